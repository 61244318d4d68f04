/* Names of files that are being written. */
#ifndef BST_CORE_DRAFT_H
#define BST_CORE_DRAFT_H

#include <stdbool.h>
#include <stddef.h>

#include "boresight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Makes a new, empty file beside `path` and opens it for reading and writing. Its name,
 * PATH.tmp.DIGITS, is drawn at random, and the file is made exclusively (O_EXCL): neither a file
 * nor a symbolic link that somebody else put there is ever written through.
 * Given: path, where the file goes when it is complete; bytes, the room of `name`.
 * Returned: name of the draft; *fd, which the caller closes. Who has written it gives it its name
 * by rename(), which replaces a symbolic link at `path` and does not follow it. Errors:
 * BST_ERR_ARGUMENT: the path is too long, or a folder, device or pipe is there; BST_ERR_IO: the
 * file cannot be made, with path and reason. */
bst_status bst_draft_make(bst_ctx *ctx, const char *path, char *name, size_t bytes,
                          int *fd) BST_MUST_CHECK;

/* Makes a new, empty file called `path` and opens it for reading and writing, after removing the
 * file or link that is there. The file is made exclusively, as by bst_draft_make. BST_ERR_IO. */
bst_status bst_draft_make_at(bst_ctx *ctx, const char *path, int *fd) BST_MUST_CHECK;

/* Whether a file's name is one that bst_draft_make gives. */
bool bst_draft_is_name(const char *name);

#ifdef __cplusplus
}
#endif

#endif
