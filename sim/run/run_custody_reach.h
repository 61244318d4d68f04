/* Which objects may be on a line of sight, by their tabulated positions and the uncertainty of
 * their orbits. Internal to sim/run. */
#ifndef BST_RUN_CUSTODY_REACH_H
#define BST_RUN_CUSTODY_REACH_H

#include "tracker/orbit/custody.h"

/* Distance of an object's tabulated position from a line of sight beyond which it is not on it, m.
 * From one time to another it is largest at one of them: the variance is a quadratic function of
 * time with one minimum. */
double bst_run_reach_of(const bst_custody_orbit *orbit, const bst_custody_filter *filter,
                        double time_s);

/* Whether an object at a tabulated position (m, GCRF; NAN: unknown) may be on the line of sight. */
bool bst_run_reach_holds(double reach_m, bst_vec3 place, const bst_custody_observation *z);

/* Most objects of one bst_run_reach_any. */
enum { BST_RUN_REACH_BLOCK = 512 };

/* bst_run_reach_holds of objects begin to begin + n.
 *
 * Given:     place_m, reach_m  of all objects
 *            n                 at most BST_RUN_REACH_BLOCK
 * Returned:  whether one of them may be on it; out: [n] 1: it may be, 0: it is not */
bool bst_run_reach_any(double *const place_m[3], const double *reach_m, int begin, int n,
                       const bst_custody_observation *z, int *out);

#endif
