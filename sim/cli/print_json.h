/* JSON on the standard output or in a file. */
#ifndef BST_CLI_PRINT_JSON_H
#define BST_CLI_PRINT_JSON_H

#include <cjson/cJSON.h>

#include "boresight/status.h"

/* Prints a JSON value with a line end to the standard output.
 *
 * Given:     node  NULL if its maker was out of memory; deleted here
 * Returned:  exit status: BST_EXIT_OK, or BST_EXIT_FAILED after a message on the standard error */
int bst_cli_print_json(cJSON *node);

/* Writes a JSON value to a file, or to the standard output for the path "-".
 *
 * Given:     node  NULL if its maker was out of memory; deleted here
 * Errors:    BST_ERR_MEMORY; BST_ERR_IO with path and reason */
bst_status bst_cli_write_json(bst_ctx *ctx, const char *path, cJSON *node) BST_MUST_CHECK;

#endif
