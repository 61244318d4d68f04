/* Where the page of a report goes, and folders that hold neither run nor study. */
#include <unistd.h>

#include "sim/report/report_file.h"
#include "tests/test_support.h"

static void test_paths(void **state) {
    (void)state;
    static const struct {
        const char *given, *folder, *path;
    } cases[] = {
        {NULL, "runs/a", "runs/a/report.html"},
        {NULL, "runs/a/", "runs/a/report.html"},
        {"page.html", "runs/a", "page.html"},
        {"scenarios", "runs/a", "scenarios/report.html"},
        {"scenarios/", "runs/a", "scenarios/report.html"},
        {"no_such_folder", "runs/a", "no_such_folder"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        char path[4096];
        bst_assert_ok(&ctx, bst_report_path(&ctx, cases[i].given, cases[i].folder, path));
        assert_string_equal(path, cases[i].path);
    }
    bst_ctx ctx = {0};
    char path[4096], longest[4200];
    memset(longest, 'x', sizeof longest - 1);
    longest[sizeof longest - 1] = '\0';
    assert_int_equal(bst_report_path(&ctx, NULL, longest, path), BST_ERR_ARGUMENT);
}

static void test_no_file_is_left(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char folder[BST_TEST_PATH], path[4096];
    bool damaged = false;
    bst_test_template(folder, "report");
    assert_non_null(mkdtemp(folder));
    assert_int_not_equal(bst_report_write(&ctx, folder, NULL, path, &damaged), BST_OK);
    assert_int_equal(rmdir(folder), 0); /* it is empty */
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_paths),
        cmocka_unit_test(test_no_file_is_left),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
