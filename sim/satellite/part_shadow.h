/* Shadows on parts of curved surfaces, and on plane facets with a round border, which are finer
 * than the model's facets. Internal to sim/satellite. */
#ifndef BST_SATELLITE_PART_SHADOW_H
#define BST_SATELLITE_PART_SHADOW_H

#include "sim/satellite/pose.h"

/* Finds the bodies that may shadow a facet, or the parts of one of a curved surface.
 *
 * Given:     view   that bst_pose_look prepared toward the light
 * Returned:  *hiders  set of bodies
 *            false: the model has too many bodies, or the facet may be within a shell of another
 *            body: bst_pose_unshadowed has to do */
bool bst_part_shadow_hiders(bst_satellite_pose *pose, int view, int facet, uint64_t *hiders);

/* Fraction of a part of that facet that the light reaches, of its area as seen from there.
 *
 * Given:     corner  [count] of the part, convex, body frame; at most BST_POLYGON_CORNERS_MAX
 * Returned:  flat  [count] the corners along the view's x and y; pose->clip has the lit pieces in
 *                  the same coordinates if the fraction is between 0 and 1 */
double bst_part_shadow_lit(bst_satellite_pose *pose, int view, int facet, uint64_t hiders,
                           const bst_vec3 *corner, int count, bst_point2 *flat);

#endif
