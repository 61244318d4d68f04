/* Law of radiation hits: layer, charge per length and straggling, from their pixels and charges. */
#include <assert.h>
#include <math.h>

#include "boresight/vec.h"
#include "sim/analysis/characterize/radiation_hits.h"
#include "sim/analysis/characterize/simplex_search.h"

enum { ANGLES = 128, AZIMUTHS = 24, MOST_PIXELS = 24, PARAMETERS = 3, MOST_USED = 4000 };
enum { TURNS = 400 };
/* Share of groups that are no tracks, spread over ten octaves of charge: telegraph noise, decays.
 * With 0.005 the fit took 3 % of depth and straggling for them (tests/analysis/test_sensor_hits.c).
 */
static const double OTHERS = 1e-4, OTHER_RANGE = 7.0;
/* Step of the logarithms for the curvature: hundreds of hits give errors of some 0.05; the law of
 * whole numbers of pixels has kinks, which smaller steps would see. */
static const double STEP = 0.08;

/* Probabilities of the numbers of pixels of a track, by its angle; at MOST_PIXELS: that or more. */
typedef struct pixel_law {
    double mu[ANGLES], weight[ANGLES]; /* cosine, share of the tracks */
    double of_pixels[ANGLES][MOST_PIXELS + 1];
    double inside; /* share of the tracks that do not touch the frame's edge */
} pixel_law;

/* Adds the law of a track's pixels: the numbers of its crossings of columns and rows are whole
 * numbers next to |x| and |y|. */
static void add_crossings(double x, double y, double weight, double *of_pixels) {
    int nx = (int)x, ny = (int)y;
    double px = x - nx, py = y - ny;
    for (int k = 0; k < 4; k++) {
        int pixels = 1 + nx + ny + (k & 1) + (k >> 1);
        double p = ((k & 1) ? px : 1.0 - px) * ((k >> 1) ? py : 1.0 - py);
        of_pixels[pixels < MOST_PIXELS ? pixels : MOST_PIXELS] += weight * p;
    }
}

/* Given:     depth  px
 *            end    surface length whose charge is the threshold, of a track along the surface, px
 * Notes:     Long tracks touch the edge more often, and are not in the list then. */
static void make_pixel_law(double depth, double end, const bst_radiation_hits *hits,
                           pixel_law *law) {
    *law = (pixel_law){.mu = {0}};
    for (int a = 0; a < ANGLES; a++) {
        double mu = (a + 0.5) / ANGLES, sine = sqrt(1.0 - mu * mu);
        double length = fmin(fmax(depth * sine / mu - 2.0 * end * sine, 0.0), 1e6);
        law->mu[a] = mu;
        law->weight[a] = 2.0 * mu / ANGLES;
        for (int k = 0; k < AZIMUTHS; k++) {
            double azimuth = 0.5 * BST_PI * (k + 0.5) / AZIMUTHS;
            double cosine = cos(azimuth), sine_of = sin(azimuth);
            /* corners that are cut by less than that, of 2 cos sin per length, are lost as well */
            double whole = 1.0 - 2.0 * cosine * sine_of * end * sine / (cosine + sine_of);
            double x = whole * length * cosine, y = whole * length * sine_of;
            double inside = fmax(1.0 - x / hits->width, 0.0) * fmax(1.0 - y / hits->height, 0.0);
            add_crossings(x, y, inside / AZIMUTHS, law->of_pixels[a]);
            law->inside += law->weight[a] * inside / AZIMUTHS;
        }
    }
}

