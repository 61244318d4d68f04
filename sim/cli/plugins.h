/* Modules from shared libraries that the command line names (sim/engine/scenario/plugin.h), beside
 * those that come with Boresight and those that a scenario names by itself. */
#ifndef BST_CLI_PLUGINS_H
#define BST_CLI_PLUGINS_H

#include "sim/registry/registry.h"

/* Environment variable: paths of shared libraries, ':' between them. `boresight --plugin FILE` adds
 * to it, so that child processes have the same. */
#define BST_PLUGINS_VARIABLE "BORESIGHT_PLUGINS"

/* Environment variable: when set, scenarios that name plug-ins are refused; those of the command
 * line are loaded. `boresight --no-plugins` sets it, so that child processes do the same. */
#define BST_NO_PLUGINS_VARIABLE "BORESIGHT_NO_PLUGINS"

/* Refuses plug-ins from now on, in this process and its children (--no-plugins).
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_plugins_refuse(bst_ctx *ctx) BST_MUST_CHECK;

/* Adds a library to the variable's list. BST_ERR_ARGUMENT for a path with ':' in it. */
bst_status bst_plugins_add(bst_ctx *ctx, const char *path) BST_MUST_CHECK;

/* All modules that a scenario can name: bst_registry_shipped and the plugins'. Libraries stay
 * loaded until the process ends; *out is freed with bst_plugins_free. BST_ERR_IO for a library that
 * cannot be loaded, BST_ERR_CONFIG for one that is no plugin, of another version, or whose module
 * has the role and type of another. */
bst_status bst_plugins_registry(bst_ctx *ctx, bst_scenario_registry *out) BST_MUST_CHECK;
/* Frees the lists of a registry and clears it; the modules themselves stay loaded. */
void bst_plugins_free(bst_scenario_registry *registry);

/* Adds the libraries that a scenario file names to the registry. */
bst_status bst_plugins_of_scenario(bst_ctx *ctx, const char *path,
                                   bst_scenario_registry *registry) BST_MUST_CHECK;

/* bst_scenario_read with all these modules; plug-ins that it names are loaded. */
bst_status bst_plugins_scenario_read(bst_ctx *ctx, const bst_json *json,
                                     bst_scenario *out) BST_MUST_CHECK;
/* The same of a scenario that was recorded, for those who read the run and step no module: the
 * plug-ins that it names are not loaded, and what names them is left out. */
bst_status bst_plugins_recorded_read(bst_ctx *ctx, const bst_json *json,
                                     bst_scenario *out) BST_MUST_CHECK;

struct cJSON;

/* Adds "plugins" to a JSON object: the modules and stages of plug-ins that a scenario uses, with
 * path, type, file and SHA-256. Without plug-ins it adds nothing. */
void bst_plugins_tell(const bst_scenario *scenario, struct cJSON *to);

#endif
