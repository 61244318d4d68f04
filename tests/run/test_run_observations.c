/* Measured directions of a run's tracks and their covariances, of a run that is written here,
 * against differences over pixels and small turns of the camera. */
#include <cjson/cJSON.h>

#include "sim/astro/bodies.h"
#include "sim/cli/load.h"
#include "sim/onboard/knowledge.h"
#include "sim/run/run_observations.h"
#include "tests/report/run_tables.h"
#include "tracker/orbit/orbit_photocentre.h"

enum { FRAMES = 4 };

/* Frame k: mid exposure at 2 + 3 k s of 1000 ticks/s; frame 2 has no attitude, frame 3 no detection
 * of the track. */
static const double places[FRAMES][2] = {{101.5, 700.25}, {433, 58}, {300, 300}, {200, 200}};
static const double covariances[FRAMES][3] = {
    {0.04, 0.015, 0.09}, {0.16, -0.05, 0.025}, {1, 0, 1}, {1, 0, 1}};
static const double sigmas_arcsec[FRAMES][3] = {{1, 2, 40}, {3, 1.5, 60}, {1, 1, 1}, {1, 1, 1}};
/* about x and y, x and z, y and z */
static const double correlations[3] = {0.7, -0.4, 0.2};
static const double attitudes[FRAMES][4] = {{0.1, -0.2, 0.4, 0.8888194417315589},
                                            {0.12, -0.2, 0.42, 0.877040477971228},
                                            {0, 0, 0, 1},
                                            {0, 0, 0, 1}};

static void write_scenario(run_tables *t) {
    static const char *const sets[] = {"/world/star_catalogue=embedded",
                                       "/observers/0/sensors/0/camera/rotation_deg=33",
                                       "/observers/0/sensors/0/camera/width_px=640",
                                       "/observers/0/sensors/0/camera/height_px=800"};
    bst_ctx ctx = {0};
    bst_load_options load = BST_LOAD_DEFAULTS;
    bst_option none[] = {{.name = NULL}};
    bst_json *json;
    bst_scenario scenario;
    bst_assert_ok(&ctx, bst_load_check(&ctx, &load, none));
    for (int i = 0; i < 4; i++) {
        load.set.items[load.set.count++] = sets[i];
    }
    bst_assert_ok(
        &ctx, bst_load_scenario(&ctx, "scenarios/neossat_geo_track.json", &load, &json, &scenario));
    cJSON *echo = bst_scenario_echo(&scenario);
    char *text = cJSON_Print(echo);
    run_tables_file(t, "scenario.json", text);
    cJSON_free(text);
    cJSON_Delete(echo);
    bst_scenario_free(&scenario);
    bst_json_free(json);
}

static int tick_of(int k) {
    return 6000 * (2 + 3 * k);
}

static void put_track(run_tables *t, int id, int k, const char *status, int target, int misses) {
    run_tables_sql(t,
                   "INSERT INTO tracks VALUES (0, %d, %d, %d, '%s', %d, %d, %.17g, %.17g, %g, %g, "
                   "%.17g, %.17g, 1e-12, -4e-13, 2e-12)",
                   k, id, tick_of(k), status, target, misses, 250.5 + k, -12.25 - k, 12.5 + k,
                   30.0 + k, places[k][0], places[k][1]);
}

static void make_run(run_tables *t) {
    run_tables_begin(t, "run.sqlite");
    write_scenario(t);
    run_tables_sql(
        t,
        "CREATE TABLE tracks (sensor INT, exposure_id INT, track_id INT, tick INT, status TEXT,"
        " target_of_interest INT, misses_in_row INT, ra_deg REAL, dec_deg REAL, v_mag REAL, snr "
        "REAL, x_px REAL, y_px REAL, cov_d1_d1_rad2 REAL, cov_d1_d2_rad2 REAL, cov_d2_d2_rad2 "
        "REAL);"
        "CREATE TABLE track_frames (sensor INT, exposure_id INT, attitude_valid INT,"
        " attitude_q_cam_from_gcrf_x REAL, attitude_q_cam_from_gcrf_y REAL,"
        " attitude_q_cam_from_gcrf_z REAL, attitude_q_cam_from_gcrf_w REAL,"
        " attitude_sigma_x_arcsec REAL, attitude_sigma_y_arcsec REAL, attitude_sigma_z_arcsec "
        "REAL, attitude_correlation_xy REAL, attitude_correlation_xz REAL, attitude_correlation_yz "
        "REAL, attitude_shared REAL);"
        "CREATE TABLE detections (sensor INT, exposure_id INT, x_px REAL, y_px REAL,"
        " cov_xx_px2 REAL, cov_xy_px2 REAL, cov_yy_px2 REAL);"
        "CREATE TABLE detection_frames (sensor INT, exposure_id INT, start_tick INT, end_tick "
        "INT)");
    for (int k = 0; k < FRAMES; k++) {
        const double *q = attitudes[k], *s = sigmas_arcsec[k], *c = covariances[k];
        run_tables_sql(t,
                       "INSERT INTO track_frames VALUES (0, %d, %d, %.17g, %.17g, %.17g, %.17g, %g,"
                       " %g, %g, %g, %g, %g, %g);"
                       "INSERT INTO detection_frames VALUES (0, %d, %d, %d);"
                       "INSERT INTO detections VALUES (0, %d, %.17g, %.17g, %g, %g, %g), (0, %d, "
                       "5, 5, 9, 9, 9)",
                       k, k != 2, q[0], q[1], q[2], q[3], s[0], s[1], s[2], correlations[0],
                       correlations[1], correlations[2], k == 1 ? 0.64 : 0.5, k, tick_of(k) - 1800,
                       tick_of(k) + 1200, k, places[k][0], places[k][1], c[0], c[1], c[2], k);
        put_track(t, 7, k, k == 1 ? "confirmed" : "tentative", k == 1, k == 3);
        put_track(t, 8, k, "tentative", 0, 0);
    }
}

