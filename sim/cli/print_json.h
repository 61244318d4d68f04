/* JSON on the standard output. */
#ifndef BST_CLI_PRINT_JSON_H
#define BST_CLI_PRINT_JSON_H

#include <cjson/cJSON.h>

/* Prints a JSON value with a line end to the standard output.
 *
 * Given:     node  NULL if its maker was out of memory; deleted here
 * Returned:  exit status: BST_EXIT_OK, or BST_EXIT_FAILED after a message on the standard error */
int bst_cli_print_json(cJSON *node);

#endif
