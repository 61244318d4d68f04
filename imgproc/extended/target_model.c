#include "imgproc/extended/target_model.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "sim/satellite/pose.h"

/* Least cosine between a facet's normal and the directions to Sun and observer, and that of facets
 * that are not grazing. */
static const double LEAST_COSINE = 1e-3, GRAZING_COSINE = 0.05;

struct bst_target_model {
    bst_satellite *satellite;
    bst_satellite_pose *pose;
    double cosine[BST_TARGET_DIRECTIONS], sine[BST_TARGET_DIRECTIONS];
};

static bst_status check_joints(bst_ctx *ctx, const bst_satellite *s) {
    for (int i = 0; i < s->joint_count; i++) {
        const bst_joint *j = &s->joints[i];
        bool known = j->follows == BST_JOINT_FIXED || j->follows == BST_JOINT_SUN ||
                     j->follows == BST_JOINT_TARGET;
        if (!known) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "joint \"%s\" of the target's model: its angle is not known on board; "
                            "allowed are joints that follow nothing, the Sun or the observer",
                            j->name);
        }
    }
    return BST_OK;
}

bst_status bst_target_model_load(bst_ctx *ctx, const char *path, bst_target_model **out) {
    assert(path && out);
    *out = NULL;
    bst_target_model *m = calloc(1, sizeof *m);
    if (!m) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the target's model");
    }
    bst_status status = bst_satellite_load(ctx, path, &m->satellite);
    if (status == BST_OK) {
        status = check_joints(ctx, m->satellite);
    }
    if (status == BST_OK) {
        status = bst_satellite_pose_create(ctx, m->satellite, &m->pose);
    }
    if (status != BST_OK) {
        bst_target_model_free(m);
        return status;
    }
    for (int k = 0; k < BST_TARGET_DIRECTIONS; k++) {
        double angle = 2.0 * BST_PI * k / BST_TARGET_DIRECTIONS;
        m->cosine[k] = cos(angle);
        m->sine[k] = sin(angle);
    }
    *out = m;
    return BST_OK;
}

void bst_target_model_free(bst_target_model *m) {
    if (m) {
        bst_satellite_pose_free(m->pose);
        bst_satellite_free(m->satellite);
        free(m);
    }
}

double bst_target_model_radius_m(const bst_target_model *m) {
    assert(m);
    return m->satellite->radius_m;
}

int bst_target_model_lacks(const bst_target_model *m) {
    assert(m);
    int all = m->satellite->part_count + m->satellite->material_count;
    return all < BST_TARGET_LACKS ? all : BST_TARGET_LACKS;
}

/* True if a pose says that a facet is not seen whatever its light. */
static bool lacks(const bst_target_model *m, const bst_target_pose *pose, int facet) {
    const bst_facet *f = &m->satellite->facets[facet];
    return pose->without > 0 && (f->part == pose->without - 1 ||
                                 f->material == pose->without - 1 - m->satellite->part_count);
}

/* Takes a point of the body into the outline. */
static void add_point(const bst_target_model *m, const bst_target_sight *sight, bst_vec3 p,
                      bst_target_outline *out) {
    bst_vec3 at = bst_vec3_add(bst_mat3_mul_vec(&out->local_from_body, p), out->centre_m);
    double x = at.x / (at.z * sight->scale_rad), y = at.y / (at.z * sight->scale_rad);
    for (int k = 0; k < BST_TARGET_DIRECTIONS; k++) {
        double along = m->cosine[k] * x + m->sine[k] * y;
        if (along > out->support_px[k]) {
            out->support_px[k] = along;
            out->point_m[k] = p;
        }
    }
}

