/* Mask of the parts of satellites that are rendered with their shape. */
#ifndef BST_SCENEGEN_PART_MASK_H
#define BST_SCENEGEN_PART_MASK_H

#include "scenegen/renderer.h"

/* Work memory: pose and image of the latest model. All zero: empty. */
typedef struct bst_part_mask {
    struct bst_satellite_pose *pose;
    struct bst_resolved *image;
} bst_part_mask;

/* Frees the memory and clears the struct, which belongs to the caller. */
void bst_part_mask_free(bst_part_mask *work);

/* Draws the parts of all sources with a body, far ones first.
 *
 * Given:     request  its track, sources and window
 * Returned:  mask     [height][width] of the frame, its window over its binning: 0, or the number
 *                     of the part that covers the centre of the pixel (bst_world_first_part)
 * Errors:    BST_ERR_MEMORY, BST_ERR_RANGE
 * Notes:     at the middle of the exposure, in perspective, without the PSF; dark parts count. A
 *            body with a part beside or behind the observer is left out, as in the frame. Cells of
 *            up to 0.5 px: a border is right to 0.35 px.
 */
bst_status bst_part_mask_draw(bst_ctx *ctx, bst_part_mask *work, const bst_camera *camera,
                              const bst_render_request *request, int32_t *mask) BST_MUST_CHECK;

#endif
