/* Pixels of frames and masks of an open file. */
#include <stdlib.h>

#include "sim/io/fits_reader_internal.h"
#include "sim/io/fits_rice.h"

enum {
    /* upper limit of a compressed 16-bit row: verbatim pixels, a code per block, the first pixel */
    MOST_ROW_BYTES = BST_FITS_LONGEST_SIDE * 2 + BST_FITS_LONGEST_SIDE / 2 + 16
};

static bst_status make_room(bst_ctx *ctx, bst_fits_reader *reader, size_t count) {
    if (reader->capacity < count) {
        free(reader->pixels);
        reader->pixels = malloc(count * sizeof *reader->pixels);
        reader->capacity = reader->pixels ? count : 0;
    }
    return reader->pixels ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a frame");
}

/* Converts from BZERO 32768: stored minus 2^15, which inverts the top bit. */
static void from_fits(uint16_t *pixels, size_t count) {
    for (size_t i = 0; i < count; i++) {
        uint8_t *b = (uint8_t *)&pixels[i];
        pixels[i] = (uint16_t)(((unsigned)b[0] << 8 | b[1]) ^ 0x8000u);
    }
}

/* Decodes one compressed row of a frame; `row`: row of the table. */
static bst_status read_row(bst_ctx *ctx, bst_fits_reader *reader, const bst_fits_hdu *h,
                           int64_t row, uint16_t *out) {
    uint8_t place[16];
    int width = h->p.wide ? 8 : 4;
    size_t count = (size_t)h->size[0];
    BST_TRY(bst_fits_read_at(ctx, reader, place, 2 * (uint64_t)width,
                             h->data_at + (uint64_t)row * (uint64_t)h->p.row_bytes));
    uint64_t bytes = bst_fits_big_endian(place, width),
             offset = bst_fits_big_endian(place + width, width);
    bool ok =
        bytes <= MOST_ROW_BYTES && offset <= h->p.heap_bytes && bytes <= h->p.heap_bytes - offset;
    if (ok) {
        BST_TRY(bst_fits_read_at(ctx, reader, reader->row, bytes, h->p.heap_at + offset));
        ok = bst_fits_rice_decode(reader->row, (size_t)bytes, h->p.block, out, count);
    }
    if (!ok) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "%.400s: HDU %d: row %lld of the compressed pixels is damaged",
                        reader->path, h->number, (long long)row);
    }
    for (size_t i = 0; i < count; i++) {
        out[i] ^= 0x8000u;
    }
    return BST_OK;
}

/* Reads rows of the frame whose HDU was found. */
static bst_status read_rows(bst_ctx *ctx, bst_fits_reader *reader, const bst_fits_hdu *h,
                            int64_t plane, int64_t first, int64_t rows) {
    const size_t width = (size_t)h->size[0], count = width * (size_t)rows;
    const int64_t from = plane * h->size[1] + first; /* row of the file's image */
    if (h->compressed && !reader->row) {
        reader->row = malloc(MOST_ROW_BYTES);
        if (!reader->row) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a row");
        }
    }
    BST_TRY(make_room(ctx, reader, count));
    for (int64_t y = 0; y < rows && h->compressed; y++) {
        BST_TRY(read_row(ctx, reader, h, from + y, reader->pixels + (size_t)y * width));
    }
    if (!h->compressed) {
        BST_TRY(bst_fits_read_at(ctx, reader, reader->pixels, count * 2,
                                 h->data_at + (uint64_t)from * width * 2));
        from_fits(reader->pixels, count);
    }
    return BST_OK;
}

bst_status bst_fits_reader_rows(bst_ctx *ctx, bst_fits_reader *reader, int64_t index, int first,
                                int rows, bst_fits_read_frame *out) {
    bst_fits_hdu h;
    if (reader->items) {
        return bst_fail(ctx, BST_ERR_STATE, "%.400s: holds masks", reader->path);
    }
    BST_TRY(bst_fits_find_frame(ctx, reader, index, &h));
    *out = (bst_fits_read_frame){.width = (int)h.size[0], .height = (int)h.size[1]};
    BST_TRY(bst_fits_read_id(ctx, reader, index, &out->exposure_id));
    if (first < 0 || first > out->height) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%.400s: frame %lld has no row %d; it has %d",
                        reader->path, (long long)index, first, out->height);
    }
    rows = rows < out->height - first ? rows : out->height - first;
    if (rows > 0) {
        BST_TRY(read_rows(ctx, reader, &h, reader->info.cube ? index : 0, first, rows));
        out->pixels = reader->pixels;
    }
    return BST_OK;
}

bst_status bst_fits_reader_frame(bst_ctx *ctx, bst_fits_reader *reader, int64_t index,
                                 bst_fits_read_frame *out) {
    return bst_fits_reader_rows(ctx, reader, index, 0, BST_FITS_LONGEST_SIDE, out);
}

bst_status bst_fits_reader_mask(bst_ctx *ctx, bst_fits_reader *reader, int64_t index,
                                bst_fits_read_mask *out) {
    bst_fits_hdu h;
    if (!reader->items) {
        return bst_fail(ctx, BST_ERR_STATE, "%.400s: holds frames", reader->path);
    }
    BST_TRY(bst_fits_find_frame(ctx, reader, index, &h));
    BST_TRY(bst_fits_read_id(ctx, reader, index, &out->exposure_id));
    size_t count = (size_t)h.size[0] * (size_t)h.size[1];
    if (reader->mask_capacity < count) {
        free(reader->mask);
        reader->mask = malloc(count * sizeof *reader->mask);
        reader->mask_capacity = reader->mask ? count : 0;
        if (!reader->mask) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a mask");
        }
    }
    BST_TRY(bst_fits_read_at(ctx, reader, reader->mask, count * sizeof *reader->mask, h.data_at));
    for (size_t i = 0; i < count; i++) {
        reader->mask[i] = (int32_t)bst_fits_big_endian((const uint8_t *)&reader->mask[i], 4);
    }
    out->items = reader->mask;
    out->width = (int)h.size[0];
    out->height = (int)h.size[1];
    return BST_OK;
}
