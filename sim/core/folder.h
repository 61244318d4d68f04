/* Creates folders and checks their permissions. */
#ifndef BST_CORE_FOLDER_H
#define BST_CORE_FOLDER_H

#include "boresight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Creates a folder and its missing parents; an existing folder is unchanged. BST_ERR_ARGUMENT:
 * empty or too long path; BST_ERR_IO: cannot be created, or is no folder. */
bst_status bst_folder_make(bst_ctx *ctx, const char *path) BST_MUST_CHECK;

/* Creates the missing parents of `path`, but not `path`. As bst_folder_make. */
bst_status bst_folder_make_above(bst_ctx *ctx, const char *path) BST_MUST_CHECK;

/* Checks that only this user and root can write to the folder `path`: it and its parents belong to
 * them, and others have no write permission (parents: except with the sticky bit, such as /tmp).
 * BST_ERR_IO states the reason. */
bst_status bst_folder_check_private(bst_ctx *ctx, const char *path) BST_MUST_CHECK;

/* Creates the folder `path` for this user only (mode 0700), with its parents, if necessary; then as
 * bst_folder_check_private. */
bst_status bst_folder_make_private(bst_ctx *ctx, const char *path) BST_MUST_CHECK;

#ifdef __cplusplus
}
#endif

#endif
