#include <math.h>
#include <stdlib.h>

#include "sim/optics/band.h"
#include "sim/optics/psf_internal.h"

/* A PSF is linear in the normalised spectrum. Mixing the PSFs of four black bodies approximates
 * that of any other one in the band; weights may be negative. The weights preserve mean, mean
 * square and mean cube of the wavelength. The error is the part of the OTF beyond a cubic of the
 * wavelength, on the difference of the spectra. */

/* temperatures: the Sun's (IAU 2015 resolution B3), then others: of stars, and in thermal bands of
 * warm bodies */
static const double anchor_k[2][BST_PSF_SPECTRA] = {{5772.0, 2800.0, 3900.0, 16000.0},
                                                    {5772.0, 200.0, 300.0, 500.0}};
/* Bounds of what a source's spectrum can be, K, and of the temperatures that stars have or that
 * things have in a thermal band. */
static const double coldest_k[2] = {2400.0, 150.0}, hottest_k = 50000.0;
static const double usual_k[2][2] = {{2700.0, 22000.0}, {200.0, 22000.0}};

enum { STEPS = 1024, RINGS = 200, C = BST_PSF_COLOURS };

struct bst_psf_colours {
    double least, per_step;    /* 1 / temperature: smallest value, and step between entries */
    float share[STEPS + 1][C]; /* spectra 1, 2, 3 */
    double error;
};

double bst_psf_anchor_k(bool thermal, int spectrum) {
    return anchor_k[thermal][spectrum];
}

/* Photons of a black body through the band, normalised to 1. */
static void photons_of(const bst_psf_rule *rule, double temperature_k, double *out) {
    double sum = 0.0;
    for (int k = 0; k < rule->count; k++) {
        double photons = bst_optics_planck_photons(rule->wavelength_m[k], temperature_k);
        out[k] = rule->weight[k] * rule->response[k] * photons;
        sum += out[k];
    }
    for (int k = 0; k < rule->count && sum > 0.0; k++) {
        out[k] /= sum;
    }
}

/* Moments 1, 2, 3 of the wavelength, scaled to -1 .. 1. */
static void moments_of(const bst_psf_rule *rule, const double *photons, double out[C]) {
    double first = rule->wavelength_m[0], last = rule->wavelength_m[rule->count - 1];
    double middle = 0.5 * (first + last), half = 0.5 * (last - first);
    for (int j = 0; j < C; j++) {
        out[j] = 0.0;
    }
    for (int k = 0; k < rule->count; k++) {
        double u = half > 0.0 ? (rule->wavelength_m[k] - middle) / half : 0.0, power = 1.0;
        for (int j = 0; j < C; j++) {
            power *= u;
            out[j] += photons[k] * power;
        }
    }
}

/* Moments of spectra 1, 2, 3 relative to spectrum 0. */
typedef struct anchors {
    double sun[C], more[C][C]; /* more[moment][spectrum - 1] */
} anchors;

/* Smallest fractions that preserve the moments. In a narrow band the spectra do not differ in some
 * combinations of moments; these get no weight. Regularised least squares (Tikhonov). */
static void shares_of(const anchors *a, const double moments[C], double out[C]) {
    double m[C][C + 1];
    for (int i = 0; i < C; i++) {
        for (int j = 0; j <= C; j++) {
            m[i][j] = i == j ? 1e-14 : 0.0;
            for (int k = 0; k < C; k++) {
                m[i][j] += a->more[k][i] * (j < C ? a->more[k][j] : moments[k] - a->sun[k]);
            }
        }
    }
    for (int i = 0; i < C; i++) { /* symmetric and positive definite: no pivoting */
        for (int r = 0; r < C; r++) {
            double factor = r == i ? 0.0 : m[r][i] / m[i][i];
            for (int j = i; j <= C; j++) {
                m[r][j] -= factor * m[i][j];
            }
        }
    }
    for (int i = 0; i < C; i++) {
        out[i] = m[i][C] / m[i][i];
    }
}

/* Computes the moments of the anchor spectra, relative to the Sun's. */
static void make_anchors(const bst_psf_rule *rule, anchors *a) {
    double photons[BST_PSF_WAVELENGTHS], moments[C];
    for (int s = 0; s < BST_PSF_SPECTRA; s++) {
        photons_of(rule, anchor_k[rule->thermal][s], photons);
        moments_of(rule, photons, moments);
        for (int j = 0; j < C; j++) {
            if (s == 0) {
                a->sun[j] = moments[j];
            } else {
                a->more[j][s - 1] = moments[j] - a->sun[j];
            }
        }
    }
}

