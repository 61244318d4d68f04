/* Loads the dark, flat, bad-pixel and PSF calibration files of image processing. */
#ifndef BST_IMGPROC_CALIBRATE_CALIBRATION_H
#define BST_IMGPROC_CALIBRATE_CALIBRATION_H

#include "imgproc/imgproc.h"
#include "sim/onboard/knowledge.h"

/* Loads the calibration maps dark_file, flat_file and bad_pixel_file; "" leaves a map NULL. Each
 * image must have the sensor's size. Dark values must be finite; flat values must be finite and
 * above zero; bad pixels are exempt. A bad-pixel value other than zero, blank included, marks a bad
 * pixel.
 *
 * Errors:    BST_ERR_CONFIG with key, file and reason or first wrong pixel, counted from (0, 0);
 *            errors of bst_fits_read_image
 * Ownership: free *out with bst_calibration_free */
bst_status bst_calibration_load(bst_ctx *ctx, const bst_imgproc_config *config,
                                const bst_camera *camera, bst_imgproc_maps *out) BST_MUST_CHECK;
/* Loads the PSF that is known on board.
 *
 * Returned:  maps->psf            the PSF; NULL if it is a Gaussian of the camera's FWHM
 *            camera->psf_fwhm_px  FWHM of the Gaussian with the PSF's noise-equivalent area, px;
 *                                 unchanged for a Gaussian
 * Errors:    those of reading the PSF file
 * Ownership: free a PSF read from a file with bst_calibration_free */
bst_status bst_calibration_psf(bst_ctx *ctx, const bst_knowledge *knowledge, bst_camera *camera,
                               bst_imgproc_maps *maps) BST_MUST_CHECK;
/* Frees the maps, releases the measured PSF and clears the struct, which belongs to the caller. */
void bst_calibration_free(bst_imgproc_maps *maps);

#endif
