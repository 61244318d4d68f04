/* Shadows on parts of curved surfaces, which are finer than the model's facets. Internal to
 * sim/satellite. */
#ifndef BST_SATELLITE_PART_SHADOW_H
#define BST_SATELLITE_PART_SHADOW_H

#include "sim/satellite/pose.h"

/* Finds the bodies that may shadow the parts of a facet of a curved surface.
 *
 * Given:     view   that bst_pose_look prepared toward the light
 * Returned:  *hiders  set of bodies
 *            false: the model has too many bodies, or the facet may be within a shell of another
 *            body: bst_pose_unshadowed has to do */
bool bst_part_shadow_hiders(bst_satellite_pose *pose, int view, int facet, uint64_t *hiders);

/* Fraction of a part of that facet that the light reaches, of its area as seen from there.
 *
 * Given:     corner  [4] of the part, body frame
 * Returned:  flat  [4] the corners along the view's x and y; pose->clip has the lit pieces in the
 *                  same coordinates if the fraction is between 0 and 1 */
double bst_part_shadow_lit(bst_satellite_pose *pose, int view, int facet, uint64_t hiders,
                           const bst_vec3 corner[4], bst_point2 flat[4]);

#endif
