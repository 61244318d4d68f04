/* The wall clock of a run: in the manifest and on the terminal. */
#ifndef BST_RUN_RUN_PACING_H
#define BST_RUN_RUN_PACING_H

#include "sim/engine/simulation.h"

struct cJSON;

/* Before stepping: a run whose clock goes on, or that waits for nobody, begins when all peers are
 * there. */
bst_status bst_run_pacing_begin(bst_ctx *ctx, const bst_scenario *scenario,
                                bst_simulation *simulation) BST_MUST_CHECK;
/* "pacing" of the manifest: the mode, whether results repeat, and how the clock was kept. */
void bst_run_pacing_add(struct cJSON *root, const bst_scenario *scenario, bst_simulation *sim);
/* Rows of the table of results; nothing in lockstep. */
void bst_run_pacing_print(const bst_scenario *scenario, bst_simulation *sim);

#endif
