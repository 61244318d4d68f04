/* The executor of three commands: what they are given, what their words mean, and what happens when
 * they fail. tests/e2e/test_study.py executes a study with it. */
#include "sim/studies/scheduler.h"

#include <unistd.h>

#include "sim/core/wall_clock.h"
#include "tests/test_support.h"

enum { MOST_NEWS = 64 };

static char folder[BST_TEST_PATH];

static int set_up(void **state) {
    (void)state;
    bst_test_template(folder, "scheduler");
    assert_non_null(mkdtemp(folder));
    return 0;
}

static int tear_down(void **state) {
    (void)state;
    char command[BST_TEST_PATH + 16];
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    return system(command);
}

/* Text of a file of the folder, with '|' for the end of a line. */
static void read_file(const char *name, char out[2048]) {
    char path[BST_TEST_PATH + 64];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "r");
    size_t n = file ? fread(out, 1, 2047, file) : 0;
    out[n] = '\0';
    for (size_t i = 0; i < n; i++) {
        out[i] = out[i] == '\n' ? '|' : out[i];
    }
    if (file) {
        fclose(file);
    }
}

/* A scheduler whose queue is the file `states`: jobs are named by their runs. */
static bst_executor create(const char *poll, double grace_s, double patience_s) {
    bst_ctx ctx = {0};
    bst_scheduler s = {.submit =
                           "echo \"$1\" >>submitted; [ ! -e refuse ] || exit 3; "
                           "echo Submitted; echo \"job-$2 of a queue\"",
                       .cancel = "echo \"$@\" >>cancelled",
                       .queue_size = 5,
                       .poll_s = 0.05,
                       .grace_s = grace_s,
                       .patience_s = patience_s,
                       .call_s = 0.3};
    snprintf(s.poll, sizeof s.poll, "%s", poll);
    bst_executor executor;
    const char *program[] = {"run it", "--name", "o'clock", NULL};
    bst_assert_ok(&ctx, bst_scheduler_create(&ctx, &s, folder, program, &executor));
    return executor;
}

static void start(bst_executor *executor, int64_t count) {
    bst_ctx ctx = {0};
    for (int64_t i = 0; i < count; i++) {
        bst_study_shard_job job = {.id = 100 + i, .first = 10 * i, .count = 10, .attempt = 1};
        bst_assert_ok(&ctx, executor->start(&ctx, executor->self, &job, 1));
    }
}

/* News until `wanted` came or an error; at most 20 s. */
static bst_status collect(bst_ctx *ctx, bst_executor *executor, int wanted,
                          bst_study_shard_news *news, int *reported) {
    bst_status status = BST_OK;
    double until = bst_wall_seconds() + 20;
    *reported = 0;
    while (status == BST_OK && *reported < wanted && bst_wall_seconds() < until) {
        int count = 0;
        status = executor->poll(ctx, executor->self, 50, news + *reported, MOST_NEWS - *reported,
                                &count);
        *reported += count;
    }
    return status;
}

static void test_states(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_study_shard_news news[MOST_NEWS];
    int n;
    bst_executor executor = create(
        "echo \"$@\" >>polled; echo a title; echo job-0:10 done and well; "
        "echo job-10:10 failed no room; echo job-20:10 lost; echo job-30:10 failed",
        60, 60);
    assert_int_equal(executor.room(executor.self), 5);
    start(&executor, 4);
    assert_int_equal(executor.room(executor.self), 1);
    bst_assert_ok(&ctx, collect(&ctx, &executor, 4, news, &n));
    assert_int_equal(n, 4);
    static const struct {
        int kind;
        const char *text;
    } expected[] = {{BST_SHARD_ENDED, ""},
                    {BST_SHARD_ENDED, "no room"},
                    {BST_SHARD_LOST, "its job was killed or has disappeared"},
                    {BST_SHARD_ENDED, "its job failed, and the scheduler does not say why"}};
    for (int i = 0; i < 4; i++) {
        assert_int_equal(news[i].id, 100 + i);
        assert_int_equal(news[i].kind, expected[i].kind);
        assert_string_equal(news[i].text, expected[i].text);
    }
    assert_int_equal(executor.room(executor.self), 5);
    executor.close(executor.self);
    char text[2048];
    read_file("submitted", text);
    assert_string_equal(
        text,
        "'run it' '--name' 'o'\\''clock' 0:10|'run it' '--name' 'o'\\''clock' 10:10|"
        "'run it' '--name' 'o'\\''clock' 20:10|'run it' '--name' 'o'\\''clock' "
        "30:10|");
    read_file("polled", text);
    assert_string_equal(text, "job-0:10 job-10:10 job-20:10 job-30:10|");
    read_file("cancelled", text);
    assert_string_equal(text, "");
}

