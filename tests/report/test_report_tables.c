/* What a report takes from the tables of a run whose world cannot be made again: each value of a
 * frame against the rows, and the track's errors against vectors on the sphere. */
#include <cjson/cJSON.h>

#include "boresight/messages.h"
#include "boresight/vec.h"
#include "sim/report/report.h"
#include "sim/run/run_observations.h"
#include "tests/report/run_tables.h"
#include "tests/world/world_support.h"

enum { N = 24, RATE = 100 };

#define DEG (BST_PI / 180.0)
#define ARCSEC (BST_PI / 648000.0)

typedef struct row {
    int id;
    double mid, x, y, ra, dec, snr, v, range, phase, sun[3], here[3], beside_east, beside_north;
    int end_tick, dropped, in_field, occulted, detections, stars, valid, confirmed, fresh;
    double sunlit, track_time, rate_east, rate_north, cov[3], measured;
} row;

typedef struct fixture {
    run_tables tables;
    row rows[N];
    bst_report_sensor sensor;
} fixture;

static double draw(uint64_t *state) {
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return ((double)(*state >> 11) + 0.5) * 0x1p-53;
}

static void make_tables(run_tables *t) {
    run_tables_sql(
        t,
        "CREATE TABLE run (tick_rate_hz INT, epoch_utc TEXT, program TEXT);"
        "INSERT INTO run VALUES (%d, '2022-06-16T22:10:00Z', 'boresight 9');"
        "CREATE TABLE sensors (sensor INT, observer TEXT, name TEXT, target TEXT, file TEXT,"
        " width_px INT, height_px INT, pixel_scale_arcsec REAL);"
        "INSERT INTO sensors VALUES (0, 'eye', 'other', '', '', 1, 2, 3.0);"
        "INSERT INTO sensors VALUES (1, 'eye', 'camera', 'PREY', '', 640, 480, 4.0);"
        "CREATE TABLE objects (id INT, name TEXT);"
        "INSERT INTO objects VALUES (3, 'OTHER'), (7, 'PREY'), (8, 'NEXT');"
        "CREATE TABLE exposures (sensor INT, exposure_id INT, mid_s REAL, dropped INT,"
        " q_cam_from_gcrf_mid_x REAL, q_cam_from_gcrf_mid_y REAL, q_cam_from_gcrf_mid_z REAL,"
        " q_cam_from_gcrf_mid_w REAL, boresight_x_px REAL, boresight_y_px REAL,"
        " boresight_ra_deg REAL, boresight_dec_deg REAL, observer_gcrf_x_m REAL,"
        " observer_gcrf_y_m REAL, observer_gcrf_z_m REAL, sun_x_m REAL, sun_y_m REAL, sun_z_m REAL,"
        " pixel_scale_arcsec REAL, end_tick INT, lost INT, error_sigma REAL, hits INT,"
        " earth_fraction REAL, moon_fraction REAL, sun_fraction REAL);"
        "CREATE TABLE truth (sensor INT, exposure_id INT, kind TEXT, id INT, x_mid_px REAL,"
        " y_mid_px REAL, in_field INT, snr REAL, occulted INT, sunlit_fraction REAL, v_mag REAL,"
        " range_m REAL, phase_deg REAL, ra_deg REAL, dec_deg REAL);"
        "CREATE TABLE detection_frames (sensor INT, exposure_id INT, mid_s REAL, detections INT,"
        " stars_identified INT, lost INT);"
        "CREATE TABLE control (sensor INT, tick INT, time_s REAL, mode TEXT);"
        "CREATE TABLE track_frames (sensor INT, exposure_id INT, attitude_valid INT,"
        " written_tick INT, lost INT);"
        "CREATE TABLE tracks (sensor INT, exposure_id INT, tick INT, time_s REAL, status TEXT,"
        " ra_deg REAL, dec_deg REAL, rate_east_arcsec_per_s REAL, rate_north_arcsec_per_s REAL,"
        " cov_d1_d1_rad2 REAL, cov_d1_d2_rad2 REAL, cov_d2_d2_rad2 REAL, snr REAL,"
        " last_update_tick INT, target_of_interest INT);",
        RATE);
}

/* A row of each table; the other sensor's rows differ. The track lies `beside` the truth at
 * mid-exposure and is given at another time. */
