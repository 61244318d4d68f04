/* Gimbal module types that a scenario can name. */
#ifndef BST_GIMBAL_MODULES_H
#define BST_GIMBAL_MODULES_H

#include "boresight/module.h"

extern const bst_module_desc bst_gimbal_second_order_module; /* role "gimbal", "second_order" */
extern const bst_module_desc bst_gimbal_azimuth_elevation_module;
extern const bst_module_desc bst_gimbal_cross_elevation_module;
extern const bst_module_desc bst_gimbal_ideal_module;    /* type "ideal" */
extern const bst_module_desc bst_gimbal_scripted_module; /* type "scripted" */
extern const bst_module_desc bst_gimbal_external_module; /* type "external" */

#endif
