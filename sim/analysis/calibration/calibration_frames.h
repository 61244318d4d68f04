/* Makes bias, dark and flat frames of a scenario's sensors (`boresight calibration-frames`). */
#ifndef BST_ANALYSIS_CALIBRATION_CALIBRATION_FRAMES_H
#define BST_ANALYSIS_CALIBRATION_CALIBRATION_FRAMES_H

#include "sim/engine/scenario/scenario.h"

typedef struct bst_calibration_frames {
    const char *out;          /* output folder, created if necessary */
    const char *sensor;       /* OBSERVER/SENSOR; NULL: all */
    const char *device;       /* OpenCL device; NULL: the default */
    int threads;              /* of the device; 0: all */
    int64_t bias, dark, flat; /* numbers of frames */
    int64_t linearity;        /* exposures of the series for linearity, two flats each */
    double exposure_s;        /* of darks and flats; 0: from the scenario */
    double level_e;           /* light per pixel in flats; 0: half of the capacity */
} bst_calibration_frames;

/* Writes OBSERVER_SENSOR_bias.fits, _dark.fits, _flat.fits and _linearity.fits, one extension per
 * frame, with the fixed patterns of the scenario's runs, and prints a line for each. Prepares the
 * scenario's cameras. Errors: BST_ERR_IO: a file exists or cannot be created; BST_ERR_INTERRUPTED:
 * stop requested; errors of the renderer. */
bst_status bst_calibration_frames_make(bst_ctx *ctx, const bst_calibration_frames *frames,
                                       bst_scenario *scenario) BST_MUST_CHECK;

#endif
