/* Runs a scenario and hands over what its first sensor truly saw beside what was detected. */
#ifndef BST_ANALYSIS_CALIBRATION_WATCH_H
#define BST_ANALYSIS_CALIBRATION_WATCH_H

#include "sim/engine/scenario/scenario.h"
#include "sim/eval/loop_summary.h"

typedef struct bst_calibration_watcher {
    void *user;
    /* Each frame whose detections were published, in their order. */
    bst_status (*frame)(void *user, bst_ctx *ctx, const bst_truth *truth,
                        const bst_detections *detections);
    /* May be NULL: error of the confirmed track of interest, px, each frame that has one. */
    void (*track_error)(void *user, double error_px);
} bst_calibration_watcher;

/* Runs the first sensor's scenario to its end; *figures (may be NULL) judge its loop. */
bst_status bst_watch_run(bst_ctx *ctx, const bst_scenario *scenario,
                         const bst_calibration_watcher *watcher, const char *device, int threads,
                         bst_loop_figures *figures) BST_MUST_CHECK;

#endif
