#include "sim/io/manifest.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/core/draft.h"
#include "sim/core/file.h"

bst_status bst_io_write_file_atomic(bst_ctx *ctx, const char *path, const void *data,
                                    size_t bytes) {
    char draft[4160];
    int fd;
    BST_TRY(bst_draft_make(ctx, path, draft, sizeof draft, &fd));
    bool ok = bst_file_write_all(fd, data, bytes) && fsync(fd) == 0;
    int error = ok ? 0 : errno;
    if (close(fd) != 0 && ok) {
        ok = false;
        error = errno;
    }
    if (ok && rename(draft, path) != 0) {
        ok = false;
        error = errno;
    }
    if (!ok) {
        unlink(draft);
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be written: %s", path, strerror(error));
    }
    return BST_OK;
}

bst_status bst_io_run_write_json(bst_ctx *ctx, const bst_run *run, const char *name,
                                 const struct cJSON *json) {
    char path[4096];
    BST_TRY(bst_run_file(ctx, run, name, path, sizeof path));
    char *text = cJSON_Print(json);
    if (!text) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", path);
    }
    /* the newline replaces the terminating zero */
    size_t bytes = strlen(text);
    text[bytes] = '\n';
    bst_status status = bst_io_write_file_atomic(ctx, path, text, bytes + 1);
    cJSON_free(text);
    return status;
}
