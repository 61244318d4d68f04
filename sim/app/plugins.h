/* Modules from shared libraries of the user's own, beside those that come with Boresight. */
#ifndef BST_APP_PLUGINS_H
#define BST_APP_PLUGINS_H

#include "sim/app/registry.h"

/* Environment variable: paths of shared libraries, ':' between them. `boresight --plugin FILE` adds
 * to it, so that child processes have the same. */
#define BST_PLUGINS_VARIABLE "BORESIGHT_PLUGINS"

/* What such a library defines: a list of modules that NULL ends,
 *     const bst_module_desc *const bst_plugin_modules[] = {&my_module, NULL};
 */
#define BST_PLUGIN_SYMBOL "bst_plugin_modules"

/* Adds a library to the variable's list. BST_ERR_ARGUMENT for a path with ':' in it. */
bst_status bst_plugins_add(bst_ctx *ctx, const char *path) BST_MUST_CHECK;

/* All modules that a scenario can name: bst_app_registry and the plugins'. Libraries stay loaded
 * until the process ends; *out is freed with bst_plugins_free. BST_ERR_IO for a library that cannot
 * be loaded, BST_ERR_CONFIG for one that is no plugin, of another version, or whose module has the
 * role and type of another. */
bst_status bst_plugins_registry(bst_ctx *ctx, bst_registry *out) BST_MUST_CHECK;
void bst_plugins_free(bst_registry *registry);

/* bst_scenario_read with all these modules. */
bst_status bst_plugins_scenario_read(bst_ctx *ctx, const bst_json *json,
                                     bst_scenario *out) BST_MUST_CHECK;

#endif
