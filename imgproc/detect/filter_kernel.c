/* Kernels of the matched filters, and noise statistics of their outputs. */
#include <math.h>
#include <stdlib.h>

#include "imgproc/detect/filter.h"
#include "imgproc/detect/low_rank.h"
#include "imgproc/detect/row_kernels.h"

enum { SIZE = 2 * BST_FILTER_MAX_RADIUS + 3, PLANE = SIZE * SIZE };

/* Share of a known PSF's energy that truncation may lose: by the kernel's radius, by its rank. */
static const double RADIUS_SHARE = 1e-3, RANK_SHARE = 1e-3;
/* Step of the numerical derivatives, px. */
static const double STEP_PX = 1e-3;

/* Autocorrelation of the one-axis kernel (unit norm) at integer lags. */
static void correlate(bst_filter *f) {
    for (int lag = 0; lag <= 2 * f->radius; lag++) {
        double sum = 0.0;
        for (int i = 0; i + lag <= 2 * f->radius; i++) {
            sum += (double)f->kernel[i] * (double)f->kernel[i + lag];
        }
        f->correlation[lag] = sum;
    }
}

/* Autocorrelation of the one-axis kernel at a lag of either sign; 0 beyond its length. */
static double axis_correlation(const bst_filter *f, int lag) {
    return abs(lag) <= 2 * f->radius ? f->correlation[abs(lag)] : 0.0;
}

/* Covariance of the point filter's output between pixels a lag apart. */
static double point_covariance(const bst_filter *f, int lag_x, int lag_y) {
    if (!f->known) {
        return axis_correlation(f, lag_x) * axis_correlation(f, lag_y);
    }
    int most = 2 * f->radius;
    return abs(lag_x) <= most && abs(lag_y) <= most
               ? f->lags[(lag_y + most) * BST_FILTER_LAGS + lag_x + most]
               : 0.0;
}

/* Point kernel (unit norm) at a pixel offset. */
static double kernel_at(const bst_filter *f, int x, int y) {
    if (abs(x) > f->radius || abs(y) > f->radius) {
        return 0.0;
    }
    if (!f->known) {
        return (double)f->kernel[x + f->radius] * (double)f->kernel[y + f->radius];
    }
    double sum = 0.0;
    for (int k = 0; k < f->rank; k++) {
        sum += (double)f->across[k][x + f->radius] *
               (double)f->down[k * (2 * f->radius + 1) + y + f->radius];
    }
    return sum;
}

/* Covariance of the streak filter's output between pixels a lag apart, before its weights are
 * normalised. */
static double streak_covariance(const bst_filter *f, int lag_x, int lag_y) {
    double sum = 0.0;
    for (int a = 0; a < f->taps; a++) {
        for (int b = 0; b < f->taps; b++) {
            int lx = f->tap_x[a] - f->tap_x[b] + lag_x, ly = f->tap_y[a] - f->tap_y[b] + lag_y;
            if (abs(lx) <= 2 * f->radius && abs(ly) <= 2 * f->radius) {
                sum += (double)f->tap_weight[a] * (double)f->tap_weight[b] *
                       point_covariance(f, lx, ly);
            }
        }
    }
    return sum;
}

/* Adds a tap of the streak kernel; weights at the same pixel add up. */
static void add_tap(bst_filter *f, int x, int y, double weight) {
    if (weight > 0.0 && f->taps < BST_FILTER_MAX_TAPS - 4) {
        f->tap_x[f->taps] = x;
        f->tap_y[f->taps] = y;
        f->tap_weight[f->taps++] = (float)weight;
    }
}

/* Pixel-integrated Gaussian along one axis, centred `shift` px off the middle pixel, for pixels
 * -radius - 1 to radius + 1. */
static void pixel_integrated_gaussian(double sigma_px, double shift, int radius, double *out) {
    double root = sigma_px * sqrt(2.0);
    for (int i = -radius - 1; i <= radius + 1; i++) {
        out[i + radius + 1] = 0.5 * (erf((i + 0.5 - shift) / root) - erf((i - 0.5 - shift) / root));
    }
}

