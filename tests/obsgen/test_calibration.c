/* Calibration files: written and read back; what is wrong with one is said. */
#include <unistd.h>

#include "obsgen/calibration.h"
#include "tests/test_support.h"

static void write_text(const char *path, const char *text) {
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

static void a_file_reads_back_as_it_was(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char path[BST_TEST_PATH];
    bst_test_template(path, "calibration");
    close(mkstemp(path));
    bst_obsgen_calibration c, back;
    bst_obsgen_calibration_theory(&c);
    c.gain[2] = 0.93;
    c.threshold_offset = -0.012345678901234567;
    memset(c.made_from, 0, sizeof c.made_from);
    snprintf(c.made_from, sizeof c.made_from, "a, b");
    bst_assert_ok(&ctx, bst_obsgen_calibration_write(&ctx, path, &c));
    bst_assert_ok(&ctx, bst_obsgen_calibration_read(&ctx, path, &back));
    assert_memory_equal(&c, &back, sizeof c);
    remove(path);
}

static void refuse(const char *text, const char *part) {
    bst_ctx ctx = {0};
    char path[BST_TEST_PATH];
    bst_test_template(path, "calibration");
    close(mkstemp(path));
    write_text(path, text);
    bst_obsgen_calibration c;
    assert_int_not_equal(bst_obsgen_calibration_read(&ctx, path, &c), BST_OK);
    if (!strstr(ctx.message, part) || !strstr(ctx.message, path)) {
        fail_msg("\"%s\" does not hold \"%s\" and the file", ctx.message, part);
    }
    remove(path);
}

static void what_is_wrong_is_said(void **state) {
    (void)state;
    refuse("{}", "make one with `boresight calibrate-obsgen`");
    refuse("{\"boresight_obsgen\": 99}", "make the calibration anew");
    refuse("{\"boresight_obsgen\": \"1\"}", "make the calibration anew");
    refuse("{\"boresight_obsgen\": 4}", "/threshold_offset: missing");
    refuse("{\"boresight_obsgen\": 4, \"gian\": 2}", "did you mean \"gain\"");
    refuse("not json", "");
    bst_ctx ctx = {0};
    bst_obsgen_calibration c;
    assert_int_not_equal(bst_obsgen_calibration_read(&ctx, "/nonexistent.json", &c), BST_OK);
    assert_non_null(strstr(ctx.message, "/nonexistent.json"));
}

static void tables_are_straight_between_nodes(void **state) {
    (void)state;
    const double x[] = {1, 2, 4}, y[] = {10, 20, 0};
    /* exact in binary */
    bst_assert_close(bst_obsgen_between(x, y, 3, 0.0), 10.0, 0.0);
    bst_assert_close(bst_obsgen_between(x, y, 3, 1.5), 15.0, 0.0);
    bst_assert_close(bst_obsgen_between(x, y, 3, 3.0), 10.0, 0.0);
    bst_assert_close(bst_obsgen_between(x, y, 3, 9.0), 0.0, 0.0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_file_reads_back_as_it_was),
        cmocka_unit_test(what_is_wrong_is_said),
        cmocka_unit_test(tables_are_straight_between_nodes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
