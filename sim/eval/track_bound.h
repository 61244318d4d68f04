/* Posterior Cramer-Rao bound of a track: direction and angular rate on the sky. */
#ifndef BST_EVAL_TRACK_BOUND_H
#define BST_EVAL_TRACK_BOUND_H

#include <stdbool.h>

/* Fisher information of direction and rate along and across the track: order d_along, d_across,
 * r_along, r_across; rad^-2, s rad^-2, s^2 rad^-2. */
typedef struct bst_track_bound {
    double information[4][4];
} bst_track_bound;

/* Initial bound from two measurements dt_s > 0 apart without prior information: covariances r1 and
 * r2 (11, 12, 22 along and across the track, rad^2), white acceleration of power spectral density
 * noise_rad2ps3. False: singular. */
bool bst_track_bound_start(bst_track_bound *bound, const double r1[3], const double r2[3],
                           double dt_s, double noise_rad2ps3);

/* One step of the recursion of Tichavsky, Muravchik and Nehorai (IEEE Trans. SP 46, 1998), which
 * for linear motion with noise is J' = (Q + F J^-1 F^T)^-1 + factor H^T R^-1 H: dt_s onward along a
 * great circle at rate_radps, then a measurement of covariance r (as above). factor: mean remaining
 * fraction of a measurement's information, bst_eval_information_factor; or 1 with and 0 without a
 * detection, for the bound conditioned on detections. False: singular. */
bool bst_track_bound_step(bst_track_bound *bound, double dt_s, double rate_radps,
                          double noise_rad2ps3, const double r[3], double factor);

/* Covariance from the bound's information matrix; false: singular. */
bool bst_track_bound_covariance(const bst_track_bound *bound, double covariance[4][4]);

/* The information reduction factor of a two-dimensional normal measurement with probability of
 * detection pd among Poisson false alarms of `density` per unit area, the unit being sqrt(det R),
 * so that density = (false alarms per steradian) * sqrt(det R) (Zhang and Willett, IEEE Trans. AES
 * 37, 2001; Niu, Willett and Bar-Shalom, same volume): the variance of the score of the likelihood
 * (1 - pd) + pd / density * sum of phi(z_i). pd without false alarms. 0 < pd <= 1, density >= 0.
 * Computed from a fixed set of 2e5 pseudo-random draws: relative error about 0.003. */
double bst_eval_information_factor(double pd, double density);

#endif
