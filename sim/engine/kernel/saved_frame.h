/* Frames in an archive. Restored ones are in host memory. */
#ifndef BST_ENGINE_KERNEL_SAVED_FRAME_H
#define BST_ENGINE_KERNEL_SAVED_FRAME_H

#include "boresight/frame.h"
#include "sim/core/archive.h"

/* Saves the size and the pixels of a frame.
 *
 * Errors:    those of bst_frame_map */
bst_status bst_frame_save(bst_ctx *ctx, bst_archive *archive, bst_frame *frame) BST_MUST_CHECK;

/* Restores a frame.
 *
 * Returned:  *out  with one reference; NULL on error
 * Errors:    BST_ERR_FORMAT: a size that no frame has; BST_ERR_MEMORY
 * Ownership: the caller releases it with bst_frame_release */
bst_status bst_frame_restore(bst_ctx *ctx, bst_archive *archive, bst_frame **out) BST_MUST_CHECK;

#endif
