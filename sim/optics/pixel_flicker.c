#include "sim/optics/pixel_flicker.h"

#include <assert.h>
#include <math.h>

#include "boresight/vec.h"

void bst_pixel_flicker_begin(const bst_detector_config *detector, bst_pixel_flicker *out) {
    assert(detector && out);
    const bst_detector_pixel_flicker_config *c = &detector->pixel_flicker_noise;
    *out = (bst_pixel_flicker){0};
    if (!(c->rms_e > 0.0)) {
        return;
    }
    const double fours = log(c->highest_hz / c->lowest_hz) / log(4.0);
    out->terms = (int)ceil(fours - 1e-9) + 1;
    assert(out->terms >= 1 && out->terms <= BST_FLICKER_TERMS);
    out->variance_e2 = c->rms_e * c->rms_e / out->terms;
    for (int i = 0; i < out->terms; i++) {
        double part = out->terms > 1 ? (double)i / (out->terms - 1) : 0.0;
        out->rate_per_s[i] = 2.0 * BST_PI * c->lowest_hz * pow(c->highest_hz / c->lowest_hz, part);
        out->covariance[i][i] = out->variance_e2;
    }
}

double bst_pixel_flicker_covariance(const bst_pixel_flicker *flicker, double seconds) {
    assert(flicker);
    double sum = 0.0;
    for (int i = 0; i < flicker->terms; i++) {
        sum += exp(-flicker->rate_per_s[i] * fabs(seconds));
    }
    return flicker->variance_e2 * sum;
}

/* Lets the processes run without a read; factor: what is left of each. */
static void wait(bst_pixel_flicker *f, double seconds, double *factor) {
    for (int i = 0; i < f->terms; i++) {
        factor[i] = exp(-f->rate_per_s[i] * seconds);
    }
    for (int i = 0; i < f->terms; i++) {
        for (int j = 0; j < f->terms; j++) {
            f->covariance[i][j] *= factor[i] * factor[j];
        }
        f->covariance[i][i] -= f->variance_e2 * expm1(-2.0 * f->rate_per_s[i] * seconds);
    }
}

void bst_pixel_flicker_advance(bst_pixel_flicker *f, double read_s, double double_s, double white_e,
                               bst_pixel_flicker_step *step) {
    assert(f && step && double_s >= 0.0 && white_e >= 0.0);
    const int n = f->terms;
    const double first_s = fmax(read_s - double_s, f->time_s);
    double gap[BST_FLICKER_TERMS], between[BST_FLICKER_TERMS], seen[BST_FLICKER_TERMS];
    double cross[BST_FLICKER_TERMS] = {0}, variance = white_e * white_e;
    wait(f, first_s - f->time_s, gap);
    f->time_s = first_s + double_s;
    for (int i = 0; i < n; i++) { /* the frame: sum of `seen` times the process at the first read */
        seen[i] = double_s > 0.0 ? expm1(-f->rate_per_s[i] * double_s) : 1.0;
    }
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            cross[i] += f->covariance[i][j] * seen[j];
        }
        variance += seen[i] * cross[i];
    }
    wait(f, double_s, between);
    for (int i = 0; i < n; i++) {
        cross[i] *= between[i];
        if (double_s > 0.0) { /* what comes after the first read */
            double added = -f->variance_e2 * expm1(-2.0 * f->rate_per_s[i] * double_s);
            cross[i] += added;
            variance += added;
        }
    }
    step->terms = n;
    step->spread = sqrt(variance);
    for (int i = 0; i < n; i++) {
        step->weight[i] = seen[i] * gap[i];
        step->decay[i] = between[i] * gap[i];
        step->gain[i] = variance > 0.0 ? cross[i] / step->spread : 0.0;
    }
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            f->covariance[i][j] -= step->gain[i] * step->gain[j];
        }
        f->covariance[i][i] = fmax(f->covariance[i][i], 0.0); /* rounding */
    }
}

double bst_pixel_flicker_noise_e(const bst_detector_config *detector) {
    bst_pixel_flicker f;
    bst_pixel_flicker_begin(detector, &f);
    const double apart_s = detector->double_sampling_s;
    double variance = bst_pixel_flicker_covariance(&f, 0.0);
    if (apart_s > 0.0) {
        variance = 0.0;
        for (int i = 0; i < f.terms; i++) {
            variance -= 2.0 * f.variance_e2 * expm1(-f.rate_per_s[i] * apart_s);
        }
    }
    return sqrt(variance);
}
