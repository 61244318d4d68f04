/* Finds files shipped with the program: scenarios and their element sets. */
#ifndef BST_CLI_SHIPPED_H
#define BST_CLI_SHIPPED_H

#include <stddef.h>

/* Path of the shipped file "scenarios/NAME": in PREFIX/share/boresight of an installation
 * (../share/boresight from its folder), in the parent folder of a build, else in the working
 * folder. Returned: path, or `name` if not found. */
void bst_cli_shipped_file(const char *name, char *path, size_t bytes);

#endif
