/* Plug-ins used by the scenarios of a study: recorded in folder and tables; all runs must use the
 * same ones. */
#ifndef BST_STUDY_KINDS_STUDY_PLUGINS_H
#define BST_STUDY_KINDS_STUDY_PLUGINS_H

#include "sim/engine/scenario/scenario.h"
#include "sim/studies/kind.h"

/* List of libraries without duplicates; empty if zero-initialised. */
typedef struct bst_study_plugins {
    bst_scenario_plugin_use *items;
    bst_study_note *notes; /* "plugin", "FILE sha256 DIGEST" */
    int count;
} bst_study_plugins;

/* Adds the plug-ins of a scenario. bst_study_check_scenario calls it if `user` of the kind is a
 * bst_study_plugins. */
bst_status bst_study_plugins_take(bst_ctx *ctx, bst_study_plugins *plugins,
                                  const bst_scenario *scenario) BST_MUST_CHECK;
/* Frees the memory of a list of plug-ins and clears the struct, which belongs to the caller. */
void bst_study_plugins_free(bst_study_plugins *plugins);

/* Writes OUT/plugins.json, or compares with the existing one. BST_ERR_STATE: a library has changed
 * since the study began. */
bst_status bst_study_plugins_settle(bst_ctx *ctx, const bst_study_plugins *plugins,
                                    const char *out) BST_MUST_CHECK;

/* Reads the scenario of a run. BST_ERR_IO: a plug-in differs from OUT/plugins.json. */
bst_status bst_study_read_scenario(bst_ctx *ctx, const bst_study_run *run,
                                   bst_scenario *out) BST_MUST_CHECK;

#endif
