#include "sim/io/psf_fits.h"

#include <fitsio.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "boresight/vec.h"
#include "sim/io/fits_image.h"

/* Reads OVERSAMP of the first image with two to `most_axes` axes; 0: missing. */
static bst_status read_keyword(bst_ctx *ctx, const char *path, int most_axes, double *out) {
    fitsfile *file = NULL;
    int code = 0, count = 0, axes = 0;
    *out = 0.0;
    fits_open_diskfile(&file, path, READONLY, &code);
    fits_get_num_hdus(file, &count, &code);
    for (int hdu = 1; hdu <= count && code == 0 && !(axes >= 2 && axes <= most_axes); hdu++) {
        int type = 0;
        axes = 0;
        fits_movabs_hdu(file, hdu, &type, &code);
        if (type == IMAGE_HDU) {
            fits_get_img_dim(file, &axes, &code);
        }
    }
    bool wrong = false;
    if (code == 0) {
        fits_read_key_dbl(file, "OVERSAMP", out, NULL, &code);
        if (code == KEY_NO_EXIST) {
            *out = 0.0;
        } else {
            wrong = code != 0;
        }
        code = 0;
    }
    int ignored = 0;
    if (file) {
        fits_close_file(file, &ignored);
    }
    fits_clear_errmsg();
    if (code != 0) {
        return bst_fail(ctx, BST_ERR_IO, "%.400s: cannot be read again", path);
    }
    return wrong ? bst_fail(ctx, BST_ERR_FORMAT, "%.400s: OVERSAMP is not a number", path) : BST_OK;
}

/* PSF samples per detector pixel: as given, else the keyword OVERSAMP. */
static bst_status find_oversampling(bst_ctx *ctx, const char *path, int most_axes, double given,
                                    double *out) {
    *out = given;
    if (given > 0.0) {
        return BST_OK;
    }
    BST_TRY(read_keyword(ctx, path, most_axes, out));
    if (*out == 0.0) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "%.400s: has no keyword OVERSAMP (samples per detector pixel); add it, or "
                        "give psf_oversampling",
                        path);
    }
    if (!(*out >= 0.1 && *out <= 1000.0)) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%.400s: OVERSAMP is %g (allowed: 0.1 to 1000)", path,
                        *out);
    }
    return BST_OK;
}

/* Checks the PSF samples and sums them and their squares, scaled to a maximum of 1. */
static bst_status sum_up(bst_ctx *ctx, const char *path, const float *pixels, int width, int height,
                         double *sum, double *sum2) {
    double largest = 0.0;
    for (int i = 0; i < width * height; i++) {
        double v = (double)pixels[i];
        if (!(v >= 0.0) || isinf(v)) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "%.400s: sample (%d, %d) is %g (allowed: finite, not negative)", path,
                            i % width, i / width, v);
        }
        largest = fmax(largest, v);
    }
    if (!(largest > 0.0)) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%.400s: all samples are 0; there must be some light",
                        path);
    }
    *sum = *sum2 = 0.0;
    for (int i = 0; i < width * height; i++) {
        double v = (double)pixels[i] / largest;
        *sum += v;
        *sum2 += v * v;
    }
    return BST_OK;
}

bst_status bst_psf_fits_read(bst_ctx *ctx, const char *path, double oversampling,
                             bst_psf_summary *out) {
    int width, height;
    float *pixels;
    BST_TRY(bst_fits_read_image(ctx, path, &width, &height, &pixels));
    double sum = 0.0, sum2 = 1.0;
    bst_status status = BST_OK;
    if (width > BST_PSF_LONGEST_SIDE || height > BST_PSF_LONGEST_SIDE) {
        status = bst_fail(ctx, BST_ERR_FORMAT,
                          "%.400s: a PSF of %d x %d samples (allowed: sides of 1 to %d)", path,
                          width, height, BST_PSF_LONGEST_SIDE);
    }
    if (status == BST_OK) {
        status = sum_up(ctx, path, pixels, width, height, &sum, &sum2);
    }
    free(pixels);
    BST_TRY(status);
    double samples;
    BST_TRY(find_oversampling(ctx, path, 2, oversampling, &samples));
    double area = sum * sum / sum2 / (samples * samples);
    *out = (bst_psf_summary){.width = width,
                             .height = height,
                             .oversampling = samples,
                             .noise_equivalent_px = area,
                             .fwhm_px = BST_FWHM_PER_SIGMA * sqrt(area / (4.0 * BST_PI))};
    return BST_OK;
}

bst_status bst_psf_fits_samples(bst_ctx *ctx, const char *path, double oversampling,
                                bst_psf_samples *out) {
    *out = (bst_psf_samples){0};
    double samples;
    int width, height, planes;
    float *pixels;
    BST_TRY(bst_fits_read_planes(ctx, path, &width, &height, &planes, &pixels));
    bst_status status = find_oversampling(ctx, path, 3, oversampling, &samples);
    if (status != BST_OK) {
        free(pixels);
        return status;
    }
    *out = (bst_psf_samples){pixels, width, height, planes, samples};
    return BST_OK;
}
