/* Making folders. */
#ifndef BST_CORE_FOLDER_H
#define BST_CORE_FOLDER_H

#include "boresight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Makes a folder and those above it that are missing; one that is there is left as it is.
 * BST_ERR_ARGUMENT: the path is empty or too long; BST_ERR_IO: one of them cannot be made, or is no
 * folder. */
bst_status bst_folder_make(bst_ctx *ctx, const char *path) BST_MUST_CHECK;

/* Makes what is missing above `path`, which itself is left alone. As bst_folder_make. */
bst_status bst_folder_make_above(bst_ctx *ctx, const char *path) BST_MUST_CHECK;

/* Checks that nobody but this user and root can have put files into the folder `path`: it and the
 * folders above it belong to one of both, and others may not write there (above it: only into a
 * folder with the sticky bit, such as /tmp). BST_ERR_IO says what is wrong, also when it is no
 * folder. */
bst_status bst_folder_check_private(bst_ctx *ctx, const char *path) BST_MUST_CHECK;

/* Makes the folder `path` for this user alone (mode 0700) where it is missing, and what is missing
 * above; then as bst_folder_check_private. */
bst_status bst_folder_make_private(bst_ctx *ctx, const char *path) BST_MUST_CHECK;

#ifdef __cplusplus
}
#endif

#endif
