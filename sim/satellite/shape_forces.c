#include "sim/satellite/shape_forces.h"

#include <assert.h>
#include <pthread.h>
#include <stdlib.h>

struct bst_shape_forces {
    pthread_mutex_t lock;
    bst_satellite_pose *pose;
    const bst_body_attitude *attitude;
    bst_force_surface surface;
};

/* Reflectance of a facet's material for a beam: diffuse part and mirror part. */
static void reflectance(const bst_satellite *s, int material, double cosine, double *diffuse,
                        double *mirror) {
    const double *table = s->surfaces[material].reflectance;
    double at = fmin(fmax(cosine, 0.0), 1.0) * (BST_REFLECTANCE_POINTS - 1);
    int k = (int)fmin(at, BST_REFLECTANCE_POINTS - 2.0);
    double all = table[k] + (at - k) * (table[k + 1] - table[k]);
    double normal = table[BST_REFLECTANCE_POINTS - 1];
    double scale = normal > 0.0 ? (1.0 - s->surfaces[material].absorptance) / normal : 0.0;
    all = fmin(all * scale, 1.0);
    *diffuse = fmin(s->materials[material].brdf.diffuse * scale, all);
    *mirror = all - *diffuse;
}

bst_vec3 bst_shape_light_area_m2(bst_satellite_pose *p, bst_vec3 sun) {
    const bst_satellite *s = p->satellite;
    assert(s->has_surfaces);
    bst_vec3 sum = {0.0, 0.0, 0.0};
    bst_pose_look(p, 0, sun);
    for (int i = 0; i < s->facet_count; i++) {
        double cosine = bst_vec3_dot(p->normals[i], sun), diffuse, mirror;
        if (!(cosine > 1e-9)) {
            continue;
        }
        double area = bst_pose_unshadowed_area(p, i, 1) * cosine;
        reflectance(s, s->facets[i].material, cosine, &diffuse, &mirror);
        sum = bst_vec3_axpy(sum, -area * (1.0 - mirror), sun);
        sum = bst_vec3_axpy(sum, -2.0 * area * (mirror * cosine + diffuse / 3.0), p->normals[i]);
    }
    return sum;
}

double bst_shape_silhouette_m2(bst_satellite_pose *p, bst_vec3 direction) {
    const bst_satellite *s = p->satellite;
    double sum = 0.0;
    bst_pose_look(p, 0, direction);
    for (int i = 0; i < s->facet_count; i++) {
        double cosine = bst_vec3_dot(p->normals[i], direction);
        sum += cosine > 1e-9 ? bst_pose_unshadowed_area(p, i, 1) * cosine : 0.0;
    }
    return sum;
}

/* Adds the area of a polygon and its first moments. */
static void add_polygon(const bst_point2 *p, int count, double sum[3]) {
    for (int i = 1; i + 1 < count; i++) {
        double ax = p[i].x - p[0].x, ay = p[i].y - p[0].y;
        double bx = p[i + 1].x - p[0].x, by = p[i + 1].y - p[0].y;
        double area = 0.5 * (ax * by - ay * bx);
        sum[0] += area;
        sum[1] += area * (p[0].x + p[i].x + p[i + 1].x) / 3.0;
        sum[2] += area * (p[0].y + p[i].y + p[i + 1].y) / 3.0;
    }
}

/* Centroid of the area that bst_pose_unshadowed left of a facet. */
static bst_vec3 centroid_of(bst_satellite_pose *p, int facet, bool whole) {
    const bst_facet *f = &p->satellite->facets[facet];
    bst_vec3 origin, e1, e2;
    double sum[3] = {0.0, 0.0, 0.0};
    bst_pose_facet_axes(p, facet, &origin, &e1, &e2);
    for (int i = 1; whole && i + 1 < f->count; i++) {
        const bst_point2 zero = {0.0, 0.0};
        bst_point2 corner[3] = {zero, zero, zero};
        for (int k = 1; k < 3; k++) {
            int vertex = p->satellite->corner[f->first + i + k - 1];
            bst_vec3 r = bst_vec3_sub(p->vertices[vertex], origin);
            corner[k] = (bst_point2){bst_vec3_dot(r, e1), bst_vec3_dot(r, e2)};
        }
        add_polygon(corner, 3, sum);
    }
    for (int i = 0; !whole && i < p->clip.piece_count; i++) {
        const bst_polygon_piece *piece = &p->clip.pieces[i];
        add_polygon(p->clip.points + piece->first, piece->count, sum);
    }
    if (!(sum[0] > 0.0)) {
        return origin;
    }
    return bst_vec3_axpy(bst_vec3_axpy(origin, sum[1] / sum[0], e1), sum[2] / sum[0], e2);
}

