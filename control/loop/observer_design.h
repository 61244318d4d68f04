/* Gains of the observer of control/loop/pointing_error.h that its loop bears. */
#ifndef BST_CONTROL_LOOP_OBSERVER_DESIGN_H
#define BST_CONTROL_LOOP_OBSERVER_DESIGN_H

#include "control/loop/tracking_loop.h"

typedef struct bst_observer_request {
    bst_tracking_timing timing;
    double servo_lag_s;
    double density, sigma; /* of bst_tracking_observer_gains, in units of one angle */
} bst_observer_request;

/* The greatest density, at most that asked for, at which the loop of bst_tracking_open has margins
 * that bst_loop_verdict finds no fault with, and a little more: a gain margin of 6.2 dB, a phase
 * margin of 31 deg, a sensitivity peak of at most 1.95, for a mount that follows servo_lag_s late.
 * More latency takes a smaller density: the farther the estimate is carried on, the more its rate's
 * error counts. BST_ERR_NUMERIC: not even a density 1e40 times smaller has them. */
bst_status bst_observer_design(bst_ctx *ctx, const bst_observer_request *request,
                               double *density) BST_MUST_CHECK;

#endif
