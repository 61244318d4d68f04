/* Dark current, hot pixels, signal gathered during read-out, trails of charge. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/analysis/characterize/dark_distribution.h"
#include "sim/analysis/characterize/readout_time.h"
#include "sim/analysis/characterize/sensor_figures.h"
#include "sim/analysis/characterize/trap_fit.h"
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
/* Largest RMS misfit of traps, share of the trail: below 0.12 on real and simulated darks. */
static const double MOST_MISFIT = 0.3;
/* Share of the saturated signal that may be full. */
static const double FULL = 0.9;
/* Hot pixels from which on their law is sought. */
enum { LEAST_HOT = 20 };
/* Hot pixels lie beyond this quantile of the core's lognormal law, in standard deviations: of a
 * million pixels 0.3 that are not hot. */
static const double HOT = 5.0;

/* Dark signal of each pixel less the level, and what is found in it. */
typedef struct dark_signal {
    const bst_sensor_stacks *stacks;
    bst_sensor_figures *out;
    float *map;       /* [height][width] DN; NAN in shielded columns */
    float *scratch;   /* [height * width] */
    double slope;     /* DN per row; 0: no ramp */
    double noise;     /* temporal variance of the map, DN^2, without shot noise of the dark */
    double row_noise; /* the part of it that is common to a row */
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
    if (isfinite(out->figures[BST_SENSOR_RAMP].value)) { /* subtracted with the bias frames */
        return;
    }
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

/* Time of the read-out from the levels of bias frames; false: there are none. */
static bool measure_readout_of_bias(const dark_signal *d) {
    const bst_sensor_estimate *ramp = &d->out->figures[BST_SENSOR_RAMP];
    if (d->stacks->bias.count == 0 || !isfinite(ramp->value)) {
        return false;
    }
    const bst_frame_stack *bias = &d->stacks->bias, *dark = &d->stacks->dark;
    double one = d->noise - d->row_noise; /* of the map, by the read noise */
    double of_bias = bias->pairs > 0
                         ? bst_mean_estimate(bias->variance, BST_STACK_BLOCKS).value / bias->count
                         : one * dark->count / (bias->count + dark->count);
    double of_dark = dark->pairs > 0
                         ? bst_mean_estimate(dark->variance, BST_STACK_BLOCKS).value / dark->count
                         : fmax(one - of_bias, 0.0);
    const bst_readout_frames frames = {.bias = bias->mean,
                                       .dark = d->map,
                                       .bias_variance = of_bias,
                                       .dark_variance = of_bias + of_dark,
                                       .width = d->out->width,
                                       .height = d->out->height,
                                       .exposure_s = dark->exposure_s,
                                       .last_first = ramp->value < 0.0};
    bst_sensor_estimate time = bst_readout_time(&frames);
    if (!(time.value > CERTAIN * time.sigma)) {
        return false;
    }
    /* offsets of rows are common to the columns: the ramp's error has them */
    time.sigma = hypot(time.sigma, time.value * ramp->sigma / ramp->value);
    d->out->figures[BST_SENSOR_READOUT] = time;
    d->out->method[BST_SENSOR_READOUT] = "bias frames against the dark current that packets pass";
    return true;
}

/* Time of the read-out: without bias frames the ramp over the dark current that packets pass in the
 * time of a row, that of a typical column with its hot pixels. */
static void measure_readout(dark_signal *d) {
    bst_sensor_figures *out = d->out;
    if (measure_readout_of_bias(d)) {
        return;
    }
    int width = out->width, height = out->height, known = 0;
    double *columns = malloc((size_t)width * sizeof *columns);
    out->method[BST_SENSOR_READOUT] = "none: no ramp over the rows";
    const bst_sensor_estimate *ramp = &out->figures[BST_SENSOR_RAMP];
    for (int x = 0; columns && isfinite(ramp->value) && x < width; x++) {
        double sum = 0.0, n = 0.0;
        for (int y = 0; y < height; y++) {
            float v = d->map[(size_t)y * (size_t)width + (size_t)x];
            sum += isnan(v) ? 0.0 : (double)v;
            n += !isnan(v);
        }
        if (n > 0.5 * height) {
            columns[known++] = sum / n;
        }
    }
    if (known >= BST_STACK_BLOCKS) {
        double parts[8];
        for (int k = 0; k < 8; k++) {
            int from = k * known / 8, to = (k + 1) * known / 8;
            qsort(columns + from, (size_t)(to - from), sizeof *columns, bst_compare_doubles);
            parts[k] = columns[(from + to) / 2];
        }
        qsort(columns, (size_t)known, sizeof *columns, bst_compare_doubles);
        double typical = columns[known / 2], relative = bst_mean_estimate(parts, 8).sigma / typical;
        double slope = fabs(ramp->value) / (height - 1);
        double value = slope * height * d->stacks->dark.exposure_s / typical;
        if (typical > 0.0 && relative < 0.2) {
            out->figures[BST_SENSOR_READOUT] =
                (bst_sensor_estimate){value, value * hypot(relative, ramp->sigma / ramp->value)};
            out->method[BST_SENSOR_READOUT] = "ramp over the mean dark current of a typical column";
        }
    }
    free(columns);
}

/* Scatter of the map in blocks, rows levelled: noise that is common to a row would add its own
 * random variance, which is more than that of weak dark currents. */
static bst_status scatter_of_blocks(bst_ctx *ctx, dark_signal *d, double *variances) {
    size_t width = (size_t)d->out->width, height = (size_t)d->out->height;
    double means[BST_STACK_BLOCKS];
    float *levelled = malloc(width * height * sizeof *levelled);
    if (!levelled) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", width * height);
    }
    for (size_t y = 0; y < height; y++) {
        float *row = levelled + y * width;
        memcpy(d->scratch, d->map + y * width, width * sizeof *row);
        float level = (float)bst_clipped_moments_of(d->scratch, width, CLIP).mean;
        for (size_t x = 0; x < width; x++) {
            row[x] = d->map[y * width + x] - level;
        }
    }
    bst_sensor_block_moments(levelled, d->out->width, d->out->height, CLIP, d->scratch, means,
                             variances);
    double freedom = 1.0 - 1.0 / (double)width; /* the row's mean is of the same pixels */
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        variances[k] /= freedom;
    }
    free(levelled);
    return BST_OK;
}

