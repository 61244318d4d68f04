/* Writes grey-level PNG files, one pixel per frame pixel. */
#ifndef BST_IO_GREY_PNG_H
#define BST_IO_GREY_PNG_H

#include <stdint.h>

#include "boresight/status.h"

/* Writes a 16-bit grey PNG of width x height pixels, row 0 at the top, complete or not at all.
 * Values are unchanged; the file declares a linear scale. Errors: BST_ERR_MEMORY, BST_ERR_IO.
 * Format: ISO/IEC 15948. */
bst_status bst_grey_png_write16(bst_ctx *ctx, const char *path, const uint16_t *pixels, int width,
                                int height) BST_MUST_CHECK;

/* Writes an 8-bit grey PNG.
 *
 * Given:     pixels  [height][width], row 0 at the top
 * Errors:    BST_ERR_IO, BST_ERR_MEMORY */
bst_status bst_grey_png_write8(bst_ctx *ctx, const char *path, const uint8_t *pixels, int width,
                               int height) BST_MUST_CHECK;

#endif
