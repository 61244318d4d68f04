/* FITS files that tests write byte by byte after the FITS Standard, so that what is expected does
 * not come from the library that reads. */
#ifndef TESTS_IO_WRITTEN_FITS_H
#define TESTS_IO_WRITTEN_FITS_H

#include <stdarg.h>

#include "sim/io/recorded_frames.h"
#include "tests/io/scratch.h"

typedef struct fixture {
    bst_ctx ctx;
    scratch place;
    char path[600];
    uint8_t *bytes; /* of the file */
    size_t count, room;
} fixture;

static inline fixture begin(const char *name) {
    fixture f = {.count = 0};
    scratch_make(&f.place);
    snprintf(f.path, sizeof f.path, "%s/%s", f.place.folder, name);
    return f;
}

static inline void end(fixture *f) {
    free(f->bytes);
    scratch_remove(&f->place);
}

static inline void put(fixture *f, const void *bytes, size_t count) {
    if (f->count + count > f->room) {
        f->room = 2 * (f->count + count);
        f->bytes = realloc(f->bytes, f->room);
        assert_non_null(f->bytes);
    }
    memcpy(f->bytes + f->count, bytes, count);
    f->count += count;
}

static inline void card(fixture *f, const char *format, ...) {
    char text[200], line[81];
    va_list list;
    va_start(list, format);
    vsnprintf(text, sizeof text, format, list);
    va_end(list);
    snprintf(line, sizeof line, "%-80.80s", text);
    put(f, line, 80);
}

static inline void pad(fixture *f, char with) {
    while (f->count % 2880 != 0) {
        put(f, &with, 1);
    }
}

/* Cards up to NAXISn of an image. */
static inline void begin_image(fixture *f, bool primary, int bitpix, int nx, int ny, int planes) {
    card(f, primary ? "SIMPLE  =                    T" : "XTENSION= 'IMAGE   '");
    card(f, "BITPIX  = %20d", bitpix);
    card(f, "NAXIS   = %20d", planes > 0 ? 3 : 2);
    card(f, "NAXIS1  = %20d", nx);
    card(f, "NAXIS2  = %20d", ny);
    if (planes > 0) {
        card(f, "NAXIS3  = %20d", planes);
    }
    if (!primary) {
        card(f, "PCOUNT  =                    0");
        card(f, "GCOUNT  =                    1");
    }
}

static inline void end_header(fixture *f) {
    card(f, "END");
    pad(f, ' ');
}

static inline void big_endian(fixture *f, uint64_t value, int width) {
    for (int i = width - 1; i >= 0; i--) {
        uint8_t byte = (uint8_t)(value >> (8 * i));
        put(f, &byte, 1);
    }
}

static inline void real32(fixture *f, float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    big_endian(f, bits, 4);
}

static inline void real64(fixture *f, double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    big_endian(f, bits, 8);
}

static inline void save(const fixture *f, size_t count) {
    FILE *file = fopen(f->path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(f->bytes, 1, count, file), count);
    fclose(file);
}

static inline void load_map(fixture *f, const char *text, bst_keyword_map *map) {
    char path[700];
    snprintf(path, sizeof path, "%s.json", f->path);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
    bst_assert_ok(&f->ctx, bst_keyword_map_load(&f->ctx, path, map));
}

#endif