/* Frequency times OTF, including the pixel, on rings of the frequency plane. */
static void fill_rings(const bst_psf_rule *rule, const double *q, double inner, double *h) {
    double least_q = INFINITY;
    for (int k = 0; k < rule->count; k++) {
        least_q = fmin(least_q, q[k]);
    }
    for (int i = 0; i < RINGS; i++) {
        double f = (i + 0.5) / (RINGS * least_q), x = BST_PI * f * sqrt(0.5), pixel = sin(x) / x;
        for (int k = 0; k < rule->count; k++) {
            h[i * rule->count + k] = f * pixel * pixel * bst_optics_annulus_otf(inner, f * q[k]);
        }
    }
}

/* Error of mixing spectra, see bst_psf_mixing_error. h: [RINGS][wavelengths], frequency times
 * OTF. */
static double mixing_error(const bst_psf_rule *rule, const anchors *a, const double *h) {
    enum { COLOURS = 48 };
    double photons[BST_PSF_SPECTRA][BST_PSF_WAVELENGTHS], worst = 0.0;
    for (int s = 0; s < BST_PSF_SPECTRA; s++) {
        photons_of(rule, anchor_k[rule->thermal][s], photons[s]);
    }
    const double *usual = usual_k[rule->thermal];
    for (int n = 0; n <= COLOURS; n++) {
        double own[BST_PSF_WAVELENGTHS], moments[C], share[C], missed = 0.0, peak = 0.0;
        double u = (double)n / COLOURS;
        photons_of(rule, 1.0 / ((1.0 - u) / usual[0] + u / usual[1]), own);
        moments_of(rule, own, moments);
        shares_of(a, moments, share);
        for (int i = 0; i < RINGS; i++) {
            double miss = 0.0, whole = 0.0;
            for (int k = 0; k < rule->count; k++) {
                double sun = photons[0][k], mix = sun;
                for (int s = 0; s < C; s++) {
                    mix += share[s] * (photons[s + 1][k] - sun);
                }
                miss += (mix - own[k]) * h[i * rule->count + k];
                whole += own[k] * h[i * rule->count + k];
            }
            missed += fabs(miss);
            peak += fabs(whole);
        }
        worst = fmax(worst, missed / peak);
    }
    return worst;
}

bst_status bst_psf_colours_create(bst_ctx *ctx, const bst_psf_rule *rule, const double *q,
                                  double inner, bst_psf_colours **out) {
    bst_psf_colours *c = malloc(sizeof *c);
    double *rings = malloc((size_t)(RINGS * rule->count) * sizeof *rings);
    *out = c;
    if (!c || !rings) {
        free(rings);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the colours of a PSF");
    }
    anchors a;
    make_anchors(rule, &a);
    c->least = 1.0 / hottest_k;
    c->per_step = (1.0 / coldest_k[rule->thermal] - c->least) / STEPS;
    for (int i = 0; i <= STEPS; i++) {
        double photons[BST_PSF_WAVELENGTHS], moments[C], share[C];
        photons_of(rule, 1.0 / (c->least + i * c->per_step), photons);
        moments_of(rule, photons, moments);
        shares_of(&a, moments, share);
        for (int s = 0; s < C; s++) {
            c->share[i][s] = (float)share[s];
        }
    }
    fill_rings(rule, q, inner, rings);
    c->error = mixing_error(rule, &a, rings);
    free(rings);
    return BST_OK;
}

void bst_psf_colour(const bst_psf *psf, double temperature_k, float colour[BST_PSF_COLOURS]) {
    const bst_psf_colours *c = psf->colours;
    double at = c ? (1.0 / temperature_k - c->least) / c->per_step : 0.0;
    at = at > 0.0 ? fmin(at, STEPS) : 0.0;
    int i = (int)fmin(at, STEPS - 1.0);
    for (int s = 0; s < BST_PSF_COLOURS; s++) {
        double from = c ? (double)c->share[i][s] : 0.0, to = c ? (double)c->share[i + 1][s] : 0.0;
        colour[s] = (float)(from + (at - i) * (to - from));
    }
}

double bst_psf_mixing_error(const bst_psf *psf) {
    return psf->colours ? psf->colours->error : 0.0;
}
