/* Read noise, level, fixed offsets and pick-up of a sensor. */
#include <math.h>
#include <stdlib.h>

#include "sim/analysis/characterize/sensor_figures.h"

/* Variance of rounding to whole numbers, DN^2. */
static const double ROUNDING = 1.0 / 12.0;
static const double CLIP = 5.0;
/* Least significance of a ramp over the rows. */
static const double CERTAIN = 5.0;

/* Read noise by pairs of bias frames. */
static void noise_of_pairs(const bst_frame_stack *bias, bst_sensor_figures *out) {
    bst_sensor_estimate v = bst_mean_estimate(bias->variance, BST_STACK_BLOCKS);
    v.value -= bias->integer ? ROUNDING : 0.0;
    out->figures[BST_SENSOR_READ_NOISE] = bst_root_estimate(v);
    out->method[BST_SENSOR_READ_NOISE] = "differences of pairs of bias frames";
    /* the variance of H row means, chi-square with H - 1 degrees of freedom, of each pair */
    double within = v.value / bias->width;
    bst_sensor_estimate rows = {bias->row_variance, sqrt(2.0 / (bias->height - 1) / bias->pairs) *
                                                        (fmax(bias->row_variance, 0.0) + within)};
    out->figures[BST_SENSOR_ROW_NOISE] = bst_root_estimate(rows);
    out->method[BST_SENSOR_ROW_NOISE] = "means of rows in differences of pairs of bias frames";
}

/* Read noise by differences of neighbouring columns, in eight parts of the rows. */
static void noise_of_neighbours(const float *pixels, int width, int height, bool integer,
                                float *scratch, bst_sensor_figures *out) {
    enum { PARTS = 8 };
    double variances[PARTS];
    for (int part = 0; part < PARTS; part++) {
        size_t n = 0;
        for (int y = part * height / PARTS; y < (part + 1) * height / PARTS; y++) {
            const float *row = pixels + (size_t)y * (size_t)width;
            for (int x = 1; x < width; x++) {
                scratch[n++] = row[x] - row[x - 1];
            }
        }
        double sigma = bst_robust_sigma(scratch, n);
        variances[part] = 0.5 * sigma * sigma;
    }
    bst_sensor_estimate v = bst_mean_estimate(variances, PARTS);
    v.value -= integer ? 1.5 * ROUNDING : 0.0; /* of both pixels, and of their spread in between */
    out->figures[BST_SENSOR_READ_NOISE] = bst_root_estimate(v);
}

/* Subtracts a line through values with a certain slope. Returns its rise from the first to the last
 * value; NAN: none. */
static bst_sensor_estimate subtract_line(double *values, int count) {
    double middle = 0.5 * (count - 1), sxx = middle * (count + 1) * count / 6.0, b = 0.0,
           rest = 0.0;
    double mean = 0.0;
    for (int i = 0; i < count; i++) {
        mean += values[i] / count;
        b += (i - middle) * values[i] / sxx;
    }
    for (int i = 0; i < count; i++) {
        double r = values[i] - mean - b * (i - middle);
        rest += r * r / (count - 2);
    }
    double sigma = sqrt(rest / sxx);
    if (!(fabs(b) > CERTAIN * sigma) || fabs(b) * (count - 1) < 0.5) {
        return (bst_sensor_estimate){NAN, NAN};
    }
    for (int i = 0; i < count; i++) {
        values[i] -= b * (i - middle);
    }
    return (bst_sensor_estimate){b * (count - 1), sigma * (count - 1)};
}

/* Mean of each column or row of a map, clipped, and the variance among them; of rows, the ramp is
 * not part of it. */
static bst_sensor_estimate offsets_of(const float *map, int width, int height, bool columns,
                                      double noise, float *scratch, bst_sensor_estimate *ramp) {
    int lines = columns ? width : height, along = columns ? height : width;
    size_t step = columns ? (size_t)width : 1, next = columns ? 1 : (size_t)width;
    double *means = malloc((size_t)lines * sizeof *means);
    if (!means) {
        return (bst_sensor_estimate){NAN, NAN};
    }
    double mean = 0.0, variance = 0.0;
    for (int i = 0; i < lines; i++) {
        for (int k = 0; k < along; k++) {
            scratch[k] = map[(size_t)i * next + (size_t)k * step];
        }
        means[i] = bst_clipped_moments_of(scratch, (size_t)along, CLIP).mean;
        mean += means[i] / lines;
    }
    if (ramp) {
        *ramp = subtract_line(means, lines);
    }
    for (int i = 0; i < lines; i++) {
        variance += (means[i] - mean) * (means[i] - mean) / (lines - 1);
    }
    free(means);
    return bst_root_estimate(
        (bst_sensor_estimate){variance - noise, sqrt(2.0 / (lines - 1)) * variance});
}

