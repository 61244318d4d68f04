/* From the SNR map to candidate sources: pixels above a threshold, flooded from the brightest down
 * and split where two maxima are parted by a saddle. */
#ifndef BST_IMGPROC_CANDIDATES_H
#define BST_IMGPROC_CANDIDATES_H

#include "imgproc/filter.h"

typedef struct bst_candidate {
    int x, y;   /* the maximum's pixel */
    float snr;  /* there */
    int pixels; /* above the threshold that drain to this maximum; 0: the maximum lies between
                   pixels */
} bst_candidate;

typedef struct bst_candidates {
    int32_t *owner; /* [pixels of a frame], candidate + 1, 0 outside */
    int *hit, *hit_swap; /* pixels of the frame that are above, brightest first */
    uint32_t *key, *key_swap;
    bst_candidate *items;
    int *order;      /* of items: SNR falling, then y, then x */
    int32_t *parent; /* of a candidate that was merged */
    int count, capacity;
} bst_candidates;

bst_status bst_candidates_create(bst_ctx *ctx, int max_width, int max_height,
                                 bst_candidates *out) BST_MUST_CHECK;
void bst_candidates_free(bst_candidates *candidates);

/* Asked of maxima that a noise peak might have made: whether one at this pixel counts. */
typedef bool (*bst_candidate_fn)(const void *user, const bst_candidate *candidate);

/* Finds the candidates among the filter's latest hits. A maximum stands alone when the saddle that
 * joins it to a higher one lies more than max(3, 0.15 maximum) below it: three standard deviations
 * of the map's noise, and the share by which a streak's own brightness may ripple. Maxima below
 * `threshold` count only where no brighter pixel touches them; of all maxima below `certain` those
 * stay that `accept` accepts. */
void bst_candidates_find(bst_candidates *candidates, const bst_filter *filter, float threshold,
                         float certain, bst_candidate_fn accept, const void *user);

#endif
