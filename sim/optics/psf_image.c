#include "sim/optics/psf_image.h"

#include <math.h>
#include <string.h>

#include "boresight/vec.h"
#include "sim/core/fft.h"

enum { LEAST_PERIOD_PX = 64, MOST_FREQUENCIES = 1024 };

/* frequency times sigma above which exp(-2 pi^2 (sigma f)^2) is below 1e-9 */
static const double GAUSSIAN_CUTOFF = 1.03;

static int period_of(int reach_px) {
    int period = 4 * reach_px < 2 * reach_px + LEAST_PERIOD_PX ? 4 * reach_px
                                                               : 2 * reach_px + LEAST_PERIOD_PX;
    return period > LEAST_PERIOD_PX ? period : LEAST_PERIOD_PX;
}

/* OTF at multiples of 1 / period on a grid of `side` frequencies per axis; higher frequencies are
 * aliased. */
static void fill_spectrum(const bst_psf *psf, int node, double blur_px, int period, int side,
                          bst_fft_complex_f64 *out) {
    double cutoff = bst_psf_cutoff(psf), scale = 1.0 / ((double)period * period);
    cutoff = blur_px > 0.0 ? fmin(cutoff, GAUSSIAN_CUTOFF / blur_px) : cutoff;
    int most = (int)fmin(ceil(cutoff * period), MOST_FREQUENCIES);
    memset(out, 0, (size_t)side * (size_t)side * sizeof *out);
    for (int ky = -most; ky <= most; ky++) {
        for (int kx = 0; kx <= most; kx++) {
            double fx = (double)kx / period, fy = (double)ky / period, value[2];
            double f2 = fx * fx + fy * fy;
            if (f2 > cutoff * cutoff) {
                continue;
            }
            double by = scale * exp(-2.0 * BST_PI * BST_PI * blur_px * blur_px * f2);
            bst_psf_otf(psf, node, fx, fy, value);
            size_t row = (size_t)(((ky % side) + side) % side), column = (size_t)(kx % side);
            double *at = out[row * (size_t)side + column];
            at[0] += by * value[0];
            at[1] += by * value[1];
            if (kx > 0) {
                /* the image is real */
                row = ((size_t)side - row) % (size_t)side;
                column = ((size_t)side - column) % (size_t)side;
                at = out[row * (size_t)side + column];
                at[0] += by * value[0];
                at[1] -= by * value[1];
            }
        }
    }
}

bst_status bst_psf_image(bst_ctx *ctx, const bst_psf *psf, int node, double blur_px, int per_px,
                         int reach_px, double *out) {
    int period = period_of(reach_px), grid = period * per_px;
    int side = bst_psf_image_side(per_px, reach_px), half = per_px * reach_px;
    bst_fft_complex_f64 *work = bst_fft_array((size_t)grid * (size_t)grid * sizeof *work);
    if (!work) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the image of a point");
    }
    bst_fft *inverse;
    bst_status status =
        bst_fft_create_f64(ctx, BST_FFT_INVERSE, grid, grid, *work, *work, &inverse);
    if (status != BST_OK) {
        bst_fft_array_free(work);
        return status;
    }
    fill_spectrum(psf, node, blur_px, period, grid, work);
    bst_fft_run(inverse);
    for (int j = 0; j < side; j++) {
        size_t row = (size_t)((j - half + grid) % grid) * (size_t)grid;
        for (int i = 0; i < side; i++) {
            out[j * side + i] = work[row + (size_t)((i - half + grid) % grid)][0];
        }
    }
    bst_fft_free(inverse);
    bst_fft_array_free(work);
    return BST_OK;
}
