/* The recorder: messages in, tables and FITS out. */
#include "sim/engine/recorder/recorder.h"

#include <fitsio.h>
#include <sqlite3.h>

#include "tests/io/scratch.h"

enum { RATE = 6000, WIDTH = 8, HEIGHT = 6 };

/* A frame of the test's own, that counts what is done to it. */
typedef struct fake_frame {
    bst_frame frame;
    uint16_t pixels[WIDTH * HEIGHT];
    int maps, recycled;
} fake_frame;

static bst_status fake_map(void *owner, bst_ctx *ctx, const uint16_t **pixels) {
    (void)ctx;
    fake_frame *f = owner;
    f->maps++;
    *pixels = f->pixels;
    return BST_OK;
}
static void fake_unmap(void *owner) {
    ((fake_frame *)owner)->maps--;
}
static void fake_recycle(void *owner) {
    ((fake_frame *)owner)->recycled++;
}
static const bst_frame_ops fake_ops = {
    .map = fake_map, .unmap = fake_unmap, .device_buffer = NULL, .recycle = fake_recycle};

static void fake_init(fake_frame *f, uint16_t value) {
    *f = (fake_frame){
        .frame = {.ops = &fake_ops, .owner = f, .width = WIDTH, .height = HEIGHT, .references = 1}};
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        f->pixels[i] = (uint16_t)(value + i);
    }
}

static const bst_camera camera = {.width_px = WIDTH,
                                  .height_px = HEIGHT,
                                  .pixel_scale_arcsec = 3.0,
                                  .full_well_e = 1e5,
                                  .gain_e_per_dn = 2.0,
                                  .bits = 16};

static bst_recorder *make(bst_ctx *ctx, bst_run *run, const bst_recorder_config *config,
                          int sensors) {
    const bst_recorder_sensor two[2] = {
        {.observer = "alpha", .sensor = "wide", .camera = &camera, .has_truth = true},
        {.observer = "beta", .sensor = "a/b", .target = "GX5", .camera = &camera}};
    bst_recorder_info info = {
        .tick_rate_hz = RATE, .program = "test", .sensors = two, .sensor_count = sensors};
    bst_assert_ok(ctx, bst_time_from_utc(ctx, "2022-06-16T22:10:00Z", &info.epoch));
    bst_recorder *recorder;
    bst_assert_ok(ctx, bst_recorder_create(ctx, run, config, &info, &recorder));
    return recorder;
}

static void send(bst_ctx *ctx, bst_recorder *recorder, const char *channel, const void *payload,
                 int64_t tick) {
    bst_assert_ok(ctx, bst_recorder_channel(ctx, recorder, 0, channel, payload, tick));
}

static void send_frame(bst_ctx *ctx, bst_recorder *recorder, fake_frame *f, int64_t id) {
    const bst_frame_message m = {.frame = &f->frame,
                                 .exposure_id = id,
                                 .start_tick = id * RATE,
                                 .end_tick = id * RATE + RATE / 2,
                                 .window = {0, 0, WIDTH, HEIGHT},
                                 .binning = 1,
                                 .bits = 16};
    send(ctx, recorder, BST_CHANNEL_FRAME, &m, m.end_tick);
}

/* Scale of a frame, arcsec/px: the telescope's focus moves. */
static double scale_of(int64_t id) {
    return 3.0 * (1.0 + 0.002 * (double)id);
}

