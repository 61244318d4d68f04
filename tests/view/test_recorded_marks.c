/* What the viewer sends of a recorded run: frames, marks, plots and the facts behind its reasons,
 * each against the rows of the tables. The frames are windows off the corner, binned by 3 or not;
 * the sensor is the second of two. */
#include "boresight/vec.h"
#include "tests/report/run_tables.h"
#include "tests/test_support.h"
#include "view/noise_free.h"
#include "view/recorded_run_internal.h"
#include "view/track_history.h"
#include "view/why.h"

enum { FRAMES = 9, RATE = 250, SHOWN = 4 };

static bst_view_why_facts facts;
static char facts_object[64], facts_status[32];
static int looks;

/* Keeps the facts of the frame that is asked for: the fifth that is looked at. */
const char *__wrap_bst_view_why_reason(const bst_view_why_facts *f, char *text, size_t bytes);
const char *__wrap_bst_view_why_reason(const bst_view_why_facts *f, char *text, size_t bytes) {
    if (looks++ == SHOWN) {
        facts = *f;
        snprintf(facts_object, sizeof facts_object, "%s", f->object);
        snprintf(facts_status, sizeof facts_status, "%s", f->track_status);
    }
    snprintf(text, bytes, "text");
    return f->dropped ? "dropped" : "other";
}

static double binning_of(int i) {
    return i % 2 == 0 ? 3.0 : 1.0;
}

static double mid_of(int i) {
    return 0.8 + 2.5 * i;
}

static double x_of(double x_px, int i) {
    return (x_px - (20.0 + 3 * i)) / binning_of(i) + (0.5 / binning_of(i) - 0.5);
}

static double y_of(double y_px, int i) {
    return (y_px - (50.0 + 6 * i)) / binning_of(i) + (0.5 / binning_of(i) - 0.5);
}

static void make_tables(run_tables *t) {
    run_tables_begin(t, "run.sqlite");
    run_tables_sql(
        t,
        "CREATE TABLE run (tick_rate_hz INT, epoch_utc TEXT, program TEXT);"
        "INSERT INTO run VALUES (%d, '2022-06-16T22:10:00Z', 'boresight 9');"
        "CREATE TABLE sensors (sensor INT, observer TEXT, name TEXT, target TEXT, file TEXT,"
        " width_px INT, height_px INT, pixel_scale_arcsec REAL);"
        "INSERT INTO sensors VALUES (0, 'eye', 'other', '', '', 1, 2, 3.0);"
        "INSERT INTO sensors VALUES (5, 'eye', 'camera', 'PREY', '', 640, 480, 4.0);"
        "CREATE TABLE objects (id INT, name TEXT);"
        "INSERT INTO objects VALUES (3, 'OTHER'), (7, 'PREY'), (8, 'NEXT');"
        "CREATE TABLE exposures (sensor INT, exposure_id INT, mid_s REAL, start_tick INT,"
        " end_tick INT, dropped INT, boresight_x_px REAL, boresight_y_px REAL);"
        "CREATE TABLE frames (sensor INT, exposure_id INT, fits_index INT, x0_px INT, y0_px INT,"
        " binning INT, crpix1 REAL, crpix2 REAL, crval1_deg REAL, crval2_deg REAL,"
        " cd1_1_deg REAL, cd1_2_deg REAL, cd2_1_deg REAL, cd2_2_deg REAL);"
        "CREATE TABLE truth (sensor INT, exposure_id INT, kind TEXT, id INT, norad INT,"
        " in_field INT, occulted INT, saturated INT, x_centroid_px REAL, y_centroid_px REAL,"
        " x_mid_px REAL, y_mid_px REAL, x_start_px REAL, y_start_px REAL, x_end_px REAL,"
        " y_end_px REAL, v_mag REAL, snr REAL, sunlit_fraction REAL, mid_s REAL, ra_deg REAL,"
        " dec_deg REAL);",
        RATE);
    run_tables_sql(
        t,
        "CREATE TABLE detection_frames (sensor INT, exposure_id INT, mid_s REAL,"
        " start_tick INT, end_tick INT, written_tick INT, detections INT, stars_identified INT,"
        " background_e REAL, noise_e REAL, threshold_snr REAL, lost INT);"
        "CREATE TABLE detections (sensor INT, exposure_id INT, label TEXT, star_id INT,"
        " x_px REAL, y_px REAL, cov_xx_px2 REAL, cov_xy_px2 REAL, cov_yy_px2 REAL, flux_e REAL,"
        " snr REAL, length_px REAL, angle_deg REAL, v_mag REAL, blend INT, streak INT);"
        "CREATE TABLE tracks (sensor INT, exposure_id INT, time_s REAL, track_id INT,"
        " status TEXT, target_of_interest INT, x_px REAL, y_px REAL, snr REAL, ra_deg REAL,"
        " dec_deg REAL, misses_in_row INT, v_mag REAL, cov_d1_d1_rad2 REAL,"
        " cov_d2_d2_rad2 REAL, rate_east_arcsec_per_s REAL, rate_north_arcsec_per_s REAL,"
        " cov_d1_d2_rad2 REAL, cov_d1_r1_rad2ps REAL, cov_d1_r2_rad2ps REAL,"
        " cov_d2_r1_rad2ps REAL, cov_d2_r2_rad2ps REAL, cov_r1_r1_rad2ps2 REAL,"
        " cov_r1_r2_rad2ps2 REAL, cov_r2_r2_rad2ps2 REAL, hits INT, first_tick INT);"
        "CREATE TABLE track_frames (sensor INT, exposure_id INT, time_s REAL, tick INT,"
        " written_tick INT, attitude_error_x_arcsec REAL, attitude_error_y_arcsec REAL,"
        " attitude_error_z_arcsec REAL, attitude_valid INT);"
        "CREATE TABLE control (sensor INT, time_s REAL, mode TEXT, aim_error_x_px REAL,"
        " aim_error_y_px REAL);"
        "CREATE TABLE pointing (sensor INT, time_s REAL, axis_outer_deg REAL,"
        " axis_inner_deg REAL);"
        "CREATE TABLE events (time_s REAL, source TEXT, kind TEXT, text TEXT);");
}

