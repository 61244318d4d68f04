/* Devices of a study's workers as the command line names them. */
#include "sim/study_kinds/study_devices.h"

#include <string.h>

#include "tests/test_support.h"

static void names_are_split_at_commas(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_study_devices devices;
    bst_assert_ok(&ctx, bst_study_devices_read(&ctx, "0:0,,EPYC,", &devices));
    assert_int_equal(devices.count, 2);
    assert_string_equal(bst_study_device(&devices, 0), "0:0");
    assert_string_equal(bst_study_device(&devices, 3), "EPYC");
    bst_assert_ok(&ctx, bst_study_devices_read(&ctx, NULL, &devices));
    assert_string_equal(bst_study_device(&devices, 5), "");
}

static void nothing_is_dropped_in_silence(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_study_devices devices;
    char text[4 * BST_STUDY_DEVICES];
    memset(text, 'x', BST_STUDY_DEVICE_BYTES);
    text[BST_STUDY_DEVICE_BYTES] = '\0';
    assert_int_equal(bst_study_devices_read(&ctx, text, &devices), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "has 128 characters, at most 127"));
    text[BST_STUDY_DEVICE_BYTES - 1] = '\0';
    bst_assert_ok(&ctx, bst_study_devices_read(&ctx, text, &devices));
    assert_string_equal(bst_study_device(&devices, 0), text);
    for (int i = 0; i <= BST_STUDY_DEVICES; i++) {
        memcpy(text + 2 * i, "0,", 3);
    }
    assert_int_equal(bst_study_devices_read(&ctx, text, &devices), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "more than 64 devices: name fewer"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(names_are_split_at_commas),
        cmocka_unit_test(nothing_is_dropped_in_silence),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
