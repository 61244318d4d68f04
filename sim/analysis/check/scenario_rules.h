/* What a scenario may say but hardly means: rules, each with a name, that `boresight check` and
 * `boresight run` apply before anything is simulated. */
#ifndef BST_ANALYSIS_CHECK_SCENARIO_RULES_H
#define BST_ANALYSIS_CHECK_SCENARIO_RULES_H

#include <stdio.h>

#include "sim/engine/simulation.h"

/* Given: the scenario and its simulation, created but not run. Logs a warning for each finding,
 * with its place in the scenario, what was found and what to do. Returns the error of the first
 * rule whose finding is an error, or of what a rule asks. */
bst_status bst_check_rules_apply(bst_ctx *ctx, const bst_scenario *scenario,
                                 const bst_simulation *simulation) BST_MUST_CHECK;

/* Prints each rule's name and what it looks for, one a line. */
void bst_check_rules_print(FILE *out);

#endif
