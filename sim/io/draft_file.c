#include "sim/io/draft_file.h"

#include <dirent.h>
#include <errno.h>
#include <stdbool.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

bst_status bst_draft_open(bst_ctx *ctx, const char *path, bst_draft *out) {
    int n = snprintf(out->path, sizeof out->path, "%s", path);
    if (n < 0 || (size_t)n >= sizeof out->path) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", path);
    }
    struct stat info;
    if (stat(path, &info) == 0 && !S_ISREG(info.st_mode)) {
        /* a rename would put a file in the place of a device or a pipe */
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: is not a regular file; give another path",
                        path);
    }
    snprintf(out->name, sizeof out->name, "%s.tmp.%ld", out->path, (long)getpid());
    out->stream = fopen(out->name, "wbe");
    if (!out->stream) {
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be made: %s", path, strerror(errno));
    }
    return BST_OK;
}

bst_status bst_draft_close(bst_ctx *ctx, bst_draft *draft, bst_status status) {
    int error = 0;
    if (fflush(draft->stream) != 0 || fsync(fileno(draft->stream)) != 0) {
        error = errno;
    } else if (ferror(draft->stream)) {
        error = EIO;
    }
    if (fclose(draft->stream) != 0 && !error) {
        error = errno;
    }
    if (status == BST_OK && !error && rename(draft->name, draft->path) != 0) {
        error = errno;
    }
    if (status == BST_OK && !error) {
        return BST_OK;
    }
    unlink(draft->name);
    return status != BST_OK ? status
                            : bst_fail(ctx, BST_ERR_IO, "%s: cannot be written: %s", draft->path,
                                       strerror(error));
}

/* NAME.tmp.PROCESS */
static bool is_draft(const char *name) {
    const char *end = strrchr(name, '.');
    return end && end[1] && end[1 + strspn(end + 1, "0123456789")] == '\0' && end - name > 4 &&
           strncmp(end - 4, ".tmp", 4) == 0;
}

void bst_draft_sweep(const char *folder) {
    DIR *dir = opendir(folder);
    for (struct dirent *entry; dir && (entry = readdir(dir)) != NULL;) {
        if (is_draft(entry->d_name)) {
            (void)unlinkat(dirfd(dir), entry->d_name, 0); /* not a folder */
        }
    }
    if (dir) {
        closedir(dir);
    }
}