/* Rows of one exposure: those of the other sensor have other values. */
static void add_rows(run_tables *t, int i, int sensor, double more) {
    int id = 10 + 2 * i;
    double at = mid_of(i) + more;
    run_tables_sql(t, "INSERT INTO exposures VALUES (%d,%d,%.17g,%d,%d,%d,%.17g,%.17g)", sensor, id,
                   at, 100 * i, 100 * i + 30 + i, i == 2, 300.0 + i, 200.0 - 2 * i);
    run_tables_sql(t,
                   "INSERT INTO frames VALUES (%d,%d,NULL,%d,%d,%.0f,%d.25,%d.75,%d.5,-%d.5,"
                   "1e-3,%d.0,-2e-3,%d.5)",
                   sensor, id, 20 + 3 * i, 50 + 6 * i, binning_of(i), i, i + 3, 30 + i, 40 + i,
                   i + 1, i + 2);
    /* the target, another object, two stars; one of them outside */
    double x = 100.0 + 8 * i + more, y = 150.0 + 5 * i;
    run_tables_sql(t,
                   "INSERT INTO truth VALUES (%d,%d,'object',7,25544,1,%d,%d,%.17g,%.17g,%.17g,"
                   "%.17g,%.17g,%.17g,%.17g,%.17g,8.5,%.17g,0.75,%.17g,121.501,-34.25)",
                   sensor, id, i == 4, i == 4, x + 0.125, y - 0.25, x, y, x - 6.0, y - 2.5, x + 6.0,
                   y + 2.5, 12.0 + i, at);
    run_tables_sql(t,
                   "INSERT INTO truth VALUES (%d,%d,'object',8,0,1,0,0,%.17g,%.17g,%.17g,%.17g,0,0,"
                   "0,0,9.5,3.0,1.0,%.17g,1,2), (%d,%d,'object',3,0,1,0,0,400,300,400,300,0,0,0,0,"
                   "9.5,3.0,1.0,%.17g,1,2)",
                   sensor, id, x + 40.0, y, x + 40.0, y + 3.0, at, sensor, id, at);
    run_tables_sql(
        t,
        "INSERT INTO truth VALUES (%d,%d,'star',77,0,1,0,0,%.17g,%.17g,%.17g,%.17g,0,0,0,"
        "0,7.25,30.0,1.0,%.17g,1,2), (%d,%d,'star',78,0,0,0,0,-5,-6,-5,-6,0,0,0,0,"
        "9.5,3.0,1.0,%.17g,1,2)",
        sensor, id, x - 3.0, y + 15.0, x - 3.0, y + 15.0, at, sensor, id, at);
    run_tables_sql(t,
                   "INSERT INTO detection_frames VALUES (%d,%d,%.17g,%d,%d,%d,%d,%d,%.17g,%.17g,"
                   "%.17g,%d)",
                   sensor, id, at, 100 * i, 100 * i + 30, 100 * i + 30 + 5 * i, 20 + i, 7 + i,
                   50.5 + i, 7.5 - 0.1 * i, 5.25, i);
    run_tables_sql(t,
                   "INSERT INTO detections VALUES (%d,%d,'star',77,%.17g,%.17g,0.9,-0.4,0.3,1000,"
                   "20,9,35,7.5,0,0), (%d,%d,'unknown',0,%.17g,%.17g,0.18,0.09,0.36,2000,15,18,-40,"
                   "8.25,1,1)",
                   sensor, id, x - 30.0, y + 15.5, sensor, id, x + 6.9, y + 2.8);
    run_tables_sql(t,
                   "INSERT INTO tracks VALUES (%d,%d,%.17g,4,'confirmed',1,%.17g,%.17g,14.5,120.5,"
                   "-33.25,0,8.75,1e-10,2e-10,3,4,5e-11,6e-11,7e-11,8e-11,9e-11,1e-11,2e-11,"
                   "3e-11,%d,%d), (%d,%d,%.17g,9,'tentative',0,%.17g,%.17g,5.5,121.5,"
                   "-34.25,%d,9.75,3e-10,5e-10,3,4,NULL,6e-11,7e-11,8e-11,9e-11,1e-11,2e-11,"
                   "3e-11,1,0)",
                   sensor, id, at + 0.1, x + 6.9, y + 2.8, 2 + i, 250, sensor, id, at + 0.1,
                   x + 10.0, y - 5.0, i == 4 ? 2 : 0);
    run_tables_sql(t, "INSERT INTO track_frames VALUES (%d,%d,%.17g,%d,%d,%.17g,%.17g,%.17g,%d)",
                   sensor, id, at + 0.1, 100 * i + 15, 100 * i + 60 + 3 * i, 1.5 + i, -2.5 - i,
                   8.0 * i, i != 4);
    run_tables_sql(t, "INSERT INTO control VALUES (%d,%.17g,'%s',%.17g,%.17g)", sensor, at + 0.2,
                   i < 3 ? "acquire" : "track", 3.0 * (i + 1), -4.0 * (i + 1));
    run_tables_sql(t, "INSERT INTO pointing VALUES (%d,%.17g,%.17g,%.17g)", sensor, at + 0.3,
                   30.0 + i, -12.0 - i);
}

