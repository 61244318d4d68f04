/* Compressed tiles of FITS images (FITS Standard 4.0, section 10). */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <zlib.h>

#include "sim/io/fits_rice.h"
#include "sim/io/fits_tiles_internal.h"

/* Most pixels of a tile, and bytes that one has in a file at most. */
enum { MOST_TILE_PIXELS = 1 << 28, MOST_PIXEL_BYTES = 16 };

enum { METHOD_NONE, METHOD_RICE, METHOD_GZIP_1, METHOD_GZIP_2 };

/* A compressed image that is being read. */
typedef struct tiling {
    bst_ctx *ctx;
    const bst_fits_source *source;
    const bst_fits_source_hdu *hdu;
    int method, bitpix, pixel_bytes, block; /* pixel_bytes, block: of RICE_1 */
    int64_t size[3], tile[3], count[3];     /* pixels; pixels of a tile; tiles */
    bool quantised;                         /* floats as scaled integers */
    bst_fits_tile_scale scale;
    bst_fits_source_column data, gzip, plain, tile_scale, tile_zero, tile_blank; /* width 0: none */
    uint64_t heap_at, heap_bytes;
    size_t tile_pixels;
    uint8_t *packed; /* of a tile */
    size_t room;
    uint8_t *bytes;   /* [tile_pixels * 8] */
    int32_t *numbers; /* [tile_pixels] */
    float *values;    /* [tile_pixels] */
} tiling;

static bst_status fail(const tiling *t, const char *what) {
    return bst_fail(t->ctx, BST_ERR_FORMAT, "%.400s: HDU %d: %s", t->source->path, t->hdu->number,
                    what);
}

static bst_status fail_tile(const tiling *t, int64_t row) {
    char what[80];
    snprintf(what, sizeof what, "tile %" PRId64 " of the compressed pixels is damaged", row + 1);
    return fail(t, what);
}

/* Text of a key; "": none. */
static void text_of(const tiling *t, const char *key, char text[BST_FITS_CARD]) {
    if (!bst_fits_card_text(t->source->header.text, t->source->header.bytes, key, text)) {
        *text = '\0';
    }
}

/* Value of a parameter of the compression (ZNAMEn, ZVALn). */
static int64_t parameter(const tiling *t, const char *name, int64_t fallback) {
    for (int i = 1; i <= 16; i++) {
        char key[24], text[BST_FITS_CARD];
        snprintf(key, sizeof key, "ZNAME%d", i);
        text_of(t, key, text);
        if (strcmp(text, name) == 0) {
            snprintf(key, sizeof key, "ZVAL%d", i);
            return bst_fits_source_int(&t->source->header, key, fallback);
        }
    }
    return fallback;
}

static void find(const tiling *t, const char *name, bst_fits_source_column *out) {
    if (!bst_fits_source_find_column(&t->source->header, name, strlen(name), out)) {
        *out = (bst_fits_source_column){.width = 0};
    }
}

/* Reads the kind of compression. */
static bst_status read_method(tiling *t) {
    char name[BST_FITS_CARD], quantised[BST_FITS_CARD], what[240];
    text_of(t, "ZCMPTYPE", name);
    text_of(t, "ZQUANTIZ", quantised);
    static const char *const names[] = {"NOCOMPRESS", "RICE_1", "GZIP_1", "GZIP_2"};
    t->method = strcmp(name, "RICE_ONE") == 0 ? METHOD_RICE : -1;
    for (int i = 0; i < 4; i++) {
        t->method = strcmp(name, names[i]) == 0 ? i : t->method;
    }
    if (t->method < 0) {
        snprintf(what, sizeof what,
                 "ZCMPTYPE is %.20s (allowed: RICE_1, GZIP_1, GZIP_2, NOCOMPRESS; unpack the file "
                 "with funpack)",
                 name);
        return fail(t, what);
    }
    int width = abs(t->bitpix) / 8;
    t->pixel_bytes = (int)parameter(t, "BYTEPIX", t->bitpix > 0 ? width : 4);
    t->block = (int)parameter(t, "BLOCKSIZE", 32);
    if (t->method == METHOD_RICE &&
        ((t->pixel_bytes != 1 && t->pixel_bytes != 2 && t->pixel_bytes != 4) || t->block < 1 ||
         t->block > MOST_TILE_PIXELS)) {
        return fail(t,
                    "BYTEPIX or BLOCKSIZE of the compression is wrong (allowed: 1, 2 or 4; 1 or "
                    "more)");
    }
    t->quantised = t->bitpix < 0 && t->tile_scale.width > 0 && t->tile_zero.width > 0 &&
                   strcmp(quantised, "NONE") != 0;
    t->scale.dithered = strncmp(quantised, "SUBTRACTIVE_DITHER", 18) == 0;
    t->scale.zero_kept = strcmp(quantised, "SUBTRACTIVE_DITHER_2") == 0;
    t->scale.seed = bst_fits_source_int(&t->source->header, "ZDITHER0", 1);
    if (t->bitpix == 64 || (t->method == METHOD_RICE && t->bitpix < 0 && !t->quantised)) {
        return fail(t, "ZBITPIX is not read with this compression (allowed: 8, 16, 32, -32, -64)");
    }
    return BST_OK;
}

