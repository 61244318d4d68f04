/* Gain by photon transfer, response of the pixels. */
#include <math.h>
#include <stdlib.h>

#include "sim/analysis/characterize/sensor_figures.h"

/* Least run of dead pixels from an end of a column that makes the column bad. */
enum { LEAST_RUN = 8 };
/* A pixel below this share of its block is dead. */
static const float DEAD = 0.5F;
/* A pixel this much above the level in darks is hot: its response is not known. */
static const double HOT = 2.0;
static const double CLIP = 5.0;

/* Level that is subtracted from flats: darks are best, then bias frames. */
static const bst_frame_stack *level_of(const bst_sensor_stacks *s) {
    return s->dark.count > 0 ? &s->dark : s->bias.count > 0 ? &s->bias : NULL;
}

/* Gain by the variance between flats against their level. */
static void measure_gain(const bst_sensor_stacks *s, const double *signal,
                         bst_sensor_figures *out) {
    const bst_frame_stack *quiet = s->bias.pairs > 0   ? &s->bias
                                   : s->dark.pairs > 0 ? &s->dark
                                                       : NULL;
    double gains[BST_STACK_BLOCKS];
    if (s->flat.pairs == 0 || !quiet) {
        return;
    }
    double level = bst_mean_estimate(quiet->variance, BST_STACK_BLOCKS).value;
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        gains[k] = signal[k] / (s->flat.variance[k] - level);
    }
    out->figures[BST_SENSOR_GAIN] = bst_mean_estimate(gains, BST_STACK_BLOCKS);
    out->method[BST_SENSOR_GAIN] = "photon transfer: variance between pairs of flats";
    out->gain_of_header = false;
}

/* Temporal variance of the mean of a stack; by the noise model if it has no pairs. */
static double noise_of(const bst_frame_stack *f, double signal_dn, const bst_sensor_figures *out) {
    double read = out->figures[BST_SENSOR_READ_NOISE].value;
    double one = f->pairs > 0 ? bst_mean_estimate(f->variance, BST_STACK_BLOCKS).value
                              : (isfinite(read) ? read * read : 0.0) + 1.0 / 12.0 +
                                    fmax(signal_dn, 0.0) / out->figures[BST_SENSOR_GAIN].value;
    double rows = f->pairs > 0 ? fmax(f->row_variance, 0.0) : 0.0;
    return (one + rows) / f->count;
}

/* Counts columns that are dead from one end on, and dead pixels elsewhere. */
static void measure_dead(float *map, const bst_frame_stack *level, bst_sensor_figures *out) {
    int bad = 0;
    int64_t dead = 0, good = 0;
    size_t pixels = (size_t)out->width * (size_t)out->height;
    for (size_t i = 0; i < pixels; i++) { /* a hot pixel may be full in a flat, and is not dead */
        map[i] = map[i] < DEAD && level->mean[i] > HOT * out->figures[BST_SENSOR_OFFSET].value
                     ? 1.0F
                     : map[i];
    }
    for (int x = 0; x < out->width; x++) {
        int run[2] = {0, 0}, count = 0;
        for (int end = 0; end < 2; end++) {
            for (int k = 0; k < out->height && run[end] == k; k++) {
                int y = end ? out->height - 1 - k : k;
                run[end] += map[(size_t)y * (size_t)out->width + (size_t)x] < DEAD;
            }
        }
        if (run[0] >= LEAST_RUN || run[1] >= LEAST_RUN) {
            bad++;
            continue;
        }
        for (int y = 0; y < out->height; y++) {
            count += map[(size_t)y * (size_t)out->width + (size_t)x] < DEAD;
        }
        dead += count;
        good += out->height;
    }
    double share = good > 0 ? (double)dead / (double)good : NAN;
    out->figures[BST_SENSOR_DEAD_FRACTION] =
        (bst_sensor_estimate){share, sqrt(fmax((double)dead, 1.0)) / (double)good};
    out->figures[BST_SENSOR_BAD_COLUMNS] = (bst_sensor_estimate){bad, 0.0};
    out->method[BST_SENSOR_DEAD_FRACTION] = "pixels below half of the flat around them";
    out->method[BST_SENSOR_BAD_COLUMNS] = "columns with 8 dead pixels or more from an end on";
}

/* Spread of the response in blocks, and the map of the response. */
static void measure_response(const bst_sensor_stacks *s, const double *signal, float *scratch,
                             bst_sensor_figures *out) {
    const bst_frame_stack *level = level_of(s);
    double means[BST_STACK_BLOCKS], variances[BST_STACK_BLOCKS], prnu[BST_STACK_BLOCKS];
    float *map = out->prnu_map;
    size_t width = (size_t)out->width;
    for (size_t i = 0; i < width * (size_t)out->height; i++) {
        int x = (int)(i % width), y = (int)(i / width);
        int block = (int)((int64_t)x * BST_STACK_SIDE / out->width) +
                    BST_STACK_SIDE * (int)((int64_t)y * BST_STACK_SIDE / out->height);
        map[i] = (float)((s->flat.mean[i] - level->mean[i]) / signal[block]);
    }
    bst_sensor_block_moments(map, out->width, out->height, CLIP, scratch, means, variances);
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        double noise = noise_of(&s->flat, signal[k], out) + noise_of(level, 0.0, out);
        prnu[k] = variances[k] - noise / (signal[k] * signal[k]);
    }
    bst_sensor_estimate v = bst_mean_estimate(prnu, BST_STACK_BLOCKS);
    double value = sqrt(fmax(v.value, 0.0));
    out->figures[BST_SENSOR_PRNU] =
        (bst_sensor_estimate){value, 0.5 * v.sigma / sqrt(fmax(fabs(v.value), v.sigma))};
    out->method[BST_SENSOR_PRNU] = "scatter of the mean flat in 8 x 8 blocks, less its noise";
    measure_dead(map, level, out);
}

bst_status bst_sensor_measure_flat(bst_ctx *ctx, const bst_sensor_stacks *s,
                                   bst_sensor_figures *out) {
    const bst_frame_stack *level = level_of(s);
    if (s->flat.count == 0 || !level) {
        out->method[BST_SENSOR_PRNU] = out->method[BST_SENSOR_DEAD_FRACTION] =
            out->method[BST_SENSOR_BAD_COLUMNS] =
                "not determined: needs flats, and darks or bias "
                "frames";
        return BST_OK;
    }
    size_t pixels = (size_t)out->width * (size_t)out->height;
    float *scratch = malloc(pixels * sizeof *scratch);
    double signal[BST_STACK_BLOCKS], below[BST_STACK_BLOCKS], shot[BST_STACK_BLOCKS];
    out->prnu_map = malloc(pixels * sizeof *out->prnu_map);
    if (!scratch || !out->prnu_map) {
        free(scratch);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", pixels);
    }
    bst_sensor_block_moments(s->flat.mean, out->width, out->height, CLIP, scratch, signal, NULL);
    /* charge that has shot noise: all above the level whose variance is subtracted */
    const bst_frame_stack *quiet = s->bias.pairs > 0 ? &s->bias : level;
    bst_sensor_block_moments(quiet->mean, out->width, out->height, CLIP, scratch, below, NULL);
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        shot[k] = signal[k] - below[k];
    }
    measure_gain(s, shot, out);
    bst_sensor_block_moments(level->mean, out->width, out->height, CLIP, scratch, below, NULL);
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        signal[k] -= below[k];
    }
    measure_response(s, signal, scratch, out);
    free(scratch);
    return BST_OK;
}