/* Mean and spread of the core, and the limit above which pixels are hot. */
static bst_status measure_core(bst_ctx *ctx, dark_signal *d, double per_s,
                               bst_clipped_moments *core) {
    bst_sensor_figures *out = d->out;
    size_t pixels = (size_t)out->width * (size_t)out->height;
    double means[BST_STACK_BLOCKS], variances[BST_STACK_BLOCKS], medians[BST_STACK_BLOCKS];
    memcpy(d->scratch, d->map, pixels * sizeof *d->scratch);
    *core = bst_clipped_moments_of(d->scratch, pixels, CLIP);
    bst_sensor_block_moments(d->map, out->width, out->height, CLIP, d->scratch, means, NULL);
    BST_TRY(scatter_of_blocks(ctx, d, variances));
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        double shot = fmax(means[k], 0.0) / out->figures[BST_SENSOR_GAIN].value;
        double rest = variances[k] - (d->noise - d->row_noise) - shot / d->stacks->dark.count;
        medians[k] = means[k] > 0.0 ? rest / (means[k] * means[k]) : NAN;
    }
    bst_sensor_estimate dark = bst_mean_estimate(means, BST_STACK_BLOCKS);
    const bst_sensor_estimate *gain = &out->figures[BST_SENSOR_GAIN];
    double relative = gain->sigma > 0.0 ? gain->sigma / gain->value : 0.0;
    double level = d->stacks->bias.count > 0 ? 0.0 : out->figures[BST_SENSOR_OFFSET].sigma;
    dark.sigma = hypot(dark.sigma, level);
    /* blocks beside one another share the noise of their rows */
    dark.sigma = hypot(dark.sigma, sqrt(d->row_noise / out->height));
    dark.sigma = hypot(dark.sigma, dark.value * relative);
    out->figures[BST_SENSOR_DARK] = (bst_sensor_estimate){dark.value * per_s, dark.sigma * per_s};
    out->method[BST_SENSOR_DARK] = "mean of the pixels that are not hot";
    bst_sensor_estimate v = bst_mean_estimate(medians, BST_STACK_BLOCKS);
    out->figures[BST_SENSOR_DSNU] = bst_root_estimate(v);
    out->method[BST_SENSOR_DSNU] = "scatter of the dark map in 8 x 8 blocks, less its noise";
    return BST_OK;
}

