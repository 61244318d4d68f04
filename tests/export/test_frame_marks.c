/* Marks of a recorded frame: places in the pixels of a binned window, labels, order and caption. */
#include "sim/export/frame_marks.h"
#include "sim/io/frame_picture.h"
#include "sim/run/run_sensors.h"
#include "tests/report/run_tables.h"

static void make_run(run_tables *t) {
    run_tables_begin(t, "run.sqlite");
    run_tables_file(t, "scenario.json",
                    "{\"world\": {\"objects\": [{\"name\": \"PREY\"}, {\"name\": \"OTHER\"}]}}");
    run_tables_sql(
        t,
        "CREATE TABLE run (epoch_utc TEXT); INSERT INTO run VALUES ('2022-06-16T22:10:00Z');"
        "CREATE TABLE sensors (sensor INT, observer TEXT, name TEXT, target TEXT, file TEXT);"
        "INSERT INTO sensors VALUES (0, 'eye', 'camera', 'PREY', 'frames.fits'),"
        " (1, 'ear', 'camera', '', '../frames.fits'), (2, 'ear', 'wide', '', '');"
        "CREATE TABLE frames (sensor INT, exposure_id INT, x0_px INT, y0_px INT, binning INT,"
        " start_s REAL, exposure_s REAL, start_tick INT, end_tick INT, fits_index INT);"
        "INSERT INTO frames VALUES (0, 4, 0, 0, 1, 1.0, 0.5, 100, 150, 1),"
        " (0, 6, 40, 30, 2, 2.0, 0.5, 200, 250, NULL), (1, 6, 9, 9, 9, 9, 9, 9, 9, 9),"
        " (0, 8, 10, 20, 4, 3.0, 1.0, 300, 400, 2);"
        "CREATE TABLE exposures (sensor INT, exposure_id INT, boresight_x_px REAL, boresight_y_px "
        "REAL, pixel_scale_arcsec REAL);"
        "INSERT INTO exposures VALUES (0, 4, 100.5, 50.25, 3), (0, 6, 100.5, 50.25, 3), (0, 8, "
        "101, 51, 3);"
        "CREATE TABLE truth (sensor INT, exposure_id INT, kind TEXT, id INT, norad INT, in_field "
        "INT,"
        " x_centroid_px REAL, y_centroid_px REAL);"
        "INSERT INTO truth VALUES (0, 6, 'object', 1, 5, 1, 60, 44), (0, 6, 'object', 0, 6, 1, "
        "71.5, 36.5),"
        " (0, 6, 'object', 7, 44801, 1, 50, 40), (0, 6, 'star', 0, 0, 1, 1, 1),"
        " (0, 6, 'object', 0, 6, 0, 2, 2), (1, 6, 'object', 0, 6, 1, 3, 3);"
        "CREATE TABLE detections (sensor INT, exposure_id INT, label TEXT, x_px REAL, y_px REAL,"
        " length_px REAL, star_id INT, flux_e REAL, angle_deg REAL);"
        "INSERT INTO detections VALUES (0, 6, 'star', 80, 50, 0, 9, 700, 0), (0, 6, 'star', 82, "
        "52, "
        "0, 0, 800, 0),"
        " (0, 6, 'object', 72.5, 40.5, 24, 0, 5, 60), (0, 6, 'object', 90, 60, 0, 0, NULL, 0),"
        " (0, 6, 'object', 72.5, 41.5, 0, 0, 900, 0), (1, 6, 'object', 1, 1, 0, 0, 1e9, 0);"
        "CREATE TABLE tracks (sensor INT, exposure_id INT, track_id INT, status TEXT,"
        " target_of_interest INT, x_px REAL, y_px REAL, snr REAL, misses_in_row INT);"
        "INSERT INTO tracks VALUES (0, 6, 11, 'confirmed', 1, 72, 37, 12.34, 0),"
        " (0, 6, 12, 'tentative', 0, 61, 45, 5.55, 0), (0, 6, 13, 'coasting', 0, 1, 1, 1, 1);"
        "CREATE TABLE control (sensor INT, tick INT, mode TEXT);"
        "INSERT INTO control VALUES (0, 0, 'idle'), (0, 220, 'slew'), (1, 222, 'scan'), (0, 226, "
        "'track')");
}

typedef struct expected_mark {
    bst_io_overlay_kind kind;
    double x_px, y_px, radius_px; /* on the sensor */
    const char *label;
} expected_mark;

/* Centre of a binned pixel: (b - 1) / 2 after that of its first one. */
static double place(double px, double first, double binning) {
    return (px - first - 0.5 * (binning - 1)) / binning;
}

