#include "sim/core/folder.h"

#include <errno.h>
#include <stdbool.h>
#include <string.h>
#include <sys/stat.h>

enum { PATH_BYTES = 4096 };

static bst_status make_one(bst_ctx *ctx, const char *path) {
    if (mkdir(path, 0777) == 0) {
        return BST_OK;
    }
    /* a folder that is there may answer EROFS or EACCES before EEXIST */
    int reason = errno;
    struct stat info;
    bool there = stat(path, &info) == 0;
    if (there && S_ISDIR(info.st_mode)) {
        return BST_OK;
    }
    if (reason == EEXIST) { /* a file is in the way, or a link that leads nowhere */
        reason = there ? ENOTDIR : errno;
    }
    return bst_fail(ctx, BST_ERR_IO, "%s: cannot make the folder: %s", path, strerror(reason));
}

bst_status bst_folder_make_above(bst_ctx *ctx, const char *path) {
    char above[PATH_BYTES];
    for (const char *slash = path; *slash && (slash = strchr(slash + 1, '/'));) {
        size_t n = (size_t)(slash - path);
        if (n >= sizeof above) {
            return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", path);
        }
        memcpy(above, path, n);
        above[n] = '\0';
        BST_TRY(make_one(ctx, above));
    }
    return BST_OK;
}

bst_status bst_folder_make(bst_ctx *ctx, const char *path) {
    if (!*path) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "the path of a folder is empty");
    }
    BST_TRY(bst_folder_make_above(ctx, path));
    return make_one(ctx, path);
}