/* Percentiles of the pixels of every step-th row from `first` on; returns the number of pixels,
 * sorted in d->scratch. NAN: none has a value. */
static size_t percentiles_of(dark_signal *d, double per_s, int first, int step,
                             double percentiles[BST_SENSOR_PERCENTILES]) {
    size_t width = (size_t)d->out->width, n = 0;
    for (int y = first; y < d->out->height; y += step) {
        for (size_t x = 0; x < width; x++) {
            float v = d->map[(size_t)y * width + x];
            if (!isnan(v)) {
                d->scratch[n++] = v;
            }
        }
    }
    bst_sort_floats(d->scratch, n);
    for (int i = 0; i < BST_SENSOR_PERCENTILES; i++) {
        size_t at = (size_t)(bst_sensor_percentiles[i] / 100.0 * ((double)n - 1.0) + 0.5);
        percentiles[i] = n > 0 ? d->scratch[at] * per_s : NAN;
    }
    return n;
}

/* Fits the detector's law of the dark currents if hot pixels are there but not separate: values of
 * all pixels, errors from four groups of rows, of which three must have such a law. */
static void fit_distribution(dark_signal *d, double per_s) {
    enum { GROUPS = 4, LEAST_GROUPS = 3, VALUES = 5 };
    bst_sensor_figures *out = d->out;
    const bst_sensor_figure figures[VALUES] = {BST_SENSOR_DARK, BST_SENSOR_DSNU,
                                               BST_SENSOR_HOT_FRACTION, BST_SENSOR_HOT_MEDIAN,
                                               BST_SENSOR_HOT_SPREAD};
    double line = out->figures[BST_SENSOR_LINE_AMPLITUDE].value; /* still in DN, as the noise */
    /* the read noise of pairs has it */
    line = isfinite(line) && !out->noise_of_pairs ? 0.5 * line * line / d->stacks->dark.count : 0.0;
    double ramp =
        0.5 * fabs(out->figures[BST_SENSOR_RAMP].value) / out->figures[BST_SENSOR_GAIN].value;
    ramp = isfinite(ramp) ? ramp : 0.0;
    const bst_dark_noise noise = {(d->noise + line + ramp / d->stacks->dark.count) * per_s * per_s,
                                  d->stacks->dark.exposure_s * d->stacks->dark.count};
    bst_dark_distribution all, part;
    double percentiles[BST_SENSOR_PERCENTILES];
    percentiles_of(d, per_s, 0, 1, percentiles);
    if (!bst_dark_distribution_fit(percentiles, &noise, NULL, &all)) {
        return;
    }
    const double values[VALUES] = {all.dark, all.dsnu, all.hot_fraction, all.hot_median,
                                   all.hot_spread_dex};
    double groups[VALUES][GROUPS];
    int fitted = 0;
    for (int g = 0; g < GROUPS; g++) {
        percentiles_of(d, per_s, g, GROUPS, percentiles);
        bool good = bst_dark_distribution_fit(percentiles, &noise, &all, &part);
        fitted += good;
        const double found[VALUES] = {part.dark, part.dsnu, part.hot_fraction, part.hot_median,
                                      part.hot_spread_dex};
        for (int i = 0; i < VALUES; i++) {
            groups[i][g] = good ? found[i] : NAN;
        }
    }
    for (int i = 0; i < VALUES; i++) {
        double sigma = bst_mean_estimate(groups[i], GROUPS).sigma;
        out->figures[figures[i]] =
            (bst_sensor_estimate){values[i], fitted >= LEAST_GROUPS ? sigma : NAN};
        out->method[figures[i]] =
            "law of all pixels, fitted to the percentiles: hot pixels are not "
            "separate from the others";
    }
}

/* Median and other percentiles of the map, as it was read. */
static void measure_percentiles(dark_signal *d, double per_s) {
    bst_sensor_figures *out = d->out;
    size_t n = percentiles_of(d, per_s, 0, 1, out->percentiles_e_per_s);
    out->figures[BST_SENSOR_DARK_MEDIAN].value = bst_sorted_median(d->scratch, n) * per_s;
    out->method[BST_SENSOR_DARK_MEDIAN] = "median of all pixels that gather dark current";
}

