#include "sim/io/image_file.h"

#include <assert.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/core/file.h"
#include "sim/io/image_file_internal.h"

static const uint64_t MAX_FILE_BYTES = (uint64_t)1 << 42;

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
