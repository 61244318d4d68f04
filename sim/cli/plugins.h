/* Plug-ins from the command line (sim/engine/scenario/plugin.h), besides built-in modules and
 * plug-ins named by scenarios. */
#ifndef BST_CLI_PLUGINS_H
#define BST_CLI_PLUGINS_H

#include "sim/registry/registry.h"

/* Environment variable: paths of shared libraries, separated by ':'. `boresight --plugin FILE` adds
 * to it, so that child processes inherit them. */
#define BST_PLUGINS_VARIABLE "BORESIGHT_PLUGINS"

/* Environment variable: if set, scenarios with plug-ins are refused; those of the command line are
 * loaded. `boresight --no-plugins` sets it for child processes too. */
#define BST_NO_PLUGINS_VARIABLE "BORESIGHT_NO_PLUGINS"

/* Refuses plug-ins from now on, in this process and its children (--no-plugins).
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_plugins_refuse(bst_ctx *ctx) BST_MUST_CHECK;

/* Adds a library to the environment variable. BST_ERR_ARGUMENT: ':' in the path. */
bst_status bst_plugins_add(bst_ctx *ctx, const char *path) BST_MUST_CHECK;

/* Registry of all modules: bst_registry_shipped and those of plug-ins. Libraries stay loaded until
 * the process ends; free *out with bst_plugins_free. BST_ERR_IO: cannot be loaded; BST_ERR_CONFIG:
 * no plug-in, wrong version, or role and type already exist. */
bst_status bst_plugins_registry(bst_ctx *ctx, bst_scenario_registry *out) BST_MUST_CHECK;
/* Frees the lists of a registry and clears it; the modules themselves stay loaded. */
void bst_plugins_free(bst_scenario_registry *registry);

/* Adds the libraries that a scenario file names to the registry. */
bst_status bst_plugins_of_scenario(bst_ctx *ctx, const char *path,
                                   bst_scenario_registry *registry) BST_MUST_CHECK;

/* Reads a scenario with the modules of all plug-ins; loads those that it names. */
bst_status bst_plugins_scenario_read(bst_ctx *ctx, const bst_json *json,
                                     bst_scenario *out) BST_MUST_CHECK;
/* Reads a recorded scenario without loading its plug-ins, for commands that step no module; blocks
 * with plug-ins are skipped. */
bst_status bst_plugins_recorded_read(bst_ctx *ctx, const bst_json *json,
                                     bst_scenario *out) BST_MUST_CHECK;

struct cJSON;

/* Adds "plugins" to a JSON object: modules and stages of plug-ins that a scenario uses, with path,
 * type, file and SHA-256. Without plug-ins it adds nothing. */
void bst_plugins_tell(const bst_scenario *scenario, struct cJSON *to);

#endif
