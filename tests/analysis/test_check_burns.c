/* What `check` says of burns that a tracker cannot follow, against the velocity across the line of
 * sight and the limits of a filter with white noise of acceleration; and its figures of sensors and
 * targets, against the photons of a star, sums over pixels and the states of both bodies. */
#include <cjson/cJSON.h>
#include <string.h>

#include "boresight/vec.h"
#include "sim/analysis/check/check_burns.h"
#include "sim/analysis/check/check_figures.h"
#include "sim/cli/load.h"
#include "sim/world/world.h"
#include "tests/test_support.h"

#define TRACKER "/observers/0/sensors/0/modules/tracker/"

static bst_world *made;
static char said[1200];

const bst_world *__wrap_bst_simulation_world(const bst_simulation *simulation);
const bst_world *__wrap_bst_simulation_world(const bst_simulation *simulation) {
    (void)simulation;
    return made;
}

static void keep(void *user, bst_log_level level, const char *message) {
    (void)user;
    if (level == BST_LOG_WARNING) {
        snprintf(said, sizeof said, "%s", message);
    }
}

/* A burn at 50 s; what is said of it, "" if nothing. Returned: the velocity across, m/s, the range.
 */
static void check(const double dv_rtn[3], double duration_s, const char *events, double *across,
                  double *range) {
    bst_ctx ctx;
    bst_load_options load = BST_LOAD_DEFAULTS;
    bst_option none[] = {{.name = NULL}};
    bst_json *json;
    bst_scenario scenario;
    char burn[200];
    bst_ctx_init(&ctx, keep, NULL, BST_LOG_WARNING);
    snprintf(burn, sizeof burn,
             "/world/objects/0/burns=[{\"time_s\": 50, \"dv_rtn_mps\": [%.9g, %.9g, %.9g], "
             "\"duration_s\": %g}]",
             dv_rtn[0], dv_rtn[1], dv_rtn[2], duration_s);
    bst_assert_ok(&ctx, bst_load_check(&ctx, &load, none));
    const char *sets[] = {
        burn,
        "/world/star_catalogue=embedded",
        "/world/objects/0/orbit={\"source\": \"numerical\", \"state\": {\"source\": "
        "\"keplerian\", \"semi_major_axis_m\": 2.6e7, \"eccentricity\": 0.3, "
        "\"inclination_deg\": 50, \"raan_deg\": 120, \"true_anomaly_deg\": 80}}",
        "/observers/0/sensors/0/exposure/period_s=4",
        TRACKER "gate_chi2=9",
        TRACKER "process_noise_arcsec_per_s15=0.3",
        TRACKER "manoeuvre_noise_arcsec_per_s15=2",
        events};
    for (size_t i = 0; i < sizeof sets / sizeof *sets; i++) {
        load.set.items[load.set.count++] = sets[i];
    }
    bst_assert_ok(
        &ctx, bst_load_scenario(&ctx, "scenarios/neossat_geo_track.json", &load, &json, &scenario));
    bst_assert_ok(&ctx, bst_world_create(&ctx, scenario.file, &scenario.world, &scenario.observers,
                                         "", scenario.epoch, &made));
    said[0] = '\0';
    bst_assert_ok(&ctx, bst_check_burns(&ctx, &scenario, NULL));
    bst_world_view *view;
    bst_world_state target, eye;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, made, &view));
    bst_assert_ok(&ctx, bst_world_view_object_state(&ctx, view, 0, 50.0, &target));
    bst_assert_ok(&ctx, bst_world_view_observer_state(&ctx, view, 0, 50.0, &eye));
    /* along the radius, along the track across it, and along the angular momentum */
    bst_vec3 r = bst_vec3_unit(target.position_m);
    bst_vec3 t =
        bst_vec3_unit(bst_vec3_axpy(target.velocity_mps, -bst_vec3_dot(target.velocity_mps, r), r));
    bst_vec3 n = bst_vec3_cross(r, t);
    bst_vec3 dv = {dv_rtn[0] * r.x + dv_rtn[1] * t.x + dv_rtn[2] * n.x,
                   dv_rtn[0] * r.y + dv_rtn[1] * t.y + dv_rtn[2] * n.y,
                   dv_rtn[0] * r.z + dv_rtn[1] * t.z + dv_rtn[2] * n.z};
    bst_vec3 line = bst_vec3_sub(target.position_m, eye.position_m);
    *range = bst_vec3_norm(line);
    double towards = bst_vec3_dot(dv, line) / *range;
    *across = sqrt(bst_vec3_dot(dv, dv) - towards * towards);
    bst_world_view_free(view);
    bst_world_free(made);
    bst_scenario_free(&scenario);
    bst_json_free(json);
}