static bst_view_run *open_run(run_tables *t, bst_view_subject *subject) {
    bst_ctx ctx = {0};
    bst_view_run *run;
    int64_t number;
    make_tables(t);
    for (int i = 0; i < FRAMES; i++) {
        add_rows(t, i, 0, 1000.0);
        add_rows(t, i, 5, 0.0);
    }
    run_tables_sql(t, "INSERT INTO events VALUES (4.5,'eye','lost','of it')");
    run_tables_close(t);
    bst_assert_ok(&ctx, bst_view_subject_open(&ctx, subject, t->place.folder, &number));
    bst_assert_ok(&ctx, bst_view_subject_run(&ctx, subject, number, &run));
    return run;
}

typedef struct fixture {
    run_tables tables;
    bst_view_subject *subject;
    bst_view_run *run;
} fixture;

static int setup(void **state) {
    static fixture f;
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_view_subject_create(&ctx, &f.subject));
    f.run = open_run(&f.tables, f.subject);
    *state = &f;
    return 0;
}

static int teardown(void **state) {
    fixture *f = *state;
    bst_view_subject_free(f->subject);
    scratch_remove(&f->tables.place);
    return 0;
}

static const cJSON *member(const cJSON *node, const char *key) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(node, key);
    if (!item) {
        fail_msg("there is no %s", key);
    }
    return item;
}

