#include "obsgen/model/blend_weight.h"

#include <assert.h>
#include <math.h>

#include "boresight/vec.h"

/* Radius of the circle that replaces the square of fitted pixels, sigmas of the image: with it the
 * position agrees best with fits on pixels, to 1.0 % RMS for FWHM of 1.5 to 3 px
 * (tests/obsgen/test_blend_weight.c; 2 % with 3.8, 1.0 % with 5). */
static const double FITTED_SIGMAS = 4.6;
/* The table: log10 of the first light level, levels per decade, distances per sigma. Linear
 * interpolation errs by at most 0.001 of the largest weight between light levels and by 0.004
 * between distances: an eighth of the square of the step, times the curvature at 0, -1/2. */
static const double FIRST_LIGHT = -1.0, PER_DECADE = 4.0, PER_SIGMA = BST_BLEND_PER_SIGMA;

/* Midpoints of the integral: it errs by 3e-5 of its value. */
enum { RADII = 48, ANGLES = 24 };

void bst_blend_weights_init(bst_blend_weights *out) {
    double step = FITTED_SIGMAS / RADII, turned[BST_BLEND_DISTANCES][RADII];
    for (int k = 0; k < BST_BLEND_DISTANCES; k++) {
        /* limit of zero distance, by a small one */
        double d = fmax(k / PER_SIGMA, 1e-3);
        for (int i = 0; i < RADII; i++) {
            double r = (i + 0.5) * step;
            turned[k][i] = 0.0;
            for (int a = 0; a < ANGLES; a++) {
                double cosine = cos(BST_PI * (a + 0.5) / ANGLES);
                turned[k][i] += cosine * exp(r * d * cosine - 0.5 * (r * r + d * d)) / ANGLES;
            }
            turned[k][i] *= r * r * exp(-0.5 * r * r) / d;
        }
    }
    for (int l = 0; l < BST_BLEND_LIGHTS; l++) {
        double light = pow(10.0, FIRST_LIGHT + l / PER_DECADE), sum[BST_BLEND_DISTANCES] = {0.0};
        for (int k = 0; k < BST_BLEND_DISTANCES; k++) {
            for (int i = 0; i < RADII; i++) {
                double r = (i + 0.5) * step;
                sum[k] += turned[k][i] / (1.0 + light * exp(-0.5 * r * r));
            }
            out->weight[l][k] = (float)(sum[k] / sum[0]);
        }
    }
}

/* Row of a light level in the table (fractional). */
static double row_of(double light) {
    double row = (log10(fmax(light, 1e-30)) - FIRST_LIGHT) * PER_DECADE;
    return fmin(fmax(row, 0.0), BST_BLEND_LIGHTS - 1.001);
}

void bst_blend_weight_row(const bst_blend_weights *w, double light,
                          float row[BST_BLEND_DISTANCES]) {
    double bright = row_of(light);
    int l = (int)bright;
    float part = (float)(bright - l);
    for (int k = 0; k < BST_BLEND_DISTANCES; k++) {
        row[k] = w->weight[l][k] + part * (w->weight[l + 1][k] - w->weight[l][k]);
    }
}

double bst_blend_weight(const bst_blend_weights *w, double light, double overlap) {
    assert(w && overlap >= 0.0);
    double far = 2.0 * PER_SIGMA * sqrt(-log(fmin(fmax(overlap, 1e-30), 1.0)));
    double bright = row_of(light);
    if (far >= BST_BLEND_DISTANCES - 1) {
        return 0.0;
    }
    int l = (int)bright, k = (int)far;
    double pl = bright - l, pk = far - k;
    double low = (double)w->weight[l][k] * (1.0 - pk) + (double)w->weight[l][k + 1] * pk;
    double high = (double)w->weight[l + 1][k] * (1.0 - pk) + (double)w->weight[l + 1][k + 1] * pk;
    return low + pl * (high - low);
}
