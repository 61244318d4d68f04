/* Flats of several exposures in light that stays the same, reduced exposure by exposure. */
#ifndef BST_ANALYSIS_CHARACTERIZE_LINEARITY_SERIES_H
#define BST_ANALYSIS_CHARACTERIZE_LINEARITY_SERIES_H

#include "sim/analysis/characterize/frame_stack.h"

/* Flats of one exposure; block by block, in DN. */
typedef struct bst_linearity_point {
    double exposure_s;
    int frames, pairs;
    double mean[BST_STACK_BLOCKS];       /* of the pixels, without outliers */
    double variance[BST_STACK_BLOCKS];   /* of a pixel between frames; NAN without a pair */
    bst_neighbour_covariance neighbours; /* between frames */
    double scatter[BST_STACK_BLOCKS];    /* standard deviation over the block's pixels in a frame */
} bst_linearity_point;

typedef struct bst_linearity_series {
    int count; /* exposures, ascending */
    int width, height;
    bst_linearity_point *points; /* [count] */
} bst_linearity_series;

/* Reads flats; successive ones of one exposure (to 0.1 %) are a point.
 *
 * Given:     paths  [count] as bst_recorded_frames_open takes them
 * Errors:    those of bst_frame_stack_read; BST_ERR_ARGUMENT: fewer than 6 exposures
 * Ownership: free *out with bst_linearity_series_free, also after an error */
bst_status bst_linearity_series_read(bst_ctx *ctx, const char *const *paths, int count,
                                     const bst_keyword_map *map,
                                     bst_linearity_series *out) BST_MUST_CHECK;
/* Frees the points. */
void bst_linearity_series_free(bst_linearity_series *series);

#endif
