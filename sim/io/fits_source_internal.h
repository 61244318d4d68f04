/* State of an open FITS file of frames, shared by its source files. */
#ifndef BST_IO_FITS_SOURCE_INTERNAL_H
#define BST_IO_FITS_SOURCE_INTERNAL_H

#include "sim/io/fits_cards_internal.h"
#include "sim/io/fits_source.h"

/* A header in memory; bytes 0: none. */
typedef struct bst_fits_source_header {
    char *text;
    size_t bytes, room;
    bst_fits_cards cards;
} bst_fits_source_header;

/* An HDU with frames. */
typedef struct bst_fits_source_hdu {
    int number; /* from 1 */
    int bitpix;
    int64_t first; /* number of its first frame in the file */
    uint64_t at, data_at, end;
    int64_t size[3]; /* width, height, planes */
    bool planes, compressed, has_blank;
    int64_t blank;
    double zero, scale;
} bst_fits_source_hdu;

struct bst_fits_source {
    char path[4096];
    int fd;
    uint64_t bytes; /* of the file */
    bst_fits_source_hdu *hdus;
    size_t count, room;
    int64_t frames;
    bst_fits_source_header primary, header, table; /* header, table: of the selected HDU */
    uint64_t table_at;                             /* data of the table */
    int64_t selected, plane;                       /* index in hdus, -1: none; plane of the frame */
};

/* Reads bytes at an offset; BST_ERR_FORMAT beyond the file's end, BST_ERR_IO. */
bst_status bst_fits_source_read_at(bst_ctx *ctx, const bst_fits_source *source, void *out,
                                   uint64_t bytes, uint64_t at) BST_MUST_CHECK;
/* Loads and parses the header of HDU `number` at an offset. BST_ERR_FORMAT with file and HDU. */
bst_status bst_fits_source_load_header(bst_ctx *ctx, const bst_fits_source *source, int number,
                                       uint64_t at, bst_fits_source_header *header) BST_MUST_CHECK;
/* Value of a key as an integer; `fallback` if it is missing or none. */
int64_t bst_fits_source_int(const bst_fits_source_header *header, const char *key,
                            int64_t fallback);
/* A column of a table. */
typedef struct bst_fits_source_column {
    int64_t offset, repeat; /* bytes from the start of a row; elements */
    char letter;            /* of its TFORM */
    int width;              /* bytes of an element */
} bst_fits_source_column;

/* Finds a column by its name, without regard to case (FITS Standard 4.0, section 7.3.1). False:
 * there is none, or the columns are not those of a table. */
bool bst_fits_source_find_column(const bst_fits_source_header *header, const char *name,
                                 size_t length, bst_fits_source_column *out);

/* Pixels of the selected frame, which is compressed in tiles: RICE_1, GZIP_1, GZIP_2, NOCOMPRESS;
 * integers, floats, floats as scaled integers with or without dithering.
 *
 * Returned:  pixels  [height][width], NAN for blank ones
 * Errors:    BST_ERR_FORMAT with file, HDU and keyword or tile; BST_ERR_IO, BST_ERR_MEMORY
 * Source:    FITS Standard 4.0, section 10 */
bst_status bst_fits_source_tiles(bst_ctx *ctx, const bst_fits_source *source,
                                 const bst_fits_source_hdu *hdu, float *pixels) BST_MUST_CHECK;

/* Big-endian floating-point number of 4 or 8 bytes. */
double bst_fits_source_real_at(const uint8_t *bytes, int width);
/* Big-endian integer of 1, 2, 4 or 8 bytes; of one byte unsigned. */
int64_t bst_fits_source_integer_at(const uint8_t *bytes, int width);

#endif
