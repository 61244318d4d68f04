/* Vectors, 3x3 matrices and quaternions.
 *
 * Conventions (docs/reference/conventions.md): quaternions are scalar last {x, y, z, w}, unit,
 * Hamilton product; q_b_from_a takes the coordinates of a vector in frame a to its coordinates in
 * frame b. Matrices are row-major. */
#ifndef BORESIGHT_VEC_H
#define BORESIGHT_VEC_H

#include <math.h>

#pragma GCC visibility push(default)

#define BST_PI 3.14159265358979323846
#define BST_ARCSEC_RAD (BST_PI / 648000.0)
#define BST_DEG_RAD (BST_PI / 180.0)
#define BST_FWHM_PER_SIGMA 2.3548200450309493 /* of a Gaussian: 2 sqrt(2 ln 2) */

typedef struct bst_vec3 {
    double x, y, z;
} bst_vec3;

typedef struct bst_quat {
    double x, y, z, w;
} bst_quat;

typedef struct bst_mat3 {
    double m[3][3];
} bst_mat3;

#define BST_QUAT_IDENTITY ((bst_quat){0.0, 0.0, 0.0, 1.0})

/* atan2(y, x), rad; by series, accurate to rounding, if |y| < 0.01 x: a few times as fast. */
static inline double bst_atan2(double y, double x) {
    if (fabs(y) < 0.01 * x) {
        double t = y / x, t2 = t * t;
        return t * (1.0 - t2 * (1.0 / 3.0 - t2 * (0.2 - t2 * (1.0 / 7.0 - t2 * (1.0 / 9.0)))));
    }
    return atan2(y, x);
}
/* Reduces an angle to (-pi, pi], rad. */
static inline double bst_wrap_angle(double angle_rad) {
    const double two_pi = 2.0 * BST_PI;
    return angle_rad - two_pi * ceil(angle_rad / two_pi - 0.5);
}
/* Vector of three components. */
static inline bst_vec3 bst_vec3_make(double x, double y, double z) {
    return (bst_vec3){x, y, z};
}
/* Vector of the three components in an array. */
static inline bst_vec3 bst_vec3_from_array(const double v[3]) {
    return (bst_vec3){v[0], v[1], v[2]};
}
/* a + b */
static inline bst_vec3 bst_vec3_add(bst_vec3 a, bst_vec3 b) {
    return (bst_vec3){a.x + b.x, a.y + b.y, a.z + b.z};
}
/* a - b */
static inline bst_vec3 bst_vec3_sub(bst_vec3 a, bst_vec3 b) {
    return (bst_vec3){a.x - b.x, a.y - b.y, a.z - b.z};
}
/* s a */
static inline bst_vec3 bst_vec3_scale(bst_vec3 a, double s) {
    return (bst_vec3){a.x * s, a.y * s, a.z * s};
}
/* a + s b */
static inline bst_vec3 bst_vec3_axpy(bst_vec3 a, double s, bst_vec3 b) {
    return (bst_vec3){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}
/* Scalar product. */
static inline double bst_vec3_dot(bst_vec3 a, bst_vec3 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
/* Vector product a x b. */
static inline bst_vec3 bst_vec3_cross(bst_vec3 a, bst_vec3 b) {
    return (bst_vec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
/* Euclidean norm. */
static inline double bst_vec3_norm(bst_vec3 a) {
    return sqrt(bst_vec3_dot(a, a));
}
/* Unit vector along a; a zero vector gives zero. */
static inline bst_vec3 bst_vec3_unit(bst_vec3 a) {
    double n = bst_vec3_norm(a);
    return n > 0.0 ? bst_vec3_scale(a, 1.0 / n) : a;
}
/* Angle between a and b, rad, in [0, pi]; accurate for parallel and antiparallel vectors. */
static inline double bst_vec3_angle(bst_vec3 a, bst_vec3 b) {
    return atan2(bst_vec3_norm(bst_vec3_cross(a, b)), bst_vec3_dot(a, b));
}
/* A unit vector perpendicular to a (a not zero): a cross the axis of its smallest component. */
static inline bst_vec3 bst_vec3_perpendicular(bst_vec3 a) {
    double ax = fabs(a.x), ay = fabs(a.y), az = fabs(a.z);
    bst_vec3 e = ax <= ay && ax <= az ? (bst_vec3){1, 0, 0}
                 : ay <= az           ? (bst_vec3){0, 1, 0}
                                      : (bst_vec3){0, 0, 1};
    return bst_vec3_unit(bst_vec3_cross(a, e));
}
/* Unit vector at a right ascension and declination, rad. */
static inline bst_vec3 bst_vec3_from_radec(double ra_rad, double dec_rad) {
    double c = cos(dec_rad);
    return (bst_vec3){c * cos(ra_rad), c * sin(ra_rad), sin(dec_rad)};
}
/* Right ascension in [0, 2 pi) and declination of v (any length), rad. */
static inline void bst_vec3_to_radec(bst_vec3 v, double *ra_rad, double *dec_rad) {
    double ra = atan2(v.y, v.x);
    *ra_rad = ra < 0.0 ? ra + 2.0 * BST_PI : ra;
    *dec_rad = atan2(v.z, hypot(v.x, v.y));
}

/* Matrix times vector: a v. */
static inline bst_vec3 bst_mat3_mul_vec(const bst_mat3 *a, bst_vec3 v) {
    return (bst_vec3){a->m[0][0] * v.x + a->m[0][1] * v.y + a->m[0][2] * v.z,
                      a->m[1][0] * v.x + a->m[1][1] * v.y + a->m[1][2] * v.z,
                      a->m[2][0] * v.x + a->m[2][1] * v.y + a->m[2][2] * v.z};
}
/* Transposed matrix times vector: a^T v. */
static inline bst_vec3 bst_mat3_transpose_mul_vec(const bst_mat3 *a, bst_vec3 v) {
    return (bst_vec3){a->m[0][0] * v.x + a->m[1][0] * v.y + a->m[2][0] * v.z,
                      a->m[0][1] * v.x + a->m[1][1] * v.y + a->m[2][1] * v.z,
                      a->m[0][2] * v.x + a->m[1][2] * v.y + a->m[2][2] * v.z};
}
/* Matrix product: a b. */
static inline bst_mat3 bst_mat3_mul(const bst_mat3 *a, const bst_mat3 *b) {
    bst_mat3 r;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            r.m[i][j] = a->m[i][0] * b->m[0][j] + a->m[i][1] * b->m[1][j] + a->m[i][2] * b->m[2][j];
        }
    }
    return r;
}
/* Transposed matrix. */
static inline bst_mat3 bst_mat3_transpose(const bst_mat3 *a) {
    bst_mat3 r;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            r.m[i][j] = a->m[j][i];
        }
    }
    return r;
}