/* Adds the powers of a kernel value for the threshold statistics. */
static void add_powers(double k, double *powers) {
    double power = k * k;
    for (int i = 0; i < BST_THRESHOLD_POWERS; i++) {
        power *= k;
        powers[i] += power;
    }
}

/* Sets the point filter's shifted kernels, density of maxima and sums of powers. The gradient's
 * covariance is that of unit-norm kernels by shift, averaged over the sub-pixel phases. */
static void set_point_statistics(bst_filter *f, double sigma_px) {
    int n = 2 * f->radius + 3;
    double roughness = 0.0, powers[BST_THRESHOLD_POWERS] = {0.0};
    for (int p = 0; p < BST_FILTER_PHASES; p++) {
        double here[SIZE], before[SIZE], after[SIZE], h = 1e-3, squares[3] = {0}, metric = 0.0;
        double shift = -0.5 + (double)p / (BST_FILTER_PHASES - 1);
        pixel_integrated_gaussian(sigma_px, shift, f->radius, here);
        pixel_integrated_gaussian(sigma_px, shift - h, f->radius, before);
        pixel_integrated_gaussian(sigma_px, shift + h, f->radius, after);
        for (int i = 0; i < n; i++) {
            squares[0] += before[i] * before[i];
            squares[1] += here[i] * here[i];
            squares[2] += after[i] * after[i];
        }
        for (int i = 0; i < n; i++) {
            double slope = (after[i] / sqrt(squares[2]) - before[i] / sqrt(squares[0])) / (2.0 * h);
            double k = here[i] / sqrt(squares[1]);
            metric += slope * slope;
            add_powers(k, powers);
            f->phase[i][p] = (float)k;
        }
        /* the two end phases are the same, half a weight each */
        double weight = p == 0 || p == BST_FILTER_PHASES - 1 ? 0.5 : 1.0;
        roughness += weight * metric / (BST_FILTER_PHASES - 1);
    }
    double half = 0.0;
    for (int i = 0; i < n; i++) {
        half += (double)f->phase[i][BST_FILTER_PHASES / 2] * (double)f->phase[i][0];
    }
    f->corner = half * half;
    f->point_density = roughness; /* sqrt of the product over both axes, which are equal */
    for (int i = 0; i < BST_THRESHOLD_POWERS; i++) {
        double one_axis = powers[i] / BST_FILTER_PHASES;
        f->point_weights.power[i] = one_axis * one_axis;
    }
}

/* Sets the streak filter's density of maxima and sums of powers. The gradient's covariance follows
 * from correlations at lags of one pixel, whose logarithm is quadratic near 0. */
static void set_streak_statistics(bst_filter *f) {
    double r[3][3];
    for (int j = -1; j <= 1; j++) {
        for (int i = -1; i <= 1; i++) {
            r[j + 1][i + 1] = streak_covariance(f, i, j) / streak_covariance(f, 0, 0);
        }
    }
    double lxx = -2.0 * log(fmax(r[1][2], 1e-6)), lyy = -2.0 * log(fmax(r[2][1], 1e-6));
    double lxy = -0.5 * (log(fmax(r[2][2], 1e-6)) - log(fmax(r[2][0], 1e-6)));
    f->streak_density = sqrt(fmax(lxx * lyy - lxy * lxy, 1e-8));
    /* kernel values at whole pixels */
    int reach_x = 0, reach_y = 0;
    for (int t = 0; t < f->taps; t++) {
        reach_x = abs(f->tap_x[t]) > reach_x ? abs(f->tap_x[t]) : reach_x;
        reach_y = abs(f->tap_y[t]) > reach_y ? abs(f->tap_y[t]) : reach_y;
    }
    f->streak_weights = (bst_threshold_weights){{0.0}};
    for (int y = -reach_y - f->radius; y <= reach_y + f->radius; y++) {
        for (int x = -reach_x - f->radius; x <= reach_x + f->radius; x++) {
            double k = 0.0;
            for (int t = 0; t < f->taps; t++) {
                k += (double)f->tap_weight[t] * kernel_at(f, x - f->tap_x[t], y - f->tap_y[t]);
            }
            add_powers(k, f->streak_weights.power);
        }
    }
}

