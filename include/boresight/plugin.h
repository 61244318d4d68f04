/* Plug-ins of the program itself: a program that holds simulations gives its own modules and stages
 * a name, and scenarios name them in the key "plugin" as they name a library. */
#ifndef BORESIGHT_PLUGIN_H
#define BORESIGHT_PLUGIN_H

#include "boresight/module.h"
#include "boresight/stage.h"

#pragma GCC visibility push(default)

/* Registers modules and stages under a name, for scenarios that are read from now on.
 *
 * Given:     name     1 to 120 printable characters with a ":" and without "/" ("python:mine"). A
 *                     second registration of a name replaces the first one
 *            sha256   64 hexadecimal digits: digest of what the plug-in is made of, for manifests.
 * A study refuses to go on with another one. NULL: none modules  ends with NULL; NULL: none stages
 * ends with NULL; NULL: none. With neither, the name is removed Errors:    BST_ERR_ARGUMENT: the
 * name or the digest; BST_ERR_CONFIG: a descriptor of another interface version, or without what it
 * must have; BST_ERR_MEMORY Ownership: lists and descriptors must stay valid as long as the process
 * uses scenarios that name them Notes:     any thread. In this process only: the program
 * `boresight` does not know the name. */
bst_status bst_plugin_register(bst_ctx *ctx, const char *name, const char *sha256,
                               const bst_module_desc *const *modules,
                               const bst_stage_desc *const *stages) BST_MUST_CHECK;

#pragma GCC visibility pop

#endif
