/* Messages: what they quote cannot write to a terminal or pretend to be a second message. */
#include "boresight/status.h"
#include "tests/test_support.h"

static void keep(void *user, bst_log_level level, const char *message) {
    (void)level;
    snprintf(user, BST_MESSAGE_BYTES, "%s", message);
}

static void test_quoted_text_is_one_line(void **state) {
    (void)state;
    static const char quoted[] = "a\nb\x1b[31m\x7f\tc";
    char logged[BST_MESSAGE_BYTES] = "";
    bst_ctx ctx;
    bst_ctx_init(&ctx, keep, logged, BST_LOG_WARNING);
    assert_int_equal(bst_fail(&ctx, BST_ERR_IO, "%s: missing", quoted), BST_ERR_IO);
    assert_string_equal(ctx.message, "a?b?[31m??c: missing");
    assert_int_equal(bst_fail_prefix(&ctx, BST_ERR_IO, "x%sx", quoted), BST_ERR_IO);
    assert_string_equal(ctx.message, "xa?b?[31m??cx: a?b?[31m??c: missing");
    bst_log(&ctx, BST_LOG_WARNING, "%s", quoted);
    assert_string_equal(logged, "a?b?[31m??c");
}

/* A message that has lines of its own may quote lines: what a compiler said. */
static void test_lines_of_the_program(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_fail(&ctx, BST_ERR_DEVICE, "building failed:\n%s", "line 1\nline\x1b 2");
    assert_string_equal(ctx.message, "building failed:\nline 1\nline? 2");
    bst_fail_prefix(&ctx, BST_ERR_DEVICE, "frame\n3");
    assert_string_equal(ctx.message, "frame\n3: building failed:\nline 1\nline? 2");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_quoted_text_is_one_line),
        cmocka_unit_test(test_lines_of_the_program),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