static void a_binned_window(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    run_tables t;
    bst_frame_marks *m;
    bst_io_overlay o;
    make_run(&t);
    bst_run_reader *run = run_tables_open(&t);
    bst_assert_ok(&ctx, bst_frame_marks_create(&ctx, run, 0, "PREY", &m));
    bst_assert_ok(&ctx, bst_frame_marks_get(&ctx, m, 4, &o));
    assert_int_equal(o.count, 1);
    bst_assert_close(o.marks[0].x_px, 100.5, 0);
    bst_assert_close(o.marks[0].y_px, 50.25, 0);
    assert_string_equal(o.caption, "frame 4   2022-06-16T22:10:01.250Z   0.500 s   mode: idle");
    bst_assert_ok(&ctx, bst_frame_marks_get(&ctx, m, 6, &o));
    assert_string_equal(o.caption, "frame 6   2022-06-16T22:10:02.250Z   0.500 s   mode: slew");
    /* first the boresight, the target and its track, then its detection within 5 px (2.5 here),
     * other objects and tracks, and detections by their light */
    static const expected_mark first[] = {
        {BST_OVERLAY_BORESIGHT, 100.5, 50.25, 0, ""},
        {BST_OVERLAY_TARGET, 71.5, 36.5, 0, "PREY"},
        {BST_OVERLAY_TRACK, 72, 37, 0, "target: track 11 SNR 12.3"}};
    static const expected_mark second[] = {
        {BST_OVERLAY_OBJECT, 60, 44, 0, "OTHER"},
        {BST_OVERLAY_OBJECT, 50, 40, 0, "NORAD 44801"},
        {BST_OVERLAY_TRACK, 61, 45, 0, "track 12 SNR 5.5"},
    };
    static const expected_mark last[] = {{BST_OVERLAY_DETECTION, 72.5, 40.5, 24, ""},
                                         {BST_OVERLAY_DETECTION, 72.5, 41.5, 0, ""},
                                         {BST_OVERLAY_REST, 82, 52, 0, ""},
                                         {BST_OVERLAY_STAR, 80, 50, 0, ""},
                                         {BST_OVERLAY_DETECTION, 90, 60, 0, ""}};
    assert_int_equal(o.count, 11);
    /* equal importance: in any order */
    int at = 0;
    for (int i = 0; i < 11; i++) {
        const bst_io_overlay_mark *k = &o.marks[i];
        const expected_mark *list = i < 3 ? first : i == 3 ? last : i < 7 ? second : last + 1;
        int count = i < 3 || (i > 3 && i < 7) ? 3 : 1;
        list += i >= 7 ? i - 7 : 0;
        bool found = false;
        for (int n = 0; n < count; n++) {
            const expected_mark *e = &list[n];
            found = found || (k->kind == e->kind && strcmp(k->label, e->label) == 0 &&
                              fabs(k->x_px - place(e->x_px, 40, 2)) < 1e-12 &&
                              fabs(k->y_px - place(e->y_px, 30, 2)) < 1e-12);
        }
        if (!found) {
            fail_msg("mark %d: kind %d at %g, %g: %s", i, (int)k->kind, k->x_px, k->y_px, k->label);
        }
        at += k->kind == BST_OVERLAY_DETECTION;
    }
    assert_int_equal(at, 3);
    bst_assert_close(o.marks[3].radius_px, 0.5 * 24 / 2 + 2, 1e-12);
    /* half of the streak, in binned pixels, 60 degrees from x towards y; 16 px of the sensor make
     * one */
    bst_assert_close(o.marks[3].half_x_px, 0.5 * 24 / 2 * 0.5, 1e-12);
    bst_assert_close(o.marks[3].half_y_px, 0.5 * 24 / 2 * sqrt(0.75), 1e-12);
    bst_assert_close(o.marks[10].radius_px, 2, 1e-12);
    bst_assert_ok(&ctx, bst_frame_marks_get(&ctx, m, 8, &o));
    assert_string_equal(o.caption, "frame 8   2022-06-16T22:10:03.500Z   1.000 s   mode: track");
    bst_assert_close(o.marks[0].x_px, place(101, 10, 4), 1e-12);
    bst_assert_close(o.marks[0].y_px, place(51, 20, 4), 1e-12);
    bst_assert_ok(&ctx, bst_frame_marks_get(&ctx, m, 9, &o)); /* of no table */
    assert_string_equal(o.caption, "frame 9");
    assert_int_equal(o.count, 0);
    bst_frame_marks_free(m);
    bst_assert_ok(&ctx, bst_frame_marks_create(&ctx, run, 0, "", &m));
    int64_t id;
    bst_assert_ok(&ctx, bst_frame_marks_exposure(&ctx, m, 0, &id));
    assert_int_equal(id, -1);
    bst_assert_ok(&ctx, bst_frame_marks_exposure(&ctx, m, 1, &id));
    assert_int_equal(id, 4);
    bst_assert_ok(&ctx, bst_frame_marks_exposure(&ctx, m, 2, &id));
    assert_int_equal(id, 8);
    bst_assert_ok(&ctx, bst_frame_marks_exposure(&ctx, m, 3, &id));
    assert_int_equal(id, -1);
    bst_frame_marks_free(m);
    run_tables_end(&t);
}

static void names_of_sensors(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    run_tables t;
    bst_run_sensor list[BST_EXPORT_SENSORS];
    int count;
    make_run(&t);
    bst_run_reader *run = run_tables_open(&t);
    static const struct {
        const char *name;
        int count;
        int64_t first;
    } cases[] = {{NULL, 3, 0},       {"camera", 2, 0},  {"ear/camera", 1, 1},
                 {"ear/wide", 1, 2}, {"wide", 1, 2},    {"eye/wide", 0, 0},
                 {"ear", 0, 0},      {"ear/cam", 0, 0}, {"earXcamera", 0, 0}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_status status = bst_run_sensors(&ctx, run, cases[i].name, list, &count);
        assert_int_equal(count, cases[i].count);
        assert_int_equal(status, cases[i].count ? BST_OK : BST_ERR_NOT_FOUND);
        if (count > 0) {
            assert_int_equal(list[0].index, cases[i].first);
        } else {
            assert_non_null(strstr(ctx.message, "it has eye/camera, ear/camera, ear/wide"));
        }
    }
    bst_assert_ok(&ctx, bst_run_sensors(&ctx, run, NULL, list, &count));
    assert_string_equal(list[0].file, "frames.fits");
    assert_string_equal(list[0].target, "PREY");
    assert_string_equal(list[1].file, ""); /* outside the folder */
    assert_string_equal(list[2].observer, "ear");
    run_tables_end(&t);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_binned_window),
        cmocka_unit_test(names_of_sensors),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
