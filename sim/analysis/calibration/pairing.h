/* Pairs detections with sources of the truth. */
#ifndef BST_ANALYSIS_CALIBRATION_PAIRING_H
#define BST_ANALYSIS_CALIBRATION_PAIRING_H

#include "boresight/messages.h"

/* Work space for the pairs of a frame. All zero: empty. */
typedef struct bst_pairing {
    int *detection_of; /* [truth->count] -1: none */
    int *item_of;      /* [detections->count] -1: none */
    int *order;
    int items, detections;
} bst_pairing;

/* Pairs detections with sources, the brightest first: each takes the nearest free detection within
 * fwhm_px of its position. Streaks that have none then take the nearest free one within half their
 * length more. Sources outside the field or without light take none. BST_ERR_MEMORY. */
bst_status bst_pairing_make(bst_ctx *ctx, bst_pairing *pairing, const bst_truth *truth,
                            const bst_detections *detections, double fwhm_px) BST_MUST_CHECK;
/* Frees the memory of a pairing and clears the struct, which belongs to the caller. */
void bst_pairing_free(bst_pairing *pairing);

#endif
