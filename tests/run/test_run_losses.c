/* Losses of a run: lines, manifest and tables of one set of numbers. */
#include <cjson/cJSON.h>

#include "sim/run/run_losses.h"
#include "tests/report/run_tables.h"

typedef struct lines {
    char text[16][300];
    bst_run_severity severity[16];
    int count;
} lines;

static void keep(void *user, bst_run_severity severity, const char *text) {
    lines *l = user;
    assert_true(l->count < 16);
    snprintf(l->text[l->count], sizeof *l->text, "%s", text);
    l->severity[l->count++] = severity;
}

static const bst_run_losses every = {.frames = 300,
                                     .detections = 5120,
                                     .detection_frames = 12,
                                     .tracks = 7,
                                     .track_frames = 3,
                                     .truth = 1,
                                     .truth_frames = 1,
                                     .dropped_frames = 21,
                                     .no_stars_frames = 22,
                                     .no_attitude_frames = 23,
                                     .earth_frames = 24,
                                     .moon_frames = 25,
                                     .sun_frames = 26};

static void a_line_for_each_loss(void **state) {
    (void)state;
    lines l = {.count = 0};
    bst_run_losses_report(&every, keep, &l);
    static const struct {
        bst_run_severity severity;
        const char *end;
    } expected[] = {{BST_SEVERITY_PROBLEM, ": 5120 detections in 12 of 300 frames"},
                    {BST_SEVERITY_PROBLEM, ": 7 tracks in 3 of 300 frames"},
                    {BST_SEVERITY_WARNING, ": 1 source of the truth in 1 of 300 frames"},
                    {BST_SEVERITY_WARNING, "lost on their way: 21 of 300 frames"},
                    {BST_SEVERITY_WARNING, "directions with: 23 of 300 frames"},
                    {BST_SEVERITY_WARNING, "the Earth covers part of the image: 24 of 300 frames"},
                    {BST_SEVERITY_WARNING, "the Moon covers part of the image: 25 of 300 frames"},
                    {BST_SEVERITY_WARNING, "the Sun covers part of the image: 26 of 300 frames"},
                    {BST_SEVERITY_NOTE, "no star identified: 22 of 300 frames"}};
    assert_int_equal(l.count, 9);
    for (int i = 0; i < 9; i++) {
        size_t n = strlen(l.text[i]), tail = strlen(expected[i].end);
        assert_true(n >= tail);
        assert_string_equal(l.text[i] + n - tail, expected[i].end);
        assert_int_equal(l.severity[i], expected[i].severity);
    }
    l.count = 0;
    bst_run_losses_report(&(bst_run_losses){.frames = 9}, keep, &l);
    assert_int_equal(l.count, 0);
}

