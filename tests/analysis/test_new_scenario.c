/* boresight new: satellites by name, the sensor's design against the SNR equation, the text. */
#include <unistd.h>

#include "sim/analysis/new/new_scenario.h"
#include "sim/analysis/new/reference_sensor.h"
#include "sim/analysis/new/satellite_lookup.h"
#include "sim/analysis/new/scenario_template.h"
#include "sim/analysis/new/sensor_design.h"
#include "sim/astro/sgp4.h"
#include "sim/cli/plugins.h"
#include "tests/test_support.h"

#define CATALOGUE "scenarios/catalogue_2022-06.tle"

static void test_plain_names(void **state) {
    (void)state;
    char out[28], small[5];
    bst_new_plain_name("NEOSSAT (X)", out, sizeof out);
    assert_string_equal(out, "neossat_x");
    bst_new_plain_name("  -ISS (ZARYA)--", out, sizeof out);
    assert_string_equal(out, "iss_zarya");
    bst_new_plain_name("abc defg", small, sizeof small);
    assert_string_equal(small, "abc");
}

static void test_satellites_are_found(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_new_satellite found;
    bst_assert_ok(&ctx, bst_new_satellite_find(&ctx, "target-tle", "39089", &found));
    assert_string_equal(found.name, "NEOSSAT");
    /* the lines of the file itself */
    assert_memory_equal(found.line1, "1 39089U 13009D   22166.78481540", 32);
    assert_memory_equal(found.line2, "2 39089  98.4228   3.1337 0010095", 33);
    assert_true(found.file[0] == '/');
    bst_assert_ok(&ctx, bst_new_satellite_find(&ctx, "target-tle", "inmarsat gx5", &found));
    assert_int_equal(found.elements.norad, 44801);
    bst_assert_ok(&ctx, bst_new_satellite_find(&ctx, "target-tle", CATALOGUE ":44801", &found));
    assert_int_equal(found.elements.norad, 44801);
}

static void test_satellites_are_refused(void **state) {
    (void)state;
    static const struct {
        const char *which, *message;
        bst_status status;
    } cases[] = {
        {"INMARSAT GX4", "did you mean \"INMARSAT GX5\"?", BST_ERR_NOT_FOUND},
        {CATALOGUE, "holds more than one satellite; say which", BST_ERR_ARGUMENT},
        {CATALOGUE ":x44", "\"x44\" is no catalogue number", BST_ERR_ARGUMENT},
        {"nofile:44801", "--target-tle: nofile", BST_ERR_IO},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        bst_new_satellite found;
        bst_status status = bst_new_satellite_find(&ctx, "target-tle", cases[i].which, &found);
        if (status == BST_OK || !strstr(ctx.message, cases[i].message)) {
            fail_msg("%s: %s: %s", cases[i].which, bst_status_name(status), ctx.message);
        }
        assert_true(cases[i].status == BST_ERR_IO || status == cases[i].status);
    }
}

/* A line of an element set with its checksum: digits add up, minus signs count 1, modulo 10. */
static void write_line(FILE *file, const char *text) {
    int sum = 0;
    for (const char *c = text; *c; c++) {
        sum += *c >= '0' && *c <= '9' ? *c - '0' : *c == '-';
    }
    fprintf(file, "%s%d\n", text, sum % 10);
}

static void test_the_latest_set_is_taken(void **state) {
    (void)state;
    char path[BST_TEST_PATH];
    bst_test_template(path, "sets");
    int fd = mkstemp(path);
    FILE *file = fdopen(fd, "w");
    assert_non_null(file);
    static const char *const days[] = {"22166.78481540", "22168.50000000", "22167.10000000"};
    for (int i = 0; i < 3; i++) {
        char line[80];
        snprintf(line, sizeof line, "1 39089U 13009D   %s  .00000151  00000+0  68433-4 0  999",
                 days[i]);
        write_line(file, line);
        write_line(file, "2 39089  98.4228   3.1337 0010095 284.4434  75.5631 14.3466465048697");
    }
    assert_int_equal(fclose(file), 0);
    bst_ctx ctx = {0};
    bst_new_satellite found;
    bst_assert_ok(&ctx, bst_new_satellite_find(&ctx, "observer-tle", path, &found));
    assert_memory_equal(found.line1 + 18, "22168.5", 7);
    assert_string_equal(found.name, "NORAD 39089");
    unlink(path);
}