/* Minus the logarithm of the likelihood; x: logarithms of depth, charge, straggling. */
static double cost_of(const void *user, const double *x) {
    const bst_radiation_hits *hits = user;
    double depth = exp(x[0]), charge = exp(x[1]), straggling = exp(x[2]), total = 0.0;
    pixel_law law;
    make_pixel_law(depth, hits->threshold_dn / charge, hits, &law);
    size_t n = hits->used < MOST_USED ? hits->used : MOST_USED;
    for (size_t i = 0; i < n; i++) {
        double q = (double)hits->items[i].charge_dn, sum = 0.0;
        int pixels = hits->items[i].pixels;
        pixels = pixels < MOST_PIXELS ? pixels : MOST_PIXELS;
        for (int a = 0; a < ANGLES; a++) {
            double probable = charge * depth / law.mu[a]; /* of a track of this angle */
            double m = (q / probable - 1.0) / straggling;
            sum += law.weight[a] * law.of_pixels[a][pixels] * exp(-0.5 * (m + exp(-m))) /
                   (probable * straggling);
        }
        sum *= 1.0 / (law.inside * sqrt(2.0 * BST_PI));
        total -= log((1.0 - OTHERS) * sum + OTHERS / (OTHER_RANGE * q));
    }
    /* far outside what the detector takes */
    for (int k = 0; k < PARAMETERS; k++) {
        double over = fmax(fabs(x[k]) - 20.0, 0.0);
        total += over * over;
    }
    return total;
}

/* Variances of the parameters from the curvature; false: no maximum of the likelihood. */
static bool variances_of(const bst_radiation_hits *hits, const double *x, double *variances) {
    double h[PARAMETERS][PARAMETERS];
    for (int i = 0; i < PARAMETERS; i++) {
        for (int j = 0; j < PARAMETERS; j++) {
            double sum = 0.0;
            for (int k = 0; k < 4; k++) {
                double at[PARAMETERS] = {x[0], x[1], x[2]};
                at[i] += (k & 1) ? STEP : -STEP;
                at[j] += (k >> 1) ? STEP : -STEP;
                sum += ((k & 1) ? 1.0 : -1.0) * ((k >> 1) ? 1.0 : -1.0) * cost_of(hits, at);
            }
            h[i][j] = sum / (4.0 * STEP * STEP);
        }
    }
    double determinant = 0.0;
    for (int i = 0; i < PARAMETERS; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        variances[i] = h[j][j] * h[k][k] - h[j][k] * h[k][j];
        determinant += h[0][i] * (h[1][j] * h[2][k] - h[1][k] * h[2][j]);
    }
    for (int i = 0; i < PARAMETERS; i++) {
        variances[i] /= determinant;
    }
    return variances[0] > 0.0 && variances[1] > 0.0 && variances[2] > 0.0;
}

bst_hit_law bst_radiation_hits_fit(const bst_radiation_hits *hits) {
    assert(hits);
    const bst_sensor_estimate none = {NAN, NAN};
    bst_hit_law law = {none, none, none};
    if (hits->used < BST_LEAST_HITS) {
        return law;
    }
    double pixels = 0.0, log_charge = 0.0;
    for (size_t i = 0; i < hits->used; i++) {
        pixels += fmin(hits->items[i].pixels, 8.0) / (double)hits->used;
        log_charge += log((double)hits->items[i].charge_dn) / (double)hits->used;
    }
    /* means of both laws: 1 + 2 depth pixels, half the logarithm's range above the least charge */
    double depth = fmax(0.5 * (pixels - 1.0), 0.05), variances[PARAMETERS];
    double x[PARAMETERS] = {log(depth), log_charge - 0.6 - log(depth), log(0.15)};
    const double step[PARAMETERS] = {0.3, 0.3, 0.5};
    bst_simplex_search(cost_of, hits, PARAMETERS, x, step, TURNS);
    if (!variances_of(hits, x, variances)) {
        return law;
    }
    bst_sensor_estimate *out[PARAMETERS] = {&law.depth_px, &law.charge_dn, &law.straggling};
    for (int k = 0; k < PARAMETERS; k++) {
        *out[k] = (bst_sensor_estimate){exp(x[k]), exp(x[k]) * sqrt(variances[k])};
    }
    return law;
}
