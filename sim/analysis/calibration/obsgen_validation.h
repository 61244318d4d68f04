/* Statistical comparison of the observation generator with the image path: the same scenario, many
 * runs each. */
#ifndef BST_ANALYSIS_CALIBRATION_OBSGEN_VALIDATION_H
#define BST_ANALYSIS_CALIBRATION_OBSGEN_VALIDATION_H

#include "sim/cli/load.h"

typedef struct bst_obsgen_validation_options {
    const char *scenario;
    const char *calibration; /* NULL: from the scenario */
    const char *device;      /* NULL: default device */
    const bst_load_options *load;
    int seeds, threads;
    const char *json; /* NULL: none */
} bst_obsgen_validation_options;

/* Executes the runs and prints a table of both sides with 95 % bootstrap intervals of the
 * differences or ratios and their standard errors. *equivalent: every interval is within its
 * margin. Margins: Pd by true SNR 0.02, false alarms 10 %, RMS of positions and of the track of
 * interest 5 %, time to confirm 10 %. Figures that the scenario lacks on both sides are skipped;
 * one that a single side has is not equivalent, and neither is a scenario without any figure. */
bst_status bst_obsgen_validation_run(bst_ctx *ctx, const bst_obsgen_validation_options *options,
                                     bool *equivalent) BST_MUST_CHECK;

#endif
