/* Plug-ins that a study's scenarios use: told in its folder and its tables, and the same for all
 * runs. */
#ifndef BST_STUDY_KINDS_STUDY_PLUGINS_H
#define BST_STUDY_KINDS_STUDY_PLUGINS_H

#include "sim/engine/scenario/scenario.h"
#include "sim/studies/kind.h"

/* Libraries, each once. Zero-initialised it is empty. */
typedef struct bst_study_plugins {
    bst_scenario_plugin_use *items;
    bst_study_note *notes; /* "plugin", "FILE sha256 DIGEST" */
    int count;
} bst_study_plugins;

/* Takes those of a scenario; as `user` of a kind a bst_study_plugins has bst_study_check_scenario
 * do so. */
bst_status bst_study_plugins_take(bst_ctx *ctx, bst_study_plugins *plugins,
                                  const bst_scenario *scenario) BST_MUST_CHECK;
/* Frees the memory of a list of plug-ins and clears the struct, which belongs to the caller. */
void bst_study_plugins_free(bst_study_plugins *plugins);

/* Writes OUT/plugins.json, or compares with the one that is there. BST_ERR_STATE: a library has
 * been changed since the study began. */
bst_status bst_study_plugins_settle(bst_ctx *ctx, const bst_study_plugins *plugins,
                                    const char *out) BST_MUST_CHECK;

/* The scenario of a run that is to be executed. BST_ERR_IO: it uses a plug-in other than
 * OUT/plugins.json says. */
bst_status bst_study_read_scenario(bst_ctx *ctx, const bst_study_run *run,
                                   bst_scenario *out) BST_MUST_CHECK;

#endif
