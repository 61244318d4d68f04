/* Dark current, hot pixels, signal gathered during read-out, trails of charge. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/analysis/characterize/sensor_figures.h"
#include "sim/core/compare.h"

/* Clipping of the dark current's core: hot pixels are beyond it. */
static const double CLIP = 8.0;
/* Columns below this share of the median dark signal are shielded. */
static const double SHIELDED = 0.75;
/* Least significance of a ramp, and of a median signal for finding shielded columns. */
static const double CERTAIN = 5.0;
/* Charge of hot pixels whose trails are measured, in half distances of the 16th and the 84th
 * percentile, which hot pixels do not widen. */
static const double TRAIL = 20.0;
/* Hot pixels lie beyond this quantile of the core's lognormal law, in standard deviations: of a
 * million pixels 0.3 that are not hot. */
static const double HOT = 5.0;

/* Dark signal of each pixel less the level, and what is found in it. */
typedef struct dark_signal {
    const bst_sensor_stacks *stacks;
    bst_sensor_figures *out;
    float *map;     /* [height][width] DN; NAN in shielded columns */
    float *scratch; /* [height * width] */
    double slope;   /* DN per row; 0: no ramp */
    double noise;   /* temporal variance of the map, DN^2, without shot noise of the dark */
} dark_signal;

/* Level of an overscan in each row would add its noise: its mean is subtracted. */
static void subtract_level(dark_signal *d) {
    const bst_sensor_stacks *s = d->stacks;
    size_t pixels = (size_t)d->out->width * (size_t)d->out->height;
    double level = d->out->figures[BST_SENSOR_OFFSET].value;
    for (size_t i = 0; i < pixels; i++) {
        d->map[i] = s->dark.mean[i] - (s->bias.count > 0 ? s->bias.mean[i] : (float)level);
    }
}

/* Closes the gaps of values that are NAN (BLANK pixels, shielded columns); returns the number of
 * the others. */
static size_t drop_nan(float *v, size_t count) {
    size_t n = 0;
    for (size_t i = 0; i < count; i++) {
        if (!isnan(v[i])) {
            v[n++] = v[i];
        }
    }
    return n;
}

/* Excludes columns without dark signal, as at the edges of many sensors. */
static void exclude_shielded(dark_signal *d) {
    int width = d->out->width, height = d->out->height;
    double *columns = malloc((size_t)width * sizeof *columns);
    double *sorted = malloc((size_t)width * sizeof *sorted);
    int known = 0;
    for (int x = 0; columns && sorted && x < width; x++) {
        for (int y = 0; y < height; y++) {
            d->scratch[y] = d->map[(size_t)y * (size_t)width + (size_t)x];
        }
        size_t n = drop_nan(d->scratch, (size_t)height);
        double sigma = bst_robust_sigma(d->scratch, n); /* sorts, from four values on */
        columns[x] = n >= 4 ? bst_sorted_median(d->scratch, n) : NAN;
        if (isnan(columns[x])) {
            continue;
        }
        sorted[known++] = columns[x];
        /* a level that does not differ from 0 in one column says nothing */
        if (columns[x] < CERTAIN * sigma / sqrt((double)n)) {
            columns[x] = fmin(columns[x], 0.0);
        }
    }
    if (columns && sorted && known > 0) {
        qsort(sorted, (size_t)known, sizeof *sorted, bst_compare_doubles);
        double typical = sorted[known / 2], spread = sorted[3 * known / 4] - sorted[known / 4];
        for (int x = 0; x < width; x++) {
            if (typical > 4.0 * spread && columns[x] < SHIELDED * typical) {
                d->out->shielded_columns++;
                for (int y = 0; y < height; y++) {
                    d->map[(size_t)y * (size_t)width + (size_t)x] = NAN;
                }
            }
        }
    }
    free(columns);
    free(sorted);
}