/* True if a facet is bright enough to be seen. */
static bool is_seen(const bst_target_model *m, const bst_target_sight *sight, unsigned dimming,
                    int facet, const bst_satellite_aim *aim) {
    bst_vec3 normal = m->pose->normals[facet];
    double in = bst_vec3_dot(normal, aim->sun), out = bst_vec3_dot(normal, aim->target);
    if (!(out > (dimming & 1u ? GRAZING_COSINE : LEAST_COSINE)) ||
        !(in > (dimming & 2u ? GRAZING_COSINE : LEAST_COSINE))) {
        return false;
    }
    const bst_material *material = &m->satellite->materials[m->satellite->facets[facet].material];
    double brdf = bst_brdf_value(&material->brdf, in, out, bst_vec3_dot(aim->sun, aim->target));
    return sight->full_e * material->scale * brdf * in >= sight->least_e;
}

/* Takes all of a facet into the outline. */
static void add_whole(const bst_target_model *m, const bst_target_sight *sight, int facet,
                      bst_target_outline *out) {
    const bst_facet *f = &m->satellite->facets[facet];
    for (int i = 0; i < f->count; i++) {
        add_point(m, sight, m->pose->vertices[m->satellite->corner[f->first + i]], out);
    }
}

/* Takes the lit and visible part of a facet into the outline. Returns true if there is any. */
static bool add_facet(bst_target_model *m, const bst_target_sight *sight, int facet,
                      bst_target_outline *out) {
    const bst_facet *f = &m->satellite->facets[facet];
    const bst_polygon_clip *clip = &m->pose->clip;
    bool whole, any = false;
    if (!(bst_pose_unshadowed(m->pose, facet, 2, &whole) > 1e-4 * f->area_m2)) {
        return false;
    }
    if (whole) {
        add_whole(m, sight, facet, out);
        return true;
    }
    bst_vec3 origin, e1, e2;
    bst_pose_facet_axes(m->pose, facet, &origin, &e1, &e2);
    for (int i = 0; i < clip->piece_count; i++) {
        const bst_polygon_piece *piece = &clip->pieces[i];
        for (int k = 0; k < piece->count; k++) {
            bst_point2 p = clip->points[piece->first + k];
            add_point(m, sight, bst_vec3_axpy(bst_vec3_axpy(origin, p.x, e1), p.y, e2), out);
            any = true;
        }
    }
    return any;
}

bool bst_target_model_predict(bst_target_model *m, const bst_target_sight *sight,
                              const bst_target_pose *pose, bst_target_outline *out) {
    assert(m && sight && pose && out && sight->scale_rad > 0.0);
    bst_quat q = bst_quat_mul(sight->q_local_from_gcrf, bst_quat_conj(pose->q_body_from_gcrf));
    out->local_from_body = bst_quat_to_mat3(q);
    double d = pose->depth_m;
    out->centre_m =
        bst_vec3_make(d * sight->scale_rad * pose->x_px, d * sight->scale_rad * pose->y_px, d);
    if (!(d > 1.05 * m->satellite->radius_m)) {
        return false;
    }
    for (int k = 0; k < BST_TARGET_DIRECTIONS; k++) {
        out->support_px[k] = -INFINITY;
    }
    bst_vec3 eye = bst_vec3_unit(bst_vec3_scale(out->centre_m, -1.0));
    bst_satellite_aim aim = {
        .sun = bst_mat3_transpose_mul_vec(&out->local_from_body, sight->sun_local),
        .target = bst_mat3_transpose_mul_vec(&out->local_from_body, eye)};
    aim.earth = aim.target; /* no joint follows it */
    bst_satellite_pose_set(m->pose, &aim);
    bst_pose_look(m->pose, 0, aim.sun);
    bst_pose_look(m->pose, 1, aim.target);
    bool any = false;
    for (int i = 0; i < m->satellite->facet_count; i++) {
        if (pose->without == BST_TARGET_WHOLE) {
            add_whole(m, sight, i, out);
            any = true;
        } else if (!lacks(m, pose, i) && is_seen(m, sight, pose->dimming, i, &aim) &&
                   add_facet(m, sight, i, out)) {
            any = true;
        }
    }
    return any;
}
