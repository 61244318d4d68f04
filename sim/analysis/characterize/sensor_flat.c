/* Gain by photon transfer, response of the pixels. */
#include <math.h>
#include <stdlib.h>

#include "sim/analysis/characterize/sensor_figures.h"

/* Least run of dead pixels from an end of a column that makes the column bad. */
enum { LEAST_RUN = 8 };
/* A pixel below this share of its block is dead. */
static const float DEAD = 0.5F;
static const double CLIP = 5.0;

/* Least significance of a gain that replaces the header's. */
static const double CERTAIN = 2.0;

/* What is subtracted from the mean flat: share_bias bias frames and share_dark darks. */
typedef struct flat_level {
    double share_bias, share_dark;
    float *mean; /* [height][width] DN */
} flat_level;

/* Shares of the frames that are subtracted: darks of the flats' exposure are best, then bias frames
 * with the dark signal scaled to it, then bias frames. Returns false: the frames say none. */
static bool find_level(const bst_sensor_stacks *s, flat_level *out) {
    double dark_s = s->dark.exposure_s, flat_s = s->flat.exposure_s;
    /* the tolerance of frames of one kind */
    if (s->dark.count > 0 && fabs(dark_s - flat_s) <= 1e-3 * flat_s + 1e-6) {
        *out = (flat_level){.share_dark = 1.0};
        return true;
    }
    double ratio = s->dark.count > 0 && dark_s > 0.0 && flat_s >= 0.0 ? flat_s / dark_s : 0.0;
    *out = (flat_level){.share_bias = 1.0 - ratio, .share_dark = ratio};
    return s->bias.count > 0;
}

/* Ratio of the sums of two lists; the standard error by leaving out each block in turn. */
static bst_sensor_estimate ratio_of_sums(const double *above, const double *below, int count) {
    double a = 0.0, b = 0.0, rest = 0.0;
    int n = 0;
    for (int i = 0; i < count; i++) {
        if (isfinite(above[i]) && isfinite(below[i])) {
            a += above[i];
            b += below[i];
            n++;
        }
    }
    for (int i = 0; i < count; i++) {
        if (isfinite(above[i]) && isfinite(below[i])) {
            double d = (a - above[i]) / (b - below[i]) - a / b;
            rest += d * d * (n - 1.0) / n;
        }
    }
    return n > 1 ? (bst_sensor_estimate){a / b, sqrt(rest)} : (bst_sensor_estimate){NAN, NAN};
}

/* Gain by the variance between flats, with what neighbours share, against their level. A mean of
 * the blocks' ratios would be too large, since the noise stands in the denominator. */
static void measure_gain(const bst_sensor_stacks *s, float *scratch, bst_sensor_figures *out) {
    const bst_frame_stack *quiet = s->bias.pairs > 0   ? &s->bias
                                   : s->dark.pairs > 0 ? &s->dark
                                                       : NULL;
    double charge[BST_STACK_BLOCKS], below[BST_STACK_BLOCKS], excess[BST_STACK_BLOCKS];
    if (s->flat.pairs == 0 || !quiet || !out->gain_of_header) { /* a series gave the gain */
        return;
    }
    /* charge that has shot noise: all above the level whose variance is subtracted */
    bst_sensor_block_moments(s->flat.mean, out->width, out->height, CLIP, scratch, charge, NULL);
    bst_sensor_block_moments(quiet->mean, out->width, out->height, CLIP, scratch, below, NULL);
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        charge[k] -= below[k];
        excess[k] = s->flat.variance[k] - quiet->variance[k];
    }
    bst_shared_noise shared = {.excess = 0.0};
    bst_shared_noise_add(&shared, 1.0, &s->flat.neighbours,
                         bst_mean_estimate(s->flat.variance, BST_STACK_BLOCKS).value,
                         &quiet->neighbours,
                         bst_mean_estimate(quiet->variance, BST_STACK_BLOCKS).value);
    bst_sensor_estimate gain = bst_sensor_ratio(ratio_of_sums(charge, excess, BST_STACK_BLOCKS),
                                                bst_shared_noise_factor(&shared));
    if (!(gain.value > CERTAIN * gain.sigma && gain.sigma > 0.0)) {
        out->method[BST_SENSOR_GAIN] =
            "header or map: the noise of the flats is not above that of the others";
        return;
    }
    out->figures[BST_SENSOR_GAIN] = gain;
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

/* Block of a pixel. */
static int block_of(size_t i, const bst_sensor_figures *f) {
    int x = (int)(i % (size_t)f->width), y = (int)(i / (size_t)f->width);
    return bst_stack_block_of(x, y, f->width, f->height);
}

/* Counts columns that are dead from one end on, and dead pixels elsewhere.
 *
 * Given:     hot  [BST_STACK_BLOCKS] level above which a pixel is hot */
