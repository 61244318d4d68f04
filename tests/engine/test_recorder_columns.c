/* Every column of the tables against its own field of the message. */
#include <sqlite3.h>

#include "sim/engine/recorder/recorder.h"
#include "sim/world/world.h"
#include "tests/io/scratch.h"

enum { RATE = 6000, WIDTH = 8, HEIGHT = 6 };

static const bst_camera camera = {.width_px = WIDTH,
                                  .height_px = HEIGHT,
                                  .pixel_scale_arcsec = 3.0,
                                  .full_well_e = 1e5,
                                  .gain_e_per_dn = 2.0,
                                  .bits = 16};

/* A world with one object, which has a shape. */
static bst_world_object_info object;
static int some_shape, some_world;

int __wrap_bst_world_object_count(const bst_world *world);
const bst_world_object_info *__wrap_bst_world_object(const bst_world *world, int index);

int __wrap_bst_world_object_count(const bst_world *world) {
    assert_ptr_equal(world, &some_world);
    return 1;
}

const bst_world_object_info *__wrap_bst_world_object(const bst_world *world, int index) {
    assert_ptr_equal(world, &some_world);
    assert_int_equal(index, 0);
    return &object;
}

static bst_recorder *make(bst_ctx *ctx, bst_run *run, const bst_recorder_config *config) {
    const bst_recorder_sensor one = {.observer = "alpha",
                                     .sensor = "wide",
                                     .camera = &camera,
                                     .has_truth = true,
                                     .has_regions = true,
                                     .has_wheels = true};
    bst_recorder_info info = {
        .tick_rate_hz = RATE, .program = "test", .sensors = &one, .sensor_count = 1};
    info.world = (const bst_world *)(const void *)&some_world;
    bst_assert_ok(ctx, bst_time_from_utc(ctx, "2022-06-16T22:10:00Z", &info.epoch));
    bst_recorder *recorder;
    bst_assert_ok(ctx, bst_recorder_create(ctx, run, config, &info, &recorder));
    return recorder;
}

static void send(bst_ctx *ctx, bst_recorder *recorder, const char *channel, const void *payload,
                 int64_t tick) {
    bst_assert_ok(ctx, bst_recorder_channel(ctx, recorder, 0, channel, payload, tick));
}

static double number(const char *path, const char *sql) {
    sqlite3 *db;
    sqlite3_stmt *statement;
    assert_int_equal(sqlite3_open_v2(path, &db, SQLITE_OPEN_READONLY, NULL), SQLITE_OK);
    if (sqlite3_prepare_v2(db, sql, -1, &statement, NULL) != SQLITE_OK) {
        fail_msg("%s: %s", sql, sqlite3_errmsg(db));
    }
    assert_int_equal(sqlite3_step(statement), SQLITE_ROW);
    double value = sqlite3_column_type(statement, 0) == SQLITE_NULL
                       ? NAN
                       : sqlite3_column_double(statement, 0);
    sqlite3_finalize(statement);
    sqlite3_close(db);
    return value;
}

/* Values that messages are filled with, one for each column. */
typedef struct kept_values {
    struct {
        const char *table, *column;
        double value;
    } items[320];
    int count;
} kept_values;

static kept_values kept;

/* A value that no other column has, which the column shows in a unit of which `unit` make one of
 * the message's. */
static double keep(const char *table, const char *column, double unit) {
    assert_true(kept.count < (int)(sizeof kept.items / sizeof *kept.items));
    double value = kept.count + 2.0;
    kept.items[kept.count].table = table;
    kept.items[kept.count].column = column;
    kept.items[kept.count++].value = value * unit;
    return value;
}

static bst_vec3 keep_vector(const char *table, const char *const columns[3], double unit) {
    double x = keep(table, columns[0], unit), y = keep(table, columns[1], unit);
    return (bst_vec3){x, y, keep(table, columns[2], unit)};
}

static bst_quat keep_quat(const char *table, const char *const columns[4]) {
    bst_vec3 v = keep_vector(table, columns, 1.0);
    return (bst_quat){v.x, v.y, v.z, keep(table, columns[3], 1.0)};
}

#define XYZ(name, tail) ((const char *const[]){name "_x" tail, name "_y" tail, name "_z" tail})
#define XYZW(name) ((const char *const[]){name "_x", name "_y", name "_z", name "_w"})
#define PUT(to, field, column) (to)->field = keep(table, column, 1.0)
#define PUT_INT(to, field, column) (to)->field = (int32_t)keep(table, column, 1.0)

