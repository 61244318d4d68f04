/* Reads frames from a run's FITS file: image extensions or a datacube, raw or tile-compressed, also
 * of a killed run. All sizes are checked: a damaged file causes an error, never an invalid memory
 * access. cfitsio is not used, because it trusts the sizes in headers. */
#ifndef BST_IO_FITS_READER_H
#define BST_IO_FITS_READER_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/status.h"

typedef struct bst_fits_reader bst_fits_reader;

typedef struct bst_fits_file_info {
    int64_t frames;    /* complete frames */
    bool cube;         /* a datacube, else one image extension per frame */
    bool compressed;   /* tile-compressed (Rice) */
    bool cut_off;      /* the file ends within data after the last complete frame */
    int width, height; /* largest of all frames; 0 without frames */
} bst_fits_file_info;

/* Opens a FITS file of frames for reading and counts its complete frames. Frames are 16-bit
 * unsigned images (BITPIX 16, BZERO 32768): extensions, or planes of a cube in the first or second
 * HDU; raw or RICE_1 tile-compressed with one tile per row, as boresight and fpack write. Memory:
 * 16 bytes per frame. BST_ERR_NOT_FOUND, BST_ERR_IO: cannot be opened or read; BST_ERR_FORMAT: no
 * FITS file, or its images are no frames. Data after the last complete HDU only set cut_off. */
bst_status bst_fits_reader_open(bst_ctx *ctx, const char *path,
                                bst_fits_reader **out) BST_MUST_CHECK;
/* As bst_fits_reader_open, for a file in memory, which is borrowed; `name`: file name for
 * messages. */
bst_status bst_fits_reader_open_buffer(bst_ctx *ctx, const char *name, const void *data,
                                       uint64_t bytes, bst_fits_reader **out) BST_MUST_CHECK;
/* NULL is allowed. */
void bst_fits_reader_close(bst_fits_reader *reader);
/* Description of the open file; it belongs to the reader. */
const bst_fits_file_info *bst_fits_reader_info(const bst_fits_reader *reader);

/* A frame read from a file. */
typedef struct bst_fits_read_frame {
    const uint16_t
        *pixels; /* row-major [height][width]; owned by the reader, valid until its next call */
    int width, height;
    int64_t exposure_id; /* -1: unknown (cube of a killed run) */
} bst_fits_read_frame;

/* Exposure number of frame `index` without reading pixels; -1: unknown. */
bst_status bst_fits_reader_id(bst_ctx *ctx, bst_fits_reader *reader, int64_t index,
                              int64_t *exposure_id) BST_MUST_CHECK;

/* Reads frame `index`, from 0 in file order. Memory: one frame. BST_ERR_FORMAT: damaged compressed
 * pixels. */
bst_status bst_fits_reader_frame(bst_ctx *ctx, bst_fits_reader *reader, int64_t index,
                                 bst_fits_read_frame *out) BST_MUST_CHECK;

/* Reads rows of frame `index`. Of a compressed frame only these rows are unpacked: a row is a tile.
 *
 * Given:     first  from 0 to the height of the frame
 *            rows   that are wanted; 0 or fewer: none, for the size of the frame alone
 * Returned:  *out   pixels: [rows][width], fewer rows at the end of the frame; NULL: none. width,
 *                   height: of the whole frame
 * Errors:    those of bst_fits_reader_frame; BST_ERR_ARGUMENT: no such frame or row
 * Notes:     memory: these rows. The buffer does not shrink */
bst_status bst_fits_reader_rows(bst_ctx *ctx, bst_fits_reader *reader, int64_t index, int first,
                                int rows, bst_fits_read_frame *out) BST_MUST_CHECK;

/* Opens a FITS file of segmentation masks (segmentation.fits): uncompressed 32-bit signed image
 * extensions. Errors as bst_fits_reader_open. */
bst_status bst_fits_reader_open_masks(bst_ctx *ctx, const char *path,
                                      bst_fits_reader **out) BST_MUST_CHECK;

/* A segmentation mask read from a file. */
typedef struct bst_fits_read_mask {
    const int32_t
        *items; /* row-major [height][width]; owned by the reader, valid until its next call */
    int width, height;
    int64_t exposure_id; /* -1: unknown */
} bst_fits_read_mask;

/* Reads mask `index`, from 0, of a file opened by bst_fits_reader_open_masks. */
bst_status bst_fits_reader_mask(bst_ctx *ctx, bst_fits_reader *reader, int64_t index,
                                bst_fits_read_mask *out) BST_MUST_CHECK;

#endif
