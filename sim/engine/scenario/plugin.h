/* Shared libraries of the user's own: what they hold, checked when they are opened. */
#ifndef BST_ENGINE_SCENARIO_PLUGIN_H
#define BST_ENGINE_SCENARIO_PLUGIN_H

#include "boresight/module.h"
#include "boresight/stage.h"
#include "sim/core/sha256.h"

/* What such a library defines, one of the two or both: lists that NULL ends,
 *     const bst_module_desc *const bst_plugin_modules[] = {&my_module, NULL};
 *     const bst_stage_desc *const bst_plugin_stages[] = {&my_detector, NULL};
 */
#define BST_PLUGIN_MODULES "bst_plugin_modules"
#define BST_PLUGIN_STAGES "bst_plugin_stages"

typedef struct bst_plugin {
    char file[512]; /* its full path */
    char sha256[BST_SHA256_TEXT];
    const bst_module_desc *const *modules; /* ends with NULL; NULL: none */
    const bst_stage_desc *const *stages;   /* the same */
} bst_plugin;

/* Loads a library, which stays loaded until the process ends. BST_ERR_NOT_FOUND: there is no such
 * file; BST_ERR_IO: it cannot be loaded; BST_ERR_CONFIG: it defines neither list, is linked with
 * another version of libboresight, or has a module or stage of another interface or a stage of a
 * kind that there is not. Messages begin with the file and say what to do. */
bst_status bst_plugin_open(bst_ctx *ctx, const char *path, bst_plugin *out) BST_MUST_CHECK;

/* The module of this role and type (NULL: the only one of the role). BST_ERR_CONFIG says what the
 * library has instead. */
bst_status bst_plugin_module(bst_ctx *ctx, const bst_plugin *plugin, const char *role,
                             const char *type, const bst_module_desc **out) BST_MUST_CHECK;
/* The same of a stage. */
bst_status bst_plugin_stage(bst_ctx *ctx, const bst_plugin *plugin, const char *kind,
                            const char *type, const bst_stage_desc **out) BST_MUST_CHECK;

#endif
