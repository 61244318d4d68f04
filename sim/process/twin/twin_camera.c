/* The camera of the twin: band and throughput by the stars, background and noise by the pixels. */
#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/json_number.h"
#include "sim/process/twin/twin_internal.h"

/* The colour term is that of a band if it is larger than this, mag per mag of B-V. */
static const double LEAST_COLOUR_MAG = 0.03;
/* Colours between which the term is taken. */
static const double BLUE = 0.2, RED = 1.2, SOLAR_B_MINUS_V = 0.65;
/* Wavelengths of the response, um, and the most that it is tilted, per um. */
static const double SHORTEST_UM = 0.35, STEP_UM = 0.05, MOST_TILT = 25.0;
enum { POINTS = 16, BISECTIONS = 30 };
/* Share of the wide Gaussian below which the PSF is one Gaussian. */
static const double LEAST_WIDE = 0.01;

/* Makes the band: the response of silicon times exp(tilt wavelength), largest value 1. */
static bst_status make_band(bst_ctx *ctx, bst_twin_camera *c, double tilt) {
    bst_band *silicon;
    double most = 0.0;
    bst_band_config preset = {.preset = BST_BAND_SILICON, .optics_beam_factor = 1.0};
    BST_TRY(bst_band_create(ctx, &preset, "", &silicon));
    for (int i = 0; i < POINTS; i++) {
        double um = SHORTEST_UM + i * STEP_UM;
        c->response[i] = (bst_optics_response_point){
            um, bst_band_response(silicon, um * 1e-6) * exp(tilt * (um - 0.7))};
        most = fmax(most, c->response[i].value);
    }
    bst_band_free(silicon);
    for (int i = 0; i < POINTS; i++) { /* six digits, as the scenario has them */
        c->response[i].value = round(1e6 * c->response[i].value / most) * 1e-6;
    }
    c->points = POINTS;
    c->band = (bst_band_config){
        .preset = BST_BAND_SILICON, .response = {c->response, POINTS}, .optics_beam_factor = 1.0};
    bst_band_free(c->spectrum);
    c->spectrum = NULL;
    return bst_band_create(ctx, &c->band, "", &c->spectrum);
}

/* Colour term of the band: mag by which red stars are brighter, per mag of B-V. */
static double colour_of(const bst_twin_camera *c) {
    return 2.5 * log10(bst_band_star(c->spectrum, RED) / bst_band_star(c->spectrum, BLUE)) /
           (RED - BLUE);
}

/* Band with the colour term of the stars. */
static bst_status choose_band(bst_ctx *ctx, const bst_twin *t, bst_twin_camera *c) {
    double low = -MOST_TILT, high = MOST_TILT;
    if (fabs(t->photometry.colour_mag) < LEAST_COLOUR_MAG) {
        return BST_OK;
    }
    for (int i = 0; i < BISECTIONS; i++) {
        double tilt = 0.5 * (low + high);
        BST_TRY(make_band(ctx, c, tilt));
        *(colour_of(c) < t->photometry.colour_mag ? &low : &high) = tilt;
    }
    return BST_OK;
}

static double number_of(const cJSON *c, const char *key, double fallback) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(c, key);
    if (cJSON_IsRaw(item)) { /* as bst_process_make_scenario writes numbers */
        return strtod(item->valuestring, NULL);
    }
    return cJSON_IsNumber(item) ? item->valuedouble : fallback;
}

static void replace_number(cJSON *c, const char *key, double value) {
    cJSON_DeleteItemFromObjectCaseSensitive(c, key);
    cJSON_AddNumberToObject(c, key, value);
}