static void write_row(run_tables *t, const row *r) {
    char v_mag[32] = "9e999"; /* infinity in SQL */
    if (isfinite(r->v)) {
        snprintf(v_mag, sizeof v_mag, "%.17g", r->v);
    }
    run_tables_sql(
        t,
        "INSERT INTO exposures VALUES (1, %d, %.17g, %d, 0, 0, 0, 1, 320.5, 241.25, %.17g,"
        " %.17g, %.17g, %.17g, %.17g, %.17g, %.17g, %.17g, 4.0, %d, 0, 0, 0, 0, 0, 0);"
        "INSERT INTO exposures VALUES (0, %d, 1e3, 1, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1, 1,"
        " 1, 1, 1, 5, 0, 0, 0, 0, 0, 0);",
        r->id, r->mid, r->dropped, r->ra + 0.2, r->dec - 0.1, r->here[0], r->here[1], r->here[2],
        r->sun[0], r->sun[1], r->sun[2], r->end_tick, r->id);
    run_tables_sql(
        t,
        "INSERT INTO truth VALUES (1, %d, 'object', 7, %.17g, %.17g, %d, %.17g, %d, %.17g,"
        " %s, %.17g, %.17g, %.17g, %.17g);"
        "INSERT INTO truth VALUES (1, %d, 'object', 3, 1, 2, 1, 99, 0, 1, 3, 4, 5, 6, 7);"
        "INSERT INTO truth VALUES (1, %d, 'star', 7, 1, 2, 1, 99, 0, 1, 3, 4, 5, 6, 7);"
        "INSERT INTO truth VALUES (0, %d, 'object', 7, 1, 2, 1, 99, 0, 1, 3, 4, 5, 6, 7);",
        r->id, r->x, r->y, r->in_field, r->snr, r->occulted, r->sunlit, v_mag, r->range, r->phase,
        r->ra, r->dec, r->id, r->id, r->id);
    run_tables_sql(
        t,
        "INSERT INTO detection_frames VALUES (1, %d, %.17g, %d, %d, 0), (0, %d, 1, 1, 1, 0);"
        "INSERT INTO track_frames VALUES (1, %d, %d, %d, 0);",
        r->id, r->mid, r->detections, r->stars, r->id, r->id, r->valid, r->end_tick + 40);
    double dt = r->track_time - r->mid; /* arcsec at the track's own time, on the tangent plane */
    double dec = r->dec + (r->beside_north + dt * r->rate_north) / 3600.0;
    double ra = r->ra + (r->beside_east + dt * r->rate_east) / 3600.0 / cos(r->dec * DEG);
    run_tables_sql(
        t,
        "INSERT INTO tracks VALUES (1, %d, %d, %.17g, '%s', %.17g, %.17g, %.17g, %.17g,"
        " %.17g, %.17g, %.17g, %.17g, %d, 1);"
        "INSERT INTO tracks VALUES (1, %d, 1, 1, 'confirmed', 1, 1, 0, 0, 1, 0, 1, 5, 1, 0);"
        "INSERT INTO tracks VALUES (0, %d, 1, 1, 'confirmed', 1, 1, 0, 0, 1, 0, 1, 5, 1, 1);",
        r->id, 50 + r->id, r->track_time,
        r->confirmed == 2   ? "confirmed"
        : r->confirmed == 1 ? "coasting"
                            : "tentative",
        ra, dec, r->rate_east, r->rate_north, r->cov[0], r->cov[1], r->cov[2], r->measured,
        r->fresh ? 50 + r->id : 3, r->id, r->id);
}

