/* Frames back from a FITS file of a run: image extensions or a datacube, raw or tile-compressed,
 * finished or left over from a killed run. All of it is checked: a damaged file gives an error,
 * never a read beyond memory. cfitsio is not asked, since it believes what headers say of sizes. */
#ifndef BST_IO_FITS_READER_H
#define BST_IO_FITS_READER_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/status.h"

typedef struct bst_fits_reader bst_fits_reader;

typedef struct bst_fits_file_info {
    int64_t frames;    /* whole frames */
    bool cube;         /* one cube, else an image extension per frame */
    bool compressed;   /* tile-compressed (Rice) */
    bool cut_off;      /* the file ends inside what follows the last whole frame */
    int width, height; /* largest of all frames; 0 without frames */
} bst_fits_file_info;

/* Opens a file for reading only and counts its whole frames. Frames are images of 16-bit unsigned
 * numbers (BITPIX 16, BZERO 32768), each in an extension, or planes of a cube in the first or
 * second HDU; or the same tile-compressed by RICE_1, a row to a tile, as boresight and fpack do.
 * Memory: 16 bytes a frame. BST_ERR_NOT_FOUND, BST_ERR_IO: it cannot be opened or read, with the
 * system's reason; BST_ERR_FORMAT: it is no FITS file, or its images are not frames. What follows
 * the last HDU that is whole is no error but cut_off. */
bst_status bst_fits_reader_open(bst_ctx *ctx, const char *path,
                                bst_fits_reader **out) BST_MUST_CHECK;
/* The same of a file in memory, which is borrowed; `name` stands for the path in messages. */
bst_status bst_fits_reader_open_buffer(bst_ctx *ctx, const char *name, const void *data,
                                       uint64_t bytes, bst_fits_reader **out) BST_MUST_CHECK;
/* NULL is allowed. */
void bst_fits_reader_close(bst_fits_reader *reader);
/* Description of the open file; it belongs to the reader. */
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

/* Reads frame `index`, counted from 0 in the file's order. Memory is that of one frame.
 * BST_ERR_FORMAT when its compressed pixels are damaged. */
bst_status bst_fits_reader_frame(bst_ctx *ctx, bst_fits_reader *reader, int64_t index,
                                 bst_fits_read_frame *out) BST_MUST_CHECK;

/* Opens a file of masks (segmentation.fits): 32-bit signed images, an extension each, not
 * compressed. Errors as bst_fits_reader_open. */
bst_status bst_fits_reader_open_masks(bst_ctx *ctx, const char *path,
                                      bst_fits_reader **out) BST_MUST_CHECK;

/* A mask as read. */
typedef struct bst_fits_read_mask {
    const int32_t *items; /* row-major [height][width]; the reader's, until its next call */
    int width, height;
    int64_t exposure_id; /* -1: the file does not say */
} bst_fits_read_mask;

/* Reads mask `index`, counted from 0, of a file that was opened as one of masks. */
bst_status bst_fits_reader_mask(bst_ctx *ctx, bst_fits_reader *reader, int64_t index,
                                bst_fits_read_mask *out) BST_MUST_CHECK;

#endif
