#include "sim/io/draft_file.h"

#include <dirent.h>
#include <errno.h>
#include <stdbool.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/core/draft.h"

bst_status bst_draft_open(bst_ctx *ctx, const char *path, bst_draft *out) {
    int n = snprintf(out->path, sizeof out->path, "%s", path);
    if (n < 0 || (size_t)n >= sizeof out->path) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", path);
    }
    struct stat info;
    if (stat(path, &info) == 0 && S_ISCHR(info.st_mode)) {
        out->name[0] = '\0';
        out->stream = fopen(path, "we");
        return out->stream
                   ? BST_OK
                   : bst_fail(ctx, BST_ERR_IO, "%s: cannot be opened: %s", path, strerror(errno));
    }
    int fd;
    BST_TRY(bst_draft_make(ctx, path, out->name, sizeof out->name, &fd));
    out->stream = fdopen(fd, "wb");
    if (!out->stream) {
        close(fd);
        unlink(out->name);
        return bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", path);
    }
    return BST_OK;
}

bst_status bst_draft_close(bst_ctx *ctx, bst_draft *draft, bst_status status) {
    int error = 0;
    bool device = !draft->name[0];
    if (fflush(draft->stream) != 0 || (!device && fsync(fileno(draft->stream)) != 0)) {
        error = errno;
    } else if (ferror(draft->stream)) {
        error = EIO;
    }
    if (fclose(draft->stream) != 0 && !error) {
        error = errno;
    }
    if (status == BST_OK && !error && !device && rename(draft->name, draft->path) != 0) {
        error = errno;
    }
    if (status == BST_OK && !error) {
        return BST_OK;
    }
    if (!device) {
        unlink(draft->name);
    }
    return status != BST_OK ? status
                            : bst_fail(ctx, BST_ERR_IO, "%s: cannot be written: %s", draft->path,
                                       strerror(error));
}

void bst_draft_sweep(const char *folder) {
    DIR *dir = opendir(folder);
    for (struct dirent *entry; dir && (entry = readdir(dir)) != NULL;) {
        if (bst_draft_is_name(entry->d_name)) {
            (void)unlinkat(dirfd(dir), entry->d_name, 0); /* fails on folders, which stay */
        }
    }
    if (dir) {
        closedir(dir);
    }
}
