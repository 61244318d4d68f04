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

/* Who may have put files there: owner and mode of the folder and of those above it. */
static void private_folders(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    scratch place;
    scratch_make(&place);
    char path[1100];
    snprintf(path, sizeof path, "%s/a/b", place.folder);
    bst_assert_ok(&ctx, bst_folder_make_private(&ctx, path));
    struct stat info;
    assert_int_equal(stat(path, &info), 0);
    assert_int_equal(info.st_mode & 0777, 0700);
    bst_assert_ok(&ctx, bst_folder_make_private(&ctx, path));
    assert_int_equal(chmod(path, 0707), 0);
    assert_int_equal(bst_folder_check_private(&ctx, path), BST_ERR_IO);
    assert_non_null(strstr(ctx.message, "can be written to by others"));
    assert_int_equal(chmod(path, 01777), 0); /* the sticky bit does not help where files lie */
    assert_int_equal(bst_folder_check_private(&ctx, path), BST_ERR_IO);
    assert_int_equal(chmod(path, 0755), 0);
    bst_assert_ok(&ctx, bst_folder_check_private(&ctx, path));
    *strrchr(path, '/') = '\0';
    assert_int_equal(chmod(path, 0777), 0);
    strcat(path, "/b");
    assert_int_equal(bst_folder_check_private(&ctx, path), BST_ERR_IO);
    assert_non_null(strstr(ctx.message, "/a can be written to by others"));
    *strrchr(path, '/') = '\0';
    assert_int_equal(chmod(path, 01777), 0); /* as /tmp */
    strcat(path, "/b");
    bst_assert_ok(&ctx, bst_folder_check_private(&ctx, path));
    if (geteuid() == 0) {
        assert_int_equal(chown(path, 12345, 12345), 0);
        assert_int_equal(bst_folder_check_private(&ctx, path), BST_ERR_IO);
        assert_non_null(strstr(ctx.message, "belongs to another user"));
    }
    assert_int_equal(bst_folder_check_private(&ctx, "/dev/null"), BST_ERR_IO);
    scratch_remove(&place);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_make),
        cmocka_unit_test(test_refused),
        cmocka_unit_test(private_folders),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
