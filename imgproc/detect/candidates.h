/* Candidate sources: maxima of the SNR map, separated from brighter ones by a saddle. */
#ifndef BST_IMGPROC_DETECT_CANDIDATES_H
#define BST_IMGPROC_DETECT_CANDIDATES_H

#include "imgproc/detect/filter.h"
#include "sim/core/arena.h"

typedef struct bst_candidate {
    int x, y; /* pixel of the maximum */
    /* output of the matched filter, sigma */
    float snr;
} bst_candidate;

typedef struct bst_candidates {
    bst_arena arena; /* of all arrays below */
    bst_candidate *items;
    int *order; /* indices of items: falling SNR, then y, then x */
    int count, capacity;
    bst_candidate *maxima; /* all maxima in row order */
    /* the same grouped by cell of the frame */
    int32_t *cell_x, *cell_y;
    float *cell_snr;
    int *cell;   /* index of the first maximum of each cell */
    int columns; /* cells per row of the latest frame */
    /* [maxima]: 1: it is a candidate */
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

/* Significance test of a maximum that may be a noise peak; true: it is accepted. It is called by
 * several threads at a time. */
typedef bool (*bst_candidate_fn)(const void *user, const bst_candidate *candidate);

/* Criteria of a candidate: `accept` tests maxima below `certain`. */
typedef struct bst_candidates_criteria {
    /* largest distance, px along x or y, at which a higher maximum can absorb one */
    int reach_px;
    /* SNR; no saddle is deeper than floor */
    float floor, certain;
    bst_candidate_fn accept;
    const void *user;
} bst_candidates_criteria;

/* Finds the candidate sources among the matched filter's latest maxima.
 *
 * A maximum is separate if the SNR on the line to each higher maximum within reach_px falls more
 * than max(3, 0.15 maximum) below it, or below `floor`. The 3 is three standard deviations of the
 * map's noise; 0.15 allows for brightness ripple along a streak. Below `certain` only maxima that
 * `accept` accepts are kept. */
void bst_candidates_find(bst_candidates *candidates, bst_parallel *pool, const bst_filter *filter,
                         const bst_candidates_criteria *criteria);

#endif