static void send_full_truth(bst_ctx *ctx, bst_recorder *recorder) {
    const char *table = "exposures";
    bst_truth *t = calloc(1, sizeof *t + 2 * sizeof(bst_truth_item));
    assert_non_null(t);
    t->end_tick = 2 * RATE;
    t->q_cam_from_gcrf_mid = keep_quat(table, XYZW("q_cam_from_gcrf_mid"));
    t->q_cam_from_gcrf_mean = keep_quat(table, XYZW("q_cam_from_gcrf_mean"));
    t->observer_gcrf_m = keep_vector(table, XYZ("observer_gcrf", "_m"), 1.0);
    t->observer_gcrf_mps = keep_vector(table, XYZ("observer_gcrf", "_mps"), 1.0);
    t->velocity_bary_mps = keep_vector(table, XYZ("velocity_bary", "_mps"), 1.0);
    t->sun_m = keep_vector(table, XYZ("sun", "_m"), 1.0);
    PUT(t, boresight_x_px, "boresight_x_px");
    PUT(t, boresight_y_px, "boresight_y_px");
    PUT(t, background_e, "background_e");
    PUT(t, dark_e, "dark_e");
    PUT(t, earth_fraction, "earth_fraction");
    PUT(t, moon_fraction, "moon_fraction");
    PUT(t, sun_fraction, "sun_fraction");
    PUT(t, hits_e, "hits_e");
    PUT_INT(t, hits, "hits");
    PUT(t, error_sigma, "error_sigma");
    PUT_INT(t, nodes, "nodes");
    PUT(t, pixel_scale_arcsec, "pixel_scale_arcsec");
    PUT_INT(t, lost, "lost");
    t->count = 1;
    table = "truth";
    bst_truth_item *i = &t->items[0];
    i->kind = BST_SOURCE_OBJECT;
    PUT_INT(i, norad, "norad");
    PUT(i, x_start_px, "x_start_px");
    PUT(i, y_start_px, "y_start_px");
    PUT(i, x_mid_px, "x_mid_px");
    PUT(i, y_mid_px, "y_mid_px");
    PUT(i, x_end_px, "x_end_px");
    PUT(i, y_end_px, "y_end_px");
    PUT(i, x_chief_px, "x_chief_px");
    PUT(i, y_chief_px, "y_chief_px");
    PUT(i, x_centroid_px, "x_centroid_px");
    PUT(i, y_centroid_px, "y_centroid_px");
    i->delay_s = keep(table, "mid_s", 1.0) - 1.0; /* after the middle of 0 to 2 s */
    i->ra_rad = keep(table, "ra_deg", 180.0 / BST_PI);
    i->dec_rad = keep(table, "dec_deg", 180.0 / BST_PI);
    PUT(i, v_mag, "v_mag");
    PUT(i, electrons, "electrons");
    PUT(i, snr, "snr");
    PUT(i, sunlit_fraction, "sunlit_fraction");
    i->phase_rad = keep(table, "phase_deg", 180.0 / BST_PI);
    PUT(i, range_m, "range_m");
    t->shape_count = 1;
    bst_truth_shape *s = &t->shapes[0];
    table = "shapes";
    PUT(s, x_px, "x_px");
    PUT(s, y_px, "y_px");
    PUT(s, x_light_px, "x_light_px");
    PUT(s, y_light_px, "y_light_px");
    PUT(s, x0_px, "x0_px");
    PUT(s, y0_px, "y0_px");
    PUT(s, x1_px, "x1_px");
    PUT(s, y1_px, "y1_px");
    PUT(s, size_px, "size_px");
    PUT(s, visible, "visible");
    s->q_body_from_gcrf = keep_quat(table, XYZW("q_body_from_gcrf"));
    send(ctx, recorder, BST_CHANNEL_TRUTH, t, t->end_tick);
    free(t);
}

