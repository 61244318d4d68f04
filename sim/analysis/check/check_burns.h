/* Burns of the targets against what the trackers' filters follow. */
#ifndef BST_ANALYSIS_CHECK_CHECK_BURNS_H
#define BST_ANALYSIS_CHECK_CHECK_BURNS_H

#include "sim/engine/simulation.h"

/* Logs a warning for the first burn of each sensor's cued object that turns the line of sight
 * faster than the sensor's tracker follows. With frames every T a model of noise density q follows
 * an even acceleration up to sqrt(gate_chi2 q / T); what goes beyond that of the quiet model is
 * found up to sqrt(gate_chi2 q_m / (3 T)) / 2 and, of a jump of the rate, up to sqrt(gate_chi2 q_m
 * T / 3), q_m that of the manoeuvring model; docs/explanation/equations/tracking.md, "Accelerations
 * that a filter follows". BST_ERR_NUMERIC when an orbit has no state at its burn; BST_ERR_MEMORY.
 */
bst_status bst_check_burns(bst_ctx *ctx, const bst_scenario *scenario,
                           const bst_simulation *simulation) BST_MUST_CHECK;

#endif
