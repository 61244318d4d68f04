/* States of a space object that another program sends during a run. */
#ifndef BST_WORLD_EXTERNAL_STATES_H
#define BST_WORLD_EXTERNAL_STATES_H

#include <stdbool.h>

#include "boresight/archive.h"
#include "sim/world/world.h"

/* Ring of the latest states of one object; several threads may use it. */
typedef struct bst_external_states bst_external_states;

/* Creates the ring of states of an externally commanded object; its functions are thread-safe.
 *
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY */
bst_status bst_external_states_create(bst_ctx *ctx, bst_external_states **out) BST_MUST_CHECK;
void bst_external_states_free(bst_external_states *external); /* NULL allowed */

/* Adds a state (GCRF) of an externally commanded object at `seconds` after the epoch. Two-body
 * motion continues it. BST_ERR_ARGUMENT: not later than the previous state. */
bst_status bst_external_states_add(bst_ctx *ctx, bst_external_states *external, double seconds,
                                   const bst_world_state *state) BST_MUST_CHECK;

/* State of an externally commanded object at a time. *steered false: before the first state. Errors
 * of bst_kepler_propagate. */
bst_status bst_external_states_state(bst_ctx *ctx, bst_external_states *external, double seconds,
                                     bool *steered, bst_world_state *out) BST_MUST_CHECK;

/* Archives the states that the ring holds; thread-safe. */
void bst_external_states_archive(bst_external_states *external, bst_archive *archive);

#endif
