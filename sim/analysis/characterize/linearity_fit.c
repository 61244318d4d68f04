#include "sim/analysis/characterize/linearity_fit.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

enum { UNKNOWNS = 1 + BST_LINEARITY_TERMS, LEAST_USED = UNKNOWNS + 1, BLOCKS = BST_STACK_BLOCKS };
/* Variance of saturated flats over the largest of the series: the break of photon transfer. */
static const double BREAK = 0.25;
/* Saturated signals of the series agree to this share, or to the noise. */
static const double SAME = 3e-4;
/* Pixels this many standard deviations above the mean must be below saturation. */
static const double MARGIN = 5.0;

/* A block's curve: signal = slope t (1 + shape[0] (t / longest) + ...). */
typedef struct curve {
    double slope, shape[BST_LINEARITY_TERMS];
    double saturation, full_s; /* signal, and exposure at which it is reached; NAN: none */
} curve;

/* A fit of all blocks. */
typedef struct work {
    const bst_linearity_series *series;
    const bst_linearity_dark *dark;
    double longest_s, per_pixel; /* 1 / pixels of a block */
    bool *used, *full;           /* [series->count] */
    curve curves[BLOCKS];
    double *residuals; /* [series->count][BLOCKS] over the noise; of the fit */
} work;

static double signal_of(const work *w, int i, int block) {
    return w->series->points[i].mean[block] - w->dark->level[block];
}

/* Mean over the blocks. */
static double mean_signal(const work *w, int i) {
    double values[BLOCKS];
    for (int k = 0; k < BLOCKS; k++) {
        values[k] = signal_of(w, i, k);
    }
    return bst_mean_estimate(values, BLOCKS).value;
}

/* Variance of a block's mean. Without pairs the noise is taken as that of the signal. */
static double noise_of(const work *w, int i, int block) {
    const bst_linearity_point *p = &w->series->points[i];
    double one = isfinite(p->variance[block]) ? p->variance[block] : fabs(signal_of(w, i, block));
    double rounding = 1.0 / 12.0;
    return ((one + rounding) * w->per_pixel + w->dark->level_variance) / p->frames;
}

/* Marks saturated exposures. Returns false: none. */
static bool find_saturated(work *w) {
    const bst_linearity_series *s = w->series;
    double most = 0.0, top = -INFINITY;
    int peak = 0, found = 0;
    for (int i = 0; i < s->count; i++) {
        double v = bst_mean_estimate(s->points[i].variance, BLOCKS).value;
        if (v > most) {
            most = v;
            peak = i;
        }
    }
    for (int i = peak + 1; i < s->count; i++) {
        top = fmax(top, mean_signal(w, i));
    }
    for (int i = peak + 1; i < s->count; i++) {
        double v = bst_mean_estimate(s->points[i].variance, BLOCKS).value;
        double noise = sqrt(noise_of(w, i, 0) / BLOCKS);
        w->full[i] = v < BREAK * most && mean_signal(w, i) > top - fmax(5.0 * noise, SAME * top);
        found += w->full[i];
    }
    return found > 0;
}

/* Mean of the saturated signals of a block. */
static double saturation_of(const work *w, int block) {
    double sum = 0.0;
    int n = 0;
    for (int i = 0; i < w->series->count; i++) {
        if (w->full[i]) {
            sum += signal_of(w, i, block);
            n++;
        }
    }
    return n > 0 ? sum / n : NAN;
}

/* Chooses the exposures without a saturated pixel in any block. Returns their number. */
static int choose(work *w, bool saturates) {
    int used = 0;
    for (int i = 0; i < w->series->count; i++) {
        bool below = w->series->points[i].exposure_s > 0.0 && !w->full[i];
        for (int k = 0; k < BLOCKS && below; k++) {
            double v = signal_of(w, i, k), brightest = v + MARGIN * w->series->points[i].scatter[k];
            below = isfinite(v) && (!saturates || brightest < w->curves[k].saturation);
        }
        w->used[i] = below;
        used += below;
    }
    return used;
}

/* Solves the normal equations by elimination; matrix and side are overwritten. */
static bool solve(double matrix[UNKNOWNS][UNKNOWNS], double *side) {
    for (int i = 0; i < UNKNOWNS; i++) { /* positive definite: no exchange of rows */
        if (!(matrix[i][i] > 0.0)) {
            return false;
        }
        for (int j = i + 1; j < UNKNOWNS; j++) {
            double f = matrix[j][i] / matrix[i][i];
            for (int k = i; k < UNKNOWNS; k++) {
                matrix[j][k] -= f * matrix[i][k];
            }
            side[j] -= f * side[i];
        }
    }
    for (int i = UNKNOWNS - 1; i >= 0; i--) {
        for (int k = i + 1; k < UNKNOWNS; k++) {
            side[i] -= matrix[i][k] * side[k];
        }
        side[i] /= matrix[i][i];
    }
    return true;
}