static void test_snr(void **state) {
    (void)state;
    /* By hand: 3.6e10 photons/s/m2 of V = 0, 0.15 m, 0.7 x 0.7, V 10, 0.5 s: 15586 e. In 4 pi
     * pixels of 3 arcsec, sky of V 22 per square arcsec gives 4.447 e/s each, dark 0.5 e/s, read
     * noise 5 e. Tolerance: rounding of the operands. */
    bst_assert_close(bst_new_snr(0.15, 3.0, 22.0, 10.0, 0.5), 123.48469228, 1e-7);
    /* shot noise of the source alone: SNR grows as the aperture */
    bst_assert_close(bst_new_snr(2.0, 3.0, 22.0, 2.0, 1.0) / bst_new_snr(1.0, 3.0, 22.0, 2.0, 1.0),
                     2.0, 1e-4);
    /* a sky 1000 times as bright: 4447 e/s in each of 4 pi pixels */
    double noise2 = 15586.0 + 4.0 * BST_PI * (25.0 + 0.5 * (4447.0 + 0.5));
    bst_assert_close(bst_new_snr(0.15, 3.0, 14.5, 10.0, 0.5), 15586.0 / sqrt(noise2), 0.01);
}

static void test_pixel_scale(void **state) {
    (void)state;
    bst_new_request free_choice = {.aperture_m = 0.15}, by_focal = {.focal_m = 0.9},
                    given = {.pixel_arcsec = 4.5};
    /* 13 um / 0.9 m in arcsec, 206264.806 to the radian */
    bst_assert_close(bst_new_pixel_arcsec(&by_focal, 0.0, 0.0), 206264.806 * 13e-6 / 0.9, 1e-7);
    assert_true(bst_new_pixel_arcsec(&given, 500.0, 9.0) == 4.5);
    assert_true(bst_new_pixel_arcsec(&free_choice, 10.0, 11.5) == 3.0);
    assert_true(bst_new_pixel_arcsec(&free_choice, 700.0, 11.5) == 10.0);
    /* with few known stars a field of 1024 pixels is wider than 2 degrees: 8 stars at 3 / deg2 */
    double field_deg = 1024 * bst_new_pixel_arcsec(&free_choice, 10.0, 9.0) / 3600.0;
    assert_true(3.0 * field_deg * field_deg >= 8.0);
}

static void test_period_and_exposure(void **state) {
    (void)state;
    bst_new_request q = {.aperture_m = 0.15}, fixed = {.aperture_m = 0.15, .period_s = 2.5};
    assert_true(bst_new_period_s(&fixed, 1e4, 3.0) == 2.5);
    for (double rate = 1.0; rate < 2000.0; rate *= 1.3) {
        double pixel = bst_new_pixel_arcsec(&q, rate, 11.5),
               period = bst_new_period_s(&q, rate, pixel);
        bst_new_scene s = {.period_s = period,
                           .pixel_arcsec = pixel,
                           .rate_arcsec_per_s = rate,
                           .sky_mag_arcsec2 = 22.0,
                           .faintest_v_mag = 9.5};
        double exposure = bst_new_exposure_s(&q, &s, 9.0);
        assert_true(period == 0.1 || rate * period <= 24.0 * pixel);
        if (exposure > 0.0) {
            assert_true(exposure <= 0.5 * period * 1.1);
            assert_true(bst_new_snr(0.15, pixel, 22.0, 9.5, exposure) >= 12.0);
        }
    }
    /* the faintest target needs the whole period, a fainter one has no exposure */
    bst_new_scene s = {
        .period_s = 1.0, .pixel_arcsec = 3.0, .sky_mag_arcsec2 = 22.0, .faintest_v_mag = 12.0};
    assert_true(bst_new_exposure_s(&q, &s, 12.0) > 0.0);
    /* not before a sky of V 12 per square arcsecond */
    s.sky_mag_arcsec2 = 12.0;
    assert_true(bst_new_exposure_s(&q, &s, 12.0) == 0.0);
    s.sky_mag_arcsec2 = 22.0;
    /* what limits it: stars that move 6 px; half of a full well in the brightest pixel, a fifth of
     * the light of 1/4 pi d^2 of the pupil; half of the period; 5 ms at least. Rounded up to two
     * digits of whole milliseconds */
    double per_s =
        BST_NEW_FLUX_V0 * BST_PI * 0.075 * 0.075 * BST_NEW_THROUGHPUT * BST_NEW_QUANTUM_EFFICIENCY;
    for (int k = 0; k < 4; k++) {
        const double v_mag = k == 1 ? 3.0 : 8.0;
        bst_new_scene limited = {.period_s = 1.6,
                                 .pixel_arcsec = 4.0,
                                 .sky_mag_arcsec2 = 22.0,
                                 .rate_arcsec_per_s = k == 0   ? 130.0
                                                      : k == 3 ? 20000.0
                                                               : 1.0,
                                 .faintest_v_mag = v_mag};
        const double wanted[] = {6.0 * 4.0 / 130.0,
                                 0.5 * BST_NEW_FULL_WELL_E * 5.0 / (per_s * pow(10, -0.4 * 3.0)),
                                 0.8, 0.005};
        double found = bst_new_exposure_s(&q, &limited, v_mag);
        double unit = fmax(pow(10.0, floor(log10(wanted[k])) - 1.0), 1e-3);
        assert_true(found >= wanted[k] - 1e-9 && found < wanted[k] + unit);
    }
    s.faintest_v_mag = 16.0;
    assert_true(bst_new_snr(0.15, 3.0, 22.0, 16.0, 0.5) < 12.0);
    assert_true(bst_new_exposure_s(&q, &s, 16.0) == 0.0);
}

