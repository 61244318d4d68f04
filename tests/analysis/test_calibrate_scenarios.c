/* boresight calibrate-obsgen: what a calibration says about its data, and scenarios without images.
 */
#include "boresight/version.h"
#include "sim/analysis/calibration/calibrate_scenarios.h"
#include "tests/test_support.h"

static void test_description(void **state) {
    (void)state;
    char one[] = "scenarios/calibration/a.json", two[] = "b.json", out[128], wanted[128], small[12];
    char *const files[] = {one, two};
    bst_calibration_describe(3, 2, files, out, sizeof out);
    snprintf(wanted, sizeof wanted, "boresight %s, 3 runs of a.json b.json", bst_version());
    assert_string_equal(out, wanted);
    memset(small, 'x', sizeof small);
    bst_calibration_describe(3, 2, files, small, sizeof small);
    assert_memory_equal(small, wanted, sizeof small - 1);
    assert_int_equal(small[sizeof small - 1], '\0');
}

static void test_the_image_path_is_needed(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char file[] = "scenarios/day_generator.json";
    char *const files[] = {file};
    bst_option none[] = {{.name = NULL}};
    bst_calibration_order order = {.load = BST_LOAD_DEFAULTS, .seeds = 1, .out = "/nowhere/x"};
    bst_assert_ok(&ctx, bst_load_check(&ctx, &order.load, none));
    assert_int_equal(bst_calibration_make(&ctx, &order, 1, files), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "observation_source \"image\""));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_description),
        cmocka_unit_test(test_the_image_path_is_needed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
