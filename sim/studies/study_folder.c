/* The folder of a study's results: lock and study.json. */
#include "sim/studies/study_folder.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

#include "sim/core/folder.h"
#include "sim/io/manifest.h"

/* Locks the folder against other drivers; -1 with a message. */
static int lock_folder(bst_ctx *ctx, const char *out, bool shared) {
    char path[4200];
    snprintf(path, sizeof path, "%.4000s/lock", out);
    int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (fd < 0) {
        bst_fail(ctx, BST_ERR_IO, "%s: %s", path, strerror(errno));
        return -1;
    }
    if (flock(fd, (shared ? LOCK_SH : LOCK_EX) | LOCK_NB) != 0) {
        bst_fail(ctx, BST_ERR_IO,
                 "%s: another boresight study is at work there; wait for it, or choose another "
                 "folder with --out",
                 out);
        close(fd);
        return -1;
    }
    return fd;
}

/* Writes study.json, or checks that the folder belongs to this study. */
static bst_status settle_study(bst_ctx *ctx, const bst_study *study, const char *out, bool resume) {
    char path[4200];
    bst_study there;
    snprintf(path, sizeof path, "%.4000s/study.json", out);
    if (access(path, F_OK) == 0) {
        bst_ctx quiet = {0};
        bool same = bst_study_open(&quiet, path, study->tables, &there) == BST_OK &&
                    strcmp(there.digest, study->digest) == 0;
        bst_study_close(&there);
        if (!same) {
            return bst_fail(ctx, BST_ERR_STATE,
                            "%s: holds another study, or this one before it or its scenarios were "
                            "changed; choose another folder with --out",
                            out);
        }
        return resume ? BST_OK
                      : bst_fail(ctx, BST_ERR_STATE,
                                 "%s: holds this study already; go on with --resume, or choose "
                                 "another folder with --out",
                                 out);
    }
    cJSON *echo = bst_study_echo(study);
    char *text = echo ? cJSON_Print(echo) : NULL;
    cJSON_Delete(echo);
    bst_status status = text ? bst_io_write_file_atomic(ctx, path, text, strlen(text))
                             : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the study");
    free(text);
    return status;
}

bst_status bst_study_folder_open(bst_ctx *ctx, const bst_study *study, const char *out, bool resume,
                                 bool shared, int *lock) {
    char shards[4200];
    *lock = -1;
    if (!resume) {
        char path[4200];
        snprintf(path, sizeof path, "%.4000s/study.json", out);
        if (access(path, F_OK) != 0 && rmdir(out) != 0 && errno == ENOTEMPTY) {
            return bst_fail(ctx, BST_ERR_IO,
                            "%s: is in the way and holds no study; choose another folder with "
                            "--out",
                            out);
        }
    }
    snprintf(shards, sizeof shards, "%.4000s/shards", out);
    BST_TRY(bst_folder_make(ctx, shards));
    *lock = lock_folder(ctx, out, shared);
    if (*lock < 0) {
        return BST_ERR_IO;
    }
    bst_status status = settle_study(ctx, study, out, resume || shared);
    if (status != BST_OK) {
        close(*lock);
        *lock = -1;
    }
    return status;
}
