/* Reads frames from FITS files of other programs, with the keywords that belong to each frame. All
 * sizes are checked against the file: a damaged file causes an error, never an invalid memory
 * access. */
#ifndef BST_IO_FITS_SOURCE_H
#define BST_IO_FITS_SOURCE_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/status.h"

typedef struct bst_fits_source bst_fits_source;

/* Room for the text of a keyword's value, with the zero byte. */
enum { BST_FITS_SOURCE_TEXT = 128 };

/* Place and size of a frame. */
typedef struct bst_fits_source_frame {
    int hdu;       /* from 1 */
    int64_t plane; /* of a cube, from 0; -1: the HDU is one frame */
    int width, height;
    bool compressed;
} bst_fits_source_frame;

/* Opens a FITS file and lists its frames: every image of two axes, and every plane of images of
 * three, in the order of the file; any BITPIX, or compressed in tiles (RICE_1, GZIP_1, GZIP_2).
 *
 * Given:     path  a file
 * Returned:  *out  the open file
 * Errors:    BST_ERR_NOT_FOUND, BST_ERR_IO, BST_ERR_MEMORY; BST_ERR_FORMAT with file, HDU and
 *            keyword: no FITS file, cut short, or without an image
 * Ownership: free *out with bst_fits_source_close
 * Source:    FITS Standard 4.0, sections 4, 5 and 7.3 */
bst_status bst_fits_source_open(bst_ctx *ctx, const char *path,
                                bst_fits_source **out) BST_MUST_CHECK;
/* Closes a file; NULL is allowed. */
void bst_fits_source_close(bst_fits_source *source);

/* Name of the file, which belongs to the source. */
const char *bst_fits_source_path(const bst_fits_source *source);
/* Number of frames in the file, 1 or more. */
int64_t bst_fits_source_count(const bst_fits_source *source);

/* Selects a frame: the functions below refer to it.
 *
 * Given:     index  from 0
 * Returned:  *out   place and size
 * Errors:    BST_ERR_ARGUMENT: no such frame; BST_ERR_IO: the file changed */
bst_status bst_fits_source_select(bst_ctx *ctx, bst_fits_source *source, int64_t index,
                                  bst_fits_source_frame *out) BST_MUST_CHECK;

/* Value of a keyword of the selected frame. The first of these that has it: the row of a cube's
 * table, in the column of that name ("OBSPOS[2]" is the second element of a vector); the header of
 * the frame's HDU; the primary header.
 *
 * Returned:  value  text without quotes and comment
 *            false: nothing has the keyword
 * Notes:     no error: a table that is cut short has no columns. */
bool bst_fits_source_text(bst_fits_source *source, const char *keyword,
                          char value[BST_FITS_SOURCE_TEXT]);

/* Pixels of the selected frame.
 *
 * Returned:  pixels  [height][width], physical values (BSCALE, BZERO applied), NAN for blank ones;
 *                    16-bit values are exact. The first row of the file is row 0
 * Errors:    BST_ERR_IO, BST_ERR_MEMORY; BST_ERR_FORMAT: damaged compressed pixels, or compressed
 *            in a way that is not supported */
bst_status bst_fits_source_pixels(bst_ctx *ctx, bst_fits_source *source,
                                  float *pixels) BST_MUST_CHECK;

#endif
