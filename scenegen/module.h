/* The renderer as a module: role "scenegen", type "opencl". */
#ifndef BST_SCENEGEN_MODULE_H
#define BST_SCENEGEN_MODULE_H

#include "boresight/module.h"

/* Triggered by `exposure`; reads `los_history`; writes `truth` for every exposure and `frame` for
 * every one that is not dropped. Truth items carry BST_TRUTH_SATURATED when the source's brightest
 * pixel is expected to fill its well or to exceed the highest digital number. The summary counts
 * "saturated" frames (any pixel so) and "truth_overflow" (more sources than truth_capacity). */
extern const bst_module_desc bst_scenegen_module;

#endif
