/* A fixed number of frames on the device, lent and taken back without allocation. Frames may be
 * read and released by another thread than the one that renders. */
#ifndef BST_SCENEGEN_FRAME_POOL_H
#define BST_SCENEGEN_FRAME_POOL_H

#include "boresight/frame.h"
#include "sim/device/device.h"

typedef struct bst_frame_pool bst_frame_pool;

/* `count` frames of at most width x height pixels each. */
bst_status bst_frame_pool_create(bst_ctx *ctx, bst_device *device, int width, int height, int count,
                                 bst_frame_pool **out) BST_MUST_CHECK;
/* Frames still lent stay valid; the memory goes with the last of them. */
void bst_frame_pool_free(bst_frame_pool *pool);

/* Lends a frame of width x height with one reference, and the buffer to render into.
 * BST_ERR_STATE when all are lent. */
bst_status bst_frame_pool_take(bst_ctx *ctx, bst_frame_pool *pool, int width, int height,
                               bst_frame **out, cl_mem *buffer) BST_MUST_CHECK;

/* What renders into the frame has been put on the queue: mapping the frame waits for that alone,
 * not for what is put on the queue later. */
bst_status bst_frame_pool_enqueued(bst_ctx *ctx, bst_frame *frame) BST_MUST_CHECK;

/* Waits for the frame and gives its pixels [height][width] to be changed, before it is handed on.
 * All readers get what was changed; the device does when the frame is given back. */
bst_status bst_frame_pool_pixels(bst_ctx *ctx, bst_frame *frame, uint16_t **out) BST_MUST_CHECK;

#endif