static void send_full_detections(bst_ctx *ctx, bst_recorder *recorder) {
    const char *table = "detection_frames";
    bst_detections *d = calloc(1, sizeof *d + sizeof(bst_detection));
    assert_non_null(d);
    d->q_cam_from_gcrf = keep_quat(table, XYZW("q_cam_from_gcrf"));
    d->q_telemetry_from_gcrf = keep_quat(table, XYZW("q_telemetry_from_gcrf"));
    PUT(d, background_e, "background_e");
    PUT(d, noise_e, "noise_e");
    PUT(d, threshold_snr, "threshold_snr");
    PUT(d, shared_xx, "shared_xx_px2");
    PUT(d, shared_xy, "shared_xy_px2");
    PUT(d, shared_yy, "shared_yy_px2");
    PUT(d, zero_point_mag, "zero_point_mag");
    PUT(d, zero_point_sigma_mag, "zero_point_sigma_mag");
    PUT_INT(d, zero_point_stars, "zero_point_stars");
    PUT_INT(d, stars_identified, "stars_identified");
    PUT_INT(d, windows, "windows");
    PUT_INT(d, lost, "lost");
    PUT_INT(d, bad_pixels, "bad_pixels");
    table = "camera_calibration";
    bst_camera_calibration *c = &d->calibration;
    PUT_INT(c, frames, "frames");
    PUT(c, scale, "scale");
    PUT(c, rotation_rad, "rotation_rad");
    PUT(c, k1, "k1");
    PUT(c, p1, "p1");
    PUT(c, p2, "p2");
    static const char *const of[] = {"scale", "rotation", "k1", "p1", "p2"};
    static char names[15][40];
    for (int i = 0, n = 0; i < 5; i++) {
        for (int k = i; k < 5; k++, n++) {
            snprintf(names[n], sizeof names[n], "cov_%s_%s", of[i], of[k]);
            c->covariance[i][k] = c->covariance[k][i] = keep(table, names[n], 1.0);
        }
    }
    table = "detections";
    d->count = 1;
    bst_detection *i = &d->items[0];
    i->star_id = (uint32_t)keep(table, "star_id", 1.0);
    PUT(i, x_px, "x_px");
    PUT(i, y_px, "y_px");
    PUT(i, cov_xx, "cov_xx_px2");
    PUT(i, cov_xy, "cov_xy_px2");
    PUT(i, cov_yy, "cov_yy_px2");
    PUT(i, flux_e, "flux_e");
    PUT(i, flux_sigma_e, "flux_sigma_e");
    PUT(i, snr, "snr");
    PUT(i, length_px, "length_px");
    PUT(i, width_px, "width_px");
    i->angle_rad = keep(table, "angle_deg", 180.0 / BST_PI);
    PUT(i, v_mag, "v_mag");
    PUT(i, v_mag_sigma, "v_mag_sigma");
    PUT(i, label_probability, "label_probability");
    PUT(i, rate_x_pxps, "rate_x_pxps");
    PUT(i, rate_y_pxps, "rate_y_pxps");
    PUT(i, rate_sigma_pxps, "rate_sigma_pxps");
    i->flags |= BST_DETECTION_EXTENDED;
    table = "extended_targets";
    bst_detection_extent *e = &i->extent;
    PUT(e, light_x_px, "x_light_px");
    PUT(e, light_y_px, "y_light_px");
    PUT(e, x0_px, "x0_px");
    PUT(e, y0_px, "y0_px");
    PUT(e, x1_px, "x1_px");
    PUT(e, y1_px, "y1_px");
    PUT(e, size_px, "size_px");
    PUT(e, size_sigma_px, "size_sigma_px");
    PUT(e, area_px2, "area_px2");
    PUT(e, saturated_share, "saturated_share");
    e->phase_rad = keep(table, "phase_deg", 180.0 / BST_PI);
    PUT(e, range_m, "range_m");
    PUT(e, range_sigma_m, "range_sigma_m");
    send(ctx, recorder, BST_CHANNEL_DETECTIONS, d, 4000);
    free(d);
}

static void send_full_tracks(bst_ctx *ctx, bst_recorder *recorder) {
    const double arcsec = 180.0 * 3600.0 / BST_PI;
    const char *table = "track_frames";
    bst_tracks *t = calloc(1, sizeof *t + sizeof(bst_track));
    assert_non_null(t);
    PUT_INT(t, target_id, "target_id");
    PUT_INT(t, at_rest, "at_rest");
    PUT_INT(t, lost, "lost");
    bst_attitude_fix *a = &t->attitude;
    a->valid = true;
    PUT_INT(a, stars, "attitude_stars");
    a->q_cam_from_gcrf = keep_quat(table, XYZW("attitude_q_cam_from_gcrf"));
    a->error_cam_rad = keep_vector(table, XYZ("attitude_error", "_arcsec"), arcsec);
    const bst_vec3 sigma = keep_vector(table, XYZ("attitude_sigma", "_arcsec"), arcsec);
    a->sigma_rad[0] = sigma.x;
    a->sigma_rad[1] = sigma.y;
    a->sigma_rad[2] = sigma.z;
    PUT(a, correlation[0], "attitude_correlation_xy");
    PUT(a, correlation[1], "attitude_correlation_xz");
    PUT(a, correlation[2], "attitude_correlation_yz");
    PUT(a, rms_px, "attitude_rms_px");
    PUT(a, shared, "attitude_shared");
    PUT(t, clock_offset_s, "clock_offset_s");
    PUT(t, clock_sigma_s, "clock_sigma_s");
    table = "tracks";
    t->count = 1;
    bst_track *k = &t->items[0];
    k->direction_gcrf = (bst_vec3){1.0, 0.0, 0.0};
    PUT_INT(k, id, "track_id");
    PUT(k, v_mag, "v_mag");
    PUT(k, snr, "snr");
    PUT(k, score, "score");
    PUT_INT(k, hits, "hits");
    PUT_INT(k, misses_in_row, "misses_in_row");
    PUT_INT(k, first_tick, "first_tick");
    PUT_INT(k, last_update_tick, "last_update_tick");
    PUT(k, x_px, "x_px");
    PUT(k, y_px, "y_px");
    send(ctx, recorder, BST_CHANNEL_TRACKS, t, 4000);
    free(t);
}

