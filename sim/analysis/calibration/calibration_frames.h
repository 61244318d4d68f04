/* Bias, dark and flat frames of a scenario's sensors. */
#ifndef BST_ANALYSIS_CALIBRATION_CALIBRATION_FRAMES_H
#define BST_ANALYSIS_CALIBRATION_CALIBRATION_FRAMES_H

#include "sim/engine/scenario/scenario.h"

typedef struct bst_calibration_frames {
    const char *out;          /* folder, made when missing */
    const char *sensor;       /* OBSERVER/SENSOR; NULL: all */
    const char *device;       /* OpenCL device; NULL: the default */
    int threads;              /* of the device; 0: all */
    int64_t bias, dark, flat; /* numbers of frames */
    double exposure_s;        /* of darks and flats; 0: the scenario's */
    double level_e;           /* light per pixel in flats; 0: half of what fits */
} bst_calibration_frames;

/* Writes OBSERVER_SENSOR_bias.fits, _dark.fits and _flat.fits, one extension per frame, with the
 * fixed patterns of the scenario's runs, and prints a line for each. Prepares the scenario's
 * cameras. Errors: BST_ERR_IO: a file is there already or cannot be made; BST_ERR_INTERRUPTED: the
 * user asked to stop; what the renderer fails with. */
bst_status bst_calibration_frames_make(bst_ctx *ctx, const bst_calibration_frames *frames,
                                       bst_scenario *scenario) BST_MUST_CHECK;

#endif