/* Reads the sizes of tiles. */
static bst_status read_sizes(tiling *t) {
    const bst_fits_source_header *h = &t->source->header;
    int64_t tiles = 1, pixels = 1;
    for (int i = 0; i < 3; i++) {
        char key[24];
        snprintf(key, sizeof key, "ZTILE%d", i + 1);
        t->size[i] = t->hdu->size[i];
        int64_t tile = bst_fits_source_int(h, key, i == 0 ? t->size[0] : 1);
        if (tile < 1) {
            return fail(t, "ZTILEn is wrong (allowed: 1 or more)");
        }
        t->tile[i] = tile < t->size[i] ? tile : t->size[i];
        t->count[i] = (t->size[i] + t->tile[i] - 1) / t->tile[i];
        tiles *= t->count[i];
        pixels *= t->tile[i]; /* sides up to 2^15, planes up to 2^24 */
    }
    if (pixels > MOST_TILE_PIXELS) {
        return fail(t, "ZTILEn give tiles of more than 268435456 pixels (allowed: that many)");
    }
    if (tiles != h->cards.axes[1]) {
        return fail(t, "NAXIS2 is not the number of tiles that ZNAXISn and ZTILEn give");
    }
    t->tile_pixels = (size_t)pixels;
    return BST_OK;
}

static bst_status prepare(tiling *t) {
    const bst_fits_source_header *h = &t->source->header;
    t->bitpix = t->hdu->bitpix;
    find(t, "COMPRESSED_DATA", &t->data);
    find(t, "GZIP_COMPRESSED_DATA", &t->gzip);
    find(t, "UNCOMPRESSED_DATA", &t->plain);
    find(t, "ZSCALE", &t->tile_scale);
    find(t, "ZZERO", &t->tile_zero);
    find(t, "ZBLANK", &t->tile_blank);
    if (t->bitpix != 8 && t->bitpix != 16 && t->bitpix != 32 && t->bitpix != -32 &&
        t->bitpix != -64) {
        return fail(t, "ZBITPIX is wrong (allowed: 8, 16, 32, -32, -64)");
    }
    BST_TRY(read_sizes(t));
    BST_TRY(read_method(t));
    t->scale.scale = t->hdu->scale;
    t->scale.zero = t->hdu->zero;
    t->scale.has_blank = t->bitpix > 0 && t->hdu->has_blank;
    t->scale.blank = t->hdu->blank;
    int64_t blank;
    if (bst_fits_card_int(h->text, h->bytes, "ZBLANK", &blank)) {
        t->scale.has_blank = true;
        t->scale.blank = blank;
    } else if (t->quantised) { /* cfitsio leaves the keyword out where it is this */
        t->scale.has_blank = true;
        t->scale.blank = INT32_MIN;
    }
    uint64_t table = (uint64_t)h->cards.axes[0] * (uint64_t)h->cards.axes[1];
    int64_t heap = bst_fits_source_int(h, "THEAP", (int64_t)table);
    if (heap < (int64_t)table || (uint64_t)heap > h->cards.data_bytes) {
        return fail(t, "THEAP is wrong (allowed: behind the rows, within the data)");
    }
    t->heap_at = t->hdu->data_at + (uint64_t)heap;
    t->heap_bytes = h->cards.data_bytes - (uint64_t)heap;
    t->bytes = malloc(t->tile_pixels * 8);
    t->numbers = malloc(t->tile_pixels * sizeof *t->numbers);
    t->values = malloc(t->tile_pixels * sizeof *t->values);
    return t->bytes && t->numbers && t->values
               ? BST_OK
               : bst_fail(t->ctx, BST_ERR_MEMORY, "%.400s: no memory for a tile", t->source->path);
}

