#include "sim/io/grey_png.h"

#include <png.h>
#include <stdlib.h>

#include "sim/io/manifest.h"

static bst_status write_png(bst_ctx *ctx, const char *path, const void *pixels, int width,
                            int height, png_uint_32 format) {
    png_image png = {.version = PNG_IMAGE_VERSION,
                     .width = (png_uint_32)width,
                     .height = (png_uint_32)height,
                     .format = format,
                     .flags = PNG_IMAGE_FLAG_FAST};
    png_alloc_size_t bytes = PNG_IMAGE_PNG_SIZE_MAX(png);
    void *encoded = malloc(bytes);
    if (!encoded) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory for a PNG", path);
    }
    bst_status status =
        png_image_write_to_memory(&png, encoded, &bytes, 0, pixels, width, NULL)
            ? bst_io_write_file_atomic(ctx, path, encoded, bytes)
            : bst_fail(ctx, BST_ERR_IO, "%s: no PNG can be made: %s", path, png.message);
    free(encoded);
    return status;
}

bst_status bst_grey_png_write16(bst_ctx *ctx, const char *path, const uint16_t *pixels, int width,
                                int height) {
    return write_png(ctx, path, pixels, width, height, PNG_FORMAT_LINEAR_Y);
}

bst_status bst_grey_png_write8(bst_ctx *ctx, const char *path, const uint8_t *pixels, int width,
                               int height) {
    return write_png(ctx, path, pixels, width, height, PNG_FORMAT_GRAY);
}
