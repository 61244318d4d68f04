/* The PSF of a camera from the stars of a run. */
#ifndef BST_ANALYSIS_CAMERA_CAMERA_PSF_H
#define BST_ANALYSIS_CAMERA_CAMERA_PSF_H

#include <cjson/cJSON.h>

#include "sim/analysis/camera/camera_fit.h"
#include "sim/analysis/camera/effective_psf.h"

/* Identified stars of a run, and where their pixels are. */
typedef struct bst_camera_psf_stars {
    const char *frames; /* FITS file */
    const bst_camera *camera;
    const bst_camera_fit_star *stars; /* [count] */
    const int64_t *fits_index;        /* [count] of the star's frame; -1: a star for no PSF */
    const int *window;                /* [count][2] first column and row of the frame */
    int count;
} bst_camera_psf_stars;

/* Measures the PSF on the pixels around the stars.
 *
 * Errors:    those of the file and of bst_effective_psf_fit; BST_ERR_MEMORY
 * Ownership: free with bst_effective_psf_free */
bst_status bst_camera_psf_fit(bst_ctx *ctx, const bst_camera_psf_stars *stars,
                              const bst_effective_psf_options *options,
                              bst_effective_psf *out) BST_MUST_CHECK;

/* Writes psf.fits (before integration over the pixel, as the camera's optics.psf_file reads it) and
 * psf_sigma.fits (standard errors of its samples) into a folder.
 *
 * Returned:  report  its object `psf_file` is added: figures of each node with standard errors
 * Errors:    those of the outputs; BST_ERR_MEMORY */
bst_status bst_camera_psf_write(bst_ctx *ctx, const char *folder, const bst_effective_psf *psf,
                                cJSON *report) BST_MUST_CHECK;

#endif
