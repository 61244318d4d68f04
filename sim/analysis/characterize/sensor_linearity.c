/* Linearity, full well and gain of flats of several exposures, as figures. */
#include <math.h>
#include <stdlib.h>

#include "sim/analysis/characterize/sensor_figures.h"

/* Least significance of a gain that replaces the header's. */
static const double CERTAIN = 2.0;

/* Level and noise of the blocks without light; false: no memory. */
static bool find_dark(const bst_sensor_stacks *s, const bst_sensor_figures *f,
                      bst_linearity_dark *dark) {
    size_t pixels = (size_t)f->width * (size_t)f->height;
    const bst_sensor_estimate *read = &f->figures[BST_SENSOR_READ_NOISE];
    *dark = (bst_linearity_dark){.level_variance = bst_frame_stack_level_variance(&s->bias)};
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        dark->level[k] = f->figures[BST_SENSOR_OFFSET].value;
        dark->variance[k] =
            s->bias.pairs > 0 ? s->bias.variance[k] : read->value * read->value + 1.0 / 12.0;
    }
    dark->neighbours = s->bias.neighbours;
    if (s->bias.count > 0) {
        float *scratch = malloc(pixels * sizeof *scratch);
        if (!scratch) {
            return false;
        }
        bst_sensor_block_moments(s->bias.mean, f->width, f->height, 5.0, scratch, dark->level,
                                 NULL);
        free(scratch);
    }
    return true;
}

/* Takes the figures over. */
static void put(const bst_linearity *l, bst_sensor_figures *out) {
    static const bst_sensor_figure terms[BST_LINEARITY_TERMS] = {
        BST_SENSOR_NONLINEARITY_1, BST_SENSOR_NONLINEARITY_2, BST_SENSOR_NONLINEARITY_3};
    const char *below = "none: fewer than 5 exposures without a saturated pixel";
    const char *fit = "curve of the signals over the exposures below saturation";
    bool fitted = isfinite(l->error.value);
    const char *full = l->of_converter ? "none: the converter saturates before the pixels"
                       : l->saturates  ? fit
                                       : "none: no exposure saturates";
    full = fitted ? full : below;
    if (l->gain_e_per_dn.value > CERTAIN * l->gain_e_per_dn.sigma) {
        out->figures[BST_SENSOR_GAIN] = l->gain_e_per_dn;
        out->method[BST_SENSOR_GAIN] =
            "photon transfer: variance between pairs of flats of several exposures, freed of the "
            "non-linearity";
        out->gain_of_header = false;
    }
    out->figures[BST_SENSOR_FULL_WELL] = l->full_well_e;
    out->method[BST_SENSOR_FULL_WELL] = full == fit ? "charge at which the curve of the signals "
                                                      "reaches the saturated signal"
                                                    : full;
    out->figures[BST_SENSOR_SATURATION] = l->saturation_dn;
    out->method[BST_SENSOR_SATURATION] =
        !l->saturates ? "none: no exposure saturates"
        : l->of_converter
            ? "signal beyond the break of photon transfer, where the converter is full"
            : "signal beyond the break of photon transfer";
    out->figures[BST_SENSOR_LINEARITY_ERROR] = l->error;
    out->method[BST_SENSOR_LINEARITY_ERROR] =
        fitted ? "curve over its slope at 0, less 1, at the largest signal below saturation"
               : below;
    for (int i = 0; i < BST_LINEARITY_TERMS; i++) {
        out->figures[terms[i]] = l->terms[i];
        out->method[terms[i]] = full;
    }
}

bst_status bst_sensor_measure_linearity(bst_ctx *ctx, const bst_sensor_stacks *s,
                                        bst_sensor_figures *out) {
    if (s->linearity.count == 0) {
        for (int i = BST_SENSOR_FULL_WELL; i <= BST_SENSOR_NONLINEARITY_3; i++) {
            out->method[i] = "not determined: needs flats of several exposures (--linearity)";
        }
        return BST_OK;
    }
    if (!isfinite(out->figures[BST_SENSOR_OFFSET].value)) {
        for (int i = BST_SENSOR_FULL_WELL; i <= BST_SENSOR_NONLINEARITY_3; i++) {
            out->method[i] = "not determined: needs bias frames or an overscan";
        }
        return BST_OK;
    }
    bst_linearity_dark dark;
    if (!find_dark(s, out, &dark)) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the level of %d x %d pixels",
                        out->width, out->height);
    }
    bst_linearity_fit(&s->linearity, &dark, out->figures[BST_SENSOR_GAIN], &out->linearity);
    put(&out->linearity, out);
    return BST_OK;
}
