/* Controller modules that a scenario can name. */
#ifndef BST_CONTROL_MODULES_H
#define BST_CONTROL_MODULES_H

#include "boresight/module.h"

extern const bst_module_desc bst_control_standard_module; /* role "control", type "standard" */
extern const bst_module_desc bst_tasking_priority_module; /* role "tasking", type "priority" */

#endif
