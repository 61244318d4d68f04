#include <math.h>
#include <stdlib.h>

#include "sim/optics/band.h"
#include "sim/optics/psf_internal.h"
#include "sim/optics/pupil.h"

/* Diffraction OTF: closed form of the annular aperture, averaged over the band, plus the change by
 * spider vanes and aberrations. The change is computed on grids, where it is smooth: the annulus,
 * whose OTF has a cone at 0 and square roots at its edges, is subtracted on the same grids. */

/* grid cells across the aperture at the shortest wavelength: minimum; with vanes; maximum; per wave
 * of slope across the aperture */
enum { CELLS = 384, CELLS_VANES = 512, CELLS_MOST = 1024, CELLS_PER_WAVE = 16 };

enum { MOST_WAVELENGTHS = BST_PSF_WAVELENGTHS };

/* Quadrature over the band, for each spectrum. */
typedef struct band {
    bst_psf_rule rule;
    int spectra;
    double weight[BST_PSF_SPECTRA][MOST_WAVELENGTHS];
    double q[MOST_WAVELENGTHS]; /* wavelength times focal ratio over pixel pitch */
    double q_least;
} band;

/* Gauss-Legendre nodes and weights on [0, 1] (Abramowitz and Stegun 25.4.29): Newton's method on
 * the Legendre polynomial. */
static void gauss_legendre(int n, double *place, double *weight) {
    for (int i = 0; i < n; i++) {
        double x = cos(BST_PI * (i + 0.75) / (n + 0.5)), slope = 1.0;
        for (int step = 0; step < 8; step++) {
            double p = 1.0, before = 0.0;
            for (int k = 1; k <= n; k++) {
                double next = ((2.0 * k - 1.0) * x * p - (k - 1.0) * before) / k;
                before = p;
                p = next;
            }
            slope = n * (x * p - before) / (x * x - 1.0);
            x -= p / slope;
        }
        place[i] = 0.5 * (1.0 - x);
        weight[i] = 1.0 / ((1.0 - x * x) * slope * slope);
    }
}

/* The Sun's effective temperature, K (IAU 2015 resolution B3). */
#define SUN_K 5772.0

/* Wavelength range, m, in which the response exceeds a thousandth of its maximum. */
static void find_range(const bst_band *spectrum, double *from_m, double *to_m) {
    enum { STEPS = 2000 };
    double ratio = pow(40e-6 / 0.1e-6, 1.0 / STEPS), most = 0.0;
    for (int pass = 0; pass < 2; pass++) {
        double wavelength_m = 0.1e-6;
        *from_m = *to_m = 0.0;
        for (int k = 0; k <= STEPS; k++, wavelength_m *= ratio) {
            double response = bst_band_response(spectrum, wavelength_m);
            if (pass == 0) {
                most = fmax(most, response);
            } else if (response > 1e-3 * most) {
                *from_m = *from_m > 0.0 ? *from_m : wavelength_m / ratio;
                *to_m = wavelength_m * ratio;
            }
        }
    }
}

/* Photons of spectrum `s` in the band, normalised to 1. */
static bst_status make_spectrum(bst_ctx *ctx, bool solar, band *b, int s) {
    const bst_psf_rule *rule = &b->rule;
    double sum = 0.0;
    for (int k = 0; k < rule->count; k++) {
        double photons = 1.0;
        if (solar || b->spectra > 1) {
            double temperature_k = s > 0 ? bst_psf_anchor_k(rule->thermal, s) : SUN_K;
            photons = bst_optics_planck_photons(rule->wavelength_m[k], temperature_k);
        }
        b->weight[s][k] = rule->weight[k] * (photons * rule->response[k]);
        sum += b->weight[s][k];
    }
    if (!(sum > 0.0)) {
        return bst_fail(ctx, BST_ERR_CONFIG, "the spectrum of a PSF has no light");
    }
    for (int k = 0; k < rule->count; k++) {
        b->weight[s][k] /= sum;
    }
    return BST_OK;
}

