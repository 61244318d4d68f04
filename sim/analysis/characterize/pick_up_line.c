#include "sim/analysis/characterize/pick_up_line.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/compare.h"
#include "sim/core/fft.h"

/* Half width of the running median that gives the continuum; the lowest bins have no line. */
enum { CONTINUUM = 30, FIRST_BIN = 5, GROUPS = 8, STEPS = 24 };
/* The line and its highest side lobes reach this many bins. */
enum { LINE_BINS = 4 };

static const double PI = 3.14159265358979323846;
/* Outliers beyond this many robust standard deviations are clipped. */
static const float CLIP = 6.0F;
/* Standard deviations of the continuum that make a line certain. */
static const double CERTAIN = 7.0;
/* Share of the power at the frequency that has one phase from row to row; noise has 1 / sqrt(rows).
 */
static const double COHERENT = 0.5;

/* Clips rows at CLIP robust standard deviations. */
static bst_status clip_rows(bst_ctx *ctx, float *rows, size_t count) {
    float *copy = malloc(count * sizeof *copy);
    if (!copy) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", count);
    }
    memcpy(copy, rows, count * sizeof *copy);
    float limit = CLIP * (float)bst_robust_sigma(copy, count);
    free(copy);
    for (size_t i = 0; i < count; i++) {
        rows[i] = isnan(rows[i]) ? 0.0F : fminf(fmaxf(rows[i], -limit), limit);
    }
    return BST_OK;
}

/* Mean power spectrum of the rows through a Hann window. */
static bst_status mean_spectrum(bst_ctx *ctx, const float *rows, int width, int height,
                                double *power, int bins) {
    float *in = bst_fft_array((size_t)width * sizeof *in);
    float *out = bst_fft_array((size_t)(2 * (width / 2 + 1)) * sizeof *out);
    bst_fft *fft = NULL;
    bst_status status = in && out
                            ? bst_fft_create_f32(ctx, BST_FFT_REAL_FORWARD, 1, width, in, out, &fft)
                            : bst_fail(ctx, BST_ERR_MEMORY, "no memory for a spectrum");
    memset(power, 0, (size_t)bins * sizeof *power);
    for (int y = 0; y < height && status == BST_OK; y++) {
        for (int x = 0; x < width; x++) {
            double window = 0.5 - 0.5 * cos(2.0 * PI * (x + 0.5) / width);
            in[x] = (float)(window * rows[(size_t)y * (size_t)width + (size_t)x]);
        }
        bst_fft_run(fft);
        for (int k = 0; k < bins; k++) {
            power[k] +=
                ((double)out[2 * k] * out[2 * k] + (double)out[2 * k + 1] * out[2 * k + 1]) /
                height;
        }
    }
    bst_fft_free(fft);
    bst_fft_array_free(in);
    bst_fft_array_free(out);
    return status;
}

/* Divides a spectrum by its running median. */
static void flatten(double *power, int bins, double *copy) {
    double window[2 * CONTINUUM + 1];
    memcpy(copy, power, (size_t)bins * sizeof *copy);
    for (int k = 0; k < bins; k++) {
        int from = k > CONTINUUM ? k - CONTINUUM : 1, n = 0;
        for (int i = from; i <= k + CONTINUUM && i < bins; i++) {
            window[n++] = copy[i];
        }
        qsort(window, (size_t)n, sizeof *window, bst_compare_doubles);
        power[k] = n > 0 && window[n / 2] > 0.0 ? copy[k] / window[n / 2] : 1.0;
    }
}

/* Mean over rows of the squared Fourier sum at a frequency. */
static double power_at(const float *rows, int width, int from, int to, double cycles_px) {
    double turn[2] = {cos(2.0 * PI * cycles_px), sin(2.0 * PI * cycles_px)}, sum = 0.0;
    for (int y = from; y < to; y++) {
        const float *row = rows + (size_t)y * (size_t)width;
        double re = 0.0, im = 0.0, c = 1.0, s = 0.0;
        for (int x = 0; x < width; x++) {
            re += c * row[x];
            im += s * row[x];
            double next = c * turn[0] - s * turn[1];
            s = c * turn[1] + s * turn[0];
            c = next;
        }
        sum += re * re + im * im;
    }
    return sum / (to - from);
}

