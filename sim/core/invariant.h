/* Predicates for assertions: what a precondition or an invariant asks of a value.
 *
 * Assertions are for errors of the program. What a user, a file, a plug-in or another program gives
 * is checked with a bst_status and a message instead. */
#ifndef BST_CORE_INVARIANT_H
#define BST_CORE_INVARIANT_H

#include <stdbool.h>
#include <stddef.h>

#include "boresight/vec.h"

/* Deviation of a squared norm from 1 that is allowed of a unit vector or quaternion: 1e-9 of the
 * norm, some thousand products of rotations. */
#define BST_UNIT_TOLERANCE 2e-9
/* The same where the value may come from another program: the link allows 5e-7 of the norm. */
#define BST_LINK_UNIT_TOLERANCE 1.1e-6

/* All components are finite. */
static inline bool bst_is_finite_vec3(bst_vec3 v) {
    return isfinite(v.x) && isfinite(v.y) && isfinite(v.z);
}
/* |v| = 1 to `tolerance` of the squared norm; false for NAN. */
static inline bool bst_is_unit_vec3(bst_vec3 v, double tolerance) {
    return fabs(bst_vec3_dot(v, v) - 1.0) <= tolerance;
}
/* |q| = 1 to `tolerance` of the squared norm; false for NAN. */
static inline bool bst_is_unit_quat(bst_quat q, double tolerance) {
    return fabs(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w - 1.0) <= tolerance;
}
/* A variance or a standard deviation: finite and not negative. */
static inline bool bst_is_variance(double v) {
    return isfinite(v) && v >= 0.0;
}
/* Finite and greater than 0. */
static inline bool bst_is_positive(double v) {
    return isfinite(v) && v > 0.0;
}
/* A probability or another share: 0 to 1. */
static inline bool bst_is_share(double v) {
    return v >= 0.0 && v <= 1.0;
}
/* The n x n matrix p, row-major, is finite with a diagonal that is not negative. */
static inline bool bst_is_covariance(const double *p, int n) {
    for (int i = 0; i < n * n; i++) {
        if (!isfinite(p[i])) {
            return false;
        }
    }
    for (int i = 0; i < n; i++) {
        if (!(p[i * n + i] >= 0.0)) {
            return false;
        }
    }
    return true;
}
/* The first `count` values ascend; equal neighbours are allowed. */
static inline bool bst_is_ascending(const double *values, int count) {
    for (int i = 1; i < count; i++) {
        if (!(values[i - 1] <= values[i])) {
            return false;
        }
    }
    return true;
}

#endif
