/* Samples of a line of a plot, as they are read and kept. */
#ifndef BST_VIEW_PLOT_SAMPLES_H
#define BST_VIEW_PLOT_SAMPLES_H

#include "view/recorded_run_internal.h"

/* Samples that are being read; zero to begin with. */
typedef struct bst_view_samples {
    void *samples; /* bst_io_sample[count]; malloc */
    size_t room, count;
} bst_view_samples;

/* True if the lines that are held leave room for further samples. */
bool bst_view_has_room(const bst_view_run *run, size_t samples);

/* Adds a sample; too many are thinned to their extremes. A time that is no number is left out.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_view_collect(bst_ctx *ctx, bst_view_samples *c, double time_s,
                            double value) BST_MUST_CHECK;
/* Makes the samples a line, and frees lines that were not used for long if there are too many.
 *
 * Given:     status  of reading them; after an error they are freed, and the line stays empty
 * Errors:    `status`, BST_ERR_MEMORY
 * Ownership: the samples become the line's */
bst_status bst_view_keep_line(bst_ctx *ctx, bst_status status, bst_view_run *run,
                              bst_view_samples *c, bst_view_line *line) BST_MUST_CHECK;

#endif