/* Frequency of most power between two, by golden section. */
static double refine(const float *rows, int width, int from, int to, double low, double high) {
    const double golden = 0.6180339887498949;
    double a = high - golden * (high - low), b = low + golden * (high - low);
    double at_a = power_at(rows, width, from, to, a), at_b = power_at(rows, width, from, to, b);
    for (int i = 0; i < STEPS && high - low > 1e-3 / width; i++) {
        if (at_a > at_b) {
            high = b;
            b = a;
            at_b = at_a;
            a = high - golden * (high - low);
            at_a = power_at(rows, width, from, to, a);
        } else {
            low = a;
            a = b;
            at_a = at_b;
            b = low + golden * (high - low);
            at_b = power_at(rows, width, from, to, b);
        }
    }
    return 0.5 * (low + high);
}

/* Frequency at which the Fourier sums of rows add up best, cycles per row in [-1/2, 1/2). sums:
 * real and imaginary parts by row. Returns its share of the power. */
static double best_growth(const double *sums, int rows, double *cycles) {
    double best = -1.0, power = 0.0, around[3] = {0.0, 0.0, 0.0}, last = 0.0, before = 0.0;
    int steps = 4 * rows;
    for (int y = 0; y < rows; y++) {
        power += sums[2 * y] * sums[2 * y] + sums[2 * y + 1] * sums[2 * y + 1];
    }
    for (int k = -steps / 2 - 1; k <= steps / 2; k++) { /* a step beyond, for the parabola */
        double turn[2] = {cos(2.0 * PI * k / steps), -sin(2.0 * PI * k / steps)};
        double re = 0.0, im = 0.0, c = 1.0, s = 0.0;
        for (int y = 0; y < rows; y++) {
            re += sums[2 * y] * c - sums[2 * y + 1] * s;
            im += sums[2 * y] * s + sums[2 * y + 1] * c;
            double next = c * turn[0] - s * turn[1];
            s = c * turn[1] + s * turn[0];
            c = next;
        }
        double now = re * re + im * im;
        if (last > best && k > -steps / 2) {
            best = last;
            *cycles = (k - 1.0) / steps;
            around[0] = before;
            around[1] = last;
            around[2] = now;
        }
        before = last;
        last = now;
    }
    double bend = around[0] - 2.0 * around[1] + around[2];
    *cycles += bend < 0.0 ? 0.5 * (around[0] - around[2]) / bend / steps : 0.0;
    *cycles -= floor(*cycles + 0.5);
    return power > 0.0 ? best / (rows * power) : 0.0;
}

/* Growth of the phase from row to row, with the scatter of groups of rows; NAN if the rows are not
 * coherent. */
static bst_sensor_estimate row_phase(const float *rows, int width, int height, double cycles_px) {
    bst_sensor_estimate out = {NAN, NAN};
    double groups[GROUPS], value;
    double *sums = calloc(2 * (size_t)height, sizeof *sums);
    for (int x = 0; sums && x < width; x++) {
        double c = cos(2.0 * PI * cycles_px * x), s = -sin(2.0 * PI * cycles_px * x);
        for (int y = 0; y < height; y++) {
            double v = (double)rows[(size_t)y * (size_t)width + (size_t)x];
            sums[2 * y] += v * c;
            sums[2 * y + 1] += v * s;
        }
    }
    if (sums && best_growth(sums, height, &value) > COHERENT) {
        for (int g = 0; g < GROUPS; g++) {
            int from = g * height / GROUPS, to = (g + 1) * height / GROUPS;
            best_growth(sums + 2 * from, to - from, &groups[g]);
            groups[g] = value + remainder(groups[g] - value, 1.0);
        }
        out = (bst_sensor_estimate){value, bst_mean_estimate(groups, GROUPS).sigma};
    }
    free(sums);
    return out;
}