/* Hamilton product: bst_quat_mul(q_c_from_b, q_b_from_a) = q_c_from_a. */
static inline bst_quat bst_quat_mul(bst_quat p, bst_quat q) {
    return (bst_quat){p.w * q.x + p.x * q.w + p.y * q.z - p.z * q.y,
                      p.w * q.y - p.x * q.z + p.y * q.w + p.z * q.x,
                      p.w * q.z + p.x * q.y - p.y * q.x + p.z * q.w,
                      p.w * q.w - p.x * q.x - p.y * q.y - p.z * q.z};
}
/* Conjugate; for a unit quaternion its inverse: q_b_from_a gives q_a_from_b. */
static inline bst_quat bst_quat_conj(bst_quat q) {
    return (bst_quat){-q.x, -q.y, -q.z, q.w};
}
/* Unit quaternion along q; a zero quaternion gives the identity. */
static inline bst_quat bst_quat_unit(bst_quat q) {
    double n = sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    double s = 1.0 / n;
    return n > 0.0 ? (bst_quat){q.x * s, q.y * s, q.z * s, q.w * s} : BST_QUAT_IDENTITY;
}

/* Coordinates of a vector in frame b.
 *
 * Given:     q  q_b_from_a, unit
 *            v  coordinates in frame a */
static inline bst_vec3 bst_quat_rotate(bst_quat q, bst_vec3 v) {
    bst_vec3 u = {q.x, q.y, q.z};
    bst_vec3 t = bst_vec3_scale(bst_vec3_cross(u, v), 2.0);
    return bst_vec3_add(bst_vec3_axpy(v, q.w, t), bst_vec3_cross(u, t));
}
/* Rotation matrix of a unit quaternion: R v = bst_quat_rotate(q, v). */
static inline bst_mat3 bst_quat_to_mat3(bst_quat q) {
    double x = q.x, y = q.y, z = q.z, w = q.w;
    return (bst_mat3){{{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                       {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                       {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}}};
}

/* Unit quaternion of a proper rotation matrix.
 *
 * Reference: Shepperd 1978 (largest component first) */
bst_quat bst_quat_from_mat3(const bst_mat3 *a);
/* bst_quat_from_rotvec for any r that is not zero, without the series for small angles. */
bst_quat bst_quat_from_large_rotvec(bst_vec3 r);

/* Unit quaternion of a rotation vector (exponential).
 *
 * Given:     r  axis times angle, rad; right-handed
 * Returned:  q with bst_quat_rotate(q, v) = v turned by |r| about r
 * Notes:     a frame that turns by r has q_new_from_old = bst_quat_from_rotvec(-r), see
 *            bst_quat_turn_frame. */
static inline bst_quat bst_quat_from_rotvec(bst_vec3 r) {
    double square = 0.25 * bst_vec3_dot(r, r); /* of half the angle */
    if (!(square < 2e-4)) {
        return bst_quat_from_large_rotvec(r);
    }
    /* series of sin(a/2)/a and cos(a/2), accurate to rounding for the usual small angles, where the
     * quotient would lose digits */
    double s = 0.5 - square * (1.0 / 12.0 - square * (1.0 / 240.0 - square * (1.0 / 10080.0)));
    double c =
        1.0 -
        square * (0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0 - square * (1.0 / 40320.0))));
    return (bst_quat){s * r.x, s * r.y, s * r.z, c};
}

