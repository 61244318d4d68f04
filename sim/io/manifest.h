/* Writes small files atomically, such as manifest.json of a run. */
#ifndef BST_IO_MANIFEST_H
#define BST_IO_MANIFEST_H

#include "sim/io/run_store.h"

#ifdef __cplusplus
extern "C" {
#endif

struct cJSON;

/* Writes `bytes` bytes to `path` by a temporary file that is flushed and renamed: readers see the
 * old or the new content. BST_ERR_IO with path and reason; no temporary file remains. */
bst_status bst_io_write_file_atomic(bst_ctx *ctx, const char *path, const void *data,
                                    size_t bytes) BST_MUST_CHECK;

/* Writes `json` to "<run>/<name>", indented, with numbers that are recovered exactly. Write
 * "manifest.json" last, before bst_run_finish. */
bst_status bst_io_run_write_json(bst_ctx *ctx, const bst_run *run, const char *name,
                                 const struct cJSON *json) BST_MUST_CHECK;

#ifdef __cplusplus
}
#endif

#endif
