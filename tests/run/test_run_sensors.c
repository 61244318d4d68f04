/* Which of a run's sensors a name means. */
#include "sim/run/run_sensors.h"
#include "tests/report/run_tables.h"
#include "tests/test_support.h"

static void names_of_sensors(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    run_tables t;
    run_tables_begin(&t, "run.sqlite");
    run_tables_sql(
        &t,
        "CREATE TABLE run (epoch_utc TEXT, tick_rate_hz INTEGER, program TEXT);"
        "INSERT INTO run VALUES ('2022-06-16T22:10:00Z', 6000, 'boresight');"
        "CREATE TABLE sensors (sensor INTEGER, observer TEXT, name TEXT, target TEXT, "
        "file TEXT);"
        "INSERT INTO sensors VALUES (2, 'east', 'narrow', 'GX5', 'c.fits'), "
        "(0, 'east', 'wide', '', '../a.fits'), (1, 'westward', 'wide', 'ISS', 'b.fits')");
    bst_run_reader *run = run_tables_open(&t);
    static const struct {
        const char *wanted;
        int count;
        int64_t index[3];
    } rows[] = {{NULL, 3, {0, 1, 2}},        {"wide", 2, {0, 1}},       {"narrow", 1, {2}},
                {"east/wide", 1, {0}},       {"westward/wide", 1, {1}}, {"east/narrow", 1, {2}},
                {"westward/narrow", 0, {0}}, {"east", 0, {0}},          {"east/", 0, {0}},
                {"east//wide", 0, {0}},      {"eastwide", 0, {0}},      {"west/wide", 0, {0}}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        bst_run_sensor found[BST_EXPORT_SENSORS];
        int count = -1;
        bst_status status = bst_run_sensors(&ctx, run, rows[i].wanted, found, &count);
        assert_int_equal(status, rows[i].count ? BST_OK : BST_ERR_NOT_FOUND);
        assert_int_equal(count, rows[i].count);
        for (int k = 0; k < count; k++) {
            assert_int_equal(found[k].index, rows[i].index[k]);
        }
        if (i == 0) {
            assert_string_equal(found[0].file, ""); /* never outside the folder */
            assert_string_equal(found[1].target, "ISS");
            assert_string_equal(found[2].file, "c.fits");
        }
        if (count == 0) {
            assert_non_null(strstr(ctx.message, "it has east/wide, westward/wide, east/narrow"));
        }
    }
    run_tables_end(&t);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(names_of_sensors)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
