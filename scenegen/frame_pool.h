/* Fixed pool of frames on the device, reused without allocation. Frames may be read and released by
 * a thread other than the renderer's. */
#ifndef BST_SCENEGEN_FRAME_POOL_H
#define BST_SCENEGEN_FRAME_POOL_H

#include "boresight/frame.h"
#include "sim/device/device.h"

typedef struct bst_frame_pool bst_frame_pool;

/* Creates a pool of `count` frames of at most width x height pixels each. */
bst_status bst_frame_pool_create(bst_ctx *ctx, bst_device *device, int width, int height, int count,
                                 bst_frame_pool **out) BST_MUST_CHECK;
/* Frees a pool. Lent frames stay valid; the memory is released with the last one. */
void bst_frame_pool_free(bst_frame_pool *pool);

/* Lends a frame of width x height with one reference, and its buffer to render into. Errors:
 * BST_ERR_STATE if all are lent. */
bst_status bst_frame_pool_take(bst_ctx *ctx, bst_frame_pool *pool, int width, int height,
                               bst_frame **out, cl_mem *buffer) BST_MUST_CHECK;

/* Marks the end of a frame's commands on the queue: mapping the frame waits for these commands
 * only, not for later ones. */
bst_status bst_frame_pool_enqueued(bst_ctx *ctx, bst_frame *frame) BST_MUST_CHECK;

/* Waits for a frame and returns its pixels [height][width] for modification before it is published.
 * All readers see the changes; the device does once the frame is returned. */
bst_status bst_frame_pool_pixels(bst_ctx *ctx, bst_frame *frame, uint16_t **out) BST_MUST_CHECK;

#endif
