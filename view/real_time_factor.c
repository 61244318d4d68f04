#include "view/real_time_factor.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <unistd.h>

#include "sim/core/file.h"

/* Shortest wall time of a sample, s: shorter ones show the clock's grain. */
static const double INTERVAL_S = 0.05;
/* Lines that are read. */
enum { LINES_MOST = 1000000 };

/* Opens the file. NULL: there is none, or something else in its place. */
static FILE *open_clock(const char *path) {
    bst_ctx ignored = {0};
    uint64_t bytes;
    int fd;
    if (bst_file_open(&ignored, path, INT64_MAX, "a wall clock", &fd, &bytes) != BST_OK) {
        return NULL;
    }
    FILE *file = fdopen(fd, "r");
    if (!file) {
        close(fd);
    }
    return file;
}

bool bst_view_has_wall_clock(const char *path) {
    FILE *file = open_clock(path);
    if (file) {
        fclose(file);
    }
    return file != NULL;
}

bst_status bst_view_read_factors(bst_ctx *ctx, const char *path, bst_view_samples *out) {
    FILE *file = open_clock(path);
    char line[128];
    double begin_s = NAN, begin_wall = NAN;
    bst_status status = BST_OK;
    for (int k = 0; file && status == BST_OK && k < LINES_MOST && fgets(line, sizeof line, file);
         k++) {
        double time_s, wall_s;
        if (sscanf(line, "%lf,%lf", &time_s, &wall_s) != 2 || !isfinite(time_s) ||
            !isfinite(wall_s)) {
            continue;
        }
        if (wall_s - begin_wall < INTERVAL_S || time_s <= begin_s) {
            continue;
        }
        if (isfinite(begin_s)) {
            status = bst_view_collect(ctx, out, time_s, (time_s - begin_s) / (wall_s - begin_wall));
        }
        begin_s = time_s;
        begin_wall = wall_s;
    }
    if (file) {
        fclose(file);
    }
    return status;
}
