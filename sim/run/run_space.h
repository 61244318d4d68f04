/* Whether there is room for a run's frames. */
#ifndef BST_RUN_RUN_SPACE_H
#define BST_RUN_RUN_SPACE_H

#include "sim/engine/scenario/scenario.h"

/* Says how much the frames of a run will take where that is 0.1 GB or more. BST_ERR_IO when the
 * disk on which `out` lies has less; with `force` a warning instead. */
bst_status bst_run_check_space(bst_ctx *ctx, const bst_scenario *scenario, const char *out,
                               bool force) BST_MUST_CHECK;

#endif