/* Sets the taps of the streak kernel: one sample per pixel along the longer axis, linearly
 * interpolated across. The interpolation broadens the kernel by at most 1/4 px^2 and costs 0.3 % of
 * the SNR at FWHM 2. */
static void set_streak_kernel(bst_filter *f, double dx, double dy) {
    bool along_x = fabs(dx) >= fabs(dy);
    double major = along_x ? dx : dy, minor = along_x ? dy : dx;
    double slope = minor / major, half = 0.5 * fabs(major);
    int reach = (int)ceil(half + 0.5);
    f->taps = 0;
    for (int j = -reach; j <= reach; j++) {
        double lo = fmax(j - 0.5, -half), hi = fmin(j + 0.5, half);
        if (hi <= lo) {
            continue;
        }
        double across = 0.5 * (lo + hi) * slope, base = floor(across), fraction = across - base;
        for (int k = 0; k < 2; k++) {
            double weight = (hi - lo) * (k ? fraction : 1.0 - fraction);
            int m = (int)base + k;
            add_tap(f, along_x ? j : m, along_x ? m : j, weight);
        }
    }
    double scale = 1.0 / sqrt(streak_covariance(f, 0, 0));
    double total = 0.0, shared = 0.0;
    for (int t = 0; t < f->taps; t++) {
        total += (double)f->tap_weight[t];
        f->tap_weight[t] = (float)((double)f->tap_weight[t] * scale);
        shared += (double)f->tap_weight[t] * point_covariance(f, f->tap_x[t], f->tap_y[t]);
    }
    f->overlap = fmin(shared, 1.0);
    /* norm of the streak kernel at unit flux: the point kernel's norm over total weight times scale
     */
    f->streak_norm = f->kernel_norm / (scale * total);
    set_streak_statistics(f);
}

/* Shares of light of the known PSF in `count` x `count` pixels about a source offset by (x, y) from
 * the middle one. */
static void known_pixel_shares(const bst_filter *f, int binning, double x, double y, int count,
                               double *out) {
    for (int j = 0; j < count; j++) {
        for (int i = 0; i < count; i++) {
            out[j * count + i] = bst_known_psf_share(f->known, f->known->nodes, binning,
                                                     i - count / 2 - x, j - count / 2 - y);
        }
    }
}

/* Scales values to unit norm; returns the norm before. */
static double scale_to_unit(double *values, int count) {
    double square = 0.0;
    for (int i = 0; i < count; i++) {
        square += values[i] * values[i];
    }
    for (int i = 0; i < count; i++) {
        values[i] /= sqrt(square);
    }
    return sqrt(square);
}

