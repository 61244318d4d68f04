/* Mixtures of sky states. States must lie within a radian or so of the heaviest one, in whose
 * tangent plane the moments are taken. */
#ifndef BST_TRACKER_MTT_MIXTURE_H
#define BST_TRACKER_MTT_MIXTURE_H

#include "tracker/mtt/sky_filter.h"

/* The state with mean and covariance of a mixture of `count` >= 1 states with weights (>= 0, any
 * sum > 0). `out` may be one of them. */
void bst_sky_mix(const bst_sky_state *states, const double *weights, int count, bst_sky_state *out);

/* Reduces a mixture in place to at most `keep` >= 1 components and returns their number; weights
 * sum to 1 afterwards. Components of less than 1e-4 of the whole are dropped, then those whose
 * merging changes the mixture least are merged (Runnalls, IEEE Trans. AES 43, 2007). */
int bst_sky_reduce(bst_sky_state *states, double *weights, int count, int keep);

/* bst_sky_shift by components in the tangent axes at the state: direction (rad), rate (rad/s). */
void bst_sky_shift_by(bst_sky_state *state, const double x[4]);

/* ln det; INFINITY when not positive definite. */
double bst_mixture_log_det4(const double p[4][4]);

#endif
