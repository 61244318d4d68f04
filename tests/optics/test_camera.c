/* Focal-plane geometry, radiometry, and the brightness of a sphere, against numbers by hand. */
#include "boresight/camera.h"

#include <string.h>

#include "sim/optics/band.h"
#include "sim/world/world.h"
#include "tests/test_support.h"

/* The main scenario's telescope. */
static const bst_camera telescope = {.width_px = 1024,
                                     .height_px = 1000,
                                     .pixel_scale_arcsec = 3,
                                     .aperture_m = 0.15,
                                     .throughput = 0.7,
                                     .quantum_efficiency = 0.7,
                                     .photon_flux_v0_per_s_m2 = 3.6e10,
                                     .psf_fwhm_px = 2,
                                     .background_mag_arcsec2 = 22};

static void projection_is_gnomonic(void **state) {
    (void)state;
    const bst_camera *c = &telescope;
    const double scale = 3.0 * BST_PI / 648000.0;
    double x = -1, y = -1;
    assert_true(bst_camera_project(c, (bst_vec3){0, 0, 5}, &x, &y));
    bst_assert_close(x, 511.5, 1e-12); /* the sensor's centre, exact but for rounding */
    bst_assert_close(y, 499.5, 1e-12);
    /* an angle a to the right and b down lies at tan / scale from the centre */
    const double a = 0.004, b = 0.007;
    assert_true(bst_camera_project(c, (bst_vec3){sin(a), 0, cos(a)}, &x, &y));
    bst_assert_close(x, 511.5 + tan(a) / scale, 1e-9); /* rounding of 300 px */
    bst_assert_close(y, 499.5, 1e-12);
    assert_true(bst_camera_project(c, (bst_vec3){0, sin(b), cos(b)}, &x, &y));
    bst_assert_close(y, 499.5 + tan(b) / scale, 1e-9);
    bst_assert_close(bst_camera_half_diagonal_rad(c), atan(0.5 * scale * sqrt(1024. * 1024 + 1e6)),
                     1e-15);
    /* behind and beside the camera: nothing, and the outputs are left alone */
    x = y = 7;
    assert_false(bst_camera_project(c, (bst_vec3){0, 0, -1}, &x, &y));
    assert_false(bst_camera_project(c, (bst_vec3){1, 0, 0}, &x, &y));
    assert_false(bst_camera_project(c, (bst_vec3){0, 0, (double)NAN}, &x, &y));
    assert_true(x == 7 && y == 7);
}

static void unproject_inverts_project(void **state) {
    (void)state;
    bst_camera wide = telescope;
    wide.pixel_scale_arcsec = 300; /* 45 degrees from the boresight at the edge */
    const bst_camera *cameras[] = {&telescope, &wide};
    for (int k = 0; k < 2; k++) {
        for (double px = -100; px <= 1200; px += 130) {
            for (double py = -100; py <= 1200; py += 130) {
                bst_vec3 d = bst_camera_unproject(cameras[k], px, py);
                bst_assert_close(bst_vec3_norm(d), 1, 1e-15);
                double x = NAN, y = NAN;
                assert_true(bst_camera_project(cameras[k], bst_vec3_scale(d, 3.7), &x, &y));
                bst_assert_close(x, px, 1e-10); /* 1e-16 / (1.5e-5 rad per px), and some */
                bst_assert_close(y, py, 1e-10);
            }
        }
    }
}

static void points_are_unprojected_one_by_one(void **state) {
    (void)state;
    const double x_px[] = {-100.5, 0, 511.5, 1023}, y_px[] = {7, 1023, 511.5, -3};
    bst_vec3 all[4];
    bst_camera_unproject_points(&telescope, x_px, y_px, 4, all);
    for (int i = 0; i < 4; i++) {
        bst_vec3 one = bst_camera_unproject(&telescope, x_px[i], y_px[i]);
        assert_memory_equal(&all[i], &one, sizeof one);
    }
}