/* Standard error of the level from blocks of a frame without its ramp. */
static double offset_error(const float *mean, int width, int height, double ramp, float *scratch) {
    double parts[BST_STACK_BLOCKS];
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        int from = (int)((int64_t)k * height / BST_STACK_BLOCKS);
        int to = (int)((int64_t)(k + 1) * height / BST_STACK_BLOCKS);
        size_t n = 0;
        for (int y = from; y < to; y++) {
            for (int x = 0; x < width; x++) {
                double line = ramp * y / (height - 1.0);
                scratch[n++] = mean[(size_t)y * (size_t)width + (size_t)x] - (float)line;
            }
        }
        parts[k] = bst_clipped_moments_of(scratch, n, CLIP).mean;
    }
    return bst_mean_estimate(parts, BST_STACK_BLOCKS).sigma;
}

/* Level of the bias frames, its drift, and fixed offsets of columns and rows. */
static void measure_level(const bst_frame_stack *bias, float *scratch, bst_sensor_figures *out) {
    double means[BST_STACK_BLOCKS], n = bias->count;
    bst_sensor_block_moments(bias->mean, bias->width, bias->height, CLIP, scratch, means, NULL);
    bst_sensor_estimate level = bst_mean_estimate(means, BST_STACK_BLOCKS);
    double pixel =
        bias->pairs > 0 ? bst_mean_estimate(bias->variance, BST_STACK_BLOCKS).value : 0.0;
    double row = bias->pairs > 0 ? fmax(bias->row_variance, 0.0) : 0.0;
    bst_sensor_estimate ramp = {NAN, NAN};
    bst_sensor_estimate column = offsets_of(bias->mean, bias->width, bias->height, true,
                                            pixel / n / bias->height, scratch, NULL);
    bst_sensor_estimate fixed_row = offsets_of(bias->mean, bias->width, bias->height, false,
                                               pixel / n / bias->width + row / n, scratch, &ramp);
    if (isfinite(ramp.value)) { /* the level is that of the row that is read first */
        out->figures[BST_SENSOR_RAMP] = ramp;
        out->method[BST_SENSOR_RAMP] = "line through the rows of the mean bias frame";
        level.value -= 0.5 * fabs(ramp.value);
        level.sigma = offset_error(bias->mean, bias->width, bias->height, ramp.value, scratch);
    }
    if (bias->pairs > 0) {
        out->figures[BST_SENSOR_COLUMN_OFFSET] = column;
        out->figures[BST_SENSOR_ROW_OFFSET] = fixed_row;
        out->method[BST_SENSOR_COLUMN_OFFSET] = "means of columns of the mean bias frame";
        out->method[BST_SENSOR_ROW_OFFSET] = "means of rows of the mean bias frame";
    }
    /* offsets of columns and rows are drawn once: blocks in a column share them */
    double columns = isfinite(column.value) ? column.value * column.value : 0.0;
    double rows = isfinite(fixed_row.value) ? fixed_row.value * fixed_row.value : 0.0;
    level.sigma =
        sqrt(level.sigma * level.sigma + columns / bias->width + (rows + row / n) / bias->height);
    out->figures[BST_SENSOR_OFFSET] = level;
    out->method[BST_SENSOR_OFFSET] = "mean of the bias frames";
    if (bias->count < 3) {
        out->method[BST_SENSOR_OFFSET_DRIFT] = "not determined: needs three bias frames";
        return;
    }
    double middle = 0.5 * (n - 1.0), mean = 0.0, slope = 0.0, rest = 0.0;
    for (int i = 0; i < bias->count; i++) {
        mean += bias->levels[i] / n;
        slope += (i - middle) * bias->levels[i] / (n * (n * n - 1.0) / 12.0);
    }
    for (int i = 0; i < bias->count; i++) {
        double d = bias->levels[i] - mean - slope * (i - middle);
        rest += d * d / (n - 2.0);
    }
    out->figures[BST_SENSOR_OFFSET_DRIFT] =
        (bst_sensor_estimate){slope, sqrt(rest / (n * (n * n - 1.0) / 12.0))};
    out->method[BST_SENSOR_OFFSET_DRIFT] = "line through the levels of the bias frames";
}

/* Last frame, or its difference from the mean of all, without the levels of its rows and columns.
 * The difference lacks fixed patterns, but also pick-up of equal phases. */
static void level_rows(const bst_frame_stack *s, bool difference, float *rows, float *scratch) {
    size_t width = (size_t)s->width;
    for (int y = 0; y < s->height; y++) {
        size_t at = (size_t)y * width;
        for (size_t x = 0; x < width; x++) {
            rows[at + x] = s->last[at + x] - (difference ? s->mean[at + x] : 0.0F);
            scratch[x] = rows[at + x];
        }
        float level = (float)bst_clipped_moments_of(scratch, width, CLIP).mean;
        for (size_t x = 0; x < width; x++) {
            rows[at + x] -= level;
        }
    }
    for (size_t x = 0; x < width; x++) {
        for (int y = 0; y < s->height; y++) {
            scratch[y] = rows[(size_t)y * width + x];
        }
        float level = (float)bst_clipped_moments_of(scratch, (size_t)s->height, CLIP).mean;
        for (int y = 0; y < s->height; y++) {
            rows[(size_t)y * width + x] -= level;
        }
    }
}