/* The strict reader of scenarios takes the text, and finds in it what it was made from. */
static void test_the_text_is_a_scenario(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_new_request q = {.aperture_m = 0.2, .name = "a \"quoted\" name", .observer_label = "eye"};
    bst_new_scene s = {.duration_s = 90.0,
                       .period_s = 2.0,
                       .exposure_s = 0.75,
                       .pixel_arcsec = 4.25,
                       .side_px = 512,
                       .v_mag = 11.2,
                       .range_m = 4e7,
                       .rate_arcsec_per_s = 250.0};
    bst_assert_ok(&ctx, bst_new_satellite_find(&ctx, "o", "39089", &q.observer));
    bst_assert_ok(&ctx, bst_new_satellite_find(&ctx, "t", "44801", &q.target));
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, "2022-06-16T22:10:00Z", &s.epoch));
    char *text = NULL;
    size_t bytes = 0;
    FILE *stream = open_memstream(&text, &bytes);
    assert_non_null(stream);
    bst_new_scenario_write(stream, &q, &s);
    assert_int_equal(fclose(stream), 0);
    assert_non_null(strstr(text, "a \\\"quoted\\\" name"));
    char *name = strstr(text, "a \\\"quoted\\\" name");
    memcpy(name, "a_..quoted..name", 16); /* names hold letters, digits, _ - . */
    name[14] = 'm';
    bst_json *json = NULL;
    bst_scenario scenario;
    bst_assert_ok(&ctx, bst_json_parse(&ctx, "new", text, bytes, &json));
    bst_assert_ok(&ctx, bst_plugins_scenario_read(&ctx, json, &scenario));
    const bst_observer_config *observer = scenario.observers.items;
    const bst_sensor_config *sensor = observer->sensors.items;
    assert_string_equal(scenario.epoch_utc, "2022-06-16T22:10:00Z");
    assert_true(scenario.duration_s == 90.0);
    assert_string_equal(observer->name, "eye");
    assert_true(sensor->exposure.period_s == 2.0 && sensor->exposure.exposure_s == 0.75);
    assert_int_equal(sensor->camera.width_px, 512);
    bst_assert_close(sensor->camera.aperture_m, 0.2, 1e-12); /* nine digits are written */
    bst_scenario_free(&scenario);
    bst_json_free(json);
    free(text);
}

/* Times of modules are shares of a short period and fixed ones of a long one; what waits for frames
 * waits for as many of a slow camera. */
