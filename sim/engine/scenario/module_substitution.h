/* A module that substitutes others of its sensor (bst_module_desc.substitutes_for). Internal to
 * sim/engine. */
#ifndef BST_ENGINE_SCENARIO_MODULE_SUBSTITUTION_H
#define BST_ENGINE_SCENARIO_MODULE_SUBSTITUTION_H

#include "sim/engine/scenario/scenario.h"

struct cJSON;

/* Selects between a substitute and the modules that it replaces, by the sensor's
 * observation_source. Called after the modules of the sensor have been read.
 *
 * Given:     block             JSON of the sensor's modules; may be NULL
 *            observer, sensor  indices in the scenario
 * Returned:  scenario  unused modules are disabled; a missing substitute is added with its
 * defaults; it takes the settings of the modules that it replaces Errors:    BST_ERR_CONFIG if the
 * substitute's block sets a key of the modules that it replaces, or if a substitute is needed and
 * the registry has none */
bst_status bst_module_substitution(bst_ctx *ctx, const bst_scenario_registry *registry,
                                   const struct cJSON *block, int observer, int sensor,
                                   bst_scenario *scenario) BST_MUST_CHECK;

/* True if a key of a module has the value of a module that it replaces. */
bool bst_module_substitution_taken(const bst_scenario *scenario,
                                   const bst_scenario_module_config *module, const char *key);
/* True if the delays of a module's inputs come from modules that it replaces. */
bool bst_module_substitution_delayed(const bst_scenario *scenario,
                                     const bst_scenario_module_config *module);

#endif
