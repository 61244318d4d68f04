/* The part of a surface's light that other bodies take, by lines on it. Internal to sim/satellite.
 */
#ifndef BST_SATELLITE_SURFACE_SHADOW_H
#define BST_SATELLITE_SURFACE_SHADOW_H

#include "sim/satellite/pose.h"

/* Share of the light of a curved surface that leaves it for the observer although other bodies
 * stand between it and the Sun or the observer.
 *
 * Given:     pose       bst_pose_look has prepared view 0 toward the observer and view 1 toward the
 *                       Sun
 *            curved     index of the surface
 *            light_m2   its light without shadows, over the scale of its material, m^2/sr
 *            disc       light_m2 is the mean over the Sun's disc
 *            tolerance  error of the share that one panel of azimuth may have
 * Returned:  0 to 1; exactly 1 if no body is in the way
 *            *error  estimate of the error of the share
 * Notes:     integrated over the round surface itself, along lines of its axis for cylinders and
 *            cones, and along chords of meridians for spheres: bst_line_shadow_lost. Chords end at
 *            borders of bands of latitude that become finer about the specular lobe; light is
 * linear in each. Over azimuth, three-point Gauss quadrature in panels between the azimuths of
 *            bst_surface_find_places, halved until it agrees with the rule of the middle; where a
 *            shadow begins at once its place is found by halving. The error is the sum of what the
 *            rules still differ by, of what jumps may be off, and, but for a disc, of what the
 *            light by the same points differs from light_m2. */
double bst_curved_free_share(bst_satellite_pose *pose, int curved, double light_m2, bool disc,
                             double tolerance, double *error);

/* True if a plane facet has a round border, or round bodies may hide some of it: shadows of
 * bst_pose_unshadowed_area then have the borders of polygons.
 *
 * Given:     pose  as above */
bool bst_plane_is_round(const bst_satellite_pose *pose, int facet);

/* True if bst_plane_free_share can integrate a facet: one with at most 7 corners, or the round end
 * of a body. */
bool bst_plane_has_lines(const bst_satellite_pose *pose, int facet);

/* Share of a plane facet that is free, with round borders: as bst_curved_free_share, along chords
 * of the facet. */
double bst_plane_free_share(bst_satellite_pose *pose, int facet, double tolerance, double *error);

#endif