static void make_rows(row rows[N]) {
    uint64_t s = 77;
    for (int i = 0; i < N; i++) {
        row *r = &rows[i];
        double mid = 2.0 * i + 0.25 + 0.5 * draw(&s);
        *r = (row){.id = 10 + 2 * i, .mid = mid, .end_tick = (int)(100 * mid) + 30};
        double size = i < 8 ? 20.0 - 2.0 * i : 2.0 * draw(&s), angle = 6.2 * draw(&s);
        r->x = 320.5 + size * cos(angle);
        r->y = 241.25 + size * sin(angle);
        r->ra = 40.0 + 0.01 * i;
        r->dec = 55.0 - 0.02 * i;
        r->snr = i == 5 ? 0.0 : 5.0 + 10.0 * draw(&s);
        r->v = i == 9 ? INFINITY : 10.0 + draw(&s);
        r->range = 1e7 * (1 + draw(&s));
        r->phase = 100 * draw(&s);
        r->in_field = i != 12;
        r->occulted = i == 13 || i == 14;
        r->sunlit = i == 15 ? 0.0 : i == 16 ? 0.3 : 1.0; /* half shadow is no shadow */
        r->dropped = i == 4;
        r->detections = 30 + i;
        r->stars = 20 - i / 2;
        r->valid = i != 3;
        for (int k = 0; k < 3; k++) {
            r->sun[k] = 1e11 * (2 * draw(&s) - 1);
            r->here[k] = 5e6 * (k == 1 ? -1 : 1) * (1 + draw(&s));
        }
        r->track_time = mid + (i % 3 - 1) * 0.2;
        r->rate_east = 8 * draw(&s) - 4;
        r->rate_north = 8 * draw(&s) - 4;
        /* 5 px are 20 arcsec: off it in the first frames and in one later */
        double off = i < 4 || i == 17 ? 22.0 : 6.0 * draw(&s);
        angle = 6.2 * draw(&s);
        r->beside_east = off * cos(angle);
        r->beside_north = off * sin(angle);
        r->confirmed = i == 6 ? 0 : i % 4 == 1 ? 1 : 2;
        r->fresh = i % 5 != 2;
        r->measured = 4 + 8 * draw(&s);
        double a = 1 + draw(&s), b = 1 + draw(&s), rho = 1.6 * draw(&s) - 0.8;
        r->cov[0] = a * a * ARCSEC * ARCSEC;
        r->cov[1] = rho * a * b * ARCSEC * ARCSEC;
        r->cov[2] = b * b * ARCSEC * ARCSEC;
    }
}

static int set_up(void **state) {
    fixture *f = calloc(1, sizeof *f);
    assert_non_null(f);
    run_tables_begin(&f->tables, "run.sqlite");
    make_tables(&f->tables);
    make_rows(f->rows);
    for (int i = 0; i < N; i++) {
        write_row(&f->tables, &f->rows[i]);
    }
    /* idle, track from before the eighth frame on, coast in the last three */
    run_tables_sql(&f->tables,
                   "INSERT INTO control VALUES (1, 0, 0.0, 'idle'), (1, 300, 3.0, 'slew'),"
                   " (0, 310, 3.1, 'scan'), (1, 800, 8.0, 'slew'), (1, 1350, 13.5, 'track'),"
                   " (1, 4150, 41.5, 'coast')");
    *state = f;
    return 0;
}

static int tear_down(void **state) {
    fixture *f = *state;
    bst_report_sensor_free(&f->sensor);
    run_tables_end(&f->tables);
    free(f);
    return 0;
}

static void read_sensor(fixture *f) {
    bst_ctx ctx = {0};
    bst_run_sensor list[BST_EXPORT_SENSORS];
    int count;
    bst_run_reader *run = run_tables_open(&f->tables);
    bst_assert_ok(&ctx, bst_run_sensors(&ctx, run, NULL, list, &count));
    assert_int_equal(count, 2);
    bst_assert_ok(&ctx, bst_report_read(&ctx, run, NULL, &list[1], NULL, &f->sensor));
}

/* Cosine of the angle between two vectors, and the angle. */
static double angle_of(const double a[3], const double b[3]) {
    double ab = 0, aa = 0, bb = 0;
    for (int k = 0; k < 3; k++) {
        ab += a[k] * b[k];
        aa += a[k] * a[k];
        bb += b[k] * b[k];
    }
    return acos(ab / sqrt(aa * bb));
}

