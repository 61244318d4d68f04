#include "sim/core/file.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static const char *kind_of(mode_t mode) {
    return S_ISDIR(mode)                    ? "a folder"
           : S_ISFIFO(mode)                 ? "a pipe"
           : S_ISCHR(mode) || S_ISBLK(mode) ? "a device"
           : S_ISSOCK(mode)                 ? "a socket"
                                            : "no regular file";
}

bst_status bst_file_open(bst_ctx *ctx, const char *path, uint64_t max_bytes, const char *expected,
                         int *fd, uint64_t *bytes) {
    *fd = -1;
    *bytes = 0;
    /* O_NONBLOCK: opening a pipe without writer would block */
    int opened = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    if (opened < 0) {
        return bst_fail(ctx, errno == ENOENT ? BST_ERR_NOT_FOUND : BST_ERR_IO,
                        "%.400s: cannot be opened: %s; give %s", path, strerror(errno), expected);
    }
    struct stat info;
    bst_status status = BST_OK;
    if (fstat(opened, &info) != 0) {
        status = bst_fail(ctx, BST_ERR_IO, "%.400s: cannot be read: %s", path, strerror(errno));
    } else if (!S_ISREG(info.st_mode)) {
        status = bst_fail(ctx, BST_ERR_IO, "%.400s: is %s; give %s", path, kind_of(info.st_mode),
                          expected);
    } else if ((uint64_t)info.st_size > max_bytes) {
        status = bst_fail(ctx, BST_ERR_FORMAT,
                          "%.400s: too large (found %" PRIu64 " bytes; allowed: at most %" PRIu64
                          "); give %s",
                          path, (uint64_t)info.st_size, max_bytes, expected);
    }
    if (status != BST_OK) {
        close(opened);
        return status;
    }
    *fd = opened;
    *bytes = (uint64_t)info.st_size;
    return BST_OK;
}

bst_status bst_file_read(bst_ctx *ctx, const char *path, uint64_t max_bytes, const char *expected,
                         char **out, size_t *bytes) {
    *out = NULL;
    *bytes = 0;
    int fd;
    uint64_t size;
    BST_TRY(bst_file_open(ctx, path, max_bytes, expected, &fd, &size));
    char *data = size < SIZE_MAX ? malloc((size_t)size + 1) : NULL;
    if (!data) {
        close(fd);
        return bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory for its %" PRIu64 " bytes", path,
                        size);
    }
    size_t used = 0;
    ssize_t got = 1;
    while (used < size && got > 0) {
        got = read(fd, data + used, (size_t)size - used);
        if (got < 0 && errno == EINTR) {
            got = 1;
        } else if (got > 0) {
            used += (size_t)got;
        }
    }
    int error = errno;
    close(fd);
    if (got < 0) {
        free(data);
        return bst_fail(ctx, BST_ERR_IO, "%.400s: cannot be read: %s", path, strerror(error));
    }
    data[used] = '\0';
    *out = data;
    *bytes = used;
    return BST_OK;
}

bst_status bst_file_check_text(bst_ctx *ctx, const char *name, const char *text, size_t bytes) {
    if (bytes >= 2 && (memcmp(text, "\xFF\xFE", 2) == 0 || memcmp(text, "\xFE\xFF", 2) == 0)) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "%.400s:1: the file is UTF-16 text (allowed: ASCII or UTF-8)", name);
    }
    const char *zero = bytes ? memchr(text, '\0', bytes) : NULL;
    if (!zero) {
        return BST_OK;
    }
    int line = 1;
    for (const char *c = text; c < zero; c++) {
        line += *c == '\n';
    }
    return bst_fail(ctx, BST_ERR_FORMAT,
                    "%.400s:%d: a zero byte: the file is not text (allowed: ASCII or UTF-8)", name,
                    line);
}

bool bst_file_write_all(int fd, const void *data, size_t bytes) {
    const char *next = data;
    while (bytes > 0) {
        ssize_t n = write(fd, next, bytes);
        if (n < 0 && errno != EINTR) {
            return false;
        }
        if (n > 0) {
            next += n;
            bytes -= (size_t)n;
        }
    }
    return true;
}

void bst_file_resolve(const char *base_dir, const char *file, char *out, size_t bytes) {
    bool relative = *file && *file != '/' && *base_dir;
    snprintf(out, bytes, "%s%s%s", relative ? base_dir : "", relative ? "/" : "", file);
}
