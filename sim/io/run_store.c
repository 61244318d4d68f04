#include "sim/io/run_store.h"

#include <assert.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "sim/core/folder.h"
#include "sim/io/draft_file.h"
#include "sim/io/run_files.h"
#include "sim/io/run_internal.h"

/* size of the lock file, freed when the run is abandoned: reading tables with a journal needs 32
 * KiB of disk, also on a full disk */
#define SPARE_BYTES 65536

static bst_status fail_errno(bst_ctx *ctx, const char *path, const char *what) {
    return bst_fail(ctx, BST_ERR_IO, "%s: %s: %s", path, what, strerror(errno));
}

static bool is_dots(const char *name) {
    return strcmp(name, ".") == 0 || strcmp(name, "..") == 0;
}

/* Removes the file or folder `name` in `parent`; links are removed, not followed. False with
 * errno. */
static bool remove_tree(int parent, const char *name) {
    if (unlinkat(parent, name, 0) == 0) {
        return true;
    }
    if (errno != EISDIR && errno != EPERM) {
        return false;
    }
    int fd = openat(parent, name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    DIR *dir = fd >= 0 ? fdopendir(fd) : NULL;
    if (!dir) {
        if (fd >= 0) {
            close(fd);
        }
        return false;
    }
    bool ok = true;
    for (struct dirent *entry; ok && (entry = readdir(dir));) {
        ok = is_dots(entry->d_name) || remove_tree(fd, entry->d_name);
    }
    int saved = errno;
    closedir(dir);
    errno = saved;
    return ok && unlinkat(parent, name, AT_REMOVEDIR) == 0;
}

/* Removes the folder of a run: deletes the run's files and moves other files to the folder `to`.
 * False with errno; files that cannot be moved stay in `from`. */
static bool remove_run_folder(const char *from, const char *to) {
    int source = open(from, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    int target = open(to, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    DIR *dir = source >= 0 && target >= 0 ? fdopendir(dup(source)) : NULL;
    bool ok = dir != NULL;
    int error = errno;
    for (struct dirent *entry; dir && (entry = readdir(dir));) {
        const char *name = entry->d_name;
        struct stat info;
        bool done = is_dots(name);
        if (!done && (bst_run_owns(name) || strcmp(name, BST_RUN_PAGE) == 0)) {
            done = remove_tree(source, name);
        } else if (!done && fstatat(target, name, &info, AT_SYMLINK_NOFOLLOW) != 0) {
            done = renameat(source, name, target, name) == 0;
        }
        if (!done) {
            error = ok ? errno : error;
            ok = false;
        }
    }
    if (dir) {
        closedir(dir);
    }
    if (source >= 0) {
        close(source);
    }
    if (target >= 0) {
        close(target);
    }
    errno = error;
    return ok && rmdir(from) == 0;
}

/* Checks whether a folder may be removed as a run: it contains a run's tables, or only a lock.
 * Files such as manifest.json may belong to other programs. */
static bool looks_like_run(const char *folder) {
    DIR *dir = opendir(folder);
    if (!dir) {
        return false;
    }
    bool empty = true, tables = false;
    for (struct dirent *entry; (entry = readdir(dir));) {
        if (!is_dots(entry->d_name)) {
            empty = empty && strcmp(entry->d_name, BST_RUN_LOCK) == 0;
            tables = tables || strcmp(entry->d_name, BST_RUN_DATABASE) == 0;
        }
    }
    closedir(dir);
    return empty || tables;
}

/* Opens and locks folder/lock; -1 with errno (EWOULDBLOCK: a running process holds it). */
static int take_lock(const char *folder, int flags) {
    char path[BST_RUN_PATH_BYTES];
    if (bst_run_path_join(NULL, path, sizeof path, folder, BST_RUN_LOCK) != BST_OK) {
        errno = ENAMETOOLONG;
        return -1;
    }
    int fd = open(path, O_RDWR | O_CLOEXEC | flags, 0666);
    if (fd < 0) {
        return -1;
    }
    /* the lock is valid only if the file is still at that path: another run may have replaced the
     * folder between open and flock */
    struct stat held, named;
    int error = 0;
    if (flock(fd, LOCK_EX | LOCK_NB) != 0 || fstat(fd, &held) != 0 || stat(path, &named) != 0) {
        error = errno;
    } else if (held.st_ino != named.st_ino || held.st_dev != named.st_dev) {
        error = EWOULDBLOCK;
    }
    if (error) {
        close(fd);
        errno = error;
        return -1;
    }
    return fd;
}

/* Moves the .partial folder of a dead run away and removes it; files that do not belong to a run go
 * to the folder `to`. */
static bst_status clear_dead_run(bst_ctx *ctx, const char *folder, const char *to) {
    if (!looks_like_run(folder)) {
        return bst_fail(ctx, BST_ERR_IO,
                        "%s: is in the way and does not look like an unfinished run; move it or "
                        "choose another output folder",
                        folder);
    }
    int lock = take_lock(folder, O_CREAT);
    if (lock < 0) {
        if (errno == EWOULDBLOCK) {
            return bst_fail(ctx, BST_ERR_IO,
                            "%s: another run is writing it; choose another output folder or wait",
                            folder);
        }
        return fail_errno(ctx, folder, "cannot replace the unfinished run");
    }
    bst_log(ctx, BST_LOG_WARNING, "%s: replacing what an unfinished run left", folder);
    char dead[BST_RUN_PATH_BYTES];
    int n = snprintf(dead, sizeof dead, "%s.dead.%ld", folder, (long)getpid());
    bool ok = n > 0 && (size_t)n < sizeof dead && rename(folder, dead) == 0 &&
              remove_run_folder(dead, to);
    bst_status status = ok ? BST_OK : fail_errno(ctx, folder, "cannot remove the unfinished run");
    close(lock);
    return status;
}

/* Creates the .partial folder with its lock: it is prepared under a temporary name and renamed, so
 * that it is never visible unlocked. */
static bst_status claim_folder(bst_ctx *ctx, bst_run *run) {
    char draft[BST_RUN_PATH_BYTES];
    int made = -1;
    for (int i = 0; i < 1000 && made != 0; i++) {
        int n = snprintf(draft, sizeof draft, "%s.%ld.%d", run->folder, (long)getpid(), i);
        if (n < 0 || (size_t)n >= sizeof draft) {
            return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", run->out);
        }
        made = mkdir(draft, 0777);
        if (made != 0 && errno != EEXIST) {
            break;
        }
    }
    if (made != 0) {
        return fail_errno(ctx, run->folder, "cannot make the folder");
    }
    bst_status status = BST_OK;
    run->lock = take_lock(draft, O_CREAT | O_EXCL);
    int full = run->lock < 0 ? 0 : posix_fallocate(run->lock, 0, SPARE_BYTES);
    if (run->lock < 0 || full == ENOSPC || full == EFBIG) {
        errno = full ? full : errno;
        status = fail_errno(ctx, run->folder, "cannot make the lock");
    } else if (rename(draft, run->folder) != 0) {
        if (errno == ENOTEMPTY || errno == EEXIST) {
            status = clear_dead_run(ctx, run->folder, draft);
            if (status == BST_OK && rename(draft, run->folder) != 0) {
                status = fail_errno(ctx, run->folder, "cannot make the folder");
            }
        } else {
            status = fail_errno(ctx, run->folder, "cannot make the folder");
        }
    }
    if (status != BST_OK) {
        remove_tree(AT_FDCWD, draft);
    }
    return status;
}

/* Checks that the output folder is absent, or a run that may be overwritten. */
static bst_status check_out(bst_ctx *ctx, const bst_run *run) {
    struct stat info;
    if (lstat(run->out, &info) != 0) {
        return BST_OK;
    }
    if (!run->overwrite) {
        return bst_fail(ctx, BST_ERR_IO,
                        "%s: exists already; choose another output folder, remove it, or overwrite "
                        "it (--overwrite)",
                        run->out);
    }
    if (!S_ISDIR(info.st_mode) || !looks_like_run(run->out)) {
        return bst_fail(ctx, BST_ERR_IO,
                        "%s: is not the folder of a run, so it is not overwritten; choose another "
                        "output folder",
                        run->out);
    }
    return BST_OK;
}

/* Makes a run with the names of its folders. */
static bst_status name_run(bst_ctx *ctx, const char *out_path, bool overwrite, bst_run **out) {
    assert(out_path && out);
    *out = NULL;
    size_t length = out_path ? bst_run_folder_length(out_path) : 0;
    const char *last = out_path;
    for (size_t i = 0; i < length; i++) {
        last = out_path[i] == '/' ? out_path + i + 1 : last;
    }
    size_t last_bytes = length - (size_t)(last - out_path);
    if (last_bytes == 0 || (last_bytes == 1 && last[0] == '.') ||
        (last_bytes == 2 && memcmp(last, "..", 2) == 0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "'%s' is not a name for an output folder",
                        out_path ? out_path : "");
    }
    /* leaves room for the names of files inside */
    if (length > BST_RUN_PATH_BYTES - 256) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "the path of the output folder is too long");
    }
    bst_run *run = calloc(1, sizeof *run);
    if (!run) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    run->lock = -1;
    run->overwrite = overwrite;
    memcpy(run->out, out_path, length);
    snprintf(run->folder, sizeof run->folder, "%.*s.partial", (int)length, out_path);
    *out = run;
    return BST_OK;
}

static void free_run(bst_run *run) {
    if (run->lock >= 0) {
        close(run->lock);
    }
    free(run);
}

bst_status bst_run_create(bst_ctx *ctx, const char *out_path, bool overwrite, bst_run **out) {
    bst_run *run = NULL;
    *out = NULL;
    BST_TRY(name_run(ctx, out_path, overwrite, &run));
    bst_status status = check_out(ctx, run);
    if (status == BST_OK) {
        status = bst_folder_make_above(ctx, run->out);
    }
    if (status == BST_OK) {
        status = claim_folder(ctx, run);
    }
    if (status == BST_OK) {
        status = bst_run_open_database(ctx, run);
        if (status != BST_OK) {
            remove_tree(AT_FDCWD, run->folder); /* created by this run and still empty */
        }
    }
    if (status != BST_OK) {
        free_run(run);
        return status;
    }
    *out = run;
    return BST_OK;
}

/* Locks the folder of an interrupted run. */
static bst_status lock_again(bst_ctx *ctx, bst_run *run) {
    run->lock = take_lock(run->folder, 0);
    if (run->lock < 0) {
        return errno == EWOULDBLOCK ? bst_fail(ctx, BST_ERR_IO,
                                               "%s: another process is writing this run; wait "
                                               "until it has ended",
                                               run->folder)
               : errno == ENOENT    ? bst_fail(ctx, BST_ERR_NOT_FOUND,
                                               "%s: there is no interrupted run", run->folder)
                                    : fail_errno(ctx, run->folder, "cannot be locked");
    }
    int full = posix_fallocate(run->lock, 0, SPARE_BYTES);
    errno = full;
    return full == ENOSPC || full == EFBIG ? fail_errno(ctx, run->folder, "cannot make the lock")
                                           : BST_OK;
}

bst_status bst_run_reopen(bst_ctx *ctx, const char *out_path, bool overwrite, bst_run **out) {
    bst_run *run = NULL;
    *out = NULL;
    BST_TRY(name_run(ctx, out_path, overwrite, &run));
    run->reopened = true;
    bst_status status = check_out(ctx, run);
    if (status == BST_OK) {
        status = lock_again(ctx, run);
    }
    if (status == BST_OK) {
        bst_draft_sweep(run->folder); /* of a killed run; the lock is held */
        status = bst_run_open_database(ctx, run);
    }
    if (status != BST_OK) {
        free_run(run);
        return status;
    }
    *out = run;
    return BST_OK;
}

bool bst_run_is_reopened(const bst_run *run) {
    return run->reopened;
}

int64_t bst_run_free_bytes(const char *path) {
    char folder[BST_RUN_PATH_BYTES];
    if (snprintf(folder, sizeof folder, "%s", path) >= (int)sizeof folder) {
        return -1;
    }
    for (;;) {
        struct statvfs info;
        if (statvfs(folder, &info) == 0) {
            double bytes = (double)info.f_bavail * (double)info.f_frsize;
            return bytes < 9e18 ? (int64_t)bytes : INT64_MAX;
        }
        char *slash = strrchr(folder, '/');
        if (errno != ENOENT || strcmp(folder, ".") == 0 || slash == folder) {
            return -1;
        }
        if (slash) {
            *slash = '\0';
        } else {
            memcpy(folder, ".", 2);
        }
    }
}

/* Flushes a file or folder to disk (fsync). */
static bst_status sync_path(bst_ctx *ctx, const char *path) {
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    /* some file systems reject fsync of a folder: EINVAL */
    if (fd < 0 || (fsync(fd) != 0 && errno != EINVAL)) {
        bst_status status = fail_errno(ctx, path, "cannot flush to disk");
        if (fd >= 0) {
            close(fd);
        }
        return status;
    }
    close(fd);
    return BST_OK;
}

static bst_status sync_folder(bst_ctx *ctx, const char *folder) {
    DIR *dir = opendir(folder);
    if (!dir) {
        return fail_errno(ctx, folder, "cannot read the folder");
    }
    bst_status status = BST_OK;
    for (struct dirent *entry; status == BST_OK && (entry = readdir(dir));) {
        char path[BST_RUN_PATH_BYTES];
        struct stat info;
        /* links, pipes and folders do not belong to the run */
        if (fstatat(dirfd(dir), entry->d_name, &info, AT_SYMLINK_NOFOLLOW) == 0 &&
            S_ISREG(info.st_mode)) {
            status = bst_run_path_join(ctx, path, sizeof path, folder, entry->d_name);
            status = status == BST_OK ? sync_path(ctx, path) : status;
        }
    }
    closedir(dir);
    return status == BST_OK ? sync_path(ctx, folder) : status;
}

/* Renames the finished .partial folder to its final name; replaces a former run. */
static bst_status publish(bst_ctx *ctx, bst_run *run) {
    char old[BST_RUN_PATH_BYTES] = "";
    if (run->overwrite) {
        BST_TRY(check_out(ctx, run));
        int n = snprintf(old, sizeof old, "%s.replaced.%ld", run->out, (long)getpid());
        if (n < 0 || (size_t)n >= sizeof old) {
            return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", run->out);
        }
        if (rename(run->out, old) != 0) {
            if (errno != ENOENT) {
                return fail_errno(ctx, run->out, "cannot be replaced");
            }
            old[0] = '\0';
        }
    }
    if (rename(run->folder, run->out) != 0) {
        int error = errno;
        if (old[0] && rename(old, run->out) != 0) {
            bst_log(ctx, BST_LOG_WARNING, "%s: the former run is now %s", run->out, old);
        }
        errno = error;
        if (error == ENOTEMPTY || error == EEXIST) {
            return bst_fail(ctx, BST_ERR_IO,
                            "%s: another run took this name meanwhile; this one stays in %s",
                            run->out, run->folder);
        }
        return fail_errno(ctx, run->out, "cannot name the finished run");
    }
    if (old[0] && !remove_run_folder(old, run->out)) {
        bst_log(ctx, BST_LOG_WARNING, "%s: cannot be removed: %s", old, strerror(errno));
    }
    char parent[BST_RUN_PATH_BYTES];
    memcpy(parent, run->out, sizeof parent);
    char *slash = strrchr(parent, '/');
    if (!slash) {
        memcpy(parent, ".", 2);
    } else {
        slash[slash == parent ? 1 : 0] = '\0';
    }
    return sync_path(ctx, parent);
}

bst_status bst_run_seal(bst_ctx *ctx, bst_run *run) {
    bst_status status = bst_run_check_folder(ctx, run);
    bst_status closed = bst_run_close_database(status == BST_OK ? ctx : NULL, run);
    status = status == BST_OK ? closed : status;
    return status == BST_OK ? sync_folder(ctx, run->folder) : status;
}

/* Removes a file of the run's folder, which may be absent if `needed` is false. */
static bst_status remove_file(bst_ctx *ctx, const bst_run *run, const char *name, bool needed) {
    char path[BST_RUN_PATH_BYTES];
    BST_TRY(bst_run_path_join(ctx, path, sizeof path, run->folder, name));
    return unlink(path) == 0 || (errno == ENOENT && !needed)
               ? BST_OK
               : fail_errno(ctx, path, "cannot be removed");
}

bst_status bst_run_finish(bst_ctx *ctx, bst_run *run) {
    bst_status status = run->db ? bst_run_seal(ctx, run) : bst_run_check_folder(ctx, run);
    if (status == BST_OK) {
        status = remove_file(ctx, run, BST_RUN_STATE, false);
    }
    if (status == BST_OK) {
        status = remove_file(ctx, run, BST_RUN_LOCK, true);
    }
    if (status == BST_OK) {
        status = sync_path(ctx, run->folder);
    }
    if (status == BST_OK) {
        status = publish(ctx, run);
    }
    close(run->lock);
    free(run);
    return status;
}

void bst_run_abandon(bst_run *run) {
    if (!run) {
        return;
    }
    bst_ctx unheard;
    bst_ctx_init(&unheard, NULL, NULL, BST_LOG_ERROR);
    bst_status status = bst_run_close_database(&unheard, run);
    (void)status; /* an abandoned run keeps what could be saved */
    int given = ftruncate(run->lock, 0);
    (void)given; /* the space was for readers only */
    close(run->lock);
    free(run);
}
