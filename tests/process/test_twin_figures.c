/* Photometry of a twin, its figures and its camera against sums of their own. */
#include "sim/process/twin/twin_figures.h"

#include <cjson/cJSON.h>

#include "sim/process/twin/twin_internal.h"
#include "tests/process/frame_by_sums.h"
#include "tests/test_support.h"

enum { LINE = 24 };

static double scatter_of(int i) {
    double s = sin(12.9898 * i + 4.1) * 43758.5453;
    return 2.0 * (s - floor(s)) - 1.0;
}

/* Colour that counts, and the weight, by the errors of the catalogue (Tycho-2). */
static double shrunk(double v_mag, double b_minus_v) {
    double sigma = 1.8 * 0.15 * pow(10.0, 0.4 * (v_mag - 12.0));
    return isfinite(b_minus_v) ? (b_minus_v - 0.65) * 0.25 / (0.25 + sigma * sigma) : 0.0;
}

static double weight_of(double v_mag) {
    double v = 0.15 * pow(10.0, 0.4 * (v_mag - 12.0)), c = 1.8 * v;
    double variance = 1.0 / (1.0 / (c * c) + 1.0 / 0.25); /* of the shrunk colour */
    return 1.0 / (0.01 + v * v + 0.25 * variance);
}

static void photometry_is_a_weighted_line(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_twin_star stars[LINE + 4] = {{.flux_e = 0.0}};
    bst_process_frame frame = {.values = {.exposure_s = 4.0}};
    bst_twin t = {.frame = &frame, .model = {.stars = stars, .count = LINE + 4}};
    double sum[5] = {0}, d[LINE], w[LINE], c[LINE], mean_c, mean_d;
    for (int i = 0; i < LINE; i++) {
        double v = 8.0 + 0.2 * i, colour = i == 5 ? NAN : 0.2 + 0.07 * ((5 * i) % LINE);
        c[i] = shrunk(v, colour);
        w[i] = weight_of(v);
        d[i] = 21.5 + 0.4 * c[i] + 0.05 * scatter_of(i);
        stars[i] = (bst_twin_star){.flux_e = 4.0 * pow(10.0, 0.4 * (d[i] - v)),
                                   .sigma_e = 1.0,
                                   .v_mag = v,
                                   .b_minus_v = colour,
                                   .inside = 0.5};
        sum[0] += w[i];
        sum[1] += w[i] * c[i];
        sum[2] += w[i] * d[i];
    }
    mean_c = sum[1] / sum[0];
    mean_d = sum[2] / sum[0];
    double xx = 1.0, xy = 0.0; /* a term of 0 within 1 is expected */
    for (int i = 0; i < LINE; i++) {
        xx += w[i] * (c[i] - mean_c) * (c[i] - mean_c);
        xy += w[i] * (c[i] - mean_c) * (d[i] - mean_d);
    }
    double colour = xy / xx, zero = mean_d - colour * mean_c, squares[3] = {0};
    int bright = 0;
    for (int i = 0; i < LINE; i++) {
        double off = d[i] - zero - colour * c[i];
        squares[0] += off;
        squares[1] += off * off;
        bright += stars[i].v_mag < 11.5;
    }
    /* those that do not count: an outlier, found, faint, outside */
    stars[LINE] = (bst_twin_star){.flux_e = 1e7, .sigma_e = 1.0, .v_mag = 10, .inside = 1};
    stars[LINE].b_minus_v = 0.65;
    stars[LINE + 1] = stars[LINE];
    stars[LINE + 1].found = true;
    stars[LINE + 2] = stars[LINE];
    stars[LINE + 2].sigma_e = 1.1e6;
    stars[LINE + 3] = stars[LINE];
    stars[LINE + 3].inside = 0.14;
    bst_assert_ok(&ctx, bst_twin_measure_photometry(&ctx, &t));
    assert_int_equal(t.photometry.stars, LINE);
    bst_assert_close(t.photometry.colour_mag, colour, 1e-9);
    bst_assert_close(t.photometry.zero_point_mag, zero, 1e-9);
    bst_assert_close(t.photometry.scatter_mag,
                     sqrt((squares[1] - squares[0] * squares[0] / LINE) / (LINE - 1)), 1e-9);
    assert_int_equal(t.photometry.bright, bright);
    double b[2] = {0};
    for (int i = 0; i < bright; i++) {
        double off = d[i] - zero - colour * c[i];
        b[0] += off;
        b[1] += off * off;
    }
    bst_assert_close(t.photometry.bright_mag, sqrt((b[1] - b[0] * b[0] / bright) / (bright - 1)),
                     1e-9);
    for (int i = 0; i < LINE; i++) {
        double e = 4.0 * pow(10.0, -0.4 * (stars[i].v_mag - zero - colour * c[i]));
        bst_assert_close(stars[i].expected_e, e, 1e-9 * e);
    }
    assert_true(isnan(stars[LINE + 1].expected_e));
}