/* Chooses the wavelengths and weights of the band. */
static bst_status make_band(bst_ctx *ctx, const bst_camera *camera,
                            const bst_psf_spectrum *spectrum, int spectra, band *b) {
    const bst_optics_config *o = &camera->optics;
    bst_psf_rule *rule = &b->rule;
    bool given = o->band_nm[1] > 0.0;
    double from_m = 1e-9 * (given ? o->band_nm[0] : 507.0);
    double to_m = 1e-9 * (given ? o->band_nm[1] : 595.0), middle_m;
    const bst_band *response = given ? NULL : camera->spectrum;
    b->spectra = spectra;
    if (response) {
        find_range(response, &from_m, &to_m);
    }
    if (spectrum) {
        if (spectrum->count < 1 || spectrum->count > MOST_WAVELENGTHS) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "the spectrum of a PSF has %d wavelengths; allowed are 1 to %d",
                            spectrum->count, MOST_WAVELENGTHS);
        }
        rule->count = spectrum->count;
        for (int k = 0; k < rule->count; k++) {
            rule->wavelength_m[k] = spectrum->wavelength_m[k];
            rule->weight[k] = spectrum->weight[k];
            rule->response[k] = 1.0;
        }
        middle_m = 0.5 * (rule->wavelength_m[0] + rule->wavelength_m[rule->count - 1]);
    } else {
        if (!(to_m > from_m)) {
            return bst_fail(ctx, BST_ERR_CONFIG, "optics/band_nm must grow (found %g and %g)",
                            1e9 * from_m, 1e9 * to_m);
        }
        rule->count = o->wavelengths > 0 ? (int)o->wavelengths : 8;
        gauss_legendre(rule->count, rule->wavelength_m, rule->weight);
        for (int k = 0; k < rule->count; k++) {
            double wavelength_m = from_m + rule->wavelength_m[k] * (to_m - from_m);
            rule->wavelength_m[k] = wavelength_m;
            rule->response[k] = response ? bst_band_response(response, wavelength_m) : 1.0;
        }
        middle_m = 0.5 * (from_m + to_m);
    }
    rule->thermal = response ? bst_band_is_thermal(response) : middle_m > 3e-6;
    double per_m = 1.0 / (camera->aperture_m * bst_camera_scale_rad(camera));
    if (o->q > 0.0) {
        per_m = o->q / middle_m;
    } else if (o->f_number > 0.0 && o->pixel_pitch_um > 0.0) {
        per_m = o->f_number / (1e-6 * o->pixel_pitch_um);
    }
    b->q_least = INFINITY;
    for (int k = 0; k < rule->count; k++) {
        b->q[k] = rule->wavelength_m[k] * per_m;
        if (!(rule->weight[k] >= 0.0) || !(b->q[k] > 0.0) || !isfinite(b->q[k])) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "a PSF by diffraction needs wavelengths above 0 with weights of at "
                            "least 0, and aperture_m and pixel_scale_arcsec (or optics/q) above 0");
        }
        b->q_least = fmin(b->q_least, b->q[k]);
    }
    for (int s = 0; s < spectra; s++) {
        BST_TRY(make_spectrum(ctx, !spectrum && o->spectrum == BST_SPECTRUM_SOLAR, b, s));
    }
    return BST_OK;
}

/* Wavefront of a node in m (node NULL: only aberrations of the whole field). */
static bst_status make_wavefront(bst_ctx *ctx, const bst_optics_config *o,
                                 const bst_psf_field_node *node, bst_zernike_polynomial *out) {
    double wave_m = 1e-9 * (o->zernike_nm > 0.0 ? o->zernike_nm : 550.0);
    double defocus_um = o->defocus_um + (node ? node->defocus_um : 0.0);
    if (defocus_um != 0.0 && !(o->f_number > 0.0)) {
        return bst_fail(ctx, BST_ERR_CONFIG, "optics/defocus_um needs optics/f_number");
    }
    *out = (bst_zernike_polynomial){0};
    for (int k = 0; k < BST_ZERNIKE_TERMS; k++) {
        double waves = o->zernike_waves.waves[k] + (node ? node->zernike_waves.waves[k] : 0.0);
        if (waves != 0.0) {
            bst_zernike_add(out, k + BST_ZERNIKE_FIRST, waves * wave_m);
        }
    }
    if (defocus_um != 0.0) {
        /* defocus dz is -dz / (8 F^2) r^2, and term 4 is sqrt(3) (2 r^2 - 1) */
        bst_zernike_add(out, 4,
                        -1e-6 * defocus_um / (16.0 * sqrt(3.0) * o->f_number * o->f_number));
    }
    return BST_OK;
}

