/* `boresight calibrate-camera`: a camera from the identified stars of a run. */
#ifndef BST_ANALYSIS_CAMERA_CAMERA_CALIBRATION_H
#define BST_ANALYSIS_CAMERA_CAMERA_CALIBRATION_H

#include <stdio.h>

#include "sim/analysis/camera/camera_fit.h"
#include "sim/analysis/camera/effective_psf.h"
#include "sim/cli/options.h"

typedef struct bst_camera_calibration_request {
    const char *out, *extends, *camera, *sensor; /* camera NULL: the place that the run has */
    int64_t psf_columns, psf_rows;               /* nodes of the PSF over the field; 0: none */
    int64_t psf_radius_px;
    bool overwrite, help;
} bst_camera_calibration_request;

/* Request without any option given. */
#define BST_CAMERA_CALIBRATION_DEFAULTS \
    { .psf_radius_px = 12 }

/* Table of the options, with offsets in a request. */
extern const bst_option bst_camera_calibration_options[];

/* Fits the camera to the detections of a run that are identified stars and to its frames, prints
 * the figures and writes the folder request->out: camera.json, report.json, stars.csv, plot.png,
 * and the PSF if it is asked for (docs/how-to/real_frames.md).
 *
 * Errors:    BST_ERR_RANGE: too few stars; those of the run and of the outputs */
bst_status bst_camera_calibration_run(bst_ctx *ctx, const bst_camera_calibration_request *request,
                                      const char *run, FILE *out) BST_MUST_CHECK;

/* FWHM of the stars' images, medians over the field and its ninths (row by row); NAN: no star. */
typedef struct bst_camera_widths {
    double fwhm_px, fwhm_sigma_px, ninth_px[9];
    int stars;
} bst_camera_widths;

typedef struct bst_camera_figures {
    bst_camera_geometry_fit geometry;
    bst_camera_photometry_fit photometry; /* stars 0: none */
    bst_camera_widths widths;
    bst_effective_psf psf; /* value NULL: none */
} bst_camera_figures;

/* Writes the files of the folder.
 *
 * Given:     stars, exposures  [count] and the exposure of each star's frame
 * Errors:    those of the outputs */
bst_status bst_camera_calibration_write(bst_ctx *ctx, const bst_camera_calibration_request *request,
                                        const bst_camera *start, const bst_camera_figures *figures,
                                        const bst_camera_fit_star *stars, const int64_t *exposures,
                                        int count) BST_MUST_CHECK;

#endif
