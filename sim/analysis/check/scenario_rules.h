/* Rules of `boresight check`: plausibility of a scenario before the simulation. Each rule has a
 * name. */
#ifndef BST_ANALYSIS_CHECK_SCENARIO_RULES_H
#define BST_ANALYSIS_CHECK_SCENARIO_RULES_H

#include <stdio.h>

#include "sim/engine/simulation.h"

/* Applies all rules to a scenario and its simulation, created but not run. Logs a warning for each
 * finding: JSON path, finding and remedy. Returns the error of the first rule that treats its
 * finding as an error. */
bst_status bst_check_rules_apply(bst_ctx *ctx, const bst_scenario *scenario,
                                 const bst_simulation *simulation) BST_MUST_CHECK;

/* Prints name and purpose of each rule. */
void bst_check_rules_print(FILE *out);

#endif