/* Line through the medians of the rows, without outliers. Returns the intercept. */
static bst_sensor_estimate fit_ramp(dark_signal *d, bst_sensor_estimate *slope) {
    int height = d->out->height;
    size_t width = (size_t)d->out->width;
    double *medians = malloc((size_t)height * sizeof *medians), a = NAN, b = NAN, limit = INFINITY;
    *slope = (bst_sensor_estimate){NAN, NAN};
    if (!medians) {
        return *slope;
    }
    for (int y = 0; y < height; y++) {
        memcpy(d->scratch, d->map + (size_t)y * width, width * sizeof *d->scratch);
        size_t n = drop_nan(d->scratch, width);
        bst_sort_floats(d->scratch, n);
        medians[y] = bst_sorted_median(d->scratch, n);
    }
    bst_sensor_estimate intercept = *slope;
    for (int turn = 0; turn < 6; turn++) {
        double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, rest = 0;
        for (int y = 0; y < height; y++) {
            if (isfinite(medians[y]) && (turn == 0 || fabs(medians[y] - a - b * y) < limit)) {
                n++;
                sx += y;
                sy += medians[y];
                sxx += (double)y * y;
                sxy += y * medians[y];
            }
        }
        double determinant = n * sxx - sx * sx, old_a = a, old_b = b;
        b = (n * sxy - sx * sy) / determinant;
        a = (sy - b * sx) / n;
        for (int y = 0; y < height; y++) {
            double r = medians[y] - a - b * y;
            if (isfinite(r) && (turn == 0 || fabs(medians[y] - old_a - old_b * y) < limit)) {
                rest += r * r / (n - 2.0);
            }
        }
        limit = 4.0 * sqrt(rest);
        *slope = (bst_sensor_estimate){b, sqrt(rest * n / determinant)};
        intercept = (bst_sensor_estimate){a, sqrt(rest * sxx / determinant)};
    }
    free(medians);
    return intercept;
}

/* Dark current gathered during read-out grows with the row that is read. */
static void measure_ramp(dark_signal *d) {
    bst_sensor_figures *out = d->out;
    bst_sensor_estimate slope;
    fit_ramp(d, &slope);
    int rows = out->height - 1;
    if (!(fabs(slope.value) > CERTAIN * slope.sigma) || fabs(slope.value) * rows < 0.5) {
        out->method[BST_SENSOR_RAMP] = "none: the line through the rows has no certain slope";
        return;
    }
    out->figures[BST_SENSOR_RAMP] = (bst_sensor_estimate){slope.value * rows, slope.sigma * rows};
    out->method[BST_SENSOR_RAMP] = "line through the medians of the rows, from first to last row";
    d->slope = slope.value;
    /* the row that is read first has only the dark current of the exposure */
    int first = slope.value > 0.0 ? 0 : rows;
    for (int y = 0; y < out->height; y++) {
        for (int x = 0; x < out->width; x++) {
            d->map[(size_t)y * (size_t)out->width + (size_t)x] -=
                (float)(slope.value * (y - first));
        }
    }
}