static void send_truth(bst_ctx *ctx, bst_recorder *recorder, int64_t id, bool dropped) {
    bst_truth *t = calloc(1, sizeof *t + 2 * sizeof(bst_truth_item));
    assert_non_null(t);
    t->exposure_id = id;
    t->start_tick = id * RATE;
    t->end_tick = id * RATE + RATE / 2;
    t->dropped = dropped;
    t->q_cam_from_gcrf_mid = t->q_cam_from_gcrf_mean =
        bst_quat_look(bst_vec3_from_radec(0.5, 0.25), (bst_vec3){0, 0, 1});
    t->velocity_bary_mps = (bst_vec3){0, 0, 0};
    t->sun_m = (bst_vec3){0, -1e22, 0}; /* so far away that it bends nothing */
    t->observer_gcrf_m = (bst_vec3){7e6, 0, 0};
    t->pixel_scale_arcsec = scale_of(id);
    t->count = 2;
    t->items[0] = (bst_truth_item){.kind = BST_SOURCE_STAR, .id = 77, .x_chief_px = 1.5};
    t->items[1] = (bst_truth_item){.kind = BST_SOURCE_OBJECT,
                                   .id = 3,
                                   .norad = 44801,
                                   .flags = BST_TRUTH_IN_FIELD,
                                   .x_chief_px = 2.25,
                                   .phase_rad = BST_PI / 6,
                                   .ra_rad = 1.0};
    send(ctx, recorder, BST_CHANNEL_TRUTH, t, t->end_tick);
    free(t);
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

static void assert_is(const char *path, const char *sql, double expected) {
    double found = number(path, sql);
    if (!(found == expected)) {
        fail_msg("%s: %.17g, expected %.17g", sql, found, expected);
    }
}

/* Every key of every row of all tables, as one 64-bit FNV-1a. */
static uint64_t digest(const char *path) {
    uint64_t h = 14695981039346656037u;
    sqlite3 *db;
    sqlite3_stmt *names, *rows;
    assert_int_equal(sqlite3_open_v2(path, &db, SQLITE_OPEN_READONLY, NULL), SQLITE_OK);
    sqlite3_prepare_v2(db, "SELECT \"table\" FROM tables ORDER BY 1", -1, &names, NULL);
    while (sqlite3_step(names) == SQLITE_ROW) {
        char sql[128];
        snprintf(sql, sizeof sql, "SELECT * FROM \"%s\" ORDER BY rowid",
                 (const char *)sqlite3_column_text(names, 0));
        sqlite3_prepare_v2(db, sql, -1, &rows, NULL);
        while (sqlite3_step(rows) == SQLITE_ROW) {
            for (int i = 0; i < sqlite3_column_count(rows); i++) {
                const unsigned char *text = sqlite3_column_text(rows, i);
                for (const unsigned char *c = text; c && *c; c++) {
                    h = (h ^ *c) * 1099511628211u;
                }
                h = (h ^ 255u) * 1099511628211u;
            }
        }
        sqlite3_finalize(rows);
    }
    sqlite3_finalize(names);
    sqlite3_close(db);
    return h;
}

/* One of each message that a frame brings. */
static void send_all(bst_ctx *ctx, bst_recorder *recorder) {
    bst_detections *d = calloc(1, sizeof *d + sizeof(bst_detection));
    bst_tracks *t = calloc(1, sizeof *t + sizeof(bst_track));
    assert_true(d && t);
    d->exposure_id = 4;
    d->end_tick = 3000;
    d->count = 1;
    d->items[0] = (bst_detection){.x_px = 3.5,
                                  .cov_xy = -0.01,
                                  .flags = BST_DETECTION_EDGE,
                                  .label = BST_LABEL_OBJECT,
                                  .angle_rad = BST_PI / 2};
    send(ctx, recorder, BST_CHANNEL_DETECTIONS, d, 4000);
    t->exposure_id = 4;
    t->tick = 1500;
    t->target_id = 9;
    t->count = 1;
    t->attitude =
        (bst_attitude_fix){.valid = true, .stars = 12, .error_cam_rad = {.x = BST_ARCSEC_RAD}};
    double ra = 2.0, dec = 0.4;
    t->items[0] = (bst_track){
        .id = 9,
        .status = BST_TRACK_CONFIRMED,
        .target_of_interest = true,
        .direction_gcrf = bst_vec3_from_radec(ra, dec),
        /* 3 arcsec/s to the east, 4 to the north */
        .rate_gcrf_radps = bst_vec3_add(
            bst_vec3_scale((bst_vec3){-sin(ra), cos(ra), 0}, 3 * BST_ARCSEC_RAD),
            bst_vec3_scale((bst_vec3){-sin(dec) * cos(ra), -sin(dec) * sin(ra), cos(dec)},
                           4 * BST_ARCSEC_RAD)),
        .covariance = {{1, 2, 3, 4}, {2, 5, 6, 7}, {3, 6, 8, 9}, {4, 7, 9, 10}}};
    send(ctx, recorder, BST_CHANNEL_TRACKS, t, 4000);
    bst_tracks_smoothed *smoothed = calloc(1, sizeof *smoothed + sizeof(bst_track_smoothed));
    assert_non_null(smoothed);
    smoothed->exposure_id = 3;
    smoothed->tick = 750;
    smoothed->count = 1;
    smoothed->items[0] = (bst_track_smoothed){.id = 9,
                                              .status = BST_TRACK_COASTING,
                                              .later_frames = 1,
                                              .direction_gcrf = t->items[0].direction_gcrf,
                                              .rate_gcrf_radps = t->items[0].rate_gcrf_radps};
    memcpy(smoothed->items[0].covariance, t->items[0].covariance, sizeof t->items[0].covariance);
    send(ctx, recorder, BST_CHANNEL_TRACKS_SMOOTHED, smoothed, 4000);
    free(smoothed);
    bst_track_identities *identities =
        calloc(1, sizeof *identities + 2 * sizeof(bst_track_identity));
    assert_non_null(identities);
    identities->exposure_id = 4;
    identities->tick = 1500;
    identities->count = 2;
    identities->items[0] = (bst_track_identity){9, 0, 0.75};
    identities->items[1] = (bst_track_identity){9, -1, 0.25};
    send(ctx, recorder, BST_CHANNEL_TRACK_IDENTITIES, identities, 4000);
    free(identities);
    free(d);
    free(t);
    const bst_los_command los = {.tick = 5000, .direction_gcrf = {0, 1, 0}};
    send(ctx, recorder, BST_CHANNEL_LOS_COMMAND, &los, 4800);
    const bst_mount_status mount = {
        .tick = 4800, .axes = 2, .axis = {{.angle_rad = BST_PI, .flags = BST_AXIS_STUCK}}};
    send(ctx, recorder, BST_CHANNEL_MOUNT_STATUS, &mount, 4800);
    const bst_sensor_command sensor = {.exposure_s = 0.5, .window = {1, 2, 3, 4}};
    send(ctx, recorder, BST_CHANNEL_SENSOR_COMMAND, &sensor, 4800);
    bst_assert_ok(ctx, bst_recorder_event(ctx, recorder, 4800, "alpha/wide/control", "mode",
                                          "acquire -> track"));
}

/* Of a star, a hot pixel and an object, the rows of each choice. */
static void test_detections_of(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    bst_detections *d = calloc(1, sizeof *d + 3 * sizeof(bst_detection));
    assert_non_null(d);
    d->count = 3;
    d->items[0] = (bst_detection){.label = BST_LABEL_STAR, .star_id = 5};
    d->items[1] = (bst_detection){.label = BST_LABEL_OBJECT, .x_px = 2.0};
    d->items[2] = (bst_detection){.label = BST_LABEL_HOT_PIXEL};
    for (int choice = 0; choice <= BST_RECORD_OBJECTS; choice++) {
        bst_recorder_config config;
        bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_record_config_table, &config));
        assert_int_equal(config.detections_of, BST_RECORD_ALL_DETECTIONS);
        config.detections_of = choice;
        char out[600], db[640];
        snprintf(out, sizeof out, "%s/choice%d", s.folder, choice);
        snprintf(db, sizeof db, "%s/run.sqlite", out);
        bst_run *run;
        bst_assert_ok(&ctx, bst_run_create(&ctx, out, false, &run));
        bst_recorder *recorder = make(&ctx, run, &config, 1);
        send(&ctx, recorder, BST_CHANNEL_DETECTIONS, d, 4000);
        bst_assert_ok(&ctx, bst_recorder_close(&ctx, recorder));
        bst_assert_ok(&ctx, bst_run_finish(&ctx, run));
        assert_is(db, "SELECT count(*) FROM detections", 3 - choice);
        assert_is(db, "SELECT item FROM detections WHERE label = 'object' AND x_px = 2", 1);
        assert_is(db, "SELECT detections FROM detection_frames", 3);
    }
    free(d);
    scratch_remove(&s);
}

