/* The wall clock of a run: its file, what is left out, and what stays of it when the run goes on.
 */
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "sim/core/wall_clock.h"
#include "sim/run/run_wall_clock.h"
#include "tests/test_support.h"

static void wait_ms(long milliseconds) {
    const struct timespec pause = {.tv_nsec = milliseconds * 1000000};
    nanosleep(&pause, NULL);
}

/* Rows of the file; checks its heading and that both columns grow. */
static int read_back(const char *path, double rows[16][2]) {
    char line[64];
    int count = 0;
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    assert_non_null(fgets(line, sizeof line, file));
    assert_string_equal(line, "time_s,wall_s\n");
    while (fgets(line, sizeof line, file)) {
        assert_true(count < 16);
        assert_int_equal(sscanf(line, "%lf,%lf", &rows[count][0], &rows[count][1]), 2);
        if (count > 0) {
            assert_true(rows[count][0] > rows[count - 1][0]);
            assert_true(rows[count][1] >= rows[count - 1][1]);
        }
        count++;
    }
    fclose(file);
    return count;
}

static void rows_and_pauses(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char path[] = "/tmp/boresight-wall-XXXXXX";
    int made = mkstemp(path);
    assert_true(made >= 0);
    close(made);
    bst_run_wall_clock *clock;
    bst_assert_ok(&ctx, bst_run_wall_clock_open(&ctx, path, false, 0.0, &clock));
    wait_ms(250); /* it does not run yet */
    bst_run_wall_clock_note(clock, 1.0);
    bst_run_wall_clock_go(clock);
    bst_run_wall_clock_note(clock, 2.0); /* too early for a row */
    wait_ms(410);
    bst_run_wall_clock_note(clock, 3.0);
    const double noted = bst_wall_seconds();
    bst_run_wall_clock_stop(clock);
    wait_ms(250); /* a pause */
    bst_run_wall_clock_go(clock);
    bst_run_wall_clock_note(clock, 4.0);
    bst_assert_ok(&ctx, bst_run_wall_clock_close(&ctx, clock, 5.0));
    const double passed = bst_wall_seconds() - noted;
    double rows[16][2];
    int count = read_back(path, rows), at = 1;
    assert_true(rows[0][0] == 0.0 && rows[0][1] == 0.0);
    for (; rows[at][0] < 3.0; at++) {
        assert_true(rows[at][1] >= 0.2); /* a machine that stood still for so long */
    }
    assert_true(rows[at][0] == 3.0 && rows[at][1] >= 0.4);
    assert_true(rows[count - 1][0] == 5.0);
    /* without the pause; 1 ms: between two looks at the clock */
    assert_true(rows[count - 1][1] - rows[at][1] <= passed - 0.25 + 1e-3);

    /* from a state at 4 s: the row at 5 s goes, wall time goes on from that of the row at 3 s */
    bst_assert_ok(&ctx, bst_run_wall_clock_open(&ctx, path, true, 4.0, &clock));
    bst_assert_ok(&ctx, bst_run_wall_clock_close(&ctx, clock, 6.0));
    const double wall = rows[at][1];
    count = read_back(path, rows);
    assert_true(rows[count - 1][0] == 6.0 && rows[count - 1][1] >= wall);
    assert_true(rows[count - 2][0] == 4.0 && rows[count - 2][1] >= wall);
    assert_true(rows[count - 1][1] == rows[count - 2][1]); /* it was not stepped */

    /* lines that are none are left out; a new run has none of the older one */
    FILE *file = fopen(path, "a");
    assert_non_null(file);
    fputs("nonsense\n,,\n7,0\n8,nan\n", file);
    fclose(file);
    bst_assert_ok(&ctx, bst_run_wall_clock_open(&ctx, path, true, 9.0, &clock));
    bst_assert_ok(&ctx, bst_run_wall_clock_close(&ctx, clock, 9.0));
    assert_int_equal(read_back(path, rows), count + 1);
    bst_assert_ok(&ctx, bst_run_wall_clock_open(&ctx, path, false, 2.0, &clock));
    bst_assert_ok(&ctx, bst_run_wall_clock_close(&ctx, clock, 2.0));
    assert_int_equal(read_back(path, rows), 1);

    /* each kept row keeps both of its numbers, and the clock goes on from the last one's */
    file = fopen(path, "w");
    assert_non_null(file);
    fputs("time_s,wall_s\n0,0\n10,2.5\n20,4\n30,90\n", file);
    fclose(file);
    bst_assert_ok(&ctx, bst_run_wall_clock_open(&ctx, path, true, 25.0, &clock));
    bst_assert_ok(&ctx, bst_run_wall_clock_close(&ctx, clock, 40.0));
    static const double kept[5][2] = {{0, 0}, {10, 2.5}, {20, 4}, {25, 4}, {40, 4}};
    assert_int_equal(read_back(path, rows), 5);
    assert_memory_equal(rows, kept, sizeof kept);
    unlink(path);

    assert_int_equal(bst_run_wall_clock_open(&ctx, "/tmp/no/such/folder", false, 0.0, &clock),
                     BST_ERR_IO);
    assert_non_null(strstr(ctx.message, "/tmp/no/such/folder"));
    bst_run_wall_clock_note(NULL, 1.0);
    bst_assert_ok(&ctx, bst_run_wall_clock_close(&ctx, NULL, 1.0));
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(rows_and_pauses)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
