/* Data for the pictures of a run: first and last processed frame with overlay, and pointing error
 * over time. Constant memory: long runs keep every n-th point. */
#ifndef BST_RUN_RUN_PICTURES_H
#define BST_RUN_RUN_PICTURES_H

#include "boresight/archive.h"
#include "boresight/messages.h"
#include "sim/eval/loop_summary.h"

typedef struct bst_run_pictures bst_run_pictures;

/* Prepares the pictures of a sensor's first and last frame.
 *
 * Given:     target_object  index of the target in the world
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_run_pictures_free */
bst_status bst_run_pictures_create(bst_ctx *ctx, const bst_camera *camera, int64_t tick_rate_hz,
                                   bst_time epoch, int target_object,
                                   bst_run_pictures **out) BST_MUST_CHECK;
/* Frees the pictures of a run; NULL is allowed. */
void bst_run_pictures_free(bst_run_pictures *pictures);

/* Saves or restores what the pictures will show.
 *
 * Errors:    BST_ERR_MEMORY, BST_ERR_FORMAT */
bst_status bst_run_pictures_archive(bst_run_pictures *pictures,
                                    bst_archive *archive) BST_MUST_CHECK;

/* Takes a message of the pictured sensor. */
bst_status bst_run_pictures_message(bst_ctx *ctx, bst_run_pictures *pictures, const char *channel,
                                    const void *payload) BST_MUST_CHECK;
/* Takes an evaluated frame for the pointing plot. */
void bst_run_pictures_judged(bst_run_pictures *pictures, const bst_loop_frame *frame);

/* Writes quicklook.png (if there was a frame) and pointing.png (if there was a target) with
 * `figures` of the run into `folder`. Failures are warnings. */
bst_status bst_run_pictures_write(bst_ctx *ctx, const bst_run_pictures *pictures,
                                  const char *folder, const char *title,
                                  const bst_loop_figures *figures) BST_MUST_CHECK;

#endif
