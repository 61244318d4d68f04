/* boresight calibrate-obsgen: the fit over runs of several scenarios, and the comparison. */
#ifndef BST_ANALYSIS_CALIBRATION_CALIBRATE_SCENARIOS_H
#define BST_ANALYSIS_CALIBRATION_CALIBRATE_SCENARIOS_H

#include "sim/cli/load.h"

/* What the command line asks for. */
typedef struct bst_calibration_order {
    const char *out;         /* file for the calibration */
    const char *calibration; /* comparison: the generator's file; NULL: the scenario's */
    const char *device;      /* OpenCL selector; NULL: default */
    const char *json;        /* comparison: file for the figures; NULL: none */
    bst_load_options load;
    int64_t seeds; /* runs of each scenario */
    int64_t threads;
    bool check; /* compare instead of fitting */
} bst_calibration_order;

/* Describes the data of a calibration: version, number of runs, and file names without folders.
 *
 * Given:     bytes  size of `out`; longer texts are cut */
void bst_calibration_describe(int64_t seeds, int count, char *const *files, char *out,
                              size_t bytes);

/* Runs the image path of the scenarios, fits the observation generator to it, prints the result to
 * stdout and writes order->out.
 *
 * Errors:    BST_ERR_CONFIG: the first sensor lacks the image path, or bins its pixels;
 *            BST_ERR_STATE: too few data; those of the runs and of writing */
bst_status bst_calibration_make(bst_ctx *ctx, const bst_calibration_order *order, int count,
                                char *const *files) BST_MUST_CHECK;

/* Compares images and generator in each scenario (bst_obsgen_validation_run).
 *
 * Returned:  *equivalent  whether all scenarios are within the margins */
bst_status bst_calibration_check(bst_ctx *ctx, const bst_calibration_order *order, int count,
                                 char *const *files, bool *equivalent) BST_MUST_CHECK;

#endif
