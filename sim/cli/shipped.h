/* Files that come with the program: scenarios and their element sets. */
#ifndef BST_CLI_SHIPPED_H
#define BST_CLI_SHIPPED_H

#include <stddef.h>

/* Finds "scenarios/NAME" as the program has it: of the installed one PREFIX/share/boresight
 * (../share/boresight from its folder), of a build the folder above its own, else the working
 * folder. Returned: path, `name` itself where there is none. */
void bst_cli_shipped_file(const char *name, char *path, size_t bytes);

#endif
