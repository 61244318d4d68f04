/* One image from a FITS file: calibration maps. */
#ifndef BST_IO_FITS_IMAGE_H
#define BST_IO_FITS_IMAGE_H

#include "sim/core/status.h"

/* Reads the file's first image of two axes, in the primary array or an extension, of any BITPIX,
 * tile-compressed ones too. *pixels is row-major [*height][*width], physical values (BSCALE and
 * BZERO applied), NAN where the image has none (BLANK, NaN); the first row of the file is row 0.
 * The caller frees *pixels. BST_ERR_IO: the file cannot be opened or read, with cfitsio's reason;
 * BST_ERR_FORMAT: there is no such image, or a side is longer than 32768; BST_ERR_MEMORY. Source:
 * FITS Standard 4.0, sections 4.4.2 and 5. */
bst_status bst_fits_read_image(bst_ctx *ctx, const char *path, int *width, int *height,
                               float **pixels) BST_MUST_CHECK;

#endif
