/* Plots through the gnuplot program. */
#ifndef BST_IO_PLOT_H
#define BST_IO_PLOT_H

#include <stdbool.h>
#include <stdio.h>

#include "boresight/status.h"

/* A plot that is being written: `script` takes gnuplot commands and inline data ("$name << EOD").
 */
typedef struct bst_plot {
    FILE *script;
    char path[4096];
    char draft[4160];
} bst_plot;

/* Whether a plot's path says what it becomes: it must end in .png or .svg. BST_ERR_ARGUMENT. `path`
 * may be NULL: BST_OK. */
bst_status bst_plot_check_path(bst_ctx *ctx, const char *path) BST_MUST_CHECK;

/* Begins a PNG, or where the path ends in .svg an SVG, of width x height pixels at `path`: terminal
 * (pngcairo, or png where gnuplot lacks it) and output are set. */
bst_status bst_plot_begin(bst_ctx *ctx, bst_plot *plot, const char *path, int width,
                          int height) BST_MUST_CHECK;
/* Lets gnuplot draw it. A missing or failing gnuplot is a logged warning and *made = false, not an
 * error: nothing is left at `path` then. `made` may be NULL. Errors: BST_ERR_IO when the script
 * cannot be written. */
bst_status bst_plot_end(bst_ctx *ctx, bst_plot *plot, bool *made) BST_MUST_CHECK;

/* One point of a pointing plot. */
typedef struct bst_io_pointing_point {
    double time_s;
    double dx_px, dy_px; /* true target from the boresight, mean of the exposure */
    int mode;            /* bst_mode */
    bool in_track;       /* the right target is in confirmed track */
    bool counted;        /* among the frames of the pointing figures */
    bool visible;        /* false: the point is not drawn */
} bst_io_pointing_point;

/* Plots the pointing error against time: radial error on a logarithmic scale with the modes as
 * coloured ground, and both components of the points that are counted. `title` and `label`, a line
 * of figures, may be NULL; `limit_px` > 0 draws a line at the error that is asked for. */
bst_status bst_io_pointing_plot(bst_ctx *ctx, const char *path, const char *title,
                                const char *label, const bst_io_pointing_point *points, int count,
                                double limit_px, bool *made) BST_MUST_CHECK;

#endif