/* A job that poll does not name is lost after the time of grace. */
static void test_forgotten_job(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_study_shard_news news[MOST_NEWS];
    int n;
    bst_executor executor = create("echo job-0:10 waiting", 0.2, 60);
    start(&executor, 2);
    bst_assert_ok(&ctx, collect(&ctx, &executor, 1, news, &n));
    assert_int_equal(news[0].id, 101);
    assert_int_equal(news[0].kind, BST_SHARD_LOST);
    assert_string_equal(news[0].text, "the scheduler no longer names its job job-10:10");
    executor.cancel(executor.self, false);
    assert_int_equal(executor.room(executor.self), 0);
    executor.cancel(executor.self, true);
    bst_assert_ok(&ctx, collect(&ctx, &executor, 1, news, &n));
    assert_int_equal(news[0].id, 100);
    assert_int_equal(news[0].kind, BST_SHARD_LOST);
    char text[2048];
    read_file("cancelled", text);
    assert_string_equal(text, "job-0:10|job-0:10|");
    executor.close(executor.self);
}

/* Commands that fail are tried again until patience ends; words that mean nothing are an error. */
static void test_failing_commands(void **state) {
    (void)state;
    static const struct {
        const char *poll, *refuse, *message;
    } of[] = {
        {"echo nobody home >&2; exit 7", NULL, "command poll has failed"},
        {"echo job-0:10 running", "touch", "command submit has failed"},
        /* hangs in a process of its own, after a line that is taken */
        {"echo job-0:10 running; (sleep 30); echo late", NULL, "killed after call_s, 0.3 s"},
        {"echo job-0:10 sleeping", NULL, "printed \"job-0:10 sleeping\""},
    };
    for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
        bst_ctx ctx = {0};
        bst_study_shard_news news[MOST_NEWS];
        int n;
        char path[BST_TEST_PATH + 16];
        snprintf(path, sizeof path, "%s/refuse", folder);
        if (of[i].refuse) {
            FILE *file = fopen(path, "w");
            assert_non_null(file);
            fclose(file);
        }
        bst_executor executor = create(of[i].poll, 60, 0.2);
        double began = bst_wall_seconds();
        start(&executor, 1);
        assert_int_equal(collect(&ctx, &executor, 1, news, &n), BST_ERR_IO);
        assert_non_null(strstr(ctx.message, of[i].message));
        assert_true(bst_wall_seconds() - began < 10);
        assert_true(i == 3 || bst_wall_seconds() - began > 0.2);
        assert_true(i > 0 || strstr(ctx.message, "exit code 7: nobody home"));
        executor.close(executor.self);
        unlink(path);
    }
}

static void test_file(void **state) {
    (void)state;
    char path[BST_TEST_PATH + 16];
    snprintf(path, sizeof path, "%s/s.json", folder);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs("{\"submit\": \"a\", \"poll\": \"b\"}", file);
    assert_int_equal(fclose(file), 0);
    bst_ctx ctx = {0};
    bst_scheduler s;
    assert_int_equal(bst_scheduler_load(&ctx, path, &s), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "cancel"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_states, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_forgotten_job, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_failing_commands, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_file, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
