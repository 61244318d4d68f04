/* Parts of reading a scenario that only its own files share. */
#ifndef BST_ENGINE_SCENARIO_SCENARIO_INTERNAL_H
#define BST_ENGINE_SCENARIO_SCENARIO_INTERNAL_H

#include "sim/engine/scenario/scenario.h"

/* Keys that every module has besides those of its own table; scenario_modules.c. */
extern const bst_config_desc bst_module_common_table[];

/* The folder of a file: what relative paths in it start from. */
void bst_scenario_folder(const char *file, char *folder, size_t bytes);

/* scenario_paths.c: makes the files that a table names absolute. `must_exist`: a file that is not
 * there is an error, outside of lists. */
bst_status bst_scenario_paths(bst_ctx *ctx, const bst_json *json, const bst_scenario *s,
                              const char *where, const bst_config_desc *table, void *object,
                              bool must_exist) BST_MUST_CHECK;

/* scenario_modules.c: reads the modules of all sensors, and "tasking". */
bst_status bst_scenario_modules(bst_ctx *ctx, const bst_json *json,
                                const bst_scenario_registry *registry,
                                bst_scenario *out) BST_MUST_CHECK;

/* What plug-ins are looked up in, and the scenario that uses them. */
typedef struct bst_scenario_stages {
    const bst_scenario_registry *registry;
    bst_scenario *scenario;
} bst_scenario_stages;

/* scenario_plugins.c: opens the plug-in that `text`, at the JSON pointer `where`, names. *out NULL:
 * the registry says that plug-ins are left unread. */
bst_status bst_scenario_plugin(bst_ctx *ctx, const bst_json *json, const bst_scenario_stages *in,
                               const char *where, const char *text, bst_plugin *out,
                               bool *skip) BST_MUST_CHECK;
/* Notes that a module or stage of it is used at `where`. */
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
