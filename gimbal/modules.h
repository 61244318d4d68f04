/* The gimbal types that a scenario can name. */
#ifndef BST_GIMBAL_MODULES_H
#define BST_GIMBAL_MODULES_H

#include "sim/core/module.h"

extern const bst_module_desc bst_gimbal_two_axis_module; /* role "gimbal", type "two_axis" */
extern const bst_module_desc bst_gimbal_ideal_module;    /* role "gimbal", type "ideal" */
extern const bst_module_desc bst_gimbal_scripted_module; /* role "gimbal", type "scripted" */

#endif
