#include "sim/app/progress.h"

#include <inttypes.h>
#include <stdio.h>
#include <unistd.h>

#include "sim/core/wall_clock.h"

void bst_progress_start(bst_progress *progress, const char *what, const char *unit, int64_t total) {
    *progress = (bst_progress){.what = what,
                               .unit = unit,
                               .total = total,
                               .on = isatty(STDERR_FILENO) == 1,
                               .started = bst_wall_seconds()};
    progress->newest = progress->started;
}

void bst_progress_update(bst_progress *progress, int64_t done) {
    double now = bst_wall_seconds(), elapsed = now - progress->started;
    if (!progress->on || elapsed < 2.0 || now - progress->newest < 0.2) {
        return;
    }
    progress->newest = now;
    progress->shown = true;
    double rate = (double)done / elapsed;
    fprintf(stderr, "\r\033[K%s: %" PRId64, progress->what, done);
    if (progress->total > 0) {
        fprintf(stderr, " of %" PRId64, progress->total);
    }
    fprintf(stderr, " %s, %.0f a second", progress->unit, rate);
    if (progress->total > 0 && rate > 0.0) {
        fprintf(stderr, ", %.0f s left", (double)(progress->total - done) / rate);
    }
    fflush(stderr);
}

void bst_progress_end(bst_progress *progress) {
    if (progress->shown) {
        fputs("\r\033[K", stderr);
        fflush(stderr);
    }
}
