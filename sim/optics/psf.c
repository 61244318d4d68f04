#include "sim/optics/psf.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/optics/psf_internal.h"

/* frequency, in units of 1 / sigma, above which the Gaussian OTF exp(-2 pi^2 sigma^2 f^2) is below
 * 1e-9 */
#define GAUSSIAN_CUTOFF 1.024617

/* radius in units of sigma at which a Gaussian is 1e-9 of its peak */
#define GAUSSIAN_REACH 6.437899

static double sinc(double x) {
    double a = BST_PI * x;
    return fabs(a) < 1e-4 ? 1.0 - a * a / 6.0 : sin(a) / a;
}

void bst_psf_otf(const bst_psf *psf, int node, double fx, double fy, double out[2]) {
    const bst_psf_node *n = &psf->nodes[node];
    double f2 = fx * fx + fy * fy;
    out[0] = n->radial ? bst_optics_radial_at(n->radial, sqrt(f2)) : 0.0;
    out[1] = 0.0;
    if (n->grid.step > 0.0) {
        bst_optics_grid_otf_add(&n->grid, fx, fy, out);
    } else if (!n->radial) {
        out[0] = 1.0; /* only Gaussians */
    }
    double variance = n->sigma_px * n->sigma_px + psf->diffusion_px * psf->diffusion_px;
    double factor = sinc(psf->fill[0] * fx) * sinc(psf->fill[1] * fy);
    if (variance > 0.0) {
        factor *= exp(-2.0 * BST_PI * BST_PI * variance * f2);
    }
    out[0] *= factor;
    out[1] *= factor;
}

double bst_psf_cutoff(const bst_psf *psf) {
    return psf->cutoff;
}

double bst_psf_reach_px(const bst_psf *psf, double part) {
    assert(part >= 1e-9);
    double nearer = psf->wing_power > 0.0 ? pow(1e9 * part, -1.0 / psf->wing_power) : 1.0;
    return psf->reach_px * nearer + psf->wider_px;
}

int bst_psf_nodes(const bst_psf *psf) {
    return bst_psf_node_count(psf);
}

int bst_psf_spectra(const bst_psf *psf) {
    return psf->spectra;
}

/* Position on one axis of the field grid: lower node, and weight of the upper node. */
static int grid_place(double at_px, double last_px, int nodes, double *upper) {
    if (nodes < 2 || !(last_px > 0.0)) {
        *upper = 0.0;
        return 0;
    }
    double u = fmin(fmax(at_px / last_px, 0.0), 1.0) * (nodes - 1);
    int i = (int)fmin(floor(u), nodes - 2);
    *upper = u - i;
    return i;
}

int bst_psf_weights(const bst_psf *psf, double x_px, double y_px, int node[4], double weight[4]) {
    assert(psf && node && weight && isfinite(x_px) && isfinite(y_px));
    double u, v;
    int i = grid_place(x_px, psf->width_px - 1.0, psf->columns, &u);
    int j = grid_place(y_px, psf->height_px - 1.0, psf->rows, &v);
    int count = 0;
    for (int k = 0; k < 4; k++) {
        double w = (k & 1 ? u : 1.0 - u) * (k & 2 ? v : 1.0 - v);
        if (w > 0.0) {
            node[count] = (j + (k >> 1)) * psf->columns + i + (k & 1);
            weight[count++] = w;
        }
    }
    return count;
}

bool bst_psf_gaussian(const bst_psf *psf, double *sigma_px) {
    double s = psf->nodes[0].sigma_px, d = psf->diffusion_px;
    if (psf->model != BST_PSF_GAUSSIAN || psf->fill[0] != 1.0 || psf->fill[1] != 1.0) {
        return false;
    }
    for (int k = 0; k < bst_psf_nodes(psf); k++) {
        if (psf->nodes[k].sigma_px != psf->fwhm_px / BST_FWHM_PER_SIGMA) {
            return false;
        }
    }
    *sigma_px = d > 0.0 ? hypot(s, d) : s;
    return true;
}

double bst_psf_noise_area_px2(const bst_psf *psf, int node) {
    enum { STEPS = 128 }; /* samples per side of the half-plane */
    double step = psf->cutoff / STEPS, sum = 0.0;
    for (int j = -STEPS; j < STEPS; j++) {
        for (int i = 0; i < STEPS; i++) {
            double h[2];
            bst_psf_otf(psf, node, (i + 0.5) * step, (j + 0.5) * step, h);
            sum += h[0] * h[0] + h[1] * h[1];
        }
    }
    return 1.0 / (2.0 * sum * step * step);
}

