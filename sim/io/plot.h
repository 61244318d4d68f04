/* Makes plots with the gnuplot program. */
#ifndef BST_IO_PLOT_H
#define BST_IO_PLOT_H

#include <stdbool.h>
#include <stdio.h>

#include "boresight/status.h"

/* A plot in progress: `script` takes gnuplot commands and inline data ("$name << EOD"). */
typedef struct bst_plot {
    FILE *script;
    char path[4096];
    char draft[4160];
} bst_plot;

/* Checks that a plot's path ends in .png or .svg. BST_ERR_ARGUMENT. `path` may be NULL: BST_OK. */
bst_status bst_plot_check_path(bst_ctx *ctx, const char *path) BST_MUST_CHECK;

/* Begins a plot of width x height pixels at `path`: PNG, or SVG by its ending. Sets gnuplot's
 * terminal (pngcairo, or png if missing) and output. */
bst_status bst_plot_begin(bst_ctx *ctx, bst_plot *plot, const char *path, int width,
                          int height) BST_MUST_CHECK;
/* Runs gnuplot on the script. A missing or failing gnuplot causes a warning and *made = false, no
 * error; no file then exists at `path`. `made` may be NULL. BST_ERR_IO: the script cannot be
 * written. */
bst_status bst_plot_end(bst_ctx *ctx, bst_plot *plot, bool *made) BST_MUST_CHECK;

/* One point of a pointing plot. */
typedef struct bst_io_pointing_point {
    double time_s;
    double dx_px, dy_px; /* true target relative to the boresight, mean of the exposure */
    int mode;            /* bst_mode */
    bool in_track;       /* the true target is in a confirmed track */
    bool counted;        /* counted in the pointing figures */
    bool visible;        /* false: the point is not drawn */
} bst_io_pointing_point;

/* Plots the pointing error over time: radial error on a logarithmic scale with the modes as
 * background, and both components of counted points. `title` and `label` (a line of figures) may be
 * NULL; `limit_px` > 0 draws the required error. */
bst_status bst_io_pointing_plot(bst_ctx *ctx, const char *path, const char *title,
                                const char *label, const bst_io_pointing_point *points, int count,
                                double limit_px, bool *made) BST_MUST_CHECK;

#endif