static void photometry_without_stars(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_twin_star star = {.found = true, .flux_e = 100.0, .expected_e = NAN};
    bst_process_frame frame = {.values = {.exposure_s = 4.0}};
    bst_twin t = {.frame = &frame, .model = {.stars = &star, .count = 1}};
    bst_assert_ok(&ctx, bst_twin_measure_photometry(&ctx, &t));
    assert_int_equal(t.photometry.stars, 0);
    assert_true(isnan(t.photometry.zero_point_mag) && isnan(t.photometry.scatter_mag));
    assert_true(isnan(star.expected_e));
}

/* Sums over the pixels that are chosen. */
typedef struct parts {
    double n, chi2, residual2, light, light2, variance;
} parts;

static void count(parts *p, bool in, double r, double light, double v) {
    if (in) {
        p->n += 1.0;
        p->chi2 += r * r / v;
        p->residual2 += r * r;
        p->light += light;
        p->light2 += light * light;
        p->variance += v;
    }
}

static double share(const parts *p, double noise) {
    double total = p->light2 - p->n * (p->light / p->n) * (p->light / p->n);
    return 1.0 - (p->residual2 - noise) / (total - noise);
}

static void figures_are_sums_over_pixels(void **state) {
    (void)state;
    static float residual[BST_TEST_PIXELS], stars_e[BST_TEST_PIXELS], variance[BST_TEST_PIXELS],
        background[BST_TEST_PIXELS], defects[BST_TEST_PIXELS];
    static double by_catalogue[BST_TEST_PIXELS], frame_e[BST_TEST_PIXELS];
    bst_ctx ctx = {0};
    bst_twin_star *stars = calloc(BST_TWIN_STARS, sizeof *stars);
    bst_process_frame frame = {.values = {.exposure_s = 4.0, .gain_e_per_dn = 3.0}};
    bst_twin t = {.frame = &frame, .model = bst_test_twin_model(stars, 4), .read_noise_e = 4.0};
    t.model.data_e = residual; /* not used without a fit */
    stars[0].expected_e = 2300.0;
    stars[1].expected_e = 3300.0;
    stars[2].found = true;
    stars[3].inside = 0.2; /* too little to measure it */
    bst_test_frame(&t.model, frame_e);
    memset(by_catalogue, 0, sizeof by_catalogue);
    for (int i = 0; i < 2; i++) {
        bst_twin_star s = stars[i];
        s.flux_e = s.expected_e;
        bst_test_add_star(&t.model, &s, 0.0, 0.0, by_catalogue);
    }
    double fitted[2] = {0.0, 0.0}; /* levels of defects: of all, and on streaks */
    int outliers = 0;
    parts alone = {0}, all = {0}, on = {0}, in = {0}, on_in = {0}, header = {0}, catalogue = {0};
    for (int i = 0; i < BST_TEST_PIXELS; i++) {
        double b = bst_twin_background(&t.model, i % BST_TEST_NX, i / BST_TEST_NX);
        background[i] = (float)(b - (i % 11 == 0 ? 40.0 : 0.0));
        stars_e[i] = (float)(frame_e[i] - b);
        variance[i] = (float)(26.0 + 0.3 * (i % 9)) + stars_e[i];
        residual[i] = (float)(6.0 * scatter_of(i));
        if (i % 97 == 0) {
            residual[i] = 8.0F * sqrtf(variance[i]);
        }
        defects[i] = i % 61 == 5 ? (float)(200 - i) : 0.0F;
        if (i % 50 == 7) {
            residual[i] = NAN;
        }
        if (!isfinite(residual[i])) {
            continue;
        }
        double r = residual[i], v = variance[i], s = stars_e[i], light = r + s + defects[i];
        bool own = defects[i] != 0.0F, streak = s > 5.0, sound = r * r < 25.0 * v && !own;
        fitted[0] += own;
        fitted[1] += own && streak;
        outliers += r * r >= 25.0 * v;
        count(&alone, true, r + defects[i], light, v);
        double h = 16.0 + 9.0 / 12.0 + fmax(background[i], 0.0) + fmax(s, 0.0);
        count(&all, true, r, light, v);
        count(&on, streak, r, light, v);
        count(&in, sound, r, light, v);
        count(&on_in, streak && sound, r, light, v);
        count(&header, true, r, light, h);
        count(&catalogue, sound, light - by_catalogue[i], light, v);
    }
    const bst_twin_frames f = {.stars_e = stars_e,
                               .background_e = background,
                               .defects_e = defects,
                               .residual_e = residual,
                               .variance_e2 = variance};
    bst_twin_figures g;
    bst_assert_ok(&ctx, bst_twin_figures_compute(&ctx, &t, &f, &g));
    assert_int_equal(g.pixels, (int)all.n);
    assert_int_equal(g.streak_pixels, (int)on.n);
    assert_int_equal(g.outliers, outliers);
    assert_true(g.streak_outliers > 0 && g.streak_outliers < g.outliers);
    assert_true(fitted[1] > 0.0 && fitted[0] > fitted[1]);
    bst_assert_close(g.chi2, all.chi2 / (all.n - fitted[0]), 1e-9);
    bst_assert_close(g.chi2_stars, alone.chi2 / alone.n, 1e-9 * g.chi2_stars);
    bst_assert_close(g.chi2_streaks, on.chi2 / (on.n - fitted[1]), 1e-9);
    bst_assert_close(g.chi2_clipped, in.chi2 / in.n, 1e-9);
    bst_assert_close(g.chi2_streaks_clipped, on_in.chi2 / on_in.n, 1e-9);
    bst_assert_close(g.chi2_header, header.chi2 / (header.n - fitted[0]), 1e-9);
    bst_assert_close(g.explained, share(&all, 0.0), 1e-9);
    bst_assert_close(g.explained_clipped, share(&in, in.variance), 1e-9);
    bst_assert_close(g.explained_streaks, 1.0 - on.residual2 / on.light2, 1e-9);
    bst_assert_close(g.explained_catalogue, share(&catalogue, catalogue.variance), 1e-4);
    assert_int_equal(g.streaks, 2);
    double across = 0.0, along = 0.0;
    t.model.variance_e2 = variance;
    for (int i = 0; i < 2; i++) {
        bst_twin_offset o;
        bool measured;
        bst_assert_ok(&ctx,
                      bst_twin_star_offset(&ctx, &t.model, &stars[i], residual, &o, &measured));
        assert_true(measured);
        across += o.across_px * o.across_px / 2;
        along += o.along_px * o.along_px / 2;
    }
    bst_assert_close(g.across_px, sqrt(across), 1e-12);
    bst_assert_close(g.along_px, sqrt(along), 1e-12);
    free(stars);
}

