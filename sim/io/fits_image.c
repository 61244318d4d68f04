#include "sim/io/fits_image.h"

#include <fitsio.h>
#include <math.h>
#include <stdlib.h>

enum { LONGEST_SIDE = 32768 };

static bst_status fail_cfitsio(bst_ctx *ctx, const char *path, int code) {
    char reason[FLEN_STATUS];
    fits_get_errstatus(code, reason);
    fits_clear_errmsg();
    return bst_fail(ctx, BST_ERR_IO, "%s: cannot be read: %s", path, reason);
}

/* Goes to the first image of two axes. */
static bst_status find_image(bst_ctx *ctx, const char *path, fitsfile *file, long size[2]) {
    int code = 0, count = 0;
    fits_get_num_hdus(file, &count, &code);
    for (int hdu = 1; hdu <= count && code == 0; hdu++) {
        int type = 0, axes = 0;
        fits_movabs_hdu(file, hdu, &type, &code);
        if (code == 0 && type == IMAGE_HDU) {
            fits_get_img_dim(file, &axes, &code);
        }
        if (code == 0 && axes == 2) {
            fits_get_img_size(file, 2, size, &code);
            if (code == 0 &&
                (size[0] < 1 || size[1] < 1 || size[0] > LONGEST_SIDE || size[1] > LONGEST_SIDE)) {
                return bst_fail(ctx, BST_ERR_FORMAT,
                                "%s: an image of %ld x %ld pixels (allowed: sides of 1 to %d)",
                                path, size[0], size[1], LONGEST_SIDE);
            }
            return code == 0 ? BST_OK : fail_cfitsio(ctx, path, code);
        }
    }
    return code == 0 ? bst_fail(ctx, BST_ERR_FORMAT, "%s: has no image of two axes", path)
                     : fail_cfitsio(ctx, path, code);
}

static bst_status read_pixels(bst_ctx *ctx, const char *path, fitsfile *file, const long size[2],
                              float **pixels) {
    size_t count = (size_t)size[0] * (size_t)size[1];
    float *values = malloc(count * sizeof *values);
    if (!values) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%s: no memory for %ld x %ld pixels", path, size[0],
                        size[1]);
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

bst_status bst_fits_read_image(bst_ctx *ctx, const char *path, int *width, int *height,
                               float **pixels) {
    *pixels = NULL;
    *width = *height = 0;
    fitsfile *file = NULL;
    int code = 0;
    /* "disk file": a path with brackets is a path, not cfitsio's extended syntax */
    if (fits_open_diskfile(&file, path, READONLY, &code) != 0) {
        return fail_cfitsio(ctx, path, code);
    }
    long size[2] = {0, 0};
    bst_status status = find_image(ctx, path, file, size);
    if (status == BST_OK) {
        status = read_pixels(ctx, path, file, size, pixels);
    }
    if (status == BST_OK) {
        *width = (int)size[0];
        *height = (int)size[1];
    }
    int ignored = 0;
    fits_close_file(file, &ignored);
    fits_clear_errmsg();
    return status;
}
