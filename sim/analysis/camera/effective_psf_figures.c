/* The PSF before integration over the pixel, and figures of it. */
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"
#include "sim/analysis/camera/effective_psf.h"

enum { OVER = BST_EFFECTIVE_PSF_OVERSAMPLING, STEPS = 400, FINER = 4 };
/* The pixel's transfer function is undone up to PASS cycles per pixel, and what lies above STOP is
 * left out. NOISE keeps small values of it from raising the noise (Wiener). */
static const double PASS = 0.8, STOP = 1.0, NOISE = 1e-3;
/* Second moments are of the light within this radius. */
static const double MOMENTS_PX = 5.0;

const double bst_effective_psf_radius_px[BST_EFFECTIVE_PSF_RADII] = {0.5, 1.0, 1.5, 2.0, 3.0, 5.0};

/* Inverse transfer function of a pixel along one axis, at f cycles per pixel. */
static double inverse_of_pixel(double f) {
    double s = f > 0.0 ? sin(BST_PI * f) / (BST_PI * f) : 1.0;
    double pass = f <= PASS   ? 1.0
                  : f >= STOP ? 0.0
                              : 0.5 + 0.5 * cos(BST_PI * (f - PASS) / (STOP - PASS));
    return pass * s * (1.0 + NOISE) / (s * s + NOISE);
}

bst_status bst_effective_psf_undo_pixel(bst_ctx *ctx, const double *plane, int side, double *out) {
    assert(plane && side > 0 && out);
    const size_t n = (size_t)side;
    double *kernel = malloc(n * sizeof *kernel), *rows = malloc(n * n * sizeof *rows), sum = 0.0;
    if (!kernel || !rows) {
        free(kernel);
        free(rows);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a PSF of %zu samples", n * n);
    }
    /* the filter is a product of two along the axes: its kernel by the midpoint rule */
    for (int k = 0; k < side; k++) {
        double value = 0.0;
        for (int i = 0; i < STEPS; i++) {
            double f = (i + 0.5) * STOP / STEPS;
            value += inverse_of_pixel(f) * cos(2.0 * BST_PI * f * k / OVER);
        }
        kernel[k] = 2.0 * value * STOP / STEPS / OVER;
    }
    for (int pass = 0; pass < 2; pass++) {
        for (size_t j = 0; j < n; j++) {
            for (size_t i = 0; i < n; i++) {
                double value = 0.0;
                for (size_t k = 0; k < n; k++) {
                    value += pass == 0 ? kernel[k > i ? k - i : i - k] * plane[j * n + k]
                                       : kernel[k > j ? k - j : j - k] * rows[k * n + i];
                }
                (pass == 0 ? rows : out)[j * n + i] = value;
            }
        }
    }
    for (size_t k = 0; k < n * n; k++) {
        sum += out[k];
    }
    for (size_t k = 0; k < n * n && sum > 0.0; k++) {
        out[k] /= sum;
    }
    free(kernel);
    free(rows);
    return BST_OK;
}

bst_effective_psf_figures bst_effective_psf_measure(const double *plane, int side) {
    assert(plane && side > 0);
    bst_effective_psf_figures out = {0};
    double all = 0.0, light = 0.0, x = 0.0, y = 0.0;
    const double middle = 0.5 * (side - 1);
    for (int pass = 0; pass < 2; pass++) {
        for (int j = 0; j < side; j++) {
            for (int i = 0; i < side; i++) {
                double v = plane[(size_t)j * (size_t)side + (size_t)i];
                double dx = (i - middle) / OVER - x, dy = (j - middle) / OVER - y;
                double r = hypot((i - middle) / OVER, (j - middle) / OVER);
                if (pass == 1 && r <= MOMENTS_PX) {
                    out.xx_px2 += v * dx * dx;
                    out.xy_px2 += v * dx * dy;
                    out.yy_px2 += v * dy * dy;
                }
                if (pass == 0) {
                    all += v;
                    light += r <= MOMENTS_PX ? v : 0.0;
                }
            }
        }
        for (int j = 0; j < side && pass == 0; j++) {
            for (int i = 0; i < side; i++) {
                double v = plane[(size_t)j * (size_t)side + (size_t)i];
                if (hypot(i - middle, j - middle) <= MOMENTS_PX * OVER) {
                    x += v * (i - middle) / OVER / light;
                    y += v * (j - middle) / OVER / light;
                }
            }
        }
    }
    out.xx_px2 /= light;
    out.xy_px2 /= light;
    out.yy_px2 /= light;
    /* a sample is a small square, of which the circle covers a part */
    for (int j = 0; j < side; j++) {
        for (int i = 0; i < side; i++) {
            double v = plane[(size_t)j * (size_t)side + (size_t)i] / (all * FINER * FINER);
            for (int k = 0; k < FINER * FINER; k++) {
                double u = i + (k % FINER + 0.5) / FINER - 0.5 - middle,
                       w = j + (k / FINER + 0.5) / FINER - 0.5 - middle, r = hypot(u, w) / OVER;
                for (int e = 0; e < BST_EFFECTIVE_PSF_RADII; e++) {
                    out.encircled[e] += r <= bst_effective_psf_radius_px[e] ? v : 0.0;
                }
            }
        }
    }
    return out;
}

double bst_effective_psf_standard_error(const double without[BST_EFFECTIVE_PSF_PARTS]) {
    enum { PARTS = BST_EFFECTIVE_PSF_PARTS };
    double mean = 0.0, sum = 0.0;
    for (int i = 0; i < PARTS; i++) {
        mean += without[i] / PARTS;
    }
    for (int i = 0; i < PARTS; i++) {
        sum += (without[i] - mean) * (without[i] - mean);
    }
    return sqrt(sum * (PARTS - 1) / PARTS);
}

/* Minus the mean logarithm of the root of chi-squared over its seven degrees of freedom:
 * -(digamma(3.5) + ln(2 / 7)) / 2. */
static const double MEAN_LOG = 0.0748;

void bst_effective_psf_pool_errors(const double *sigma, int side, double *pooled) {
    enum { REACH = BST_EFFECTIVE_PSF_POOL };
    for (int j = 0; j < side; j++) {
        for (int i = 0; i < side; i++) {
            double sum = 0.0, in = 0.0, here = sigma[(size_t)j * (size_t)side + (size_t)i];
            for (int v = j > REACH ? j - REACH : 0; v < side && v <= j + REACH; v++) {
                for (int u = i > REACH ? i - REACH : 0; u < side && u <= i + REACH; u++) {
                    double one = sigma[(size_t)v * (size_t)side + (size_t)u];
                    sum += one > 0.0 ? log(one) : 0.0;
                    in += one > 0.0 ? 1.0 : 0.0;
                }
            }
            pooled[(size_t)j * (size_t)side + (size_t)i] =
                here > 0.0 ? exp(sum / in + MEAN_LOG) : 0.0;
        }
    }
}