static void measure_dead(float *map, const flat_level *level, const double *hot,
                         bst_sensor_figures *out) {
    int bad = 0;
    int64_t dead = 0, good = 0;
    size_t pixels = (size_t)out->width * (size_t)out->height;
    for (size_t i = 0; i < pixels; i++) { /* a hot pixel may be full in a flat, and is not dead */
        map[i] = map[i] < DEAD && level->mean[i] > hot[block_of(i, out)] ? 1.0F : map[i];
    }
    for (int x = 0; x < out->width; x++) {
        int run[2] = {0, 0}, count = 0;
        for (int end = 0; end < 2; end++) {
            /* one in 16 and one more may be hot, which shows light of its own */
            for (int k = 0; k < out->height && k - run[end] <= 1 + k / 16; k++) {
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

/* Signals spread by other shares than charges where the response bends. */
static void free_of_non_linearity(double signal_dn, bst_sensor_figures *out) {
    double slope = out->linearity.used > 0 ? bst_linearity_slope(&out->linearity, signal_dn) : NAN;
    if (slope > 0.5 && slope < 2.0) {
        out->figures[BST_SENSOR_PRNU].value /= slope;
        out->figures[BST_SENSOR_PRNU].sigma /= slope;
        for (size_t i = 0; i < (size_t)out->width * (size_t)out->height; i++) {
            out->prnu_map[i] = (float)(1.0 + ((double)out->prnu_map[i] - 1.0) / slope);
        }
    }
}

/* Light of a pixel over that of its block. */
static float relative_to(const bst_sensor_stacks *s, const flat_level *level, const double *signal,
                         int block, size_t i) {
    return (float)((s->flat.mean[i] - level->mean[i]) / signal[block]);
}

/* Spread of the response in blocks, and the map of the response. */
static void measure_response(const bst_sensor_stacks *s, const flat_level *level, float *scratch,
                             bst_sensor_figures *out) {
    double means[BST_STACK_BLOCKS], variances[BST_STACK_BLOCKS], signal[BST_STACK_BLOCKS],
        hot[BST_STACK_BLOCKS];
    float *map = out->prnu_map;
    size_t pixels = (size_t)out->width * (size_t)out->height;
    bst_sensor_block_moments(s->flat.mean, out->width, out->height, CLIP, scratch, signal, NULL);
    bst_sensor_block_moments(level->mean, out->width, out->height, CLIP, scratch, means, variances);
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        signal[k] -= means[k];
        hot[k] = means[k] + CLIP * sqrt(variances[k]); /* the limit of the clipped mean */
    }
    /* a hot pixel's charge has shot noise of its own, and lies elsewhere on a bent response */
    for (size_t i = 0; i < pixels; i++) {
        int k = block_of(i, out);
        map[i] = level->mean[i] > hot[k] ? NAN : relative_to(s, level, signal, k, i);
    }
    bst_sensor_block_moments(map, out->width, out->height, CLIP, scratch, means, variances);
    for (size_t i = 0; i < pixels; i++) {
        map[i] = relative_to(s, level, signal, block_of(i, out), i);
    }
    const double shares[] = {level->share_bias, level->share_dark};
    const bst_frame_stack *const stacks[] = {&s->bias, &s->dark};
    double level_noise = 0.0;
    for (int i = 0; i < 2; i++) {
        level_noise +=
            shares[i] != 0.0 ? shares[i] * shares[i] * noise_of(stacks[i], 0.0, out) : 0.0;
    }
    double prnu[BST_STACK_BLOCKS];
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        double noise = noise_of(&s->flat, signal[k], out) + level_noise;
        prnu[k] = variances[k] - noise / (signal[k] * signal[k]);
    }
    out->figures[BST_SENSOR_PRNU] = bst_root_estimate(bst_mean_estimate(prnu, BST_STACK_BLOCKS));
    free_of_non_linearity(bst_mean_estimate(signal, BST_STACK_BLOCKS).value, out);
    out->method[BST_SENSOR_PRNU] = "scatter of the mean flat in 8 x 8 blocks, less its noise";
    measure_dead(map, level, hot, out);
}

bst_status bst_sensor_measure_flat(bst_ctx *ctx, const bst_sensor_stacks *s,
                                   bst_sensor_figures *out) {
    flat_level level;
    bool has_level = find_level(s, &level);
    if (s->flat.count == 0 || !has_level) {
        out->method[BST_SENSOR_PRNU] = out->method[BST_SENSOR_DEAD_FRACTION] =
            out->method[BST_SENSOR_BAD_COLUMNS] =
                "not determined: needs flats, and bias frames or darks of the flats' exposure";
    }
    if (s->flat.count == 0) {
        return BST_OK;
    }
    size_t pixels = (size_t)out->width * (size_t)out->height;
    float *scratch = malloc(pixels * sizeof *scratch);
    level.mean = malloc(pixels * sizeof *level.mean);
    out->prnu_map = has_level ? malloc(pixels * sizeof *out->prnu_map) : NULL;
    bool room = scratch && level.mean && (out->prnu_map || !has_level);
    if (room) {
        measure_gain(s, scratch, out);
    }
    if (room && has_level) {
        for (size_t i = 0; i < pixels; i++) {
            double bias = level.share_bias != 0.0 ? level.share_bias * s->bias.mean[i] : 0.0;
            double dark = level.share_dark != 0.0 ? level.share_dark * s->dark.mean[i] : 0.0;
            level.mean[i] = (float)(bias + dark);
        }
        measure_response(s, &level, scratch, out);
    }
    free(scratch);
    free(level.mean);
    return room ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", pixels);
}
