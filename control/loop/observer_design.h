/* Observer gains for a robust loop (observer of control/loop/pointing_error.h). */
#ifndef BST_CONTROL_LOOP_OBSERVER_DESIGN_H
#define BST_CONTROL_LOOP_OBSERVER_DESIGN_H

#include "control/loop/tracking_loop.h"
#include "sim/core/memo.h"

typedef struct bst_observer_request {
    bst_tracking_timing timing;
    double servo_lag_s;
    double density, sigma; /* of bst_tracking_observer_gains, in units of one angle */
} bst_observer_request;
_Static_assert(sizeof(bst_observer_request) == 8 * sizeof(double),
               "bst_memo_find compares requests byte by byte: no padding");

/* Largest density, at most the requested one, at which the loop of bst_tracking_open has sufficient
 * margins: gain margin 6.2 dB, phase margin 31 deg, sensitivity peak at most 1.95, for a mount with
 * lag servo_lag_s.
 *
 * Given:     memo  NULL, or keeps the result: the search takes longer than all else that control
 *                  does before a run
 * Errors:    BST_ERR_NUMERIC if even a density 1e40 times smaller has not
 * Notes:     Longer latency requires a smaller density, because the rate error of the extrapolated
 *            estimate grows. */
bst_status bst_observer_design(bst_ctx *ctx, const bst_observer_request *request, bst_memo *memo,
                               double *density) BST_MUST_CHECK;

#endif