/* Signal at an exposure over slope * longest; derivative by the exposure over the slope. */
static double at(const curve *c, double u, double *derivative) {
    double value = 0.0, slope = 0.0;
    for (int i = BST_LINEARITY_TERMS - 1; i >= 0; i--) {
        value = c->shape[i] + u * value;
        slope = (i + 2) * c->shape[i] + u * slope;
    }
    *derivative = 1.0 + u * slope;
    return u * (1.0 + u * value);
}

/* Exposure over the longest one at which a curve reaches a signal; NAN: it does not by 1.5. */
static double inverse(const work *w, const curve *c, double signal) {
    double target = signal / (c->slope * w->longest_s), low = 0.0, high = 1.5, unused;
    if (!(at(c, high, &unused) > target)) {
        return NAN;
    }
    for (int turn = 0; turn < 60; turn++) {
        double middle = 0.5 * (low + high);
        *(at(c, middle, &unused) < target ? &low : &high) = middle;
    }
    return 0.5 * (low + high);
}

/* Least squares of a block. */
static bool fit_block(work *w, int block) {
    const bst_linearity_series *s = w->series;
    double matrix[UNKNOWNS][UNKNOWNS] = {{0.0}}, side[UNKNOWNS] = {0.0};
    for (int i = 0; i < s->count; i++) {
        double u = s->points[i].exposure_s / w->longest_s,
               row[UNKNOWNS] = {u, u * u, u * u * u, u * u * u * u};
        double weight = w->used[i] ? 1.0 / noise_of(w, i, block) : 0.0;
        for (int a = 0; a < UNKNOWNS; a++) {
            side[a] += w->used[i] ? weight * row[a] * signal_of(w, i, block) : 0.0;
            for (int b = 0; b < UNKNOWNS; b++) {
                matrix[a][b] += weight * row[a] * row[b];
            }
        }
    }
    curve *c = &w->curves[block];
    if (!solve(matrix, side) || !(side[0] > 0.0)) {
        return false;
    }
    c->slope = side[0] / w->longest_s;
    for (int i = 0; i < BST_LINEARITY_TERMS; i++) {
        c->shape[i] = side[i + 1] / side[0];
    }
    for (int i = 0; i < s->count; i++) {
        double d, u = s->points[i].exposure_s / w->longest_s;
        double model = c->slope * w->longest_s * at(c, u, &d);
        w->residuals[i * BLOCKS + block] =
            w->used[i] ? (signal_of(w, i, block) - model) / sqrt(noise_of(w, i, block)) : NAN;
    }
    c->full_s = isfinite(c->saturation) ? inverse(w, c, c->saturation) * w->longest_s : NAN;
    return true;
}

/* Errors common to all blocks, as of the light or the level, over those that the blocks' scatter
 * shows: a factor of the standard errors, 1 or more. */
static double common_factor(const work *w, int used) {
    double sum = 0.0;
    for (int i = 0; i < w->series->count; i++) {
        if (w->used[i]) {
            bst_sensor_estimate e = bst_mean_estimate(w->residuals + i * BLOCKS, BLOCKS);
            sum += e.value * e.value / (e.sigma * e.sigma);
        }
    }
    return sqrt(fmax(sum / (used - UNKNOWNS), 1.0));
}

/* Gain: charge over the variance between the pairs, both summed over the exposures of a block with
 * weights of the variance's accuracy, with what neighbours share; error by leaving out each block
 * in turn. */
static bst_sensor_estimate measure_gain(const work *w) {
    double charge[BLOCKS] = {0.0}, excess[BLOCKS] = {0.0}, a = 0.0, b = 0.0, rest = 0.0;
    double dark = bst_mean_estimate(w->dark->variance, BLOCKS).value;
    bst_shared_noise shared = {.excess = 0.0};
    int n = 0;
    for (int i = 0; i < w->series->count; i++) {
        const bst_linearity_point *p = &w->series->points[i];
        if (w->used[i]) {
            bst_shared_noise_add(&shared, p->pairs / pow(mean_signal(w, i) + dark, 2.0),
                                 &p->neighbours, bst_mean_estimate(p->variance, BLOCKS).value,
                                 &w->dark->neighbours, dark);
        }
    }
    for (int k = 0; k < BLOCKS; k++) {
        const curve *c = &w->curves[k];
        for (int i = 0; i < w->series->count; i++) {
            const bst_linearity_point *p = &w->series->points[i];
            double d, v = p->variance[k] - w->dark->variance[k];
            double u = p->exposure_s / w->longest_s;
            if (w->used[i] && isfinite(v)) {
                (void)at(c, u, &d);
                double weight = p->pairs / pow(signal_of(w, i, k) + w->dark->variance[k], 2.0);
                charge[k] += weight * c->slope * p->exposure_s * d * d;
                excess[k] += weight * v;
                n++;
            }
        }
        a += charge[k];
        b += excess[k];
    }
    for (int k = 0; k < BLOCKS; k++) {
        double d = (a - charge[k]) / (b - excess[k]) - a / b;
        rest += d * d * (BLOCKS - 1.0) / BLOCKS;
    }
    bst_sensor_estimate factor = bst_shared_noise_factor(&shared), gain = {a / b, sqrt(rest)};
    return n > 0 ? bst_sensor_ratio(gain, factor) : (bst_sensor_estimate){NAN, NAN};
}