/* By hand: 3.6e10 10^(-5.2) = 227144.5 photons/s/m2 of V 13; pupil pi/4 0.0225 = 0.01767146 m2;
 * 0.49 of them detected: 1966.85 e/s. Sky of V 22: 3.6e10 10^(-8.8) = 57.0562 photons/s/m2/arcsec2;
 * 9 arcsec2: 4.44645 e/s/px. */
static void electrons_of_a_star_and_of_the_sky(void **state) {
    (void)state;
    bst_assert_close(bst_camera_electrons_per_s(&telescope, 13), 1966.85, 0.01); /* digits above */
    bst_assert_close(bst_camera_background_e_per_s(&telescope), 4.44645, 1e-5);
    bst_camera c = telescope;
    c.obscuration = 0.25;
    bst_assert_close(bst_camera_electrons_per_s(&c, 13), 0.75 * 1966.85, 0.01);
    /* five magnitudes are a factor of 100 by definition */
    bst_assert_close(bst_camera_electrons_per_s(&c, 8) / bst_camera_electrons_per_s(&c, 13), 100,
                     1e-11);
    for (double v = -5; v <= 25; v += 5) {
        bst_assert_close(bst_camera_v_mag(&c, bst_camera_electrons_per_s(&c, v)), v, 1e-12);
    }
    /* no light: no magnitude, and back */
    assert_true(isinf(bst_camera_v_mag(&c, 0.0)));
    bst_assert_close(bst_camera_electrons_per_s(&c, (double)INFINITY), 0, 0);
    bst_assert_close(bst_camera_psf_sigma_px(&c), 0.849321800288019, 1e-15); /* 1 / sqrt(2 ln 2) */
}

/* By hand for 4 m2, albedo 0.25, 19 degrees, 40,000 km: (pi - 0.331613) 0.945519 + 0.325568 =
 * 2.982463; 2 x 2.982463 / (29.60881 x 1.6e15) = 1.259106e-16; -26.74 + 39.74985 = 13.00985. */
static void a_sphere_at_a_geostationary_distance(void **state) {
    (void)state;
    double v = bst_world_lambert_sphere_v_mag(4, 0.25, 19 * BST_DEG_RAD, 4e7, BST_AU_M);
    bst_assert_close(v, 13.00985, 2e-5); /* seven digits above */
    bst_assert_close(bst_world_lambert_sphere_v_mag(4, 0.25, -19 * BST_DEG_RAD, 4e7, BST_AU_M), v,
                     1e-13);
    /* ten times the range is five magnitudes, twice the Sun's distance 1.505 */
    bst_assert_close(bst_world_lambert_sphere_v_mag(4, 0.25, 19 * BST_DEG_RAD, 4e8, BST_AU_M),
                     v + 5, 1e-12);
    bst_assert_close(bst_world_lambert_sphere_v_mag(4, 0.25, 19 * BST_DEG_RAD, 4e7, 2 * BST_AU_M),
                     v + 5 * log10(2.0), 1e-12);
    /* full phase: geometric albedo of a Lambert sphere is 2/3 of its albedo (Lambert 1760) */
    bst_assert_close(bst_world_lambert_sphere_v_mag(4, 0.25, 0, 4e7, BST_AU_M),
                     -26.74 - 2.5 * log10(2.0 / 3.0 * 0.25 * 4 / BST_PI / 1.6e15), 1e-12);
    /* half phase: 1 / pi of full phase */
    bst_assert_close(bst_world_lambert_sphere_v_mag(4, 0.25, 0.5 * BST_PI, 4e7, BST_AU_M),
                     -26.74 - 2.5 * log10(2.0 / 3.0 / BST_PI * 0.25 * 4 / BST_PI / 1.6e15), 1e-12);
}

/* All light that falls on the sphere times the albedo leaves it, into some direction. */
static void a_sphere_keeps_the_energy(void **state) {
    (void)state;
    const int n = 2000;
    double sum = 0;
    for (int i = 0; i < n; i++) {
        double phase = BST_PI * (i + 0.5) / n;
        double v = bst_world_lambert_sphere_v_mag(4, 0.25, phase, 1e7, BST_AU_M);
        sum += pow(10, -0.4 * (v + 26.74)) * 1e14 * 2 * BST_PI * sin(phase) * BST_PI / n;
    }
    bst_assert_close(sum, 4 * 0.25, 1e-6); /* midpoint rule, step 1.6e-3: error of 1e-6 / 4 */
}

