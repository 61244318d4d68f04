/* The state of an engine as an archive. */
#ifndef BST_ENGINE_KERNEL_ENGINE_STATE_H
#define BST_ENGINE_KERNEL_ENGINE_STATE_H

#include "boresight/state.h"
#include "sim/core/archive.h"
#include "sim/engine/kernel/engine.h"

/* Saves the state of an engine, or restores components of it into an engine of the same modules.
 *
 * Given:     archive     saves or restores
 *            components  BST_STATE_... to restore, the others keep their state; ignored while
 * saving Errors:    BST_ERR_STATE: a module cannot be saved, or the engine already has threads
 * (restoring); BST_ERR_FORMAT: the archive is damaged or that of other modules; BST_ERR_MEMORY,
 *            BST_ERR_DEVICE
 * Notes:     between two calls of bst_engine_advance. After an error of a restore the engine must
 *            not be stepped. */
bst_status bst_engine_archive(bst_ctx *ctx, bst_engine *engine, bst_archive *archive,
                              unsigned components) BST_MUST_CHECK;

#endif
