/* Photocentre of a star blended with its neighbours. */
#ifndef BST_TRACKER_ATTITUDE_PHOTOCENTRE_H
#define BST_TRACKER_ATTITUDE_PHOTOCENTRE_H

#include "sim/catalogue/stars.h"

/* Flux-weighted mean direction (unit, ICRS) of a star and of those of near[count] that lie within
 * radius_rad of it; the star itself may be among them. */
bst_vec3 bst_photocentre(const bst_star *star, const bst_star *near, int count, double radius_rad);

#endif
