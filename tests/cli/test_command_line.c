/* Start and end of a command, options before it, and the progress of a star catalogue. */
#include <fcntl.h>
#include <unistd.h>

#include "sim/cli/catalogue_progress.h"
#include "sim/cli/command_line.h"
#include "sim/cli/plugin_options.h"
#include "sim/cli/plugins.h"
#include "tests/test_support.h"

static void test_exit_codes(void **state) {
    (void)state;
    bst_ctx ctx = {.message = "a message of the test"};
    assert_int_equal(bst_command_line_end(&ctx, BST_OK), 0);
    assert_int_equal(bst_command_line_end(&ctx, BST_ERR_IO), 1);
    assert_int_equal(bst_command_line_end(&ctx, BST_ERR_INTERRUPTED), 130);
    assert_int_equal(bst_command_line_end_as("x", &ctx, BST_ERR_ARGUMENT), 1);
    assert_int_equal(bst_command_line_misuse("x", "no such part", "y"), 2);
}

/* Runs bst_command_line_read over words; what it prints to stdout comes in `printed`. */
static bool read_words(int argc, char **argv, bool *help, int *arguments, int *code,
                       char printed[512]) {
    char path[BST_TEST_PATH];
    bst_ctx ctx = {0};
    *help = false;
    const bst_option table[] = {
        {.name = "help", .kind = BST_OPTION_FLAG, .target = help, .doc = "print this"},
        {.name = NULL},
    };
    const bst_command_line line = {"test", "usage: test\n", table, help};
    bst_test_template(path, "stdout");
    int file = mkstemp(path), kept = dup(STDOUT_FILENO);
    fflush(stdout);
    dup2(file, STDOUT_FILENO);
    bool on = bst_command_line_read(&ctx, &line, argc, argv, arguments, code);
    fflush(stdout);
    dup2(kept, STDOUT_FILENO);
    ssize_t bytes = pread(file, printed, 511, 0);
    printed[bytes > 0 ? bytes : 0] = '\0';
    close(file);
    close(kept);
    unlink(path);
    return on;
}

static void test_start(void **state) {
    (void)state;
    char name[] = "test", word[] = "file", wrong[] = "--wrong", asked[] = "--help", printed[512];
    char *plain[] = {name, word, NULL}, *unknown[] = {name, wrong, NULL},
         *helped[] = {name, asked, NULL};
    bool help;
    int arguments = 0, code = 7;
    assert_true(read_words(2, plain, &help, &arguments, &code, printed));
    assert_int_equal(arguments, 1);
    assert_int_equal(code, 7);
    assert_string_equal(printed, "");
    assert_false(read_words(2, unknown, &help, &arguments, &code, printed));
    assert_int_equal(code, 2);
    assert_false(read_words(2, helped, &help, &arguments, &code, printed));
    assert_int_equal(code, 0);
    assert_memory_equal(printed, "usage: test\n", 12);
    assert_non_null(strstr(printed, "--help"));
}

static void test_options_about_plugins(void **state) {
    (void)state;
    char program[] = "boresight", plugin[] = "--plugin", no[] = "--no-plugins", a[] = "a.so",
         b[] = "b.so", run[] = "run", wrong[] = "--plugn", colon[] = "a:b";
    bst_ctx ctx = {0};
    unsetenv(BST_PLUGINS_VARIABLE);
    unsetenv(BST_NO_PLUGINS_VARIABLE);
    char *two[] = {program, plugin, a, plugin, b, run, wrong};
    int first = 1;
    bst_assert_ok(&ctx, bst_plugin_options_take(&ctx, 7, two, &first));
    assert_int_equal(first, 5); /* what follows the command is the command's */
    assert_string_equal(getenv(BST_PLUGINS_VARIABLE), "a.so:b.so");
    assert_null(getenv(BST_NO_PLUGINS_VARIABLE));
    char *none[] = {program, no};
    first = 1;
    bst_assert_ok(&ctx, bst_plugin_options_take(&ctx, 2, none, &first));
    assert_int_equal(first, 2); /* no command */
    assert_non_null(getenv(BST_NO_PLUGINS_VARIABLE));
    char *mistyped[] = {program, wrong, a, run}, *without[] = {program, plugin, run},
         *path[] = {program, plugin, colon, run};
    first = 1;
    assert_int_equal(bst_plugin_options_take(&ctx, 4, mistyped, &first), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "did you mean --plugin?"));
    first = 1;
    assert_int_equal(bst_plugin_options_take(&ctx, 3, without, &first), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "and a command after it"));
    first = 1;
    assert_int_equal(bst_plugin_options_take(&ctx, 4, path, &first), BST_ERR_ARGUMENT);
    unsetenv(BST_PLUGINS_VARIABLE);
    unsetenv(BST_NO_PLUGINS_VARIABLE);
}

static void test_progress_of_a_catalogue(void **state) {
    (void)state;
    char text[160];
    /* 30 of 120 MB in 10 s: a quarter, 3 MB/s, 90 MB left at that rate */
    bst_catalogue_progress_text("downloading", 30000000, 120000000, 10.0, text, sizeof text);
    assert_string_equal(text, "downloading:  25 %, 3.0 MB/s, 30 s left");
    bst_catalogue_progress_text("reading", 2000000, 2000000, 4.0, text, sizeof text);
    assert_string_equal(text, "reading: 100 %, 0.5 million stars/s, 0 s left");
    bst_catalogue_progress_text("reading", 0, 2000000, 4.0, text, sizeof text);
    assert_string_equal(text, "reading: 4 s");
    bst_catalogue_progress_text("sorting", 5, 0, 12.0, text, sizeof text);
    assert_string_equal(text, "sorting: 12 s");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_exit_codes),
        cmocka_unit_test(test_start),
        cmocka_unit_test(test_options_about_plugins),
        cmocka_unit_test(test_progress_of_a_catalogue),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
