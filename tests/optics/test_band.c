/* Bands: Planck's law and its quadrature, the Sun, stars of all colours, and a case by hand in each
 * band. */
#include "sim/optics/band.h"

#include <unistd.h>

#include "boresight/camera.h"
#include "boresight/vec.h"
#include "tests/test_support.h"

static bst_band *band_of(int preset) {
    bst_ctx ctx = {0};
    bst_band *band;
    bst_band_config config = {.preset = preset};
    bst_assert_ok(&ctx, bst_band_create(&ctx, &config, "", &band));
    return band;
}

static bst_band *band_from(const bst_optics_response_point *points, int count) {
    bst_ctx ctx = {0};
    bst_band *band;
    bst_band_config config = {.preset = BST_BAND_LWIR, .response = {(void *)points, count}};
    bst_assert_ok(&ctx, bst_band_create(&ctx, &config, "", &band));
    return band;
}

/* Photons of a black body above x = h c / (lambda k T), over those at all wavelengths: the series
 * sum exp(-n x) (x^2 / n + 2 x / n^2 + 2 / n^3) / (2 zeta(3)). */
static double photons_below(double wavelength_m, double temperature_k) {
    double x = 6.62607015e-34 * 299792458.0 / (1.380649e-23 * wavelength_m * temperature_k);
    double sum = 0.0;
    for (int n = 1; n < 2000; n++) {
        sum += exp(-n * x) * (x * x / n + 2.0 * x / (n * n) + 2.0 / ((double)n * n * n));
    }
    return sum / (2.0 * 1.2020569031595942);
}

/* Photon radiance of a black body: 2 zeta(3) 2 k^3 / (h^3 c^2) T^3 = 1.520461e+15 T^3 / pi per m2,
 * s and sr; a box from a to b takes the share between the two series. */
static void the_integral_of_planck_is_the_series(void **state) {
    (void)state;
    const double pairs[][2] = {{0.2, 30}, {3.5, 5}, {8, 12}, {0.9, 1.7}};
    for (int i = 0; i < 4; i++) {
        bst_optics_response_point box[2] = {{pairs[i][0], 1}, {pairs[i][1], 1}};
        bst_band *band = band_from(box, 2);
        for (double t = 60; t < 30000; t *= 1.7) {
            double all = 1.5204608594e+15 / BST_PI * t * t * t;
            double expected = all * (photons_below(box[1].wavelength_um * 1e-6, t) -
                                     photons_below(box[0].wavelength_um * 1e-6, t));
            /* the constant's eleven digits; the series' difference has no more where nearly all
             * light is beyond the box */
            bst_assert_close(bst_band_radiance(band, t), expected, 1e-10 * expected + 1e-13 * all);
        }
        bst_band_free(band);
    }
}

static void planck_at_its_ends(void **state) {
    (void)state;
    /* 10 um, 300 K by hand: h c / (lambda k T) = 1.43877688e-2 / 3e-3 = 4.79592; exp - 1 =
     * 120.0166; 2 c / lambda^4 = 5.99584916e8 / 1e-20 = 5.99584916e28; 4.99585e26 */
    bst_assert_close(bst_optics_planck_photons(1e-5, 300) / 4.99585e26, 1, 2e-5); /* digits above */
    bst_assert_close(bst_optics_planck_photons(1e-5, 0), 0, 0);
    bst_assert_close(bst_optics_planck_photons(5e-7, 3), 0,
                     0); /* exp(9592) overflows to no light */
    /* Rayleigh and Jeans: 2 k T / (h lambda^3), x = 0.00048: off by x / 2 */
    double jeans = 2 * 1.380649e-23 * 1e6 / (6.62607015e-34 * 2.7e-14);
    bst_assert_close(bst_optics_planck_photons(3e-5, 1e6) / jeans, 1, 3e-4);
}

/* The table's source: 1347.93 W/m2 between 0.28 and 4 um by the trapezium rule on its 2002 rows.
 * The solar constant of ASTM E490, 1366.1 W/m2, is that plus the ends: sigma T^4 of 5562 K beyond 4
 * um gives 10.4, and 0.6 % of the Sun's light is below 0.28 um (Neckel and Labs 1984: 0.5 to 0.7
 * %). */