/* Throughput by the zero point; what is above 1 makes the aperture larger. */
static bst_status choose_throughput(bst_ctx *ctx, const bst_twin *t, const cJSON *json,
                                    bst_twin_camera *c) {
    double zero = isfinite(t->photometry.zero_point_mag) ? t->photometry.zero_point_mag
                                                         : t->process.zero_point_mag;
    if (!isfinite(zero)) {
        char where[BST_FRAME_WHERE_TEXT];
        return bst_fail(ctx, BST_ERR_NUMERIC,
                        "%s: none of the %d catalogue stars on the frame gives a zero "
                        "point; give --catalogue with stars of known brightness there, or a "
                        "fainter --v-limit",
                        bst_frame_where(t->frame->path, &t->frame->place, where),
                        t->catalogue_stars);
    }
    c->rate_v0 = pow(10.0, 0.4 * zero);
    c->aperture_m = number_of(json, "aperture_m", 0.1);
    c->throughput = number_of(json, "throughput", 0.8);
    c->quantum_efficiency = number_of(json, "quantum_efficiency", 0.8);
    double area =
        0.25 * BST_PI * c->aperture_m * c->aperture_m * (1.0 - number_of(json, "obscuration", 0.0));
    if (!c->spectrum) {
        c->photon_flux_v0_per_s_m2 = c->rate_v0 / (area * c->throughput * c->quantum_efficiency);
        return BST_OK;
    }
    double share = c->rate_v0 / (area * bst_band_star(c->spectrum, SOLAR_B_MINUS_V));
    if (share > 1.0) {
        c->aperture_m *= sqrt(share);
        share = 1.0;
    }
    c->quantum_efficiency = fmax(c->quantum_efficiency, share);
    c->throughput = share / c->quantum_efficiency;
    return BST_OK;
}

/* Least value of the fitted background on the frame. */
static double least_background(const bst_twin_model *m) {
    double least = INFINITY;
    for (int y = 0; y < m->height; y += 1 + (m->height - 1) / 16) {
        for (int x = 0; x < m->width; x += 1 + (m->width - 1) / 16) {
            least = fmin(least, bst_twin_background(m, x, y));
        }
    }
    return least;
}

/* Electrons behind the background: what the noise has beyond the read noise; at least as many as
 * the background varies by. */
static void choose_background(bst_ctx *ctx, const bst_twin *t, double gain, bst_twin_camera *c) {
    const bst_twin_model *m = &t->model;
    double noise2 = m->noise_e * m->noise_e - gain * gain / 12.0; /* less quantisation */
    double shot = noise2 - t->read_noise_e * t->read_noise_e, mean = m->background_e[0];
    double level = fmax(shot, mean - least_background(m) + 1.0);
    c->background_e = level - mean;
    c->read_noise_e = sqrt(fmax(noise2 - level, 0.0));
    /* what the sky does not need is dark signal, from which defects below the others subtract */
    double sky = mean - least_background(m) + 1.0;
    c->dark_e = t->defect_count > 0 ? fmax(level - sky, 0.0) : 0.0;
    if (level > noise2) {
        char where[BST_FRAME_WHERE_TEXT];
        bst_log(ctx, BST_LOG_WARNING,
                "%s: the background varies by %.6g e-, whose shot noise is more than the "
                "measured noise of %.6g e-: the twin has no read noise, and more noise than the "
                "frame; check gain and offset of the map",
                bst_frame_where(t->frame->path, &t->frame->place, where),
                mean - least_background(m), m->noise_e);
    }
}

