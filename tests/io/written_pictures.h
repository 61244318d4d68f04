/* PNG and TIFF files that tests write byte by byte after their standards (ISO/IEC 15948; TIFF 6.0),
 * so that what is expected does not come from the libraries that read. */
#ifndef TESTS_IO_WRITTEN_PICTURES_H
#define TESTS_IO_WRITTEN_PICTURES_H

#include <zlib.h>

#include "tests/io/written_fits.h"

static inline void png_chunk(fixture *f, const char type[4], const void *data, size_t bytes) {
    big_endian(f, bytes, 4);
    size_t at = f->count;
    put(f, type, 4);
    put(f, data, bytes);
    big_endian(f, crc32(0, f->bytes + at, (uInt)(4 + bytes)), 4);
}

/* A PNG file. rows: each with its filter byte, [bytes] */
static inline void write_png(fixture *f, int width, int height, int depth, int colour,
                             int interlace, const void *rows, size_t bytes) {
    uint8_t head[13] = {0,
                        0,
                        (uint8_t)(width >> 8),
                        (uint8_t)width,
                        0,
                        0,
                        (uint8_t)(height >> 8),
                        (uint8_t)height,
                        (uint8_t)depth,
                        (uint8_t)colour,
                        0,
                        0,
                        (uint8_t)interlace};
    uint8_t packed[4096];
    uLongf packed_bytes = sizeof packed;
    assert_int_equal(compress(packed, &packed_bytes, rows, bytes), Z_OK);
    f->count = 0;
    put(f, "\x89PNG\r\n\x1a\n", 8);
    png_chunk(f, "IHDR", head, sizeof head);
    if (colour == 3) {
        png_chunk(f, "PLTE", "\1\2\3\4\5\6", 6);
    }
    png_chunk(f, "IDAT", packed, packed_bytes);
    png_chunk(f, "IEND", "", 0);
    save(f, f->count);
}

/* Grey pixels of 16 bits: rows of `width` values, which begin with `first` and grow by one. */
static inline void write_png16(fixture *f, int width, int height, int first) {
    uint8_t rows[2048];
    size_t n = 0;
    for (int i = 0; i < width * height; i++) {
        if (i % width == 0) {
            rows[n++] = 0;
        }
        rows[n++] = (uint8_t)((first + i) >> 8);
        rows[n++] = (uint8_t)(first + i);
    }
    write_png(f, width, height, 16, 0, 0, rows, n);
}

/* A page of a TIFF file; 0 where the default of the standard holds. */
typedef struct tiff_page {
    int width, height, bits, samples, format, photometric, compression, orientation;
    const void *data; /* one strip, in the order of bytes of the file */
    size_t bytes;
} tiff_page;

/* A number of the file's order of bytes. */
static inline void tiff_number(fixture *f, bool big, uint64_t value, int width) {
    for (int i = 0; i < width; i++) {
        uint8_t byte = (uint8_t)(value >> (8 * (big ? width - 1 - i : i)));
        put(f, &byte, 1);
    }
}

static inline void tiff_tag(fixture *f, bool big, int tag, int type, uint64_t value) {
    tiff_number(f, big, (uint64_t)tag, 2);
    tiff_number(f, big, (uint64_t)type, 2);
    tiff_number(f, big, 1, 4);
    tiff_number(f, big, value, type == 3 ? 2 : 4);
    if (type == 3) {
        tiff_number(f, big, 0, 2);
    }
}

/* A TIFF file of some pages. */
static inline void write_tiff(fixture *f, bool big, const tiff_page *pages, int count) {
    f->count = 0;
    put(f, big ? "MM\0*" : "II*\0", 4);
    tiff_number(f, big, 8, 4);
    for (int i = 0; i < count; i++) {
        const tiff_page *p = &pages[i];
        const int tags = 11;
        size_t at = f->count + 2 + 12 * (size_t)tags + 4, padded = (p->bytes + 1) / 2 * 2;
        tiff_number(f, big, (uint64_t)tags, 2);
        tiff_tag(f, big, 256, 4, (uint64_t)p->width);
        tiff_tag(f, big, 257, 4, (uint64_t)p->height);
        tiff_tag(f, big, 258, 3, (uint64_t)p->bits);
        tiff_tag(f, big, 259, 3, (uint64_t)(p->compression ? p->compression : 1));
        tiff_tag(f, big, 262, 3,
                 (uint64_t)(p->photometric < 0 ? 0
                            : p->photometric   ? p->photometric
                                               : 1));
        tiff_tag(f, big, 273, 4, at);
        tiff_tag(f, big, 274, 3, (uint64_t)(p->orientation ? p->orientation : 1));
        tiff_tag(f, big, 277, 3, (uint64_t)(p->samples ? p->samples : 1));
        tiff_tag(f, big, 278, 4, (uint64_t)p->height);
        tiff_tag(f, big, 279, 4, p->bytes);
        tiff_tag(f, big, 339, 3, (uint64_t)(p->format ? p->format : 1));
        tiff_number(f, big, i + 1 < count ? at + padded : 0, 4);
        put(f, p->data, p->bytes);
        put(f, "", padded - p->bytes);
    }
    save(f, f->count);
}

#endif