/* Coherent pick-up in the rows of the frames with the least noise. */
static bst_status measure_line(bst_ctx *ctx, const bst_frame_stack *s, float *scratch,
                               bst_sensor_figures *out) {
    size_t pixels = (size_t)s->width * (size_t)s->height;
    float *rows = malloc(pixels * sizeof *rows);
    if (!rows) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", pixels);
    }
    level_rows(s, s->count > 1, rows, scratch);
    bst_status status = bst_pick_up_line_find(ctx, rows, s->width, s->height, &out->line);
    if (status == BST_OK && s->count > 1) {
        level_rows(s, false, rows, scratch);
        if (out->line.found) {
            status = bst_pick_up_line_amplitude(ctx, rows, s->width, s->height, &out->line);
        } else { /* what the differences lack has one phase in all frames */
            free(out->line.power);
            status = bst_pick_up_line_find(ctx, rows, s->width, s->height, &out->line);
            out->line.locked = status == BST_OK && out->line.found;
        }
        if (out->line.locked) {
            out->line.phase_deg = bst_pick_up_line_phase_deg(rows, s->width, s->height, &out->line);
        }
        if (status == BST_OK && out->line.found && s->pairs > 0) {
            out->line.pair_power =
                bst_pick_up_line_power(s->covariance, BST_STACK_LAGS, out->line.frequency.value);
        }
    }
    free(rows);
    BST_TRY(status);
    out->figures[BST_SENSOR_LINE_FREQUENCY] = out->line.frequency;
    out->figures[BST_SENSOR_LINE_AMPLITUDE] = out->line.amplitude;
    const char *how = out->line.found ? "mean spectrum of the rows"
                                      : "none: no line above 7 standard deviations of the spectrum";
    out->method[BST_SENSOR_LINE_FREQUENCY] = out->method[BST_SENSOR_LINE_AMPLITUDE] = how;
    out->figures[BST_SENSOR_LINE_PHASE] = out->line.phase;
    out->method[BST_SENSOR_LINE_PHASE] =
        out->line.found && isnan(out->line.phase.value)
            ? "none: less than half of the line's power has one phase from row to row"
            : how;
    return BST_OK;
}

bst_status bst_sensor_measure_noise(bst_ctx *ctx, const bst_sensor_stacks *s,
                                    bst_sensor_figures *out) {
    size_t pixels = (size_t)out->width * (size_t)out->height;
    size_t overscan = (size_t)s->dark.overscan_width * (size_t)out->height;
    float *scratch = malloc((pixels > overscan ? pixels : overscan) * sizeof *scratch);
    if (!scratch) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", pixels);
    }
    if (s->bias.pairs > 0) {
        noise_of_pairs(&s->bias, out);
        out->noise_of_pairs = true;
    } else if (s->dark.count > 0 && s->dark.overscan_width > 1) {
        noise_of_neighbours(s->dark.overscan, s->dark.overscan_width, s->dark.height,
                            s->dark.integer, scratch, out);
        out->method[BST_SENSOR_READ_NOISE] = "differences of neighbours in the overscan";
    } else if (s->bias.count > 0) {
        noise_of_neighbours(s->bias.mean, s->bias.width, s->bias.height, s->bias.integer, scratch,
                            out);
        out->method[BST_SENSOR_READ_NOISE] = "differences of neighbours in the bias frame";
    } else {
        out->method[BST_SENSOR_READ_NOISE] = "not determined: needs bias frames or an overscan";
    }
    if (s->bias.count > 0) {
        measure_level(&s->bias, scratch, out);
    } else if (overscan > 0) {
        double rows[8];
        for (int part = 0; part < 8; part++) {
            size_t from = overscan * (size_t)part / 8, to = overscan * (size_t)(part + 1) / 8;
            for (size_t i = from; i < to; i++) {
                scratch[i - from] = s->dark.overscan[i];
            }
            rows[part] = bst_clipped_moments_of(scratch, to - from, CLIP).mean;
        }
        out->figures[BST_SENSOR_OFFSET] = bst_mean_estimate(rows, 8);
        out->method[BST_SENSOR_OFFSET] = "mean of the overscan";
    } else {
        out->method[BST_SENSOR_OFFSET] = "not determined: needs bias frames or an overscan";
    }
    const bst_frame_stack *quiet = s->bias.count > 0   ? &s->bias
                                   : s->dark.count > 0 ? &s->dark
                                                       : NULL;
    bst_status status = quiet ? measure_line(ctx, quiet, scratch, out) : BST_OK;
    free(scratch);
    return status;
}
