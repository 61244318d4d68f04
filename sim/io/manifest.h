/* Small files that appear whole or not at all, and the manifest. */
#ifndef BST_IO_MANIFEST_H
#define BST_IO_MANIFEST_H

#include "sim/io/run_store.h"

#ifdef __cplusplus
extern "C" {
#endif

struct cJSON;

/* Writes `bytes` bytes to `path` through a temporary file beside it, flushed and renamed: readers
 * see the old content or the new one. BST_ERR_IO with path and reason; no temporary file is left.
 */
bst_status bst_io_write_file_atomic(bst_ctx *ctx, const char *path, const void *data,
                                    size_t bytes) BST_MUST_CHECK;

/* Writes `json` as "<run>/<name>", pretty-printed, numbers so that they read back to the same
 * double, a newline at the end. "manifest.json" is to be the last file before bst_run_finish. */
bst_status bst_io_run_write_json(bst_ctx *ctx, const bst_run *run, const char *name,
                                 const struct cJSON *json) BST_MUST_CHECK;

#ifdef __cplusplus
}
#endif

#endif