static void test_tables(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    bst_recorder_config config;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_record_config_table, &config));
    assert_int_equal(config.frames, BST_RECORD_EXTENSIONS);
    bst_assert_close(config.telemetry_hz, 1.0, 0.0);
    uint64_t digests[2];
    for (int round = 0; round < 2; round++) {
        char out[600], db[640];
        snprintf(out, sizeof out, "%s/run%d", s.folder, round);
        snprintf(db, sizeof db, "%s/run.sqlite", out);
        bst_run *run;
        bst_assert_ok(&ctx, bst_run_create(&ctx, out, false, &run));
        bst_recorder *recorder = make(&ctx, run, &config, 1);
        assert_int_equal(bst_recorder_find(recorder, "alpha", "wide"), 0);
        assert_int_equal(bst_recorder_find(recorder, "alpha", "a/b"), -1);
        assert_true(bst_recorder_wants(recorder, BST_CHANNEL_TRACKS));
        assert_false(bst_recorder_wants(recorder, BST_CHANNEL_PREDICTIONS));
        send_truth(&ctx, recorder, 4, false);
        send_all(&ctx, recorder);
        bst_assert_ok(&ctx, bst_recorder_close(&ctx, recorder));
        bst_assert_ok(&ctx, bst_run_finish(&ctx, run));

        assert_is(db, "SELECT tick_rate_hz FROM run WHERE epoch_utc LIKE '2022-06-16T22:10:00.0%'",
                  RATE);
        assert_is(db, "SELECT mid_s FROM exposures WHERE exposure_id = 4", 4.25);
        /* rounding of degrees */
        bst_assert_close(number(db, "SELECT boresight_ra_deg FROM exposures"), 0.5 / BST_DEG_RAD,
                         1e-12);
        assert_is(db, "SELECT x_chief_px FROM truth WHERE kind = 'star' AND id = 77", 1.5);
        bst_assert_close(
            number(db, "SELECT phase_deg FROM truth WHERE norad = 44801 AND in_field = 1"), 30.0,
            1e-12);
        assert_true(isnan(number(db, "SELECT range_m FROM truth WHERE kind = 'star'")));
        assert_is(db, "SELECT cov_xy_px2 FROM detections WHERE label = 'object' AND edge = 1",
                  -0.01);
        bst_assert_close(number(db, "SELECT angle_deg FROM detections"), 90.0, 1e-12);
        assert_is(db, "SELECT written_tick FROM detection_frames WHERE detections = 1", 4000);
        assert_is(db, "SELECT time_s FROM tracks WHERE status = 'confirmed'", 0.25);
        /* rounding: 1e-16 of a unit vector is 2e-11 arcsec */
        bst_assert_close(number(db, "SELECT rate_east_arcsec_per_s FROM tracks"), 3.0, 1e-9);
        bst_assert_close(number(db, "SELECT rate_north_arcsec_per_s FROM tracks"), 4.0, 1e-9);
        assert_is(db,
                  "SELECT 1 FROM tracks WHERE (cov_d1_d1_rad2, cov_d1_d2_rad2, cov_d2_d2_rad2, "
                  "cov_d1_r1_rad2ps, cov_d1_r2_rad2ps, cov_d2_r1_rad2ps, cov_d2_r2_rad2ps, "
                  "cov_r1_r1_rad2ps2, cov_r1_r2_rad2ps2, cov_r2_r2_rad2ps2) = "
                  "(1, 2, 5, 3, 4, 6, 7, 8, 9, 10)",
                  1);
        assert_is(db,
                  "SELECT s.time_s FROM tracks_smoothed s JOIN tracks t USING (track_id) WHERE "
                  "s.exposure_id = 3 AND s.status = 'coasting' AND s.later_frames = 1 AND "
                  "s.target_of_interest = 0 AND s.ra_deg = t.ra_deg AND s.dec_deg = t.dec_deg AND "
                  "s.rate_east_arcsec_per_s = t.rate_east_arcsec_per_s AND "
                  "s.cov_d1_r2_rad2ps = 4 AND s.cov_r2_r2_rad2ps2 = 10",
                  0.125);
        assert_is(db,
                  "SELECT sum(probability) FROM track_identities WHERE track_id = 9 AND time_s = "
                  "0.25 AND exposure_id = 4 AND (object = 0 OR (object = -1 AND name IS NULL AND "
                  "norad = 0))",
                  1.0);
        bst_assert_close(number(db, "SELECT attitude_error_x_arcsec FROM track_frames"), 1.0,
                         1e-12);
        assert_is(db, "SELECT ra_deg FROM los_commands WHERE written_tick = 4800", 90.0);
        assert_is(db, "SELECT axis0_deg FROM mount WHERE axis0_flags = 1 AND axis2_deg IS NULL",
                  180.0);
        assert_is(db, "SELECT width_px FROM sensor_commands WHERE x0_px = 1 AND y0_px = 2", 3);
        assert_is(db, "SELECT time_s FROM events WHERE kind = 'mode' AND text LIKE 'acq%'", 0.8);
        /* every column says what it is */
        assert_is(db, "SELECT count(*) FROM columns WHERE doc = ''", 0);
        assert_is(
            db,
            "SELECT count(*) FROM columns c LEFT JOIN pragma_table_info(c.\"table\") p ON "
            "p.name = c.\"column\" AND p.cid = c.position AND p.type = c.type WHERE p.name IS "
            "NULL",
            0);
        digests[round] = digest(db);
    }
    assert_true(digests[0] == digests[1]);
    scratch_remove(&s);
}

