#include "view/real_time_factor.h"

#include <fcntl.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

/* Shortest wall time of a sample, s: shorter ones show the clock's grain. */
static const double INTERVAL_S = 0.05;
/* Lines that are read. */
enum { LINES_MOST = 1000000 };

/* Opens a regular file, whatever a folder of others has in its place. NULL: it is none. */
static FILE *open_regular(const char *path) {
    struct stat found;
    const int file = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (file < 0 || fstat(file, &found) != 0 || !S_ISREG(found.st_mode)) {
        if (file >= 0) {
            close(file);
        }
        return NULL;
    }
    FILE *stream = fdopen(file, "r");
    if (!stream) {
        close(file);
    }
    return stream;
}

bool bst_view_has_wall_clock(const char *path) {
    FILE *file = open_regular(path);
    if (file) {
        fclose(file);
    }
    return file != NULL;
}

bst_status bst_view_read_factors(bst_ctx *ctx, const char *path, bst_view_take_factor take,
                                 void *user) {
    FILE *file = open_regular(path);
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
            status = take(ctx, user, time_s, (time_s - begin_s) / (wall_s - begin_wall));
        }
        begin_s = time_s;
        begin_wall = wall_s;
    }
    if (file) {
        fclose(file);
    }
    return status;
}