static void counters(void **state) {
    (void)state;
    static const struct {
        const char *name;
        int64_t count;
        bst_run_severity severity;
        const char *text; /* NULL: none */
    } cases[] = {
        {"queue_overflow", 1, BST_SEVERITY_PROBLEM,
         "overwritten before they were read: 1 message (queue_overflow)"},
        {"queue_overflow", 2, BST_SEVERITY_PROBLEM,
         "overwritten before they were read: 2 messages (queue_overflow)"},
        {"queue_overflow", 0, BST_SEVERITY_NOTE, NULL},
        {"saturated", 3, BST_SEVERITY_NOTE, "full pixels in the image: 3 frames (saturated)"},
        {"wheels_saturated", 4, BST_SEVERITY_WARNING,
         "reaction wheels saturated: 4 times (wheels_saturated)"},
        {"link_messages", 5, BST_SEVERITY_NOTE, NULL},
        {"frame_without_stars", 5, BST_SEVERITY_NOTE, NULL},
        {"of_a_plugin", 6, BST_SEVERITY_WARNING, "of_a_plugin: counted 6 times"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        lines l = {.count = 0};
        bst_run_losses_report_counter(cases[i].name, cases[i].count, keep, &l);
        assert_int_equal(l.count, cases[i].text != NULL);
        if (cases[i].text) {
            assert_string_equal(l.text[0], cases[i].text);
            assert_int_equal(l.severity[0], cases[i].severity);
        }
    }
}

/* Written to a manifest and read from it again; what is zero has no key. */
static void through_the_manifest(void **state) {
    (void)state;
    run_tables t;
    run_tables_begin(&t, "run.sqlite");
    cJSON *manifest = cJSON_CreateObject();
    cJSON_AddStringToObject(manifest, "program", "boresight");
    bst_run_losses_add(manifest, "eye/camera", &every);
    bst_run_losses_add(manifest, "eye/other", &(bst_run_losses){.frames = 8, .moon_frames = 2});
    const cJSON *all = cJSON_GetObjectItem(manifest, "losses");
    const cJSON *own = cJSON_GetObjectItem(all, "eye/camera"),
                *other = cJSON_GetObjectItem(all, "eye/other");
    assert_int_equal(cJSON_GetArraySize(own), 13);
    assert_int_equal(cJSON_GetArraySize(other), 2);
    assert_int_equal(cJSON_GetObjectItem(own, "detections")->valueint, 5120);
    assert_int_equal(cJSON_GetObjectItem(own, "detection_frames")->valueint, 12);
    assert_int_equal(cJSON_GetObjectItem(own, "no_attitude_frames")->valueint, 23);
    assert_int_equal(cJSON_GetObjectItem(other, "moon_frames")->valueint, 2);
    char *text = cJSON_Print(manifest);
    run_tables_file(&t, "manifest.json", text);
    cJSON_free(text);
    cJSON_Delete(manifest);
    bst_run_reader *run = run_tables_open(&t);
    bst_run_losses back;
    bst_run_losses_read(run, "eye/camera", 0, &back);
    assert_memory_equal(&back, &every, sizeof every);
    bst_run_losses_read(run, "eye/other", 0, &back);
    assert_int_equal(back.frames, 8);
    assert_int_equal(back.moon_frames, 2);
    assert_int_equal(back.detections + back.earth_frames + back.no_stars_frames, 0);
    run_tables_end(&t);
}

/* Without a manifest they are counted in the tables, of one sensor. */
static void from_the_tables(void **state) {
    (void)state;
    run_tables t;
    run_tables_begin(&t, "run.sqlite");
    run_tables_sql(&t,
                   "CREATE TABLE exposures (sensor INT, lost INT, dropped INT, earth_fraction REAL,"
                   " moon_fraction REAL, sun_fraction REAL);"
                   "CREATE TABLE detection_frames (sensor INT, lost INT, stars_identified INT);"
                   "CREATE TABLE track_frames (sensor INT, lost INT, attitude_valid INT);"
                   "INSERT INTO exposures VALUES (4, 10, 0, 0.5, 0, 0), (4, 0, 1, 0.1, 0.2, 0),"
                   " (4, 5, 1, 0.9, 0, 0.3), (4, 0, 1, 0, 0.1, 0), (4, 0, 0, 0, 0, 0),"
                   " (5, 99, 1, 1, 1, 1);"
                   "INSERT INTO detection_frames VALUES (4, 3, 0), (4, 0, 7), (4, 4, 0), (4, 0, 0),"
                   " (5, 50, 0);"
                   "INSERT INTO track_frames VALUES (4, 0, 1), (4, 6, 0), (4, 0, 0), (5, 9, 0)");
    bst_run_reader *run = run_tables_open(&t);
    bst_run_losses l;
    bst_run_losses_read(run, "eye/camera", 4, &l);
    const bst_run_losses expected = {.frames = 5,
                                     .detections = 7,
                                     .detection_frames = 2,
                                     .tracks = 6,
                                     .track_frames = 1,
                                     .truth = 15,
                                     .truth_frames = 2,
                                     .dropped_frames = 3,
                                     .no_stars_frames = 3,
                                     .no_attitude_frames = 2,
                                     .earth_frames = 3,
                                     .moon_frames = 2,
                                     .sun_frames = 1};
    assert_memory_equal(&l, &expected, sizeof l);
    run_tables_end(&t);
    /* a run without truth: its frames are those with detections */
    run_tables_begin(&t, "run.sqlite");
    run_tables_sql(&t,
                   "CREATE TABLE detection_frames (sensor INT, lost INT, stars_identified INT);"
                   "INSERT INTO detection_frames VALUES (0, 1, 1), (0, 2, 1)");
    run = run_tables_open(&t);
    bst_run_losses_read(run, "eye/camera", 0, &l);
    assert_int_equal(l.frames, 2);
    assert_int_equal(l.detections, 3);
    assert_int_equal(l.truth + l.dropped_frames, 0);
    run_tables_end(&t);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_line_for_each_loss),
        cmocka_unit_test(counters),
        cmocka_unit_test(through_the_manifest),
        cmocka_unit_test(from_the_tables),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
