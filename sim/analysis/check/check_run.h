/* Runs a scenario that a command wrote, as `boresight run` would: all checks first. */
#ifndef BST_ANALYSIS_CHECK_CHECK_RUN_H
#define BST_ANALYSIS_CHECK_CHECK_RUN_H

#include "sim/cli/load.h"
#include "sim/engine/simulation.h"
#include "sim/run/run_scenario.h"

/* Loads a scenario, applies all rules to it and runs it.
 *
 * Given:     path        of the scenario
 *            load        overrides of it; `table` is added, the command's options
 *            simulation  device and threads
 *            run         folder and progress
 * Errors:    those of bst_load_check, bst_load_scenario, bst_simulation_create,
 *            bst_check_rules_apply and bst_run_scenario */
bst_status bst_check_run_file(bst_ctx *ctx, const char *path, bst_load_options load,
                              const bst_option *table, const bst_simulation_options *simulation,
                              const bst_run_request *run) BST_MUST_CHECK;

#endif
