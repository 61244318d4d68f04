/* Calibration maps from the files that the configuration names. */
#ifndef BST_IMGPROC_CALIBRATE_CALIBRATION_H
#define BST_IMGPROC_CALIBRATE_CALIBRATION_H

#include "imgproc/imgproc.h"
#include "sim/onboard/knowledge.h"

/* Reads dark_file, flat_file and bad_pixel_file ("" leaves the map NULL). Each must be an image of
 * the sensor's size (as bst_fits_read_image reads it), dark values finite, flat values finite and
 * above zero; pixels of the bad-pixel map are exempt. What is not zero in the bad-pixel map is bad,
 * blank pixels too. The maps are the caller's, freed by bst_calibration_free. BST_ERR_CONFIG with
 * key, file and the reason or the first pixel that is wrong, counted from (0, 0); or the error of
 * reading. */
bst_status bst_calibration_load(bst_ctx *ctx, const bst_imgproc_config *config,
                                const bst_camera *camera, bst_imgproc_maps *out) BST_MUST_CHECK;
/* Sets maps->psf to the PSF that is known on board, and camera->psf_fwhm_px to the width of the
 * Gaussian with its noise-equivalent area; NULL and untouched where it is the Gaussian of that
 * width. That of a file is the caller's, freed by bst_calibration_free. Errors of reading the file.
 */
bst_status bst_calibration_psf(bst_ctx *ctx, const bst_knowledge *knowledge, bst_camera *camera,
                               bst_imgproc_maps *maps) BST_MUST_CHECK;
/* Frees the maps, releases the measured PSF and clears the struct, which belongs to the caller. */
void bst_calibration_free(bst_imgproc_maps *maps);

#endif