/* Reads an element of a row of the table. */
static bst_status read_cell(const tiling *t, const bst_fits_source_column *c, int64_t row,
                            uint8_t out[16]) {
    return bst_fits_source_read_at(t->ctx, t->source, out, (uint64_t)c->width,
                                   t->hdu->data_at +
                                       (uint64_t)row * (uint64_t)t->source->header.cards.axes[0] +
                                       (uint64_t)c->offset);
}

/* Reads what a descriptor of variable length points at. *bytes 0: nothing. width: of an element */
static bst_status read_packed(tiling *t, const bst_fits_source_column *c, int64_t row, int width,
                              size_t *bytes) {
    uint8_t cell[16];
    *bytes = 0;
    if (c->width == 0 || (c->letter != 'P' && c->letter != 'Q') || c->repeat < 1) {
        return BST_OK;
    }
    BST_TRY(read_cell(t, c, row, cell));
    int half = c->width / 2;
    int64_t count = bst_fits_source_integer_at(cell, half);
    int64_t at = bst_fits_source_integer_at(cell + half, half);
    int64_t most = (int64_t)t->tile_pixels * MOST_PIXEL_BYTES + 4096;
    if (count < 0 || at < 0 || count > most / width || (uint64_t)at > t->heap_bytes ||
        (uint64_t)(count * width) > t->heap_bytes - (uint64_t)at) {
        return fail_tile(t, row);
    }
    *bytes = (size_t)(count * width);
    if (*bytes > t->room) {
        free(t->packed);
        t->packed = malloc(*bytes);
        t->room = t->packed ? *bytes : 0;
        if (!t->packed) {
            return bst_fail(t->ctx, BST_ERR_MEMORY, "%.400s: no memory for a tile",
                            t->source->path);
        }
    }
    return bst_fits_source_read_at(t->ctx, t->source, t->packed, *bytes, t->heap_at + (uint64_t)at);
}

/* Unpacks gzip; the result must have `bytes` bytes. */
static bool inflate_all(const uint8_t *from, size_t from_bytes, uint8_t *to, size_t bytes) {
    z_stream z = {.next_in = (Bytef *)from,
                  .avail_in = (uInt)from_bytes,
                  .next_out = to,
                  .avail_out = (uInt)bytes};
    if (inflateInit2(&z, 15 + 32) != Z_OK) { /* 32: the header says whether gzip or zlib */
        return false;
    }
    int result = inflate(&z, Z_FINISH);
    inflateEnd(&z);
    return result == Z_STREAM_END && z.avail_out == 0;
}

/* Puts bytes that GZIP_2 ordered by their significance in the order of the pixels. */
static void unshuffle(const uint8_t *from, size_t count, size_t width, uint8_t *to) {
    for (size_t k = 0; k < width; k++) {
        for (size_t i = 0; i < count; i++) {
            to[i * width + k] = from[k * count + i];
        }
    }
}

/* Numbers or floats of bytes in the order of FITS. */
static void take_bytes(tiling *t, const uint8_t *bytes, size_t count, bool real) {
    int width = real ? -t->bitpix / 8 : t->bitpix < 0 ? 4 : t->bitpix / 8;
    for (size_t i = 0; i < count; i++) {
        const uint8_t *at = bytes + i * (size_t)width;
        if (real) {
            t->values[i] =
                (float)(bst_fits_source_real_at(at, width) * t->scale.scale + t->scale.zero);
        } else {
            t->numbers[i] = (int32_t)bst_fits_source_integer_at(at, width);
        }
    }
}

