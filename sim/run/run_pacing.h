/* Pacing of a run in manifest and terminal output. */
#ifndef BST_RUN_RUN_PACING_H
#define BST_RUN_RUN_PACING_H

#include "sim/engine/simulation.h"

struct cJSON;

/* Called before stepping: a run that follows the clock, or does not await peers, begins after all
 * peers have connected. */
bst_status bst_run_pacing_begin(bst_ctx *ctx, const bst_scenario *scenario,
                                bst_simulation *simulation) BST_MUST_CHECK;
/* Adds "pacing" to the manifest: mode, repeatability and timing figures. */
void bst_run_pacing_add(struct cJSON *root, const bst_scenario *scenario, bst_simulation *sim);
/* Prints rows of the table of results; nothing in lockstep. */
void bst_run_pacing_print(const bst_scenario *scenario, bst_simulation *sim);

#endif