static void no_light_is_infinitely_faint(void **state) {
    (void)state;
    const double nan = (double)NAN;
    assert_true(isinf(bst_world_lambert_sphere_v_mag(4, 0.25, BST_PI, 4e7, BST_AU_M)));
    assert_true(isinf(bst_world_lambert_sphere_v_mag(4, 0.25, 4.0, 4e7, BST_AU_M)));
    assert_true(isinf(bst_world_lambert_sphere_v_mag(4, 0.25, nan, 4e7, BST_AU_M)));
    assert_true(isinf(bst_world_lambert_sphere_v_mag(4, 0.25, 1, nan, BST_AU_M)));
    assert_true(isinf(bst_world_lambert_sphere_v_mag(4, 0, 1, 4e7, BST_AU_M)));
    assert_true(isinf(bst_world_lambert_sphere_v_mag(0, 0.25, 1, 4e7, BST_AU_M)));
    /* just short of new phase it still shines, faintly */
    double v = bst_world_lambert_sphere_v_mag(4, 0.25, BST_PI - 1e-3, 4e7, BST_AU_M);
    assert_true(v > 30 && v < 45);
}

static bst_camera open_camera(void) {
    return (bst_camera){.aperture_m = 0.15,
                        .pixel_scale_arcsec = NAN,
                        .focal_length_m = NAN,
                        .f_number = NAN,
                        .pixel_pitch_um = NAN};
}

/* The scale is pitch over focal length (gnomonic): 13 um over 0.9 m are 2.97936 arcsec. */
static void scale_from_focal_length_and_pitch(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const double scale = 13e-6 / 0.9 / (BST_PI / 648000.0);
    for (int given = 0; given < 5; given++) {
        bst_camera c = open_camera();
        c.pixel_pitch_um = given == 4 ? NAN : 13.0;
        c.focal_length_m = given == 0 || given == 2 || given == 4 ? 0.9 : NAN;
        c.f_number = given == 1 || given == 2 ? 6.0 : NAN;
        c.pixel_scale_arcsec = given >= 3 ? scale : NAN;
        bst_assert_ok(&ctx, bst_camera_resolve_scale(&ctx, &c));
        /* rounding */
        bst_assert_close(c.pixel_scale_arcsec, scale, 1e-14);
        bst_assert_close(c.focal_length_m, 0.9, 1e-14);
        bst_assert_close(c.f_number, 6.0, 1e-13);
        bst_assert_close(c.pixel_pitch_um, 13.0, 1e-12);
        bst_camera again = c; /* the resolved scenario is read again */
        bst_assert_ok(&ctx, bst_camera_resolve_scale(&ctx, &again));
        assert_true(again.pixel_scale_arcsec == c.pixel_scale_arcsec);
    }
    bst_camera c = open_camera();
    c.pixel_scale_arcsec = 3.0;
    bst_assert_ok(&ctx, bst_camera_resolve_scale(&ctx, &c));
    assert_true(isnan(c.focal_length_m) && isnan(c.pixel_pitch_um) && isnan(c.f_number));
}