/* Sum of squared pixel fractions of a line-integrated Gaussian, mean over the pixel phase: overlap
 * of a triangle of base 2 with a Gaussian of variance 2 sigma^2. */
static double squared_shares(double sigma) {
    double s = sqrt(2.0) * sigma;
    return erf(1.0 / (s * sqrt(2.0))) + 2.0 * s / sqrt(2.0 * BST_PI) * expm1(-0.5 / (s * s));
}

/* FWHM in px of the Gaussian with the same noise area as the PSF. */
static double equivalent_fwhm(const bst_psf *psf, int node) {
    double want = 1.0 / sqrt(bst_psf_noise_area_px2(psf, node));
    double low = 0.1 / BST_FWHM_PER_SIGMA, high = 1e3;
    for (int k = 0; k < 60; k++) {
        double middle = sqrt(low * high);
        *(squared_shares(middle) > want ? &low : &high) = middle;
    }
    return BST_FWHM_PER_SIGMA * sqrt(low * high);
}

double bst_psf_coloured_fwhm_px(const bst_psf *psf, const float colour[BST_PSF_COLOURS],
                                double x_px, double y_px) {
    int node[4], fields = psf->columns * psf->rows;
    double weight[4], sum = 0.0;
    int nodes = bst_psf_weights(psf, x_px, y_px, node, weight);
    for (int k = 0; k < nodes; k++) {
        for (int s = 0; s < psf->spectra; s++) {
            double share = psf->spectra > 1 ? bst_psf_share(colour, s) : 1.0;
            sum += weight[k] * share * psf->nodes[s * fields + node[k]].equivalent_fwhm_px;
        }
    }
    return fmax(sum, 0.1);
}

double bst_psf_equivalent_fwhm_px(const bst_psf *psf, double x_px, double y_px) {
    const float sun[BST_PSF_COLOURS] = {0.0F};
    return bst_psf_coloured_fwhm_px(psf, sun, x_px, y_px);
}

/* Centroid of the image: slope of the OTF's phase at 0, extrapolated, because wings of hard
 * apertures bend the phase in proportion to frequency. */
static void find_centroid(const bst_psf *psf, int node, double out[2]) {
    static const double f = 2e-3; /* cycles/px */
    for (int a = 0; a < 2; a++) {
        double at[2];
        for (int k = 0; k < 2; k++) {
            double h[2], g = f * (k + 1);
            bst_psf_otf(psf, node, a == 0 ? g : 0.0, a == 0 ? 0.0 : g, h);
            at[k] = -atan2(h[1], h[0]) / (2.0 * BST_PI * g);
        }
        out[a] = 2.0 * at[0] - at[1];
    }
}

void bst_psf_centroid_px(const bst_psf *psf, const float colour[BST_PSF_COLOURS], double x_px,
                         double y_px, double out[2]) {
    int node[4], fields = psf->columns * psf->rows;
    double weight[4];
    int nodes = bst_psf_weights(psf, x_px, y_px, node, weight);
    out[0] = out[1] = 0.0;
    for (int k = 0; k < nodes; k++) {
        for (int s = 0; s < psf->spectra; s++) {
            double share = psf->spectra > 1 ? bst_psf_share(colour, s) : 1.0;
            for (int a = 0; a < 2; a++) {
                out[a] += weight[k] * share * psf->nodes[s * fields + node[k]].centroid_px[a];
            }
        }
    }
}

void bst_psf_free(bst_psf *psf) {
    if (!psf || atomic_fetch_sub(&psf->owners, 1) > 1) {
        return;
    }
    for (int k = 0; !psf->base && psf->nodes && k < bst_psf_nodes(psf); k++) {
        free(psf->nodes[k].own_radial.value);
        bst_optics_grid_otf_free(&psf->nodes[k].grid);
    }
    for (int s = 0; !psf->base && s < psf->spectra; s++) {
        free(psf->shared[s].value);
    }
    if (!psf->base) {
        free(psf->colours);
    }
    bst_psf_free(psf->base);
    free(psf->nodes);
    free(psf);
}

/* ------------------------------------------------------------------ making */

