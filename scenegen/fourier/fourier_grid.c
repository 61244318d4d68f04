#include "scenegen/fourier/fourier_grid.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "scenegen/fourier/batch_fft.h"
#include "sim/core/fft.h"

enum {
    LATTICE = 128, /* frequencies per axis over the kept band */
    IMAGE = 256,   /* PSF samples per axis: four per period of the highest frequency */
    WIDE = 256,    /* samples of the coarse image of the wings */
    DIRECTIONS = 8
};

/* Design choices. WIDE_CELL_PX: cells of the coarse image of the wings. REACH_SHARE: light of a
 * point on a pixel that still counts, a fifth of an electron of a full well of 6e5. LEAST_DENSITY,
 * MOST_DENSITY: limits of the grid's samples per pixel, for PSFs of many pixels and of a fraction.
 */
static const double WIDE_CELL_PX = 4.0, REACH_SHARE = 3e-7, LEAST_DENSITY = 0.25,
                    MOST_DENSITY = 5.0;

/* Peak derivatives of order 2, 4 and 6 of a Gaussian with sigma 1, relative to its peak. */
static const double GAUSSIAN[3] = {1.0, 3.0, 15.0};

/* Modulus of a node's OTF, pixel included. */
static double modulus(const bst_psf *psf, int node, double fx, double fy) {
    double v[2];
    bst_psf_otf(psf, node, fx, fy, v);
    return hypot(v[0], v[1]);
}

/* Chooses the cut-off frequency: the OTF beyond it contributes at most `tolerance` of the peak's
 * bound. The pixel's sinc keeps it finite for optics that exceed the pixel resolution. */
static void find_cutoff(const bst_psf *psf, double tolerance, bst_fourier_band *out) {
    enum { RINGS = 256, SECTORS = 24 };
    double most = bst_psf_cutoff(psf), step = most / RINGS, ring[RINGS], total = 0.0;
    for (int i = 0; i < RINGS; i++) {
        double f = (i + 0.5) * step, largest = 0.0;
        for (int n = 0; n < bst_psf_nodes(psf); n++) {
            double sum = 0.0;
            for (int k = 0; k < SECTORS; k++) {
                double a = BST_PI * (k + 0.5) / SECTORS;
                sum += modulus(psf, n, f * cos(a), f * sin(a)) / SECTORS;
            }
            largest = fmax(largest, sum);
        }
        ring[i] = 2.0 * BST_PI * f * step * largest;
        total += ring[i];
    }
    int keep = RINGS;
    double lost = 0.0;
    while (keep > 1 && lost + ring[keep - 1] <= tolerance * total) {
        lost += ring[--keep];
    }
    out->cutoff = keep * step;
    out->lost = lost; /* relative to the peak below */
}

/* Inverse FFT in place of a Hermitian grid [n][n] in wrap-around order. */
static bst_status invert(bst_ctx *ctx, bst_fft_complex_f32 *data, int n) {
    bst_fft *inverse;
    BST_TRY(bst_fft_create_f32(ctx, BST_FFT_INVERSE, n, n, *data, *data, &inverse));
    bst_fft_run(inverse);
    bst_fft_free(inverse);
    return BST_OK;
}

/* Raises out->pixel_part to the values of a field node, for all binnings relative to none. The
 * derivatives are bounded by sums of moduli, and the peak from below by pixels about the PSF's
 * peak. */
static void measure_parts(const bst_psf *psf, int node, const double peak_px[2],
                          bst_fourier_band *out) {
    enum { SIDE = LATTICE / 2 };
    double along[BST_PIXEL_PARTS][DIRECTIONS][3];
    double step = 2.0 * out->cutoff / SIDE, top[BST_PIXEL_PARTS] = {0.0};
    memset(along, 0, sizeof along);
    for (int k = 0; k < SIDE * SIDE; k++) {
        double fx = (k % SIDE - SIDE / 2) * step, fy = (k / SIDE - SIDE / 2) * step, v[2];
        double phase = 2.0 * BST_PI * (fx * peak_px[0] + fy * peak_px[1]);
        bst_psf_otf(psf, node, fx, fy, v);
        double light = v[0] * cos(phase) - v[1] * sin(phase), size = hypot(v[0], v[1]);
        double w2[DIRECTIONS];
        for (int d = 0; d < DIRECTIONS; d++) {
            double angle = BST_PI * d / DIRECTIONS;
            double w = 2.0 * BST_PI * (fx * cos(angle) + fy * sin(angle));
            w2[d] = w * w;
        }
        for (int b = 0; b < BST_PIXEL_PARTS; b++) {
            double mean = bst_psf_binned(fx, b + 1) * bst_psf_binned(fy, b + 1),
                   m = size * fabs(mean);
            top[b] += mean * light;
            for (int d = 0; d < DIRECTIONS; d++) {
                along[b][d][0] += w2[d] * m;
                along[b][d][1] += w2[d] * w2[d] * m;
                along[b][d][2] += w2[d] * w2[d] * w2[d] * m;
            }
        }
    }
    for (int b = 0; b < BST_PIXEL_PARTS; b++) {
        for (int d = 0; d < DIRECTIONS; d++) {
            for (int k = 0; k < 3; k++) {
                double part = along[b][d][k] / along[0][d][k] * top[0] / top[b];
                out->pixel_part[b][k] = fmax(out->pixel_part[b][k], part);
            }
        }
    }
}