static double number(const cJSON *node, const char *key) {
    const cJSON *item = member(node, key);
    /* numbers of the tables may be kept as text */
    return cJSON_IsNumber(item) ? item->valuedouble : strtod(item->valuestring, NULL);
}

#define SAME(node, key, value) bst_assert_close(number(node, key), value, 1e-9)

static void frames_are_listed(void **state) {
    fixture *f = *state;
    bst_ctx ctx = {0};
    bst_view_bytes list;
    bst_assert_ok(&ctx, bst_view_run_frames(&ctx, f->run, 1, &list));
    assert_int_equal(list.bytes, FRAMES * BST_VIEW_FRAME_NUMBERS * sizeof(double));
    const double *row = list.data;
    for (int i = 0; i < FRAMES; i++, row += BST_VIEW_FRAME_NUMBERS) {
        bst_assert_close(row[0], 10 + 2 * i, 0.0);
        bst_assert_close(row[1], mid_of(i), 1e-12);
        bst_assert_close(row[2], (30.0 + i) / RATE, 1e-12);
        bst_assert_close(row[3], -1.0, 0.0); /* there is no file */
        bst_assert_close(row[4], i == 2, 0.0);
    }
    free(list.data);
}

static void check_frame(const fixture *f, int i) {
    bst_ctx ctx = {0};
    cJSON *node;
    double x = 100.0 + 8 * i, y = 150.0 + 5 * i, b = binning_of(i);
    bst_assert_ok(&ctx, bst_view_run_frame(&ctx, f->run, 1, i, &node));
    SAME(node, "exposure_id", 10 + 2 * i);
    SAME(node, "binning", b);
    SAME(node, "target", 7);
    char utc[40];
    int ms = (int)lround(1000.0 * mid_of(i)); /* less than a minute */
    snprintf(utc, sizeof utc, "2022-06-16T22:10:%02d.%03d", ms / 1000, ms % 1000);
    assert_non_null(strstr(member(node, "utc")->valuestring, utc));

    const cJSON *truth = member(node, "truth"), *item = truth->child;
    assert_int_equal(cJSON_GetArraySize(truth), 4); /* one star is outside */
    assert_string_equal(member(item, "kind")->valuestring, "object");
    SAME(item, "id", 7);
    SAME(item, "norad", 25544);
    SAME(item, "x", x_of(x + 0.125, i));
    SAME(item, "y", y_of(y - 0.25, i));
    SAME(item, "v_mag", 8.5);
    SAME(item, "snr", 12.0 + i);
    SAME(item->next->next->next, "id", 77);

    const cJSON *d = member(node, "detections");
    assert_int_equal(cJSON_GetArraySize(d), 2);
    assert_string_equal(member(d->child, "label")->valuestring, "star");
    SAME(d->child, "star_id", 77);
    d = d->child->next;
    SAME(d, "x", x_of(x + 6.9, i));
    SAME(d, "y", y_of(y + 2.8, i));
    SAME(d, "xx", 0.18 / (b * b));
    SAME(d, "xy", 0.09 / (b * b));
    SAME(d, "yy", 0.36 / (b * b));
    SAME(d, "flux_e", 2000.0);
    SAME(d, "snr", 15.0);
    SAME(d, "length", 18.0 / b);
    SAME(d, "angle_deg", -40.0);
    SAME(d, "v_mag", 8.25);

    /* those of now, then the earlier ones in this frame's pixels */
    const cJSON *tracks = member(node, "tracks"), *track = tracks->child;
    assert_int_equal(cJSON_GetArraySize(tracks), 2 * (i + 1));
    assert_true(cJSON_IsTrue(member(track, "now")));
    assert_true(cJSON_IsTrue(member(track, "target")));
    assert_string_equal(member(track, "status")->valuestring, "confirmed");
    SAME(track, "id", 4);
    SAME(track, "x", x_of(x + 6.9, i));
    SAME(track, "y", y_of(y + 2.8, i));
    SAME(track, "snr", 14.5);
    SAME(track, "ra_deg", 120.5);
    SAME(track, "dec_deg", -33.25);
    SAME(track, "misses", 0);
    SAME(track, "v_mag", 8.75);
    assert_true(cJSON_IsFalse(member(track->next, "target")));
    static const double state[] = {3,     4,     1e-10, 5e-11, 2e-10, 6e-11,
                                   7e-11, 8e-11, 9e-11, 1e-11, 2e-11, 3e-11};
    for (int k = 0; k < 12; k++) {
        bst_assert_close(cJSON_GetArrayItem(member(track, "state"), k + 1)->valuedouble, state[k],
                         0.0);
    }
    assert_null(cJSON_GetObjectItem(track->next, "state")); /* one number is missing */
    if (i > 5) {                                            /* ids are 2 apart */
        assert_non_null(cJSON_GetObjectItem(cJSON_GetArrayItem(tracks, 2 * i), "state"));
        assert_null(cJSON_GetObjectItem(cJSON_GetArrayItem(tracks, 2), "state"));
    }
    if (i > 0) {
        track = track->next->next;
        assert_true(cJSON_IsFalse(member(track, "now")));
        SAME(track, "x", x_of(100.0 + 6.9, i));
        SAME(track, "y", y_of(150.0 + 2.8, i));
    }

    const cJSON *wcs = member(node, "wcs");
    const double want[3][4] = {
        {i + 0.25, i + 3.75}, {30.5 + i, -40.5 - i}, {1e-3, i + 1.0, -2e-3, i + 2.5}};
    static const char *const keys[3] = {"crpix", "crval_deg", "cd_deg"};
    for (int k = 0; k < 3; k++) {
        for (int n = 0; n < (k < 2 ? 2 : 4); n++) {
            bst_assert_close(cJSON_GetArrayItem(member(wcs, keys[k]), n)->valuedouble, want[k][n],
                             1e-12);
        }
    }
    cJSON_Delete(node);
}