typedef struct found {
    int tracks;
    bst_run_track track;
    bst_run_observation items[FRAMES];
} found;

static bst_status take(void *user, bst_ctx *ctx, const bst_run_track *track) {
    found *f = user;
    (void)ctx;
    f->tracks++;
    f->track = *track;
    assert_in_range(track->count, 1, FRAMES);
    memcpy(f->items, track->items, (size_t)track->count * sizeof f->items[0]);
    return BST_OK;
}

/* Direction of a pixel after a small turn of the camera, without aberration. */
static bst_vec3 direction(const bst_camera *camera, const bst_light *light, int k, double x,
                          double y, bst_vec3 turn) {
    const double *q = attitudes[k];
    bst_vec3 v = bst_camera_unproject(camera, x, y);
    v = bst_vec3_unit(bst_vec3_add(v, bst_vec3_cross(turn, v)));
    bst_quat back = {-q[0], -q[1], -q[2], q[3]};
    return bst_light_unaberrate(light, bst_quat_rotate(back, v));
}

static void expect_measured(const bst_camera *camera, const bst_od_observation *o, int k) {
    bst_ctx ctx = {0};
    (void)ctx;
    const bst_vec3 sun = {1.5e11, 0, 0}; /* of no weight to 1e-9 rad */
    bst_light light = {
        .velocity_mps = bst_vec3_add(o->observer.earth_bary_mps, o->observer.velocity_mps),
        .sun_m = sun};
    double x = places[k][0], y = places[k][1], step = 1e-4;
    const bst_vec3 none = {0, 0, 0}, turns[3] = {{step, 0, 0}, {0, step, 0}, {0, 0, step}};
    bst_vec3 d = direction(camera, &light, k, x, y, none), by[5];
    bst_assert_close(bst_vec3_angle(d, o->direction), 0, 1e-8);
    bst_vec3 east = bst_vec3_unit((bst_vec3){-d.y, d.x, 0}), north = bst_vec3_cross(d, east);
    by[0] = bst_vec3_sub(direction(camera, &light, k, x + 0.5, y, none),
                         direction(camera, &light, k, x - 0.5, y, none));
    by[1] = bst_vec3_sub(direction(camera, &light, k, x, y + 0.5, none),
                         direction(camera, &light, k, x, y - 0.5, none));
    for (int i = 0; i < 3; i++) {
        by[2 + i] = bst_vec3_scale(
            bst_vec3_sub(direction(camera, &light, k, x, y, turns[i]),
                         direction(camera, &light, k, x, y, bst_vec3_scale(turns[i], -1))),
            0.5 / step);
    }
    double c[5][5] = {{covariances[k][0], covariances[k][1]},
                      {covariances[k][1], covariances[k][2]}},
           e[5], n[5], ee = 0, en = 0, nn = 0;
    for (int i = 0; i < 5; i++) {
        e[i] = bst_vec3_dot(by[i], east);
        n[i] = bst_vec3_dot(by[i], north);
        if (i > 1) {
            double sigma = sigmas_arcsec[k][i - 2] * BST_ARCSEC_RAD;
            c[i][i] = sigma * sigma;
        }
    }
    for (int i = 0; i < 3; i++) {
        const int a = 2 + i / 2, b = i < 1 ? 3 : 4;
        c[a][b] = c[b][a] = correlations[i] * sqrt(c[a][a] * c[b][b]);
    }
    for (int i = 0; i < 5; i++) {
        for (int m = 0; m < 5; m++) {
            ee += e[i] * c[i][m] * e[m];
            en += e[i] * c[i][m] * n[m];
            nn += n[i] * c[i][m] * n[m];
        }
    }
    /* aberration stretches the sky by 1e-4 */
    double margin = 5e-4 * sqrt(ee * nn);
    assert_true(fabs(en) > 100 * margin);
    bst_assert_close(o->cov_11, ee, margin);
    bst_assert_close(o->cov_12, en, margin);
    bst_assert_close(o->cov_22, nn, margin);
    /* the latest frame's share of the variance about camera x and y is common */
    double of_both[3] = {0}, common[3] = {0};
    for (int i = 0; i < 2; i++) {
        for (int m = 0; m < 2; m++) {
            of_both[0] += 0.64 * e[2 + i] * c[2 + i][2 + m] * e[2 + m];
            of_both[1] += 0.64 * e[2 + i] * c[2 + i][2 + m] * n[2 + m];
            of_both[2] += 0.64 * n[2 + i] * c[2 + i][2 + m] * n[2 + m];
        }
        common[0] += o->shared_rad[0][i] * o->shared_rad[0][i];
        common[1] += o->shared_rad[0][i] * o->shared_rad[1][i];
        common[2] += o->shared_rad[1][i] * o->shared_rad[1][i];
    }
    for (int i = 0; i < 3; i++) {
        bst_assert_close(common[i], of_both[i], 5e-4 * (of_both[0] + of_both[2]));
    }
}

