/* The list of benchmarks, and the rows of their table. */
#include "sim/bench/bench_list.h"
#include "sim/bench/bench_table.h"
#include "tests/test_support.h"

static void test_names(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char known[] = "sgp4", small[] = "small", unknown[] = "sgp5";
    char *const two[] = {small, known}, *const wrong[] = {known, unknown};
    int standard = 0, chosen = 0;
    for (int i = 0; i < BST_BENCHES; i++) {
        assert_non_null(bst_bench_list[i].run);
        for (int k = 0; k < i; k++) {
            assert_string_not_equal(bst_bench_list[i].name, bst_bench_list[k].name);
        }
        standard += bst_bench_is_wanted(&bst_bench_list[i], 0, NULL);
        chosen += bst_bench_is_wanted(&bst_bench_list[i], 2, two);
    }
    assert_int_equal(standard, BST_BENCHES - 1); /* "small" runs when it is named only */
    assert_int_equal(chosen, 2);
    bst_assert_ok(&ctx, bst_bench_check_names(&ctx, 2, two));
    bst_assert_ok(&ctx, bst_bench_check_names(&ctx, 0, NULL));
    assert_int_equal(bst_bench_check_names(&ctx, 2, wrong), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "\"sgp5\""));
}

enum { TEXT_BYTES = 2048 };

/* The row of a result, or the head for NULL. */
static void print(const bst_bench_result *result, bool markdown, char text[TEXT_BYTES]) {
    FILE *stream = fmemopen(text, TEXT_BYTES, "w");
    assert_non_null(stream);
    if (result) {
        bst_bench_print_result(stream, result, markdown);
    } else {
        bst_bench_print_head(stream, markdown);
    }
    assert_int_equal(fclose(stream), 0);
}

static int bars(const char *line) {
    int count = 0;
    for (; *line && *line != '\n'; line++) {
        count += *line == '|';
    }
    return count;
}

static void test_markdown(void **state) {
    (void)state;
    bst_bench_result r = bst_bench_nothing("sgp4");
    r.frames_per_s = 12345.6;
    r.setup_s = 2.0;
    char head[TEXT_BYTES], row[TEXT_BYTES];
    print(NULL, true, head);
    print(&r, true, row);
    assert_int_equal(bars(head), bars(row));
    assert_int_equal(bars(head), bars(strchr(head, '\n') + 1));
    assert_string_equal(row, "| `sgp4` | 1.235e+04 | - | - | - | - | - | - | - | - | - | - |\n");
}

static void test_plain(void **state) {
    (void)state;
    bst_bench_result r = bst_bench_nothing("loop");
    r.ms_median = 10.97;
    r.peak_rss_mib = 171.6;
    r.error_m = 0.0025;
    r.phase_count = 2;
    r.phases[0] = (struct bst_bench_phase){"plan", 1.24};
    r.phases[1] = (struct bst_bench_phase){"render", 25.4};
    char head[TEXT_BYTES], row[TEXT_BYTES];
    print(NULL, false, head);
    print(&r, false, row);
    size_t width = strcspn(head, "\n");
    assert_int_equal(strcspn(row, "\n"), width);
    /* the value stands below the end of its title */
    const char *title = strstr(head, "ms median"), *value = strstr(row, "10.97");
    assert_int_equal(title + 9 - head, value + 5 - row);
    assert_memory_equal(row + width - 3, "172", 3);
    assert_non_null(strstr(row, "error at most 2.5e-03 m\n"));
    assert_non_null(strstr(row, "plan 1.2 ms, render 25 ms\n"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_names),
        cmocka_unit_test(test_markdown),
        cmocka_unit_test(test_plain),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
