/* What boresight info says of a run, from tables and files that are written here. */
#include <cjson/cJSON.h>

#include "sim/report/report_info.h"
#include "tests/report/run_tables.h"

static void make_run(run_tables *t) {
    run_tables_begin(t, "run.sqlite");
    run_tables_file(t, "scenario.json",
                    "{\"name\": \"chase\", \"duration_s\": 20, \"tick_rate_hz\": 50, \"epoch_utc\":"
                    " \"2022-06-16T22:10:00Z\", \"seed\": \"0x9\", \"run\": 4}");
    run_tables_sql(
        t,
        "CREATE TABLE run (tick_rate_hz INT, epoch_utc TEXT, program TEXT);"
        "INSERT INTO run VALUES (50, '2022-06-16T22:10:00Z', 'boresight 7.6.5');"
        "CREATE TABLE tables (\"table\" TEXT, doc TEXT);"
        "INSERT INTO tables VALUES ('frames', 'Frames.'), ('events', 'Events.');"
        "CREATE TABLE columns (\"table\" TEXT, position INT, \"column\" TEXT, type TEXT, unit "
        "TEXT, doc"
        " TEXT);"
        "INSERT INTO columns VALUES ('events', 1, 'kind', 'TEXT', '', 'what'),"
        " ('events', 0, 'time_s', 'REAL', 's', 'when'), ('frames', 0, 'bits', 'INTEGER', 'bit', "
        "'depth');"
        "CREATE TABLE sensors (sensor INT, observer TEXT, name TEXT, target TEXT, file TEXT,"
        " width_px INT, height_px INT);"
        "INSERT INTO sensors VALUES (0, 'eye', 'camera', 'PREY', 'frames.fits', 640, 480),"
        " (1, 'ear', 'wide', '', '', 32, 16);"
        "CREATE TABLE frames (sensor INT, bits INT, fits_index INT, end_tick INT);"
        "INSERT INTO frames VALUES (0, 14, NULL, 100), (0, 12, NULL, 200), (1, 16, NULL, 449);"
        "CREATE TABLE control (tick INT); INSERT INTO control VALUES (420);"
        "CREATE TABLE events (time_s REAL, kind TEXT);"
        "INSERT INTO events VALUES (1, 'mode'), (2, 'mode'), (3, 'wheels')");
}

static double number(const cJSON *node, const char *key) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(node, key);
    return cJSON_IsNumber(item) ? item->valuedouble : NAN;
}
static const char *text(const cJSON *node, const char *key) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(node, key);
    return cJSON_IsString(item) ? item->valuestring : "";
}