static double value(const cJSON *json, const char *key) {
    const cJSON *item = cJSON_GetObjectItem(json, key);
    assert_true(cJSON_IsNumber(item));
    return item->valuedouble;
}

static cJSON *camera_json(void) {
    return cJSON_Parse(
        "{\"aperture_m\": 0.15, \"obscuration\": 0.2, \"throughput\": 0.7, "
        "\"quantum_efficiency\": 0.6, \"gain_e_per_dn\": 2.0, \"offset_dn\": 100, "
        "\"rotation_deg\": 3, \"boresight_offset_px\": [1, 2]}");
}

static bst_twin camera_twin(bst_process_frame *frame) {
    *frame = (bst_process_frame){.values = {.exposure_s = 4.0}};
    return (bst_twin){
        .frame = frame,
        .read_noise_e = 6.0,
        .stem = "/tmp/some/frame",
        .photometry = {.zero_point_mag = 21.0, .colour_mag = 0.0},
        .model = {.camera = {.pixel_scale_arcsec = 3.1},
                  .width = 33,
                  .height = 17,
                  .noise_e = 11.0,
                  .psf = {.sigma_px = 1.2, .ratio = 2.0, .wide = 0.25},
                  .background_e = {30.0, 5.0, -2.0, 1.0, 0.5, 0.25}},
    };
}

