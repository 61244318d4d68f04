#define _XOPEN_SOURCE 700 /* setenv */
#include "sim/device/kernel_cache.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "sim/core/folder.h"
#include "sim/device/kernel_cache_check.h"

/* Reason why a folder cannot be written or created (errno); 0: it can. */
static int folder_error(char *path) {
    struct stat info;
    while (stat(path, &info) != 0) {
        char *slash = strrchr(path, '/');
        if (errno != ENOENT || !slash) {
            return errno;
        }
        /* the parent folder decides */
        slash[slash == path] = '\0';
    }
    struct statvfs disk;
    if (!S_ISDIR(info.st_mode)) {
        return ENOTDIR;
    }
    if (access(path, W_OK | X_OK) != 0) {
        return errno;
    }
    return statvfs(path, &disk) == 0 && disk.f_bavail == 0 ? ENOSPC : 0;
}

/* Path of PoCL's cache folder, by PoCL's rules. */
static void cache_path(char path[4096]) {
    const char *given = getenv("POCL_CACHE_DIR"), *cache = getenv("XDG_CACHE_HOME"),
               *home = getenv("HOME");
    if (given) {
        snprintf(path, 4096, "%s", given);
    } else if (cache) {
        snprintf(path, 4096, "%s/pocl/kcache", cache);
    } else if (home) {
        snprintf(path, 4096, "%s/.cache/pocl/kcache", home);
    } else {
        snprintf(path, 4096, "/tmp/pocl/kcache");
    }
}

/* Selects the cache folder; see bst_kernel_cache_prepare. */
static bst_status choose(bst_ctx *ctx, char path[4096]) {
    bst_ctx quiet = {0};
    bool given = getenv("POCL_CACHE_DIR") != NULL;
    bool home = getenv("XDG_CACHE_HOME") || getenv("HOME");
    cache_path(path);
    if ((given || home) && bst_folder_make_private(&quiet, path) == BST_OK) {
        return BST_OK;
    }
    struct stat info;
    if (given && stat(path, &info) != 0) {
        return BST_OK; /* bst_kernel_cache_is_unusable reports a folder that cannot be written */
    }
    if (given && !S_ISDIR(info.st_mode)) {
        return BST_OK;
    }
    if (!given) {
        snprintf(path, 4096, "/tmp/boresight-%ld", (long)geteuid());
        if (bst_folder_make_private(&quiet, path) == BST_OK) {
            snprintf(path, 4096, "/tmp/boresight-%ld/kcache", (long)geteuid());
            if (bst_folder_make_private(&quiet, path) == BST_OK &&
                setenv("POCL_CACHE_DIR", path, 1) == 0) {
                return BST_OK;
            }
        }
    }
    return bst_fail(
        ctx, BST_ERR_DEVICE,
        "the cache of compiled kernels is not safe: %.500s; programs in it would be run "
        "as this user: set POCL_CACHE_DIR to a folder of your own",
        quiet.message);
}

bst_status bst_kernel_cache_prepare(bst_ctx *ctx) {
    char path[4096];
    BST_TRY(choose(ctx, path));
    int removed = bst_kernel_cache_repair(path);
    if (removed > 0) {
        bst_log(ctx, BST_LOG_WARNING, "%.500s: %d damaged program%s removed, to be built anew",
                path, removed, removed == 1 ? "" : "s");
    }
    return BST_OK;
}

void bst_kernel_cache_take(const char *folder) {
    char path[4096];
    bst_ctx quiet = {0};
    cache_path(path);
    if (bst_folder_check_private(&quiet, path) == BST_OK) {
        bst_kernel_cache_link(path, folder);
    }
    setenv("POCL_CACHE_DIR", folder, 1);
}

void bst_kernel_cache_settle(time_t since) {
    char path[4096];
    cache_path(path);
    bst_kernel_cache_note(path, since);
}

bool bst_kernel_cache_is_unusable(char *text, size_t bytes) {
    char path[4096], walked[4096];
    cache_path(path);
    memcpy(walked, path, sizeof walked);
    int error = folder_error(walked);
    if (error) {
        snprintf(text, bytes,
                 "PoCL cannot write its kernel cache %.400s: %s; set POCL_CACHE_DIR to a folder "
                 "that can be written",
                 path, strerror(error));
    }
    return error != 0;
}
