/* Texts of shards: parts cover all runs once, and are alike. */
#include "sim/studies/shard_range.h"
#include "tests/test_support.h"

#include <stdlib.h>

static void test_parts_cover_all_runs_once(void **state) {
    (void)state;
    static const int64_t runs[] = {1, 7, 20, 1000, 99991};
    static const int64_t parts[] = {1, 2, 3, 7, 64, 1000};
    for (size_t r = 0; r < sizeof runs / sizeof *runs; r++) {
        for (size_t p = 0; p < sizeof parts / sizeof *parts; p++) {
            int64_t next = 0;
            for (int64_t i = 1; i <= parts[p]; i++) {
                bst_ctx ctx = {0};
                bst_study_shard_job job = {0};
                bool exact = true;
                char text[64];
                snprintf(text, sizeof text, "%lld/%lld", (long long)i, (long long)parts[p]);
                bst_assert_ok(&ctx, bst_study_shard_range(&ctx, text, runs[r], &job, &exact));
                assert_false(exact);
                assert_int_equal(job.first, next);
                assert_true(job.count == runs[r] / parts[p] || job.count == runs[r] / parts[p] + 1);
                next += job.count;
            }
            assert_int_equal(next, runs[r]);
        }
    }
}

static void test_exact_runs(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_study_shard_job job = {0};
    bool exact = false;
    bst_assert_ok(&ctx, bst_study_shard_range(&ctx, "40:20", 60, &job, &exact));
    assert_true(exact && job.first == 40 && job.count == 20);
}

/* The number of a job of an array: variables of five schedulers, three of which begin elsewhere. */
static void test_numbers_of_the_environment(void **state) {
    (void)state;
    static const struct {
        const char *name, *value, *other, *start;
        int64_t part;
    } of[] = {{"SGE_TASK_ID", "undefined", NULL, NULL, 0},
              {"LSB_JOBINDEX", "0", NULL, NULL, 0},
              {"LSB_JOBINDEX", "5", NULL, NULL, 0},
              {"LSB_JOBINDEX", "2", NULL, NULL, 2},
              {"SGE_TASK_ID", "7", "SGE_TASK_FIRST", "5", 3},
              {"SLURM_ARRAY_TASK_ID", "12", "SLURM_ARRAY_TASK_MIN", "11", 2},
              {"AWS_BATCH_JOB_ARRAY_INDEX", "0", NULL, NULL, 1},
              {"JOB_COMPLETION_INDEX", "3", NULL, NULL, 4},
              {"BORESIGHT_SHARD_INDEX", "1", NULL, NULL, 2},
              {"BORESIGHT_SHARD_INDEX", "4", NULL, NULL, 0},
              {"BORESIGHT_SHARD_INDEX", "-1", NULL, NULL, 0},
              {"BORESIGHT_SHARD_INDEX", "1x", NULL, NULL, 0}};
    for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
        bst_ctx ctx = {0};
        bst_study_shard_job job = {0};
        bool exact = true;
        setenv(of[i].name, of[i].value, 1);
        if (of[i].other) {
            setenv(of[i].other, of[i].start, 1);
        }
        bst_status status = bst_study_shard_range(&ctx, "env/4", 40, &job, &exact);
        if (of[i].part == 0) {
            char value[64];
            snprintf(value, sizeof value, "%s=%s", of[i].name, of[i].value);
            assert_int_equal(status, BST_ERR_ARGUMENT);
            assert_non_null(strstr(ctx.message, i < 2 ? "BORESIGHT_SHARD_INDEX" : value));
        } else {
            bst_assert_ok(&ctx, status);
            assert_false(exact);
            assert_int_equal(job.first, 10 * (of[i].part - 1));
            assert_int_equal(job.count, 10);
        }
    }
    for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
        unsetenv(of[i].name);
    }
}

static void test_refusals(void **state) {
    (void)state;
    static const char *const wrong[] = {
        "",    "3",    "0/3",    "4/3", "-1/3",         "1/0",  "1/2x",  "40:21", "60:1",
        "3:0", "-1:3", "40:20x", "a:b", "1/1000000001", "env/", "env/x", "env/0"};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        bst_ctx ctx = {0};
        bst_study_shard_job job = {0};
        bool exact;
        if (bst_study_shard_range(&ctx, wrong[i], 60, &job, &exact) != BST_ERR_ARGUMENT) {
            fail_msg("\"%s\" is taken: %lld, %lld", wrong[i], (long long)job.first,
                     (long long)job.count);
        }
        assert_non_null(strstr(ctx.message, strcmp(wrong[i], "env/0") ? "60 runs" : "environment"));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_parts_cover_all_runs_once),
        cmocka_unit_test(test_exact_runs),
        cmocka_unit_test(test_numbers_of_the_environment),
        cmocka_unit_test(test_refusals),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
