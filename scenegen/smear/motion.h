/* The camera's motion in other ways than each star's own track: one shift that all stars share, and
 * the classic cut of the exposure into equal parts. */
#ifndef BST_SCENEGEN_SMEAR_MOTION_H
#define BST_SCENEGEN_SMEAR_MOTION_H

#include "boresight/vec.h"
#include "scenegen/smear/smear_quadrature.h"
#include "sim/world/scene/field.h"

/* How far, at most, a star at the sensor's corner (corner_px from the boresight, undistorted) moves
 * otherwise than the star at the boresight does, px: by roll, and by the tangent plane's stretch,
 * X^2 T in tangents for a tilt T. path[count]: turns from the reference attitude, two tilts in px
 * (times `stretch`) and roll in px at roll_px from the boresight; scale_rad per px. */
double bst_motion_spread_px(const bst_smear_path_point *path, int count, double scale_rad,
                            double stretch, double roll_px, double corner_px);

/* Puts in place of such a turn the shift of the star at the boresight, x and y in px (times
 * `stretch`). */
void bst_motion_to_shift(bst_smear_path_point *point, double scale_rad, double stretch,
                         double roll_px);

/* Appends `parts` >= 1 nodes of equal weight at the midpoints of equal parts of the path's time;
 * count >= 2. BST_ERR_MEMORY. */
bst_status bst_motion_midpoints(bst_ctx *ctx, const bst_smear_path_point *path, int count,
                                int parts, bst_smear_node_list *list) BST_MUST_CHECK;

/* Largest share of a source's light that falls on one pixel when smeared over nodes[count], PSF
 * centred on a pixel at best; takes at most 128 places of the path. */
double bst_smear_nodes_peak_share(const bst_smear_node *nodes, int count, double psf_sigma_px);

/* The largest error of a smeared image over its peak, by groups where they are, as part of that of
 * the worst group: 1 where all have the same, less where the worst are faint for their speed. */
double bst_smear_nodes_error_part(const bst_smear_node *nodes, int count, double psf_sigma_px);

/* Of the way between two samples of the track, which begins at begin_s of duration_s and takes
 * length_s: the stretch that begins at the share `from` and ends at the share that is returned, 1
 * or that of the source's next knot of brightness. *parts: as many as it takes to follow its light.
 */
double bst_motion_stretch(const bst_scene_source *source, double begin_s, double length_s,
                          double duration_s, double from, int *parts);

#endif
