#include "imgproc/detect/known_psf.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/detect/low_rank.h"
#include "sim/optics/psf_image.h"

enum {
    LEAST_REACH_PX = 7, /* profiles of 15 px fill sixteen lanes */
    MOST_REACH_PX = 46,
    MARGIN_PX = 2, /* margin of the sampled profiles beyond the reach */
    LEAST_PER_PX = 3,
    MOST_PER_PX = 24,
    FIELD = 16 /* field points per side for the field average */
};

static const double TOLERANCE = 1e-4;
static const double REACH_FWHM = 2.2, SAMPLES_PER_CYCLE = 8.0;

/* Lagrange polynomials: 1 at one of the points 0, 1, ... and 0 at the others. */
static void set_lagrange(bst_known_psf *k) {
    for (int p = 0; p < BST_KNOWN_PSF_POINTS; p++) {
        double *c = k->lagrange[p], scale = 1.0;
        memset(c, 0, sizeof k->lagrange[p]);
        c[0] = 1.0;
        for (int q = 0, order = 0; q < BST_KNOWN_PSF_POINTS; q++) {
            if (q == p) {
                continue;
            }
            scale *= p - q;
            for (int m = ++order; m > 0; m--) {
                c[m] = c[m - 1] - q * c[m];
            }
            c[0] *= -q;
        }
        for (int m = 0; m < BST_KNOWN_PSF_POINTS; m++) {
            c[m] /= scale;
        }
    }
}

int bst_known_psf_taps_at(const bst_known_psf *k, double d, bst_known_psf_taps out) {
    double u = (d + k->reach_px + MARGIN_PX) * k->per_px;
    if (fabs(d) > k->reach_px + 0.5 || !(u > 0.0)) {
        return -1;
    }
    int first = (int)u - (BST_KNOWN_PSF_POINTS / 2 - 1);
    double t = u - first, step = k->per_px;
    for (int p = 0; p < BST_KNOWN_PSF_POINTS; p++) {
        const double *c = k->lagrange[p];
        double v = 0.0, v1 = 0.0, v2 = 0.0;
        for (int m = BST_KNOWN_PSF_POINTS - 1; m >= 0; m--) {
            v2 = v2 * t + 2.0 * v1;
            v1 = v1 * t + v;
            v = v * t + c[m];
        }
        out[0][p] = v;
        out[1][p] = step * v1;
        out[2][p] = step * step * v2;
    }
    return first;
}

/* Interpolates a sampled profile with the given weights. */
static double value_at(const double *samples, int first, const double *weight) {
    double sum = 0.0;
    for (int p = 0; p < BST_KNOWN_PSF_POINTS; p++) {
        sum += weight[p] * samples[first + p];
    }
    return sum;
}

double bst_known_psf_share(const bst_known_psf *k, int node, int binning, double dx, double dy) {
    double x[BST_KNOWN_PSF_TERMS] = {0.0}, y[BST_KNOWN_PSF_TERMS] = {0.0}, sum = 0.0;
    const double *across = k->across + (size_t)node * (size_t)k->terms * (size_t)k->side;
    bst_known_psf_taps taps;
    for (int b = 0; b < binning; b++) {
        double off = b - 0.5 * (binning - 1);
        int at_x = bst_known_psf_taps_at(k, binning * dx + off, taps);
        for (int t = 0; at_x >= 0 && t < k->terms; t++) {
            x[t] += value_at(across + t * k->side, at_x, taps[0]);
        }
        int at_y = bst_known_psf_taps_at(k, binning * dy + off, taps);
        for (int t = 0; at_y >= 0 && t < k->terms; t++) {
            y[t] += value_at(k->down + t * k->side, at_y, taps[0]);
        }
    }
    for (int t = 0; t < k->terms; t++) {
        sum += x[t] * y[t];
    }
    return sum;
}

/* Sets the x profiles of the field-averaged PSF. */
static void set_field_mean(bst_known_psf *k, double width_px, double height_px) {
    size_t each = (size_t)k->terms * (size_t)k->side;
    double *mean = k->across + (size_t)k->nodes * each;
    memset(mean, 0, each * sizeof *mean);
    for (int p = 0; p < FIELD * FIELD; p++) {
        int node[4];
        double weight[4];
        int count = bst_psf_weights(k->psf, (p % FIELD + 0.5) / FIELD * width_px - 0.5,
                                    (p / FIELD + 0.5) / FIELD * height_px - 0.5, node, weight);
        for (int n = 0; n < count; n++) {
            const double *from = k->across + (size_t)node[n] * each;
            for (size_t i = 0; i < each; i++) {
                mean[i] += weight[n] / (FIELD * FIELD) * from[i];
            }
        }
    }
}

