/* What the start page lists: shipped scenarios, and the runs in the folder runs/. */
#ifndef BST_VIEW_START_PAGE_H
#define BST_VIEW_START_PAGE_H

#include "view/subject.h"

/* Lists scenarios and the newest runs: {"folder": working folder, "scenarios": as
 * bst_view_scenarios_add, "runs": [{name, state, scenario, ended, modified_s, picture}]}.
 *
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with cJSON_Delete */
bst_status bst_view_start_list(bst_ctx *ctx, cJSON **out) BST_MUST_CHECK;

/* Path of a listed scenario by its file name, or of a listed run by its name.
 *
 * Given:     name   as listed: one part of a path, no leading dot
 *            bytes  room at `path`
 * Errors:    BST_ERR_NOT_FOUND */
bst_status bst_view_start_scenario(bst_ctx *ctx, const char *name, char *path,
                                   size_t bytes) BST_MUST_CHECK;
/* Path of the folder of a listed run, as bst_view_start_scenario. */
bst_status bst_view_start_run(bst_ctx *ctx, const char *name, char *path,
                              size_t bytes) BST_MUST_CHECK;
/* Picture of a listed run, as PNG.
 *
 * Errors:    BST_ERR_NOT_FOUND: no such run, or no picture; BST_ERR_MEMORY */
bst_status bst_view_start_picture(bst_ctx *ctx, const char *name,
                                  bst_view_bytes *out) BST_MUST_CHECK;

#endif