/* Telemetry at 1 kHz is kept at 4 Hz, on the grid; control also whenever its mode changes. */
static void test_decimation(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    bst_recorder_config config;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_record_config_table, &config));
    config.telemetry_hz = 4.0;
    char out[600], db[640];
    snprintf(out, sizeof out, "%s/run", s.folder);
    snprintf(db, sizeof db, "%s/run.sqlite", out);
    bst_run *run;
    bst_assert_ok(&ctx, bst_run_create(&ctx, out, false, &run));
    bst_recorder *recorder = make(&ctx, run, &config, 1);
    enum { RING = 16 };
    bst_los_history *h = calloc(1, sizeof *h + RING * sizeof(bst_los_sample));
    bst_pointing_telemetry *p = calloc(1, sizeof *p + RING * sizeof(bst_pointing_sample));
    assert_true(h && p);
    h->capacity = p->capacity = RING;
    send(&ctx, recorder, BST_CHANNEL_LOS_HISTORY, h, 0); /* empty: nothing to keep */
    for (int64_t n = 0; n < 2000; n++) {
        int64_t tick = 6 * n;
        h->items[n % RING] = (bst_los_sample){.tick = tick, .q_cam_from_gcrf = BST_QUAT_IDENTITY};
        p->items[n % RING] = (bst_pointing_sample){.tick = tick, .axis_rad = {0.1, 0.2}};
        h->written = p->written = n + 1;
        send(&ctx, recorder, BST_CHANNEL_LOS_HISTORY, h, tick);
        send(&ctx, recorder, BST_CHANNEL_POINTING_TELEMETRY, p, tick);
        const bst_nav_telemetry nav = {.tick = tick};
        send(&ctx, recorder, BST_CHANNEL_NAV_TELEMETRY, &nav, tick);
        const bst_control_status control = {.tick = tick,
                                            .mode = n < 300 ? BST_MODE_SLEW : BST_MODE_TRACK};
        send(&ctx, recorder, BST_CHANNEL_CONTROL_STATUS, &control, tick);
    }
    free(h);
    free(p);
    bst_assert_ok(&ctx, bst_recorder_close(&ctx, recorder));
    bst_assert_ok(&ctx, bst_run_finish(&ctx, run));
    /* two seconds */
    assert_is(db, "SELECT count(*) FROM los_truth WHERE tick % 1500 = 0", 8);
    assert_is(db, "SELECT count(*) FROM los_truth", 8);
    assert_is(db, "SELECT count(*) FROM pointing WHERE tick % 1500 = 0", 8);
    assert_is(db, "SELECT count(*) FROM nav", 8);
    assert_is(db, "SELECT count(*) FROM control", 9);
    assert_is(db, "SELECT tick FROM control WHERE mode = 'track' LIMIT 1", 1800);
    scratch_remove(&s);
}

