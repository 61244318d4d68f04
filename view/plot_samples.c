#include "view/plot_samples.h"

#include <math.h>
#include <stdlib.h>

#include "sim/core/memory.h"

/* Samples of a line that are kept: more are thinned to their extremes. 16 bytes each. */
static const size_t LINE_SAMPLES_MOST = 4000000;
/* Samples of all lines that are kept. */
static const size_t SAMPLES_MOST = 12000000;

/* Frees the lines that were not used for the longest time, until there is room for another one. */
static void make_room(bst_view_run *run, const bst_view_line *keep) {
    while (run->samples > SAMPLES_MOST) {
        bst_view_line *oldest = NULL;
        for (int k = 0; k < run->sensors * BST_VIEW_LINES; k++) {
            bst_view_line *line = &run->sensor[k / BST_VIEW_LINES].lines[k % BST_VIEW_LINES];
            if (line->samples && line != keep && (!oldest || line->used < oldest->used)) {
                oldest = line;
            }
        }
        if (!oldest) {
            return;
        }
        run->samples -= oldest->count;
        free(oldest->samples);
        *oldest = (bst_view_line){.samples = NULL};
    }
}

bool bst_view_has_room(const bst_view_run *run, size_t samples) {
    return run->samples + samples <= SAMPLES_MOST;
}

bst_status bst_view_collect(bst_ctx *ctx, bst_view_samples *c, double time_s, double value) {
    const size_t bytes = sizeof(bst_io_sample);
    if (!isfinite(time_s)) {
        return BST_OK;
    }
    if (c->count == LINE_SAMPLES_MOST) {
        c->count = bst_io_thin_samples(c->samples, c->count);
    }
    if (c->room < (c->count + 1) * bytes) {
        BST_TRY(bst_memory_grow(ctx, "out of memory for a time series", &c->samples, &c->room,
                                2 * c->room + 65536));
    }
    ((bst_io_sample *)c->samples)[c->count++] =
        (bst_io_sample){time_s, isfinite(value) ? value : NAN};
    return BST_OK;
}

bst_status bst_view_keep_line(bst_ctx *ctx, bst_status status, bst_view_run *run,
                              bst_view_samples *c, bst_view_line *line) {
    if (status != BST_OK) {
        free(c->samples);
        return status;
    }
    bst_io_sort_samples(c->samples, c->count);
    line->samples = c->samples ? c->samples : calloc(1, sizeof *line->samples);
    line->count = c->count;
    run->samples += line->count;
    make_room(run, line);
    return line->samples ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
}
