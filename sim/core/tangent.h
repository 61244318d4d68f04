/* Tangent planes of the unit sphere: axes, exponential and logarithm map, parallel transport. The
 * only singularity is at antipodal points. */
#ifndef BST_SIM_CORE_TANGENT_H
#define BST_SIM_CORE_TANGENT_H

#include "boresight/vec.h"

/* Axes of the tangent plane at a unit vector. */
typedef struct bst_tangent {
    bst_vec3 e1, e2;
} bst_tangent;

/* Distance from the z axis below which the axes are built from x instead of z. */
#define BST_TANGENT_POLE 1e-6

/* Axes of the tangent plane as in bst_track: e1 = unit(z x d), or unit(x x d) within
 * BST_TANGENT_POLE of a pole; e2 = d x e1. */
static inline bst_tangent bst_tangent_at(bst_vec3 d) {
    bst_tangent t;
    t.e1 = hypot(d.x, d.y) < BST_TANGENT_POLE ? bst_vec3_make(0.0, -d.z, d.y)
                                              : bst_vec3_make(-d.y, d.x, 0.0);
    t.e1 = bst_vec3_unit(t.e1);
    t.e2 = bst_vec3_cross(d, t.e1);
    return t;
}

/* Tangent vector of two components. */
static inline bst_vec3 bst_tangent_vector(const bst_tangent *t, double a1, double a2) {
    return bst_vec3_axpy(bst_vec3_scale(t->e1, a1), a2, t->e2);
}

/* Projects v on the tangent plane at unit vector d. */
static inline bst_vec3 bst_tangent_project(bst_vec3 d, bst_vec3 v) {
    return bst_vec3_axpy(v, -bst_vec3_dot(d, v), d);
}

/* Exponential map: the point at distance |v| rad from unit vector d along tangent vector v. */
static inline bst_vec3 bst_tangent_exp(bst_vec3 d, bst_vec3 v) {
    double angle = bst_vec3_norm(v);
    double s = angle > 1e-4 ? sin(angle) / angle : 1.0 - angle * angle / 6.0;
    return bst_vec3_unit(bst_vec3_axpy(bst_vec3_scale(d, cos(angle)), s, v));
}

/* Logarithm map: the tangent vector at d that leads to unit vector b. */
static inline bst_vec3 bst_tangent_log(bst_vec3 d, bst_vec3 b) {
    bst_vec3 across = bst_tangent_project(d, bst_vec3_sub(b, d));
    double s = bst_vec3_norm(across);
    double angle = atan2(s, bst_vec3_dot(d, b));
    return s > 0.0 ? bst_vec3_scale(across, angle / s) : across;
}

/* Parallel transport of tangent vector v from unit vector a to b along the great circle. */
static inline bst_vec3 bst_tangent_carry(bst_vec3 a, bst_vec3 b, bst_vec3 v) {
    double f = bst_vec3_dot(b, v) / (1.0 + bst_vec3_dot(a, b));
    return bst_tangent_project(b, bst_vec3_axpy(v, -f, bst_vec3_add(a, b)));
}

/* Rotation between tangent axes: cosine and sine of the angle from axes `from` at a,
 * parallel-transported to b, to axes `to` at b. Components become (c v1 + s v2, -s v1 + c v2). */
static inline void bst_tangent_turn(bst_vec3 a, const bst_tangent *from, bst_vec3 b,
                                    const bst_tangent *to, double *c, double *s) {
    bst_vec3 e1 = bst_tangent_carry(a, b, from->e1);
    double x = bst_vec3_dot(e1, to->e1), y = bst_vec3_dot(e1, to->e2);
    double n = hypot(x, y);
    *c = n > 0.0 ? x / n : 1.0;
    *s = n > 0.0 ? -y / n : 0.0;
}

/* Covariance (11, 12, 22) in the tangent axes `from` at a, turned to the axes `to` at b. */
static inline void bst_tangent_turn_covariance(bst_vec3 a, const bst_tangent *from, bst_vec3 b,
                                               const bst_tangent *to, const double cov[3],
                                               double out[3]) {
    double c, s;
    bst_tangent_turn(a, from, b, to, &c, &s);
    out[0] = c * c * cov[0] + 2 * c * s * cov[1] + s * s * cov[2];
    out[1] = -c * s * cov[0] + (c * c - s * s) * cov[1] + c * s * cov[2];
    out[2] = s * s * cov[0] - 2 * c * s * cov[1] + c * c * cov[2];
}

#endif
