/* Frames back from a FITS file of a run: image extensions or a datacube, raw or tile-compressed,
 * finished or left over from a killed run. */
#ifndef BST_IO_FITS_READER_H
#define BST_IO_FITS_READER_H

#include <stdbool.h>
#include <stdint.h>

#include "sim/core/status.h"

typedef struct bst_fits_reader bst_fits_reader;

typedef struct bst_fits_file_info {
    int64_t frames;    /* whole frames */
    bool cube;         /* one cube, else an image extension per frame */
    bool compressed;   /* tile-compressed (Rice) */
    bool cut_off;      /* the file ends inside what follows the last whole frame */
    int width, height; /* largest of all frames; 0 without frames */
} bst_fits_file_info;

/* Opens a file for reading only and counts its whole frames. BST_ERR_IO with cfitsio's reason;
 * BST_ERR_FORMAT when its images are not frames. */
bst_status bst_fits_reader_open(bst_ctx *ctx, const char *path,
                                bst_fits_reader **out) BST_MUST_CHECK;
/* NULL is allowed. */
void bst_fits_reader_close(bst_fits_reader *reader);
const bst_fits_file_info *bst_fits_reader_info(const bst_fits_reader *reader);

/* A frame as read. */
typedef struct bst_fits_read_frame {
    const uint16_t *pixels; /* row-major [height][width]; the reader's, until its next call */
    int width, height;
    int64_t exposure_id; /* -1: the file does not say (the cube of a killed run) */
} bst_fits_read_frame;

/* Number of the exposure of frame `index`, -1 when the file does not say, without reading pixels.
 */
bst_status bst_fits_reader_id(bst_ctx *ctx, bst_fits_reader *reader, int64_t index,
                              int64_t *exposure_id) BST_MUST_CHECK;

/* Reads frame `index`, counted from 0 in the file's order. Memory is that of one frame. */
bst_status bst_fits_reader_frame(bst_ctx *ctx, bst_fits_reader *reader, int64_t index,
                                 bst_fits_read_frame *out) BST_MUST_CHECK;

#endif
