/* Error budget of a frame: combines the errors of overlapping sources.
 *
 * All stars move alike. Those that may light one pixel lie in one box, as long and wide as motion
 * and PSF. Sources are sorted into cells of half a box. The error of 3 x 3 cells is that of their
 * worst source plus a share of the others, see docs/explanation/equations/image.md. Sources within
 * one PSF sigma count as one, with the sum of their errors. Time and memory are proportional to the
 * number of sources. */
#ifndef BST_SCENEGEN_SMEAR_ERROR_BUDGET_H
#define BST_SCENEGEN_SMEAR_ERROR_BUDGET_H

#include <stdbool.h>

#include "boresight/status.h"
#include "scenegen/smear/smear_quadrature.h"

typedef struct bst_error_budget bst_error_budget;

/* Motion of a frame's stars. */
typedef struct bst_error_budget_motion {
    double direction[2];        /* unit vector */
    double length_px, width_px; /* along it and across */
    double way_px;              /* largest path length */
    double overlap;             /* part of length times width that a star's light covers */
    double sigma_px;            /* of the PSF */
    double dark_variance_e2;    /* noise variance of a dark pixel */
} bst_error_budget_motion;

/* Direction and extent of a path of tilts about x and y and roll (px in the sensor's corners), or
 * of shifts along x and y (`shift`). */
bst_error_budget_motion bst_error_budget_motion_of(const bst_smear_path_point *path, int count,
                                                   bool shift);

/* Error of one source's image. */
typedef struct bst_error_budget_source {
    float x_px, y_px;  /* position anywhere on its path, at the same time for all sources */
    float peak_e;      /* largest light in one pixel */
    float nodes_e;     /* bound of the error by nodes, profiles and rounding, e- */
    float predicted_e; /* predicted value of that error */
    float grid_e;      /* the part of it that may lie at any distance */
    float shared_e;    /* error by a shared track */
    float excess_e;    /* light from beyond the stamp, added to it */
    float border_e;    /* light missing next to the stamp */
    bool apart;        /* moves further than the stars do */
} bst_error_budget_source;

/* Creates an empty error budget.
 *
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_error_budget_free */
bst_status bst_error_budget_create(bst_ctx *ctx, bst_error_budget **out) BST_MUST_CHECK;
/* Frees an error budget; NULL is allowed. */
void bst_error_budget_free(bst_error_budget *budget);

/* Starts a frame. */
void bst_error_budget_begin(bst_error_budget *budget, const bst_error_budget_motion *motion);

/* Adds a source of the frame; it is copied.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_error_budget_add(bst_ctx *ctx, bst_error_budget *budget,
                                const bst_error_budget_source *source) BST_MUST_CHECK;

/* Adds light that any pixel may lack, e-: of sources too far away to be rendered. */
void bst_error_budget_miss(bst_error_budget *budget, double electrons);

/* Bound of the error in any pixel, in its sigma, that chooses nodes. It is computed at the first
 * call. */
double bst_error_budget_bound_sigma(bst_error_budget *budget);

/* Predicted error in any pixel, as bst_error_budget_bound_sigma. */
double bst_error_budget_error_sigma(bst_error_budget *budget);
/* The same if the nodes' errors in any pixel are known to be at most `nodes_sigma`. */
double bst_error_budget_limited_sigma(bst_error_budget *budget, double nodes_sigma);

/* Share of the other sources' errors that adds where the worst source's error is largest. */
#define BST_ERROR_REST 0.4

/* The frame's sources so far, in the order in which they were added; valid until the next one. */
const bst_error_budget_source *bst_error_budget_sources(const bst_error_budget *budget, int *count);
/* The frame's motion, with `overlap`. */
const bst_error_budget_motion *bst_error_budget_frame_motion(const bst_error_budget *budget);

#endif