/* As set_point_statistics for the known PSF, whose gradient covariance is a full 2 x 2 matrix. */
static void set_known_statistics(bst_filter *f, int binning, double *work) {
    int n = 2 * f->radius + 3, count = n * n, last = BST_FILTER_PHASES - 1;
    double *here = work,
           *side[4] = {work + PLANE, work + 2 * PLANE, work + 3 * PLANE, work + 4 * PLANE};
    double *middle = work + 5 * PLANE, metric[3] = {0.0}, norm2 = 0.0;
    f->phase_stride = (n + BST_ROW_LANES - 1) / BST_ROW_LANES * BST_ROW_LANES;
    f->point_weights = (bst_threshold_weights){{0.0}};
    known_pixel_shares(f, binning, 0.0, 0.0, n, middle);
    (void)scale_to_unit(middle, count);
    for (int p = 0; p < BST_FILTER_PHASES * BST_FILTER_PHASES; p++) {
        int px = p % BST_FILTER_PHASES, py = p / BST_FILTER_PHASES;
        double x = -0.5 + (double)px / last, y = -0.5 + (double)py / last;
        known_pixel_shares(f, binning, x, y, n, here);
        double norm = scale_to_unit(here, count);
        for (int k = 0; k < 4; k++) {
            double h = k % 2 ? STEP_PX : -STEP_PX;
            known_pixel_shares(f, binning, x + (k < 2 ? h : 0.0), y + (k < 2 ? 0.0 : h), n,
                               side[k]);
            (void)scale_to_unit(side[k], count);
        }
        /* the two end phases are the same, half a weight each */
        double weight = (px % last ? 1.0 : 0.5) * (py % last ? 1.0 : 0.5) / (last * last);
        double powers[BST_THRESHOLD_POWERS] = {0.0}, with_middle = 0.0;
        for (int i = 0; i < count; i++) {
            double gx = (side[1][i] - side[0][i]) / (2.0 * STEP_PX);
            double gy = (side[3][i] - side[2][i]) / (2.0 * STEP_PX);
            metric[0] += weight * gx * gx;
            metric[1] += weight * gx * gy;
            metric[2] += weight * gy * gy;
            with_middle += here[i] * middle[i];
            add_powers(here[i], powers);
            f->phases[(size_t)(p * n + i / n) * (size_t)f->phase_stride + (size_t)(i % n)] =
                (float)here[i];
        }
        for (int i = 0; i < BST_THRESHOLD_POWERS; i++) {
            f->point_weights.power[i] += weight * powers[i];
        }
        norm2 += weight * norm * norm;
        f->corner = p == 0 ? with_middle : fmin(f->corner, with_middle);
    }
    f->norm = sqrt(norm2);
    f->point_density = sqrt(fmax(metric[0] * metric[2] - metric[1] * metric[1], 1e-12));
}

/* Autocorrelation of the known PSF's kernel at all lags. */
static void set_lags(bst_filter *f) {
    int most = 2 * f->radius;
    for (int v = -most; v <= most; v++) {
        for (int u = -most; u <= most; u++) {
            double sum = 0.0;
            for (int y = -f->radius; y <= f->radius; y++) {
                for (int x = -f->radius; x <= f->radius; x++) {
                    sum += kernel_at(f, x, y) * kernel_at(f, x + u, y + v);
                }
            }
            f->lags[(v + most) * BST_FILTER_LAGS + u + most] = sum;
        }
    }
}

/* Sets the known PSF's kernel as a low-rank sum of separable terms. */
static void set_known(bst_filter *f, int binning) {
    double *work = f->work, *shares = work, *across = work + PLANE, *down = work + 2 * PLANE;
    int most = (f->known->reach_px + binning - 1) / binning;
    most = most < BST_FILTER_MAX_RADIUS ? most : BST_FILTER_MAX_RADIUS;
    double all = 0.0, inside = 0.0;
    for (f->radius = most; f->radius > 1; f->radius--) {
        int n = 2 * f->radius - 1; /* side of the next smaller kernel */
        known_pixel_shares(f, binning, 0.0, 0.0, 2 * f->radius + 1, shares);
        inside = scale_to_unit(shares, (2 * f->radius + 1) * (2 * f->radius + 1));
        all = f->radius == most ? inside : all;
        known_pixel_shares(f, binning, 0.0, 0.0, n, shares);
        inside = scale_to_unit(shares, n * n);
        if (inside * inside < (1.0 - RADIUS_SHARE) * all * all) {
            break;
        }
    }
    int n = 2 * f->radius + 1;
    known_pixel_shares(f, binning, 0.0, 0.0, n, shares);
    const bst_low_rank_images kernel = {shares, 1, n};
    f->rank = bst_low_rank(&kernel, BST_FILTER_RANK, RANK_SHARE, down, across, work + 3 * PLANE);
    f->kernel_norm = scale_to_unit(across, f->rank * n);
    for (int i = 0; i < n; i++) {
        f->square_x[i] = f->square_y[i] = 0.0;
    }
    for (int k = 0; k < f->rank; k++) {
        for (int i = 0; i < n; i++) {
            f->across[k][i] = (float)across[k * n + i];
            f->down[k * n + i] = (float)down[k * n + i];
        }
    }
    for (int j = 0; j < n * n; j++) {
        double value = kernel_at(f, j % n - f->radius, j / n - f->radius);
        f->square_x[j % n] += value * value;
        f->square_y[j / n] += value * value;
    }
    set_lags(f);
    set_known_statistics(f, binning, work);
}

