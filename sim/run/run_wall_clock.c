#include "sim/run/run_wall_clock.h"

#include <assert.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/wall_clock.h"

/* Wall time between two rows: at least this, and this share of what passed. */
static const double ROW_S = 0.2, ROW_SHARE = 1.0 / 2000.0;
/* Rows of an earlier part that are read: more than any run has. */
enum { ROWS_MOST = 1000000 };

struct bst_run_wall_clock {
    FILE *file;
    char path[4200];
    double counted_s;  /* wall time up to `since` */
    double since;      /* wall seconds when it began to count; < 0: it is stopped */
    double noted_s;    /* wall time of the last row */
    double noted_time; /* time of the run of the last row */
};

static double wall_s(const bst_run_wall_clock *clock) {
    return clock->counted_s + (clock->since < 0.0 ? 0.0 : bst_wall_seconds() - clock->since);
}

static void write_row(bst_run_wall_clock *clock, double time_s, double wall) {
    fprintf(clock->file, "%.9g,%.6f\n", time_s, wall);
    fflush(clock->file); /* a viewer of the run sees it at once */
    clock->noted_s = wall;
    clock->noted_time = time_s;
}

/* Reads the rows up to begin_s of an earlier part; a missing or damaged file has none.
 *
 * Returned:  *count  number of rows; rows of time and wall time */
static double *read_rows(const char *path, double begin_s, size_t *count) {
    FILE *file = fopen(path, "r");
    double *rows = NULL;
    char line[128];
    size_t room = 0;
    *count = 0;
    while (file && fgets(line, sizeof line, file) && *count < ROWS_MOST) {
        double time, wall;
        if (sscanf(line, "%lf,%lf", &time, &wall) != 2 || !(time <= begin_s) || !(wall >= 0.0) ||
            (*count > 0 && !(wall >= rows[2 * *count - 1]))) {
            continue;
        }
        if (*count == room) {
            room = 2 * room + 256;
            double *more = realloc(rows, 2 * room * sizeof *rows);
            if (!more) {
                break; /* the rows so far */
            }
            rows = more;
        }
        rows[2 * *count] = time;
        rows[2 * (*count)++ + 1] = wall;
    }
    if (file) {
        fclose(file);
    }
    return rows;
}

bst_status bst_run_wall_clock_open(bst_ctx *ctx, const char *path, bool resumes, double begin_s,
                                   bst_run_wall_clock **out) {
    size_t count = 0;
    double *rows = resumes ? read_rows(path, begin_s, &count) : NULL;
    bst_run_wall_clock *clock = calloc(1, sizeof *clock);
    *out = NULL;
    if (!clock) {
        free(rows);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the wall clock of the run");
    }
    snprintf(clock->path, sizeof clock->path, "%s", path);
    clock->since = -1.0;
    errno = 0;
    clock->file = fopen(path, "w");
    if (!clock->file) {
        free(rows);
        free(clock);
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be made: %s", path, strerror(errno));
    }
    fputs("time_s,wall_s\n", clock->file);
    for (size_t i = 0; i < count; i++) {
        clock->counted_s = rows[2 * i + 1];
        write_row(clock, rows[2 * i], clock->counted_s);
    }
    if (count == 0 || rows[2 * (count - 1)] < begin_s) {
        write_row(clock, begin_s, clock->counted_s);
    }
    free(rows);
    *out = clock;
    return BST_OK;
}

void bst_run_wall_clock_go(bst_run_wall_clock *clock) {
    if (clock && clock->since < 0.0) {
        clock->since = bst_wall_seconds();
    }
}

void bst_run_wall_clock_stop(bst_run_wall_clock *clock) {
    if (clock) {
        clock->counted_s = wall_s(clock);
        clock->since = -1.0;
    }
}

void bst_run_wall_clock_note(bst_run_wall_clock *clock, double time_s) {
    if (!clock) {
        return;
    }
    const double wall = wall_s(clock), passed = wall - clock->noted_s;
    if (passed >= ROW_S && passed >= ROW_SHARE * wall && time_s > clock->noted_time) {
        write_row(clock, time_s, wall);
    }
}

bst_status bst_run_wall_clock_close(bst_ctx *ctx, bst_run_wall_clock *clock, double time_s) {
    if (!clock) {
        return BST_OK;
    }
    if (time_s > clock->noted_time) {
        write_row(clock, time_s, wall_s(clock));
    }
    errno = 0;
    const bool good = !ferror(clock->file);
    const bool closed = fclose(clock->file) == 0;
    bst_status status = BST_OK;
    if (!good || !closed) {
        status =
            bst_fail(ctx, BST_ERR_IO, "%s: cannot be written: %s", clock->path, strerror(errno));
    }
    free(clock);
    return status;
}