/* A burn of this direction that turns the line of sight by so much more, or less, than `limit`,
 * arcsec/s or arcsec/s2: said with its numbers, or not at all. */
static void expect(const double direction[3], double duration_s, const char *events, double limit,
                   const char *unit) {
    double across, range;
    check(direction, duration_s, events, &across, &range);
    double per_s = duration_s > 4.0 ? duration_s : 1.0;
    double one = across / range / per_s / BST_ARCSEC_RAD; /* of a burn of 1 m/s */
    for (int more = 0; more < 2; more++) {
        double speed = limit / one * (more ? 1.02 : 0.98), dv[3];
        for (int i = 0; i < 3; i++) {
            dv[i] = speed * direction[i];
        }
        check(dv, duration_s, events, &across, &range);
        if (!more) {
            assert_string_equal(said, "");
            continue;
        }
        double km = 0.0, turn = 0.0, follows = 0.0;
        char units[2][20];
        const char *at = strstr(said, ": at ");
        if (!at ||
            sscanf(at,
                   ": at %lf km it turns the line of sight from /observers/0/sensors/0 by "
                   "%lf %19[^;]; its tracker (%*[a-z], a frame each 4 s) follows %lf %19[^ ]",
                   &km, &turn, units[0], &follows, units[1]) != 5) {
            fail_msg("said: %s", said);
        }
        bst_assert_close(km, 1e-3 * range, 1e-3 * km);
        bst_assert_close(turn, 1.02 * limit, 0.006 * limit);
        bst_assert_close(follows, limit, 0.006 * limit);
        assert_string_equal(units[0], unit);
        assert_string_equal(units[1], unit);
    }
}

/* Frames T = 4 s apart, a gate of 9: sqrt(9 / T) = 1.5 times the quiet noise of 0.3 is followed,
 * half of sqrt(9 / 3 T) times 2 is found. */
static void limits_of_burns(void **state) {
    (void)state;
    const double ways[][3] = {{0.6, 0.0, 0.8}, {-0.8, 0.6, 0.0}, {0.0, 0.28, 0.96}};
    double found = 0.5 * sqrt(9.0 / 12.0) * 2.0;
    expect(ways[0], 60.0, TRACKER "false_events_per_hour=0.01", found, "arcsec/s2");
    expect(ways[1], 60.0, TRACKER "false_events_per_hour=0", 0.45, "arcsec/s2");
    /* a step of the rate: sqrt(9 T / 3) times 2 */
    expect(ways[2], 0.0, TRACKER "false_events_per_hour=0.01", sqrt(12.0) * 2.0, "arcsec/s");
    expect(ways[0], 3.0, TRACKER "event_window=0", 0.45 * 4.0, "arcsec/s");
}

static double number(const cJSON *node, const char *key) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(node, key);
    if (!cJSON_IsNumber(item)) {
        fail_msg("%s is no number", key);
    }
    return item->valuedouble;
}

/* Mean over the positions in a pixel of sum s^2, s the light of a Gaussian in each pixel. */
static double sharpness(double sigma) {
    double mean = 0.0;
    for (int phase = 0; phase < 64; phase++) {
        for (int i = -12; i <= 12; i++) {
            double from = (i - 0.5 - (phase + 0.5) / 64.0) / sigma, to = from + 1.0 / sigma;
            double s = 0.5 * (erf(to / sqrt(2.0)) - erf(from / sqrt(2.0)));
            mean += s * s / 64.0;
        }
    }
    return mean * mean; /* the same in y */
}

