/* Directions of an arc that do not fit the others. */
#ifndef BST_TRACKER_ORBIT_ARC_OUTLIERS_H
#define BST_TRACKER_ORBIT_ARC_OUTLIERS_H

#include "tracker/orbit/custody.h"

/* Direction that fits worst, if it is an outlier: its chi-square (2 degrees of freedom) exceeds 25
 * and ten times the median of all. -1: none.
 *
 * Given:     chi2  [count] up to BST_CUSTODY_DIRECTIONS */
int bst_arc_outlier(const double *chi2, int count);

/* Removes a direction; the change of shared errors over it is that of both of its intervals.
 *
 * Given:     directions  [count]; one fewer afterwards */
void bst_arc_drop(bst_od_observation *directions, int count, int index);

#endif
