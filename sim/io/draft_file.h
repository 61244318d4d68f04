/* Files that are written row by row and appear whole or not at all. */
#ifndef BST_IO_DRAFT_FILE_H
#define BST_IO_DRAFT_FILE_H

#include <stdio.h>

#include "boresight/status.h"

typedef struct bst_draft {
    FILE *stream;
    char path[4096], name[4160]; /* final name; while it is written, "" of a device */
} bst_draft;

/* Opens a temporary file (bst_draft_make) beside `path` for writing. BST_ERR_IO with path and
 * reason; BST_ERR_ARGUMENT where a folder or pipe is there. A character device, such as /dev/null,
 * is written to as it is. */
bst_status bst_draft_open(bst_ctx *ctx, const char *path, bst_draft *out) BST_MUST_CHECK;

/* With BST_OK: flushes it to disk and gives it its name, replacing what was there. With another
 * status, or when that fails: removes it. Closes in every case; returns `status`, or BST_ERR_IO
 * with path and reason. */
bst_status bst_draft_close(bst_ctx *ctx, bst_draft *draft, bst_status status) BST_MUST_CHECK;

/* Removes drafts, files with a name of bst_draft_make, that killed programs left
 * in a folder. Nobody else may be writing there. */
void bst_draft_sweep(const char *folder);

#endif