/* Cosine similarity between the field-averaged PSF and a Gaussian, both pixel-integrated about the
 * source. */
static double gaussian_similarity(const bst_known_psf *k, double sigma_px, double *flux) {
    double both = 0.0, own = 0.0, other = 0.0, root = sigma_px * sqrt(2.0);
    int reach = k->reach_px;
    for (int y = -reach; y <= reach; y++) {
        double gy = 0.5 * (erf((y + 0.5) / root) - erf((y - 0.5) / root));
        for (int x = -reach; x <= reach; x++) {
            double p = bst_known_psf_share(k, k->nodes, 1, x, y);
            double g = 0.5 * (erf((x + 0.5) / root) - erf((x - 0.5) / root)) * gy;
            both += p * g;
            own += p * p;
            other += g * g;
        }
    }
    *flux = both / other;
    return both / sqrt(own * other);
}

/* Fits the nearest Gaussian by golden-section search between 0.2 and 1.5 times the equivalent
 * width. */
static void fit_nearest_gaussian(bst_known_psf *k, double equivalent_px) {
    const double golden = 0.6180339887498949;
    double lo = 0.2 * equivalent_px, hi = 1.5 * equivalent_px, flux;
    /* the similarity is flat at its maximum: 1 % of the width changes it by 1e-4 */
    while (hi - lo > 0.01 * equivalent_px) {
        double a = hi - golden * (hi - lo), b = lo + golden * (hi - lo);
        if (gaussian_similarity(k, a, &flux) > gaussian_similarity(k, b, &flux)) {
            hi = b;
        } else {
            lo = a;
        }
    }
    k->sigma_px = 0.5 * (lo + hi);
    (void)gaussian_similarity(k, k->sigma_px, &k->like_flux);
}

/* Decomposes the PSF at all field nodes into separable profiles. */
static bst_status decompose_psf(bst_ctx *ctx, bst_known_psf *k, double blur_px) {
    size_t side = (size_t)k->side, plane = side * side, nodes = (size_t)k->nodes;
    k->across = calloc((nodes + 1) * BST_KNOWN_PSF_TERMS * side, sizeof *k->across);
    k->down = calloc(BST_KNOWN_PSF_TERMS * side, sizeof *k->down);
    double *images = malloc((nodes * plane + BST_KNOWN_PSF_TERMS * side) * sizeof *images);
    bst_status status = k->across && k->down && images
                            ? BST_OK
                            : bst_fail(ctx, BST_ERR_MEMORY, "no memory for the PSF");
    for (int n = 0; n < k->nodes && status == BST_OK; n++) {
        status = bst_psf_image(ctx, k->psf, n, blur_px, k->per_px, k->reach_px + MARGIN_PX,
                               images + (size_t)n * plane);
    }
    if (status == BST_OK) {
        const bst_low_rank_images all = {images, k->nodes, k->side};
        k->terms = bst_low_rank(&all, BST_KNOWN_PSF_TERMS, TOLERANCE, k->down, k->across,
                                images + nodes * plane);
    }
    free(images);
    return status;
}

bst_status bst_known_psf_create(bst_ctx *ctx, const bst_psf *psf, double width_px, double height_px,
                                double blur_px, bst_known_psf **out) {
    *out = NULL;
    bst_known_psf *k = calloc(1, sizeof *k);
    if (!k) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the PSF");
    }
    k->psf = psf;
    k->nodes = bst_psf_nodes(psf) / bst_psf_spectra(psf);
    double fwhm_px =
        hypot(bst_psf_equivalent_fwhm_px(psf, 0.5 * (width_px - 1.0), 0.5 * (height_px - 1.0)),
              BST_FWHM_PER_SIGMA * blur_px);
    k->reach_px = (int)fmin(fmax(ceil(REACH_FWHM * fwhm_px), LEAST_REACH_PX), MOST_REACH_PX);
    double per_px = ceil(SAMPLES_PER_CYCLE * bst_psf_cutoff(psf));
    k->per_px = (int)fmin(fmax(per_px, LEAST_PER_PX), MOST_PER_PX);
    k->side = bst_psf_image_side(k->per_px, k->reach_px + MARGIN_PX);
    set_lagrange(k);
    bst_status status = decompose_psf(ctx, k, blur_px);
    if (status != BST_OK) {
        bst_known_psf_free(k);
        return status;
    }
    set_field_mean(k, width_px, height_px);
    fit_nearest_gaussian(k, fwhm_px / BST_FWHM_PER_SIGMA);
    *out = k;
    return BST_OK;
}

void bst_known_psf_free(bst_known_psf *k) {
    if (k) {
        free(k->across);
        free(k->down);
        free(k);
    }
}