/* True if the wavefront has a non-zero coefficient. */
static bool aberrated(const bst_zernike_polynomial *w) {
    for (int p = 0; p <= BST_ZERNIKE_DEGREE; p++) {
        for (int q = 0; q <= BST_ZERNIKE_DEGREE; q++) {
            if (w->c[p][q] != 0.0) {
                return true;
            }
        }
    }
    return false;
}

/* OTF tables of one node, one per spectrum */
typedef bst_optics_grid_otf *tables[BST_PSF_SPECTRA];

/* Frequency grid of the tables. */
typedef struct grid {
    double step;
    int reach;
} grid;

/* Adds the band-averaged OTF of an aperture to a node's tables. */
static bst_status add_band(bst_ctx *ctx, bst_pupil_work *work, const bst_pupil *pupil,
                           const band *b, bool with_waves, tables out) {
    for (int k = 0; k < b->rule.count; k++) {
        /* cell size of one table step at this wavelength: no resampling */
        double cell = out[0]->step * b->q[k];
        double wavelength_m = with_waves ? b->rule.wavelength_m[k] : 0.0;
        int cells = (int)ceil(1.0 / cell);
        int reach = cells + 1 < out[0]->reach ? cells + 1 : out[0]->reach;
        bst_pupil_shifts h;
        BST_TRY(bst_pupil_transfer(ctx, work, pupil, cell, wavelength_m, &h));
        for (int ky = -reach; ky <= reach; ky++) {
            const float *row = h.rows + 2 * (size_t)((ky + h.side) % h.side) * (size_t)h.stride;
            for (int s = 0; s < b->spectra; s++) {
                float *to = bst_optics_grid_otf_node(out[s], 0, ky),
                      weight = (float)b->weight[s][k];
                for (int i = 0; i < 2 * (reach + 1); i++) {
                    to[i] += weight * row[i];
                }
            }
        }
    }
    return BST_OK;
}

/* Creates the OTF tables of all spectra. */
static bst_status create_tables(bst_ctx *ctx, const band *b, grid g, tables out) {
    for (int s = 0; s < b->spectra; s++) {
        BST_TRY(bst_optics_grid_otf_create(ctx, g.step, g.reach, out[s]));
    }
    return BST_OK;
}

/* Change of a node's OTF relative to the annulus. base: tables of the annulus, made on demand. */
static bst_status make_node(bst_ctx *ctx, bst_pupil_work *work, const bst_pupil *pupil,
                            const band *b, grid g, tables base, tables out) {
    int reach = g.reach;
    if (base[0]->step == 0.0) {
        bst_pupil annulus = {.inner = pupil->inner};
        BST_TRY(create_tables(ctx, b, g, base));
        BST_TRY(add_band(ctx, work, &annulus, b, false, base));
    }
    BST_TRY(create_tables(ctx, b, g, out));
    BST_TRY(add_band(ctx, work, pupil, b, true, out));
    for (int s = 0; s < b->spectra; s++) {
        for (int ky = -reach; ky <= reach; ky++) {
            const float *less = bst_optics_grid_otf_node(base[s], 0, ky);
            float *node = bst_optics_grid_otf_node(out[s], 0, ky);
            for (int i = 0; i < 2 * (reach + 1); i++) {
                node[i] -= less[i];
            }
        }
        /* partly open cells lose light at zero shift only */
        float *centre = bst_optics_grid_otf_node(out[s], 0, 0);
        centre[0] = centre[1] = 0.0F;
        bst_optics_grid_otf_mirror(out[s]);
    }
    return BST_OK;
}

