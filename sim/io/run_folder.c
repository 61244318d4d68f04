/* The folder of a run that is being written: paths and checks. */
#include <stdio.h>
#include <sys/stat.h>

#include "sim/io/run_internal.h"

bst_status bst_run_path_join(bst_ctx *ctx, char *buffer, size_t bytes, const char *folder,
                             const char *name) {
    int n = snprintf(buffer, bytes, "%s/%s", folder, name);
    if (n < 0 || (size_t)n >= bytes) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s/%s: the path is too long", folder, name);
    }
    return BST_OK;
}

const char *bst_run_folder(const bst_run *run) {
    return run->folder;
}

bst_status bst_run_file(bst_ctx *ctx, const bst_run *run, const char *name, char *buffer,
                        size_t bytes) {
    return bst_run_path_join(ctx, buffer, bytes, run->folder, name);
}

bst_status bst_run_check_folder(bst_ctx *ctx, const bst_run *run) {
    char path[BST_RUN_PATH_BYTES];
    struct stat held, named;
    BST_TRY(bst_run_path_join(ctx, path, sizeof path, run->folder, BST_RUN_LOCK));
    if (stat(path, &named) != 0 || fstat(run->lock, &held) != 0 || held.st_ino != named.st_ino ||
        held.st_dev != named.st_dev) {
        return bst_fail(
            ctx, BST_ERR_IO,
            "%s: the folder was removed, moved or replaced while the run was writing it",
            run->folder);
    }
    return BST_OK;
}
