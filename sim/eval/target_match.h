/* Matches detections to true targets. */
#ifndef BST_EVAL_TARGET_MATCH_H
#define BST_EVAL_TARGET_MATCH_H

#include "boresight/messages.h"

typedef struct bst_eval_match_target {
    double x_px, y_px;   /* true position, mean over the exposure */
    double dx_px, dy_px; /* path during the exposure, end minus start; 0, 0: at rest */
} bst_eval_match_target;

/* True if a detection can match a target: within reach_px (one FWHM) of the true position; for a
 * streak longer than twice that, within reach_px across and half the length along it. */
bool bst_eval_match_belongs(const bst_eval_match_target *target, double reach_px,
                            const bst_detection *detection);

/* Matches detections to targets. A detection belongs to the nearest admissible target; the nearest
 * of a target's detections is its match. of_target [count]: detection index of each target's match;
 * of_detection [detections->count]: target index of each detection; -1: none. Returns the number of
 * matched targets. */
int bst_eval_match_targets(const bst_eval_match_target *targets, int count, double reach_px,
                           const bst_detections *detections, int *of_target, int *of_detection);

#endif