/* Mean and spread of the core, and the limit above which pixels are hot. */
static bst_clipped_moments measure_core(dark_signal *d, double per_s) {
    bst_sensor_figures *out = d->out;
    size_t pixels = (size_t)out->width * (size_t)out->height;
    double means[BST_STACK_BLOCKS], variances[BST_STACK_BLOCKS], medians[BST_STACK_BLOCKS];
    memcpy(d->scratch, d->map, pixels * sizeof *d->scratch);
    bst_clipped_moments core = bst_clipped_moments_of(d->scratch, pixels, CLIP);
    bst_sensor_block_moments(d->map, out->width, out->height, CLIP, d->scratch, means, variances);
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        double shot = fmax(means[k], 0.0) / out->figures[BST_SENSOR_GAIN].value;
        double rest = variances[k] - d->noise - shot / d->stacks->dark.count;
        medians[k] = means[k] > 0.0 ? rest / (means[k] * means[k]) : NAN;
    }
    bst_sensor_estimate dark = bst_mean_estimate(means, BST_STACK_BLOCKS);
    const bst_sensor_estimate *gain = &out->figures[BST_SENSOR_GAIN];
    double relative = gain->sigma > 0.0 ? gain->sigma / gain->value : 0.0;
    double level = d->stacks->bias.count > 0 ? 0.0 : out->figures[BST_SENSOR_OFFSET].sigma;
    dark.sigma = hypot(dark.sigma, level);
    dark.sigma = hypot(dark.sigma, dark.value * relative);
    out->figures[BST_SENSOR_DARK] = (bst_sensor_estimate){dark.value * per_s, dark.sigma * per_s};
    out->method[BST_SENSOR_DARK] = "mean of the pixels that are not hot";
    bst_sensor_estimate v = bst_mean_estimate(medians, BST_STACK_BLOCKS);
    out->figures[BST_SENSOR_DSNU] = bst_root_estimate(v);
    out->method[BST_SENSOR_DSNU] = "scatter of the dark map in 8 x 8 blocks, less its noise";
    return core;
}

/* Median and other percentiles of the map. */
static void measure_percentiles(dark_signal *d, double per_s) {
    bst_sensor_figures *out = d->out;
    size_t pixels = (size_t)out->width * (size_t)out->height, n = 0;
    for (size_t i = 0; i < pixels; i++) {
        if (!isnan(d->map[i])) {
            d->scratch[n++] = d->map[i];
        }
    }
    bst_sort_floats(d->scratch, n);
    for (int i = 0; i < BST_SENSOR_PERCENTILES && n > 0; i++) {
        size_t at = (size_t)(bst_sensor_percentiles[i] / 100.0 * (double)(n - 1) + 0.5);
        out->percentiles_e_per_s[i] = d->scratch[at] * per_s;
    }
    /* standard error of a median: sqrt(pi / 2) of that of a mean; the core's as above */
    bst_sensor_estimate *median = &out->figures[BST_SENSOR_DARK_MEDIAN];
    median->value = bst_sorted_median(d->scratch, n) * per_s;
    median->sigma = 1.2533 * out->figures[BST_SENSOR_DARK].sigma;
    out->method[BST_SENSOR_DARK_MEDIAN] = "median of all pixels that gather dark current";
}

/* Hot pixels and the charge that trails them. */
static void measure_hot(dark_signal *d, const bst_clipped_moments *core, double per_s) {
    bst_sensor_figures *out = d->out;
    size_t pixels = (size_t)out->width * (size_t)out->height;
    for (size_t i = 0; i < pixels; i++) {
        d->scratch[i] = (float)((d->map[i] - core->mean) * per_s);
    }
    /* the noise of the map, and the law of the dark currents, whose tail is longer */
    double dsnu = out->figures[BST_SENSOR_DSNU].value;
    dsnu = isfinite(dsnu) ? dsnu : 0.0;
    double log2_sigma = log(1.0 + dsnu * dsnu);
    double noise = sqrt(d->noise + fmax(core->mean, 0.0) / out->figures[BST_SENSOR_GAIN].value /
                                       d->stacks->dark.count);
    double tail = core->mean * (exp(HOT * sqrt(log2_sigma) - 0.5 * log2_sigma) - 1.0);
    double limit = fmax(core->high - core->mean, tail + HOT * noise) * per_s;
    bst_hot_pixels hot = bst_hot_pixels_fit(d->scratch, pixels, limit);
    out->hot_found = hot.found;
    out->hot_limit_e_per_s = limit + core->mean * per_s;
    out->figures[BST_SENSOR_HOT_FRACTION] = hot.fraction;
    out->figures[BST_SENSOR_HOT_MEDIAN] = hot.median;
    out->figures[BST_SENSOR_HOT_SPREAD] = hot.spread_dex;
    const char *how = isfinite(hot.median.value)
                          ? "normal law of the logarithm, fitted above the limit"
                          : "not determined: fewer than 20 hot pixels, or most of them would lie "
                            "below the limit";
    out->method[BST_SENSOR_HOT_FRACTION] = out->method[BST_SENSOR_HOT_MEDIAN] =
        out->method[BST_SENSOR_HOT_SPREAD] = how;
    double median = out->percentiles_e_per_s[2] / per_s;
    double spread = 0.5 * (out->percentiles_e_per_s[3] - out->percentiles_e_per_s[1]) / per_s;
    for (size_t i = 0; i < pixels; i++) {
        d->scratch[i] = d->map[i] - (float)median;
    }
    double saturated = 0.9 * 65535.0 - out->figures[BST_SENSOR_OFFSET].value;
    out->trail =
        bst_charge_trail_measure(d->scratch, out->width, out->height, TRAIL * spread, saturated);
    out->figures[BST_SENSOR_PARALLEL_TRAIL] = out->trail.parallel;
    out->figures[BST_SENSOR_SERIAL_TRAIL] = out->trail.serial;
    out->method[BST_SENSOR_PARALLEL_TRAIL] = out->method[BST_SENSOR_SERIAL_TRAIL] =
        isfinite(out->trail.parallel.value)
            ? "median profile behind hot pixels less the one before them, 5 px"
            : "not determined: fewer than 50 isolated hot pixels of 20 standard deviations";
}

