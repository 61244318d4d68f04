/* Counts of frames with saturated pixels. The device leaves a frame's counts in its set of the
 * upload ring; they are read when the set is used again, so that the host does not wait. */
#ifndef BST_SCENEGEN_SATURATION_COUNT_H
#define BST_SCENEGEN_SATURATION_COUNT_H

#include "scenegen/upload_ring.h"

typedef struct bst_saturation_count {
    /* by set of the ring, for a frame that is not counted yet: number of counts (tiles or rows)
     * that the device leaves there, 0: none; saturated pixels as restored, -1: none */
    int tiles[BST_STAGE_SETS];
    int64_t restored[BST_STAGE_SETS];
    int64_t pixels; /* saturated pixels of the frame counted last */
    int64_t frames; /* frames with saturated pixels */
} bst_saturation_count;

/* Starts with no frame. */
void bst_saturation_count_init(bst_saturation_count *count);

/* Counts the frame that used a set, once. Waits for that frame.
 *
 * Given:     set  0 to BST_STAGE_SETS - 1
 * Errors:    BST_ERR_DEVICE */
bst_status bst_saturation_count_frame(bst_ctx *ctx, bst_saturation_count *count,
                                      bst_upload_ring *ring, int set) BST_MUST_CHECK;

/* Saves or restores the counts. Saving waits for the frames in progress and leaves them uncounted:
 * after a restore each is counted when it would have been.
 *
 * Errors:    BST_ERR_DEVICE */
bst_status bst_saturation_count_archive(bst_saturation_count *count, bst_upload_ring *ring,
                                        bst_archive *archive) BST_MUST_CHECK;

#endif
