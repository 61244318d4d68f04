/* Internal state of a reader of frames, shared by fits_reader.c and fits_reader_pixels.c. */
#ifndef BST_IO_FITS_READER_INTERNAL_H
#define BST_IO_FITS_READER_INTERNAL_H

#include "sim/io/fits_reader.h"

/* Longest side of a frame, px. */
enum { BST_FITS_LONGEST_SIDE = 32768 };

/* Layout of a tile-compressed image in its table. */
typedef struct bst_fits_packed {
    bool wide; /* descriptors of 64-bit numbers */
    int block;
    int64_t row_bytes; /* of the table */
    uint64_t heap_at, heap_bytes;
} bst_fits_packed;

/* An HDU, from its header. */
typedef struct bst_fits_hdu {
    int number; /* from 1 */
    uint64_t at, data_at, end;
    int64_t axes, size[3]; /* of the image, also if compressed; axes 0: no image */
    bool compressed;
    bst_fits_packed p;
} bst_fits_hdu;

/* Position of a frame's HDU. */
typedef struct bst_fits_frame_place {
    uint64_t at;
    int number;
} bst_fits_frame_place;

struct bst_fits_reader {
    char path[4096];
    int fd; /* -1: file in memory */
    const char *data;
    uint64_t bytes; /* of the file */
    bst_fits_file_info info;
    bool items;                   /* pixels are 32-bit item numbers of sources */
    bst_fits_frame_place *frames; /* of a file with one extension per frame */
    size_t frame_room;
    bst_fits_hdu cube;
    uint64_t ids_at; /* offset of the cube's table; 0: none */
    int64_t id_step, id_count;
    char *header;
    size_t header_bytes, header_room;
    uint8_t *row; /* buffer of MOST_ROW_BYTES for a compressed row */
    uint16_t *pixels;
    size_t capacity;
    int32_t *mask; /* pixels of a file of masks */
    size_t mask_capacity;
};

/* Reads `bytes` at offset `at`, within the size that the file had when opened.
 *
 * Errors:    BST_ERR_FORMAT: beyond that size; BST_ERR_IO */
bst_status bst_fits_read_at(bst_ctx *ctx, const bst_fits_reader *reader, void *out, uint64_t bytes,
                            uint64_t at) BST_MUST_CHECK;

/* Finds the HDU of a frame; loads its header unless it is the cube.
 *
 * Errors:    BST_ERR_ARGUMENT: no such frame; BST_ERR_IO: the file changed */
bst_status bst_fits_find_frame(bst_ctx *ctx, bst_fits_reader *reader, int64_t index,
                               bst_fits_hdu *h) BST_MUST_CHECK;

/* Exposure number of the frame whose header is loaded; -1: unknown. */
bst_status bst_fits_read_id(bst_ctx *ctx, const bst_fits_reader *reader, int64_t index,
                            int64_t *exposure_id) BST_MUST_CHECK;

/* Number of `count` bytes, the most significant first. */
static inline uint64_t bst_fits_big_endian(const uint8_t *bytes, int count) {
    uint64_t value = 0;
    for (int i = 0; i < count; i++) {
        value = value << 8 | bytes[i];
    }
    return value;
}

#endif
