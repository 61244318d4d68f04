/* One image from a FITS file: calibration maps. */
#ifndef BST_IO_FITS_IMAGE_H
#define BST_IO_FITS_IMAGE_H

#include <stddef.h>

#include "boresight/status.h"

/* Reads the file's first image of two axes, in the primary array or an extension, of any BITPIX,
 * not compressed. *pixels is row-major [*height][*width], physical values (BSCALE and
 * BZERO applied), NAN where the image has none (BLANK, NaN); the first row of the file is row 0.
 * The caller frees *pixels. BST_ERR_NOT_FOUND, BST_ERR_IO: the file cannot be opened or read, with
 * the system's or cfitsio's reason; BST_ERR_FORMAT: it is no FITS file, or compressed,
 * or has no such image, or a side is longer than 32768, or it has more than 2^28 pixels, or is cut
 * short; BST_ERR_MEMORY. Source: FITS Standard 4.0, sections 4.4.2 and 5. */
bst_status bst_fits_read_image(bst_ctx *ctx, const char *path, int *width, int *height,
                               float **pixels) BST_MUST_CHECK;

/* The same for the first image of two or three axes: *pixels is [*planes][*height][*width]. */
bst_status bst_fits_read_planes(bst_ctx *ctx, const char *path, int *width, int *height,
                                int *planes, float **pixels) BST_MUST_CHECK;

/* bst_fits_read_image from memory; `name` stands for the path in messages. */
bst_status bst_fits_read_image_buffer(bst_ctx *ctx, const char *name, const void *data,
                                      size_t bytes, int *width, int *height,
                                      float **pixels) BST_MUST_CHECK;

#endif