static void read_key(const char *path, int hdu, const char *key, char *text, double *value) {
    fitsfile *f;
    int code = 0, type;
    fits_open_diskfile(&f, path, READONLY, &code);
    fits_movabs_hdu(f, hdu, &type, &code);
    if (text) {
        fits_read_key(f, TSTRING, key, text, NULL, &code);
    } else {
        fits_read_key(f, TDOUBLE, key, value, NULL, &code);
    }
    if (code == KEY_NO_EXIST && value) {
        *value = NAN;
    } else {
        assert_int_equal(code, 0);
    }
    code = 0;
    fits_close_file(f, &code);
}

static void count_log(void *user, bst_log_level level, const char *message) {
    (void)message;
    *(int *)user += level == BST_LOG_WARNING;
}

/* The axes of the frames with a truth are as long as their own pixels. */
static void scales_are_those_of_frames(const char *file) {
    static const int ids[4] = {0, 1, 3, 4};
    for (int i = 0; i < 4; i++) {
        double cd[2][2];
        read_key(file, 2 + i, "CD1_1", NULL, &cd[0][0]);
        read_key(file, 2 + i, "CD1_2", NULL, &cd[0][1]);
        read_key(file, 2 + i, "CD2_1", NULL, &cd[1][0]);
        read_key(file, 2 + i, "CD2_2", NULL, &cd[1][1]);
        for (int axis = 0; axis < 2; axis++) {
            bst_assert_close(3600.0 * hypot(cd[0][axis], cd[1][axis]), scale_of(ids[i]), 1e-6);
        }
    }
}

