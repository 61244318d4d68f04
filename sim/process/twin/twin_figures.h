/* Figures of the twin's frame against the recorded one. */
#ifndef BST_PROCESS_TWIN_TWIN_FIGURES_H
#define BST_PROCESS_TWIN_TWIN_FIGURES_H

#include "sim/process/twin/twin_defects.h"

/* Frames to compare, all [height][width] electrons. */
typedef struct bst_twin_frames {
    float *stars_e, *background_e; /* of the twin, without noise; background as in data_e */
    float *defects_e;   /* levels by the twin's dark map, 0 elsewhere; NULL: no defects */
    float *residual_e;  /* data_e minus all three; NAN: no value */
    float *variance_e2; /* measured noise and the shot noise of the stars */
    double level_dn;    /* of the twin's dark pixels over the recorded ones */
} bst_twin_frames;

/* Computes the figures.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_twin_figures_compute(bst_ctx *ctx, const bst_twin *twin,
                                    const bst_twin_frames *frames,
                                    bst_twin_figures *out) BST_MUST_CHECK;

/* Writes the report, and prints it.
 *
 * Errors:    those of the outputs */
bst_status bst_twin_write_report(bst_ctx *ctx, const bst_twin *twin, const bst_twin_camera *camera,
                                 const bst_twin_figures *figures,
                                 const bst_twin_frames *frames) BST_MUST_CHECK;

/* A star brighter than this many sigma_e, with so much of its light on the frame, is measured. */
#define BST_TWIN_OFFSET_SNR 20.0
#define BST_TWIN_OFFSET_INSIDE 0.3

#endif