/* Attitude of a frame after a turn about its own axes.
 *
 * Given:     q  q_old_from_a
 *            r  axis in the frame times angle, rad; right-handed
 * Returned:  q_new_from_a, not brought back to unit length */
static inline bst_quat bst_quat_turn_frame(bst_quat q, bst_vec3 r) {
    return bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(r, -1.0)), q);
}

/* Rotation vector of a unit quaternion (logarithm), |r| in [0, pi] rad. q and -q give the same
 * vector, that of the shorter turn. */
bst_vec3 bst_quat_to_rotvec(bst_quat q);

/* Spherical linear interpolation from a to b along the shorter turn.
 *
 * Given:     s  0: a, 1: b; extrapolates outside [0, 1]
 * Notes:     also correct for nearly equal attitudes and for q, -q of one attitude. */
bst_quat bst_quat_slerp(bst_quat a, bst_quat b, double s);

/* Attitude of a camera from its boresight and an approximate +x axis.
 *
 * Given:     boresight_ref  direction of +z, reference frame, any length
 *            x_hint_ref     +x lies as close to this vector as possible; reference frame, any
 *                           length
 * Returned:  q_cam_from_ref
 * Notes:     if the two are parallel, +x is an arbitrary perpendicular vector. */
bst_quat bst_quat_look(bst_vec3 boresight_ref, bst_vec3 x_hint_ref);

#pragma GCC visibility pop

#endif