/* Frame before truth, truth before frame, truth long before, a dropped frame, a frame whose truth
 * never comes: every frame is written once, with its own truth, and let go. */
static void test_frames_meet_truth(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    int warnings = 0;
    bst_ctx ctx;
    bst_ctx_init(&ctx, count_log, &warnings, BST_LOG_INFO);
    bst_recorder_config config;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_record_config_table, &config));
    config.truth_stars = false;
    char out[600], db[640], file[640], text[80];
    snprintf(out, sizeof out, "%s/run", s.folder);
    snprintf(db, sizeof db, "%s/run.sqlite", out);
    snprintf(file, sizeof file, "%s/frames.fits", out);
    bst_run *run;
    bst_assert_ok(&ctx, bst_run_create(&ctx, out, false, &run));
    bst_recorder *recorder = make(&ctx, run, &config, 1);
    fake_frame frames[6];
    for (int i = 0; i < 6; i++) {
        fake_init(&frames[i], (uint16_t)(1000 * i));
    }
    send_frame(&ctx, recorder, &frames[0], 0);
    send_truth(&ctx, recorder, 0, false);
    send_truth(&ctx, recorder, 1, false);
    send_frame(&ctx, recorder, &frames[1], 1);
    send_truth(&ctx, recorder, 2, true); /* dropped: no frame comes */
    send_truth(&ctx, recorder, 3, false);
    send_truth(&ctx, recorder, 4, false);
    send_frame(&ctx, recorder, &frames[3], 3);
    send_frame(&ctx, recorder, &frames[4], 4);
    send_frame(&ctx, recorder, &frames[5], 5); /* no truth */
    assert_int_equal(frames[5].frame.references, 2);
    assert_int_equal(warnings, 0);
    bst_assert_ok(&ctx, bst_recorder_close(&ctx, recorder));
    bst_assert_ok(&ctx, bst_run_finish(&ctx, run));
    for (int i = 0; i < 6; i++) {
        assert_int_equal(frames[i].frame.references, 1);
        assert_int_equal(frames[i].recycled, 0); /* the channel still has its reference */
        assert_int_equal(frames[i].maps, 0);
    }
    assert_is(db, "SELECT count(*) FROM frames", 5);
    assert_is(db, "SELECT count(*) FROM exposures", 5);
    assert_is(db, "SELECT count(*) FROM truth", 5); /* objects only */
    assert_is(db, "SELECT exposure_id FROM frames WHERE fits_index = 3", 3);
    assert_is(db, "SELECT dropped FROM exposures WHERE exposure_id = 2", 1);
    /* rounding of degrees: the sight has no aberration here */
    bst_assert_close(number(db, "SELECT crval1_deg FROM frames WHERE exposure_id = 1"),
                     0.5 / BST_DEG_RAD, 1e-10);
    assert_true(isnan(number(db, "SELECT crval1_deg FROM frames WHERE exposure_id = 5")));
    double value;
    read_key(file, 3, "DATE-OBS", text, NULL);
    assert_string_equal(text, "2022-06-16T22:10:01.000000");
    read_key(file, 3, "CRVAL2", NULL, &value);
    bst_assert_close(value, 0.25 / BST_DEG_RAD, 1e-10);
    scales_are_those_of_frames(file);
    read_key(file, 4, "FRAMEID", NULL, &value);
    bst_assert_close(value, 3.0, 0.0);
    read_key(file, 6, "CRVAL2", NULL, &value);
    assert_true(isnan(value));
    scratch_remove(&s);
}