/* Makes the OTF of a Moffat profile. */
static bst_status make_moffat(bst_ctx *ctx, bst_psf_node *node, double fwhm_px, double beta) {
    double alpha = 0.5 * fwhm_px / sqrt(exp2(1.0 / beta) - 1.0);
    /* the OTF decreases at least as (pi alpha f)^(beta - 1.5) exp(-2 pi alpha f), for large beta as
     * a Gaussian: find 1e-9 by doubling and bisection */
    double low = 0.0, high = 0.1 / alpha;
    while (bst_optics_moffat_otf(alpha, beta, high) > 1e-9) {
        low = high;
        high *= 2.0;
    }
    for (int k = 0; k < 40; k++) {
        double middle = 0.5 * (low + high);
        *(bst_optics_moffat_otf(alpha, beta, middle) > 1e-9 ? &low : &high) = middle;
    }
    BST_TRY(bst_optics_radial_create(ctx, high, &node->own_radial));
    for (int i = 0; i < BST_RADIAL_NODES; i++) {
        node->own_radial.value[i] =
            bst_optics_moffat_otf(alpha, beta, bst_optics_radial_frequency(high, i));
    }
    node->radial = &node->own_radial;
    return BST_OK;
}

/* Makes the Gaussian or Moffat profiles of all nodes. */
static bst_status make_profiles(bst_ctx *ctx, const bst_camera *camera, bst_psf *psf) {
    const bst_optics_config *optics = &camera->optics;
    const bst_psf_field_node *field = optics->field.items;
    double beta = optics->moffat_beta > 0.0 ? optics->moffat_beta : 2.5;
    for (int k = 0; k < bst_psf_nodes(psf); k++) {
        double fwhm = camera->psf_fwhm_px;
        if (optics->field.count > 0 && field[k].psf_fwhm_px > 0.0) {
            fwhm = field[k].psf_fwhm_px;
        }
        if (!(fwhm > 0.0)) {
            return bst_fail(ctx, BST_ERR_CONFIG, "psf_fwhm_px must be above 0 (found %g)", fwhm);
        }
        if (optics->psf == BST_PSF_GAUSSIAN) {
            psf->nodes[k].sigma_px = fwhm / BST_FWHM_PER_SIGMA;
            psf->cutoff = fmax(psf->cutoff, GAUSSIAN_CUTOFF / psf->nodes[k].sigma_px);
            psf->reach_px = fmax(psf->reach_px, GAUSSIAN_REACH * psf->nodes[k].sigma_px);
        } else {
            BST_TRY(make_moffat(ctx, &psf->nodes[k], fwhm, beta));
            double alpha = 0.5 * fwhm / sqrt(exp2(1.0 / beta) - 1.0);
            psf->cutoff = fmax(psf->cutoff, psf->nodes[k].own_radial.limit);
            psf->reach_px = fmax(psf->reach_px, alpha * pow(1e9, 0.5 / beta));
            psf->wing_power = 2.0 * beta;
        }
    }
    return BST_OK;
}

/* Widens a PSF by sigma_px of diffusion: limits and widths. */
static void widen(bst_psf *psf, double sigma_px) {
    if (psf->diffusion_px > 0.0) {
        /* both decrease from 1: their product is below 1e-9 where one of them is */
        psf->cutoff = fmin(psf->cutoff, GAUSSIAN_CUTOFF / psf->diffusion_px);
    }
    psf->wider_px += GAUSSIAN_REACH * sigma_px;
    double sigma;
    bool gaussian = bst_psf_gaussian(psf, &sigma);
    for (int k = 0; k < bst_psf_nodes(psf); k++) {
        psf->nodes[k].equivalent_fwhm_px =
            gaussian ? BST_FWHM_PER_SIGMA * sigma : equivalent_fwhm(psf, k);
        if (!gaussian) {
            bst_psf_fit_gaussians(psf, k, &psf->nodes[k]);
        }
    }
}

/* Makes the PSF nodes of the camera by its PSF model. */
static bst_status fill_in(bst_ctx *ctx, const bst_camera *camera, const bst_psf_inputs *inputs,
                          bst_psf *psf) {
    switch (camera->optics.psf) {
        case BST_PSF_DIFFRACTION:
            BST_TRY(bst_psf_make_diffraction(ctx, camera, inputs->spectrum, psf));
            break;
        case BST_PSF_FILE:
            BST_TRY(bst_psf_make_sampled(ctx, camera, inputs->samples, psf));
            break;
        default:
            BST_TRY(make_profiles(ctx, camera, psf));
    }
    psf->wider_px += 1.0;
    widen(psf, psf->diffusion_px);
    for (int k = 0; k < bst_psf_nodes(psf); k++) {
        find_centroid(psf, k, psf->nodes[k].centroid_px);
    }
    return BST_OK;
}