/* Computes OTF tables of an aberrated or vaned pupil at each field node. */
static bst_status make_tables(bst_ctx *ctx, const bst_camera *camera, const band *b,
                              bst_pupil pupil, bst_psf *psf) {
    const bst_optics_config *o = &camera->optics;
    const bst_psf_field_node *field = o->field.count > 0 ? o->field.items : NULL;
    double slope_m = 0.0;
    bool any = pupil.vanes > 0;
    int nodes = psf->columns * psf->rows; /* number of nodes per spectrum */
    for (int k = 0; k < nodes; k++) {
        BST_TRY(make_wavefront(ctx, o, field ? &field[k] : NULL, &pupil.wavefront));
        slope_m = fmax(slope_m, bst_pupil_slope_m(&pupil));
        any = any || aberrated(&pupil.wavefront);
    }
    if (!any) {
        return BST_OK;
    }
    double shortest_m = b->rule.wavelength_m[0];
    for (int k = 1; k < b->rule.count; k++) {
        shortest_m = fmin(shortest_m, b->rule.wavelength_m[k]);
    }
    double waves = slope_m / shortest_m, most = (double)CELLS_MOST / CELLS_PER_WAVE;
    if (waves > most) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "optics has aberrations with slopes of %.3g waves per aperture diameter; "
                        "at most %g can be drawn: lower zernike_waves or defocus_um",
                        waves, most);
    }
    double cells = fmax(pupil.vanes > 0 ? CELLS_VANES : CELLS, ceil(CELLS_PER_WAVE * waves));
    const grid g = {1.0 / (cells * b->q_least), (int)cells + 1};
    bst_pupil_work *work;
    BST_TRY(bst_pupil_work_create(ctx, g.reach, &work));
    bst_optics_grid_otf annulus[BST_PSF_SPECTRA] = {{0}};
    tables base, own;
    bst_status status = BST_OK;
    for (int s = 0; s < b->spectra; s++) {
        base[s] = &annulus[s];
    }
    for (int k = 0; k < nodes && status == BST_OK; k++) {
        status = make_wavefront(ctx, o, field ? &field[k] : NULL, &pupil.wavefront);
        if (status == BST_OK && (pupil.vanes > 0 || aberrated(&pupil.wavefront))) {
            for (int s = 0; s < b->spectra; s++) {
                own[s] = &psf->nodes[s * nodes + k].grid;
            }
            status = make_node(ctx, work, &pupil, b, g, base, own);
        }
    }
    for (int s = 0; s < b->spectra; s++) {
        bst_optics_grid_otf_free(base[s]);
    }
    bst_pupil_work_free(work);
    return status;
}

bst_status bst_psf_make_diffraction(bst_ctx *ctx, const bst_camera *camera,
                                    const bst_psf_spectrum *spectrum, bst_psf *psf) {
    const bst_optics_config *o = &camera->optics;
    band b = {0};
    BST_TRY(make_band(ctx, camera, spectrum, psf->spectra, &b));
    bst_pupil pupil = {
        .inner = o->central_obstruction > 0.0 ? o->central_obstruction : sqrt(camera->obscuration),
        .vanes = o->spiders.width_m > 0.0 ? (int)o->spiders.count : 0,
        .vane_rad = o->spiders.angle_deg * BST_DEG_RAD};
    if (!(pupil.inner < 1.0)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "optics/central_obstruction must be below 1 (found %g)", pupil.inner);
    }
    if (pupil.vanes > 0) {
        pupil.vane_width = o->spiders.width_m / camera->aperture_m;
        if (pupil.vanes > 32 || !(pupil.vanes * pupil.vane_width < 1.0)) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "optics/spiders of %d vanes and %g m cover an aperture of %g m",
                            pupil.vanes, o->spiders.width_m, camera->aperture_m);
        }
    }
    psf->cutoff = 1.0 / b.q_least;
    /* far out the mean over a circle of radius r is Q / (pi^3 r^3 (1 - e)), from the length of the
     * aperture's rims; the peak is pi / 4 (1 - e^2) / Q^2 */
    double e = pupil.inner, q_most = 0.0;
    for (int k = 0; k < b.rule.count; k++) {
        q_most = fmax(q_most, b.q[k]);
    }
    psf->reach_px = q_most * cbrt(4e9 / (pow(BST_PI, 4.0) * (1.0 - e) * (1.0 - e) * (1.0 + e)));
    psf->wing_power = 3.0;
    int nodes = psf->columns * psf->rows;
    for (int s = 0; s < b.spectra; s++) {
        BST_TRY(bst_optics_radial_create(ctx, psf->cutoff, &psf->shared[s]));
        for (int i = 0; i < BST_RADIAL_NODES; i++) {
            double f = bst_optics_radial_frequency(psf->cutoff, i), sum = 0.0;
            for (int k = 0; k < b.rule.count; k++) {
                sum += b.weight[s][k] * bst_optics_annulus_otf(pupil.inner, f * b.q[k]);
            }
            psf->shared[s].value[i] = sum;
        }
        for (int k = 0; k < nodes; k++) {
            psf->nodes[s * nodes + k].radial = &psf->shared[s];
        }
    }
    if (b.spectra > 1) {
        BST_TRY(bst_psf_colours_create(ctx, &b.rule, b.q, pupil.inner, &psf->colours));
    }
    return make_tables(ctx, camera, &b, pupil, psf);
}