/* Two sensors, cubes, and what was not asked for is not there. */
static void test_choices(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    bst_recorder_config config = {.frames = BST_RECORD_CUBE};
    char out[600], db[640];
    snprintf(out, sizeof out, "%s/run", s.folder);
    snprintf(db, sizeof db, "%s/run.sqlite", out);
    bst_run *run;
    bst_assert_ok(&ctx, bst_run_create(&ctx, out, false, &run));
    bst_recorder *recorder = make(&ctx, run, &config, 2);
    static const char *const unwanted[] = {BST_CHANNEL_DETECTIONS, BST_CHANNEL_TRACKS,
                                           BST_CHANNEL_LOS_COMMAND, BST_CHANNEL_LOS_HISTORY,
                                           BST_CHANNEL_NAV_TELEMETRY};
    for (size_t i = 0; i < sizeof unwanted / sizeof *unwanted; i++) {
        assert_false(bst_recorder_wants(recorder, unwanted[i]));
    }
    send_all(&ctx, recorder); /* ignored */
    fake_frame f;
    fake_init(&f, 7);
    const bst_frame_message m = {
        .frame = &f.frame, .end_tick = 600, .window = {0, 0, WIDTH, HEIGHT}, .bits = 12};
    bst_assert_ok(&ctx, bst_recorder_channel(&ctx, recorder, 1, BST_CHANNEL_FRAME, &m, 600));
    assert_int_equal(f.frame.references, 1);
    assert_int_equal(bst_recorder_channel(&ctx, recorder, 2, BST_CHANNEL_FRAME, &m, 600),
                     BST_ERR_ARGUMENT);
    bst_assert_ok(&ctx, bst_recorder_close(&ctx, recorder));
    bst_assert_ok(&ctx, bst_run_finish(&ctx, run));
    assert_int_equal(scratch_count(out), 2);
    assert_true(scratch_has(scratch_path(&s, "run/frames_beta_a_b.fits")));
    assert_is(db, "SELECT count(*) FROM frames WHERE sensor = 1 AND fits_index = 0", 1);
    assert_is(db, "SELECT count(*) FROM tables", 3); /* run, sensors, frames */
    scratch_remove(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_tables),     cmocka_unit_test(test_detections_of),
        cmocka_unit_test(test_decimation), cmocka_unit_test(test_frames_meet_truth),
        cmocka_unit_test(test_choices),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