/* Keys of the background: all light of the sky is in stray_e_per_s, the dark signal in dark_map. */
static void put_background(const bst_twin *t, cJSON *json, bst_twin_camera *c) {
    const bst_twin_model *m = &t->model;
    double exposure_s = t->frame->values.exposure_s;
    cJSON_DeleteItemFromObjectCaseSensitive(json, "background");
    cJSON *block = cJSON_AddObjectToObject(json, "background");
    cJSON_AddNumberToObject(block, "stray_e_per_s",
                            (m->background_e[0] + c->background_e - c->dark_e) / exposure_s);
    cJSON *gradient = cJSON_AddArrayToObject(block, "gradient_e_per_s");
    cJSON *curvature = cJSON_AddArrayToObject(block, "curvature_e_per_s");
    for (int k = 1; k < BST_TWIN_BACKGROUND; k++) {
        cJSON_AddItemToArray(k < 3 ? gradient : curvature,
                             cJSON_CreateNumber(m->background_e[k] / exposure_s));
    }
    replace_number(json, "background_mag_arcsec2", 40.0);
    replace_number(json, "dark_current_e_per_s", 0.0);
    replace_number(json, "read_noise_e", c->read_noise_e);
    double gain = number_of(json, "gain_e_per_dn", 1.0);
    c->recorded_offset_dn = number_of(json, "offset_dn", 0.0);
    /* offsets below 0 are none: the rest is a pedestal, which scenario and report state */
    double offset = c->recorded_offset_dn - c->background_e / gain;
    replace_number(json, "offset_dn", fmax(offset, 0.0));
    c->pedestal_dn = fmax(-offset, 0.0);
}

/* Keys of the PSF. */
static void put_psf(const bst_twin *t, cJSON *json, const char *file) {
    const bst_twin_psf *p = &t->model.psf;
    cJSON_DeleteItemFromObjectCaseSensitive(json, "optics");
    double fwhm = BST_FWHM_PER_SIGMA * p->sigma_px;
    replace_number(json, "psf_fwhm_px", fwhm);
    if (p->wide >= LEAST_WIDE) {
        cJSON *optics = cJSON_AddObjectToObject(json, "optics");
        cJSON_AddStringToObject(optics, "psf", "file");
        cJSON_AddStringToObject(optics, "psf_file", file);
        cJSON_AddNumberToObject(optics, "psf_oversampling", BST_TWIN_OVERSAMPLING);
    }
}

/* Name of a file in its folder. */
static const char *name_within(const char *path) {
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

bst_status bst_twin_make_camera(bst_ctx *ctx, const bst_twin *t, cJSON *json,
                                bst_twin_camera *out) {
    char path[4096];
    *out = (bst_twin_camera){.spectrum = NULL};
    BST_TRY(choose_band(ctx, t, out));
    BST_TRY(choose_throughput(ctx, t, json, out));
    choose_background(ctx, t, number_of(json, "gain_e_per_dn", 1.0), out);
    static const char *const replaced[] = {
        "band",    "rotation_deg", "boresight_offset_px", "distortion", "photon_flux_v0_per_s_m2",
        "detector"};
    for (size_t i = 0; i < sizeof replaced / sizeof *replaced; i++) {
        cJSON_DeleteItemFromObjectCaseSensitive(json, replaced[i]);
    }
    replace_number(json, "pixel_scale_arcsec", t->model.camera.pixel_scale_arcsec);
    replace_number(json, "aperture_m", out->aperture_m);
    replace_number(json, "throughput", out->throughput);
    replace_number(json, "quantum_efficiency", out->quantum_efficiency);
    if (out->spectrum) {
        cJSON *band = cJSON_AddObjectToObject(json, "band");
        cJSON *response = cJSON_AddArrayToObject(band, "response");
        for (int i = 0; i < out->points; i++) {
            cJSON *point = cJSON_CreateObject();
            cJSON_AddNumberToObject(point, "wavelength_um", out->response[i].wavelength_um);
            cJSON_AddNumberToObject(point, "value", out->response[i].value);
            cJSON_AddItemToArray(response, point);
        }
    } else {
        cJSON_AddNumberToObject(json, "photon_flux_v0_per_s_m2", out->photon_flux_v0_per_s_m2);
    }
    put_background(t, json, out);
    bst_twin_file(t, "_psf.fits", path);
    put_psf(t, json, name_within(path));
    if (t->defect_count > 0) {
        bst_twin_file(t, "_dark.fits", path);
        cJSON_AddStringToObject(cJSON_AddObjectToObject(json, "detector"), "dark_map",
                                name_within(path));
    }
    return BST_OK;
}
