#include "sim/device/kernel_cache.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

/* Why a folder cannot be written, or made where it is not there yet; 0 when it can. */
static int folder_error(char *path) {
    struct stat info;
    while (stat(path, &info) != 0) {
        char *slash = strrchr(path, '/');
        if (errno != ENOENT || !slash) {
            return errno;
        }
        /* the folder above decides */
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

bool bst_kernel_cache_is_unusable(char *text, size_t bytes) {
    const char *given = getenv("POCL_CACHE_DIR"), *cache = getenv("XDG_CACHE_HOME"),
               *home = getenv("HOME");
    char path[4096], walked[4096];
    if (given) {
        snprintf(path, sizeof path, "%s", given);
    } else if (cache) {
        snprintf(path, sizeof path, "%s/pocl/kcache", cache);
    } else if (home) {
        snprintf(path, sizeof path, "%s/.cache/pocl/kcache", home);
    } else {
        snprintf(path, sizeof path, "/tmp/pocl/kcache");
    }
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
