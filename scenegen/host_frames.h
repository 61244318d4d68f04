/* Fixed pool of frames in the host's memory, reused without allocation. Frames may be read and
 * released by any thread. */
#ifndef BST_SCENEGEN_HOST_FRAMES_H
#define BST_SCENEGEN_HOST_FRAMES_H

#include "boresight/frame.h"

typedef struct bst_host_frames bst_host_frames;

/* Creates a pool.
 *
 * Given:     pixels  of a frame, at most
 *            count   frames
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_host_frames_free */
bst_status bst_host_frames_create(bst_ctx *ctx, size_t pixels, int count,
                                  bst_host_frames **out) BST_MUST_CHECK;
/* Frees a pool. Lent frames stay valid; the memory is released with the last one. NULL is allowed.
 */
void bst_host_frames_free(bst_host_frames *pool);

/* Lends a frame with one reference.
 *
 * Given:     width, height  at most the pool's pixels together
 * Returned:  *pixels  [height][width], to be filled before the frame is published
 * Errors:    BST_ERR_STATE if all are lent */
bst_status bst_host_frames_take(bst_ctx *ctx, bst_host_frames *pool, int width, int height,
                                bst_frame **out, uint16_t **pixels) BST_MUST_CHECK;

#endif
