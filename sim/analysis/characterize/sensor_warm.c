/* Dark current by temperature, of darks at two temperatures. */
#include <math.h>
#include <stdlib.h>

#include "sim/analysis/characterize/sensor_figures.h"

static const double CLIP = 5.0;

/* Dark current of each block, DN/s. */
static void rates_of(const bst_frame_stack *darks, const double *level, float *scratch,
                     double *rates) {
    bst_sensor_block_moments(darks->mean, darks->width, darks->height, CLIP, scratch, rates, NULL);
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        rates[k] = (rates[k] - level[k]) / darks->exposure_s;
    }
}

/* Variance of the logarithm of warm / cold, DN/s, by errors that all blocks have: noise of rows,
 * columns of blocks share it, and of frames. The level is subtracted from both. */
static double common_variance(const bst_sensor_stacks *s, double warm, double cold) {
    const bst_frame_stack *const stacks[] = {&s->warm, &s->dark, &s->bias};
    const double to_warm = 1.0 / (warm * s->warm.exposure_s),
                 to_cold = 1.0 / (cold * s->dark.exposure_s),
                 slope[] = {to_warm, -to_cold, to_cold - to_warm};
    double sum = 0.0, weight = 0.0, variance = 0.0;
    for (int i = 0; i < 3; i++) {
        sum += (stacks[i]->count - 1) * bst_frame_stack_level_variance(stacks[i]);
        weight += stacks[i]->count - 1;
    }
    for (int i = 0; i < 3 && weight > 0.0; i++) {
        variance += slope[i] * slope[i] * sum / weight / stacks[i]->count;
    }
    return variance;
}

bst_status bst_sensor_measure_warm(bst_ctx *ctx, const bst_sensor_stacks *s,
                                   bst_sensor_figures *out) {
    const char **method = &out->method[BST_SENSOR_DARK_DOUBLING];
    *method = "not determined: needs bias frames, darks, and darks at another temperature (--warm)";
    if (s->warm.count == 0 || s->dark.count == 0 || s->bias.count == 0 ||
        !(s->dark.exposure_s > 0.0) || !(s->warm.exposure_s > 0.0)) {
        return BST_OK;
    }
    size_t pixels = (size_t)out->width * (size_t)out->height;
    float *scratch = malloc(pixels * sizeof *scratch);
    if (!scratch) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", pixels);
    }
    double level[BST_STACK_BLOCKS], cold[BST_STACK_BLOCKS], warm[BST_STACK_BLOCKS];
    bst_sensor_block_moments(s->bias.mean, out->width, out->height, CLIP, scratch, level, NULL);
    rates_of(&s->dark, level, scratch, cold);
    rates_of(&s->warm, level, scratch, warm);
    free(scratch);
    /* sums, as a mean of ratios would be too large; error by leaving out each block in turn, and of
     * what is common to the blocks */
    double a = 0.0, b = 0.0, rest = 0.0;
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        a += warm[k];
        b += cold[k];
    }
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        double d = log((a - warm[k]) / (b - cold[k])) - log(a / b);
        rest += d * d * (BST_STACK_BLOCKS - 1.0) / BST_STACK_BLOCKS;
    }
    rest += common_variance(s, a / BST_STACK_BLOCKS, b / BST_STACK_BLOCKS);
    double growth = log(a / b), value = s->warmer_k * log(2.0) / growth;
    if (!(fabs(growth) > 5.0 * sqrt(rest)) || !(value > 0.0)) {
        *method = "none: the dark current does not grow with the temperature for certain";
        return BST_OK;
    }
    out->figures[BST_SENSOR_DARK_DOUBLING] =
        (bst_sensor_estimate){value, value * sqrt(rest) / fabs(growth)};
    *method = "dark currents at two temperatures, pixels that are not hot";
    return BST_OK;
}