static void the_sun_has_its_constant(void **state) {
    (void)state;
    double sum = 0, beyond = 0;
    for (double um = 0.2; um < 4; um += 1e-4) {
        sum += bst_optics_sun_irradiance((um + 5e-5) * 1e-6) * 1e-10;
    }
    for (double um = 4; um < 1000; um *= 1.001) {
        beyond += bst_optics_sun_irradiance(um * 1.0005e-6) * um * 0.001e-6;
    }
    bst_assert_close(sum, 1347.93, 0.5); /* the coarse nodes, two of them halved at the ends */
    bst_assert_close(sum + beyond, 1366.1 * 0.995, 0.005 * 1366.1); /* what is below 0.28 um */
    /* its brightness temperature at 4 um joins smoothly */
    bst_assert_close(bst_optics_sun_irradiance(4.0001e-6) / bst_optics_sun_irradiance(3.9999e-6), 1,
                     1e-3);
    bst_assert_close(bst_optics_sun_irradiance(0.27e-6), 0, 0);
}

/* Through Bessell's V the table's Sun is as bright as Willmer (ApJS 236, 47, 2018) has it: -26.76;
 * a star of V = 0 has 995.5 photons/s/cm2/A over the 893 A of the passband, 8.890e9 per m2. */
static void the_sun_and_a_star_through_v(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_band *band;
    bst_optics_response_point clear[2] = {{0.3, 1}, {1.0, 1}};
    bst_band_config config = {.preset = BST_BAND_V, .transmission = {clear, 2}};
    bst_assert_ok(&ctx, bst_band_create(&ctx, &config, "", &band));
    double sun = bst_band_sun(band), star = bst_band_star(band, 0.65);
    bst_assert_close(-2.5 * log10(sun / star), -26.76, 0.01); /* spread of published values: 0.02 */
    bst_assert_close(star / 8.890e9, 1, 0.012); /* weighted by photons or by energy: 1 % */
    /* colour hardly matters where V is defined */
    bst_assert_close(bst_band_star(band, -0.2) / bst_band_star(band, 1.6), 1, 0.03);
    bst_assert_close(bst_band_star(band, (double)NAN), star, 1e-9 * star); /* rounding */
    bst_band_free(band);
}

/* Ballesteros 2012: 5772 K at the Sun's colour, 10125 K at 0. */
static void temperatures_of_stars(void **state) {
    (void)state;
    bst_assert_close(bst_optics_star_temperature_k(0), 4600 * (1 / 1.7 + 1 / 0.62),
                     1e-9);                                          /* closed form */
    bst_assert_close(bst_optics_star_temperature_k(0.65), 5772, 60); /* the paper's own agreement */
}

/* Gaia's G (Evans et al. 2018) every 20 nm from 0.32 um, and the published G - V of B - V of the
 * Gaia DR2 documentation (table 5.7, scatter 0.063 mag), measured from B - V = 0. What a black body
 * misses: 0.03 mag to B - V 1.3, 0.1 to 1.7, 0.36 at 2.4. */
static void colours_against_published_photometry(void **state) {
    (void)state;
    static const double g[] = {0.000, 0.056, 0.093, 0.118, 0.338, 0.475, 0.544, 0.593,
                               0.634, 0.665, 0.687, 0.701, 0.708, 0.712, 0.712, 0.709,
                               0.701, 0.692, 0.680, 0.663, 0.641, 0.613, 0.579, 0.540,
                               0.497, 0.448, 0.398, 0.345, 0.293, 0.244, 0.196, 0.152,
                               0.114, 0.081, 0.055, 0.035, 0.021, 0.011, 0.005, 0.000};
    bst_optics_response_point points[40];
    for (int i = 0; i < 40; i++) {
        points[i] = (bst_optics_response_point){0.32 + 0.02 * i, g[i]};
    }
    bst_band *band = band_from(points, 40);
    double zero = bst_band_star(band, 0);
    for (double c = -0.3; c < 2.45; c += 0.1) {
        double published = -0.02385 * c - 0.2297 * c * c - 0.001768 * c * c * c;
        double ours = -2.5 * log10(bst_band_star(band, c) / zero);
        bst_assert_close(ours, published, c < 1.35 ? 0.03 : c < 1.75 ? 0.11 : 0.37);
    }
    bst_band_free(band);
}

