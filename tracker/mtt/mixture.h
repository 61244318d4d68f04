/* Gaussian mixtures of sky states. Their moments are taken in the tangent plane of the heaviest
 * state; all must lie within about a radian of it. */
#ifndef BST_TRACKER_MTT_MIXTURE_H
#define BST_TRACKER_MTT_MIXTURE_H

#include "tracker/mtt/sky_filter.h"

/* Mean and covariance of a mixture of `count` >= 1 states with weights (>= 0, any positive sum).
 * `out` may be one of the states. */
void bst_sky_mix(const bst_sky_state *states, const double *weights, int count, bst_sky_state *out);

/* Reduces a mixture in place to at most `keep` >= 1 components; the weights then sum to 1.
 * Components below 1e-4 of the total are dropped. Then the pairs whose merging changes the mixture
 * least are merged.
 *
 * Returned:  number of components
 * Reference: Runnalls, IEEE Trans. AES 43, 2007 */
int bst_sky_reduce(bst_sky_state *states, double *weights, int count, int keep);

/* Shifts a sky state by components in the tangent axes at its direction: direction (rad), then rate
 * (rad/s). */
void bst_sky_shift_by(bst_sky_state *state, const double x[4]);

/* ln of the determinant of a 4 x 4 matrix; INFINITY if it is not positive definite. */
double bst_mixture_log_det4(const double p[4][4]);

#endif