bst_status bst_psf_create_from(bst_ctx *ctx, const bst_camera *camera, const bst_psf_inputs *inputs,
                               bst_psf **out) {
    const bst_optics_config *optics = &camera->optics;
    *out = NULL;
    if (camera->psf && !inputs->samples && !inputs->spectrum) {
        *out = (bst_psf *)camera->psf;
        atomic_fetch_add(&(*out)->owners, 1);
        return BST_OK;
    }
    int columns = optics->field_columns > 1 ? (int)optics->field_columns : 1;
    int rows = optics->field_rows > 1 ? (int)optics->field_rows : 1;
    if (optics->field.count > 0 && optics->field.count != columns * rows) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "optics/field has %d nodes where field_columns times field_rows are %d",
                        optics->field.count, columns * rows);
    }
    bool coloured = optics->psf == BST_PSF_DIFFRACTION &&
                    optics->spectrum == BST_SPECTRUM_SOURCES && !inputs->spectrum;
    int spectra = coloured ? BST_PSF_SPECTRA : 1;
    bst_psf *psf = calloc(1, sizeof *psf);
    bst_psf_node *nodes = calloc((size_t)(columns * rows * spectra), sizeof *nodes);
    if (!psf || !nodes) {
        free(psf);
        free(nodes);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a PSF");
    }
    *psf = (bst_psf){.owners = 1,
                     .model = optics->psf,
                     .fwhm_px = camera->psf_fwhm_px,
                     .columns = columns,
                     .rows = rows,
                     .spectra = spectra,
                     .width_px = (double)camera->width_px,
                     .height_px = (double)camera->height_px,
                     .diffusion_px = optics->diffusion_px,
                     .nodes = nodes};
    for (int k = 0; k < 2; k++) {
        psf->fill[k] = optics->fill_factor[k] > 0.0 ? optics->fill_factor[k] : 1.0;
    }
    bst_status status = fill_in(ctx, camera, inputs, psf);
    if (status != BST_OK) {
        bst_psf_free(psf);
        return status;
    }
    *out = psf;
    return BST_OK;
}

bst_status bst_psf_create(bst_ctx *ctx, const bst_camera *camera, bst_psf **out) {
    const bst_psf_inputs none = {0};
    return bst_psf_create_from(ctx, camera, &none, out);
}

bst_status bst_psf_camera_blurred(bst_ctx *ctx, const bst_camera *camera, double sigma_px,
                                  bst_camera *out) {
    bst_psf *base;
    *out = *camera;
    out->psf = NULL;
    BST_TRY(bst_psf_create(ctx, camera, &base));
    bst_psf *psf = calloc(1, sizeof *psf);
    size_t bytes = (size_t)bst_psf_nodes(base) * sizeof *base->nodes;
    bst_psf_node *nodes = malloc(bytes);
    if (!psf || !nodes) {
        free(psf);
        free(nodes);
        bst_psf_free(base);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a PSF");
    }
    memcpy(nodes, base->nodes, bytes);
    *psf = *base;
    atomic_init(&psf->owners, 1);
    psf->base = base;
    psf->nodes = nodes;
    psf->diffusion_px = hypot(base->diffusion_px, sigma_px);
    widen(psf, sigma_px);
    out->optics.diffusion_px = hypot(camera->optics.diffusion_px, sigma_px);
    out->psf = psf;
    return BST_OK;
}

bst_status bst_psf_camera_trembling(bst_ctx *ctx, const bst_camera *camera,
                                    double pixel_scale_arcsec, double jitter_rad2, bst_camera *out,
                                    bst_psf **psf) {
    bst_camera scaled;
    *psf = NULL;
    scaled = *camera;
    scaled.pixel_scale_arcsec = pixel_scale_arcsec;
    BST_TRY(bst_camera_prepare(ctx, &scaled));
    *out = scaled;
    if (jitter_rad2 > 0.0) {
        double sigma_px = sqrt(jitter_rad2) / bst_camera_scale_rad(&scaled);
        BST_TRY(bst_psf_camera_blurred(ctx, &scaled, sigma_px, out));
        *psf = (bst_psf *)out->psf;
    }
    return BST_OK;
}