static void send_full_telemetry(bst_ctx *ctx, bst_recorder *recorder) {
    const double degrees = 180.0 / BST_PI;
    const char *table = "los_commands";
    bst_los_command los = {.direction_gcrf = {0, 1, 0}};
    los.rate_gcrf_radps = keep_vector(table, XYZ("rate_gcrf", "_radps"), 1.0);
    los.accel_gcrf_radps2 = keep_vector(table, XYZ("accel_gcrf", "_radps2"), 1.0);
    send(ctx, recorder, BST_CHANNEL_LOS_COMMAND, &los, 4800);
    table = "sensor_commands";
    bst_sensor_command sensor = {0};
    PUT(&sensor, exposure_s, "exposure_s");
    PUT(&sensor, period_s, "period_s");
    PUT_INT(&sensor, window.x0, "x0_px");
    PUT_INT(&sensor, window.y0, "y0_px");
    PUT_INT(&sensor, window.width, "width_px");
    PUT_INT(&sensor, window.height, "height_px");
    PUT_INT(&sensor, binning, "binning");
    send(ctx, recorder, BST_CHANNEL_SENSOR_COMMAND, &sensor, 4800);
    table = "pointing";
    bst_pointing_telemetry *p = calloc(1, sizeof *p + 3 * sizeof(bst_pointing_sample));
    assert_non_null(p);
    p->capacity = 3;
    p->written = 5; /* the latest sample is item 1 */
    p->q_body_from_gcrf = keep_quat(table, XYZW("q_body_from_gcrf"));
    p->items[1].q_cam_from_gcrf = keep_quat(table, XYZW("q_cam_from_gcrf"));
    PUT_INT(&p->items[1], tick, "tick");
    p->items[1].axis_rad[0] = keep(table, "axis_outer_deg", degrees);
    p->items[1].axis_rad[1] = keep(table, "axis_inner_deg", degrees);
    send(ctx, recorder, BST_CHANNEL_POINTING_TELEMETRY, p, 4800);
    free(p);
    table = "los_truth";
    bst_los_history *h = calloc(1, sizeof *h + 3 * sizeof(bst_los_sample));
    assert_non_null(h);
    h->capacity = 3;
    h->written = 6; /* item 2 */
    PUT_INT(&h->items[2], tick, "tick");
    h->items[2].q_cam_from_gcrf = keep_quat(table, XYZW("q_cam_from_gcrf"));
    send(ctx, recorder, BST_CHANNEL_LOS_HISTORY, h, 4800);
    free(h);
    table = "mount";
    bst_mount_status mount = {.axes = 3};
    static const char *const axes[3][3] = {{"axis0_deg", "axis0_rate_degps", "axis0_flags"},
                                           {"axis1_deg", "axis1_rate_degps", "axis1_flags"},
                                           {"axis2_deg", "axis2_rate_degps", "axis2_flags"}};
    for (int i = 0; i < 3; i++) {
        mount.axis[i].angle_rad = keep(table, axes[i][0], degrees);
        mount.axis[i].rate_radps = keep(table, axes[i][1], degrees);
        mount.axis[i].flags = (uint32_t)keep(table, axes[i][2], 1.0);
    }
    mount.rate_body_radps = keep_vector(table, XYZ("body_rate", "_degps"), degrees);
    send(ctx, recorder, BST_CHANNEL_MOUNT_STATUS, &mount, 4800);
    table = "nav";
    bst_nav_telemetry nav = {0};
    nav.position_gcrf_m = keep_vector(table, XYZ("position_gcrf", "_m"), 1.0);
    nav.velocity_gcrf_mps = keep_vector(table, XYZ("velocity_gcrf", "_mps"), 1.0);
    send(ctx, recorder, BST_CHANNEL_NAV_TELEMETRY, &nav, 4800);
    table = "control";
    bst_control_status control = {.mode = BST_MODE_TRACK};
    PUT_INT(&control, target_id, "target_id");
    PUT_INT(&control, search_step, "search_step");
    PUT(&control, aim_error_px[0], "aim_error_x_px");
    PUT(&control, aim_error_px[1], "aim_error_y_px");
    send(ctx, recorder, BST_CHANNEL_CONTROL_STATUS, &control, 4800);
}