/* Amplitude of a line in rows [from, to): its power less that of the continuum beside it. */
static double amplitude_in(const float *rows, int width, int from, int to, double f) {
    double beside = 0.0;
    int samples = 0;
    for (int k = -16; k < 16; k++) {
        /* spectra of real rows fold at 0 and 1/2: near an end a sample would be the line */
        double sample = fabs(f + (k + 0.5) / width);
        sample = fmin(sample, 1.0 - sample);
        if ((k < -8 || k >= 8) && fabs(sample - f) * width >= LINE_BINS) {
            beside += power_at(rows, width, from, to, sample);
            samples++;
        }
    }
    double power = power_at(rows, width, from, to, f) - beside / samples;
    return 2.0 * sqrt(fmax(power, 0.0)) / width;
}

/* Frequency and amplitude of the line, from groups of rows. */
static void measure(const float *rows, int width, int height, int peak, bst_pick_up_line *out) {
    double frequency[GROUPS], amplitude[GROUPS];
    for (int g = 0; g < GROUPS; g++) {
        int from = (int)((int64_t)g * height / GROUPS),
            to = (int)((int64_t)(g + 1) * height / GROUPS);
        frequency[g] = refine(rows, width, from, to, (peak - 1.0) / width, (peak + 1.0) / width);
        amplitude[g] = amplitude_in(rows, width, from, to, frequency[g]);
    }
    out->frequency = bst_mean_estimate(frequency, GROUPS);
    out->phase = row_phase(rows, width, height, out->frequency.value);
    out->amplitude = bst_mean_estimate(amplitude, GROUPS);
}

bst_status bst_pick_up_line_amplitude(bst_ctx *ctx, float *rows, int width, int height,
                                      bst_pick_up_line *line) {
    double amplitude[GROUPS];
    BST_TRY(clip_rows(ctx, rows, (size_t)width * (size_t)height));
    for (int g = 0; g < GROUPS; g++) {
        int from = (int)((int64_t)g * height / GROUPS),
            to = (int)((int64_t)(g + 1) * height / GROUPS);
        amplitude[g] = amplitude_in(rows, width, from, to, line->frequency.value);
    }
    line->amplitude = bst_mean_estimate(amplitude, GROUPS);
    return BST_OK;
}

double bst_pick_up_line_phase_deg(const float *rows, int width, int height,
                                  const bst_pick_up_line *line) {
    double re = 0.0, im = 0.0;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            double v = (double)rows[(size_t)y * (size_t)width + (size_t)x];
            double turns = line->frequency.value * x + line->phase.value * y;
            re += v * sin(2.0 * PI * turns);
            im += v * cos(2.0 * PI * turns);
        }
    }
    return isnan(line->phase.value) ? NAN : atan2(im, re) * 180.0 / PI;
}

double bst_pick_up_line_power(const double *covariance, int lags, double cycles_px) {
    double sum = 0.0, norm = 0.0;
    for (int k = 1; k <= lags; k++) { /* least squares */
        double c = cos(2.0 * PI * cycles_px * k);
        sum += covariance[k - 1] * c;
        norm += c * c;
    }
    return norm > 0.0 ? fmax(sum / norm, 0.0) : 0.0;
}

bst_status bst_pick_up_line_find(bst_ctx *ctx, float *rows, int width, int height,
                                 bst_pick_up_line *out) {
    *out = (bst_pick_up_line){.bins = width / 2,
                              .frequency = {NAN, NAN},
                              .amplitude = {NAN, NAN},
                              .phase = {NAN, NAN},
                              .phase_deg = NAN,
                              .pair_power = NAN,
                              .least_ratio = 1.0 + CERTAIN / sqrt(height)};
    BST_TRY(clip_rows(ctx, rows, (size_t)width * (size_t)height));
    double *power = malloc((size_t)out->bins * sizeof *power);
    double *copy = malloc((size_t)out->bins * sizeof *copy);
    bst_status status = power && copy ? mean_spectrum(ctx, rows, width, height, power, out->bins)
                                      : bst_fail(ctx, BST_ERR_MEMORY, "no memory for a spectrum");
    if (status != BST_OK) {
        free(power);
        free(copy);
        return status;
    }
    flatten(power, out->bins, copy);
    free(copy);
    int peak = FIRST_BIN;
    for (int k = FIRST_BIN; k < out->bins - 1; k++) {
        peak = power[k] > power[peak] ? k : peak;
    }
    out->power = power;
    out->found = power[peak] > out->least_ratio;
    if (out->found) {
        measure(rows, width, height, peak, out);
    }
    return BST_OK;
}
