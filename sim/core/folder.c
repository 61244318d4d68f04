#define _XOPEN_SOURCE 700 /* realpath */
#include "sim/core/folder.h"

#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { PATH_BYTES = 4096 };

/* Creates a folder unless it exists. */
static bst_status make_one(bst_ctx *ctx, const char *path) {
    if (mkdir(path, 0777) == 0) {
        return BST_OK;
    }
    /* an existing folder may cause EROFS or EACCES instead of EEXIST */
    int reason = errno;
    struct stat info;
    bool there = stat(path, &info) == 0;
    if (there && S_ISDIR(info.st_mode)) {
        return BST_OK;
    }
    if (reason == EEXIST) { /* a file or a dangling link has this name */
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

enum { OVERFLOW_USER = 65534 }; /* user that Linux shows if a container does not map one */

/* Describes wrong owner or mode of a folder; NULL: none. */
static const char *fault_of(const struct stat *info, bool above) {
    bool unknown = above && info->st_uid == OVERFLOW_USER;
    if (info->st_uid != geteuid() && info->st_uid != 0 && !unknown) {
        return "belongs to another user";
    }
    if (above && (info->st_mode & S_ISVTX)) {
        return NULL;
    }
    bool group = (info->st_mode & S_IWGRP) && info->st_gid != getegid() && info->st_gid != 0;
    return (info->st_mode & S_IWOTH) || group ? "can be written to by others" : NULL;
}

bst_status bst_folder_check_private(bst_ctx *ctx, const char *path) {
    char *real = realpath(path, NULL);
    bst_status status = real ? BST_OK : bst_fail(ctx, BST_ERR_IO, "%s: %s", path, strerror(errno));
    bool above = false;
    while (status == BST_OK) {
        struct stat info;
        const char *fault = NULL;
        if (stat(real, &info) != 0) {
            fault = strerror(errno);
        } else if (!S_ISDIR(info.st_mode)) {
            fault = strerror(ENOTDIR);
        } else {
            fault = fault_of(&info, above);
        }
        if (fault) {
            status = bst_fail(ctx, BST_ERR_IO, "%s: %s%s%s", path, above ? real : "",
                              above ? " " : "", fault);
        }
        char *slash = strrchr(real, '/');
        if (!slash || !real[1]) {
            break;
        }
        slash[slash == real] = '\0';
        above = true;
    }
    free(real);
    return status;
}

bst_status bst_folder_make_private(bst_ctx *ctx, const char *path) {
    BST_TRY(bst_folder_make_above(ctx, path));
    if (mkdir(path, 0700) != 0 && errno != EEXIST) {
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot make the folder: %s", path, strerror(errno));
    }
    return bst_folder_check_private(ctx, path);
}
