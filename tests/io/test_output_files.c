/* Files that are being written: nothing that another process put there is written through; cells of
 * CSV files stay text. */
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/core/draft.h"
#include "sim/io/csv.h"
#include "sim/io/draft_file.h"
#include "sim/io/manifest.h"
#include "tests/io/scratch.h"
#include "tests/test_support.h"

static scratch place;

static int begin(void **state) {
    (void)state;
    scratch_make(&place);
    return 0;
}

static int end(void **state) {
    (void)state;
    scratch_remove(&place);
    return 0;
}

static void path_of(const char *name, char path[1024]) {
    snprintf(path, 1024, "%s", scratch_path(&place, name));
}

static void put(const char *path, const char *text) {
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

static void expect(const char *path, const char *text) {
    char found[64] = "";
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    size_t n = fread(found, 1, sizeof found - 1, file);
    fclose(file);
    found[n] = '\0';
    assert_string_equal(found, text);
}

/* A link at PATH.tmp.PROCESS, a predictable name, and one at the path itself. */
static void links_are_not_followed(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char path[1024], victim[1024], trap[1100];
    path_of("table.csv", path);
    path_of("victim", victim);
    put(victim, "mine");
    snprintf(trap, sizeof trap, "%s.tmp.%ld", path, (long)getpid());
    assert_int_equal(symlink(victim, trap), 0);
    bst_draft draft;
    bst_assert_ok(&ctx, bst_draft_open(&ctx, path, &draft));
    fputs("rows", draft.stream);
    bst_assert_ok(&ctx, bst_draft_close(&ctx, &draft, BST_OK));
    expect(path, "rows");
    expect(victim, "mine");
    bst_assert_ok(&ctx, bst_io_write_file_atomic(&ctx, path, "more", 4));
    expect(path, "more");
    expect(victim, "mine");
    assert_int_equal(unlink(path), 0);
    assert_int_equal(symlink(victim, path), 0);
    bst_assert_ok(&ctx, bst_io_write_file_atomic(&ctx, path, "more", 4));
    expect(path, "more");
    expect(victim, "mine");
    int fd;
    bst_assert_ok(&ctx, bst_draft_make_at(&ctx, trap, &fd));
    assert_int_equal(write(fd, "x", 1), 1);
    close(fd);
    expect(trap, "x");
    expect(victim, "mine");
    unlink(trap);
}

static void what_is_no_file_is_not_replaced(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char path[1024];
    struct stat info;
    path_of("pipe", path);
    assert_int_equal(mkfifo(path, 0600), 0);
    assert_int_equal(bst_io_write_file_atomic(&ctx, path, "x", 1), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "is not a regular file; give another path"));
    assert_int_equal(stat(path, &info), 0);
    assert_true(S_ISFIFO(info.st_mode));
    path_of("none/x", path);
    assert_int_equal(bst_io_write_file_atomic(&ctx, path, "x", 1), BST_ERR_IO);
    assert_non_null(strstr(ctx.message, "none/x: cannot be made: No such file or directory"));
}

static void drafts_are_swept_by_their_names(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char path[1024], name[1100];
    int fd;
    path_of("swept", path);
    bst_assert_ok(&ctx, bst_draft_make(&ctx, path, name, sizeof name, &fd));
    close(fd);
    assert_true(bst_draft_is_name(strrchr(name, '/') + 1));
    bst_draft_sweep(place.folder);
    assert_int_not_equal(access(name, F_OK), 0);
    assert_true(bst_draft_is_name("runs.csv.tmp.7")); /* of versions before 0.2 */
    assert_false(bst_draft_is_name("mine.tmp"));
    assert_false(bst_draft_is_name("tmp.5"));
    assert_false(bst_draft_is_name("x.tmp.5a"));
}

/* RFC 4180, and no cell that a spreadsheet runs as a formula. */
static void cells_of_csv_are_text(void **state) {
    (void)state;
    static const char *const cases[][2] = {
        {"plain", "plain"},     {"", "\"\""},
        {"a,b", "\"a,b\""},     {"say \"x\"", "\"say \"\"x\"\"\""},
        {"=1+1", "\"'=1+1\""},  {"+a", "\"'+a\""},
        {"-a", "\"'-a\""},      {"@a", "\"'@a\""},
        {"\ta", "\"'\ta\""},    {"=\"x\"", "\"'=\"\"x\"\"\""},
        {"a=1+1", "a=1+1"},     {"-0", "-0"},
        {"+1.5e-3", "+1.5e-3"}, {"-1+1", "\"'-1+1\""},
        {"-", "\"'-\""},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char *text = NULL;
        size_t bytes = 0;
        FILE *file = open_memstream(&text, &bytes);
        assert_non_null(file);
        bst_csv_put_text(file, cases[i][0]);
        fclose(file);
        assert_string_equal(text, cases[i][1]);
        free(text);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(links_are_not_followed),
        cmocka_unit_test(what_is_no_file_is_not_replaced),
        cmocka_unit_test(drafts_are_swept_by_their_names),
        cmocka_unit_test(cells_of_csv_are_text),
    };
    return cmocka_run_group_tests(tests, begin, end);
}