static void values_of_the_frames(void **state) {
    fixture *f = *state;
    read_sensor(f);
    const bst_report_sensor *s = &f->sensor;
    assert_string_equal(s->name, "eye/camera");
    assert_int_equal(s->count, N);
    assert_int_equal(s->exposures, N);
    assert_int_equal(s->width_px, 640);
    assert_int_equal(s->height_px, 480);
    bst_assert_close(s->pixel_scale_arcsec, 4, 0);
    assert_true(s->has_truth && s->has_tracks && !s->damaged);
    for (int i = 0; i < N; i++) {
        const bst_report_frame *r = &s->frames[i];
        const row *w = &f->rows[i];
        assert_int_equal(r->exposure_id, w->id);
        bst_assert_close(r->mid_s, w->mid, 1e-12);
        bst_assert_close(r->end_s, w->end_tick / 100.0, 1e-12);
        bst_assert_close(r->tracked_s, (w->end_tick + 40) / 100.0, 1e-12);
        assert_int_equal(r->dropped, w->dropped);
        assert_int_equal(r->attitude, w->valid);
        bst_assert_close(r->detections, w->detections, 0);
        bst_assert_close(r->stars, w->stars, 0);
        bst_assert_close(r->boresight_x_px, 320.5, 0);
        bst_assert_close(r->boresight_y_px, 241.25, 0);
        bst_assert_close(r->error_x_px, w->x - 320.5, 1e-12);
        bst_assert_close(r->error_y_px, w->y - 241.25, 1e-12);
        bst_assert_close(r->error_px * r->error_px,
                         (w->x - 320.5) * (w->x - 320.5) + (w->y - 241.25) * (w->y - 241.25), 1e-9);
        assert_int_equal(r->in_field, w->in_field);
        assert_int_equal(r->occulted, w->occulted);
        assert_int_equal(r->dark, w->sunlit == 0.0);
        assert_int_equal(r->visible, !w->occulted && isfinite(w->v));
        if (w->in_field && w->snr > 0.0) {
            bst_assert_close(r->snr, w->snr, 0);
        } else {
            assert_true(isnan(r->snr));
        }
        bst_assert_close(r->range_m, w->range, 0);
        bst_assert_close(r->phase_rad, w->phase * DEG, 1e-14);
        bst_assert_close(r->ra_deg, w->ra + 0.2, 1e-12);
        bst_assert_close(r->dec_deg, w->dec - 0.1, 1e-12);
        bst_assert_close(r->target_ra_deg, w->ra, 0);
        bst_assert_close(r->target_dec_deg, w->dec, 0);
        bst_assert_close(r->apparent_ra_deg, w->ra, 0);
        bst_assert_close(r->apparent_dec_deg, w->dec, 0);
        double ra = (w->ra + 0.2) * DEG, dec = (w->dec - 0.1) * DEG;
        const double look[3] = {cos(ra) * cos(dec), sin(ra) * cos(dec), sin(dec)};
        const double down[3] = {-w->here[0], -w->here[1], -w->here[2]};
        const double away[3] = {w->here[0], w->here[1], w->here[2]};
        double distance = sqrt(away[0] * away[0] + away[1] * away[1] + away[2] * away[2]);
        bst_assert_close(r->sun_rad, angle_of(look, w->sun), 1e-7); /* acos near its ends */
        bst_assert_close(r->limb_rad, angle_of(look, down) - asin(6378137.0 / distance), 1e-6);
        assert_true(isnan(r->latitude_rad));
    }
}

/* The world of a run: PREY seen from the observer "eye" with "camera". */
typedef struct own_world {
    bst_sensor_config sensor;
    bst_observer_config observer;
    bst_run_scene scene;
} own_world;

static void open_world(own_world *w) {
    bst_ctx ctx = {0};
    memset(w, 0, sizeof *w);
    snprintf(w->sensor.name, sizeof w->sensor.name, "camera");
    snprintf(w->observer.name, sizeof w->observer.name, "eye");
    w->observer.sensors = (bst_config_list){&w->sensor, 1};
    w->scene.scenario.observers = (bst_config_list){&w->observer, 1};
    w->scene.world = test_world_with(
        "{\"name\": \"OTHER\", " TEST_NEOSSAT "}, {\"name\": \"PREY\", " TEST_GX5 "}", "");
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, w->scene.world, &w->scene.view));
}

/* Directions, range and phase from places of the orbits; the aberrated direction to first order in
 * v / c (20 arcsec: second order 1 mas); latitude and longitude by the sidereal time, without
 * precession and polar motion (0.4 degree). */