static void marks_are_in_pixels_of_their_frame(void **state) {
    bst_ctx ctx = {0};
    cJSON *node;
    fixture *f = *state;
    check_frame(f, 0);
    check_frame(f, 5);
    check_frame(f, FRAMES - 1);
    assert_int_equal(bst_view_run_frame(&ctx, f->run, 1, FRAMES, &node), BST_ERR_NOT_FOUND);
    assert_int_equal(bst_view_run_frame(&ctx, f->run, 2, 0, &node), BST_ERR_NOT_FOUND);
}

/* Value of line k of a panel in exposure i, and its time after mid-exposure. */
static double plotted(const char *panel, int k, int i, double *after_s) {
    double x = 100.0 + 8 * i, y = 150.0 + 5 * i;
    *after_s = 0.0;
    if (strcmp(panel, "pointing_error") == 0) {
        *after_s = k == 0 ? 0.0 : 0.2;
        return k == 0 ? hypot(x - 300.0 - i, y - 200.0 + 2 * i) : 5.0 * (i + 1);
    }
    if (strcmp(panel, "snr") == 0) {
        *after_s = k == 0 ? 0.0 : 0.1;
        return k == 0 ? 12.0 + i : 14.5;
    }
    if (strcmp(panel, "mount") == 0) {
        *after_s = 0.3;
        return k == 0 ? 30.0 + i : -12.0 - i;
    }
    if (strcmp(panel, "detections") == 0) {
        return k == 0 ? 20.0 + i : 7.0 + i;
    }
    if (strcmp(panel, "attitude_error") == 0) {
        *after_s = 0.1;
        return k == 0 ? 1.5 + i : k == 1 ? -2.5 - i : 8.0 * i;
    }
    if (strcmp(panel, "background") == 0) {
        return k == 0 ? 50.5 + i : 7.5 - 0.1 * i;
    }
    *after_s = k == 0 ? 0.0 : 0.1; /* latency */
    return k == 0 ? 5.0 * i / RATE : (45.0 + 3 * i) / RATE;
}

