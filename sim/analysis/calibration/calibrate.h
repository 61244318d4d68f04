/* Fits the calibration of the observation generator to detections of the image path. */
#ifndef BST_ANALYSIS_CALIBRATION_CALIBRATE_H
#define BST_ANALYSIS_CALIBRATION_CALIBRATE_H

#include "boresight/camera.h"
#include "boresight/messages.h"
#include "obsgen/calibration.h"

typedef struct bst_calibration_fitter bst_calibration_fitter;

/* Creates a fitter without data.
 *
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_calibration_fitter_free */
bst_status bst_calibration_fitter_create(bst_ctx *ctx, bst_calibration_fitter **out) BST_MUST_CHECK;
/* Frees a fitter; NULL is allowed. */
void bst_calibration_fitter_free(bst_calibration_fitter *calibrator);

/* Settings of the image path for the following frames; theory uses them. */
typedef struct bst_calibration_path {
    const bst_camera *camera; /* the true camera */
    double jitter_px;         /* of the line of sight, per axis; widens the true PSF */
    double false_alarms_per_frame, streak_min_px, streak_max_px;
} bst_calibration_path;

/* Starts the data of one image path: sets up the generators that its frames are compared with.
 *
 * Given:     path  camera and settings of the path; copied, its camera must outlive the fitter's
 *                  use of it
 * Errors:    those of bst_generator_create */
bst_status bst_calibration_fitter_begin(bst_ctx *ctx, bst_calibration_fitter *calibrator,
                                        const bst_calibration_path *path) BST_MUST_CHECK;

/* Adds one full, unbinned frame to the fit. */
bst_status bst_calibration_fitter_add(bst_ctx *ctx, bst_calibration_fitter *calibrator,
                                      const bst_truth *truth, const bst_detections *detections,
                                      double exposure_s) BST_MUST_CHECK;

/* Numbers of used data, for messages. */
typedef struct bst_calibration_counts {
    long frames, sources, detected, false_alarms, places;
} bst_calibration_counts;

/* Computes the calibration: maximum likelihood for Pd (probit) and false alarms, mean squares for
 * positions, least squares for noise. With too few data the theoretical value is kept.
 * BST_ERR_STATE: not enough data for Pd or false alarms; the message names which. */
bst_status bst_calibration_fitter_fit(bst_ctx *ctx, bst_calibration_fitter *calibrator,
                                      bst_obsgen_calibration *out,
                                      bst_calibration_counts *counts) BST_MUST_CHECK;

#endif
