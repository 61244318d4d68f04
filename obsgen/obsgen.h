/* Observation generator module: detections from the truth, in place of rendering and image
 * processing. */
#ifndef BST_OBSGEN_OBSGEN_H
#define BST_OBSGEN_OBSGEN_H

#include "boresight/module.h"

extern const bst_module_desc bst_obsgen_module;

#endif
