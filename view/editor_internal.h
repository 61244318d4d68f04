/* Internal functions of the editor, shared by editor.c and editor_files.c. */
#ifndef BST_VIEW_EDITOR_INTERNAL_H
#define BST_VIEW_EDITOR_INTERNAL_H

#include "boresight/config.h"
#include "sim/registry/registry.h"

/* Reads a body and finds the text of a key.
 *
 * Returned:  *value  belongs to *json
 * Errors:    BST_ERR_FORMAT: no JSON; BST_ERR_ARGUMENT: no such text
 * Ownership: free *json with bst_json_free */
bst_status bst_view_editor_body(bst_ctx *ctx, const char *body, const char *key, bst_json **json,
                                const char **value) BST_MUST_CHECK;

#endif
