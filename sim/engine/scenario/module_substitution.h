/* A module that stands in for others of its sensor (bst_module_desc.stands_for). Inside of
 * sim/engine. */
#ifndef BST_ENGINE_SCENARIO_MODULE_SUBSTITUTION_H
#define BST_ENGINE_SCENARIO_MODULE_SUBSTITUTION_H

#include "sim/engine/scenario/scenario.h"

struct cJSON;

/* After the modules of a sensor have been read from `block` (may be NULL): switches either the
 * module that stands in or those that it stands for off, as the sensor's observation_source says;
 * makes the former, with its defaults, where it is needed and the block has none; gives it the
 * settings of the others. BST_ERR_CONFIG where its own block says what is another's to say, and
 * where it is asked for and there is none of the kind. */
bst_status bst_module_substitution(bst_ctx *ctx, const bst_scenario_registry *registry,
                                   const struct cJSON *block, int observer, int sensor,
                                   bst_scenario *scenario) BST_MUST_CHECK;

/* Whether a key of a module's table has its value from a module that it stands for. */
bool bst_module_substitution_taken(const bst_scenario *scenario,
                                   const bst_scenario_module_config *module, const char *key);
/* Whether the delays of its inputs come from modules that it stands for. */
bool bst_module_substitution_delayed(const bst_scenario *scenario,
                                     const bst_scenario_module_config *module);

#endif
