#include "sim/cli/progress.h"

#include <inttypes.h>
#include <stdio.h>
#include <unistd.h>

#include "sim/core/wall_clock.h"

void bst_progress_start(bst_progress *progress, const char *what, const char *unit, int64_t total) {
    *progress = (bst_progress){.what = what,
                               .unit = unit,
                               .total = total,
                               .terminal = isatty(STDERR_FILENO) == 1,
                               .started = bst_wall_seconds()};
    progress->newest = progress->started;
}

/* seconds between lines in a file, which cannot be overwritten as on a terminal */
#define PLAIN_PERIOD_S 10.0

void bst_progress_update(bst_progress *progress, int64_t done) {
    double now = bst_wall_seconds(), elapsed = now - progress->started;
    if (progress->off || elapsed < 2.0 ||
        now - progress->newest < (progress->terminal ? 0.2 : PLAIN_PERIOD_S)) {
        return;
    }
    progress->newest = now;
    progress->shown = progress->terminal;
    double rate = (double)done / elapsed;
    fprintf(stderr, "%s%s: %" PRId64, progress->terminal ? "\r\033[K" : "", progress->what, done);
    if (progress->total > 0) {
        fprintf(stderr, " of %" PRId64, progress->total);
    }
    fprintf(stderr, " %s, %.0f a second", progress->unit, rate);
    if (progress->total > 0 && rate > 0.0) {
        fprintf(stderr, ", %.0f s left", (double)(progress->total - done) / rate);
    }
    if (!progress->terminal) {
        fputs("\n", stderr);
    }
    fflush(stderr);
}

void bst_progress_end(bst_progress *progress) {
    if (progress->shown) {
        fputs("\r\033[K", stderr);
        fflush(stderr);
    }
}
