#include "sim/studies/gather.h"

#include <dirent.h>
#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/core/file.h"
#include "sim/io/draft_file.h"

static bst_status copy_file(bst_ctx *ctx, const char *from, const char *to) {
    char *text;
    size_t bytes;
    bst_draft draft;
    BST_TRY(bst_file_read(ctx, from, SIZE_MAX, "the rows of a shard", &text, &bytes));
    bst_status status = bst_draft_open(ctx, to, &draft);
    if (status == BST_OK) {
        fwrite(text, 1, bytes, draft.stream);
        status = bst_draft_close(ctx, &draft, BST_OK);
    }
    free(text);
    return status;
}

/* True if `name` ends as the files of complete shards do. */
static bool is_shard(const char *name) {
    size_t n = strlen(name);
    return n > 5 && strcmp(name + n - 5, ".rows") == 0;
}

/* Loads one file, and copies it unless there is one of this name. */
static bst_status gather_file(bst_ctx *ctx, bst_results *results, const char *path, const char *to,
                              int64_t *files) {
    bst_ctx quiet = {0};
    bst_status status = bst_results_load(&quiet, results, path);
    if (status == BST_ERR_FORMAT || status == BST_ERR_NOT_FOUND) {
        bst_log(ctx, BST_LOG_WARNING, "%s; it is left out", quiet.message);
        return BST_OK;
    }
    if (status != BST_OK) {
        return bst_fail(ctx, status, "%s", quiet.message);
    }
    if (access(to, F_OK) != 0) {
        BST_TRY(copy_file(ctx, path, to));
        ++*files;
    }
    return BST_OK;
}

bst_status bst_study_gather_check(bst_ctx *ctx, const char *from) {
    char folder[4200];
    struct stat info;
    snprintf(folder, sizeof folder, "%.4000s/shards", from);
    return stat(folder, &info) == 0 && S_ISDIR(info.st_mode)
               ? BST_OK
               : bst_fail(ctx, BST_ERR_NOT_FOUND,
                          "%s: is no folder of a study: it has no folder shards", from);
}

bst_status bst_study_gather(bst_ctx *ctx, bst_results *results, const char *from, const char *out,
                            int64_t *files) {
    char folder[4200], path[4600], to[4600];
    *files = 0;
    snprintf(folder, sizeof folder, "%.4000s/shards", from);
    DIR *dir = opendir(folder);
    if (!dir) {
        return bst_fail(ctx, BST_ERR_IO, "%s: %s", folder, strerror(errno));
    }
    bst_status status = BST_OK;
    for (struct dirent *entry; status == BST_OK && (entry = readdir(dir));) {
        if (is_shard(entry->d_name)) {
            snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
            snprintf(to, sizeof to, "%.4000s/shards/%s", out, entry->d_name);
            status = gather_file(ctx, results, path, to, files);
        }
    }
    closedir(dir);
    return status;
}
