/* Folders with those above them: new ones, ones that are there, a file in the way, a wall. */
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/core/folder.h"
#include "tests/io/scratch.h"
#include "tests/test_support.h"

static bool is_folder(const char *path) {
    struct stat info;
    return stat(path, &info) == 0 && S_ISDIR(info.st_mode);
}

static void test_make(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    bst_assert_ok(&ctx, bst_folder_make(&ctx, scratch_path(&s, "a/b//c/")));
    assert_true(is_folder(scratch_path(&s, "a/b/c")));
    bst_assert_ok(&ctx, bst_folder_make(&ctx, scratch_path(&s, "a/b/c")));
    bst_assert_ok(&ctx, bst_folder_make_above(&ctx, scratch_path(&s, "d/e/file")));
    assert_true(is_folder(scratch_path(&s, "d/e")));
    assert_int_equal(access(scratch_path(&s, "d/e/file"), F_OK), -1);
    bst_assert_ok(&ctx, bst_folder_make_above(&ctx, "file"));
    scratch_remove(&s);
}

static void test_refused(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    FILE *file = fopen(scratch_path(&s, "file"), "w");
    assert_non_null(file);
    fclose(file);
    assert_int_equal(bst_folder_make(&ctx, scratch_path(&s, "file/below")), BST_ERR_IO);
    assert_non_null(strstr(ctx.message, "/file: cannot make the folder: "));
    assert_int_equal(bst_folder_make(&ctx, scratch_path(&s, "file")), BST_ERR_IO);
    assert_int_equal(bst_folder_make(&ctx, ""), BST_ERR_ARGUMENT);
    assert_int_equal(bst_folder_make(&ctx, "/proc/none/below"), BST_ERR_IO);
    char longest[8192];
    memset(longest, 'x', sizeof longest);
    longest[5000] = '/';
    longest[sizeof longest - 1] = '\0';
    assert_int_equal(bst_folder_make(&ctx, longest), BST_ERR_ARGUMENT);
    scratch_remove(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_make),
        cmocka_unit_test(test_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
