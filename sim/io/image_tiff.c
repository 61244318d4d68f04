/* TIFF files by libtiff: grey pages of integers or floats, values as stored. */
#include <inttypes.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <tiffio.h>

#include "sim/io/image_file_internal.h"

/* Kinds of numbers. */
enum { UNSIGNED, SIGNED, REAL };

/* State of an open file. */
struct bst_image_tiff {
    TIFF *handle;
    char message[160]; /* of libtiff's last error */
    int64_t current;   /* directory; -1: unknown */
    int samples, bits, kind;
    bool from_bottom; /* the first row is at the bottom */
    bool tiles;
};

static int on_error(TIFF *handle, void *user, const char *module, const char *format,
                    va_list list) {
    struct bst_image_tiff *t = user;
    (void)handle;
    (void)module;
    if (!*t->message) { /* the first one is the cause */
        vsnprintf(t->message, sizeof t->message, format, list);
    }
    return 1;
}

static int on_warning(TIFF *handle, void *user, const char *module, const char *format,
                      va_list list) {
    (void)handle;
    (void)user;
    (void)module;
    (void)format;
    (void)list;
    return 1;
}

/* Fails with libtiff's words. */
static bst_status fail(bst_ctx *ctx, const bst_image_file *f, const char *what) {
    char text[400];
    snprintf(text, sizeof text, "%s%s%s", what, *f->tiff->message ? ": " : "", f->tiff->message);
    return bst_image_fail(ctx, f, text);
}

/* Begins a compression that is not read. */
static int refuse_codec(TIFF *handle, int scheme) {
    TIFFErrorExtR(handle, "bst",
                  "Compression is %d (allowed: 1 none, 5 LZW, 8 and 32946 Deflate, 32773 PackBits)",
                  scheme);
    return 0;
}

/* Replaces libtiff's other codecs, in this process: the libraries behind them are never called, by
 * whatever file. */
static void refuse_codecs(void) {
    static const uint16_t schemes[] = {
        COMPRESSION_CCITTRLE,  COMPRESSION_CCITTRLEW, COMPRESSION_CCITTFAX3,
        COMPRESSION_CCITTFAX4, COMPRESSION_OJPEG,     COMPRESSION_JPEG,
        COMPRESSION_JBIG,      COMPRESSION_NEXT,      COMPRESSION_THUNDERSCAN,
        COMPRESSION_PIXARLOG,  COMPRESSION_SGILOG,    COMPRESSION_SGILOG24,
        COMPRESSION_LERC,      COMPRESSION_LZMA,      COMPRESSION_ZSTD,
        COMPRESSION_WEBP};
    for (size_t i = 0; i < sizeof schemes / sizeof *schemes; i++) {
        (void)TIFFRegisterCODEC(schemes[i], "refused", refuse_codec); /* NULL: out of memory */
    }
}

bst_status bst_image_tiff_open(bst_ctx *ctx, bst_image_file *f, int fd) {
    struct bst_image_tiff *t = calloc(1, sizeof *t);
    TIFFOpenOptions *options = TIFFOpenOptionsAlloc();
    if (!t || !options) {
        close(fd);
        free(t);
        TIFFOpenOptionsFree(options);
        return bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory to open it", f->path);
    }
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    (void)pthread_once(&once, refuse_codecs);
    /* no more memory than the file can unpack to, as bst_image_check_size has it */
    uint64_t most = f->bytes * 1500 + (1 << 20);
    TIFFOpenOptionsSetMaxSingleMemAlloc(options, (tmsize_t)most);
    TIFFOpenOptionsSetErrorHandlerExtR(options, on_error, t);
    TIFFOpenOptionsSetWarningHandlerExtR(options, on_warning, t);
    t->handle = TIFFFdOpenExt(fd, f->path, "rm", options); /* m: no memory map */
    TIFFOpenOptionsFree(options);
    f->tiff = t;
    if (!t->handle) {
        close(fd);
        return fail(ctx, f, "cannot be read as a TIFF file");
    }
    t->current = 0;
    *t->message = '\0';
    f->pages = (int64_t)TIFFNumberOfDirectories(t->handle);
    return f->pages > 0 && !*t->message ? BST_OK
                                        : fail(ctx, f, "its list of pages is damaged or cut short");
}

void bst_image_tiff_close(struct bst_image_tiff *t) {
    if (t) {
        if (t->handle) {
            TIFFClose(t->handle);
        }
        free(t);
    }
}

