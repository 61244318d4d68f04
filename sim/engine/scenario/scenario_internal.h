/* Internal functions that read a scenario, shared by the scenario_*.c files. */
#ifndef BST_ENGINE_SCENARIO_SCENARIO_INTERNAL_H
#define BST_ENGINE_SCENARIO_SCENARIO_INTERNAL_H

#include "sim/engine/scenario/scenario.h"

/* Configuration keys common to all modules (scenario_modules.c). */
extern const bst_config_desc bst_module_common_table[];

/* True if a module has no period: rate_hz and offset_s of its block have no effect
 * (scenario_modules.c). */
bool bst_module_steps_on_inputs(const bst_module_desc *module);

/* Folder of a file, the base of its relative paths. */
void bst_scenario_folder(const char *file, char *folder, size_t bytes);

/* Makes the file paths of a configuration table absolute (scenario_paths.c). `must_exist`: a
 * missing file is an error, outside of lists. */
bst_status bst_scenario_paths(bst_ctx *ctx, const bst_json *json, const bst_scenario *s,
                              const char *where, const bst_config_desc *table, void *object,
                              bool must_exist) BST_MUST_CHECK;

/* Reads the "modules" blocks of all sensors and "tasking" (scenario_modules.c). */
bst_status bst_scenario_modules(bst_ctx *ctx, const bst_json *json,
                                const bst_scenario_registry *registry,
                                bst_scenario *out) BST_MUST_CHECK;

/* Context for loading the plug-ins of stages. */
typedef struct bst_scenario_stages {
    const bst_scenario_registry *registry;
    bst_scenario *scenario;
} bst_scenario_stages;

/* Opens the plug-in that a block names (scenario_plugins.c). `text`: its path; `where`: JSON
 * pointer. *out NULL: the registry skips plug-ins. */
bst_status bst_scenario_plugin(bst_ctx *ctx, const bst_json *json, const bst_scenario_stages *in,
                               const char *where, const char *text, bst_plugin *out,
                               bool *skip) BST_MUST_CHECK;
/* Records that a scenario uses a module or stage of a plug-in at the JSON pointer `where`. */
bst_status bst_scenario_plugin_used(bst_ctx *ctx, bst_scenario *s, const bst_plugin *plugin,
                                    const char *where, const char *type) BST_MUST_CHECK;

/* Loads the plug-in of a stage: function `load` of a bst_stage_loader.
 *
 * Given:     user  a bst_scenario_stages
 * Errors:    those of the plug-in's library, with the scenario's file and path */
bst_status bst_scenario_stage(void *user, bst_ctx *ctx, const bst_json *json, const char *path,
                              const char *plugin, const char *kind, const char *type,
                              const bst_stage_desc **out, char *file, size_t bytes) BST_MUST_CHECK;

#endif
