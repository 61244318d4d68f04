/* The page of a run: numbers, warnings, cards, events and sightings of tables that are written
 * here. */
#include <cjson/cJSON.h>

#include "boresight/messages.h"
#include "sim/report/report.h"
#include "tests/report/run_tables.h"
#include "tests/report/svg_chart.h"

static void numbers(void **state) {
    (void)state;
    static const struct {
        double value;
        int digits;
        const char *text;
    } cases[] = {{12.345, 3, "12.3"},
                 {-12.345, 3, "-12.3"},
                 {0.0012345, 3, "0.00123"},
                 {123.45, 3, "123"},
                 {1234.5, 3, "1234"},
                 {999999, 4, "999999"},
                 {1.5e6, 3, "1.5e+06"},
                 {0.00098765, 3, "0.000988"},
                 {0.0, 3, "0"},
                 {1e-3, 2, "0.0010"},
                 {NAN, 3, "-"},
                 {INFINITY, 3, "-"},
                 {5.25e-7, 2, "5.2e-07"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[32];
        assert_string_equal(bst_report_page_number(text, cases[i].value, cases[i].digits),
                            cases[i].text);
    }
}

/* The warnings of a sensor without any tables. */
static void warn(bst_run_reader *run, bst_report_sensor *s, bst_report_warnings *w) {
    memset(w, 0, sizeof *w);
    bst_report_run_warnings(run, s, 1, NULL, w);
}

static bool has(const bst_report_warnings *w, bst_run_severity severity, const char *text) {
    for (int i = 0; i < w->count; i++) {
        if (w->items[i].severity == severity && strstr(w->items[i].text, text)) {
            return true;
        }
    }
    return false;
}

static bst_report_warnings warnings;

static void verdicts_on_a_loop(void **state) {
    (void)state;
    run_tables t;
    run_tables_begin(&t, "run.sqlite");
    run_tables_file(&t, "manifest.json", "{\"program\": \"boresight\", \"complete\": true}");
    run_tables_file(&t, "scenario.json", "{}");
    bst_run_reader *run = run_tables_open(&t);
    assert_int_equal(bst_run_reader_state(run), BST_RUN_COMPLETE);
    const bst_report_sensor good = {.name = "eye/camera",
                                    .sensor = {.target = "PREY"},
                                    .has_tracks = true,
                                    .every = 1,
                                    .loop = {.time_to_acquire_s = 1,
                                             .time_to_settle_s = 2,
                                             .track_fraction = 0.95,
                                             .final_mode = BST_MODE_TRACK}};
    bst_report_sensor s = good;
    warn(run, &s, &warnings);
    assert_int_equal(warnings.count, 0);
    s.loop.track_fraction = 0.9499;
    warn(run, &s, &warnings);
    assert_int_equal(warnings.count, 1);
    assert_true(has(&warnings, BST_SEVERITY_WARNING, "in only 95.0 % of the frames"));
    s.loop.track_fraction = 0.5;
    warn(run, &s, &warnings);
    assert_true(has(&warnings, BST_SEVERITY_WARNING, "in only 50.0 %"));
    s.loop.track_fraction = 0.4321;
    warn(run, &s, &warnings);
    assert_true(has(&warnings, BST_SEVERITY_PROBLEM, "in only 43.2 %"));
    s.loop.time_to_acquire_s = NAN; /* without an acquisition, no share and no mode */
    s.loop.final_mode = BST_MODE_SEARCH;
    warn(run, &s, &warnings);
    assert_int_equal(warnings.count, 1);
    assert_true(has(&warnings, BST_SEVERITY_PROBLEM, "never acquired"));
    s = good;
    s.loop.time_to_settle_s = NAN;
    warn(run, &s, &warnings);
    assert_int_equal(warnings.count, 1);
    assert_true(has(&warnings, BST_SEVERITY_PROBLEM, "never settled"));
    s = good;
    s.loop.wrong_target_frames = 1;
    s.bad_pixels = 1;
    s.loop.final_mode = BST_MODE_COAST;
    warn(run, &s, &warnings);
    assert_int_equal(warnings.count, 3);
    assert_true(has(&warnings, BST_SEVERITY_WARNING, "in 1 frame the track of interest"));
    assert_true(has(&warnings, BST_SEVERITY_NOTE, "1 pixel is bad, and left it out"));
    assert_true(has(&warnings, BST_SEVERITY_WARNING, "at the end the mode was coast"));
    s.task_count = 2; /* there is always a next target */
    s.loop.wrong_target_frames = 2;
    s.bad_pixels = 3;
    warn(run, &s, &warnings);
    assert_int_equal(warnings.count, 2);
    assert_true(has(&warnings, BST_SEVERITY_WARNING, "in 2 frames the track of interest"));
    assert_true(has(&warnings, BST_SEVERITY_NOTE, "3 pixels are bad, and left them out"));
    s.task_count = 1;
    s.loop.final_mode = -1; /* not recorded */
    warn(run, &s, &warnings);
    assert_int_equal(warnings.count, 2);
    s = good;
    s.every = 3;
    s.exposures = 2500000;
    s.loop.track_fraction = 0.1;
    s.has_tracks = false; /* no loop to judge */
    warn(run, &s, &warnings);
    assert_int_equal(warnings.count, 1);
    assert_true(has(&warnings, BST_SEVERITY_NOTE, "of 2500000 exposures one in 3 is drawn"));
    run_tables_end(&t);
}

static void warnings_from_tables(void **state) {
    (void)state;
    run_tables t;
    run_tables_begin(&t, "run.sqlite");
    run_tables_file(&t, "manifest.json",
                    "{\"program\": \"boresight\", \"complete\": false, \"error\": \"no more room\","
                    " \"warnings\": 2, \"counters\": {\"saturated\": 4, \"link_messages\": 9},"
                    " \"wcs_misfit_px\": {\"eye/camera\": 0.0021, \"eye/other\": 0.0009}}");
    run_tables_file(&t, "scenario.json", "{}");
    run_tables_sql(
        &t,
        "CREATE TABLE mount (sensor INT, axis0_flags INT, axis1_flags INT, axis2_flags INT,"
        " wheels_saturated INT);"
        "INSERT INTO mount VALUES (0, 1, 0, 0, 0), (0, 0, 3, 0, 1), (0, 0, 0, 5, 1), (0, 2, 4, 6, "
        "0),"
        " (1, 1, 0, 0, 1);"
        "CREATE TABLE exposures (sensor INT, error_sigma REAL, hits INT, lost INT);"
        "INSERT INTO exposures VALUES (0, 0.3, 0, 0), (0, 0.31, 1, 0), (0, 0.5, 2, 0), (0, 1, 0, "
        "0),"
        " (0, 0, 0, 0);"
        "CREATE TABLE pointing (sensor INT, limited INT);"
        "INSERT INTO pointing VALUES (0, 1), (0, 0), (1, 1), (1, 1);"
        "CREATE TABLE events (tick INT, time_s REAL, source TEXT, kind TEXT, text TEXT);"
        "INSERT INTO events VALUES (5, 0.5, 'b', 'target_lost', ''), (3, 0.3, 'a', 'target_lost', "
        "''),"
        " (9, 0.9, 'a', 'mode', ''), (2, 0.25, 'a', 'of_a_plugin', ''), (7, 0.7, 'c', 'guidance', "
        "'')");
    bst_run_reader *run = run_tables_open(&t);
    bst_report_sensor s[2] = {{.name = "eye/camera", .sensor = {.index = 0}, .every = 1},
                              {.name = "eye/other", .sensor = {.index = 1}, .every = 1}};
    memset(&warnings, 0, sizeof warnings);
    bst_report_run_warnings(run, s, 2, NULL, &warnings);
    const struct {
        bst_run_severity severity;
        const char *text;
    } expected[] = {
        {BST_SEVERITY_PROBLEM, "The run was interrupted"},
        {BST_SEVERITY_PROBLEM, "The run failed: no more room"},
        {BST_SEVERITY_WARNING, "2 warnings on its standard error"},
        {BST_SEVERITY_PROBLEM, "with a stuck axis: eye/camera 3, eye/other 1."},
        {BST_SEVERITY_WARNING, "a pixel's noise: eye/camera 3."},
        {BST_SEVERITY_WARNING, "with an axis at a limit: eye/camera 1, eye/other 2."},
        {BST_SEVERITY_WARNING, "saturated reaction wheels: eye/camera 2, eye/other 1."},
        {BST_SEVERITY_NOTE, "radiation hits: eye/camera 2."},
        {BST_SEVERITY_NOTE, "full pixels in the image: 4 frames (saturated)."},
        {BST_SEVERITY_WARNING,
         "eye/camera: the WCS of its frames misses the distortion by up to 0.0021"},
        {BST_SEVERITY_NOTE, "a: of_a_plugin: 1 time, first at 0.25 s."},
        {BST_SEVERITY_WARNING,
         "2 modules: the track of the target was given up: 2 times, first at 0.3 s"},
        {BST_SEVERITY_NOTE, "c: guidance announced what is out of reach: 1 time, first at 0.7 s."},
    };
    enum { EXPECTED = sizeof expected / sizeof *expected };
    for (int i = 0; i < EXPECTED; i++) {
        if (!has(&warnings, expected[i].severity, expected[i].text)) {
            fail_msg("no warning \"%s\"", expected[i].text);
        }
    }
    assert_int_equal(warnings.count, EXPECTED);
    run_tables_end(&t);
}

static void list_of_warnings(void **state) {
    (void)state;
    char *text;
    size_t bytes;
    memset(&warnings, 0, sizeof warnings);
    for (int i = 0; i < BST_REPORT_WARNINGS + 3; i++) {
        bst_report_warnings_add(&warnings, (bst_run_severity)(2 - i % 3), "number %d at 1e-05", i);
    }
    assert_int_equal(warnings.count, BST_REPORT_WARNINGS);
    assert_int_equal(warnings.more, 3);
    FILE *out = open_memstream(&text, &bytes);
    bst_report_warnings_write(out, &warnings);
    fclose(out);
    /* problems, then warnings, then notes */
    const char *problem = strstr(text, "<li class=\"bad\"><b>Problem:</b>number 2 at"),
               *warning = strstr(text, "<li class=\"fair\"><b>Warning:</b>number 1 at"),
               *note = strstr(text, "<li class=\"note\"><b>Note:</b>number 0 at");
    assert_true(problem && warning && note && problem < warning && warning < note);
    assert_non_null(strstr(text, "<span class=\"w\">1e-05</span>"));
    assert_non_null(strstr(text, "<p>3 more are not listed.</p>"));
    free(text);
}

/* A run of 20 s at 50 Hz with two sensors, objects and their passes. */
static void make_run(run_tables *t, const char *manifest) {
    run_tables_begin(t, "run.sqlite");
    run_tables_file(t, "manifest.json", manifest);
    run_tables_file(t, "scenario.json",
                    "{\"name\": \"chase\", \"duration_s\": 20, \"tick_rate_hz\": 50, \"epoch_utc\":"
                    " \"2022-06-16T22:10:00Z\", \"world\": {\"objects\": [{\"name\": \"PREY\"},"
                    " {\"name\": \"B\"}]}}");
    run_tables_sql(
        t,
        "CREATE TABLE run (tick_rate_hz INT, epoch_utc TEXT);"
        "INSERT INTO run VALUES (50, '2022-06-16T22:10:00Z');"
        "CREATE TABLE sensors (sensor INT, observer TEXT, name TEXT, target TEXT, file TEXT,"
        " width_px INT, height_px INT, pixel_scale_arcsec REAL);"
        "INSERT INTO sensors VALUES (0, 'eye', 'camera', 'PREY', '', 640, 480, 2.5),"
        " (1, 'ear', 'wide', '', '', 32, 16, 20.0);"
        "CREATE TABLE detection_frames (sensor INT, exposure_id INT, mid_s REAL, detections INT,"
        " stars_identified INT, lost INT);"
        "INSERT INTO detection_frames VALUES (0, 1, 0.5, 12, 4, 0), (0, 2, 1.5, 5, 4, 0),"
        " (1, 1, 0.5, 100, 4, 0);"
        "CREATE TABLE track_frames (sensor INT, exposure_id INT, attitude_valid INT,"
        " written_tick INT, lost INT);"
        "INSERT INTO track_frames VALUES (0, 1, 1, 30, 0);"
        "CREATE TABLE tracks (sensor INT, exposure_id INT, tick INT, time_s REAL, status TEXT,"
        " ra_deg REAL, dec_deg REAL, rate_east_arcsec_per_s REAL, rate_north_arcsec_per_s REAL,"
        " cov_d1_d1_rad2 REAL, cov_d1_d2_rad2 REAL, cov_d2_d2_rad2 REAL, snr REAL,"
        " last_update_tick INT, target_of_interest INT);"
        "CREATE TABLE frames (sensor INT, end_tick INT);"
        "INSERT INTO frames VALUES (0, 400), (1, 449);"
        "CREATE TABLE events (tick INT, time_s REAL, source TEXT, kind TEXT, text TEXT);");
}

static char *page_of(run_tables *t) {
    bst_ctx ctx = {0};
    char *text;
    size_t bytes;
    bst_run_reader *run = run_tables_open(t);
    FILE *out = open_memstream(&text, &bytes);
    bst_assert_ok(&ctx, bst_report_run(&ctx, run, out));
    fclose(out);
    return text;
}

/* Value and note of a card of a part of the page. */
static void expect_card(const char *from, const char *name, const char *value, const char *note) {
    char card[600];
    snprintf(card, sizeof card, "<div class=\"card\"><small>%s</small><b>%s", name, value);
    const char *at = strstr(from, card);
    if (!at) {
        fail_msg("no card \"%s\" with %s: %.500s", name, value,
                 strstr(from, name) ? strstr(from, name) : "");
    }
    const char *end = strstr(at, "</div>"), *said = strstr(at, note);
    if (note[0] && !(said && said < end)) {
        fail_msg("the card \"%s\" does not say \"%s\": %.300s", name, note, at);
    }
}

static const char manifest[] =
    "{\"program\": \"boresight\", \"version\": \"9.8.7\", \"complete\": true, \"wall_time_s\": "
    "4.25,"
    " \"seed\": \"0x2A\", \"run\": 3, \"device\": \"CPU\", \"stars\": 1234, \"star_catalogue\":"
    " \"embedded\", \"summary\": {\"pointing_frames\": 1, \"frames\": 77, \"custody\": 0.8125,"
    " \"track_fraction\": 0.9375, \"time_to_acquire_s\": 3.25, \"time_to_confirm_s\": 2.125,"
    " \"time_to_settle_s\": 5.75, \"pointing_rms_px\": 0.2345, \"pointing_p99_px\": 0.678,"
    " \"scored_frames\": 60, \"gospa_px\": 1.237, \"ospa2_px\": 0.456, \"track_purity\": 0.9765,"
    " \"id_switches\": 3, \"ghosts\": 1,"
    " \"pointing_bias_px\": 0.0912, \"final_mode\": \"track\", \"real_time_factor\": 12.34}}";

static void cards_of_a_sensor(void **state) {
    (void)state;
    run_tables t;
    make_run(&t, manifest);
    char *page = page_of(&t);
    assert_non_null(strstr(page, "Run of chase"));
    const char *sensor = strstr(page, "Sensor eye/camera"),
               *other = strstr(page, "Sensor ear/wide");
    assert_true(sensor && other && sensor < other);
    expect_card(sensor, "custody", "81.25", "93.75 % from acquisition on");
    expect_card(sensor, "time to acquire", "3.250",
                "confirmed after 2.125 s, settled after 5.750 s");
    expect_card(sensor, "pointing RMS", "0.234", "99 % below 0.678 px, bias 0.091 px");
    expect_card(sensor, "GOSPA", "1.24", "all tracks against all objects; OSPA(2) 0.456 px");
    expect_card(sensor, "track purity", "97.65", "3 changes of identity, 1 ghost");
    expect_card(sensor, "mode at the end", "track", "");
    expect_card(sensor, "exposures", "77", "");
    expect_card(sensor, "detections", "17", "8.50 a frame");
    expect_card(sensor, "speed", "12.3", "");
    expect_card(other, "detections", "100", "100 a frame");
    const char *const rows[] = {
        "from (UTC)</th><td>2022-06-16T22:10:00.000Z",
        "to (UTC)</th><td>2022-06-16T22:10:20.000Z",
        "duration</th><td>20 s",
        "seed</th><td>0x2A, run 3",
        "program</th><td>Boresight 9.8.7",
        "star catalogue</th><td>embedded, 1234 stars",
        "objects</th><td>2: PREY, B<",
        "sensors</th><td>eye/camera: 640 × 480 px of 2.5 arcsec, target PREY",
        "ear/wide: 32 × 16 px of 20 arcsec<",
        "wall time</th><td>4.25 s",
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        if (!strstr(page, rows[i])) {
            fail_msg("the page does not have \"%s\"", rows[i]);
        }
    }
    free(page);
    run_tables_end(&t);
}

/* Of a run that was killed: up to its last frame. */
static void the_end_of_a_killed_run(void **state) {
    (void)state;
    run_tables t;
    make_run(&t, manifest);
    scratch_path(&t.place, "manifest.json");
    unlink(t.place.path);
    char *page = page_of(&t);
    assert_non_null(strstr(page, "to (UTC)</th><td>2022-06-16T22:10:09.000Z"));
    assert_non_null(strstr(page, "duration</th><td>9 s of 20 s"));
    assert_non_null(strstr(page, "<span class=\"badge bad\">"));
    assert_non_null(strstr(page, "The run was killed"));
    free(page);
    run_tables_end(&t);
}

static void events(void **state) {
    (void)state;
    run_tables t;
    make_run(&t, manifest);
    for (int i = 0; i < 450; i++) {
        run_tables_sql(&t, "INSERT INTO events VALUES (%d, %d.5, 'a<b', 'k', 'number %d')", i, i,
                       i);
    }
    char *page = page_of(&t);
    const char *list = strstr(page, ">Events<");
    assert_non_null(list);
    assert_non_null(strstr(list, "<summary>450 events</summary>"));
    assert_non_null(
        strstr(list, "<td class=\"n\">7.500</td><td>2022-06-16T22:10:07</td><td>a&lt;b"));
    assert_non_null(strstr(list, ">number 199<"));
    assert_null(strstr(list, ">number 200<"));
    assert_non_null(strstr(list, "50 events more"));
    assert_null(strstr(list, ">number 249<"));
    assert_non_null(strstr(list, ">number 250<"));
    assert_non_null(strstr(list, ">number 449<"));
    free(page);
    run_tables_end(&t);
}

/* The largest speed of a wheel is given as a share of its limit, where one was recorded. */
static void wheels(void **state) {
    (void)state;
    static const char *const limits[] = {"6000", "NULL"};
    static const char *const expected[] = {
        "Limit: 6000 rpm in both directions. Largest: 1500 rpm,"
        " 25 % of it, wheel 1.",
        "No limit was recorded."};
    for (int k = 0; k < 2; k++) {
        run_tables t;
        make_run(&t, manifest);
        run_tables_sql(&t,
                       "CREATE TABLE wheels (sensor INT, time_s REAL, wheel INT, speed_rpm REAL,"
                       " speed_limit_rpm REAL);"
                       "INSERT INTO wheels VALUES (0, 1, 0, 10, %s), (0, 1, 1, -1500, %s),"
                       " (0, 2, 0, 20, %s), (0, 2, 1, -1400, %s)",
                       limits[k], limits[k], limits[k], limits[k]);
        char *page = page_of(&t);
        assert_non_null(strstr(page, expected[k]));
        assert_null(strstr(page, "nan rpm"));
        free(page);
        run_tables_end(&t);
    }
}

/* Cards by the manifest, a dot for each updated object, and the largest NEES first. */
static void custody(void **state) {
    (void)state;
    run_tables t;
    char own[1200];
    snprintf(own, sizeof own,
             "%.*s, \"custody\": {\"objects\": 40, \"updated\": 3, \"in_custody\": 12,"
             " \"tracks\": 9, \"correlated\": 6, \"ambiguous\": 2, \"uncorrelated\": 1,"
             " \"cross_tags\": 5, \"age_mean_s\": 321.5, \"sigma_median_m\": 951,"
             " \"sigma_p90_m\": 1500, \"sigma_updated_median_m\": 432, \"nees_mean\": 6.25,"
             " \"nees_low\": 5.5, \"nees_high\": 6.5, \"candidates\": 4, \"new_objects\": 3,"
             " \"new_wrong\": 1}}",
             (int)strlen(manifest) - 1, manifest);
    make_run(&t, own);
    run_tables_sql(&t,
                   "CREATE TABLE custody (object INT, name TEXT, norad INT, updates INT,"
                   " cross_tags INT, last_s REAL, age_s REAL, sigma_m REAL, error_m REAL,"
                   " nees REAL, chi2_mean REAL);"
                   "CREATE TABLE custody_tracks (time_s REAL, object INT);"
                   "INSERT INTO custody_tracks VALUES (3.0, 1), (9.0, NULL), (6.0, 2), (12.0, 1);"
                   "INSERT INTO custody VALUES (1, 'a<b', 7, 2, 1, 12, 7200, 10, 1, 5.5, 4.25),"
                   " (2, 'large', 8, 1, 0, 6, 14400, 1000, 100, 9.5, 3.5),"
                   " (3, 'not updated', 9, 0, 0, NULL, NULL, 2000, 3000, 99, NULL);");
    char *page = page_of(&t);
    const char *part = strstr(page, ">Custody of the catalogue<");
    assert_non_null(part);
    expect_card(part, "objects in custody", "12", "of 40, by the uncertainty at the end");
    expect_card(part, "objects updated", "3", "last 321.5 s ago, mean");
    expect_card(part, "tracks correlated", "6", "of 9; 2 ambiguous, 1 of no object");
    expect_card(part, "cross-tags", "5", "tracks of another object by the truth");
    expect_card(part, "new objects", "3", "of 4 candidates; 1 wrong by the truth");
    expect_card(part, "uncertainty of updated objects, median", "432",
                "all objects: 951 m, 90 % below 1500 m");
    expect_card(part, "NEES of updated objects", "6.25", "5.50 to 6.50 if consistent (95 %)");
    (void)svg_need(page, "Updates of orbits so far", false, false);
    (void)svg_need(page, "Uncertainty of updated objects against the age", false, true);
    (void)svg_need(page, "Error of the position against its uncertainty", true, true);
    const char *first = strstr(part, "<td>large</td><td class=\"n\">8</td>");
    const char *second = strstr(part,
                                "<td>a&lt;b</td><td class=\"n\">7</td><td class=\"n\">2</td>"
                                "<td class=\"n\">1</td><td class=\"n\">7200</td>");
    assert_true(first && second && first < second);
    assert_null(strstr(part, "not updated"));
    free(page);
    run_tables_end(&t);
}

static void sightings(void **state) {
    (void)state;
    run_tables t;
    char own[1200];
    snprintf(
        own, sizeof own,
        "%.*s, \"sightings\": {\"objects\": 40, \"objects_in_field\": 12,"
        " \"objects_seen\": 11, \"passes\": 31, \"passes_seen\": 29, \"revisit_mean_s\": 123.4,"
        " \"revisit_most_s\": 567.8, \"custody_fraction_all\": 0.125,"
        " \"custody_fraction_seen\": 0.345, \"place_rms_arcsec\": 0.678,"
        " \"track_rms_arcsec\": 0.234, \"tasks\": 9, \"tasks_done\": 6, \"tasks_not_found\": 2,"
        " \"tasks_lost\": 1}}",
        (int)strlen(manifest) - 1, manifest);
    make_run(&t, own);
    run_tables_sql(
        &t,
        "CREATE TABLE passes (sensor INT, object INT, name TEXT, start_s REAL, end_s REAL,"
        " frames INT, detected INT, first_s REAL);"
        "CREATE TABLE sightings (sensor INT, object INT, name TEXT, norad INT,"
        " passes_seen INT, detected INT, tracked INT, custody_fraction REAL, revisits INT,"
        " revisit_mean_s REAL, longest_gap_s REAL, place_rms_arcsec REAL,"
        " track_rms_arcsec REAL);");
    /* object k is seen k times, first by sensor k % 2 at 1 + k s; the last one is not detected */
    for (int k = 1; k <= 12; k++) {
        int seen = k < 12;
        char first[20] = "NULL";
        if (seen) {
            snprintf(first, sizeof first, "%g", 1.0 + k);
        }
        run_tables_sql(
            &t,
            "INSERT INTO passes VALUES (%d, %d, 'OBJ%02d', %g, %g, 9, %d, %s);"
            "INSERT INTO passes VALUES (%d, %d, 'OBJ%02d', 18.0, 19.0, 4, 0, NULL);"
            "INSERT INTO sightings VALUES (NULL, %d, 'OBJ%02d', %d, 1, %d, %d, %g, 1, %g, 3,"
            " %g, 0.5);"
            "INSERT INTO sightings VALUES (0, %d, 'x', 1, 1, 99, 1, 1, 1, 1, 1, 1, 1);",
            k % 2, k, k, 0.5 + k, 2.5 + k, k * seen, first, 0, k, k, k, k, 1000 + k, k * seen, k,
            0.01 * k, 60.0 * k, 0.1 * k, k);
    }
    char *page = page_of(&t);
    const char *part = strstr(page, ">Who saw what<");
    assert_non_null(part);
    expect_card(part, "objects seen", "11", "of 40, 12 of them in a field");
    expect_card(part, "passes seen", "29", "of 31 through a field");
    expect_card(part, "revisit, mean", "123.4", "at most 567.8 s");
    expect_card(part, "object custody, mean of all", "12.5", "34.5 % of those seen");
    expect_card(part, "detections from truth, RMS", "0.678", "tracks 0.234 arcsec");
    expect_card(part, "tasks done", "6", "of 9; 2 not found, 1 lost");
    /* most detections on top */
    svg_chart c = svg_need(page, "Timeline of the objects", false, false);
    svg_bar bars[40];
    for (int sensor = 0; sensor < 2; sensor++) {
        int count = svg_bars(&c, sensor, bars, 40);
        assert_int_equal(count, sensor == 0 ? 5 : 6);
        for (int i = 0; i < count; i++) {
            int k = (int)floor(11 * bars[i].y0) + 1, from, detected, frames;
            assert_int_equal(k % 2, sensor);
            bst_assert_close(11 * bars[i].y0, k - 1 + 0.15, 0.02);
            bst_assert_close(11 * bars[i].y1, k - 1 + 0.85, 0.02);
            bst_assert_close(bars[i].x0, 0.5 + k, 0.02);
            bst_assert_close(bars[i].x1, 2.5 + k, 0.02);
            assert_int_equal(
                sscanf(bars[i].title,
                       sensor ? "ear/wide: %d.5 s to %*f s, detected in %d of %d frames"
                              : "eye/camera: %d.5 s to %*f s, detected in %d of %d frames",
                       &from, &detected, &frames),
                3);
            assert_int_equal(from, k);
            assert_int_equal(detected, k);
            assert_int_equal(frames, 9);
        }
    }
    assert_int_equal(svg_bars(&c, 7, bars, 40), 11); /* not detected */
    c = svg_need(page, "Number of objects seen so far", false, false);
    double x[40], y[40];
    int n = svg_points(&c, "l s c7", 0, x, y, 40);
    assert_int_equal(n, 12);
    for (int i = 0; i < 11; i++) {
        bst_assert_close(x[i], 2.0 + i, 0.02);
        bst_assert_close(y[i], 1.0 + i, 0.02);
    }
    bst_assert_close(x[11], 20, 0.02);
    bst_assert_close(y[11], 11, 0.02);
    n = svg_points(&c, "l c1", 0, x, y, 40);
    assert_int_equal(n, 7); /* objects 1, 3, 5 ... */
    bst_assert_close(x[2], 6, 0.02);
    bst_assert_close(y[2], 3, 0.02);
    c = svg_need(page, "Object custody", false, false);
    bst_assert_close(svg_low_x(&c), 1, 0.05); /* percent */
    bst_assert_close(svg_high_x(&c), 11, 0.05);
    c = svg_need(page, "Mean time between two passes", false, false);
    bst_assert_close(svg_low_x(&c), 1, 0.05); /* minutes */
    bst_assert_close(svg_high_x(&c), 12, 0.05);
    c = svg_need(page, "RMS of the detections", false, false);
    bst_assert_close(svg_high_x(&c), 1.2, 0.01);
    assert_non_null(
        strstr(part,
               "<td>OBJ11</td><td class=\"n\">1011</td><td class=\"n\">1</td>"
               "<td class=\"n\">11</td><td class=\"n\">11</td><td class=\"n\">11.00</td>"
               "<td class=\"n\">660.0</td><td class=\"n\">3.000</td>"
               "<td class=\"n\">1.100</td><td class=\"n\">0.5000</td>"));
    assert_true(strstr(part, "<td>OBJ11</td>") < strstr(part, "<td>OBJ10</td>"));
    assert_null(strstr(part, "<td>OBJ12</td>"));
    free(page);
    run_tables_end(&t);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers),
        cmocka_unit_test(verdicts_on_a_loop),
        cmocka_unit_test(warnings_from_tables),
        cmocka_unit_test(list_of_warnings),
        cmocka_unit_test(cards_of_a_sensor),
        cmocka_unit_test(the_end_of_a_killed_run),
        cmocka_unit_test(events),
        cmocka_unit_test(wheels),
        cmocka_unit_test(custody),
        cmocka_unit_test(sightings),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
