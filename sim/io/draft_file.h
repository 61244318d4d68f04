/* Draft files: written row by row under a temporary name, renamed when complete. */
#ifndef BST_IO_DRAFT_FILE_H
#define BST_IO_DRAFT_FILE_H

#include <stdio.h>

#include "boresight/status.h"

typedef struct bst_draft {
    FILE *stream;
    char path[4096], name[4160]; /* final name; name of the draft, "" for a device */
} bst_draft;

/* Opens a draft (bst_draft_make) beside `path` for writing. BST_ERR_IO with path and reason;
 * BST_ERR_ARGUMENT: `path` is a folder or pipe. A character device such as /dev/null is written
 * directly. */
bst_status bst_draft_open(bst_ctx *ctx, const char *path, bst_draft *out) BST_MUST_CHECK;

/* Closes a draft. With status BST_OK it flushes the file to disk and renames it, replacing an older
 * file. Otherwise, or on failure, it removes the draft. Returns `status`, or BST_ERR_IO with path
 * and reason. */
bst_status bst_draft_close(bst_ctx *ctx, bst_draft *draft, bst_status status) BST_MUST_CHECK;

/* Removes drafts (names of bst_draft_make) of killed programs from a folder. No other program may
 * be writing there. */
void bst_draft_sweep(const char *folder);

#endif
