/* Point spread functions in FITS images: a width for onboard knowledge, samples for rendering. */
#ifndef BST_IO_PSF_FITS_H
#define BST_IO_PSF_FITS_H

#include "boresight/status.h"
#include "sim/optics/psf.h"

/* Longest side of the image. */
#define BST_PSF_LONGEST_SIDE 4096

typedef struct bst_psf_summary {
    int width, height;
    double oversampling;        /* samples per detector pixel and axis */
    double noise_equivalent_px; /* area (sum p)^2 / sum p^2, detector px^2 */
    double fwhm_px;             /* of the Gaussian with that area */
} bst_psf_summary;

/* Reads the file's first image of two axes (see bst_fits_read_image) as samples of the PSF on a
 * square grid, before integration over the pixel, on any scale and anywhere in the image. Samples
 * per detector pixel: `oversampling` when it is > 0, else the keyword OVERSAMP of the image.
 *
 * fwhm_px belongs to the Gaussian with the same noise-equivalent area, which is what sets the
 * detectability of a point in white noise. For a Gaussian the area is 4 pi sigma^2
 * (King 1983, PASP 95, 163), so FWHM = 2.3548 sqrt(area / (4 pi)).
 *
 * BST_ERR_FORMAT, naming file and value: a value that is not finite or negative, a sum of zero, a
 * side longer than BST_PSF_LONGEST_SIDE, no or a wrong OVERSAMP (0.1 to 1000); and all that
 * bst_fits_read_image refuses. */
bst_status bst_psf_fits_read(bst_ctx *ctx, const char *path, double oversampling,
                             bst_psf_summary *out) BST_MUST_CHECK;

/* Reads PSF samples before integration over the pixel, on any scale: the first image with two axes,
 * or a cube with one plane per node of the field grid. Samples per pixel as in bst_psf_fits_read.
 * The caller frees out->samples. BST_ERR_FORMAT: OVERSAMP missing or wrong; errors of
 * bst_fits_read_image. */
bst_status bst_psf_fits_samples(bst_ctx *ctx, const char *path, double oversampling,
                                bst_psf_samples *out) BST_MUST_CHECK;

/* Writes PSF samples as bst_psf_fits_samples reads them: an image, or a cube of several planes,
 * with the keyword OVERSAMP. The file appears complete or not at all.
 *
 * Errors:    BST_ERR_IO with path and reason */
bst_status bst_psf_fits_write(bst_ctx *ctx, const char *path,
                              const bst_psf_samples *psf) BST_MUST_CHECK;

#endif
