/* The link of a run: opening, recording and replay. */
#ifndef BST_RUN_RUN_LINK_H
#define BST_RUN_RUN_LINK_H

#include "sim/cli/load.h"
#include "sim/engine/simulation.h"

/* Checks that the options --link and --link-keys have an effect.
 *
 * Errors:    BST_ERR_ARGUMENT if one is given and no module of the scenario is external */
bst_status bst_run_link_check(bst_ctx *ctx, const bst_load_options *load,
                              const bst_scenario *scenario,
                              bst_simulation *simulation) BST_MUST_CHECK;

/* Binds the address if modules are external; stop signals end its waits. */
bst_status bst_run_link_open(bst_ctx *ctx, bst_simulation *simulation) BST_MUST_CHECK;
/* Makes a linked simulation use the recorded answers of the run in this folder. BST_ERR_CONFIG: it
 * has no link. */
bst_status bst_run_link_replay(bst_ctx *ctx, bst_simulation *simulation,
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