/* Unpacks a tile to t->numbers, or to t->values if *real. */
static bst_status unpack(tiling *t, int64_t row, size_t count, bool *real) {
    size_t bytes,
        width = (size_t)(t->bitpix < 0 ? (t->quantised ? 4 : -t->bitpix / 8) : t->bitpix / 8);
    *real = t->bitpix < 0 && !t->quantised;
    BST_TRY(read_packed(t, &t->data, row, 1, &bytes));
    bool good = bytes > 0;
    if (good && t->method == METHOD_RICE) {
        good = bst_fits_rice_decode_wide(t->packed, bytes, t->block, t->pixel_bytes, t->numbers,
                                         count);
    } else if (good && t->method != METHOD_NONE) {
        good = inflate_all(t->packed, bytes, t->bytes, count * width);
        if (good && t->method == METHOD_GZIP_2) {
            uint8_t *ordered = malloc(count * width);
            good = ordered != NULL;
            if (good) {
                unshuffle(t->bytes, count, width, ordered);
                memcpy(t->bytes, ordered, count * width);
            }
            free(ordered);
        }
        if (good) {
            take_bytes(t, t->bytes, count, *real);
        }
    } else if (good) {
        good = bytes == count * width;
        if (good) {
            take_bytes(t, t->packed, count, *real);
        }
    }
    if (bytes > 0) {
        return good ? BST_OK : fail_tile(t, row);
    }
    /* a tile that could not be compressed so: of floats those that were not scaled */
    width = (size_t)abs(t->bitpix) / 8;
    *real = t->bitpix < 0;
    BST_TRY(read_packed(t, &t->gzip, row, 1, &bytes));
    if (bytes > 0) {
        if (!inflate_all(t->packed, bytes, t->bytes, count * width)) {
            return fail_tile(t, row);
        }
        take_bytes(t, t->bytes, count, *real);
        return BST_OK;
    }
    BST_TRY(read_packed(t, &t->plain, row, (int)width, &bytes));
    if (bytes != count * width) {
        return fail_tile(t, row);
    }
    take_bytes(t, t->packed, count, *real);
    return BST_OK;
}

/* Scale and zero of a tile of floats. */
static bst_status read_scale(const tiling *t, int64_t row, bst_fits_tile_scale *s) {
    uint8_t cell[16];
    if (t->tile_scale.letter != 'D' && t->tile_scale.letter != 'E') {
        return fail(t, "the column ZSCALE has no numbers");
    }
    BST_TRY(read_cell(t, &t->tile_scale, row, cell));
    s->scale = bst_fits_source_real_at(cell, t->tile_scale.width);
    if (t->tile_zero.letter != 'D' && t->tile_zero.letter != 'E') {
        return fail(t, "the column ZZERO has no numbers");
    }
    BST_TRY(read_cell(t, &t->tile_zero, row, cell));
    s->zero = bst_fits_source_real_at(cell, t->tile_zero.width);
    if (t->tile_blank.width > 0 && strchr("BIJK", t->tile_blank.letter)) {
        BST_TRY(read_cell(t, &t->tile_blank, row, cell));
        s->has_blank = true;
        s->blank = bst_fits_source_integer_at(cell, t->tile_blank.width);
    }
    return BST_OK;
}

/* Copies the part of a tile that is in the plane. from: [3] first pixel of the tile; size: [3] */
static void copy_tile(const tiling *t, const int64_t from[3], const int64_t size[3],
                      float *pixels) {
    int64_t z = t->source->plane - from[2];
    for (int64_t y = 0; y < size[1]; y++) {
        memcpy(pixels + (from[1] + y) * t->size[0] + from[0],
               t->values + (z * size[1] + y) * size[0], (size_t)size[0] * sizeof *pixels);
    }
}

/* Reads all tiles of a plane. */
static bst_status read_plane(tiling *t, float *pixels) {
    int64_t layer = t->source->plane / t->tile[2];
    for (int64_t i = 0; i < t->count[0] * t->count[1]; i++) {
        const int64_t at[3] = {i % t->count[0], i / t->count[0], layer};
        int64_t from[3], size[3], row = layer * t->count[0] * t->count[1] + i;
        for (int k = 0; k < 3; k++) {
            from[k] = at[k] * t->tile[k];
            size[k] = t->size[k] - from[k] < t->tile[k] ? t->size[k] - from[k] : t->tile[k];
        }
        size_t count = (size_t)(size[0] * size[1] * size[2]);
        bst_fits_tile_scale scale = t->scale;
        bool real;
        BST_TRY(unpack(t, row, count, &real));
        if (!real) {
            if (t->quantised) {
                BST_TRY(read_scale(t, row, &scale));
            }
            scale.dithered = scale.dithered && t->quantised;
            bst_fits_tile_values(&scale, row + 1, t->numbers, count, t->values);
        }
        copy_tile(t, from, size, pixels);
    }
    return BST_OK;
}

bst_status bst_fits_source_tiles(bst_ctx *ctx, const bst_fits_source *source,
                                 const bst_fits_source_hdu *hdu, float *pixels) {
    tiling t = {.ctx = ctx, .source = source, .hdu = hdu};
    bst_status status = prepare(&t);
    status = status == BST_OK ? read_plane(&t, pixels) : status;
    free(t.packed);
    free(t.bytes);
    free(t.numbers);
    free(t.values);
    return status;
}