/* Sets the separable Gaussian kernel. */
static void set_gaussian(bst_filter *f, double sigma_px) {
    f->radius = (int)ceil(3.2 * sigma_px);
    f->radius = f->radius < 1                       ? 1
                : f->radius > BST_FILTER_MAX_RADIUS ? BST_FILTER_MAX_RADIUS
                                                    : f->radius;
    double share[2 * BST_FILTER_MAX_RADIUS + 1], square = 0.0;
    for (int i = -f->radius; i <= f->radius; i++) {
        double root = sigma_px * sqrt(2.0);
        double p = 0.5 * (erf((i + 0.5) / root) - erf((i - 0.5) / root));
        share[i + f->radius] = p;
        square += p * p;
    }
    f->norm = f->kernel_norm = square;
    for (int i = 0; i <= 2 * f->radius; i++) {
        f->kernel[i] = (float)(share[i] / sqrt(square));
        f->square_x[i] = f->square_y[i] = (double)f->kernel[i] * (double)f->kernel[i];
    }
    for (int i = 2 * f->radius + 1; i < 2 * f->radius + 4; i++) {
        f->kernel[i] = 0.0f;
    }
    correlate(f);
    set_point_statistics(f, sigma_px);
}

void bst_filter_set(bst_filter *f, double sigma_px, int binning, double dx_px, double dy_px) {
    bool same = f->made_sigma == sigma_px && f->made_binning == binning;
    if (same && f->made_dx == dx_px && f->made_dy == dy_px) {
        return;
    }
    f->made_sigma = sigma_px;
    f->made_binning = binning;
    f->made_dx = dx_px;
    f->made_dy = dy_px;
    f->streak = dx_px != 0.0 || dy_px != 0.0;
    f->dx_px = dx_px;
    f->dy_px = dy_px;
    f->overlap = 0.0;
    f->taps = 0;
    f->threshold = 0.0;
    if (!same && f->known) {
        set_known(f, binning);
    } else if (!same) {
        set_gaussian(f, sigma_px);
    }
    if (f->streak) {
        set_streak_kernel(f, dx_px, dy_px);
    }
}

/* Share of a smooth field's maxima above the threshold that the search finds: 0.95 to 0.99 for PSFs
 * of 1.3 to 3 px FWHM, measured with boresight pd (docs/explanation/equations/image_processing.md,
 * "Threshold", has the command). */
static const double SEEN = 0.97;

double bst_filter_threshold(bst_filter *f, double false_alarms, double pixels) {
    if (f->threshold > 0.0 && f->threshold_density == false_alarms / pixels) {
        return f->threshold;
    }
    double lo = 2.5, hi = 9.0;
    for (int i = 0; i < 24; i++) {
        double u = 0.5 * (lo + hi);
        double rate = bst_threshold_maxima(u, f->point_density);
        if (f->streak) {
            rate += bst_threshold_maxima(u, f->streak_density) *
                    (1.0 - bst_threshold_exceeds_too(u, u, f->overlap));
        }
        if (SEEN * rate * pixels > false_alarms) {
            lo = u;
        } else {
            hi = u;
        }
    }
    f->threshold = 0.5 * (lo + hi);
    f->threshold_density = false_alarms / pixels;
    return f->threshold;
}