static void camera_has_the_frames_noise_level_and_zero_point(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_process_frame frame;
    const bst_twin t = camera_twin(&frame);
    bst_twin_camera c;
    cJSON *json = camera_json();
    bst_assert_ok(&ctx, bst_twin_make_camera(&ctx, &t, json, &c));
    assert_null(c.spectrum);
    double area = 0.25 * BST_PI * 0.15 * 0.15 * 0.8;
    /* a star of V = 21 gives one electron per second */
    bst_assert_close(
        area * 0.7 * 0.6 * value(json, "photon_flux_v0_per_s_m2") * pow(10.0, -0.4 * 21.0), 1.0,
        1e-9);
    /* noise of 11 e-, without that of rounding and of reading */
    double quantisation = 4.0 / 12.0, shot = 121.0 - quantisation - 36.0;
    double level = c.background_e + 30.0; /* of the twin's mean background */
    bst_assert_close(level, shot, 1e-9);
    bst_assert_close(value(json, "read_noise_e"), 6.0, 1e-9);
    const cJSON *b = cJSON_GetObjectItem(json, "background");
    bst_assert_close(value(b, "stray_e_per_s"), shot / 4.0, 1e-9);
    const double linear[2] = {5.0, -2.0}, curved[3] = {1.0, 0.5, 0.25};
    const cJSON *g = cJSON_GetObjectItem(b, "gradient_e_per_s"),
                *k = cJSON_GetObjectItem(b, "curvature_e_per_s");
    assert_int_equal(cJSON_GetArraySize(g), 2);
    assert_int_equal(cJSON_GetArraySize(k), 3);
    for (int i = 0; i < 3; i++) {
        bst_assert_close(cJSON_GetArrayItem(k, i)->valuedouble, curved[i] / 4.0, 1e-12);
        if (i < 2) {
            bst_assert_close(cJSON_GetArrayItem(g, i)->valuedouble, linear[i] / 4.0, 1e-12);
        }
    }
    /* the level of the counts stays: less offset by as much as the background is more */
    bst_assert_close(value(json, "offset_dn"), 100.0 - c.background_e / 2.0, 1e-9);
    bst_assert_close(c.pedestal_dn, 0.0, 0.0);
    bst_assert_close(value(json, "pixel_scale_arcsec"), 3.1, 0.0);
    bst_assert_close(value(json, "dark_current_e_per_s"), 0.0, 0.0);
    bst_assert_close(value(json, "psf_fwhm_px"), 2.0 * sqrt(2.0 * log(2.0)) * 1.2, 1e-9);
    assert_string_equal(
        cJSON_GetObjectItem(cJSON_GetObjectItem(json, "optics"), "psf_file")->valuestring,
        "frame_psf.fits");
    assert_null(cJSON_GetObjectItem(json, "rotation_deg"));
    assert_null(cJSON_GetObjectItem(json, "boresight_offset_px"));
    cJSON_Delete(json);
}

static void defects_take_the_dark_part_of_the_background(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_process_frame frame;
    bst_twin t = camera_twin(&frame);
    bst_twin_camera c;
    t.defect_count = 1;
    cJSON *json = camera_json();
    bst_assert_ok(&ctx, bst_twin_make_camera(&ctx, &t, json, &c));
    double shot = 121.0 - 4.0 / 12.0 - 36.0;
    /* darkest at u = -1, v = 1 with the quadratic terms: 7.0 - 0.75 below the mean; 1 e- is left */
    bst_assert_close(c.dark_e, shot - 6.25 - 1.0, 1e-9);
    bst_assert_close(value(cJSON_GetObjectItem(json, "background"), "stray_e_per_s"), 7.25 / 4.0,
                     1e-9);
    bst_assert_close(value(json, "offset_dn"), 100.0 - c.background_e / 2.0, 1e-9);
    assert_string_equal(
        cJSON_GetObjectItem(cJSON_GetObjectItem(json, "detector"), "dark_map")->valuestring,
        "frame_dark.fits");
    cJSON_Delete(json);
}

static void background_with_more_slope_than_noise(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_process_frame frame;
    bst_twin t = camera_twin(&frame);
    bst_twin_camera c;
    t.model.noise_e = 7.0;
    t.model.background_e[0] = 300.0;
    t.model.background_e[1] = 60.0;
    t.model.background_e[2] = -20.0;
    t.model.psf.wide = 0.005; /* one Gaussian is enough */
    t.photometry.zero_point_mag = NAN;
    t.process.zero_point_mag = 20.0; /* of all frames */
    cJSON *json = camera_json();
    bst_assert_ok(&ctx, bst_twin_make_camera(&ctx, &t, json, &c));
    /* darkest at u = -1, v = 1 with the quadratic terms 1 - 0.5 + 0.25: 79.25 below the mean */
    bst_assert_close(c.background_e, 79.25 + 1.0 - 300.0, 1e-9);
    bst_assert_close(value(json, "read_noise_e"), 0.0, 0.0);
    bst_assert_close(c.rate_v0, 1e8, 1e-3); /* 20 mag */
    assert_null(cJSON_GetObjectItem(json, "optics"));
    cJSON_Delete(json);

    t.process.zero_point_mag = NAN;
    frame.path = "some.fits";
    frame.place = (bst_frame_place){.hdu = 2, .plane = -1};
    json = camera_json();
    assert_int_equal(bst_twin_make_camera(&ctx, &t, json, &c), BST_ERR_NUMERIC);
    assert_non_null(strstr(ctx.message, "some.fits: HDU 2: none of the 0 catalogue stars"));
    cJSON_Delete(json);
}