static void figures_of_sensor_and_target(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_load_options load = BST_LOAD_DEFAULTS;
    bst_option none[] = {{.name = NULL}};
    bst_json *json;
    bst_scenario scenario;
    bst_assert_ok(&ctx, bst_load_check(&ctx, &load, none));
    const char *sets[] = {"/world/star_catalogue=embedded",
                          "/duration_s=1000",
                          "/observers/0/sensors/0/camera/height_px=512",
                          "/observers/0/sensors/0/camera/obscuration=0.4",
                          "/observers/0/sensors/0/exposure={\"exposure_s\": 0.8, \"period_s\": 3, "
                          "\"first_s\": 10, \"binning\": 2, \"window_px\": [100, 50, 256, 128]}",
                          "/record={\"frames\": \"extensions\", \"compression\": \"none\"}"};
    for (size_t i = 0; i < sizeof sets / sizeof *sets; i++) {
        load.set.items[load.set.count++] = sets[i];
    }
    bst_assert_ok(
        &ctx, bst_load_scenario(&ctx, "scenarios/neossat_geo_stare.json", &load, &json, &scenario));
    bst_assert_ok(&ctx, bst_world_create(&ctx, scenario.file, &scenario.world, &scenario.observers,
                                         "", scenario.epoch, &made));
    cJSON *root;
    bst_assert_ok(&ctx, bst_check_figures(&ctx, &scenario, NULL, &root));
    const cJSON *sensor = cJSON_GetObjectItem(root, "sensors")->child;
    const cJSON *field = cJSON_GetObjectItem(sensor, "field_deg");
    bst_assert_close(cJSON_GetArrayItem(field, 0)->valuedouble, 1024 * 3 / 3600.0, 1e-12);
    bst_assert_close(cJSON_GetArrayItem(field, 1)->valuedouble, 512 * 3 / 3600.0, 1e-12);
    bst_assert_close(number(sensor, "pixel_scale_arcsec"), 3.0, 1e-12);
    /* frames that begin at 10, 13, ..., 997 s */
    bst_assert_close(number(sensor, "frames"), 330, 0.0);
    bst_assert_close(number(sensor, "frame_bytes"), 330.0 * 128 * 64 * 2, 0.0);
    bst_assert_close(number(root, "frame_bytes"), 330.0 * 128 * 64 * 2, 0.0);
    /* electrons per second of a star of V = 0 */
    double v0 = 3.6e10 * BST_PI / 4.0 * 0.15 * 0.15 * (1.0 - 0.4) * 0.7 * 0.7;
    /* of four pixels, which are read together: the read noise once */
    double sky = v0 * pow(10.0, -0.4 * 22.0) * 4.0 * 9.0 * 0.8, dark = 4.0 * 0.5 * 0.8;
    double noise = sqrt(sky + dark + 64.0), snr_per_e = sqrt(sharpness(1.0 / 2.35482)) / noise;
    bst_assert_close(number(sensor, "sky_e"), sky, 1e-9 * sky);
    bst_assert_close(number(sensor, "dark_e"), dark, 1e-12);
    bst_assert_close(number(sensor, "noise_e"), noise, 1e-9);
    bst_assert_close(number(sensor, "psf_fwhm_px"), 2.0, 1e-6);
    /* four positions instead of all */
    bst_assert_close(number(sensor, "v_mag_at_snr_5"), 2.5 * log10(v0 * 0.8 * snr_per_e / 5.0),
                     2e-3);
    bst_world_view *view;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, made, &view));
    const cJSON *target = cJSON_GetObjectItem(sensor, "target");
    const cJSON *at = cJSON_GetObjectItem(target, "states")->child;
    for (int i = 0; i < 3; i++, at = at->next) {
        bst_world_state body[2], eye[2];
        bst_vec3 line[2];
        double time_s = 500.0 * i;
        for (int k = 0; k < 2; k++) {
            bst_assert_ok(&ctx, bst_world_view_object_state(&ctx, view, 0, time_s + k, &body[k]));
            bst_assert_ok(&ctx, bst_world_view_observer_state(&ctx, view, 0, time_s + k, &eye[k]));
            line[k] = bst_vec3_sub(body[k].position_m, eye[k].position_m);
        }
        double range = bst_vec3_norm(line[0]), v = number(at, "v_mag");
        bst_assert_close(number(at, "time_s"), time_s, 0.0);
        bst_assert_close(number(at, "range_m"), range, 2e-5 * range); /* light time */
        double rate = bst_vec3_angle(line[0], line[1]) / BST_ARCSEC_RAD;
        bst_assert_close(number(at, "rate_arcsec_per_s"), rate, 2e-4 * rate + 1e-3);
        double snr = v0 * 0.8 * pow(10.0, -0.4 * v) * snr_per_e;
        bst_assert_close(number(at, "snr"), snr, 2e-3 * snr);
        bst_assert_close(number(at, "sunlit_fraction"), 1.0, 0.0);
    }
    assert_null(at);
    cJSON_Delete(root);
    bst_world_view_free(view);
    bst_world_free(made);
    bst_scenario_free(&scenario);
    bst_json_free(json);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(limits_of_burns),
                                       cmocka_unit_test(figures_of_sensor_and_target)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