/* Sums in Python (numpy, step 10 pm, the source's own 2002 rows for the Sun, CODATA constants):
 * sunlight in photons/s/m2, radiance at 300 and 220 K in photons/s/m2/sr. */
static void presets_against_independent_sums(void **state) {
    (void)state;
    const struct {
        int preset;
        double sun, at_300_k, at_220_k;
    } cases[] = {{BST_BAND_SILICON, 2.27247088e21, 29950.935, 0.00189125},
                 {BST_BAND_SWIR, 2.06057468e21, 1.295631041e12, 26329188.8},
                 {BST_BAND_MWIR, 2.61797576e20, 4.118409864e19, 8.933405270e17},
                 {BST_BAND_LWIR, 5.94317889e19, 1.935371092e21, 3.416047990e20}};
    for (int i = 0; i < 4; i++) {
        bst_band *band = band_of(cases[i].preset);
        /* nodes of the coarse table */
        bst_assert_close(bst_band_sun(band) / cases[i].sun, 1, 5e-3);
        /* the sums' step where exp(-h c / lambda k T) is steep */
        bst_assert_close(bst_band_radiance(band, 300) / cases[i].at_300_k, 1, 1e-5);
        bst_assert_close(bst_band_radiance(band, 220) / cases[i].at_220_k, 1, 1e-5);
        assert_int_equal(bst_band_is_thermal(band), cases[i].preset >= BST_BAND_MWIR);
        bst_band_free(band);
    }
    assert_null(band_of(BST_BAND_V));
}

static bst_camera camera_of(const bst_band *band) {
    return (bst_camera){.width_px = 64,
                        .height_px = 64,
                        .pixel_scale_arcsec = 3,
                        .aperture_m = 0.2,
                        .throughput = 0.5,
                        .quantum_efficiency = 0.8,
                        .background_mag_arcsec2 = 40,
                        .spectrum = band};
}

/* By hand, camera of 0.2 m, 0.5 and 0.8: 0.0314159 m2 * 0.4 = 0.01256637 m2.
 * Silicon, sunlit object of V = 10: 2.272e21 * 10^(-0.4 * 36.74) = 2.272e21 * 2.0137e-15 = 4.576e6
 *   per m2; 57,500 e/s. A V = 10 star of the Sun's colour gets the same within the difference of
 * its V, -26.76 and -26.74: 2 %, and its black body's in the red. SWIR: 2.0606e21 * 2.0137e-15 *
 * 0.01256637 = 52,140 e/s. MWIR, 1 m2 black at 300 K at 1000 km: 1e-12 sr * 4.1184e19 * 0.01256637
 * = 517,530 e/s. LWIR: 1e-12 * 1.93537e21 * 0.01256637 = 2.43206e7 e/s; at 220 K 4.29272e6. */
static void one_case_by_hand_in_each_band(void **state) {
    (void)state;
    bst_band *silicon = band_of(BST_BAND_SILICON), *swir = band_of(BST_BAND_SWIR),
             *mwir = band_of(BST_BAND_MWIR), *lwir = band_of(BST_BAND_LWIR);
    bst_camera c = camera_of(silicon);
    bst_assert_close(bst_camera_electrons_per_s(&c, 10) / 57500, 1, 3e-3); /* the Sun's table */
    bst_assert_close(bst_camera_star_electrons_per_s(&c, 10, 0.65) / 57500, 1, 0.05);
    bst_assert_close(bst_camera_v_mag(&c, bst_camera_electrons_per_s(&c, 7.3)), 7.3, 1e-12);
    c = camera_of(swir);
    bst_assert_close(bst_camera_electrons_per_s(&c, 10) / 52140, 1, 3e-3);
    c = camera_of(mwir);
    bst_assert_close(bst_camera_thermal_electrons_per_s(&c, 300, 1e-12) / 517530, 1, 1e-4);
    c = camera_of(lwir);
    bst_assert_close(bst_camera_thermal_electrons_per_s(&c, 300, 1e-12) / 2.43206e7, 1, 1e-4);
    bst_assert_close(bst_camera_thermal_electrons_per_s(&c, 220, 1e-12) / 4.29272e6, 1, 1e-4);
    bst_assert_close(bst_camera_thermal_electrons_per_s(&c, 0, 1e-12), 0, 0);
    bst_assert_close(bst_camera_thermal_electrons_per_s(&c, 300, 0), 0, 0);
    /* the camera of old has no thermal light */
    c = camera_of(NULL);
    bst_assert_close(bst_camera_thermal_electrons_per_s(&c, 300, 1e-12), 0, 0);
    bst_assert_close(bst_camera_optics_e_per_s(&c), 0, 0);
    bst_band_free(silicon);
    bst_band_free(swir);
    bst_band_free(mwir);
    bst_band_free(lwir);
}