static void plots_are_the_columns_of_the_tables(void **state) {
    fixture *f = *state;
    bst_ctx ctx = {0};
    static const char *const names[] = {"pointing_error", "snr",        "mount",  "detections",
                                        "attitude_error", "background", "latency"};
    static const int lines[] = {2, 2, 2, 2, 3, 2, 2};
    for (int p = 0; p < 7; p++) {
        bst_view_bytes out;
        const bst_view_plot plot = {1, names[p], -1.0, 100.0, 50};
        bst_assert_ok(&ctx, bst_view_run_plot(&ctx, f->run, &plot, &out));
        const double *at = out.data;
        for (int k = 0; k < lines[p]; k++) {
            assert_true(*at++ == FRAMES);
            for (int i = 0; i < FRAMES; i++, at += 3) {
                double after_s, value = plotted(names[p], k, i, &after_s);
                bst_assert_close(at[0], mid_of(i) + after_s, 1e-9);
                bst_assert_close(at[1], value, 1e-9);
                bst_assert_close(at[2], value, 1e-9);
            }
        }
        assert_int_equal((const char *)at - (const char *)out.data, out.bytes);
        free(out.data);
    }
    bst_view_bytes none;
    const bst_view_plot wrong[] = {
        {1, "size", 0.0, 1.0, 5}, {1, "snr", 1.0, 1.0, 5}, {1, "snr", 0.0, 1.0, 0}};
    for (int i = 0; i < 3; i++) {
        assert_int_not_equal(bst_view_run_plot(&ctx, f->run, &wrong[i], &none), BST_OK);
    }
}

static void modes_names_and_description(void **state) {
    fixture *f = *state;
    bst_ctx ctx = {0};
    cJSON *node;
    bst_assert_ok(&ctx, bst_view_run_modes(&ctx, f->run, 1, &node));
    const cJSON *modes = member(node, "modes");
    assert_int_equal(cJSON_GetArraySize(modes), 2); /* changes alone */
    SAME(modes->child->next, "time_s", mid_of(3) + 0.2);
    assert_string_equal(member(modes->child->next, "mode")->valuestring, "track");
    cJSON_Delete(node);
    bst_assert_ok(&ctx, bst_view_run_names(&ctx, f->run, &node));
    assert_string_equal(member(member(node, "names"), "8")->valuestring, "NEXT");
    cJSON_Delete(node);
    bst_assert_ok(&ctx, bst_view_run_events(&ctx, f->run, &node));
    SAME(node, "total", 1);
    SAME(member(node, "events")->child, "time_s", 4.5);
    cJSON_Delete(node);
    bst_assert_ok(&ctx, bst_view_run_describe(&ctx, f->run, &node));
    const cJSON *sensor = member(node, "sensors")->child->next;
    SAME(sensor, "width_px", 640);
    SAME(sensor, "height_px", 480);
    SAME(sensor, "pixel_scale_arcsec", 4.0);
    SAME(sensor, "frames", FRAMES);
    assert_int_equal(cJSON_GetArraySize(member(sensor, "panels")), 9);
    assert_int_equal(cJSON_GetArraySize(member(sensor, "planes")), 0);
    cJSON_Delete(node);
}

static void tracks_have_the_detections_that_made_them(void **state) {
    fixture *f = *state;
    bst_ctx ctx = {0};
    bst_view_exchange x = {.subject = f->subject, .sensor = 1, .frame = 5, .object = 4};
    bst_assert_ok(&ctx, bst_view_route_track(&ctx, &x));
    const cJSON *states = member(x.json, "states"), *one = states->child;
    assert_int_equal(cJSON_GetArraySize(states), 6);
    SAME(x.json, "first_s", 1.0);
    assert_true(cJSON_IsFalse(member(x.json, "earlier")));
    for (int i = 0; i < 6; i++, one = one->next) {
        const cJSON *detection = member(one, "detection");
        SAME(one, "frame", i);
        SAME(one, "time_s", mid_of(i) + 0.1);
        SAME(one, "hits", 2 + i);
        SAME(detection, "x", 100.0 + 8 * i + 6.9);
        SAME(detection, "y", 150.0 + 5 * i + 2.8);
        SAME(detection, "snr", 15.0);
        assert_string_equal(member(detection, "label")->valuestring, "unknown");
        assert_true(cJSON_IsTrue(member(detection, "blend")));
    }
    cJSON_Delete(x.json);
    x.object = 9; /* its places are those of no detection; in the last frame it was not updated */
    x.frame = 4;
    bst_assert_ok(&ctx, bst_view_route_track(&ctx, &x));
    assert_int_equal(cJSON_GetArraySize(member(x.json, "states")), 5);
    SAME(cJSON_GetArrayItem(member(x.json, "states"), 4), "misses", 2);
    assert_null(cJSON_GetObjectItem(member(x.json, "states")->child, "detection"));
    cJSON_Delete(x.json);
    x.object = 44;
    bst_assert_ok(&ctx, bst_view_route_track(&ctx, &x));
    assert_int_equal(cJSON_GetArraySize(member(x.json, "states")), 0);
    cJSON_Delete(x.json);
    x.json = NULL;
    x.frame = FRAMES;
    assert_int_equal(bst_view_route_track(&ctx, &x), BST_ERR_NOT_FOUND);
    cJSON_Delete(x.json);
    x.json = NULL;
    x.frame = 0;
    assert_int_equal(bst_view_route_noise_free(&ctx, &x), BST_ERR_NOT_FOUND); /* no pixels */
}

