/* Modules of type "external": parts that a peer of the link plays. */
#ifndef BST_LINK_EXTERNAL_H
#define BST_LINK_EXTERNAL_H

#include "sim/core/module.h"
#include "sim/link/wire.h"

extern const bst_module_desc bst_external_imgproc_module;
extern const bst_module_desc bst_external_tracker_module;
extern const bst_module_desc bst_external_control_module;

/* The message of a channel; BST_LINK_TYPES where the link has none. */
bst_link_type bst_external_type(const char *channel);
/* Whether there is a module of type "external" for a role. */
bool bst_external_role(const char *role);

#endif
