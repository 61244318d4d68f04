#include "sim/analysis/characterize/sensor_figures.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

const double bst_sensor_percentiles[BST_SENSOR_PERCENTILES] = {5, 16, 50, 84, 95, 99, 99.9, 99.99};

/* Converts an estimate from DN to electrons; the error of the gain is part of it. */
static void scale(bst_sensor_figures *f, bst_sensor_figure which) {
    const bst_sensor_estimate *gain = &f->figures[BST_SENSOR_GAIN];
    bst_sensor_estimate *e = &f->figures[which];
    double relative = gain->sigma > 0.0 ? gain->sigma / gain->value : 0.0;
    e->sigma = hypot(e->sigma * gain->value, e->value * gain->value * relative);
    e->value *= gain->value;
}

/* First stack with frames. */
static const bst_frame_stack *first_stack(const bst_sensor_stacks *s) {
    return s->bias.count > 0 ? &s->bias : s->dark.count > 0 ? &s->dark : &s->flat;
}

static bst_status check_sizes(bst_ctx *ctx, const bst_sensor_stacks *s) {
    const bst_frame_stack *first = first_stack(s);
    const bst_frame_stack *const all[] = {&s->bias, &s->dark, &s->flat, &s->warm};
    const char *const names[] = {"bias", "dark", "flat", "warm dark"};
    for (int i = 0; i < 4; i++) {
        if (all[i]->count > 0 &&
            (all[i]->width != first->width || all[i]->height != first->height)) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "the %s frames have %d x %d pixels, others %d x %d (allowed: frames of "
                            "one sensor and size)",
                            names[i], all[i]->width, all[i]->height, first->width, first->height);
        }
    }
    if (s->linearity.count > 0 &&
        (s->linearity.width != first->width || s->linearity.height != first->height)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "the flats of several exposures have %d x %d pixels, others %d x %d "
                        "(allowed: frames of one sensor and size)",
                        s->linearity.width, s->linearity.height, first->width, first->height);
    }
    return BST_OK;
}

bst_status bst_sensor_figures_compute(bst_ctx *ctx, const bst_sensor_stacks *stacks,
                                      bst_sensor_figures *out) {
    assert(stacks && out);
    const bst_frame_stack *first = first_stack(stacks);
    assert(first->count > 0);
    *out = (bst_sensor_figures){.width = first->width, .height = first->height};
    for (int i = 0; i < BST_SENSOR_FIGURES; i++) {
        out->figures[i] = (bst_sensor_estimate){NAN, NAN};
        out->method[i] = "not determined";
    }
    for (int i = 0; i < BST_SENSOR_PERCENTILES; i++) {
        out->percentiles_e_per_s[i] = NAN;
    }
    BST_TRY(check_sizes(ctx, stacks));
    out->figures[BST_SENSOR_GAIN] = (bst_sensor_estimate){first->gain_e_per_dn, NAN};
    out->method[BST_SENSOR_GAIN] = "header or map; pairs of flats and bias frames would measure it";
    out->gain_of_header = true;
    BST_TRY(bst_sensor_measure_noise(ctx, stacks, out));
    BST_TRY(bst_sensor_measure_linearity(ctx, stacks, out));
    BST_TRY(bst_sensor_measure_flat(ctx, stacks, out));
    BST_TRY(bst_sensor_measure_dark(ctx, stacks, out));
    BST_TRY(bst_sensor_measure_warm(ctx, stacks, out));
    bst_sensor_measure_hits(stacks, out);
    const bst_sensor_figure in_dn[] = {BST_SENSOR_READ_NOISE, BST_SENSOR_ROW_NOISE,
                                       BST_SENSOR_COLUMN_OFFSET, BST_SENSOR_ROW_OFFSET,
                                       BST_SENSOR_LINE_AMPLITUDE};
    for (size_t i = 0; i < sizeof in_dn / sizeof *in_dn; i++) {
        scale(out, in_dn[i]);
    }
    for (int i = 0; i < BST_SENSOR_FIGURES; i++) {
        if (!isfinite(out->figures[i].value) &&
            strncmp(out->method[i], "not determined", 14) != 0 &&
            strncmp(out->method[i], "none", 4) != 0) {
            out->method[i] = "not determined: too few pixels with a value";
        }
    }
    return BST_OK;
}

void bst_sensor_interval(const bst_sensor_figures *figures, bst_sensor_figure which, double *low,
                         double *high) {
    const bst_sensor_estimate *e = &figures->figures[which];
    double reach = BST_SENSOR_T95 * e->sigma;
    bool of_hits = which >= BST_SENSOR_HIT_RATE && which <= BST_SENSOR_HIT_STRAGGLING;
    if (of_hits && e->value > 0.0) {
        *low = e->value * exp(-reach / e->value);
        *high = e->value * exp(reach / e->value);
    } else {
        *low = e->value - reach;
        *high = e->value + reach;
    }
}

void bst_sensor_figures_free(bst_sensor_figures *figures) {
    free(figures->line.power);
    free(figures->dark_map);
    free(figures->prnu_map);
    *figures = (bst_sensor_figures){0};
}
