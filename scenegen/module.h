/* Renderer module: role "scenegen", type "opencl". */
#ifndef BST_SCENEGEN_MODULE_H
#define BST_SCENEGEN_MODULE_H

#include "boresight/module.h"

/* Triggered by `exposure`; reads `los_history`; writes `truth` for every exposure and `frame` for
 * every exposure that is not dropped. Truth items have BST_TRUTH_SATURATED if the source's
 * brightest pixel is expected to fill its well or exceed the highest digital number. The summary
 * counts "saturated" frames (with any such pixel) and "truth_overflow" (more sources than
 * truth_capacity). */
extern const bst_module_desc bst_scenegen_module;

#endif
