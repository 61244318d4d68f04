/* Sub-pixel interpolation of the matched-filter output. */
#include <math.h>
#include <string.h>

#include "imgproc/detect/filter.h"
#include "imgproc/detect/simd_layout.h"

/* A quadratic is valid only within the outputs that it was fitted to. Along a streak noise curves
 * them little, and the extrapolated peak would lie pixels away. */
static const double QUADRATIC_REACH_PX = 1.0;

/* Peak of the parabola through three values one step apart, the middle one the largest. */
static double parabola_peak(double left, double middle, double right) {
    double bend = left - 2.0 * middle + right;
    return bend < 0.0 ? middle - (right - left) * (right - left) / (8.0 * bend) : middle;
}

/* filter output by sub-pixel shift in y and x */
typedef double phase_values[BST_FILTER_PHASES][BST_FILTER_PHASES];

#define BST_SIMD_KERNELS "imgproc/detect/filter_peak_kernels.inc"
#include "sim/core/simd_each.inc"

/* Point-filter output at a pixel for all sub-pixel shifts of the known PSF. */
static void known_phase_values(const bst_filter *f, const float *corner, phase_values value) {
    float lanes[BST_FILTER_PHASES * BST_FILTER_PHASES * BST_LANES] = {0.0f};
    float row[2 * BST_FILTER_MAX_RADIUS + 3 + BST_LANES];
    int n = 2 * f->radius + 3;
    for (int i = n; i < f->phase_stride; i++) {
        row[i] = 0.0f;
    }
    for (int j = 0; j < n; j++) {
        for (int i = 0; i < n; i++) {
            float pixel = corner[(size_t)j * (size_t)f->width + (size_t)i];
            row[i] = pixel > BST_PIXEL_NONE ? pixel : 0.0f;
        }
        BST_SIMD_PICK(add_row)(f, row, j, lanes);
    }
    for (int p = 0; p < BST_FILTER_PHASES * BST_FILTER_PHASES; p++) {
        value[p / BST_FILTER_PHASES][p % BST_FILTER_PHASES] =
            bst_simd_layout_sum(lanes + p * BST_LANES);
    }
}

/* Point-filter output at a pixel for all sub-pixel shifts of the Gaussian PSF. */
BST_CLONES_256
static void gaussian_phase_values(const bst_filter *f, const float *corner, phase_values value) {
    enum { LANES = BST_FILTER_PHASE_LANES };
    double all[BST_FILTER_PHASES][LANES] = {{0.0}};
    int n = 2 * f->radius + 3;
    for (int j = 0; j < n; j++) {
        const float *row = corner + (size_t)j * (size_t)f->width;
        double sum[LANES] = {0.0};
        for (int i = 0; i < n; i++) {
            double pixel = row[i] > BST_PIXEL_NONE ? (double)row[i] : 0.0;
            for (int px = 0; px < LANES; px++) {
                sum[px] += (double)f->phase[i][px] * pixel;
            }
        }
        for (int py = 0; py < BST_FILTER_PHASES; py++) {
            double weight = (double)f->phase[j][py];
            for (int px = 0; px < LANES; px++) {
                all[py][px] += weight * sum[px];
            }
        }
    }
    for (int py = 0; py < BST_FILTER_PHASES; py++) {
        memcpy(value[py], all[py], sizeof value[py]);
    }
}

/* Interpolated peak SNR of the point filter near (x, y). */
static double point_peak(const bst_filter *f, const float *signal, double noise_e, int x, int y) {
    int r = f->radius + 1;
    if (x < r || y < r || x + r >= f->width || y + r >= f->height) {
        return -INFINITY;
    }
    phase_values value = {{0.0}};
    const float *corner = signal + (size_t)(y - r) * (size_t)f->width + (size_t)(x - r);
    if (f->known) {
        known_phase_values(f, corner, value);
    } else {
        gaussian_phase_values(f, corner, value);
    }
    int bx = 0, by = 0;
    for (int py = 0; py < BST_FILTER_PHASES; py++) {
        for (int px = 0; px < BST_FILTER_PHASES; px++) {
            if (value[py][px] > value[by][bx]) {
                bx = px;
                by = py;
            }
        }
    }
    double best = value[by][bx], more = 0.0;
    if (bx > 0 && bx < BST_FILTER_PHASES - 1) {
        more += parabola_peak(value[by][bx - 1], best, value[by][bx + 1]) - best;
    }
    if (by > 0 && by < BST_FILTER_PHASES - 1) {
        more += parabola_peak(value[by - 1][bx], best, value[by + 1][bx]) - best;
    }
    return (best + more) / noise_e;
}