static void values_of_the_world(void **state) {
    fixture *f = *state;
    bst_ctx ctx = {0};
    own_world w;
    open_world(&w);
    bst_world_view *view = w.scene.view;
    bst_vec3 geometric[N], apparent[N];
    double range[N], phase[N];
    for (int i = 0; i < N; i++) {
        double t = f->rows[i].mid;
        bst_world_state eye, prey;
        bst_bodies bodies;
        bst_assert_ok(&ctx, bst_world_view_observer_state(&ctx, view, 0, t, &eye));
        bst_assert_ok(&ctx, bst_world_view_bodies(&ctx, view, t, &bodies));
        double light_s = 0.0;
        bst_vec3 line = {0};
        for (int round = 0; round < 4; round++) {
            bst_assert_ok(&ctx, bst_world_view_object_state(&ctx, view, 1, t - light_s, &prey));
            line = bst_vec3_sub(bst_vec3_axpy(prey.position_m, -light_s, bodies.earth_bary_mps),
                                eye.position_m);
            light_s = bst_vec3_norm(line) / BST_LIGHT_SPEED_MPS;
        }
        geometric[i] = bst_vec3_unit(line);
        range[i] = test_distance(prey.position_m, eye.position_m);
        bst_vec3 v = bst_vec3_scale(bst_vec3_add(bodies.earth_bary_mps, eye.velocity_mps),
                                    1.0 / BST_LIGHT_SPEED_MPS);
        apparent[i] = bst_vec3_unit(bst_vec3_add(geometric[i], v));
        phase[i] = bst_vec3_angle(bst_vec3_sub(bodies.sun_m, prey.position_m),
                                  bst_vec3_sub(eye.position_m, prey.position_m));
        bst_quat q =
            bst_quat_look(bst_vec3_unit(bst_vec3_axpy(apparent[i], 2e-3, (bst_vec3){0.6, 0, 0.8})),
                          (bst_vec3){0.8, 0.6, 0});
        run_tables_sql(
            &f->tables,
            "UPDATE exposures SET q_cam_from_gcrf_mid_x = %.17g, q_cam_from_gcrf_mid_y = %.17g,"
            " q_cam_from_gcrf_mid_z = %.17g, q_cam_from_gcrf_mid_w = %.17g WHERE exposure_id = %d",
            q.x, q.y, q.z, q.w, f->rows[i].id);
        bst_vec3 seen = bst_quat_rotate(q, apparent[i]);
        /* 4 arcsec a pixel; 2e-3 rad from the axis the plane is off by 1e-6 of it */
        f->rows[i].x = seen.x / seen.z / (4 * ARCSEC);
        f->rows[i].y = seen.y / seen.z / (4 * ARCSEC);
    }
    /* modes change between the middle and the end of a frame: the end counts */
    run_tables_sql(&f->tables,
                   "DELETE FROM control; INSERT INTO control VALUES (1, 0, 0.0, 'idle'), (1, 1, "
                   "%.17g, 'track')",
                   f->rows[10].mid + 0.15);
    bst_run_sensor list[BST_EXPORT_SENSORS];
    int count;
    w.scene.run = run_tables_open(&f->tables);
    bst_assert_ok(&ctx, bst_run_sensors(&ctx, w.scene.run, NULL, list, &count));
    bst_assert_ok(&ctx, bst_report_read(&ctx, w.scene.run, &w.scene, &list[1], NULL, &f->sensor));
    for (int i = 0; i < N; i++) {
        const bst_report_frame *r = &f->sensor.frames[i];
        bst_vec3 to = bst_vec3_from_radec(r->target_ra_deg * DEG, r->target_dec_deg * DEG);
        bst_assert_close(bst_vec3_angle(to, geometric[i]), 0.0, 1e-7);
        to = bst_vec3_from_radec(r->apparent_ra_deg * DEG, r->apparent_dec_deg * DEG);
        bst_assert_close(bst_vec3_angle(to, apparent[i]), 0.0, 1e-7);
        bst_assert_close(r->range_m, range[i], 1e-6 * range[i]);
        bst_assert_close(r->phase_rad, phase[i], 1e-4); /* light from the Sun is 20 arcsec aside */
        bst_assert_close(r->error_x_px, f->rows[i].x, 0.01);
        bst_assert_close(r->error_y_px, f->rows[i].y, 0.01);
        bst_assert_close(r->error_px, hypot(f->rows[i].x, f->rows[i].y), 0.01);
        assert_int_equal(r->mode, i < 10 ? BST_MODE_IDLE : BST_MODE_TRACK);
        /* GMST of 2022-06-16 22:10 UT: 280.46062 + 360.98564737 (JD - 2451545) degrees (Meeus 1998,
         * eq. 12.4) */
        double days = 2459747.42361111 + r->mid_s / 86400.0 - 2451545.0;
        const double *here = f->rows[i].here;
        double lon =
            atan2(here[1], here[0]) - fmod(280.46061837 + 360.98564736629 * days, 360.0) * DEG;
        bst_assert_close(sin(r->longitude_rad - lon), 0.0, 0.4 * DEG);
        assert_true(cos(r->longitude_rad - lon) > 0.0);
        /* geocentric: at 8000 km and more the geodetic one is 0.1 degree from it */
        bst_assert_close(r->latitude_rad, atan2(here[2], hypot(here[0], here[1])), 0.4 * DEG);
    }
    bst_world_view_free(view);
    bst_world_free(w.scene.world);
}