static void add_load(bst_shape_load *sum, bst_vec3 force, bst_vec3 lever_m) {
    sum->force = bst_vec3_add(sum->force, force);
    sum->torque = bst_vec3_add(sum->torque, bst_vec3_cross(lever_m, force));
}

bst_shape_load bst_shape_light_load(bst_satellite_pose *p, bst_vec3 sun, bst_vec3 centre_m) {
    const bst_satellite *s = p->satellite;
    bst_shape_load sum = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    assert(s->has_surfaces);
    bst_pose_look(p, 0, sun);
    for (int i = 0; i < s->facet_count; i++) {
        double cosine = bst_vec3_dot(p->normals[i], sun), diffuse, mirror;
        bool whole;
        double area = cosine > 1e-9 ? bst_pose_unshadowed(p, i, 1, &whole) * cosine : 0.0;
        if (area > 0.0) {
            reflectance(s, s->facets[i].material, cosine, &diffuse, &mirror);
            bst_vec3 force = bst_vec3_scale(sun, -area * (1.0 - mirror));
            force = bst_vec3_axpy(force, -2.0 * area * (mirror * cosine + diffuse / 3.0),
                                  p->normals[i]);
            add_load(&sum, force, bst_vec3_sub(centroid_of(p, i, whole), centre_m));
        }
    }
    return sum;
}

bst_shape_load bst_shape_drag_load(bst_satellite_pose *p, bst_vec3 ahead, bst_vec3 centre_m) {
    const bst_satellite *s = p->satellite;
    bst_shape_load sum = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    bst_pose_look(p, 0, ahead);
    for (int i = 0; i < s->facet_count; i++) {
        double cosine = bst_vec3_dot(p->normals[i], ahead);
        bool whole;
        double area = cosine > 1e-9 ? bst_pose_unshadowed(p, i, 1, &whole) * cosine : 0.0;
        if (area > 0.0) {
            add_load(&sum, bst_vec3_scale(ahead, -area),
                     bst_vec3_sub(centroid_of(p, i, whole), centre_m));
        }
    }
    return sum;
}

/* Places the pose; q_body_from_gcrf. */
static bst_quat place(const bst_shape_forces *f, const bst_force_state *at) {
    bst_attitude_state state = {at->position_m, at->velocity_mps, at->sun, at->seconds};
    bst_quat q = bst_body_attitude_at(f->attitude, &state);
    bst_vec3 earth = bst_quat_rotate(q, bst_vec3_unit(bst_vec3_scale(at->position_m, -1.0)));
    bst_satellite_aim aim = {.sun = bst_quat_rotate(q, at->sun),
                             .earth = earth,
                             .target = earth,
                             .seconds = at->seconds};
    bst_satellite_pose_set(f->pose, &aim);
    return q;
}

static bst_vec3 light_area(void *user, const bst_force_state *at) {
    bst_shape_forces *f = user;
    pthread_mutex_lock(&f->lock);
    bst_quat q = place(f, at);
    bst_vec3 area = bst_shape_light_area_m2(f->pose, bst_quat_rotate(q, at->sun));
    pthread_mutex_unlock(&f->lock);
    return bst_quat_rotate(bst_quat_conj(q), area);
}

static double drag_area(void *user, const bst_force_state *at, bst_vec3 ahead) {
    bst_shape_forces *f = user;
    pthread_mutex_lock(&f->lock);
    bst_quat q = place(f, at);
    double area = bst_shape_silhouette_m2(f->pose, bst_quat_rotate(q, ahead));
    pthread_mutex_unlock(&f->lock);
    return area;
}

bst_status bst_shape_forces_create(bst_ctx *ctx, const bst_satellite *satellite,
                                   const bst_body_attitude *attitude, const double *burn_s,
                                   int burn_count, bst_shape_forces **out) {
    bst_shape_forces *f = *out = calloc(1, sizeof *f);
    if (!f) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the forces on a shape");
    }
    pthread_mutex_init(&f->lock, NULL);
    f->attitude = attitude;
    f->surface =
        (bst_force_surface){.light_area_m2 = light_area, .drag_area_m2 = drag_area, .user = f};
    bst_status status = bst_satellite_pose_create(ctx, satellite, &f->pose);
    if (status != BST_OK) {
        bst_shape_forces_free(f);
        *out = NULL;
        return status;
    }
    f->pose->burn_s = burn_s;
    f->pose->burn_count = burn_count;
    return BST_OK;
}

void bst_shape_forces_free(bst_shape_forces *f) {
    if (f) {
        pthread_mutex_destroy(&f->lock);
        bst_satellite_pose_free(f->pose);
        free(f);
    }
}

const bst_force_surface *bst_shape_forces_surface(const bst_shape_forces *f) {
    return &f->surface;
}