static void scales_that_contradict(void **state) {
    (void)state;
    const struct {
        double scale, focal, ratio, pitch, optics_ratio, background_pitch;
        const char *says[2];
    } cases[] = {
        {NAN, NAN, NAN, NAN, 0, 0, {"pixel_scale_arcsec", "pixel_pitch_um and f_number"}},
        {NAN, 0.9, NAN, NAN, 0, 0, {"the pixel scale is missing", "focal_length_m"}},
        {3.0, 0.9, NAN, 13, 0, 0, {"pixel_scale_arcsec gives 3 arcsec", "pixel_pitch_um over"}},
        {NAN, 0.9, 5, 13, 0, 0, {"focal_length_m gives 0.9 m", "f_number times aperture"}},
        {NAN, NAN, 6, 13, 8, 0, {"f_number gives 6", "optics/f_number gives 8"}},
        {NAN, NAN, 6, 13, 0, 10, {"pixel_pitch_um gives 13", "background/pixel_pitch_um gives 10"}},
        {NAN, 100, NAN, 0.01, 0, 0, {"pixel scale of 2.06265e-05", "0.001 to 600"}}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        bst_camera c = open_camera();
        c.pixel_scale_arcsec = cases[i].scale;
        c.focal_length_m = cases[i].focal;
        c.f_number = cases[i].ratio;
        c.pixel_pitch_um = cases[i].pitch;
        c.optics.f_number = cases[i].optics_ratio;
        c.background.pixel_pitch_um = cases[i].background_pitch;
        assert_int_equal(bst_camera_resolve_scale(&ctx, &c), BST_ERR_CONFIG);
        for (int k = 0; k < 2; k++) {
            if (!strstr(ctx.message, cases[i].says[k])) {
                fail_msg("%zu: %s", i, ctx.message);
            }
        }
    }
}

/* 1000 x 600 pixels, boresight 40 px right of and 25 px above the middle, 600 arcsec a pixel. */
static void light_falls_off_from_the_boresight(void **state) {
    (void)state;
    bst_camera c = {.width_px = 1000,
                    .height_px = 600,
                    .pixel_scale_arcsec = 600,
                    .boresight_offset_px = {40.0, -25.0}};
    const double x0 = 539.5, y0 = 274.5, scale = 600.0 * BST_PI / 648000.0;
    assert_true(bst_camera_illumination(&c, 0.0, 0.0) == 1.0);
    /* cos^4 of the angle that the pixel's centre has from the boresight */
    c.optics.vignetting.model = BST_VIGNETTING_COS4;
    bst_assert_close(bst_camera_illumination(&c, x0, y0), 1.0, 1e-15);
    bst_assert_close(bst_camera_illumination(&c, x0 + 300, y0), pow(cos(atan(300 * scale)), 4),
                     1e-14); /* rounding */
    bst_assert_close(bst_camera_illumination(&c, x0, y0 - 250), pow(cos(atan(250 * scale)), 4),
                     1e-14);
    bst_assert_close(bst_camera_illumination(&c, x0 - 300, y0 + 160),
                     pow(cos(atan(340 * scale)), 4), 1e-14);
    /* nothing beyond the limit, all of the model within */
    c.optics.vignetting.limit_px = 200.0;
    assert_true(bst_camera_illumination(&c, x0, y0 + 200.01) == 0.0);
    assert_true(bst_camera_illumination(&c, x0 - 200.01, y0) == 0.0);
    bst_assert_close(bst_camera_illumination(&c, x0, y0 + 199.99),
                     pow(cos(atan(199.99 * scale)), 4), 1e-14);
    c.optics.vignetting.model = BST_VIGNETTING_NONE;
    assert_true(bst_camera_illumination(&c, x0, y0 + 199.99) == 1.0);
    assert_true(bst_camera_illumination(&c, x0, y0 + 200.01) == 0.0);
    /* s = r^2 over half the diagonal's, 500^2 + 300^2 = 340000: at (300, 160) off 0.34, so that
     * 1 - 0.5 s + 0.3 s^2 - 0.1 s^3 = 1 - 0.17 + 0.03468 - 0.0039304 */
    c.optics.vignetting = (bst_optics_vignetting){.model = BST_VIGNETTING_POLYNOMIAL,
                                                  .coefficients = {-0.5, 0.3, -0.1}};
    bst_assert_close(bst_camera_illumination(&c, x0 + 300, y0 + 160), 0.8607496, 1e-12);
    bst_assert_close(bst_camera_illumination(&c, x0 - 160, y0 - 300), 0.8607496, 1e-12);
    c.optics.vignetting.coefficients[0] = -10.0; /* never below none */
    assert_true(bst_camera_illumination(&c, x0 + 300, y0 + 160) == 0.0);
}