/* LWIR optics at 300 K, emissivity 0.1, warm surfaces over four times the beam, no throughput on
 * their way: pixel (3 arcsec)^2 = 2.11539e-10 sr; 0.1 * 4 * 1.93537e21 * 2.11539e-10 * 0.0314159 *
 * 0.8 = 4.11576e9 e/s. */
static void warm_optics_by_hand(void **state) {
    (void)state;
    bst_band *lwir = band_of(BST_BAND_LWIR);
    bst_camera c = camera_of(lwir);
    c.band = (bst_band_config){
        .optics_temperature_k = 300, .optics_emissivity = 0.1, .optics_beam_factor = 4};
    bst_assert_close(bst_camera_optics_e_per_s(&c) / 4.11576e9, 1, 1e-4); /* digits above */
    c.background_mag_arcsec2 = 40;
    bst_assert_close(bst_camera_background_e_per_s(&c) / bst_camera_optics_e_per_s(&c), 1, 1e-9);
    c.throughput = 0.25; /* behind the warm surfaces there is no more loss */
    bst_assert_close(bst_camera_optics_e_per_s(&c) / 4.11576e9, 1, 1e-4);
    c.throughput = 0;
    bst_assert_close(bst_camera_optics_e_per_s(&c), 0, 0);
    bst_band_free(lwir);
}

/* Detector times transmission, with corners at different wavelengths. */
static void tables_are_multiplied(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_band *band;
    bst_optics_response_point detector[3] = {{0.4, 0.2}, {0.6, 1}, {0.9, 0}};
    bst_optics_response_point optics[3] = {{0.5, 0.5}, {0.55, 1}, {0.8, 0.5}};
    bst_band_config config = {
        .preset = BST_BAND_SILICON, .response = {detector, 3}, .transmission = {optics, 3}};
    bst_assert_ok(&ctx, bst_band_create(&ctx, &config, "", &band));
    bst_assert_close(bst_band_response(band, 0.525e-6), 0.7 * 0.75, 1e-12); /* rounding */
    bst_assert_close(bst_band_response(band, 0.7e-6), (2.0 / 3) * 0.7, 1e-12);
    bst_assert_close(bst_band_response(band, 0.45e-6), 0, 0);
    bst_assert_close(bst_band_response(band, 0.85e-6), 0, 0);
    bst_band_free(band);
}

static void expect_refused(const bst_band_config *config, const char *words) {
    bst_ctx ctx = {0};
    bst_band *band;
    assert_int_equal(bst_band_create(&ctx, config, "", &band), BST_ERR_CONFIG);
    assert_null(band);
    if (!strstr(ctx.message, words)) {
        fail_msg("\"%s\" is not in \"%s\"", words, ctx.message);
    }
}

static void wrong_tables_are_refused(void **state) {
    (void)state;
    bst_optics_response_point back[2] = {{0.6, 1}, {0.5, 1}}, one[1] = {{0.5, 1}},
                              dark[2] = {{0.5, 0}, {0.6, 0}}, far[2] = {{5, 1}, {6, 1}};
    expect_refused(&(bst_band_config){.response = {back, 2}}, "response/1/wavelength_um");
    expect_refused(&(bst_band_config){.transmission = {one, 1}}, "transmission: one wavelength");
    expect_refused(&(bst_band_config){.response = {dark, 2}}, "zero at all wavelengths");
    expect_refused(&(bst_band_config){.preset = BST_BAND_SILICON, .transmission = {far, 2}},
                   "zero at all wavelengths");
    expect_refused(&(bst_band_config){.response = {dark, 2}, .response_file = "x.csv"}, "not both");
    expect_refused(&(bst_band_config){.response_file = "/nowhere/x.csv"}, "response_file");
}