static void send_full_windows_and_wheels(bst_ctx *ctx, bst_recorder *recorder) {
    const char *table = "regions_of_interest";
    bst_regions_of_interest *r = calloc(1, sizeof *r + sizeof r->items[0]);
    assert_non_null(r);
    r->count = 1;
    r->end_tick = 2 * RATE;
    r->exposure_id = (int64_t)keep(table, "exposure_id", 1.0);
    bst_searched_window *w = &r->items[0];
    PUT_INT(w, number, "window");
    PUT_INT(w, window.x0, "x0_px");
    PUT_INT(w, window.y0, "y0_px");
    PUT_INT(w, window.width, "width_px");
    PUT_INT(w, window.height, "height_px");
    w->reason = BST_REGION_TRACK;
    w->track_id = (int64_t)keep(table, "track_id", 1.0);
    w->star_id = (uint32_t)keep(table, "star_id", 1.0);
    PUT(w, x_px, "x_px");
    PUT(w, y_px, "y_px");
    send(ctx, recorder, BST_CHANNEL_REGIONS_OF_INTEREST, r, 4800);
    free(r);
    table = "wheels";
    const double rpm = 60.0 / (2.0 * BST_PI);
    bst_wheel_status *s = calloc(1, sizeof *s + sizeof s->items[0]);
    assert_non_null(s);
    s->count = 1;
    PUT_INT(s, tick, "tick");
    s->items[0].speed_radps = keep(table, "speed_rpm", rpm);
    s->items[0].speed_limit_radps = keep(table, "speed_limit_rpm", rpm);
    PUT(&s->items[0], motor_nm, "motor_nm");
    PUT(&s->items[0], motor_limit_nm, "motor_limit_nm");
    send(ctx, recorder, BST_CHANNEL_WHEEL_STATUS, s, 4800);
    free(s);
}

/* Every column has the value of its own field of the message, in its unit. */
static void test_columns(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    bst_recorder_config config;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_record_config_table, &config));
    char out[600], db[640], sql[160];
    snprintf(out, sizeof out, "%s/run", s.folder);
    snprintf(db, sizeof db, "%s/run.sqlite", out);
    bst_run *run;
    bst_assert_ok(&ctx, bst_run_create(&ctx, out, false, &run));
    kept.count = 0;
    object = (bst_world_object_info){
        .name = "box", .shape = (const struct bst_object_shape *)(const void *)&some_shape};
    object.norad = (int)keep("objects", "norad", 1.0);
    object.area_m2 = keep("objects", "area_m2", 1.0);
    object.albedo = keep("objects", "albedo", 1.0);
    bst_recorder *recorder = make(&ctx, run, &config);
    send_full_truth(&ctx, recorder);
    send_full_detections(&ctx, recorder);
    send_full_tracks(&ctx, recorder);
    send_full_telemetry(&ctx, recorder);
    send_full_windows_and_wheels(&ctx, recorder);
    bst_assert_ok(&ctx, bst_recorder_close(&ctx, recorder));
    bst_assert_ok(&ctx, bst_run_finish(&ctx, run));
    snprintf(sql, sizeof sql, "SELECT reason = 'track' FROM regions_of_interest");
    assert_true(number(db, sql) == 1.0);
    for (int i = 0; i < kept.count; i++) {
        snprintf(sql, sizeof sql, "SELECT \"%s\" FROM %s", kept.items[i].column,
                 kept.items[i].table);
        double expected = kept.items[i].value, found = number(db, sql);
        if (!(fabs(found - expected) <= 1e-12 * expected)) { /* rounding of units */
            fail_msg("%s: %.17g, expected %.17g", sql, found, expected);
        }
    }
    scratch_remove(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_columns)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
