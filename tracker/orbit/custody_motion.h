/* States that a filter of custody.h stands for. */
#ifndef BST_TRACKER_ORBIT_CUSTODY_MOTION_H
#define BST_TRACKER_ORBIT_CUSTODY_MOTION_H

#include "tracker/orbit/custody.h"

/* Distance of the states that a measurement is predicted for from the middle one, in standard
 * deviations along the columns of the covariance's root: with its square 3, the kurtosis of a
 * normal distribution, second differences give the second moments of a quadratic function exactly
 * (Norgaard, Poulsen and Ravn, "New developments in state estimation for nonlinear systems",
 * Automatica 36, 2000). */
#define BST_CUSTODY_SPREAD 1.7320508075688772

/* States at some times on the elements that differ from the catalogued ones by x.
 *
 * Given:     derivative  the velocity is that of the positions (bst_sgp4_motion), not SGP4's own.
 *                        Near-Earth orbits of scenarios/objects_2022-06.tle differ by 0.02 m/s in
 *                        the mean, and by up to 7 m/s in the last days before their decay
 *            time_s      [count] since the epoch of the run
 * Returned:  r, v        [count] TEME, m and m/s; false: there are none */
bool bst_custody_motion(const bst_custody_orbit *orbit, const double x[BST_CUSTODY_STATE],
                        bool derivative, int count, const double *time_s, bst_vec3 *r, bst_vec3 *v);

#endif