static void times_by_the_period(void **state) {
    (void)state;
    static const struct {
        double period_s, image_s, tracks_s, command_s, v_mag;
        const char *v, *gap, *timeout;
    } cases[] = {{0.4, 0.12, 0.08, 0.04, 9.3, "\"v_mag\": 9.3", NULL, NULL},
                 {0.8, 0.15, 0.16, 0.05, (double)INFINITY, "\"v_mag\": 10.0", NULL, NULL},
                 {1.5, 0.15, 0.2, 0.05, 12.0, "\"v_mag\": 12.0", NULL, NULL},
                 {2.5, 0.15, 0.2, 0.05, 12.0, "\"v_mag\": 12.0", "\"initiation_gap_s\": 8.75",
                  "\"dwell_timeout_s\": 50,\n                            "
                  "\"acquire_timeout_s\": 50,\n                            "
                  "\"reacquire_coast_s\": 50,"}};
    bst_ctx ctx = {0};
    bst_new_request q = {.aperture_m = 0.2, .name = "a", .observer_label = "eye"};
    bst_assert_ok(&ctx, bst_new_satellite_find(&ctx, "o", "39089", &q.observer));
    bst_assert_ok(&ctx, bst_new_satellite_find(&ctx, "t", "44801", &q.target));
    for (int i = 0; i < 4; i++) {
        bst_new_scene s = {.duration_s = 90.0,
                           .period_s = cases[i].period_s,
                           .exposure_s = 0.3,
                           .pixel_arcsec = 4.5,
                           .side_px = 400,
                           .v_mag = cases[i].v_mag,
                           .range_m = 4e7,
                           .rate_arcsec_per_s = 90.0};
        char *text = NULL, part[96];
        size_t bytes = 0;
        FILE *stream = open_memstream(&text, &bytes);
        bst_new_scenario_write(stream, &q, &s);
        assert_int_equal(fclose(stream), 0);
        const char *const names[] = {"\"los_command\": %.4g}", "\"frame\": %.4g}",
                                     "\"tracks\": %.4g}", "\"command_latency_s\": %.4g,"};
        const double values[] = {cases[i].command_s, cases[i].image_s, cases[i].tracks_s,
                                 cases[i].command_s};
        for (int k = 0; k < 4; k++) {
            snprintf(part, sizeof part, names[k], values[k]);
            if (!strstr(text, part)) {
                fail_msg("period %g: no %s", cases[i].period_s, part);
            }
        }
        assert_non_null(strstr(text, cases[i].v));
        assert_non_null(strstr(text, "\"telemetry_sigma_arcsec\": 3"));
        assert_non_null(strstr(text, "\"rate_sigma_arcsec_per_s\": 0.9,"));
        assert_non_null(strstr(text, "\"offset_deg\": 0.05,")); /* a tenth of 400 x 4.5 arcsec */
        assert_int_equal(strstr(text, "timeout_s") != NULL, cases[i].timeout != NULL);
        assert_true(!cases[i].gap || strstr(text, cases[i].gap));
        assert_true(!cases[i].timeout || strstr(text, cases[i].timeout));
        free(text);
    }
}

/* A judge that keeps the scenes it refuses, best first. */
typedef struct judged {
    bst_new_scene scenes[12];
    int count;
} judged;

static bst_status refuse(void *user, bst_ctx *ctx, const bst_new_scene *scene, bool *holds,
                         char why[256]) {
    judged *j = user;
    (void)ctx;
    assert_true(j->count < 12);
    j->scenes[j->count++] = *scene;
    *holds = false;
    snprintf(why, 256, "refused");
    return BST_OK;
}

static bst_vec3 place_of(const bst_sgp4 *sgp4, const bst_elements *e, bst_time t) {
    bst_time epoch;
    bst_ctx ctx = {0};
    double r[3], v[3];
    bst_assert_ok(&ctx, bst_time_from_utc_jd(&ctx, e->epoch_utc_jd1, e->epoch_utc_jd2, &epoch));
    assert_int_equal(bst_sgp4_propagate(sgp4, bst_time_diff(t, epoch) / 60.0, r, v), BST_SGP4_OK);
    return (bst_vec3){1e3 * r[0], 1e3 * r[1], 1e3 * r[2]};
}

/* Angle from the Earth's limb in place of the true one, rad; 0: the true one. */
static double limb_rad;

double __real_bst_astro_earth_limb_angle(bst_vec3 position_m, bst_vec3 pole, bst_vec3 direction);
double __wrap_bst_astro_earth_limb_angle(bst_vec3 position_m, bst_vec3 pole, bst_vec3 direction);

double __wrap_bst_astro_earth_limb_angle(bst_vec3 position_m, bst_vec3 pole, bst_vec3 direction) {
    return limb_rad > 0.0 ? limb_rad
                          : __real_bst_astro_earth_limb_angle(position_m, pole, direction);
}

