/* A folder of its own for a test, removed at the end. */
#ifndef BST_TESTS_IO_SCRATCH_H
#define BST_TESTS_IO_SCRATCH_H

#include <dirent.h>
#include <stdbool.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include "tests/test_support.h"

typedef struct scratch {
    char folder[512];
    char path[1024];
} scratch;

static inline void scratch_make(scratch *s) {
    const char *base = getenv("TMPDIR");
    snprintf(s->folder, sizeof s->folder, "%s/boresight-test-XXXXXX", base ? base : "/tmp");
    assert_non_null(mkdtemp(s->folder));
}

/* folder/name; valid until the next call. */
static inline const char *scratch_path(scratch *s, const char *name) {
    snprintf(s->path, sizeof s->path, "%s/%s", s->folder, name);
    return s->path;
}

static inline void scratch_remove_tree(const char *path) {
    DIR *dir = opendir(path);
    for (struct dirent *e; dir && (e = readdir(dir));) {
        char child[2048];
        int n = snprintf(child, sizeof child, "%s/%s", path, e->d_name);
        struct stat info;
        if (n > 0 && (size_t)n < sizeof child && strcmp(e->d_name, ".") != 0 &&
            strcmp(e->d_name, "..") != 0 && lstat(child, &info) == 0) {
            if (S_ISDIR(info.st_mode)) {
                scratch_remove_tree(child);
            } else {
                unlink(child);
            }
        }
    }
    if (dir) {
        closedir(dir);
    }
    rmdir(path);
}

static inline void scratch_remove(scratch *s) {
    scratch_remove_tree(s->folder);
}

static inline bool scratch_has(const char *path) {
    struct stat info;
    return lstat(path, &info) == 0;
}

/* Number of entries of a folder. */
static inline int scratch_count(const char *folder) {
    int count = 0;
    DIR *dir = opendir(folder);
    assert_non_null(dir);
    while (readdir(dir)) {
        count++;
    }
    closedir(dir);
    return count - 2; /* . and .. */
}

#endif
