/* The link of a run. */
#ifndef BST_APP_RUN_LINK_H
#define BST_APP_RUN_LINK_H

#include "sim/engine/simulation.h"

/* Binds the address where modules are outside, and lets the signals that end a run end its waiting.
 */
bst_status bst_run_link_open(bst_ctx *ctx, bst_simulation *simulation) BST_MUST_CHECK;
/* What peers are told when the simulation is freed; NULL allowed. */
void bst_run_link_end(bst_simulation *simulation, bst_status status, const char *message);

#endif
