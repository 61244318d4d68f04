/* Children of the viewer: this program, run again, that waits, computes or copies. The limit is of
 * processor time: a busy machine, on which a child waits for most of the time, ends none. */
#include "view/child_command.h"

#include <time.h>

#include "tests/test_support.h"

enum { LIMIT_S = 1 };

/* What the child does: argv is "boresight --no-plugins WORD". */
static int child(const char *word) {
    char line[64] = "";
    if (!strcmp(word, "wait")) { /* three times the limit */
        nanosleep(&(struct timespec){.tv_sec = 3 * LIMIT_S}, NULL);
    }
    for (volatile long n = 0; !strcmp(word, "compute"); n++) {
    }
    if (!fgets(line, sizeof line, stdin)) {
        return 2;
    }
    printf("read %s", line);
    return 0;
}

static bst_view_child_result run(const char *word) {
    bst_ctx ctx = {0};
    bst_view_child_result out;
    const char *words[] = {word, NULL};
    bst_assert_ok(&ctx, bst_view_child_run(&ctx, words, "/", "a text\n", 7, LIMIT_S, &out));
    return out;
}

static void waiting_is_no_work(void **state) {
    (void)state;
    for (int k = 0; k < 2; k++) {
        bst_view_child_result out = run(k ? "wait" : "copy");
        assert_false(out.timed_out);
        assert_int_equal(out.exit_code, 0);
        assert_string_equal(out.output, "read a text\n");
        assert_string_equal(out.messages, "");
        bst_view_child_free(&out);
    }
}

static void work_has_a_limit(void **state) {
    (void)state;
    bst_view_child_result out = run("compute");
    assert_true(out.timed_out);
    assert_true(out.exit_code > 128);
    bst_view_child_free(&out);
}

int main(int argc, char **argv) {
    if (argc == 3 && !strcmp(argv[1], "--no-plugins")) {
        return child(argv[2]);
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(waiting_is_no_work),
                                       cmocka_unit_test(work_has_a_limit)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