/* Temporal variance of the map without the dark's shot noise. */
static double map_noise(const dark_signal *d) {
    const bst_frame_stack *bias = &d->stacks->bias, *dark = &d->stacks->dark;
    double read = d->out->figures[BST_SENSOR_READ_NOISE].value;
    double row = d->out->figures[BST_SENSOR_ROW_NOISE].value;
    double one = (isfinite(read) ? read * read : 0.0) + (isfinite(row) ? row * row : 0.0) +
                 (dark->integer ? 1.0 / 12.0 : 0.0);
    return one / dark->count + (bias->count > 0 ? one / bias->count : 0.0);
}

static void measure_all(dark_signal *d) {
    bst_sensor_figures *out = d->out;
    double per_s = out->figures[BST_SENSOR_GAIN].value / d->stacks->dark.exposure_s;
    subtract_level(d);
    exclude_shielded(d);
    measure_ramp(d);
    d->noise = map_noise(d);
    bst_clipped_moments core = measure_core(d, per_s);
    measure_percentiles(d, per_s);
    measure_hot(d, &core, per_s);
    size_t pixels = (size_t)out->width * (size_t)out->height;
    for (size_t i = 0; i < pixels; i++) {
        d->map[i] *= (float)per_s;
    }
}

bst_status bst_sensor_measure_dark(bst_ctx *ctx, const bst_sensor_stacks *s,
                                   bst_sensor_figures *out) {
    if (s->dark.count == 0 || !bst_sensor_has_level(s) || !(s->dark.exposure_s > 0.0)) {
        for (int i = BST_SENSOR_DARK; i <= BST_SENSOR_HOT_SPREAD; i++) {
            out->method[i] = "not determined: needs darks, and bias frames or an overscan";
        }
        out->method[BST_SENSOR_RAMP] = out->method[BST_SENSOR_PARALLEL_TRAIL] =
            out->method[BST_SENSOR_SERIAL_TRAIL] = out->method[BST_SENSOR_DARK];
        return BST_OK;
    }
    size_t pixels = (size_t)out->width * (size_t)out->height;
    dark_signal d = {.stacks = s, .out = out};
    out->dark_map = d.map = malloc(pixels * sizeof *d.map);
    d.scratch = malloc(pixels * sizeof *d.scratch);
    if (d.map && d.scratch) {
        measure_all(&d);
    }
    free(d.scratch);
    return d.map && d.scratch ? BST_OK
                              : bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", pixels);
}
