/* Reads frames from PNG and TIFF files of other programs: a shim over libpng and libtiff. Sizes are
 * checked against the file before memory is taken: a damaged file causes an error. */
#ifndef BST_IO_IMAGE_FILE_H
#define BST_IO_IMAGE_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "boresight/status.h"

/* What becomes of a pixel of red, green and blue. */
typedef enum bst_image_colour {
    BST_IMAGE_COLOUR_REFUSE, /* a colour picture is an error */
    BST_IMAGE_COLOUR_MEAN,   /* mean of the three */
    BST_IMAGE_COLOUR_RED,
    BST_IMAGE_COLOUR_GREEN,
    BST_IMAGE_COLOUR_BLUE
} bst_image_colour;

typedef struct bst_image_file bst_image_file;

/* True if bytes are the first of a PNG or TIFF file.
 *
 * Given:     bytes, count  of the file's begin; 8 are enough
 * Source:    ISO/IEC 15948, 5.2; TIFF 6.0, section 2; BigTIFF has 43 in place of 42 */
bool bst_image_file_begins(const void *bytes, size_t count);

/* Opens a PNG or TIFF file and counts its pages.
 *
 * Errors:    BST_ERR_NOT_FOUND, BST_ERR_IO, BST_ERR_MEMORY; BST_ERR_FORMAT with the file: no PNG or
 *            TIFF file, or damaged
 * Ownership: free *out with bst_image_file_close */
bst_status bst_image_file_open(bst_ctx *ctx, const char *path, bst_image_colour colour,
                               bst_image_file **out) BST_MUST_CHECK;
/* Closes a file; NULL is allowed. */
void bst_image_file_close(bst_image_file *file);

/* Name of the file, which belongs to it. */
const char *bst_image_file_path(const bst_image_file *file);
/* Pages of a TIFF file; 1 of a PNG file. */
int64_t bst_image_file_pages(const bst_image_file *file);

/* Selects a page and reads its size.
 *
 * Given:     page  from 0
 * Errors:    BST_ERR_ARGUMENT: no such page; BST_ERR_FORMAT with file and page: damaged, a side
 *            beyond 32768, colour that is not to be converted, lossy, or another kind of pixels
 *            than unsigned or signed integers of 8, 16 and 32 bits and 32-bit floats */
bst_status bst_image_file_select(bst_ctx *ctx, bst_image_file *file, int64_t page, int *width,
                                 int *height) BST_MUST_CHECK;

/* Pixels of the selected page.
 *
 * Returned:  pixels  [height][width] as stored, without gamma: those of 16 bits are exact. The
 *                    picture's top row is row 0
 * Errors:    BST_ERR_FORMAT: cut short or damaged; BST_ERR_MEMORY */
bst_status bst_image_file_pixels(bst_ctx *ctx, bst_image_file *file, float *pixels) BST_MUST_CHECK;

#endif
