/* Plug-ins: shared libraries with modules and stages of the user, checked when they are opened. */
#ifndef BST_ENGINE_SCENARIO_PLUGIN_H
#define BST_ENGINE_SCENARIO_PLUGIN_H

#include "boresight/module.h"
#include "boresight/stage.h"
#include "sim/core/sha256.h"

/* A plug-in defines one or both of these lists, which end with NULL:
 *     const bst_module_desc *const bst_plugin_modules[] = {&my_module, NULL};
 *     const bst_stage_desc *const bst_plugin_stages[] = {&my_detector, NULL}; */
#define BST_PLUGIN_MODULES "bst_plugin_modules"
#define BST_PLUGIN_STAGES "bst_plugin_stages"

typedef struct bst_plugin {
    char file[512]; /* full path */
    char sha256[BST_SHA256_TEXT];
    const bst_module_desc *const *modules; /* ends with NULL; NULL: no modules */
    const bst_stage_desc *const *stages;   /* ends with NULL; NULL: no stages */
} bst_plugin;

/* Loads a plug-in; it remains loaded until the process ends. BST_ERR_NOT_FOUND: no such file;
 * BST_ERR_IO: it cannot be loaded, or is cut short. BST_ERR_CONFIG: it defines neither list, is
 * linked with another version of libboresight, or has an unknown interface version or kind of
 * stage. Messages name the file and the remedy. */
bst_status bst_plugin_open(bst_ctx *ctx, const char *path, bst_plugin *out) BST_MUST_CHECK;

/* Checks interface versions, functions and kinds of a plug-in's lists. BST_ERR_CONFIG. */
bst_status bst_plugin_check(bst_ctx *ctx, const bst_plugin *plugin) BST_MUST_CHECK;
/* Finds a plug-in that the program has registered (bst_plugin_register); false: there is none. Its
 * file is its name, its digest is empty. */
bool bst_plugin_registered(const char *name, bst_plugin *out);

/* Finds a plug-in's module by role and type (NULL: the only module of the role). BST_ERR_CONFIG
 * lists what the library contains. */
bst_status bst_plugin_module(bst_ctx *ctx, const bst_plugin *plugin, const char *role,
                             const char *type, const bst_module_desc **out) BST_MUST_CHECK;
/* Finds a plug-in's stage by kind and type (NULL: the only stage of the kind). BST_ERR_CONFIG lists
 * what the library contains. */
bst_status bst_plugin_stage(bst_ctx *ctx, const bst_plugin *plugin, const char *kind,
                            const char *type, const bst_stage_desc **out) BST_MUST_CHECK;

#endif