static void of_a_complete_run(void **state) {
    (void)state;
    run_tables t;
    make_run(&t);
    run_tables_file(
        &t, "manifest.json",
        "{\"program\": \"boresight\", \"complete\": true, \"version\": \"1.2\", \"seed\":"
        " \"0x2A\", \"run\": 3, \"stars\": 99, \"wall_time_s\": 4.5, \"warnings\": 2,"
        " \"device\": \"CPU\", \"summary\": {\"frames\": 5}, \"counters\": {\"a\": 1},"
        " \"epoch_utc\": \"2022-06-16T22:10:30Z\"}");
    cJSON *info = bst_report_info(run_tables_open(&t));
    assert_string_equal(text(info, "state"), "complete");
    assert_string_equal(text(info, "scenario"), "chase");
    assert_string_equal(text(info, "version"), "1.2");
    assert_string_equal(text(info, "seed"), "0x2A");
    assert_string_equal(text(info, "start_utc"), "2022-06-16T22:10:30.000Z");
    assert_string_equal(text(info, "end_utc"), "2022-06-16T22:10:50.000Z");
    const struct {
        const char *key;
        double value;
    } keys[] = {
        {"run", 3}, {"stars", 99}, {"wall_time_s", 4.5}, {"warnings", 2}, {"simulated_s", 20}};
    for (size_t k = 0; k < sizeof keys / sizeof *keys; k++) {
        bst_assert_close(number(info, keys[k].key), keys[k].value, 0);
    }
    bst_assert_close(number(cJSON_GetObjectItem(info, "summary"), "frames"), 5, 0);
    bst_assert_close(number(cJSON_GetObjectItem(info, "counters"), "a"), 1, 0);
    const cJSON *sensors = cJSON_GetObjectItem(info, "sensors"),
                *s = cJSON_GetArrayItem(sensors, 0);
    assert_int_equal(cJSON_GetArraySize(sensors), 2);
    assert_string_equal(text(s, "observer"), "eye");
    assert_string_equal(text(s, "target"), "PREY");
    bst_assert_close(number(s, "width_px"), 640, 0);
    bst_assert_close(number(s, "height_px"), 480, 0);
    bst_assert_close(number(s, "frames"), 2, 0);
    bst_assert_close(number(s, "bits"), 14, 0);
    bst_assert_close(number(s, "frames_in_file"), 0, 0);
    s = cJSON_GetArrayItem(sensors, 1);
    bst_assert_close(number(s, "frames"), 1, 0);
    bst_assert_close(number(s, "bits"), 16, 0);
    const cJSON *tables = cJSON_GetObjectItem(info, "tables"),
                *events = cJSON_GetArrayItem(tables, 1);
    assert_int_equal(cJSON_GetArraySize(tables), 2);
    assert_string_equal(text(events, "name"), "events");
    bst_assert_close(number(events, "rows"), 3, 0);
    const cJSON *columns = cJSON_GetObjectItem(events, "columns");
    assert_int_equal(cJSON_GetArraySize(columns), 2);
    assert_string_equal(text(cJSON_GetArrayItem(columns, 0), "name"), "time_s");
    assert_string_equal(text(cJSON_GetArrayItem(columns, 0), "unit"), "s");
    assert_string_equal(text(cJSON_GetArrayItem(columns, 1), "doc"), "what");
    bst_assert_close(number(cJSON_GetObjectItem(info, "events"), "mode"), 2, 0);
    bst_assert_close(number(cJSON_GetObjectItem(info, "events"), "wheels"), 1, 0);
    double bytes = 0;
    const cJSON *file;
    cJSON_ArrayForEach(file, cJSON_GetObjectItem(info, "files")) {
        struct stat own;
        assert_int_equal(stat(scratch_path(&t.place, text(file, "name")), &own), 0);
        bst_assert_close(number(file, "bytes"), (double)own.st_size, 0);
        bytes += (double)own.st_size;
    }
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(info, "files")), 3);
    bst_assert_close(number(info, "bytes"), bytes, 0);
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(info, "problems")), 0);
    cJSON_Delete(info);
    run_tables_end(&t);
}

/* Without a manifest: what the tables know, up to the last tick. */
static void of_a_killed_run(void **state) {
    (void)state;
    for (int k = 0; k < 2; k++) {
        run_tables t;
        make_run(&t);
        if (k == 1) { /* control goes on after the last frame */
            run_tables_sql(&t, "INSERT INTO control VALUES (549)");
        }
        cJSON *info = bst_report_info(run_tables_open(&t));
        assert_string_equal(text(info, "state"), "killed");
        assert_string_equal(text(info, "version"), "7.6.5");
        assert_string_equal(text(info, "seed"), "0x9");
        bst_assert_close(number(info, "run"), 4, 0);
        bst_assert_close(number(info, "simulated_s"), k ? 11 : 9, 1e-12);
        assert_string_equal(text(info, "end_utc"),
                            k ? "2022-06-16T22:10:11.000Z" : "2022-06-16T22:10:09.000Z");
        assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(info, "problems")), 1);
        cJSON_Delete(info);
        run_tables_end(&t);
    }
}

/* Interrupted: up to the tick of the manifest. */
static void of_an_interrupted_run(void **state) {
    (void)state;
    run_tables t;
    make_run(&t);
    run_tables_file(&t, "manifest.json",
                    "{\"program\": \"boresight\", \"complete\": false, \"last_tick\": 249}");
    cJSON *info = bst_report_info(run_tables_open(&t));
    assert_string_equal(text(info, "state"), "interrupted");
    bst_assert_close(number(info, "simulated_s"), 5, 1e-12);
    assert_string_equal(text(info, "start_utc"), "2022-06-16T22:10:00.000Z");
    cJSON_Delete(info);
    run_tables_end(&t);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(of_a_complete_run),
        cmocka_unit_test(of_a_killed_run),
        cmocka_unit_test(of_an_interrupted_run),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
