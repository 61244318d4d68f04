#define _GNU_SOURCE /* mkdtemp, nftw */
#include "tests/fuzz/input_file.h"

#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

static char folder[FUZZ_PATH_BYTES - 64];

static int remove_entry(const char *path, const struct stat *info, int kind, struct FTW *place) {
    (void)info;
    (void)kind;
    (void)place;
    return remove(path);
}

static void remove_folder(void) {
    nftw(folder, remove_entry, 8, FTW_DEPTH | FTW_PHYS);
}

const char *fuzz_folder(void) {
    if (!*folder) {
        const char *base = getenv("TMPDIR");
        /* in memory where that can be: an input is written for each of a million executions */
        const char *usual = access("/dev/shm", W_OK | X_OK) == 0 ? "/dev/shm" : "/tmp";
        int n = snprintf(folder, sizeof folder, "%s/boresight-fuzz-XXXXXX",
                         base && *base ? base : usual);
        if (n < 0 || (size_t)n >= sizeof folder || !mkdtemp(folder)) {
            fprintf(stderr, "%s: cannot be made\n", folder);
            exit(1);
        }
        atexit(remove_folder);
    }
    return folder;
}

const char *fuzz_write_file(const char *name, const void *data, size_t bytes) {
    static char path[FUZZ_PATH_BYTES];
    snprintf(path, sizeof path, "%s/%.60s", fuzz_folder(), name);
    FILE *file = fopen(path, "wb");
    int bad = !file || fwrite(data, 1, bytes, file) != bytes;
    if (file) {
        bad |= fclose(file) != 0;
    }
    if (bad) {
        fprintf(stderr, "%s: cannot be written\n", path);
        exit(1);
    }
    return path;
}
