/* Small pictures of a run's frames for the film-strip of the page, kept in memory. */
#ifndef BST_VIEW_THUMBNAILS_H
#define BST_VIEW_THUMBNAILS_H

#include "view/recorded_run.h"

/* Small picture of a frame: the largest digital number of each bin of n x n pixels, so that a point
 * of light is not averaged away. n is the least for which the longest side is at most
 * BST_VIEW_THUMBNAIL_PX (view/thumbnail_store.h).
 *
 * Given:     sensor, frame  as for bst_view_run_pixels
 * Returned:  out  [height][width] digital numbers, 16 bits; width and height of the picture
 * Errors:    those of bst_view_run_pixels
 * Ownership: free out->data */
bst_status bst_view_run_thumbnail(bst_ctx *ctx, bst_view_run *run, int64_t sensor, int64_t frame,
                                  bst_view_bytes *out) BST_MUST_CHECK;

#endif
