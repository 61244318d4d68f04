/* States of an object that come while a run goes, from whoever steers it. */
#ifndef BST_WORLD_EXTERNAL_STATES_H
#define BST_WORLD_EXTERNAL_STATES_H

#include <stdbool.h>

#include "sim/world/world.h"

/* The latest few thousand states; may be used by several threads. */
typedef struct bst_external_states bst_external_states;

/* Creates the states of an object that another program commands; its functions lock them.
 *
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY */
bst_status bst_external_states_create(bst_ctx *ctx, bst_external_states **out) BST_MUST_CHECK;
void bst_external_states_free(bst_external_states *external); /* NULL allowed */

/* From `seconds` after the epoch on the object is in this state (GCRF) and moves on by two-body
 * motion. What was before is not changed: BST_ERR_ARGUMENT unless it is later than the last one. */
bst_status bst_external_states_add(bst_ctx *ctx, bst_external_states *external, double seconds,
                                   const bst_world_state *state) BST_MUST_CHECK;

/* *steered false: before the first state. Passes on errors of bst_kepler_propagate. */
bst_status bst_external_states_state(bst_ctx *ctx, bst_external_states *external, double seconds,
                                     bool *steered, bst_world_state *out) BST_MUST_CHECK;

#endif
