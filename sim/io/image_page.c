/* What PNG and TIFF pages share: messages, sizes, colour. */
#include <inttypes.h>

#include "sim/io/image_file_internal.h"

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
