#define _DEFAULT_SOURCE /* getentropy */
#include "sim/core/draft.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* number of attempts; a second one is needed once in 1e18 / number of files */
enum { MOST_TRIES = 16 };

static int make(const char *name) {
    return open(name, O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
}

bst_status bst_draft_make(bst_ctx *ctx, const char *path, char *name, size_t bytes, int *fd) {
    struct stat info;
    *fd = -1;
    if (stat(path, &info) == 0 && !S_ISREG(info.st_mode)) {
        /* a rename would replace a device or pipe by a file */
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: is not a regular file; give another path",
                        path);
    }
    for (int i = 0; i < MOST_TRIES && *fd < 0; i++) {
        uint64_t number = 0;
        if (getentropy(&number, sizeof number) != 0) {
            number = (uint64_t)getpid() + (uint64_t)i;
        }
        int n = snprintf(name, bytes, "%s.tmp.%018" PRIu64, path,
                         number % UINT64_C(1000000000000000000));
        if (n < 0 || (size_t)n >= bytes) {
            return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", path);
        }
        *fd = make(name);
        if (*fd < 0 && errno != EEXIST) {
            break;
        }
    }
    return *fd >= 0 ? BST_OK
                    : bst_fail(ctx, BST_ERR_IO, "%s: cannot be made: %s", path, strerror(errno));
}

bst_status bst_draft_make_at(bst_ctx *ctx, const char *path, int *fd) {
    unlink(path);
    *fd = make(path);
    return *fd >= 0 ? BST_OK
                    : bst_fail(ctx, BST_ERR_IO, "%s: cannot be made: %s", path, strerror(errno));
}

bool bst_draft_is_name(const char *name) {
    const char *end = strrchr(name, '.');
    return end && end[1] && end[1 + strspn(end + 1, "0123456789")] == '\0' && end - name > 4 &&
           strncmp(end - 4, ".tmp", 4) == 0;
}
