/* Which objects' orbits are exported: by name, by number, those that were seen. */
#include "sim/export/orbit_selection.h"
#include "tests/report/run_tables.h"
#include "tests/world/world_support.h"

#define OBJECT(name) "{\"name\": \"" name "\", " TEST_GX5 "}"

static void choices(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    run_tables t;
    bst_world *world = test_world_with(
        OBJECT("A") ", " OBJECT("B, OLD") ", " OBJECT("B") ", " OBJECT("44") ", " OBJECT("E"), "");
    run_tables_begin(&t, "run.sqlite");
    run_tables_sql(&t,
                   "CREATE TABLE truth (kind TEXT, id INT, in_field INT);"
                   "INSERT INTO truth VALUES ('object', 0, 1), ('object', 2, 0), ('star', 3, 1),"
                   " ('object', 9, 1);"
                   "CREATE TABLE sensors (target TEXT); INSERT INTO sensors VALUES ('E'), ('')");
    bst_run_reader *run = run_tables_open(&t);
    static const struct {
        const char *text, *chosen; /* a digit for each object; NULL: an error */
        int left_out;
    } cases[] = {{"all", "11111", 0},    {NULL, "11111", 0},
                 {"seen", "10001", 3},   {"A", "10000", 0},
                 {"A,E", "10001", 0},    {"A, E", "10001", 0},
                 {"B, OLD", "01000", 0}, {"B", "00100", 0},
                 {"B,A", "10100", 0},    {"B, OLD,B, OLD,A", "11000", 0},
                 {"44", "00010", 0},     {"44801", "11111", 0}, /* the number of all */
                 {"448", NULL, 0},       {"A,F", NULL, 0},
                 {"", NULL, 0}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_orbit_selection s = {0};
        bst_status status = bst_orbit_selection_make(&ctx, run, world, cases[i].text, &s);
        assert_int_equal(status, cases[i].chosen ? BST_OK : BST_ERR_NOT_FOUND);
        int count = 0;
        for (int k = 0; k < 5 && cases[i].chosen; k++) {
            assert_int_equal(s.chosen[k], cases[i].chosen[k] == '1');
            count += cases[i].chosen[k] == '1';
        }
        if (cases[i].chosen) {
            assert_int_equal(s.count, count);
            assert_int_equal(s.left_out, cases[i].left_out);
        }
        bst_orbit_selection_free(&s);
    }
    bst_world_free(world);
    run_tables_end(&t);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(choices)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