static void write_file(char path[BST_TEST_PATH], const char *text) {
    bst_test_template(path, "band");
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    assert_int_equal(write(fd, text, strlen(text)), (ssize_t)strlen(text));
    close(fd);
}

static void tables_from_files(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_band *band;
    bst_band_config config = {.preset = BST_BAND_V};
    char path[BST_TEST_PATH];
    write_file(path, "# of a detector\nwavelength_um, response\n0.4,0\n0.5, 1\n\n0.9,1\n1.0,0\n");
    snprintf(config.response_file, sizeof config.response_file, "%s", path);
    bst_assert_ok(&ctx, bst_band_create(&ctx, &config, "", &band));
    bst_assert_close(bst_band_response(band, 0.45e-6), 0.5, 1e-12); /* rounding */
    bst_band_free(band);
    unlink(path);
    const char *wrong[][2] = {
        {"wavelength_nm,response\n400,1\n", ":1: the column is not known"},
        {"wavelength_um,response\n0.4,1\n0.5,1.5\n", ":3: response is not a number in its range"},
        {"wavelength_um,response\n0.5,1\n0.5,1\n", ":3: the first column does not ascend"},
        {"wavelength_um,response\n0.5\n", ":2: the row does not have two fields"},
        {"wavelength_um,response\n0.5,1,2\n", ":2: the row does not have two fields"},
        {"wavelength_um,response\nx,1\n", "wavelength_um is not a number"},
        {"wavelength_um,response\n", "has no rows"},
        {"", "has no rows"}};
    for (int i = 0; i < 8; i++) {
        write_file(path, wrong[i][0]);
        snprintf(config.response_file, sizeof config.response_file, "%s", path);
        expect_refused(&config, wrong[i][1]);
        unlink(path);
    }
}

/* Sunlight that was reddened linearly with the wavelength: as at the mean wavelength of its photons
 * in the band; and of each interval of wavelengths by itself, the bands are within. */
static void reddened_sunlight_is_that_of_the_wavelengths(void **state) {
    (void)state;
    const double *w = bst_sunlight_wavelength_m;
    for (int k = 0; k + 1 < BST_SUNLIGHT_COLOURS; k++) {
        double low_um = 1e6 * (w[k] + 0.1 * (w[k + 1] - w[k]));
        double high_um = 1e6 * (w[k] + 0.4 * (w[k + 1] - w[k]));
        bst_optics_response_point points[2] = {{low_um, 1.0}, {high_um, 0.4}};
        bst_band *band = band_from(points, 2);
        double light[BST_SUNLIGHT_COLOURS], photons = 0.0, mean_m = 0.0;
        for (int n = 0; n < 4000; n++) {
            double m = 1e-6 * (low_um + (high_um - low_um) * (n + 0.5) / 4000);
            double part = bst_band_response(band, m) * bst_optics_sun_irradiance(m) * m;
            photons += part;
            mean_m += part * m;
        }
        mean_m /= photons;
        for (int i = 0; i < BST_SUNLIGHT_COLOURS; i++) {
            light[i] = 0.1 + 0.7e6 * w[i];
        }
        /* nodes of the coarse table of the Sun */
        bst_assert_close(bst_band_reddened_sun(band, light), 0.1 + 0.7e6 * mean_m, 2e-3);
        bst_band_free(band);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_integral_of_planck_is_the_series),
        cmocka_unit_test(planck_at_its_ends),
        cmocka_unit_test(the_sun_has_its_constant),
        cmocka_unit_test(the_sun_and_a_star_through_v),
        cmocka_unit_test(temperatures_of_stars),
        cmocka_unit_test(colours_against_published_photometry),
        cmocka_unit_test(presets_against_independent_sums),
        cmocka_unit_test(one_case_by_hand_in_each_band),
        cmocka_unit_test(warm_optics_by_hand),
        cmocka_unit_test(tables_are_multiplied),
        cmocka_unit_test(wrong_tables_are_refused),
        cmocka_unit_test(tables_from_files),
        cmocka_unit_test(reddened_sunlight_is_that_of_the_wavelengths),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