static void errors_of_the_track(void **state) {
    fixture *f = *state;
    read_sensor(f);
    for (int i = 0; i < N; i++) {
        const bst_report_frame *r = &f->sensor.frames[i];
        const row *w = &f->rows[i];
        double e = w->beside_east, n = w->beside_north;
        /* 22 arcsec at a declination of 55 degrees: the tangent plane is off by 2e-3 arcsec */
        bst_assert_close(r->track_east_arcsec, e, 0.01);
        bst_assert_close(r->track_north_arcsec, n, 0.01);
        double a = w->cov[0] / (ARCSEC * ARCSEC), b = w->cov[1] / (ARCSEC * ARCSEC),
               c = w->cov[2] / (ARCSEC * ARCSEC);
        bst_assert_close(r->track_sigma_arcsec * r->track_sigma_arcsec, a + c, 1e-9);
        double nees = (e * e * c - 2 * e * n * b + n * n * a) / (a * c - b * b);
        bst_assert_close(r->nees, nees, 0.02 * (1 + nees));
        assert_int_equal(r->in_track, w->confirmed > 0 && hypot(e, n) < 20.0);
        assert_int_equal(r->updated, w->fresh);
        if (w->fresh) {
            bst_assert_close(r->track_snr, w->measured, 0);
        } else {
            assert_true(isnan(r->track_snr));
        }
    }
}

/* Acquired by the fifth frame, when its tracks were written; settled in the first frame from mode
 * track on that is within 3 px, at its start. */
static void figures_of_the_loop(void **state) {
    fixture *f = *state;
    read_sensor(f);
    const bst_report_sensor *s = &f->sensor;
    double acquired_s = (f->rows[4].end_tick + 40) / 100.0, settled_s = NAN;
    int visible = 0, in_track = 0, later = 0, in_track_later = 0, breaks = 0, pointing = 0;
    double sum2 = 0, sum_x = 0, sum_y = 0, largest = 0;
    bool was = false;
    for (int i = 0; i < N; i++) {
        const row *w = &f->rows[i];
        bool seen = !w->occulted && isfinite(w->v), held = s->frames[i].in_track;
        double end_s = w->end_tick / 100.0, x = w->x - 320.5, y = w->y - 241.25;
        int mode = end_s >= 41.5   ? BST_MODE_COAST
                   : end_s >= 13.5 ? BST_MODE_TRACK
                   : end_s >= 3.0  ? BST_MODE_SLEW
                                   : BST_MODE_IDLE;
        assert_int_equal(s->frames[i].mode, mode);
        if (isnan(settled_s) && end_s >= acquired_s && mode == BST_MODE_TRACK && hypot(x, y) < 3) {
            settled_s = 2 * w->mid - end_s;
        }
        assert_int_equal(s->frames[i].acquired, w->mid >= acquired_s);
        assert_int_equal(s->frames[i].settled, !isnan(settled_s));
        if (seen) {
            visible++;
            in_track += held;
            breaks += was && !held;
            was = held;
            later += w->mid >= acquired_s;
            in_track_later += held && w->mid >= acquired_s;
            if (!isnan(settled_s) && mode == BST_MODE_TRACK) {
                pointing++;
                sum2 += x * x + y * y;
                sum_x += x;
                sum_y += y;
                largest = fmax(largest, hypot(x, y));
            }
        }
    }
    const bst_loop_figures *l = &s->loop;
    bst_assert_close(l->time_to_acquire_s, acquired_s, 1e-12);
    bst_assert_close(l->time_to_settle_s, settled_s, 1e-9);
    assert_true(isnan(l->time_to_confirm_s));
    assert_int_equal(l->frames, N);
    assert_int_equal(l->visible_frames, visible);
    assert_int_equal(l->breaks, breaks);
    assert_true(breaks > 0 && pointing > 5);
    bst_assert_close(l->custody, (double)in_track / visible, 1e-12);
    bst_assert_close(l->track_fraction, (double)in_track_later / later, 1e-12);
    assert_int_equal(l->pointing_frames, pointing);
    bst_assert_close(l->pointing_rms_px, sqrt(sum2 / pointing), 1e-9);
    bst_assert_close(l->pointing_bias_px, hypot(sum_x, sum_y) / pointing, 1e-9);
    bst_assert_close(l->pointing_max_px, largest, 1e-9);
    assert_int_equal(l->final_mode, BST_MODE_COAST);
}

