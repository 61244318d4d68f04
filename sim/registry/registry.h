/* Registry of all modules shipped with Boresight. */
#ifndef BST_REGISTRY_REGISTRY_H
#define BST_REGISTRY_REGISTRY_H

#include "sim/core/former_names.h"
#include "sim/engine/scenario/scenario.h"

/* All modules that a scenario can name; static storage. */
const bst_scenario_registry *bst_registry_shipped(void);

/* Tables of scenarios with these modules, for bst_json_load_described. Static. */
const bst_document_tables *bst_registry_tables(void);

#endif