static bst_vec3 axis_of(int k) {
    const double *q = attitudes[k];
    return bst_quat_rotate((bst_quat){-q[0], -q[1], -q[2], q[3]}, (bst_vec3){0, 0, 1});
}

static void measured_and_filtered(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    run_tables t;
    bst_run_scene scene;
    make_run(&t);
    run_tables_open(&t);
    bst_assert_ok(&ctx, bst_run_scene_open(&ctx, t.run, &scene));
    bst_run_sensor sensor = {.index = 0};
    snprintf(sensor.observer, sizeof sensor.observer, "neossat");
    snprintf(sensor.name, sizeof sensor.name, "telescope");
    found f = {.tracks = 0};
    bst_assert_ok(&ctx, bst_run_observations(&ctx, &scene, &sensor, 0, false, take, &f));
    assert_int_equal(f.tracks, 1);
    assert_int_equal(f.track.id, 7);
    assert_int_equal(f.track.count, 2);
    assert_int_equal(f.track.skipped, 1);
    assert_true(f.track.target);
    bst_assert_close(f.track.exposure_s, 0.5, 1e-12);
    bst_knowledge *knowledge;
    bst_assert_ok(&ctx, bst_knowledge_create(&ctx, scene.world, 0, 0, &knowledge));
    for (int k = 0; k < 2; k++) {
        const bst_run_observation *o = &f.items[k];
        bst_world_state eye;
        bst_bodies bodies;
        bst_assert_close(o->od.observer.time_s, 2 + 3 * k, 1e-12);
        bst_assert_close(bst_time_diff(o->time, scene.scenario.epoch), 2 + 3 * k, 1e-9);
        bst_assert_ok(&ctx, bst_world_view_observer_state(&ctx, scene.view, 0, 2 + 3 * k, &eye));
        bst_assert_ok(&ctx, bst_world_view_bodies(&ctx, scene.view, 2 + 3 * k, &bodies));
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(o->od.observer.position_m, eye.position_m)), 0,
                         1e-3);
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(o->od.observer.velocity_mps, eye.velocity_mps)),
                         0, 1e-6);
        bst_assert_close(
            bst_vec3_norm(bst_vec3_sub(o->od.observer.earth_bary_mps, bodies.earth_bary_mps)), 0,
            1e-6);
        const double phase = bst_vec3_angle(bodies.sun_m, bst_vec3_scale(o->od.direction, -1.0));
        bst_assert_close(o->od.photocentre_factor, bst_od_photocentre_factor(phase), 1e-6);
        bst_assert_close(bst_vec3_angle(o->od.sun, bodies.sun_m), 0, 1e-6);
        bst_assert_close(bst_vec3_norm(o->od.sun), 1, 1e-12);
        bst_assert_close(o->v_mag, 12.5 + k, 0);
        bst_assert_close(o->snr, 30.0 + k, 0);
        expect_measured(bst_knowledge_camera(knowledge), &o->od, k);
    }
    /* fields at distance d along a side of 720 px share 1 - d / s, of integral s / 2 */
    bst_assert_close(f.items[0].od.shared_change, 0, 0);
    double moved = bst_vec3_angle(axis_of(0), axis_of(1)), side = 720 * 3 * BST_ARCSEC_RAD;
    bst_assert_close(f.items[1].od.shared_change, 2 * moved / side, 1e-6 * moved / side);
    /* the tracker's own */
    bst_assert_ok(&ctx, bst_run_observations(&ctx, &scene, &sensor, 7, true, take, &f));
    assert_int_equal(f.track.count, 3); /* without the frame that it missed */
    for (int k = 0; k < 3; k++) {
        double ra = (250.5 + k) * BST_DEG_RAD, dec = (-12.25 - k) * BST_DEG_RAD;
        bst_vec3 d = {cos(dec) * cos(ra), cos(dec) * sin(ra), sin(dec)};
        bst_assert_close(bst_vec3_angle(d, f.items[k].od.direction), 0, 1e-12);
        bst_assert_close(f.items[k].od.cov_11, 1e-12, 1e-24);
        bst_assert_close(f.items[k].od.cov_12, -4e-13, 1e-24);
        bst_assert_close(f.items[k].od.cov_22, 2e-12, 1e-24);
    }
    bst_knowledge_free(knowledge);
    bst_run_scene_close(&scene);
    run_tables_end(&t);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(measured_and_filtered),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