/* Goes to the directory of a page: the next one is read without a search. */
static bool find_page(struct bst_image_tiff *t, int64_t page) {
    *t->message = '\0';
    if (page != t->current) {
        bool next = t->current >= 0 && page == t->current + 1;
        int found = next ? TIFFReadDirectory(t->handle) : TIFFSetDirectory(t->handle, (tdir_t)page);
        t->current = found ? page : -1;
    }
    return t->current == page;
}

/* A tag of 16 bits; its default of TIFF 6.0 if the page has none. */
static int tag(const struct bst_image_tiff *t, uint32_t name) {
    uint16_t value = 0;
    return TIFFGetFieldDefaulted(t->handle, name, &value) ? value : 0;
}

/* Fails for a tag with a value that is not read. */
static bst_status refuse(bst_ctx *ctx, const bst_image_file *f, const char *name, int value,
                         const char *allowed) {
    char what[200];
    snprintf(what, sizeof what, "%s is %d (allowed: %s)", name, value, allowed);
    return bst_image_fail(ctx, f, what);
}

/* Checks what the samples are. */
static bst_status check_samples(bst_ctx *ctx, const bst_image_file *f) {
    struct bst_image_tiff *t = f->tiff;
    int format = tag(t, TIFFTAG_SAMPLEFORMAT), photometric = tag(t, TIFFTAG_PHOTOMETRIC);
    int compression = tag(t, TIFFTAG_COMPRESSION), orientation = tag(t, TIFFTAG_ORIENTATION);
    t->samples = tag(t, TIFFTAG_SAMPLESPERPIXEL);
    t->bits = tag(t, TIFFTAG_BITSPERSAMPLE);
    t->kind = format == SAMPLEFORMAT_INT ? SIGNED : format == SAMPLEFORMAT_IEEEFP ? REAL : UNSIGNED;
    bool known = format == SAMPLEFORMAT_UINT || format == SAMPLEFORMAT_INT ||
                 format == SAMPLEFORMAT_VOID || format == SAMPLEFORMAT_IEEEFP;
    if (!known) {
        return refuse(ctx, f, "SampleFormat", format, "1 to 4");
    }
    if (!(t->bits == 32 || (t->kind != REAL && (t->bits == 8 || t->bits == 16)))) {
        return refuse(ctx, f, "BitsPerSample", t->bits, "8, 16 and 32 of integers, 32 of floats");
    }
    static const int compressions[] = {COMPRESSION_NONE, COMPRESSION_LZW, COMPRESSION_PACKBITS,
                                       COMPRESSION_ADOBE_DEFLATE, COMPRESSION_DEFLATE};
    bool lossless = false;
    for (size_t i = 0; i < sizeof compressions / sizeof *compressions; i++) {
        lossless = lossless || compression == compressions[i];
    }
    if (!lossless) {
        return refuse(ctx, f, "Compression", compression,
                      "1 none, 5 LZW, 8 and 32946 Deflate, 32773 PackBits");
    }
    if (orientation != ORIENTATION_TOPLEFT && orientation != ORIENTATION_BOTLEFT) {
        return refuse(ctx, f, "Orientation", orientation,
                      "1, the first row at the top, or 4, at the bottom");
    }
    t->from_bottom = orientation == ORIENTATION_BOTLEFT;
    bool colours = photometric == PHOTOMETRIC_RGB && f->colour != BST_IMAGE_COLOUR_REFUSE;
    if (photometric != PHOTOMETRIC_MINISBLACK && !colours) {
        return refuse(ctx, f, "PhotometricInterpretation", photometric,
                      "1, grey with 0 black; 2, colours, with `colour` in the map");
    }
    int most = f->colour == BST_IMAGE_COLOUR_REFUSE ? 1 : 4;
    if (t->samples < (colours ? 3 : 1) || t->samples > most) {
        return refuse(ctx, f, "SamplesPerPixel", t->samples,
                      most == 1 ? "1; more with `colour` in the map" : "1 to 4");
    }
    if (t->samples > 1 && tag(t, TIFFTAG_PLANARCONFIG) != PLANARCONFIG_CONTIG) {
        return refuse(ctx, f, "PlanarConfiguration", tag(t, TIFFTAG_PLANARCONFIG), "1");
    }
    return BST_OK;
}

bst_status bst_image_tiff_select(bst_ctx *ctx, bst_image_file *f, int64_t page) {
    struct bst_image_tiff *t = f->tiff;
    uint32_t width = 0, height = 0;
    if (!find_page(t, page)) {
        return fail(ctx, f, "is damaged or cut short");
    }
    *t->message = '\0';
    BST_TRY(check_samples(ctx, f));
    TIFFGetField(t->handle, TIFFTAG_IMAGEWIDTH, &width);
    TIFFGetField(t->handle, TIFFTAG_IMAGELENGTH, &height);
    uint64_t row_bytes = (uint64_t)width * (uint64_t)(t->samples * t->bits / 8);
    BST_TRY(bst_image_check_size(ctx, f, width, height, row_bytes));
    t->tiles = TIFFIsTiled(t->handle) != 0;
    f->width = (int)width;
    f->height = (int)height;
    return BST_OK;
}

