/* Simplified camera motion: one shift shared by all stars, and the exposure in equal parts. */
#ifndef BST_SCENEGEN_SMEAR_MOTION_H
#define BST_SCENEGEN_SMEAR_MOTION_H

#include "boresight/vec.h"
#include "scenegen/smear/smear_quadrature.h"
#include "sim/world/scene/field.h"

/* Largest difference, px, between the motion of a star at the sensor's corner and at the boresight:
 * by roll, and by tangent-plane stretch (X^2 T in tangents for a tilt T).
 *
 * Given:     path       [count] rotations from the reference attitude: two tilts in px (times
 *                       `stretch`) and roll in px at roll_px from the boresight
 *            scale_rad  per px
 *            corner_px  corner distance from the boresight, undistorted */
double bst_motion_spread_px(const bst_smear_path_point *path, int count, double scale_rad,
                            double stretch, double roll_px, double corner_px);

/* Replaces such a rotation by the shift of a star at the boresight, x and y in px (times
 * `stretch`). */
void bst_motion_to_shift(bst_smear_path_point *point, double scale_rad, double stretch,
                         double roll_px);

/* Returns true if a path rests: if a piece of it within reach_px / 4, or reach_px, has more than
 * 0.6 of the light of any piece within four times as much. Of a long uniform motion it has a
 * quarter. A path that reverses, and a uniform one of less than 1.7 reach_px, may count as rests.
 *
 * Given:     path  [count] in the order of time, count >= 1
 * Notes:     Pieces follow each other in time: a jitter of more than reach_px / 4 may hide a rest.
 */
bool bst_motion_rests(const bst_smear_path_point *path, int count, double reach_px);

/* Appends `parts` >= 1 nodes of equal weight at the midpoints of equal parts of the path's time;
 * count >= 2. Errors: BST_ERR_MEMORY. */
bst_status bst_motion_midpoints(bst_ctx *ctx, const bst_smear_path_point *path, int count,
                                int parts, bst_smear_node_list *list) BST_MUST_CHECK;

/* Largest share of a source's light in one pixel when smeared over nodes[count], for a PSF centred
 * on a pixel; uses at most 128 positions of the path. */
double bst_smear_nodes_peak_share(const bst_smear_node *nodes, int count, double psf_sigma_px);

/* Properties of nodes that add up over an image: bounds of errors, predicted errors, widenings. */
enum { BST_PART_BOUND, BST_PART_PREDICTED, BST_PART_WIDENING, BST_NODE_PARTS };

/* Largest sums of properties over a smeared image, over its peak, relative to that of the worst
 * node: 1 if all nodes are equal, less if the worst are faint for their speed.
 *
 * Given:     widening  that of the widenings matters
 * Returned:  part      of the bounds of errors, the predicted errors and the widenings */
void bst_smear_nodes_parts(const bst_smear_node *nodes, int count, double psf_sigma_px,
                           bool widening, double part[BST_NODE_PARTS]);

/* Part of an interval between two track samples over which a source's brightness is smooth. The
 * interval begins at begin_s of duration_s and takes length_s.
 *
 * Given:     from  fraction at which the part starts
 * Returned:  fraction at which it ends: 1 or the source's next brightness knot
 *            *parts  number of pieces needed to follow its brightness */
double bst_motion_stretch(const bst_scene_source *source, double begin_s, double length_s,
                          double duration_s, double from, int *parts);

#endif
