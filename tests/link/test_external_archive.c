/* The state of an external module is that of another program: saving and restoring are refused,
 * with the remedy. */
#include "sim/link/external.h"
#include "tests/archive_support.h"

static void is_refused(void **state) {
    (void)state;
    const bst_module_desc *const modules[] = {
        &bst_external_imgproc_module, &bst_external_tracker_module, &bst_external_control_module};
    for (size_t i = 0; i < sizeof modules / sizeof *modules; i++) {
        bst_ctx ctx = {0};
        bst_archive *archive;
        bst_assert_ok(&ctx, bst_archive_create(&ctx, &archive));
        assert_int_equal(modules[i]->archive(NULL, archive), BST_ERR_STATE);
        assert_non_null(strstr(ctx.message, "another program"));
        assert_non_null(strstr(ctx.message, "give it a built-in type"));
        bst_archive_free(archive);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(is_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