/* From 20 s on the task is another object: its rows of the truth count, and acquisition begins
 * anew. */
static void tasks(void **state) {
    fixture *f = *state;
    run_tables_sql(
        &f->tables,
        "CREATE TABLE tasks (sensor INT, time_s REAL, object INT);"
        "INSERT INTO tasks VALUES (1, 0.0, -1), (0, 1.0, 3), (1, 20.0, 8), (1, 36.0, 3)");
    for (int i = 0; i < N; i++) {
        run_tables_sql(
            &f->tables,
            "INSERT INTO truth VALUES (1, %d, 'object', 8, 300, 200, 1, %d, 0, 1, 3, 4, 5,"
            " 200, -7)",
            f->rows[i].id, 50 + i);
    }
    read_sensor(f);
    assert_int_equal(f->sensor.task_count, 3);
    bool began[3] = {false};
    for (int i = 0; i < N; i++) {
        const bst_report_frame *r = &f->sensor.frames[i];
        double mid = f->rows[i].mid, end = f->rows[i].end_tick / 100.0;
        bst_assert_close(r->target_ra_deg, mid < 20 ? f->rows[i].ra : mid < 36 ? 200 : 6, 1e-12);
        int task = end >= 36 ? 2 : end >= 20 ? 1 : 0;
        assert_int_equal(r->task_begins, !began[task]);
        began[task] = true;
        if (mid >= 20) {
            assert_false(r->acquired || r->settled);
        }
    }
}

/* Figures come from the manifest where it has all of them. */
static void figures_of_the_summary(void **state) {
    (void)state;
    cJSON *summary = cJSON_Parse(
        "{\"time_to_confirm_s\": 1.5, \"time_to_acquire_s\": 2.5, \"time_to_settle_s\": 3.5,"
        " \"custody\": 0.25, \"track_fraction\": 0.35, \"pointing_rms_px\": 4.5,"
        " \"pointing_median_px\": 5.5, \"pointing_p95_px\": 6.5, \"pointing_p99_px\": 7.5,"
        " \"pointing_max_px\": 8.5, \"pointing_bias_px\": 9.5, \"real_time_factor\": 10.5,"
        " \"track_rms_px\": 11.5, \"track_median_px\": 12.5, \"track_p95_px\": 13.5,"
        " \"track_max_px\": null, \"frames\": 14, \"visible_frames\": 15, \"breaks\": 16,"
        " \"wrong_target_frames\": 17, \"pointing_frames\": 18, \"bad_pixels\": 19,"
        " \"track_frames\": 20, \"final_mode\": \"search\"}");
    bst_report_sensor s = {.exposures = 3};
    bst_report_judge(&s, summary);
    const bst_loop_figures *l = &s.loop;
    const double reals[] = {l->time_to_confirm_s, l->time_to_acquire_s,  l->time_to_settle_s,
                            l->pointing_rms_px,   l->pointing_median_px, l->pointing_p95_px,
                            l->pointing_p99_px,   l->pointing_max_px,    l->pointing_bias_px,
                            s.real_time_factor,   s.track_rms_px,        s.track_median_px,
                            s.track_p95_px};
    for (int k = 0; k < 13; k++) {
        bst_assert_close(reals[k], k + 1.5, 0);
    }
    assert_true(isnan(s.track_max_px));
    bst_assert_close(l->custody, 0.25, 0);
    bst_assert_close(l->track_fraction, 0.35, 0);
    const int64_t counts[] = {
        l->frames,          l->visible_frames, l->breaks,     l->wrong_target_frames,
        l->pointing_frames, s.bad_pixels,      s.track_frames};
    for (int k = 0; k < 7; k++) {
        assert_int_equal(counts[k], 14 + k);
    }
    assert_int_equal(l->final_mode, BST_MODE_SEARCH);
    /* of an earlier version: only the speed */
    cJSON_DeleteItemFromObject(summary, "pointing_frames");
    bst_report_judge(&s, summary);
    assert_int_equal(s.loop.frames, 3);
    assert_int_equal(s.loop.final_mode, -1);
    assert_true(isnan(s.loop.custody) && isnan(s.track_rms_px));
    bst_assert_close(s.real_time_factor, 10.5, 0);
    cJSON_Delete(summary);
}

