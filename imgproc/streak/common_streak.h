/* The streak that all stars of a frame have in common, found from the frame itself. */
#ifndef BST_IMGPROC_STREAK_COMMON_STREAK_H
#define BST_IMGPROC_STREAK_COMMON_STREAK_H

#include "boresight/messages.h"
#include "boresight/status.h"

typedef struct bst_common_streak_options {
    int candidates; /* shapes to choose from, the brightest first: shape 0, 1, ... */
    int shape;      /* the one to use */
    int max_sources;
    double least_snr;
} bst_common_streak_options;

/* A point along the streak, relative to the corner of its template. */
typedef struct bst_common_streak_point {
    double x_px, y_px;
} bst_common_streak_point;

typedef struct bst_common_streak {
    float *image; /* background removed, in units of `sigma` */
    int width, height;
    double sigma;    /* noise of the given image */
    float *template; /* [rows][columns] of the shape: unit sum of squares */
    int rows, columns;
    bst_common_streak_point ends[2]; /* the one further left first */
    int shapes;                      /* shapes that the frame has */
    bst_detection *items;            /* positions of the template's corner; flux_e: amplitude */
    int count;
} bst_common_streak;

/* Finds the common streak and the stars of a frame.
 *
 * The brightest connected source that lies wholly inside the frame is the template; it may be
 * curved and of uneven brightness. A matched filter with it gives the stars, one after the other:
 * the highest maximum is subtracted and the filter repeated (Hogbom 1974, A&AS 15, 417). Streaks
 * that the frame cuts off are found if one of their ends is inside.
 *
 * Given:     pixels  [height][width]; NAN: no value
 * Returned:  *out    shapes 0: no source lies wholly inside, or none is left for options->shape
 * Errors:    BST_ERR_MEMORY
 * Ownership: free with bst_common_streak_free, also after an error */
bst_status bst_common_streak_find(bst_ctx *ctx, const float *pixels, int width, int height,
                                  const bst_common_streak_options *options,
                                  bst_common_streak *out) BST_MUST_CHECK;
/* Frees what bst_common_streak_find allocated; the struct belongs to the caller. */
void bst_common_streak_free(bst_common_streak *streak);

#endif
