/* What the cascade (compensator.c) and its design (compensator_design.c) share. */
#ifndef BST_DYNAMICS_COMPENSATOR_INTERNAL_H
#define BST_DYNAMICS_COMPENSATOR_INTERNAL_H

#include "boresight/compensator.h"

/* Whether a configuration gives gains. */
bool bst_compensator_has_gains(const bst_compensator_config *config);

/* Whether type, frequencies and delay can be had at this step; BST_ERR_CONFIG. */
bst_status bst_compensator_check(bst_ctx *ctx, const bst_compensator_config *config,
                                 double dt_s) BST_MUST_CHECK;

/* bst_compensator_init of a configuration whose gains are given, or of a plug-in. */
bst_status bst_compensator_from_gains(bst_ctx *ctx, bst_compensator *compensator,
                                      const bst_compensator_config *config,
                                      double dt_s) BST_MUST_CHECK;

#endif
