/* The two kinds of picture files, shared by image_file.c, image_page.c, image_png.c and
 * image_tiff.c. */
#ifndef BST_IO_IMAGE_FILE_INTERNAL_H
#define BST_IO_IMAGE_FILE_INTERNAL_H

#include <stdio.h>

#include "sim/io/image_file.h"

/* Longest side of a picture, px. */
enum { BST_IMAGE_LONGEST_SIDE = 32768 };

struct bst_image_file {
    char path[4096];
    bst_image_colour colour;
    FILE *stream;                /* PNG */
    struct bst_image_tiff *tiff; /* TIFF: the other state */
    uint64_t bytes;              /* of the file */
    int64_t pages;
    int64_t page; /* selected; -1: none */
    int width, height;
};

/* Fails with file and, of several, page. */
bst_status bst_image_fail(bst_ctx *ctx, const bst_image_file *file, const char *what);

/* Checks the size of a page: sides, and that as many bytes can be packed in the file.
 *
 * Given:     row_bytes  of the unpacked pixels
 * Errors:    BST_ERR_FORMAT */
bst_status bst_image_check_size(bst_ctx *ctx, const bst_image_file *file, uint64_t width,
                                uint64_t height, uint64_t row_bytes) BST_MUST_CHECK;

/* One value of a pixel of several samples. */
float bst_image_sample(bst_image_colour colour, const float *samples, int count);

/* Reads the head of a PNG file. BST_ERR_FORMAT, BST_ERR_MEMORY */
bst_status bst_image_png_select(bst_ctx *ctx, bst_image_file *file) BST_MUST_CHECK;
/* Reads its pixels. */
bst_status bst_image_png_pixels(bst_ctx *ctx, bst_image_file *file, float *pixels) BST_MUST_CHECK;

/* Opens a TIFF file by its descriptor, which belongs to file->tiff afterwards, and counts its
 * pages. BST_ERR_FORMAT, BST_ERR_MEMORY */
bst_status bst_image_tiff_open(bst_ctx *ctx, bst_image_file *file, int fd) BST_MUST_CHECK;
/* Closes it; NULL is allowed. */
void bst_image_tiff_close(struct bst_image_tiff *tiff);
/* Reads the head of a page. */
bst_status bst_image_tiff_select(bst_ctx *ctx, bst_image_file *file, int64_t page) BST_MUST_CHECK;
/* Reads its pixels. */
bst_status bst_image_tiff_pixels(bst_ctx *ctx, bst_image_file *file, float *pixels) BST_MUST_CHECK;

#endif
