/* True outline and attitude of objects that are rendered with their shape. */
#ifndef BST_WORLD_SCENE_SHAPE_TRUTH_H
#define BST_WORLD_SCENE_SHAPE_TRUTH_H

#include "sim/satellite/resolved_image.h"
#include "sim/world/scene/field.h"
#include "sim/world/scene/shape_light.h"

/* Work space: poses by model. All zero: empty. */
typedef struct bst_shape_truth {
    bst_satellite_pose *poses[BST_TRUTH_SHAPES];
    bst_resolved *images[BST_TRUTH_SHAPES]; /* of the same models */
    bst_shape_light light;
    bst_point2 *points, *hull;
    int capacity; /* of points */
} bst_shape_truth;

/* Frees the memory of a work space and clears the struct, which belongs to the caller. */
void bst_shape_truth_free(bst_shape_truth *work);

/* Fills truth->shapes for the items whose source has a body; those beyond BST_TRUTH_SHAPES are left
 * out.
 *
 * Given:     sources    of the field query
 *            source_of  [truth->count] index of each item's source
 *            truth      header and items
 * Returned:  truth->shapes, and of their items x_centroid_px, y_centroid_px, electrons, snr and,
 * where the Earth hides all of the body, BST_TRUTH_OCCULTED Errors:    BST_ERR_MEMORY Notes:
 * corners are projected in perspective; the light is that of the middle of the exposure, from an
 * image of up to 256 cells across. The SNR is lowered by the width of the image. With a rolling
 * shutter the attitude of the camera is that of the middle of the exposure. */
bst_status bst_shape_truth_fill(bst_ctx *ctx, bst_shape_truth *work, const bst_camera *camera,
                                const bst_scene_source *sources, const int *source_of,
                                bst_truth *truth) BST_MUST_CHECK;

#endif
