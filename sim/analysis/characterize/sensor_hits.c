/* Radiation hits of darks and bias frames, as figures. */
#include <math.h>
#include <stdlib.h>

#include "sim/analysis/characterize/sensor_figures.h"
#include "sim/core/compare.h"

static const double CM_PER_UM = 1e-4;

/* Median charge, and its standard error from the quartiles. */
static bst_sensor_estimate median_charge(const bst_radiation_hits *h) {
    double *sorted = h->used >= 4 ? malloc(h->used * sizeof *sorted) : NULL;
    bst_sensor_estimate median = {NAN, NAN};
    if (sorted) {
        for (size_t i = 0; i < h->used; i++) {
            sorted[i] = (double)h->items[i].charge_dn;
        }
        qsort(sorted, h->used, sizeof *sorted, bst_compare_doubles);
        /* density at the median from the quarters beside it: 1.25 / (f sqrt(n)) of a normal law */
        double spread = sorted[5 * h->used / 8] - sorted[3 * h->used / 8];
        median = (bst_sensor_estimate){sorted[h->used / 2], 2.0 * spread / sqrt((double)h->used)};
        free(sorted);
    }
    return median;
}

/* Counts per frame and the collection time. */
static void measure_rate(const bst_sensor_stacks *s, bst_sensor_figures *out) {
    const bst_radiation_hits *d = &s->dark.hits, *b = &s->bias.hits;
    double side_cm = s->pixel_pitch_um * CM_PER_UM;
    double area_cm2 = side_cm * side_cm * out->width * out->height;
    double dark = (double)d->count / d->frames, bias = 0.0, variance = fmax(d->count, 1.0);
    variance /= (double)d->frames * d->frames;
    if (b->frames > 0) { /* hits of the read-out, which darks have too */
        bias = (double)b->count / b->frames;
        variance += fmax(b->count, 1.0) / ((double)b->frames * b->frames);
    }
    double per_s = 1.0 / s->dark.exposure_s, of_exposure = dark - bias;
    double rate = of_exposure * per_s / area_cm2, sigma = sqrt(variance) * per_s / area_cm2;
    out->figures[BST_SENSOR_HIT_RATE] = (bst_sensor_estimate){rate, sigma};
    out->method[BST_SENSOR_HIT_RATE] = "groups of pixels that differ between two darks";
    if (b->frames > 0 && rate > 5.0 * sigma) {
        double bias_sigma = sqrt(fmax(b->count, 1.0)) / b->frames / of_exposure;
        double value = bias / of_exposure;
        out->figures[BST_SENSOR_HIT_READOUT] =
            (bst_sensor_estimate){value * s->dark.exposure_s,
                                  hypot(bias_sigma, value * sigma / rate) * s->dark.exposure_s};
        out->method[BST_SENSOR_HIT_READOUT] = "hits of bias frames over the rate";
    }
}

void bst_sensor_measure_hits(const bst_sensor_stacks *s, bst_sensor_figures *out) {
    const bst_radiation_hits *h = &s->dark.hits;
    if (h->frames == 0 || !(s->dark.exposure_s > 0.0)) {
        for (int i = BST_SENSOR_HIT_RATE; i <= BST_SENSOR_HIT_STRAGGLING; i++) {
            out->method[i] = "not determined: needs two darks";
        }
        return;
    }
    const bst_sensor_estimate *gain = &out->figures[BST_SENSOR_GAIN];
    double relative = gain->sigma > 0.0 ? gain->sigma / gain->value : 0.0;
    out->method[BST_SENSOR_HIT_READOUT] = "none: no certain rate, or no pair of bias frames";
    measure_rate(s, out);
    bst_sensor_estimate median = median_charge(h);
    out->figures[BST_SENSOR_HIT_CHARGE] = (bst_sensor_estimate){
        median.value * gain->value, hypot(median.sigma, median.value * relative) * gain->value};
    bst_hit_law law = bst_radiation_hits_fit(h);
    out->figures[BST_SENSOR_HIT_LENGTH] = law.depth_px; /* of half the tracks: tan of 45 degrees */
    out->figures[BST_SENSOR_HIT_DEPTH] = (bst_sensor_estimate){
        law.depth_px.value * s->pixel_pitch_um, law.depth_px.sigma * s->pixel_pitch_um};
    double per_um = gain->value / s->pixel_pitch_um;
    out->figures[BST_SENSOR_HIT_E_PER_UM] =
        (bst_sensor_estimate){law.charge_dn.value * per_um,
                              hypot(law.charge_dn.sigma, law.charge_dn.value * relative) * per_um};
    out->figures[BST_SENSOR_HIT_STRAGGLING] = law.straggling;
    bool found = isfinite(law.depth_px.value);
    for (int i = BST_SENSOR_HIT_LENGTH; i <= BST_SENSOR_HIT_STRAGGLING; i++) {
        out->method[i] = found ? "law of the hits' pixels and charges, maximum likelihood"
                               : "none: fewer than 30 hits inside the frames, or no maximum of the "
                                 "likelihood";
    }
    out->method[BST_SENSOR_HIT_CHARGE] =
        isfinite(median.value) ? "median of the hits inside the frames" : "none: too few hits";
}
