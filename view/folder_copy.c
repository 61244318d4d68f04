#include "view/folder_copy.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/io/run_files.h"

enum { COPY_BYTES = 1 << 20 };

static bst_status fail(bst_ctx *ctx, const char *path) {
    return bst_fail(ctx, BST_ERR_IO, "%s: cannot be copied: %s", path, strerror(errno));
}

/* Copies the content of an open file. False: errno says why. */
static bool copy_content(int from, int to) {
    char *buffer = malloc(COPY_BYTES);
    ssize_t got = 0;
    bool done = buffer != NULL;
    while (done && (got = read(from, buffer, COPY_BYTES)) > 0) {
        for (ssize_t written = 0; done && written < got;) {
            ssize_t n = write(to, buffer + written, (size_t)(got - written));
            done = n > 0;
            written += n;
        }
    }
    free(buffer);
    return done && got == 0;
}

static bst_status copy_file(bst_ctx *ctx, const char *from, const char *to) {
    int source = open(from, O_RDONLY | O_CLOEXEC | O_NOFOLLOW), target = -1;
    bool done = false;
    if (source >= 0) {
        target = open(to, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        done = target >= 0 && copy_content(source, target);
    }
    bst_status status = done ? BST_OK : fail(ctx, from);
    if (source >= 0) {
        close(source);
    }
    if (target >= 0 && close(target) != 0 && status == BST_OK) {
        status = fail(ctx, to);
    }
    return status;
}

/* True for files that are written at the end of a run. */
static bool belongs_to_end(const char *name) {
    const char *dot = strrchr(name, '.');
    return strcmp(name, "manifest.json") == 0 || strcmp(name, "lock") == 0 ||
           (dot && strcmp(dot, ".png") == 0);
}

/* Creates the lock of a folder, without which nothing goes on with its run. */
static bst_status create_lock(bst_ctx *ctx, const char *folder) {
    char path[4400];
    int length = snprintf(path, sizeof path, "%s/lock", folder);
    int lock = length >= 0 && (size_t)length < sizeof path
                   ? open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666)
                   : -1;
    if (lock < 0 || close(lock) != 0) {
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be locked: %s", folder, strerror(errno));
    }
    return BST_OK;
}

/* Copies the run's files into a folder that is there. */
static bst_status copy_files(bst_ctx *ctx, const char *from, const char *to) {
    bst_status status = BST_OK;
    DIR *folder = opendir(from);
    if (!folder) {
        return fail(ctx, from);
    }
    for (struct dirent *entry; status == BST_OK && (entry = readdir(folder));) {
        char source[4400], target[4400];
        if (entry->d_name[0] == '.' || !bst_run_owns(entry->d_name) ||
            belongs_to_end(entry->d_name)) {
            continue;
        }
        int bytes = snprintf(source, sizeof source, "%s/%s", from, entry->d_name);
        int more = snprintf(target, sizeof target, "%s/%s", to, entry->d_name);
        bool fits = bytes >= 0 && (size_t)bytes < sizeof source && more >= 0 &&
                    (size_t)more < sizeof target;
        status = fits ? copy_file(ctx, source, target)
                      : bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", from);
    }
    closedir(folder);
    return status == BST_OK ? create_lock(ctx, to) : status;
}

bst_status bst_view_copy_run(bst_ctx *ctx, const char *from, const char *to) {
    if (mkdir(to, 0777) != 0) {
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be created: %s", to, strerror(errno));
    }
    bst_status status = copy_files(ctx, from, to);
    if (status != BST_OK) {
        bst_view_remove_copy(to);
    }
    return status;
}

void bst_view_remove_copy(const char *folder) {
    DIR *list = opendir(folder);
    if (!list) {
        return;
    }
    for (struct dirent *entry; (entry = readdir(list));) {
        if (entry->d_name[0] != '.' && bst_run_owns(entry->d_name)) {
            unlinkat(dirfd(list), entry->d_name, 0);
        }
    }
    closedir(list);
    rmdir(folder);
}
