/* Which detection is which target's. */
#ifndef BST_EVAL_TARGET_MATCH_H
#define BST_EVAL_TARGET_MATCH_H

#include "boresight/messages.h"

typedef struct bst_eval_match_target {
    double x_px, y_px;   /* true place, mean of the exposure */
    double dx_px, dy_px; /* path during the exposure, end minus start; 0, 0: at rest */
} bst_eval_match_target;

/* A detection may be a target's if it lies within reach_px (one FWHM) of the true place; of a path
 * longer than twice that, within reach_px across and half the path along. */
bool bst_eval_match_belongs(const bst_eval_match_target *target, double reach_px,
                            const bst_detection *detection);

/* A detection
 * belongs to the nearest such target, and of a target's detections the nearest is its match.
 * of_target [count] gets the index of each target's match, of_detection [detections->count] that
 * of the target a detection belongs to; -1: none. Returns the number of targets matched. */
int bst_eval_match_targets(const bst_eval_match_target *targets, int count, double reach_px,
                           const bst_detections *detections, int *of_target, int *of_detection);

#endif