/* Value of a sample in the byte order of this machine, in which libtiff gives it. */
static float sample_at(const struct bst_image_tiff *t, const uint8_t *at) {
    uint16_t half;
    uint32_t word;
    float real;
    switch (t->bits) {
        case 8:
            return t->kind == SIGNED ? (float)(int8_t)*at : (float)*at;
        case 16:
            memcpy(&half, at, sizeof half);
            return t->kind == SIGNED ? (float)(int16_t)half : (float)half;
        default:
            memcpy(&word, at, sizeof word);
            memcpy(&real, at, sizeof real);
            return t->kind == REAL ? real : t->kind == SIGNED ? (float)(int32_t)word : (float)word;
    }
}

/* Values of some pixels of a row. */
static void convert(const bst_image_file *f, const uint8_t *from, int count, float *out) {
    const struct bst_image_tiff *t = f->tiff;
    size_t step = (size_t)t->bits / 8;
    for (int x = 0; x < count; x++) {
        float samples[4] = {0};
        for (int k = 0; k < t->samples; k++) {
            samples[k] = sample_at(t, from + ((size_t)x * (size_t)t->samples + (size_t)k) * step);
        }
        out[x] = bst_image_sample(f->colour, samples, t->samples);
    }
}

/* Row of the frame that a row of the file becomes. */
static float *row_of(const bst_image_file *f, float *pixels, int y) {
    int row = f->tiff->from_bottom ? f->height - 1 - y : y;
    return pixels + (size_t)row * (size_t)f->width;
}

static bool read_rows(const bst_image_file *f, uint8_t *buffer, float *pixels) {
    for (int y = 0; y < f->height; y++) {
        if (TIFFReadScanline(f->tiff->handle, buffer, (uint32_t)y, 0) < 0) {
            return false;
        }
        convert(f, buffer, f->width, row_of(f, pixels, y));
    }
    return true;
}

static bool read_tiles(const bst_image_file *f, uint8_t *buffer, size_t bytes, float *pixels) {
    struct bst_image_tiff *t = f->tiff;
    uint32_t width = 0, height = 0;
    TIFFGetField(t->handle, TIFFTAG_TILEWIDTH, &width);
    TIFFGetField(t->handle, TIFFTAG_TILELENGTH, &height);
    uint64_t row_bytes = (uint64_t)width * (uint64_t)(t->samples * t->bits / 8);
    const uint32_t most = 1U << 24; /* beyond it the product may not fit */
    if (width < 1 || height < 1 || width > most || height > most || row_bytes * height > bytes) {
        return false;
    }
    for (uint32_t y = 0; y < (uint32_t)f->height; y += height) {
        for (uint32_t x = 0; x < (uint32_t)f->width; x += width) {
            uint32_t columns = (uint32_t)f->width - x < width ? (uint32_t)f->width - x : width;
            if (TIFFReadTile(t->handle, buffer, x, y, 0, 0) < 0) {
                return false;
            }
            for (uint32_t k = 0; k < height && y + k < (uint32_t)f->height; k++) {
                convert(f, buffer + k * row_bytes, (int)columns,
                        row_of(f, pixels, (int)(y + k)) + x);
            }
        }
    }
    return true;
}

bst_status bst_image_tiff_pixels(bst_ctx *ctx, bst_image_file *f, float *pixels) {
    struct bst_image_tiff *t = f->tiff;
    if (!find_page(t, f->page)) {
        return fail(ctx, f, "is damaged or cut short");
    }
    *t->message = '\0';
    tmsize_t bytes = t->tiles ? TIFFTileSize(t->handle) : TIFFScanlineSize(t->handle);
    size_t least = (size_t)f->width * (size_t)(t->samples * t->bits / 8);
    if (bytes <= 0 || (!t->tiles && (size_t)bytes < least) ||
        (uint64_t)bytes > f->bytes * 1500 + (1 << 20)) {
        return fail(ctx, f, "the size of its rows or tiles is damaged");
    }
    uint8_t *buffer = calloc(1, (size_t)bytes);
    if (!buffer) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory for its pixels", f->path);
    }
    bool whole =
        t->tiles ? read_tiles(f, buffer, (size_t)bytes, pixels) : read_rows(f, buffer, pixels);
    free(buffer);
    return whole ? BST_OK : fail(ctx, f, "its pixels are damaged or cut short");
}
