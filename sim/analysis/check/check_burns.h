/* Compares the targets' burns with what the trackers' filters can follow. */
#ifndef BST_ANALYSIS_CHECK_CHECK_BURNS_H
#define BST_ANALYSIS_CHECK_CHECK_BURNS_H

#include "sim/engine/simulation.h"

/* Logs a warning for the first burn of each sensor's cued object that turns the line of sight
 * faster than its tracker follows. With frame period T a model of noise density q follows a
 * constant acceleration up to sqrt(gate_chi2 q / T). Larger ones are detected up to sqrt(gate_chi2
 * q_m / (3 T)) / 2, and steps of the rate up to sqrt(gate_chi2 q_m T / 3), q_m of the manoeuvring
 * model; docs/explanation/equations/tracking.md, "Accelerations that a filter follows".
 * BST_ERR_NUMERIC: no orbit state at a burn; BST_ERR_MEMORY. */
bst_status bst_check_burns(bst_ctx *ctx, const bst_scenario *scenario,
                           const bst_simulation *simulation) BST_MUST_CHECK;

#endif