/* A field is taken whose corner, half a diagonal away, is seen through more than 60 km above the
 * limb, and not one whose corner is lower. Of the distance of the limb 2 %: the Earth's figure. */
static void test_corners_keep_off_the_limb(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_new_request q = {.aperture_m = 0.15,
                         .pixel_arcsec = 8.0,
                         .name = "search",
                         .observer_label = "eye",
                         .start = "2022-06-16T12:00:00Z"};
    bst_assert_ok(&ctx, bst_new_satellite_find(&ctx, "o", "39089", &q.observer));
    bst_assert_ok(&ctx, bst_new_satellite_find(&ctx, "t", "44801", &q.target));
    bst_sgp4 *eye;
    bst_assert_ok(
        &ctx, bst_sgp4_create(&ctx, &q.observer.elements, BST_SGP4_WGS72, BST_SGP4_AFSPC, &eye));
    judged j[3] = {{.count = 0}};
    bst_new_scene none;
    double corner = 0.0;
    for (int k = 0; k < 3; k++) {
        limb_rad = k == 0 ? 0.5 : corner * (k == 1 ? 1.02 : 0.98);
        assert_int_equal(bst_new_scene_find(&ctx, &q, refuse, &j[k], &none), BST_ERR_NOT_FOUND);
        assert_true(j[k].count > 0);
        const bst_new_scene *s = &j[0].scenes[0];
        double r = bst_vec3_norm(place_of(eye, &q.observer.elements, s->epoch));
        corner = s->side_px * s->pixel_arcsec * BST_ARCSEC_RAD / sqrt(2.0) +
                 atan(60e3 / sqrt(r * r - 6371e3 * 6371e3));
    }
    limb_rad = 0.0;
    int same[3] = {0};
    for (int k = 1; k < 3; k++) {
        for (int i = 0; i < j[k].count; i++) {
            same[k] += j[k].scenes[i].side_px == j[0].scenes[0].side_px &&
                       j[k].scenes[i].pixel_arcsec == j[0].scenes[0].pixel_arcsec;
        }
    }
    assert_true(same[1] > 0);
    assert_int_equal(same[2], 0);
    bst_sgp4_free(eye);
}

/* Two satellites of one shell see each other only near the limb: never through less than 100 km
 * above the Earth, here a sphere of the equator's radius less 22 km of flattening, nor in front of
 * a sky brighter than V 16 per square arcsecond, which the limb glow has there where the Sun is
 * overhead (2.4 + 2.5 log10(e) 100 km / 8 km). */
static void test_lines_of_sight_clear_the_limb(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_new_request q = {.aperture_m = 0.6, .name = "search", .observer_label = "eye"};
    bst_sgp4 *eye, *target;
    bst_assert_ok(&ctx, bst_new_satellite_find(&ctx, "o", "46038", &q.observer));
    bst_assert_ok(&ctx, bst_new_satellite_find(&ctx, "t", "45701", &q.target));
    bst_assert_ok(
        &ctx, bst_sgp4_create(&ctx, &q.observer.elements, BST_SGP4_WGS72, BST_SGP4_AFSPC, &eye));
    bst_assert_ok(
        &ctx, bst_sgp4_create(&ctx, &q.target.elements, BST_SGP4_WGS72, BST_SGP4_AFSPC, &target));
    judged j = {.count = 0};
    bst_new_scene none;
    assert_int_equal(bst_new_scene_find(&ctx, &q, refuse, &j, &none), BST_ERR_NOT_FOUND);
    assert_true(j.count > 0);
    for (int k = 0; k < j.count; k++) {
        for (double t = 0.0; t <= j.scenes[k].duration_s; t += 20.0) {
            bst_time at = bst_time_add(j.scenes[k].epoch, t);
            bst_vec3 here = place_of(eye, &q.observer.elements, at),
                     line = bst_vec3_sub(place_of(target, &q.target.elements, at), here);
            double lowest = bst_vec3_norm(bst_vec3_cross(here, bst_vec3_unit(line)));
            assert_true(lowest > 6378137.0 - 22e3 + 100e3);
        }
        assert_true(j.scenes[k].sky_mag_arcsec2 > 16.0 && j.scenes[k].sky_mag_arcsec2 < 22.1);
    }
    bst_sgp4_free(eye);
    bst_sgp4_free(target);
}

