#define _XOPEN_SOURCE 700 /* nftw */
#include "sim/catalogue/star_fetch.h"

#include <errno.h>
#include <ftw.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "sim/catalogue/stars.h"
#include "sim/core/folder.h"
#include "sim/core/sha256.h"
#include "sim/core/subprocess.h"

#define PATH_BYTES 1024

static bst_status join(bst_ctx *ctx, char out[PATH_BYTES], const char *folder, const char *name) {
    int n = snprintf(out, PATH_BYTES, "%s/%s", folder, name);
    if (n < 0 || n >= PATH_BYTES) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "the path %s/%s is too long", folder, name);
    }
    return BST_OK;
}

bst_status bst_star_fetch_verify(bst_ctx *ctx, const char *path, const char *sha256) {
    if (access(path, R_OK) != 0) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "%s: %s", path, strerror(errno));
    }
    char sum[BST_SHA256_TEXT];
    BST_TRY(bst_sha256_file(ctx, path, sum));
    if (strcmp(sum, sha256) != 0) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%s is damaged: SHA-256 %s, expected %s", path, sum,
                        sha256);
    }
    return BST_OK;
}

/* Writes the private apt configuration and sources into `folder`. It disables hooks after an update
 * (containers delete the system's package cache there). */
static bst_status write_apt_files(bst_ctx *ctx, const char *folder) {
    static const char *const folders[] = {"apt/sources.d", "apt/state/lists/partial",
                                          "apt/cache/archives/partial", "apt/log"};
    char path[PATH_BYTES];
    for (size_t i = 0; i < sizeof folders / sizeof folders[0]; i++) {
        BST_TRY(join(ctx, path, folder, folders[i]));
        BST_TRY(bst_folder_make(ctx, path));
    }
    BST_TRY(join(ctx, path, folder, "apt/sources.list"));
    FILE *list = fopen(path, "w");
    BST_TRY(join(ctx, path, folder, "apt/sources.d/debian.sources"));
    FILE *sources = fopen(path, "w");
    BST_TRY(join(ctx, path, folder, "apt/status"));
    FILE *installed = fopen(path, "w");
    BST_TRY(join(ctx, path, folder, "apt/apt.conf"));
    FILE *conf = fopen(path, "w");
    bst_status status = BST_OK;
    if (!list || !sources || !installed || !conf) {
        status = bst_fail(ctx, BST_ERR_IO, "cannot write into %s/apt: %s", folder, strerror(errno));
    } else {
        int count = 0;
        status = bst_star_fetch_sources(ctx, "/etc/apt", list, sources, &count);
        fprintf(conf,
                "Dir::Etc::sourcelist \"%s/apt/sources.list\";\n"
                "Dir::Etc::sourceparts \"%s/apt/sources.d\";\n"
                "Dir::State \"%s/apt/state\";\n"
                "Dir::State::status \"%s/apt/status\";\n"
                "Dir::Cache \"%s/apt/cache\";\n"
                "Dir::Log \"%s/apt/log\";\n"
                "Acquire::Languages \"none\";\n"
                "APT::Sandbox::User \"root\";\n"
                "#clear APT::Update::Pre-Invoke;\n"
                "#clear APT::Update::Post-Invoke;\n"
                "#clear APT::Update::Post-Invoke-Success;\n",
                folder, folder, folder, folder, folder, folder);
    }
    FILE *all[] = {list, sources, installed, conf};
    for (size_t i = 0; i < 4; i++) {
        if (all[i] && fclose(all[i]) != 0 && status == BST_OK) {
            status =
                bst_fail(ctx, BST_ERR_IO, "cannot write into %s/apt: %s", folder, strerror(errno));
        }
    }
    return status;
}

/* Reads the last line of a text file, for an error message. */
static void last_line(const char *path, char *out, size_t bytes) {
    char line[512];
    snprintf(out, bytes, "no message");
    FILE *f = fopen(path, "r");
    if (!f) {
        return;
    }
    while (fgets(line, sizeof line, f)) {
        line[strcspn(line, "\r\n")] = '\0';
        if (line[0]) {
            snprintf(out, bytes, "%s", line);
        }
    }
    fclose(f);
}

/* Runs apt-get with the private configuration in `folder`; reports the size of `watched` as
 * progress. */
