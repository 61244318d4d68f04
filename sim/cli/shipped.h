/* Finds files shipped with the program: scenarios and their element sets. */
#ifndef BST_CLI_SHIPPED_H
#define BST_CLI_SHIPPED_H

#include <stddef.h>

#include "boresight/status.h"

/* Path of the shipped file "scenarios/NAME": in PREFIX/share/boresight of an installation
 * (../share/boresight from its folder), in the parent folder of a build, else in the working
 * folder. Returned: path, or `name` if not found. */
void bst_cli_shipped_file(const char *name, char *path, size_t bytes);

/* Finds a keyword map: a path with a dot in it, or the name of a map in scenarios/maps.
 *
 * Returned:  path  [4096]
 * Errors:    BST_ERR_NOT_FOUND, with the shipped names */
bst_status bst_cli_find_keyword_map(bst_ctx *ctx, const char *name, char *path) BST_MUST_CHECK;

#endif