/* Adds the bounds of derivatives of order 2, 4, 6 and 8 along each direction by a frequency whose
 * modulus is m. */
static void add_derivatives(double along[DIRECTIONS][4], double fx, double fy, double m) {
    for (int d = 0; d < DIRECTIONS; d++) {
        double angle = BST_PI * d / DIRECTIONS;
        double w = 2.0 * BST_PI * (fx * cos(angle) + fy * sin(angle));
        along[d][0] += w * w * m;
        along[d][1] += w * w * w * w * m;
        along[d][2] += w * w * w * w * w * w * m;
        along[d][3] += w * w * w * w * w * w * w * w * m;
    }
}

/* Measures peak, sensitivity to coarse quadrature nodes, and spectrum along x and y. */
static bst_status measure_core(bst_ctx *ctx, const bst_psf *psf, bst_fft_complex_f32 *room,
                               bst_fourier_band *out) {
    double step = 2.0 * out->cutoff / LATTICE, area = step * step, peak = 0.0;
    double(*peak_px)[2] = calloc((size_t)bst_psf_nodes(psf), sizeof *peak_px);
    if (!peak_px) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the band of a PSF");
    }
    double smoothed_px2 = 0.0;
    out->node_sigma_px = INFINITY;
    for (int a = 0; a < 2; a++) {
        out->axis[a].step = out->cutoff / BST_SPREAD_BINS;
        memset(out->axis[a].weight, 0, sizeof out->axis[a].weight);
    }
    for (int n = 0; n < bst_psf_nodes(psf); n++) {
        double along[DIRECTIONS][4] = {{0}};
        memset(room, 0, sizeof *room * IMAGE * IMAGE);
        for (int j = -LATTICE / 2; j < LATTICE / 2; j++) {
            for (int i = -LATTICE / 2; i < LATTICE / 2; i++) {
                double fx = i * step, fy = j * step, v[2];
                bst_psf_otf(psf, n, fx, fy, v);
                float *z = room[((j + IMAGE) % IMAGE) * IMAGE + (i + IMAGE) % IMAGE];
                z[0] = (float)(v[0] * area);
                z[1] = (float)(v[1] * area);
                double m = hypot(v[0], v[1]) * area, f[2] = {fabs(fx), fabs(fy)};
                for (int a = 0; a < 2; a++) {
                    int bin = (int)(f[a] / out->axis[a].step);
                    out->axis[a].weight[bin < BST_SPREAD_BINS ? bin : BST_SPREAD_BINS - 1] += m;
                }
                add_derivatives(along, fx, fy, m);
            }
        }
        bst_status status = invert(ctx, room, IMAGE);
        if (status != BST_OK) {
            free(peak_px);
            return status;
        }
        double top = 0.0;
        for (int i = 0; i < IMAGE * IMAGE; i++) {
            if (room[i][0] > top) {
                int x = i % IMAGE, y = i / IMAGE;
                top = room[i][0];
                peak_px[n][0] = (x < IMAGE / 2 ? x : x - IMAGE) / (IMAGE * step);
                peak_px[n][1] = (y < IMAGE / 2 ? y : y - IMAGE) / (IMAGE * step);
            }
        }
        peak = fmax(peak, top);
        for (int d = 0; d < DIRECTIONS; d++) {
            for (int k = 0; k < 3; k++) {
                double sigma = pow(GAUSSIAN[k] * top / along[d][k], 0.5 / (k + 1));
                out->node_sigma_px = fmin(out->node_sigma_px, sigma);
            }
            /* of a Gaussian 5 and 7 times derivatives of order 4 and 6 are those of the next order
             * times its variance */
            smoothed_px2 = fmax(smoothed_px2, 5.0 * along[d][1] / along[d][2]);
            smoothed_px2 = fmax(smoothed_px2, 7.0 * along[d][2] / along[d][3]);
        }
    }
    memset(out->pixel_part, 0, sizeof out->pixel_part);
    for (int n = 0; n < bst_psf_nodes(psf); n++) {
        measure_parts(psf, n, peak_px[n], out);
    }
    free(peak_px);
    out->smoothed_variance_px2 = fmax(smoothed_px2, out->node_sigma_px * out->node_sigma_px);
    out->peak = peak;
    out->lost /= peak;
    for (int a = 0; a < 2; a++) {
        for (int i = 0; i < BST_SPREAD_BINS; i++) {
            out->axis[a].weight[i] /= peak * bst_psf_nodes(psf);
        }
    }
    double low = 0.01, high = 100.0;
    for (int k = 0; k < 60; k++) {
        double mid = sqrt(low * high), line = erf(0.5 / (mid * sqrt(2.0)));
        *(line * line > peak ? &low : &high) = mid;
    }
    out->share_sigma_px = low;
    return BST_OK;
}