/* Signal from which on a pixel may be full, DN above the level: of the converter or, if a series of
 * flats showed it, of the pixel. */
static double full_signal(const bst_sensor_figures *out) {
    double pixel = out->figures[BST_SENSOR_SATURATION].value;
    double converter = 65535.0 - out->figures[BST_SENSOR_OFFSET].value;
    return FULL * (pixel < converter ? pixel : converter);
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
    double most = (full_signal(out) - core->mean) * per_s;
    bst_hot_pixels hot = bst_hot_pixels_fit(d->scratch, pixels, limit, most);
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
}

/* Charge that trails hot pixels. Returns the median signal, DN. */
static double measure_trail(dark_signal *d) {
    bst_sensor_figures *out = d->out;
    size_t pixels = (size_t)out->width * (size_t)out->height;
    double percentiles[BST_SENSOR_PERCENTILES];
    percentiles_of(d, 1.0, 0, 1, percentiles);
    double median = percentiles[2], spread = 0.5 * (percentiles[3] - percentiles[1]);
    for (size_t i = 0; i < pixels; i++) {
        d->scratch[i] = d->map[i] - (float)median;
    }
    out->trail = bst_charge_trail_measure(d->scratch, out->width, out->height, TRAIL * spread,
                                          full_signal(out));
    out->figures[BST_SENSOR_PARALLEL_TRAIL] = out->trail.parallel;
    out->figures[BST_SENSOR_SERIAL_TRAIL] = out->trail.serial;
    out->method[BST_SENSOR_PARALLEL_TRAIL] = out->method[BST_SENSOR_SERIAL_TRAIL] =
        isfinite(out->trail.parallel.value)
            ? "median profile behind hot pixels less the one before them, 5 px"
            : "not determined: fewer than 50 isolated hot pixels of 20 standard deviations";
    return median;
}

/* Leaves out traps that do not give the trail. */
static void judge_traps(bst_sensor_figures *out, double misfit, bst_sensor_figure trail,
                        bst_detector_traps_config *traps) {
    if (!(misfit <= MOST_MISFIT * out->figures[trail].value)) {
        *traps = (bst_detector_traps_config){.traps_per_px = {0.0}};
        out->method[trail] =
            "median profile behind hot pixels less the one before them, 5 px; "
            "traps left out: those fitted miss it by more than 30 %";
    }
}

/* Fits traps to certain trails. */
static void fit_traps(dark_signal *d, double median) {
    bst_sensor_figures *out = d->out;
    double ramp = fabs(out->figures[BST_SENSOR_RAMP].value);
    double gain = out->figures[BST_SENSOR_GAIN].value;
    bst_trap_fit_input input = {
        .gain_e_per_dn = gain,
        .background_e = gain * (median + (isfinite(ramp) ? 0.5 * ramp : 0.0))};
    const bst_sensor_estimate *parallel = &out->trail.parallel, *serial = &out->trail.serial;
    bool ramp_up = !(out->figures[BST_SENSOR_RAMP].value < 0.0);
    out->traps.top = !ramp_up;
    if (parallel->value > CERTAIN * parallel->sigma &&
        (!isfinite(ramp) || ramp_up == out->trail.parallel_up)) {
        out->traps.top = !out->trail.parallel_up;
        input.transfers = out->height / 2;
        out->trap_misfit[0] = bst_trap_fit(&out->trail, true, &input, &out->traps.parallel);
        judge_traps(out, out->trap_misfit[0], BST_SENSOR_PARALLEL_TRAIL, &out->traps.parallel);
    }
    if (serial->value > CERTAIN * serial->sigma) {
        out->traps.right = !out->trail.serial_right;
        input.transfers = out->width / 2;
        out->trap_misfit[1] = bst_trap_fit(&out->trail, false, &input, &out->traps.serial);
        judge_traps(out, out->trap_misfit[1], BST_SENSOR_SERIAL_TRAIL, &out->traps.serial);
    }
}

