/* The link of a run: opening, recording and replay. */
#ifndef BST_RUN_RUN_LINK_H
#define BST_RUN_RUN_LINK_H

#include "sim/cli/load.h"
#include "sim/engine/simulation.h"

/* Prepares the link of a simulation before anything is written: binds the address if modules are
 * external, where stop signals end its waits, or takes the recorded answers of a run.
 *
 * Given:     load    options; --link and --link-keys must have an effect
 *            folder  of the run whose answers are repeated; NULL: peers connect
 * Errors:    BST_ERR_ARGUMENT: an option without effect; BST_ERR_CONFIG: a replay without a link;
 *            BST_ERR_IO */
bst_status bst_run_link_prepare(bst_ctx *ctx, const bst_load_options *load,
                                const bst_scenario *scenario, bst_simulation *simulation,
                                const char *folder) BST_MUST_CHECK;
/* Starts recording the answers of peers into a run's folder; nothing without a link or in a
 * replay. */
bst_status bst_run_link_record(bst_ctx *ctx, bst_simulation *simulation,
                               const char *folder) BST_MUST_CHECK;

/* Closes the recording of the simulation's link, if there is one.
 *
 * Errors:    BST_ERR_IO */
bst_status bst_run_link_recorded(bst_ctx *ctx, bst_simulation *simulation) BST_MUST_CHECK;

/* Sets the reason for the end of the run that peers will receive.
 *
 * Given:     status   result of the run
 *            message  why it failed; not used for BST_OK */
void bst_run_link_end(bst_simulation *simulation, bst_status status, const char *message);

#endif
