#include "sim/world/scene/occultation.h"

#include <stdlib.h>

#include "sim/astro/bodies.h"

bst_status bst_occultation_create(bst_ctx *ctx, int vertices, bst_occultation **out) {
    bst_occultation *w = *out = calloc(1, sizeof *w);
    if (!w) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for occultations");
    }
    bst_status status = bst_shape_silhouette_create(ctx, vertices, &w->body);
    status = status == BST_OK ? bst_shape_silhouette_create(ctx, vertices, &w->front) : status;
    status = status == BST_OK ? bst_polygon_clip_create(ctx, &w->clip) : status;
    if (status != BST_OK) {
        bst_occultation_free(w);
        *out = NULL;
    }
    return status;
}

void bst_occultation_free(bst_occultation *w) {
    if (w) {
        bst_shape_silhouette_free(&w->body);
        bst_shape_silhouette_free(&w->front);
        bst_polygon_clip_free(&w->clip);
        free(w);
    }
}

/* Axes across a line of sight. */
typedef struct plane {
    bst_vec3 x, y, z; /* z: unit, toward the light or the observer */
} plane;

static plane across(bst_vec3 z) {
    bst_vec3 x = bst_vec3_perpendicular(z);
    return (plane){x, bst_vec3_cross(z, x), z};
}

/* Silhouette of a body in a plane. */
static void make_silhouette(const bst_occultation_body *b, const plane *p, bst_vec3 sun_m,
                            bst_vec3 target_m, bst_shape_silhouette *out) {
    if (!b->shape) {
        bst_shape_silhouette_of_sphere(out, b->radius_m);
        return;
    }
    bst_vec3 sun = bst_vec3_unit(bst_vec3_sub(sun_m, b->position_m));
    bst_attitude_state state = {b->position_m, b->velocity_mps, sun, b->seconds};
    bst_quat q = bst_body_attitude_at(b->shape->attitude, &state);
    bst_satellite_aim aim = {
        .sun = bst_quat_rotate(q, sun),
        .earth = bst_quat_rotate(q, bst_vec3_unit(bst_vec3_scale(b->position_m, -1.0))),
        .target = bst_quat_rotate(q, bst_vec3_unit(bst_vec3_sub(target_m, b->position_m))),
        .seconds = b->seconds};
    bst_satellite_pose_set(b->pose, &aim);
    bst_shape_silhouette_of_pose(out, b->pose, bst_quat_rotate(q, p->x), bst_quat_rotate(q, p->y));
}

double bst_occultation_from_eye(bst_occultation *w, const bst_occultation_body *body,
                                const bst_occultation_body *front, bst_vec3 eye_m, bst_vec3 sun_m) {
    bst_vec3 to_eye = bst_vec3_sub(eye_m, body->position_m);
    bst_vec3 way = bst_vec3_sub(front->position_m, body->position_m);
    double range = bst_vec3_norm(to_eye);
    plane p = across(bst_vec3_scale(to_eye, 1.0 / range));
    double ahead = bst_vec3_dot(way, p.z);
    if (!(ahead > 0.0) || !(ahead < range)) {
        return 0.0;
    }
    double scale = range / (range - ahead); /* projected from the observer into the body's plane */
    bst_point2 shift = {scale * bst_vec3_dot(way, p.x), scale * bst_vec3_dot(way, p.y)};
    if (hypot(shift.x, shift.y) >= body->radius_m + scale * front->radius_m) {
        return 0.0;
    }
    make_silhouette(body, &p, sun_m, eye_m, &w->body);
    make_silhouette(front, &p, sun_m, eye_m, &w->front);
    return bst_shape_silhouette_hidden(&w->clip, &w->body, &w->front, scale, shift);
}

double bst_occultation_of_sun(bst_occultation *w, const bst_occultation_body *body,
                              const bst_occultation_body *front, bst_vec3 sun_m) {
    enum { RINGS = 4, AROUND = 12 };
    /* middles of rings of equal area; limb darkening 1 - 0.6 (1 - mu) (Cox, Allen's Astrophysical
     * Quantities, 4th edition, section 14.7) */
    static const double ring[RINGS] = {0.35, 0.61, 0.79, 0.94};
    bst_vec3 to_sun = bst_vec3_sub(sun_m, body->position_m);
    bst_vec3 way = bst_vec3_sub(front->position_m, body->position_m);
    double distance = bst_vec3_norm(to_sun), radius = BST_SUN_RADIUS_M / distance;
    plane p = across(bst_vec3_scale(to_sun, 1.0 / distance));
    double ahead = bst_vec3_dot(way, p.z);
    bst_point2 middle = {bst_vec3_dot(way, p.x), bst_vec3_dot(way, p.y)};
    if (!(ahead > 0.0) ||
        hypot(middle.x, middle.y) >= body->radius_m + front->radius_m + radius * ahead) {
        return 0.0;
    }
    make_silhouette(body, &p, sun_m, sun_m, &w->body);
    make_silhouette(front, &p, sun_m, sun_m, &w->front);
    double sum = 0.0, total = 0.0;
    for (int r = 0; r < RINGS; r++) {
        double weight = 1.0 - 0.6 * (1.0 - sqrt(1.0 - ring[r] * ring[r]));
        for (int k = 0; k < AROUND; k++) {
            double a = 2.0 * BST_PI * (k + 0.5 * r) / AROUND, off = radius * ring[r] * ahead;
            bst_point2 shift = {middle.x - off * cos(a), middle.y - off * sin(a)};
            sum += weight * bst_shape_silhouette_hidden(&w->clip, &w->body, &w->front, 1.0, shift);
            total += weight;
        }
    }
    return sum / total;
}