/* Takes the charge that traps deferred back to its pixels. */
static bst_status correct_transfer(bst_ctx *ctx, dark_signal *d) {
    bst_sensor_figures *out = d->out;
    size_t width = (size_t)out->width, pixels = width * (size_t)out->height;
    float gain = (float)out->figures[BST_SENSOR_GAIN].value;
    if (!bst_detector_has_traps(&out->traps.parallel) &&
        !bst_detector_has_traps(&out->traps.serial)) {
        return BST_OK;
    }
    float *image = malloc(3 * pixels * sizeof *image);
    if (!image) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", pixels);
    }
    double ramp = out->figures[BST_SENSOR_RAMP].value / (out->height - 1);
    ramp = isfinite(ramp) ? ramp : 0.0;
    int first = ramp < 0.0 ? out->height - 1 : 0;
    for (size_t i = 0; i < pixels; i++) {
        float e = gain * (d->map[i] + (float)(ramp * ((int)(i / width) - first)));
        image[i] = isnan(e) ? 0.0F : e;
        d->scratch[i] = image[i];
    }
    bst_trap_model_undo(&out->traps, out->width, out->height, image, image + pixels);
    for (size_t i = 0; i < pixels; i++) {
        d->map[i] += (image[i] - d->scratch[i]) / gain;
    }
    free(image);
    return BST_OK;
}

/* Temporal variance of the map without the dark's shot noise, and that common to a row. */
static void measure_map_noise(dark_signal *d) {
    const bst_frame_stack *bias = &d->stacks->bias, *dark = &d->stacks->dark;
    double read = d->out->figures[BST_SENSOR_READ_NOISE].value;
    double row = d->out->figures[BST_SENSOR_ROW_NOISE].value;
    double one = (isfinite(read) ? read * read : 0.0) + (dark->integer ? 1.0 / 12.0 : 0.0);
    double means = 1.0 / dark->count + (bias->count > 0 ? 1.0 / bias->count : 0.0);
    d->row_noise = isfinite(row) ? row * row * means : 0.0;
    d->noise = one * means + d->row_noise;
}

static bst_status measure_all(bst_ctx *ctx, dark_signal *d) {
    bst_sensor_figures *out = d->out;
    double per_s = out->figures[BST_SENSOR_GAIN].value / d->stacks->dark.exposure_s;
    subtract_level(d);
    exclude_shielded(d);
    measure_ramp(d);
    measure_map_noise(d);
    measure_percentiles(d, per_s);
    fit_traps(d, measure_trail(d));
    BST_TRY(correct_transfer(ctx, d));
    bst_clipped_moments core;
    BST_TRY(measure_core(ctx, d, per_s, &core));
    /* standard error of a median: sqrt(pi / 2) of that of a mean; the core's as above */
    out->figures[BST_SENSOR_DARK_MEDIAN].sigma = 1.2533 * out->figures[BST_SENSOR_DARK].sigma;
    measure_readout(d);
    measure_hot(d, &core, per_s);
    if (out->hot_found >= LEAST_HOT && !isfinite(out->figures[BST_SENSOR_HOT_MEDIAN].value)) {
        fit_distribution(d, per_s);
    }
    size_t pixels = (size_t)out->width * (size_t)out->height;
    for (size_t i = 0; i < pixels; i++) {
        d->map[i] *= (float)per_s;
    }
    return BST_OK;
}

bst_status bst_sensor_measure_dark(bst_ctx *ctx, const bst_sensor_stacks *s,
                                   bst_sensor_figures *out) {
    if (s->dark.count == 0 || !bst_sensor_has_level(s) || !(s->dark.exposure_s > 0.0)) {
        for (int i = BST_SENSOR_DARK; i <= BST_SENSOR_HOT_SPREAD; i++) {
            out->method[i] = "not determined: needs darks, and bias frames or an overscan";
        }
        out->method[BST_SENSOR_READOUT] = out->method[BST_SENSOR_PARALLEL_TRAIL] =
            out->method[BST_SENSOR_SERIAL_TRAIL] = out->method[BST_SENSOR_DARK];
        if (!isfinite(out->figures[BST_SENSOR_RAMP].value)) {
            out->method[BST_SENSOR_RAMP] = out->method[BST_SENSOR_DARK];
        }
        return BST_OK;
    }
    size_t pixels = (size_t)out->width * (size_t)out->height;
    dark_signal d = {.stacks = s, .out = out};
    out->dark_map = d.map = malloc(pixels * sizeof *d.map);
    d.scratch = malloc(pixels * sizeof *d.scratch);
    bst_status status = d.map && d.scratch
                            ? measure_all(ctx, &d)
                            : bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", pixels);
    free(d.scratch);
    return status;
}