/* The scenes found in two days: range, rate and angle from the limb over the run by SGP4 in TEME
 * alone (light time and aberration: 30 arcsec; the Earth as a sphere: 0.2 degrees), magnitudes in
 * their order, and the costs ascending. */
static void test_scenes_are_as_seen(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_new_request q = {.aperture_m = 0.15,
                         .name = "search",
                         .observer_label = "eye",
                         .start = "2022-06-16T12:00:00Z"};
    bst_assert_ok(&ctx, bst_new_satellite_find(&ctx, "o", "39089", &q.observer));
    bst_assert_ok(&ctx, bst_new_satellite_find(&ctx, "t", "44801", &q.target));
    bst_sgp4 *eye, *target;
    bst_assert_ok(
        &ctx, bst_sgp4_create(&ctx, &q.observer.elements, BST_SGP4_WGS72, BST_SGP4_AFSPC, &eye));
    bst_assert_ok(
        &ctx, bst_sgp4_create(&ctx, &q.target.elements, BST_SGP4_WGS72, BST_SGP4_AFSPC, &target));
    judged j = {.count = 0};
    bst_new_scene none;
    assert_int_equal(bst_new_scene_find(&ctx, &q, refuse, &j, &none), BST_ERR_NOT_FOUND);
    assert_non_null(strstr(ctx.message, "refused"));
    assert_int_equal(j.count, 12);
    double before = -INFINITY;
    for (int k = 0; k < j.count; k++) {
        const bst_new_scene *s = &j.scenes[k];
        double range = INFINITY, rate = 0.0, limb = INFINITY;
        bst_assert_close(s->duration_s, 120.0, 0.0);
        for (double t = 0.0; t <= s->duration_s; t += 20.0) {
            bst_vec3 seen[2], here = {0};
            for (int n = 0; n < 2; n++) {
                bst_time at = bst_time_add(s->epoch, t + n);
                here = place_of(eye, &q.observer.elements, at);
                seen[n] = bst_vec3_sub(place_of(target, &q.target.elements, at), here);
            }
            range = fmin(range, bst_vec3_norm(seen[0]));
            rate = fmax(rate, bst_vec3_angle(seen[0], seen[1]) / BST_ARCSEC_RAD);
            double down = bst_vec3_angle(seen[0], bst_vec3_scale(here, -1.0));
            limb = fmin(limb, down - asin(6371e3 / bst_vec3_norm(here)));
        }
        bst_assert_close(s->range_m, range, 1e-3 * range);
        bst_assert_close(s->rate_arcsec_per_s, rate, 0.3);
        bst_assert_close(s->limb_rad, limb, 0.5 * BST_DEG_RAD);
        assert_true(s->faintest_v_mag >= s->v_mag && s->faintest_v_mag < s->v_mag + 1.0);
        double field = s->side_px * s->pixel_arcsec * BST_ARCSEC_RAD;
        assert_true(s->limb_rad >= field / sqrt(2.0)); /* half a diagonal */
        double cost = log(s->rate_arcsec_per_s + 10.0) + 0.3 * s->faintest_v_mag;
        assert_true(cost >= before);
        before = cost;
        /* what is refused is not tried again next to it */
        for (int n = 0; n < k; n++) {
            assert_true(fabs(bst_time_diff(s->epoch, j.scenes[n].epoch)) > 299.0);
        }
        bst_time start;
        bst_assert_ok(&ctx, bst_time_from_utc(&ctx, q.start, &start));
        double after = bst_time_diff(s->epoch, start);
        assert_true(after >= 0.0 && after <= 2.0 * 86400.0);
        bst_assert_close(fmod(after + 1e-6, 20.0), 0.0, 1e-3);
    }
    bst_sgp4_free(eye);
    bst_sgp4_free(target);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_plain_names),
        cmocka_unit_test(times_by_the_period),
        cmocka_unit_test(test_corners_keep_off_the_limb),
        cmocka_unit_test(test_lines_of_sight_clear_the_limb),
        cmocka_unit_test(test_scenes_are_as_seen),
        cmocka_unit_test(test_satellites_are_found),
        cmocka_unit_test(test_satellites_are_refused),
        cmocka_unit_test(test_the_latest_set_is_taken),
        cmocka_unit_test(test_snr),
        cmocka_unit_test(test_pixel_scale),
        cmocka_unit_test(test_period_and_exposure),
        cmocka_unit_test(test_the_text_is_a_scenario),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
