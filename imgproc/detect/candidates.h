/* From the SNR map to candidate sources: its maxima, but of those that no saddle parts only the
 * brightest. */
#ifndef BST_IMGPROC_DETECT_CANDIDATES_H
#define BST_IMGPROC_DETECT_CANDIDATES_H

#include "imgproc/detect/filter.h"
#include "sim/core/arena.h"

typedef struct bst_candidate {
    int x, y; /* the maximum's pixel */
    float snr;
} bst_candidate;

typedef struct bst_candidates {
    bst_arena arena; /* of all arrays below */
    bst_candidate *items;
    int *order; /* of items: SNR falling, then y, then x */
    int count, capacity;
    bst_candidate *maxima, *by_cell; /* all, by row, and by square of the frame */
    int *cell;                       /* the first of each square, by row of squares */
    int columns;                     /* of squares of the latest frame */
    uint8_t *stands;
    int *order_swap;
    uint32_t *key, *key_swap;
} bst_candidates;

/* Allocates candidates for frames of up to max_width x max_height pixels.
 *
 * Errors:    BST_ERR_MEMORY; then `out` holds nothing to free
 * Ownership: free with bst_candidates_free */
bst_status bst_candidates_create(bst_ctx *ctx, int max_width, int max_height,
                                 bst_candidates *out) BST_MUST_CHECK;
/* Frees the memory of the candidates and clears the struct, which belongs to the caller. */
void bst_candidates_free(bst_candidates *candidates);

/* Asked of maxima that a noise peak might have made: whether one at this pixel counts. Called from
 * several threads at a time. */
typedef bool (*bst_candidate_fn)(const void *user, const bst_candidate *candidate);

/* What makes a maximum a candidate: `accept` is asked of those below `certain`. */
typedef struct bst_candidates_criteria {
    int reach_px;
    float floor, certain;
    bst_candidate_fn accept;
    const void *user;
} bst_candidates_criteria;

/* Finds the candidates among the filter's latest maxima. One stands alone when on the straight way
 * to each higher one within reach_px the SNR falls more than max(3, 0.15 maximum) below it, or
 * below `floor`: three standard deviations of the map's noise, and the share by which a streak's
 * own brightness may ripple. Of those below `certain` only those stay that `accept` accepts. */
void bst_candidates_find(bst_candidates *candidates, bst_parallel *pool, const bst_filter *filter,
                         const bst_candidates_criteria *criteria);

#endif