/* Measures the distance beyond which the smoothed wings stay below REACH_SHARE. */
static bst_status measure_reach(bst_ctx *ctx, const bst_psf *psf, bst_fft_complex_f32 *room,
                                bst_fourier_band *out) {
    double step = 1.0 / (WIDE * WIDE_CELL_PX), area = step * step, reach = 0.0;
    enum { RINGS = WIDE };
    double ring[RINGS] = {0.0}; /* by distance in cells */
    for (int n = 0; n < bst_psf_nodes(psf); n++) {
        for (int j = -WIDE / 2; j < WIDE / 2; j++) {
            for (int i = -WIDE / 2; i < WIDE / 2; i++) {
                double fx = i * step, fy = j * step, v[2];
                /* smoothed by a Gaussian of one cell to suppress ringing at the band's end */
                double s = 2.0 * BST_PI * BST_PI * WIDE_CELL_PX * WIDE_CELL_PX,
                       smooth = exp(-s * (fx * fx + fy * fy));
                bst_psf_otf(psf, n, fx, fy, v);
                float *z = room[((j + WIDE) % WIDE) * WIDE + (i + WIDE) % WIDE];
                z[0] = (float)(v[0] * smooth * area);
                z[1] = (float)(v[1] * smooth * area);
            }
        }
        BST_TRY(invert(ctx, room, WIDE));
        for (int j = -WIDE / 2; j < WIDE / 2; j++) {
            for (int i = -WIDE / 2; i < WIDE / 2; i++) {
                float p = room[((j + WIDE) % WIDE) * WIDE + (i + WIDE) % WIDE][0];
                double share = fabs((double)p), cells = hypot(i, j);
                if (share > REACH_SHARE) {
                    reach = fmax(reach, WIDE_CELL_PX * cells);
                }
                ring[(int)cells] = fmax(ring[(int)cells], share);
            }
        }
    }
    out->reach_px = (int)fmin(fmax(ceil(reach), 16.0), 160.0);
    out->beyond = 0.0;
    for (int k = (int)(out->reach_px / WIDE_CELL_PX); k < RINGS; k++) {
        out->beyond = fmax(out->beyond, ring[k]);
    }
    return BST_OK;
}

bst_status bst_fourier_band_measure(bst_ctx *ctx, const bst_psf *psf, double tolerance,
                                    bst_fourier_band *out) {
    assert(psf && out && tolerance > 0.0);
    bst_fft_complex_f32 *room = bst_fft_array(sizeof *room * IMAGE * IMAGE);
    if (!room) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the band of a PSF");
    }
    find_cutoff(psf, tolerance, out);
    bst_status status = measure_core(ctx, psf, room, out);
    if (status == BST_OK) {
        status = measure_reach(ctx, psf, room, out);
    }
    if (status == BST_OK) {
        status = bst_psf_sensitivity_measure(ctx, psf, out->cutoff, out->node_sigma_px, 1,
                                             &out->sensitivity);
    }
    bst_fft_array_free(room);
    return status;
}

double bst_fourier_density(const bst_fourier_band *band, int axis, int taps, double tolerance) {
    double low = fmax(0.5 * band->cutoff, LEAST_DENSITY), high = MOST_DENSITY;
    if (!bst_nufft_kernel_suffices(taps, &band->axis[axis], high, tolerance)) {
        return high;
    }
    for (int k = 0; k < 10; k++) {
        double mid = 0.5 * (low + high);
        *(bst_nufft_kernel_suffices(taps, &band->axis[axis], mid, tolerance) ? &high : &low) = mid;
    }
    return high;
}

bst_fourier_axis bst_fourier_axis_choose(const bst_fourier_band *band, int axis, int taps,
                                         int least, double density) {
    bst_fourier_axis best = {0};
    double lowest = INFINITY;
    int most = 32 + least + least / 3;
    for (int pixels = (least + 15) / 16 * 16; pixels <= most; pixels += 16) {
        double inverse = bst_batch_fft_cost(pixels);
        if (isinf(inverse)) {
            continue;
        }
        int first = 16 * (int)ceil(fmax(density * pixels, 64.0) / 16.0 - 1e-9);
        for (int samples = first; samples <= 32 + first + first / 3; samples += 16) {
            double sum = inverse + bst_batch_fft_cost(samples);
            if (sum < lowest) {
                lowest = sum;
                best.pixels = pixels;
                best.samples = samples;
            }
        }
    }
    best.spread.taps = taps;
    best.error = bst_nufft_kernel_choose(&best.spread, &band->axis[axis],
                                         (double)best.samples / best.pixels);
    return best;
}