/* Share of a radial profile's light in a pixel, by rings: a ring of radius r from 0.5 to sqrt(0.5)
 * px lies outside the square on eight arcs of acos(0.5 / r). `within` is the closed form of the
 * light in a circle. */
static double energy_by_rings(double (*within)(double r, double width), double width) {
    enum { RINGS = 200000 };
    const double corner = sqrt(0.5);
    double sum = within(0.5, width);
    for (int i = 0; i < RINGS; i++) {
        double r0 = 0.5 + (corner - 0.5) * i / RINGS, r1 = 0.5 + (corner - 0.5) * (i + 1) / RINGS;
        double inside = 1.0 - 8.0 * acos(fmin(1.0, 1.0 / (r0 + r1))) / (2.0 * BST_PI);
        sum += inside * (within(r1, width) - within(r0, width));
    }
    return sum;
}

static double gaussian_within(double r, double fwhm_px) {
    double sigma = fwhm_px / sqrt(8.0 * log(2.0));
    return 1.0 - exp(-0.5 * r * r / (sigma * sigma));
}

static double moffat_within(double r, double fwhm_px) {
    double alpha = 0.5 * fwhm_px / sqrt(exp2(1.0 / 2.5) - 1.0);
    return 1.0 - pow(1.0 + r * r / (alpha * alpha), 1.0 - 2.5);
}

static void width_from_ensquared_energy(void **state) {
    (void)state;
    static const double energies[] = {0.05, 0.2, 0.5, 0.8};
    for (int k = 0; k < 8; k++) {
        bst_ctx ctx = {0};
        bst_camera c = {.ensquared_energy = energies[k / 2]};
        c.optics.psf = k % 2 ? BST_PSF_MOFFAT : BST_PSF_GAUSSIAN;
        c.optics.moffat_beta = 2.5;
        bst_assert_ok(&ctx, bst_camera_resolve_figures(&ctx, &c));
        /* tolerance: Simpson's rule, 1e-5, and the rings */
        bst_assert_close(energy_by_rings(k % 2 ? moffat_within : gaussian_within, c.psf_fwhm_px),
                         energies[k / 2], 2e-5);
    }
    bst_ctx ctx = {0};
    bst_camera c = {.psf_fwhm_px = 2.5, .ensquared_energy = NAN, .zero_point_mag = NAN};
    bst_assert_ok(&ctx, bst_camera_resolve_figures(&ctx, &c));
    bst_assert_close(c.psf_fwhm_px, 2.5, 0.0);
    c.ensquared_energy = 0.99999;
    assert_int_equal(bst_camera_resolve_figures(&ctx, &c), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "ensquared_energy 0.99999 (allowed: 0.000"));
    c.ensquared_energy = 0.3;
    c.optics.psf = BST_PSF_DIFFRACTION;
    assert_int_equal(bst_camera_resolve_figures(&ctx, &c), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "neither gaussian nor moffat"));
}