/* Without exposures the frames come from other tables. */
static void frames_without_exposures(void **state) {
    fixture *f = *state;
    run_tables_sql(
        &f->tables,
        "DROP TABLE exposures;"
        "CREATE TABLE frames (sensor INT, exposure_id INT, start_s REAL, exposure_s REAL);"
        "INSERT INTO frames VALUES (1, 10, 5.0, 3.0), (0, 11, 1, 1), (1, 12, 9.0, 1.0)");
    read_sensor(f);
    assert_int_equal(f->sensor.count, 2);
    bst_assert_close(f->sensor.frames[0].mid_s, 6.5, 1e-12);
    bst_assert_close(f->sensor.frames[1].mid_s, 9.5, 1e-12);
    assert_int_equal(f->sensor.frames[1].exposure_id, 12);
    assert_int_equal(f->sensor.frames[0].mode, BST_MODE_SLEW);
}

/* The caption of the wheels' chart: the wheel that is nearest to its own limit, in percent of it,
 * of this sensor alone. */
static void fastest_wheel(void **state) {
    (void)state;
    run_tables t;
    bst_ctx ctx = {0};
    char *page = NULL;
    size_t bytes = 0;
    FILE *out = open_memstream(&page, &bytes);
    assert_non_null(out);
    run_tables_begin(&t, "run.sqlite");
    run_tables_sql(&t,
                   "CREATE TABLE wheels (sensor INT, time_s REAL, wheel INT, speed_rpm REAL,"
                   " speed_limit_rpm REAL);"
                   "INSERT INTO wheels VALUES (1, 0, 0, 1200, 6000), (1, 0, 1, -900, 4000),"
                   " (1, 0, 2, 100, 6000), (0, 0, 0, 5900, 6000), (1, 9, 0, -1500, 6000),"
                   " (1, 9, 1, -1300, 4000), (1, 9, 2, 1400, 6000);");
    bst_run_reader *run = run_tables_open(&t);
    bst_assert_ok(&ctx, bst_report_wheels(&ctx, out, run, 1, 9.0));
    fclose(out);
    assert_non_null(strstr(page, "Limit: 4000 to 6000 rpm"));
    assert_non_null(strstr(page, "Largest: 1300 rpm, 32.5 % of it, wheel 1."));
    free(page);
    run_tables_end(&t);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fastest_wheel),
        cmocka_unit_test_setup_teardown(values_of_the_frames, set_up, tear_down),
        cmocka_unit_test_setup_teardown(values_of_the_world, set_up, tear_down),
        cmocka_unit_test_setup_teardown(errors_of_the_track, set_up, tear_down),
        cmocka_unit_test_setup_teardown(figures_of_the_loop, set_up, tear_down),
        cmocka_unit_test_setup_teardown(tasks, set_up, tear_down),
        cmocka_unit_test(figures_of_the_summary),
        cmocka_unit_test_setup_teardown(frames_without_exposures, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