/* Means of the blocks, and what is common to them. */
static void average(const work *w, int last, double factor, bst_linearity *out) {
    double v[2 + 2 * BST_LINEARITY_TERMS + 2][BLOCKS];
    double *full = v[0], *saturation = v[1], *error = v[2], *slope = v[3];
    for (int k = 0; k < BLOCKS; k++) {
        const curve *c = &w->curves[k];
        double d, u = w->series->points[last].exposure_s / w->longest_s, share = 1.0;
        full[k] = c->slope * c->full_s;
        saturation[k] = c->saturation;
        error[k] = at(c, u, &d) / u - 1.0;
        slope[k] = c->slope;
        for (int i = 0; i < BST_LINEARITY_TERMS; i++) {
            share *= c->full_s / w->longest_s;
            v[4 + i][k] = c->shape[i] * share;
            out->shape[i] += c->shape[i] / BLOCKS;
        }
    }
    bst_sensor_estimate *to[] = {&out->full_well_e, &out->saturation_dn, &out->error,   NULL,
                                 &out->terms[0],    &out->terms[1],      &out->terms[2]};
    for (int i = 0; i < 7; i++) {
        if (to[i]) {
            *to[i] = bst_mean_estimate(v[i], BLOCKS);
            to[i]->sigma *= i == 1 ? 1.0 : factor;
        }
    }
    out->slope_dn_per_s = bst_mean_estimate(slope, BLOCKS).value;
    out->significance = fabs(out->error.value) / out->error.sigma;
}

void bst_linearity_fit(const bst_linearity_series *series, const bst_linearity_dark *dark,
                       bst_sensor_estimate gain, bst_linearity *out) {
    assert(series && dark && out && series->count > 0);
    const bst_sensor_estimate none = {NAN, NAN};
    *out = (bst_linearity){.gain_e_per_dn = none,
                           .saturation_dn = none,
                           .full_well_e = none,
                           .terms = {none, none, none},
                           .error = none,
                           .slope_dn_per_s = NAN};
    work w = {.series = series,
              .dark = dark,
              .longest_s = series->points[series->count - 1].exposure_s,
              .per_pixel = (double)BLOCKS / ((double)series->width * series->height)};
    out->longest_s = w.longest_s;
    w.used = calloc((size_t)series->count, sizeof *w.used);
    w.full = calloc((size_t)series->count, sizeof *w.full);
    w.residuals = calloc((size_t)series->count * BLOCKS, sizeof *w.residuals);
    if (w.used && w.full && w.residuals && w.longest_s > 0.0) {
        out->saturates = find_saturated(&w);
        for (int k = 0; k < BLOCKS; k++) {
            w.curves[k].saturation = saturation_of(&w, k);
        }
        out->used = choose(&w, out->saturates);
        bool good = out->used >= LEAST_USED;
        for (int k = 0; k < BLOCKS && good; k++) {
            good = fit_block(&w, k);
        }
        int last = 0;
        double read = bst_mean_estimate(dark->variance, BLOCKS).value, noise = INFINITY;
        for (int i = 0; i < series->count; i++) {
            last = w.used[i] ? i : last;
            noise = w.full[i]
                        ? fmin(noise, bst_mean_estimate(series->points[i].variance, BLOCKS).value)
                        : noise;
        }
        if (good) {
            average(&w, last, common_factor(&w, out->used), out);
            out->largest_dn = mean_signal(&w, last);
            out->gain_e_per_dn = measure_gain(&w);
            bst_sensor_estimate k = isfinite(out->gain_e_per_dn.value) ? out->gain_e_per_dn : gain;
            bst_sensor_estimate *well = &out->full_well_e;
            double relative =
                hypot(well->sigma / well->value, k.sigma > 0.0 ? k.sigma / k.value : 0.0);
            *well = (bst_sensor_estimate){well->value * k.value, well->value * k.value * relative};
        }
        /* pixels that are full still have the noise of the read-out, a full converter has none */
        out->of_converter = out->saturates && noise < 0.5 * read;
        if (out->of_converter) {
            out->full_well_e = out->terms[0] = out->terms[1] = out->terms[2] = none;
        }
    }
    free(w.used);
    free(w.full);
    free(w.residuals);
}

double bst_linearity_slope(const bst_linearity *fit, double signal_dn) {
    curve c = {.slope = fit->slope_dn_per_s};
    for (int i = 0; i < BST_LINEARITY_TERMS; i++) {
        c.shape[i] = fit->shape[i];
    }
    const work w = {.longest_s = fit->longest_s};
    double derivative, u = inverse(&w, &c, signal_dn), value = at(&c, u, &derivative);
    return u > 0.0 ? u * derivative / value : NAN;
}
