#include "sim/io/fits_image.h"

#include <errno.h>
#include <fitsio.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "sim/core/file.h"
#include "sim/io/fits_check.h"

enum { LONGEST_SIDE = 32768, MOST_PIXELS = 1 << 28, BLOCK = 2880 };
static const uint64_t MAX_FILE_BYTES = (uint64_t)4 << 30;

static bst_status fail_cfitsio(bst_ctx *ctx, const char *path, int code) {
    char reason[FLEN_STATUS];
    fits_get_errstatus(code, reason);
    fits_clear_errmsg();
    return bst_fail(ctx, BST_ERR_IO, "%.400s: cannot be read: %s", path, reason);
}

/* Finds the first image with two axes, or up to `most_axes`; size[2] is 1 for two axes. */
static bst_status find_image(bst_ctx *ctx, const char *path, fitsfile *file, int most_axes,
                             long size[3]) {
    int code = 0, count = 0;
    fits_get_num_hdus(file, &count, &code);
    for (int hdu = 1; hdu <= count && code == 0; hdu++) {
        int type = 0, axes = 0;
        fits_movabs_hdu(file, hdu, &type, &code);
        if (code == 0 && type == IMAGE_HDU) {
            fits_get_img_dim(file, &axes, &code);
        }
        /* cfitsio accepts more spellings of the key than the standard */
        if (code == 0 && fits_is_compressed_image(file, &code)) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "%.400s: HDU %d: is a compressed image (allowed: images that are not "
                            "compressed); unpack the file with funpack",
                            path, hdu);
        }
        if (code == 0 && axes >= 2 && axes <= most_axes) {
            size[2] = 1;
            fits_get_img_size(file, axes, size, &code);
            if (code == 0 &&
                (size[0] < 1 || size[1] < 1 || size[2] < 1 || size[0] > LONGEST_SIDE ||
                 size[1] > LONGEST_SIDE || size[2] > MOST_PIXELS / (size[0] * size[1]))) {
                char planes[32] = "";
                if (axes > 2) {
                    snprintf(planes, sizeof planes, " x %ld", size[2]);
                }
                return bst_fail(ctx, BST_ERR_FORMAT,
                                "%.400s: an image of %ld x %ld%s pixels (allowed: sides of 1 to "
                                "%d, at most %d pixels)",
                                path, size[0], size[1], planes, LONGEST_SIDE, MOST_PIXELS);
            }
            return code == 0 ? BST_OK : fail_cfitsio(ctx, path, code);
        }
    }
    return code == 0 ? bst_fail(ctx, BST_ERR_FORMAT, "%.400s: has no image of two %saxes", path,
                                most_axes > 2 ? "or three " : "")
                     : fail_cfitsio(ctx, path, code);
}

static bst_status read_pixels(bst_ctx *ctx, const char *path, fitsfile *file, const long size[3],
                              float **pixels) {
    size_t count = (size_t)size[0] * (size_t)size[1] * (size_t)size[2];
    float *values = malloc(count * sizeof *values);
    if (!values) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory for %zu pixels", path, count);
    }
    int code = 0, any_blank;
    float blank = NAN;
    fits_read_img(file, TFLOAT, 1, (LONGLONG)count, &blank, values, &any_blank, &code);
    if (code != 0) {
        free(values);
        return fail_cfitsio(ctx, path, code);
    }
    *pixels = values;
    return BST_OK;
}

/* Reads the image and closes the file. planes NULL: two axes only. */
static bst_status read_image(bst_ctx *ctx, const char *path, fitsfile *file, int *width,
                             int *height, int *planes, float **pixels) {
    long size[3] = {0, 0, 1};
    bst_status status = find_image(ctx, path, file, planes ? 3 : 2, size);
    if (status == BST_OK) {
        status = read_pixels(ctx, path, file, size, pixels);
    }
    if (status == BST_OK) {
        *width = (int)size[0];
        *height = (int)size[1];
        if (planes) {
            *planes = (int)size[2];
        }
    }
    int ignored = 0;
    fits_close_file(file, &ignored);
    fits_clear_errmsg();
    return status;
}

/* Rejects files that cfitsio would accept: compressed as a whole, other formats, wrong sizes. */
static bst_status check(bst_ctx *ctx, const char *path, const void *data, uint64_t bytes) {
    static const char expected[] = "SIMPLE  = ";
    if (bytes < sizeof expected - 1 || memcmp(data, expected, sizeof expected - 1) != 0) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "%.400s: does not begin as a FITS file does (allowed: FITS, not "
                        "compressed as a whole)",
                        path);
    }
    return bst_fits_check_structure(ctx, path, data, bytes);
}

static bst_status check_file(bst_ctx *ctx, const char *path) {
    int fd;
    uint64_t bytes;
    BST_TRY(bst_file_open(ctx, path, MAX_FILE_BYTES, "a FITS file", &fd, &bytes));
    void *data = bytes ? mmap(NULL, (size_t)bytes, PROT_READ, MAP_PRIVATE, fd, 0) : NULL;
    close(fd);
    if (data == MAP_FAILED) {
        return bst_fail(ctx, BST_ERR_IO, "%.400s: cannot be read: %s", path, strerror(errno));
    }
    bst_status status = check(ctx, path, data, bytes);
    if (data) {
        munmap(data, (size_t)bytes);
    }
    return status;
}

static bst_status read_file(bst_ctx *ctx, const char *path, int *width, int *height, int *planes,
                            float **pixels) {
    *pixels = NULL;
    *width = *height = 0;
    BST_TRY(check_file(ctx, path));
    fitsfile *file = NULL;
    int code = 0;
    /* "disk file": brackets in a path are no extended syntax of cfitsio */
    if (fits_open_diskfile(&file, path, READONLY, &code) != 0) {
        return fail_cfitsio(ctx, path, code);
    }
    return read_image(ctx, path, file, width, height, planes, pixels);
}

bst_status bst_fits_read_image(bst_ctx *ctx, const char *path, int *width, int *height,
                               float **pixels) {
    return read_file(ctx, path, width, height, NULL, pixels);
}

bst_status bst_fits_read_planes(bst_ctx *ctx, const char *path, int *width, int *height,
                                int *planes, float **pixels) {
    *planes = 0;
    return read_file(ctx, path, width, height, planes, pixels);
}

bst_status bst_fits_read_image_buffer(bst_ctx *ctx, const char *name, const void *data,
                                      size_t bytes, int *width, int *height, float **pixels) {
    *pixels = NULL;
    *width = *height = 0;
    BST_TRY(check(ctx, name, data, bytes));
    /* cfitsio changes its memory and reads whole blocks, also beyond the end: make a copy */
    size_t copy_bytes = (bytes + BLOCK - 1) / BLOCK * BLOCK;
    void *copy = calloc(1, copy_bytes);
    if (!copy) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory for %zu bytes", name, bytes);
    }
    memcpy(copy, data, bytes);
    fitsfile *file = NULL;
    int code = 0;
    bst_status status =
        fits_open_memfile(&file, "memory", READONLY, &copy, &copy_bytes, 0, NULL, &code) == 0
            ? read_image(ctx, name, file, width, height, NULL, pixels)
            : fail_cfitsio(ctx, name, code);
    free(copy);
    return status;
}