/* Peak of a quadratic through 3 x 3 logarithms: gain over the middle value, and position. */
static double quadratic_peak(double v[3][3], double *dx, double *dy) {
    double gx = 0.5 * (v[1][2] - v[1][0]), gy = 0.5 * (v[2][1] - v[0][1]);
    double hxx = v[1][2] - 2.0 * v[1][1] + v[1][0], hyy = v[2][1] - 2.0 * v[1][1] + v[0][1];
    double hxy = 0.25 * (v[2][2] - v[2][0] - v[0][2] + v[0][0]);
    double det = hxx * hyy - hxy * hxy, gain = 0.0;
    *dx = *dy = 0.0;
    if (hxx < 0.0 && hyy < 0.0 && det > 1e-3 * hxx * hyy) {
        *dx = (hxy * gy - hyy * gx) / det;
        *dy = (hxy * gx - hxx * gy) / det;
        gain = 0.5 * (gx * *dx + gy * *dy);
    } else if (hxx + hyy < 0.0) {
        *dx = hxx < hyy ? -gx / hxx : 0.0;
        *dy = hxx < hyy ? 0.0 : -gy / hyy;
        gain = 0.5 * (gx * *dx + gy * *dy);
    }
    /* largest loss of a filter for a source half a pixel off on both axes */
    return fmin(fmax(gain, 0.0), 0.3);
}

/* Interpolated peak SNR of the streak filter near (x, y). */
static double streak_peak(const bst_filter *f, int x, int y) {
    double v[3][3], dx, dy;
    double here = (double)bst_filter_streak_at(f, x, y);
    if (x < 1 || y < 1 || x + 1 >= f->width || y + 1 >= f->height || !(here > 0.0)) {
        return here;
    }
    for (int j = 0; j < 3; j++) {
        for (int i = 0; i < 3; i++) {
            double s = (double)bst_filter_streak_at(f, x + i - 1, y + j - 1);
            v[j][i] = log(fmax(s, 0.05 * here));
        }
    }
    double gain = quadratic_peak(v, &dx, &dy), off = fmax(fabs(dx), fabs(dy));
    /* share of the offset to the peak */
    double share = fmin(1.0, QUADRATIC_REACH_PX / fmax(off, 1e-9));
    return here * exp(gain * share * (2.0 - share));
}

double bst_filter_top(const bst_filter *f, bool point, int x, int y, double *dx, double *dy) {
    double v[3][3];
    double here = (double)(point ? bst_filter_point_at(f, x, y) : bst_filter_best_at(f, x, y));
    *dx = *dy = 0.0;
    if (x < 1 || y < 1 || x + 1 >= f->width || y + 1 >= f->height || !(here > 0.0)) {
        return here;
    }
    for (int j = 0; j < 3; j++) {
        for (int i = 0; i < 3; i++) {
            float s = point ? bst_filter_point_at(f, x + i - 1, y + j - 1)
                            : bst_filter_best_at(f, x + i - 1, y + j - 1);
            v[j][i] = (double)logf(fmaxf(s, 0.05f * (float)here));
        }
    }
    double gain = quadratic_peak(v, dx, dy);
    *dx = fmin(fmax(*dx, -0.7), 0.7);
    *dy = fmin(fmax(*dy, -0.7), 0.7);
    return here * exp(gain);
}

double bst_filter_peak(const bst_filter *f, const float *signal, double noise_e, bool streak, int x,
                       int y) {
    double here = (double)(streak ? bst_filter_streak_at(f, x, y) : bst_filter_point_at(f, x, y));
    double between = streak ? streak_peak(f, x, y) : point_peak(f, signal, noise_e, x, y);
    return fmax(here, between);
}
