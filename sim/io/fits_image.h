/* Reads and writes one image of a FITS file, such as a calibration map. */
#ifndef BST_IO_FITS_IMAGE_H
#define BST_IO_FITS_IMAGE_H

#include <stddef.h>

#include "boresight/status.h"

/* Reads the first uncompressed image with two axes (primary array or extension, any BITPIX).
 * *pixels: row-major [*height][*width], physical values (BSCALE, BZERO applied), NAN for blank
 * pixels; the first row of the file is row 0. The caller frees *pixels.
 *
 * Errors:    BST_ERR_NOT_FOUND, BST_ERR_IO: cannot be opened or read; BST_ERR_FORMAT: no
 *            FITS file, compressed, no such image, truncated, a side above 32768 or more than 2^28
 *            pixels; BST_ERR_MEMORY
 * Source:    FITS Standard 4.0, sections 4.4.2 and 5 */
bst_status bst_fits_read_image(bst_ctx *ctx, const char *path, int *width, int *height,
                               float **pixels) BST_MUST_CHECK;

/* As bst_fits_read_image, for two or three axes: *pixels is [*planes][*height][*width]. */
bst_status bst_fits_read_planes(bst_ctx *ctx, const char *path, int *width, int *height,
                                int *planes, float **pixels) BST_MUST_CHECK;

/* As bst_fits_read_image, from memory; `name`: file name for messages. */
bst_status bst_fits_read_image_buffer(bst_ctx *ctx, const char *name, const void *data,
                                      size_t bytes, int *width, int *height,
                                      float **pixels) BST_MUST_CHECK;

/* Writes an image as the primary array of a new FITS file, BITPIX -32. The file appears complete or
 * not at all.
 *
 * Given:     pixels  [height][width]
 *            unit    value of BUNIT, at most 60 characters
 * Errors:    BST_ERR_IO with path and reason */
bst_status bst_fits_write_map(bst_ctx *ctx, const char *path, int width, int height,
                              const float *pixels, const char *unit) BST_MUST_CHECK;

#endif
