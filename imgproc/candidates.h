/* From the SNR map to candidate sources: connected components, split where two maxima are parted by
 * a saddle. */
#ifndef BST_IMGPROC_CANDIDATES_H
#define BST_IMGPROC_CANDIDATES_H

#include "imgproc/cv/components.h"
#include "imgproc/filter.h"

typedef struct bst_candidate {
    int x, y; /* the maximum's pixel */
    float snr;
    int pixels; /* above the threshold that drain to this maximum */
} bst_candidate;

typedef struct bst_candidates {
    bst_cv_components *components;
    int *pixel;     /* indices of one component's pixels */
    int32_t *owner; /* [pixels of a frame], candidate + 1, 0 outside a component */
    bst_candidate *items;
    int *order;      /* of items: SNR falling, then y, then x */
    int32_t *parent; /* of a candidate that was merged */
    int count, capacity;
} bst_candidates;

bst_status bst_candidates_create(bst_ctx *ctx, int max_width, int max_height,
                                 bst_candidates *out) BST_MUST_CHECK;
void bst_candidates_free(bst_candidates *candidates);

/* Finds the candidates of the filter's latest frame. A maximum stands alone when the saddle that
 * joins it to a higher one lies more than max(3, 0.15 maximum) below it: three standard deviations
 * of the map's noise, and the share by which a streak's own brightness may ripple. */
bst_status bst_candidates_find(bst_ctx *ctx, bst_candidates *candidates,
                               const bst_filter *filter) BST_MUST_CHECK;

#endif