static void offsets_below_zero_are_a_pedestal(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_process_frame frame;
    bst_twin t = camera_twin(&frame);
    bst_twin_camera c;
    t.model.background_e[0] = -400.0;
    cJSON *json = camera_json();
    bst_assert_ok(&ctx, bst_twin_make_camera(&ctx, &t, json, &c));
    double more = 121.0 - 4.0 / 12.0 - 36.0 + 400.0;
    bst_assert_close(c.background_e, more, 1e-9);
    bst_assert_close(value(json, "offset_dn"), 0.0, 0.0);
    bst_assert_close(c.pedestal_dn, more / 2.0 - 100.0, 1e-9);
    cJSON_Delete(json);
}

static void band_has_the_colour_term_and_the_zero_point(void **state) {
    (void)state;
    static const double terms[] = {0.45, -0.3}, zeros[] = {21.0, 23.5};
    for (int i = 0; i < 2; i++) {
        bst_ctx ctx = {0};
        bst_process_frame frame;
        bst_twin t = camera_twin(&frame);
        bst_twin_camera c;
        bst_band *band;
        t.photometry.colour_mag = terms[i];
        t.photometry.zero_point_mag = zeros[i];
        cJSON *json = camera_json();
        bst_assert_ok(&ctx, bst_twin_make_camera(&ctx, &t, json, &c));
        /* the scenario's own table */
        const cJSON *rows = cJSON_GetObjectItem(cJSON_GetObjectItem(json, "band"), "response");
        bst_optics_response_point points[32];
        int n = cJSON_GetArraySize(rows);
        double most = 0.0;
        for (int k = 0; k < n; k++) {
            points[k].wavelength_um = value(cJSON_GetArrayItem(rows, k), "wavelength_um");
            points[k].value = value(cJSON_GetArrayItem(rows, k), "value");
            bst_assert_close(points[k].wavelength_um, 0.35 + 0.05 * k, 1e-12);
            most = fmax(most, points[k].value);
        }
        bst_assert_close(most, 1.0, 0.0);
        const bst_band_config config = {
            .preset = BST_BAND_SILICON, .response = {points, n}, .optics_beam_factor = 1.0};
        bst_assert_ok(&ctx, bst_band_create(&ctx, &config, "", &band));
        double red = bst_band_star(band, 1.2), blue = bst_band_star(band, 0.2);
        bst_assert_close(2.5 * log10(red / blue), terms[i] * (1.2 - 0.2), 1e-4); /* six digits */
        double aperture = value(json, "aperture_m");
        double rate = 0.25 * BST_PI * aperture * aperture * 0.8 * value(json, "throughput") *
                      value(json, "quantum_efficiency") * bst_band_star(band, 0.65);
        bst_assert_close(-2.5 * log10(rate), -zeros[i], 1e-5);
        assert_true(value(json, "throughput") <= 1.0 && value(json, "quantum_efficiency") <= 1.0);
        assert_true(i == 0 ? aperture == 0.15 : aperture > 0.15);
        bst_band_free(band);
        bst_band_free(c.spectrum);
        cJSON_Delete(json);
    }
}

static void faint_found_stars_are_removed(void **state) {
    (void)state;
    bst_twin_star stars[5] = {{.flux_e = 1, .sigma_e = 1, .id = 1},
                              {.flux_e = 7, .sigma_e = 2, .found = true, .id = 2},
                              {.flux_e = 9, .sigma_e = 2, .found = true, .id = 3},
                              {.flux_e = 9, .sigma_e = NAN, .found = true, .id = 4},
                              {.flux_e = 0, .sigma_e = NAN, .id = 5}};
    bst_twin t = {.model = {.stars = stars, .count = 5}};
    assert_int_equal(bst_twin_remove_faint(&t, 4.0), 2);
    assert_int_equal(t.model.count, 3);
    assert_int_equal(stars[0].id, 1);
    assert_int_equal(stars[1].id, 3);
    assert_int_equal(stars[2].id, 5);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(photometry_is_a_weighted_line),
        cmocka_unit_test(photometry_without_stars),
        cmocka_unit_test(figures_are_sums_over_pixels),
        cmocka_unit_test(camera_has_the_frames_noise_level_and_zero_point),
        cmocka_unit_test(defects_take_the_dark_part_of_the_background),
        cmocka_unit_test(background_with_more_slope_than_noise),
        cmocka_unit_test(offsets_below_zero_are_a_pedestal),
        cmocka_unit_test(band_has_the_colour_term_and_the_zero_point),
        cmocka_unit_test(faint_found_stars_are_removed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