static bst_status run_apt(bst_ctx *ctx, const char *folder, const char *const command[3],
                          const char *what, const char *watched, bst_star_progress_fn progress,
                          void *progress_user) {
    char conf[PATH_BYTES], log[PATH_BYTES];
    BST_TRY(join(ctx, conf, folder, "apt/apt.conf"));
    BST_TRY(join(ctx, log, folder, "apt/messages.txt"));
    const char *argv[8] = {"apt-get", "-q", "-c", conf, command[0], command[1], command[2], NULL};
    bst_subprocess child;
    BST_TRY(bst_subprocess_start(ctx, argv, folder, false, log, &child));
    int code = 0;
    while (!bst_subprocess_poll(&child, &code)) {
        struct stat st;
        if (progress) {
            bool is_there = watched && stat(watched, &st) == 0;
            progress(progress_user, what, is_there ? (long long)st.st_size : 0,
                     watched ? BST_STAR_TARBALL_BYTES : 0);
        }
        nanosleep(&(struct timespec){0, 50000000}, NULL);
    }
    if (code != 0) {
        char message[512];
        last_line(log, message, sizeof message);
        return bst_fail(ctx, BST_ERR_IO,
                        "apt-get %s ended with %d: %s (all messages: %s); check the network and "
                        "apt's sources, or run `boresight stars import %s` with the file from "
                        "Debian's source package tycho2",
                        command[0], code, message, log, BST_STAR_TARBALL_NAME);
    }
    return BST_OK;
}

bst_status bst_star_fetch_tarball(bst_ctx *ctx, const char *folder, bst_star_progress_fn progress,
                                  void *progress_user, char *path, size_t path_bytes) {
    char tarball[PATH_BYTES];
    BST_TRY(join(ctx, tarball, folder, BST_STAR_TARBALL_NAME));
    if (snprintf(path, path_bytes, "%s", tarball) >= (int)path_bytes) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "the path %s is too long", tarball);
    }
    if (bst_star_fetch_verify(ctx, tarball, BST_STAR_TARBALL_SHA256) == BST_OK) {
        return BST_OK;
    }
    unlink(tarball);
    BST_TRY(bst_folder_make(ctx, folder));
    BST_TRY(write_apt_files(ctx, folder));
    static const char *const update[3] = {"update", NULL, NULL};
    static const char *const source[3] = {"source", "--download-only", "tycho2"};
    /* one unreachable source makes the update fail; the package may still be found */
    bst_status updated =
        run_apt(ctx, folder, update, "reading Debian's lists", NULL, progress, progress_user);
    bst_status status =
        run_apt(ctx, folder, source, "downloading", tarball, progress, progress_user);
    if (status != BST_OK) {
        return updated != BST_OK
                   ? bst_fail_prefix(ctx, status, "reading Debian's lists failed, and then")
                   : status;
    }
    if (progress) {
        progress(progress_user, "downloading", BST_STAR_TARBALL_BYTES, BST_STAR_TARBALL_BYTES);
    }
    return bst_star_fetch_verify(ctx, tarball, BST_STAR_TARBALL_SHA256);
}

static int remove_entry(const char *path, const struct stat *st, int type, struct FTW *ftw) {
    (void)st;
    (void)type;
    (void)ftw;
    return remove(path);
}

static bst_status cache_folder(bst_ctx *ctx, char out[PATH_BYTES]) {
    const char *cache = getenv("XDG_CACHE_HOME");
    const char *home = getenv("HOME");
    if (cache && cache[0] == '/') {
        return join(ctx, out, cache, "boresight/tycho2");
    }
    if (home && home[0] == '/') {
        return join(ctx, out, home, ".cache/boresight/tycho2");
    }
    return bst_fail(ctx, BST_ERR_NOT_FOUND,
                    "no user's cache directory: set HOME or XDG_CACHE_HOME to an absolute path");
}

static bool is_complete(const char *path) {
    bst_stars *stars = NULL;
    bst_stars_info info = {0};
    if (access(path, R_OK) == 0 && bst_stars_open(NULL, path, &stars) == BST_OK) {
        bst_stars_get_info(stars, &info);
        bst_stars_close(stars);
    }
    return info.count == BST_STAR_TYCHO2_COUNT;
}

bst_status bst_star_fetch(bst_ctx *ctx, const char *out_path, bst_star_progress_fn progress,
                          void *progress_user, bool *already) {
    *already = is_complete(out_path);
    if (*already) {
        return BST_OK;
    }
    char folder[PATH_BYTES], tarball[PATH_BYTES], parent[PATH_BYTES];
    BST_TRY(cache_folder(ctx, folder));
    int n = snprintf(parent, sizeof parent, "%s", out_path);
    char *slash = n > 0 && n < PATH_BYTES ? strrchr(parent, '/') : NULL;
    if (slash && slash != parent) {
        *slash = '\0';
        BST_TRY(bst_folder_make(ctx, parent));
    }
    BST_TRY(bst_folder_make(ctx, folder));
    BST_TRY(bst_star_fetch_tarball(ctx, folder, progress, progress_user, tarball, sizeof tarball));
    bst_star_import_options options = bst_star_import_all();
    options.progress = progress;
    options.progress_user = progress_user;
    BST_TRY(bst_star_import_tarball(ctx, tarball, &options, out_path, NULL));
    /* failures only leave files behind */
    (void)nftw(folder, remove_entry, 16, FTW_DEPTH | FTW_PHYS);
    return BST_OK;
}
