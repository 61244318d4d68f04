#include "sim/io/image_file.h"

#include <assert.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/core/file.h"
#include "sim/io/image_file_internal.h"

static const uint64_t MAX_FILE_BYTES = (uint64_t)1 << 42;

/* Bytes that one byte of a file can unpack to: 1032 by DEFLATE (RFC 1951: 258 bytes in 2 bits),
 * 1365 by LZW of 12 bits (4096 bytes in 3). */
static const uint64_t MOST_PACKING = 1500;

bst_status bst_image_fail(bst_ctx *ctx, const bst_image_file *f, const char *what) {
    return f->pages > 1 && f->page >= 0
               ? bst_fail(ctx, BST_ERR_FORMAT, "%.400s: page %" PRId64 ": %s", f->path, f->page + 1,
                          what)
               : bst_fail(ctx, BST_ERR_FORMAT, "%.400s: %s", f->path, what);
}

bst_status bst_image_check_size(bst_ctx *ctx, const bst_image_file *f, uint64_t width,
                                uint64_t height, uint64_t row_bytes) {
    char what[200];
    if (width < 1 || height < 1 || width > BST_IMAGE_LONGEST_SIDE ||
        height > BST_IMAGE_LONGEST_SIDE) {
        snprintf(what, sizeof what,
                 "is %" PRIu64 " x %" PRIu64 " pixels (allowed: sides of 1 to %d)", width, height,
                 BST_IMAGE_LONGEST_SIDE);
        return bst_image_fail(ctx, f, what);
    }
    if (row_bytes * height > f->bytes * MOST_PACKING) {
        snprintf(what, sizeof what,
                 "is cut short: %" PRIu64 " x %" PRIu64 " pixels cannot be in %" PRIu64
                 " bytes; copy or download the file again",
                 width, height, f->bytes);
        return bst_image_fail(ctx, f, what);
    }
    return BST_OK;
}

float bst_image_sample(bst_image_colour colour, const float *s, int count) {
    if (count < 3) { /* grey, with or without transparency */
        return s[0];
    }
    switch (colour) {
        case BST_IMAGE_COLOUR_RED:
            return s[0];
        case BST_IMAGE_COLOUR_GREEN:
            return s[1];
        case BST_IMAGE_COLOUR_BLUE:
            return s[2];
        default:
            return (float)(((double)s[0] + (double)s[1] + (double)s[2]) / 3.0);
    }
}

static bool is_png(const void *bytes, size_t count) {
    return count >= 8 && memcmp(bytes, "\x89PNG\r\n\x1a\n", 8) == 0;
}

bool bst_image_file_begins(const void *bytes, size_t count) {
    return is_png(bytes, count) ||
           (count >= 4 && (memcmp(bytes, "II*\0", 4) == 0 || memcmp(bytes, "MM\0*", 4) == 0 ||
                           memcmp(bytes, "II+\0", 4) == 0 || memcmp(bytes, "MM\0+", 4) == 0));
}

/* Opens a descriptor as the kind of file that its first bytes say. */
static bst_status open_kind(bst_ctx *ctx, bst_image_file *f, int fd) {
    char begins[8] = "";
    ssize_t n = pread(fd, begins, sizeof begins, 0);
    if (n > 0 && is_png(begins, (size_t)n)) {
        f->pages = 1;
        f->stream = fdopen(fd, "rb");
        if (!f->stream) {
            close(fd);
            return bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory to open it", f->path);
        }
        return BST_OK;
    }
    if (n > 0 && bst_image_file_begins(begins, (size_t)n)) {
        return bst_image_tiff_open(ctx, f, fd);
    }
    close(fd);
    return bst_image_fail(ctx, f,
                          "does not begin as a PNG or TIFF file does (allowed: these; unpack files "
                          "that are compressed as a whole)");
}

bst_status bst_image_file_open(bst_ctx *ctx, const char *path, bst_image_colour colour,
                               bst_image_file **out) {
    assert(path && out);
    *out = NULL;
    bst_image_file *f = calloc(1, sizeof *f);
    if (!f) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory to open it", path);
    }
    f->page = -1;
    f->colour = colour;
    int fd = -1, n = snprintf(f->path, sizeof f->path, "%s", path);
    bst_status status = BST_OK;
    if (n < 0 || (size_t)n >= sizeof f->path) {
        status = bst_fail(ctx, BST_ERR_ARGUMENT, "%.80s...: the path is too long", path);
    }
    if (status == BST_OK) {
        status = bst_file_open(ctx, path, MAX_FILE_BYTES, "a PNG or TIFF file", &fd, &f->bytes);
    }
    if (status == BST_OK) {
        status = open_kind(ctx, f, fd);
    }
    if (status != BST_OK) {
        bst_image_file_close(f);
        return status;
    }
    *out = f;
    return BST_OK;
}

void bst_image_file_close(bst_image_file *f) {
    if (f) {
        if (f->stream) {
            fclose(f->stream);
        }
        bst_image_tiff_close(f->tiff);
        free(f);
    }
}

const char *bst_image_file_path(const bst_image_file *f) {
    return f->path;
}

int64_t bst_image_file_pages(const bst_image_file *f) {
    return f->pages;
}

bst_status bst_image_file_select(bst_ctx *ctx, bst_image_file *f, int64_t page, int *width,
                                 int *height) {
    assert(f && width && height);
    if (page < 0 || page >= f->pages) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "%.400s: has no page %" PRId64 " (allowed: 1 to %" PRId64 ")", f->path,
                        page + 1, f->pages);
    }
    if (f->page != page) {
        f->page = page;
        bst_status status =
            f->tiff ? bst_image_tiff_select(ctx, f, page) : bst_image_png_select(ctx, f);
        if (status != BST_OK) {
            f->page = -1;
            return status;
        }
    }
    *width = f->width;
    *height = f->height;
    return BST_OK;
}

bst_status bst_image_file_pixels(bst_ctx *ctx, bst_image_file *f, float *pixels) {
    assert(f && f->page >= 0 && pixels);
    return f->tiff ? bst_image_tiff_pixels(ctx, f, pixels) : bst_image_png_pixels(ctx, f, pixels);
}
