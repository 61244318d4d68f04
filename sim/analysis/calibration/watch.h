/* Runs a scenario and passes truth and detections of its first sensor to callbacks. */
#ifndef BST_ANALYSIS_CALIBRATION_WATCH_H
#define BST_ANALYSIS_CALIBRATION_WATCH_H

#include "sim/engine/scenario/scenario.h"
#include "sim/eval/loop_summary.h"

typedef struct bst_calibration_watcher {
    void *user;
    /* Called for each frame with published detections, in order. */
    bst_status (*frame)(void *user, bst_ctx *ctx, const bst_truth *truth,
                        const bst_detections *detections);
    /* May be NULL. Called with the error of the confirmed track of interest, px, per frame. */
    void (*track_error)(void *user, double error_px);
} bst_calibration_watcher;

/* Runs a scenario to its end; *figures (may be NULL): loop figures of the first sensor. */
bst_status bst_watch_run(bst_ctx *ctx, const bst_scenario *scenario,
                         const bst_calibration_watcher *watcher, const char *device, int threads,
                         bst_loop_figures *figures) BST_MUST_CHECK;

#endif