static void light_from_zero_point(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera c = {.aperture_m = 0.15,
                    .throughput = 0.8,
                    .quantum_efficiency = 0.7,
                    .photon_flux_v0_per_s_m2 = 8.8e9,
                    .zero_point_mag = 22.5};
    for (int again = 0; again < 2; again++) { /* the resolved scenario is read again */
        bst_assert_ok(&ctx, bst_camera_resolve_figures(&ctx, &c));
        bst_assert_close(bst_camera_electrons_per_s(&c, 22.5), 1.0, 1e-13);
        bst_assert_close(bst_camera_electrons_per_s(&c, 20.0), 10.0, 1e-12);
        assert_true(c.throughput == 0.8);
    }
    for (int k = 0; k < 64; k++) { /* a resolved scenario has the same bits when it is read again */
        bst_camera first = c;
        first.zero_point_mag = 20.0 + 0.05 * k;
        bst_assert_ok(&ctx, bst_camera_resolve_figures(&ctx, &first));
        bst_camera second = first;
        bst_assert_ok(&ctx, bst_camera_resolve_figures(&ctx, &second));
        assert_true(second.photon_flux_v0_per_s_m2 == first.photon_flux_v0_per_s_m2);
    }
    /* with a spectrum the throughput follows, and thermal light with it */
    c.band.preset = BST_BAND_SILICON;
    double photons = c.photon_flux_v0_per_s_m2;
    bst_assert_ok(&ctx, bst_camera_resolve_figures(&ctx, &c)); /* it has none yet */
    assert_true(c.throughput == 0.8 && c.photon_flux_v0_per_s_m2 == photons);
    bst_band *band;
    bst_assert_ok(&ctx, bst_band_create(&ctx, &c.band, "", &band));
    c.spectrum = band;
    c.zero_point_mag = bst_camera_v_mag(&c, 1.0) - 1.0;
    bst_assert_ok(&ctx, bst_camera_resolve_figures(&ctx, &c));
    bst_assert_close(c.throughput, 0.8 * pow(10.0, -0.4), 1e-13);
    bst_assert_close(bst_camera_electrons_per_s(&c, c.zero_point_mag), 1.0, 1e-13);
    c.zero_point_mag += 2.0;
    assert_int_equal(bst_camera_resolve_figures(&ctx, &c), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "needs throughput 2.01"));
    bst_band_free(band);
    c.spectrum = NULL;
    c.band.preset = BST_BAND_V;
    c.quantum_efficiency = 0.0;
    assert_int_equal(bst_camera_resolve_figures(&ctx, &c), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "photon_flux_v0_per_s_m2"));
}

/* The field that is symmetric about the boresight: twice the way to the nearer edge. */
static void field_about_a_boresight_off_the_centre(void **state) {
    (void)state;
    bst_camera c = {.width_px = 1000, .height_px = 600, .pixel_scale_arcsec = 3};
    double w, h;
    for (int side = -1; side <= 1; side += 2) {
        c.boresight_offset_px[0] = side * 100.0;
        c.boresight_offset_px[1] = side * -50.0;
        bst_camera_field_px(&c, &w, &h);
        bst_assert_close(w, 2.0 * (500 - 100), 1e-12);
        bst_assert_close(h, 2.0 * (300 - 50), 1e-12);
    }
}

/* A packet passes the rows below it, on the mean of all rows half of the others; the dark current
 * of a row's time each, doubled once, and clock-induced charge. */
static void read_out_gathers_the_rows(void **state) {
    (void)state;
    bst_camera c = {.width_px = 400, .height_px = 5, .dark_current_e_per_s = 3.0};
    c.detector.dark_doubling_k = 6.0;
    c.detector.reference_temperature_c = -20.0;
    c.detector.temperature_c = -14.0;
    c.detector.readout_s = 0.25;
    c.detector.clock_induced_e = 0.7;
    bst_assert_close(bst_camera_dark_e_per_s(&c), 6.0, 1e-12);
    bst_assert_close(bst_camera_readout_e(&c), 6.0 * 0.25 * (0 + 1 + 2 + 3 + 4) / 25.0 + 0.7,
                     1e-12);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(light_falls_off_from_the_boresight),
        cmocka_unit_test(field_about_a_boresight_off_the_centre),
        cmocka_unit_test(width_from_ensquared_energy),
        cmocka_unit_test(light_from_zero_point),
        cmocka_unit_test(scale_from_focal_length_and_pitch),
        cmocka_unit_test(scales_that_contradict),
        cmocka_unit_test(projection_is_gnomonic),
        cmocka_unit_test(unproject_inverts_project),
        cmocka_unit_test(points_are_unprojected_one_by_one),
        cmocka_unit_test(electrons_of_a_star_and_of_the_sky),
        cmocka_unit_test(a_sphere_at_a_geostationary_distance),
        cmocka_unit_test(a_sphere_keeps_the_energy),
        cmocka_unit_test(no_light_is_infinitely_faint),
        cmocka_unit_test(read_out_gathers_the_rows),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
