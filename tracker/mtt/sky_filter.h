/* Extended Kalman filter of a direction and its rate on the celestial sphere.
 *
 * Mean: unit direction d and rate r (perpendicular to d) as 3-vectors. Covariance: 4x4 in the
 * tangent axes at d (bst_tangent_at), order d1, d2, r1, r2. Motion: constant rate along a great
 * circle, driven by white acceleration. It has no singularities, because the axes are
 * parallel-transported. */
#ifndef BST_TRACKER_MTT_SKY_FILTER_H
#define BST_TRACKER_MTT_SKY_FILTER_H

#include <stdbool.h>

#include "sim/core/tangent.h"

typedef struct bst_sky_state {
    bst_vec3 direction;      /* unit */
    bst_vec3 rate_radps;     /* perpendicular to direction */
    double covariance[4][4]; /* rad^2, rad^2/s, rad^2/s^2 */
} bst_sky_state;

/* A measured direction with its covariance in the tangent axes at that direction, rad^2. */
typedef struct bst_sky_measurement {
    bst_vec3 direction; /* unit */
    double cov_11, cov_12, cov_22;
} bst_sky_measurement;

/* Innovation of a measurement in the tangent axes at the predicted state's direction. */
typedef struct bst_sky_innovation {
    double nu[2];      /* rad */
    double r[3], s[3]; /* 11, 12, 22 of the measurement's and the innovation's covariance, rad^2 */
    double chi2;       /* nu^T S^-1 nu */
    double log_det_s;  /* ln det S */
} bst_sky_innovation;

/* Predicts the state over dt_s (any sign; noise is added for |dt_s|).
 *
 * Given:     noise_rad2ps3  power spectral density of the acceleration
 * Notes:     The covariance follows the Jacobi equation of the unit sphere: linear along the track,
 *            J'' + |r|^2 J = 0 across it.
 * Reference: do Carmo, Riemannian Geometry, chapter 5 */
void bst_sky_predict(bst_sky_state *state, double dt_s, double noise_rad2ps3);

/* Adds the process noise of white acceleration over |dt_s|: noise [dt^3/3, dt^2/2; dt^2/2, dt] per
 * axis (Bar-Shalom, Li and Kirubarajan 2001, eq. 6.2.2-12). */
void bst_sky_add_noise(bst_sky_state *state, double dt_s, double noise_rad2ps3);

/* Shifts the mean by tangent vectors (components along the direction are dropped), for a known
 * acceleration. The covariance is parallel-transported. */
void bst_sky_shift(bst_sky_state *state, bst_vec3 direction_rad, bst_vec3 rate_radps);

/* Innovation of a direction measurement. Returns false if S is not positive definite.
 *
 * Given:     extra  added covariance (11, 12, 22 in the state's tangent axes, rad^2); NULL: none */
bool bst_sky_innovate(const bst_sky_state *state, const bst_sky_measurement *measurement,
                      const double extra[3], bst_sky_innovation *out);

/* Kalman update in Joseph form (Bucy and Joseph 1968), symmetric afterwards. */
void bst_sky_update(bst_sky_state *state, const bst_sky_innovation *innovation);

/* Two-point initiation: state from two measurements dt_s > 0 apart, at the time of the second. */
void bst_sky_from_pair(const bst_sky_measurement *first, const bst_sky_measurement *second,
                       double dt_s, double noise_rad2ps3, bst_sky_state *out);

/* Difference b - a of two means in the tangent axes at a: direction, then rate. */
void bst_sky_difference(const bst_sky_state *a, const bst_sky_state *b, double out[4]);

/* One step of the Rauch-Tung-Striebel smoother: the state at a time given all later measurements.
 *
 * Given:     filtered   state given the measurements up to its time
 *            dt_s       time to the next state, > 0
 *            predicted  prediction of the next state that its update used, known shifts and all
 *                       process noise included
 *            next       the next state, smoothed
 * Returned:  false if a covariance is not positive definite; then *out is the filtered state
 * Notes:     process noise enters through `predicted` alone. For a mixture the moments of all its
 *            components together give the best linear smoother, because they share the transition.
 * Reference: Rauch, Tung and Striebel 1965; Bar-Shalom, Li and Kirubarajan 2001, section 8.6 */
bool bst_sky_smooth(const bst_sky_state *filtered, double dt_s, const bst_sky_state *predicted,
                    const bst_sky_state *next, bst_sky_state *out);

/* Mahalanobis distance (a - b)^T (Pa + Pb)^-1 (a - b) over direction and rate, 4 degrees of
 * freedom. INFINITY if the sum of covariances is not positive definite or the directions are more
 * than 0.2 rad apart. */
double bst_sky_distance2(const bst_sky_state *a, const bst_sky_state *b);

/* Covariance of the state in the tangent axes of another direction nearby (parallel-transported).
 */
void bst_sky_turn_covariance(const bst_sky_state *state, bst_vec3 direction, double out[4][4]);

#endif
