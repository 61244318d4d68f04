/* PNG files by libpng: values as stored, without gamma. */
#include <png.h>
#include <setjmp.h>
#include <stdlib.h>
#include <string.h>

#include "sim/io/image_file_internal.h"

/* State of reading, in memory of its own: longjmp leaves it as it is. */
typedef struct reading {
    const bst_image_file *file;
    png_structp png;
    png_infop info;
    jmp_buf failed;
    char message[160];
    uint8_t *rows;       /* [row_bytes] or, interlaced, [height][row_bytes] */
    png_bytep *pointers; /* [height] of an interlaced picture */
    float *pixels;       /* NULL: only the head is read */
    int width, height, depth, channels;
    bool interlaced;
    size_t row_bytes, stored_bytes; /* of a row as it is given, and as it is in the file */
} reading;

static void on_error(png_structp png, png_const_charp message) {
    reading *r = png_get_error_ptr(png);
    snprintf(r->message, sizeof r->message, "%s", message);
    longjmp(r->failed, 1);
}

static void on_warning(png_structp png, png_const_charp message) {
    (void)png;
    (void)message;
}

static void on_read(png_structp png, png_bytep out, size_t bytes) {
    const reading *r = png_get_io_ptr(png);
    if (fread(out, 1, bytes, r->file->stream) != bytes) {
        png_error(png, "is cut short; copy or download the file again");
    }
}

/* Reads the head: size, and what a row becomes. */
static void read_head(reading *r) {
    png_uint_32 width, height;
    int depth, colour, interlace;
    char what[120];
    png_set_user_limits(r->png, 0x7fffffff, 0x7fffffff);
    png_set_read_fn(r->png, r, on_read);
    png_read_info(r->png, r->info);
    png_get_IHDR(r->png, r->info, &width, &height, &depth, &colour, &interlace, NULL, NULL);
    if (width > BST_IMAGE_LONGEST_SIDE || height > BST_IMAGE_LONGEST_SIDE) {
        /* before libpng takes memory for a row */
        snprintf(what, sizeof what, "is %lu x %lu pixels (allowed: sides of 1 to %d)",
                 (unsigned long)width, (unsigned long)height, BST_IMAGE_LONGEST_SIDE);
        png_error(r->png, what);
    }
    if (colour != PNG_COLOR_TYPE_GRAY && r->file->colour == BST_IMAGE_COLOUR_REFUSE) {
        snprintf(what, sizeof what, "has %s (allowed: grey, or a map with `colour`)",
                 colour == PNG_COLOR_TYPE_PALETTE      ? "a palette of colours"
                 : colour == PNG_COLOR_TYPE_GRAY_ALPHA ? "transparency"
                                                       : "colours");
        png_error(r->png, what);
    }
    r->stored_bytes = png_get_rowbytes(r->png, r->info);
    if (colour == PNG_COLOR_TYPE_PALETTE) {
        png_set_palette_to_rgb(r->png);
    }
    if (depth < 8) {
        png_set_packing(r->png); /* a value a byte, as stored */
    }
    r->interlaced = interlace != PNG_INTERLACE_NONE;
    if (r->interlaced) {
        (void)png_set_interlace_handling(r->png);
    }
    png_read_update_info(r->png, r->info);
    r->width = (int)width;
    r->height = (int)height;
    r->depth = depth == 16 ? 16 : 8;
    r->channels = png_get_channels(r->png, r->info);
    r->row_bytes = png_get_rowbytes(r->png, r->info);
}

/* Values of a row. */
static void convert_row(const reading *r, const uint8_t *row, float *out) {
    int step = r->depth / 8;
    for (int x = 0; x < r->width; x++) {
        float samples[4] = {0};
        for (int k = 0; k < r->channels; k++) {
            const uint8_t *at = row + ((size_t)x * (size_t)r->channels + (size_t)k) * (size_t)step;
            samples[k] = step == 2 ? (float)(at[0] << 8 | at[1]) : (float)at[0];
        }
        out[x] = bst_image_sample(r->file->colour, samples, r->channels);
    }
}

/* Makes room for a row, or for all of an interlaced picture. */
static void make_room(reading *r) {
    size_t count = r->interlaced ? (size_t)r->height : 1;
    r->rows = calloc(count, r->row_bytes);
    r->pointers = calloc(count, sizeof *r->pointers);
    if (!r->rows || !r->pointers) {
        png_error(r->png, "no memory for its pixels");
    }
    for (size_t i = 0; i < count; i++) {
        r->pointers[i] = r->rows + i * r->row_bytes;
    }
}

static void read_pixels(reading *r) {
    make_room(r);
    if (r->interlaced) {
        png_read_image(r->png, r->pointers);
    }
    for (int y = 0; y < r->height; y++) {
        if (!r->interlaced) {
            png_read_row(r->png, r->rows, NULL);
        }
        convert_row(r, r->pointers[r->interlaced ? y : 0],
                    r->pixels + (size_t)y * (size_t)r->width);
    }
    png_read_end(r->png, NULL);
}

/* Reads the head, and the pixels if there is room for them; false: r->message says why not. */
static bool read_guarded(reading *r, float *pixels) {
    if (setjmp(r->failed) != 0) {
        return false;
    }
    read_head(r);
    if (pixels && (r->width != r->file->width || r->height != r->file->height)) {
        png_error(r->png, "changed while it was read");
    }
    if (pixels) {
        r->pixels = pixels;
        read_pixels(r);
    }
    return true;
}

static bst_status read_file(bst_ctx *ctx, bst_image_file *f, float *pixels) {
    reading *r = calloc(1, sizeof *r);
    if (!r) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory to read it", f->path);
    }
    r->file = f;
    rewind(f->stream);
    r->png = png_create_read_struct(PNG_LIBPNG_VER_STRING, r, on_error, on_warning);
    r->info = r->png ? png_create_info_struct(r->png) : NULL;
    bst_status status = BST_OK;
    if (!r->info) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory to read it", f->path);
    } else if (!read_guarded(r, pixels)) {
        status = bst_image_fail(ctx, f, r->message);
    }
    if (status == BST_OK && !pixels) {
        status = bst_image_check_size(ctx, f, (uint64_t)r->width, (uint64_t)r->height,
                                      (uint64_t)r->stored_bytes);
        f->width = r->width;
        f->height = r->height;
    }
    png_destroy_read_struct(&r->png, &r->info, NULL);
    free(r->rows);
    free(r->pointers);
    free(r);
    return status;
}

bst_status bst_image_png_select(bst_ctx *ctx, bst_image_file *f) {
    return read_file(ctx, f, NULL);
}

bst_status bst_image_png_pixels(bst_ctx *ctx, bst_image_file *f, float *pixels) {
    return read_file(ctx, f, pixels);
}
