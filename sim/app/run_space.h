/* Whether there is room for a run's frames. */
#ifndef BST_APP_RUN_SPACE_H
#define BST_APP_RUN_SPACE_H

#include "sim/engine/scenario.h"

/* Warns when the disk on which `out` lies does not look large enough for the frames. */
void bst_run_warn_of_space(bst_ctx *ctx, const bst_scenario *scenario, const char *out);

#endif
