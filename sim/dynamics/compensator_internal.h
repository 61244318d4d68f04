/* Internal functions of compensators: cascade (compensator.c) and design (compensator_design.c). */
#ifndef BST_DYNAMICS_COMPENSATOR_INTERNAL_H
#define BST_DYNAMICS_COMPENSATOR_INTERNAL_H

#include "boresight/compensator.h"

/* True if a configuration has gains instead of a specification. */
bool bst_compensator_has_gains(const bst_compensator_config *config);

/* Checks type, frequencies and delay for this time step; BST_ERR_CONFIG. */
bst_status bst_compensator_check(bst_ctx *ctx, const bst_compensator_config *config,
                                 double dt_s) BST_MUST_CHECK;

/* Initialises a compensator with given gains, or of a plug-in. */
bst_status bst_compensator_from_gains(bst_ctx *ctx, bst_compensator *compensator,
                                      const bst_compensator_config *config,
                                      double dt_s) BST_MUST_CHECK;

#endif
