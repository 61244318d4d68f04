/* Creates draft files: temporary names for files that are being written. */
#ifndef BST_CORE_DRAFT_H
#define BST_CORE_DRAFT_H

#include <stdbool.h>
#include <stddef.h>

#include "boresight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Creates a new, empty draft file beside `path` and opens it for reading and writing. Its name,
 * PATH.tmp.DIGITS, is random, and the file is created exclusively (O_EXCL): existing files and
 * symbolic links are never followed.
 * Given: path: final path of the file; bytes: size of `name`.
 * Returned: name of the draft; *fd, which the caller closes. Complete it by rename(),
 *           which replaces a symbolic link at `path` and does not follow it. Errors:
 * BST_ERR_ARGUMENT: the path is too long, or a folder, device or pipe is there; BST_ERR_IO: the
 * file cannot be made, with path and reason. */
bst_status bst_draft_make(bst_ctx *ctx, const char *path, char *name, size_t bytes,
                          int *fd) BST_MUST_CHECK;

/* Replaces the file or link `path` by a new, empty file, created exclusively as by bst_draft_make,
 * and opens it for reading and writing. BST_ERR_IO. */
bst_status bst_draft_make_at(bst_ctx *ctx, const char *path, int *fd) BST_MUST_CHECK;

/* True if a file name has the form of bst_draft_make. */
bool bst_draft_is_name(const char *name);

#ifdef __cplusplus
}
#endif

#endif
