/* Small pictures of a run's frames for the film-strip of the page, kept in memory. */
#ifndef BST_VIEW_THUMBNAILS_H
#define BST_VIEW_THUMBNAILS_H

#include "view/recorded_run.h"

enum {
    BST_VIEW_THUMBNAIL_PX = 80, /* longest side at most */
    BST_VIEW_THUMBNAILS = 256   /* that are kept for a run; the oldest one makes room */
};

typedef struct bst_view_thumbnails bst_view_thumbnails;

/* Frees the pictures; NULL is allowed. */
void bst_view_thumbnails_free(bst_view_thumbnails *thumbnails);

/* Small picture of a frame: the largest digital number of each bin of n x n pixels, so that a point
 * of light is not averaged away. n is the least for which the longest side is at most
 * BST_VIEW_THUMBNAIL_PX.
 *
 * Given:     sensor, frame  as for bst_view_run_pixels
 * Returned:  out  [height][width] digital numbers, 16 bits; width and height of the picture
 * Errors:    those of bst_view_run_pixels
 * Ownership: free out->data */
bst_status bst_view_run_thumbnail(bst_ctx *ctx, bst_view_run *run, int64_t sensor, int64_t frame,
                                  bst_view_bytes *out) BST_MUST_CHECK;

#endif