static void reasons_have_the_facts_of_the_tables(void **state) {
    fixture *f = *state;
    bst_ctx ctx = {0};
    bst_view_exchange x = {.subject = f->subject, .run = 0, .sensor = 1, .frame = SHOWN};
    looks = 0;
    bst_assert_ok(&ctx, bst_view_route_why(&ctx, &x));
    assert_int_equal(looks, FRAMES);
    assert_string_equal(member(x.json, "target")->valuestring, "PREY");
    const cJSON *spans = member(x.json, "spans");
    assert_int_equal(cJSON_GetArraySize(spans), 3); /* the third exposure was dropped */
    SAME(spans->child, "first", 0);
    SAME(spans->child, "last", 1);
    SAME(spans->child->next->next, "first", 3);
    SAME(spans->child->next->next, "last", FRAMES - 1);
    cJSON_Delete(x.json);

    assert_true(facts.processed && facts.recorded && facts.listed && facts.in_field);
    assert_true(facts.occulted && facts.saturated && !facts.dropped);
    bst_assert_close(facts.threshold_snr, 5.25, 0.0);
    assert_int_equal(facts.lost, SHOWN);
    bst_assert_close(facts.snr, 12.0 + SHOWN, 0.0);
    bst_assert_close(facts.sunlit_fraction, 0.75, 0.0);
    /* from the path of (12, 5) px: beside it, and beyond its end */
    bst_assert_close(facts.star_px, (12.0 * 15.0 + 5.0 * 3.0) / 13.0, 1e-9);
    bst_assert_close(facts.star_v_mag, 7.25, 0.0);
    bst_assert_close(facts.object_px, hypot(40.0 - 6.0, 3.0 - 2.5), 1e-9);
    assert_string_equal(facts_object, "NEXT");
    bst_assert_close(facts.detection_px, hypot(0.9, 0.3), 1e-9);
    bst_assert_close(facts.detection_snr, 15.0, 0.0);
    assert_true(facts.is_blend && !facts.is_star);
    assert_int_equal(facts.track, 4);
    assert_string_equal(facts_status, "confirmed");
    assert_true(facts.no_attitude);
    /* the other track was not updated: its direction from the target's, by both variances */
    double away = 0.001 * cos(34.25 * BST_DEG_RAD) * 3600.0 / 4.0, scale = 4.0 * BST_PI / 648000.0;
    bst_assert_close(facts.near_px, away, 1e-9);
    assert_int_equal(facts.near_track, 9);
    assert_true(facts.near_coasts);
    bst_assert_close(facts.near_sigma, away / sqrt(4e-10 / (scale * scale) + 0.5 * (0.18 + 0.36)),
                     1e-9);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_are_listed),
        cmocka_unit_test(marks_are_in_pixels_of_their_frame),
        cmocka_unit_test(plots_are_the_columns_of_the_tables),
        cmocka_unit_test(modes_names_and_description),
        cmocka_unit_test(tracks_have_the_detections_that_made_them),
        cmocka_unit_test(reasons_have_the_facts_of_the_tables),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
