/* Whether the observation generator is statistically the image path: the same scenario with both,
 * many runs each. */
#ifndef BST_ANALYSIS_CALIBRATION_OBSGEN_VALIDATION_H
#define BST_ANALYSIS_CALIBRATION_OBSGEN_VALIDATION_H

#include "sim/cli/load.h"

typedef struct bst_obsgen_validation_options {
    const char *scenario;
    const char *calibration; /* NULL: as the scenario says */
    const char *device;      /* NULL: default */
    const bst_load_options *load;
    int seeds, threads;
    const char *json; /* NULL: none */
} bst_obsgen_validation_options;

/* Runs, prints a table of what was measured of both with the 95 % bootstrap interval over runs of
 * the difference or ratio, and says in *equivalent whether every interval is inside its margin:
 * Pd by SNR of the truth within 0.02, false alarms within 10 %, RMS of places and of the track of
 * interest within 5 %, time to confirm within 10 %. What a scenario does not have is not judged. */
bst_status bst_obsgen_validation_run(bst_ctx *ctx, const bst_obsgen_validation_options *options,
                                     bool *equivalent) BST_MUST_CHECK;

#endif
