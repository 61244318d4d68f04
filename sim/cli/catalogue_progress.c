#include "sim/cli/catalogue_progress.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "sim/core/wall_clock.h"

bst_catalogue_progress bst_catalogue_progress_start(void) {
    return (bst_catalogue_progress){.on_terminal = isatty(STDERR_FILENO)};
}

void bst_catalogue_progress_text(const char *stage, long long done, long long total,
                                 double elapsed_s, char *text, size_t bytes) {
    if (total <= 0 || done <= 0 || elapsed_s <= 0.0) {
        snprintf(text, bytes, "%s: %.0f s", stage, elapsed_s);
        return;
    }
    double rate = (double)done / elapsed_s;
    const char *unit = strcmp(stage, "downloading") == 0 ? "MB/s" : "million stars/s";
    snprintf(text, bytes, "%s: %3.0f %%, %.1f %s, %.0f s left", stage,
             100.0 * (double)done / (double)total, 1e-6 * rate, unit,
             (double)(total - done) / rate);
}

void bst_catalogue_progress_show(void *user, const char *stage, long long done, long long total) {
    bst_catalogue_progress *progress = user;
    char text[160];
    double now = bst_wall_seconds();
    if (!progress->on_terminal) {
        return;
    }
    if (!progress->stage || strcmp(progress->stage, stage) != 0) {
        if (progress->stage) {
            fputc('\n', stderr);
        }
        progress->stage = stage;
        progress->started_s = now;
        progress->shown_s = 0.0;
    }
    if (now - progress->shown_s < 0.2 && done != total) {
        return;
    }
    progress->shown_s = now;
    bst_catalogue_progress_text(stage, done, total, now - progress->started_s, text, sizeof text);
    fprintf(stderr, "\r\033[K%s", text);
}

void bst_catalogue_progress_end(const bst_catalogue_progress *progress) {
    if (progress->stage) {
        fputc('\n', stderr);
    }
}
