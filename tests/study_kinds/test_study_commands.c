/* boresight study without its command: a whole study and a shard of it with runs that are
 * arithmetic, the outcome in words, and the scenario of one run. */
#include <cjson/cJSON.h>

#include "sim/cli/cli.h"
#include "sim/studies/results.h"
#include "sim/studies/study_outcome.h"
#include "sim/study_kinds/study_emit.h"
#include "sim/study_kinds/study_execution.h"
#include "sim/study_kinds/study_kinds.h"
#include "sim/study_kinds/study_plugins.h"
#include "sim/study_kinds/study_shard.h"
#include "tests/studies/fake_kind.h"

typedef struct fixture {
    char folder[BST_TEST_PATH], out[BST_TEST_PATH + 8];
    bst_ctx ctx;
    bst_study study;
    bst_study_plugins plugins;
    bst_study_kind kind;
} fixture;

static int set_up(void **state) {
    fixture *f = calloc(1, sizeof *f);
    fixture_folder(f->folder);
    snprintf(f->out, sizeof f->out, "%s/out", f->folder);
    bst_assert_ok(&f->ctx, fixture_open(&f->ctx, f->folder,
                                        "\"replicates\": 20, \"dispersions\": [{\"path\": \"/a\", "
                                        "\"from\": 0, \"to\": 1}]",
                                        &f->study));
    f->kind = fake_kind;
    f->kind.user = &f->plugins;
    *state = f;
    return 0;
}

static int tear_down(void **state) {
    fixture *f = *state;
    bst_study_close(&f->study);
    fixture_remove(f->folder);
    free(f);
    return 0;
}

/* States of the runs that the folder holds. */
static void count_rows(fixture *f, int64_t *done, int64_t *failed, int state_of_7) {
    bst_results r;
    bst_assert_ok(&f->ctx, bst_results_create(&f->ctx, &f->study, &f->kind, &r));
    bst_assert_ok(&f->ctx, bst_results_load_folder(&f->ctx, &r, f->out, 0, 20, false));
    *done = r.done;
    *failed = r.failed;
    assert_int_equal(r.state[7], state_of_7);
    bst_results_free(&r);
}

static bool has(const fixture *f, const char *name) {
    char path[BST_TEST_PATH + 64];
    snprintf(path, sizeof path, "%s/%s", f->out, name);
    return access(path, F_OK) == 0;
}

static void test_shards_then_the_rest(void **state) {
    fixture *f = *state;
    int64_t done, failed;
    bst_study_request r = {.shard = "2/4", .emit = -1, .quiet = true, .workers = 1, .cores = 1};
    assert_int_equal(bst_study_execute_shard(&f->ctx, &r, &f->study, &f->kind, f->out),
                     BST_EXIT_OK);
    count_rows(f, &done, &failed, BST_ROW_DONE); /* runs 5 to 9 */
    assert_int_equal(done, 5);
    r.shard = "5/4";
    assert_int_equal(bst_study_execute_shard(&f->ctx, &r, &f->study, &f->kind, f->out),
                     BST_EXIT_USAGE);
    r.shard = NULL;
    /* the folder holds a study that was begun: without --resume it is refused */
    assert_int_equal(bst_study_execute(&f->ctx, &r, &f->study, &f->kind, f->out), BST_EXIT_FAILED);
    assert_false(has(f, "study.sqlite"));
    r.resume = true;
    assert_int_equal(bst_study_execute(&f->ctx, &r, &f->study, &f->kind, f->out), BST_EXIT_OK);
    assert_true(has(f, "study.sqlite"));
}

static void test_a_run_that_fails_by_itself(void **state) {
    fixture *f = *state;
    int64_t done, failed;
    bst_study_request r = {.emit = -1, .quiet = true, .workers = 1, .cores = 1, .resume = true};
    assert_int_equal(mkdir(f->out, 0777), 0);
    fixture_write(f->out, "own-7", "");
    r.shard = "0:20";
    char shards[BST_TEST_PATH + 64];
    snprintf(shards, sizeof shards, "%s/shards", f->out);
    assert_int_equal(mkdir(shards, 0777), 0);
    assert_int_equal(bst_study_execute_shard(&f->ctx, &r, &f->study, &f->kind, f->out),
                     BST_EXIT_OK);
    count_rows(f, &done, &failed, BST_ROW_FAILED);
    assert_int_equal(done, 20);
    assert_int_equal(failed, 1);
}

static void test_outcome(void **state) {
    fixture *f = *state;
    char text[2048] = "";
    bst_study_row_error errors[7];
    bst_results r = {
        .study = &f->study, .done = 18, .failed = 7, .errors = errors, .error_count = 7};
    bst_driver_outcome o = {.done = 18, .failed = 7, .missing = 2, .why = "no room"};
    char why[] = "diverged";
    for (int i = 0; i < 7; i++) {
        errors[i] = (bst_study_row_error){.run = 10 + i, .text = why};
    }
    FILE *stream = fmemopen(text, sizeof text, "w");
    bst_study_print_outcome(stream, &r, &o, 12.34, "FOLDER");
    fclose(stream);
    assert_string_equal(text,
                        "test: 18 of 20 runs in 1 setting, 12.3 s\n"
                        "  run 10 failed: diverged\n  run 11 failed: diverged\n"
                        "  run 12 failed: diverged\n  run 13 failed: diverged\n"
                        "  run 14 failed: diverged\n"
                        "  and 2 more: see status and error in the table runs\n"
                        "  2 runs are missing: no room\n"
                        "  go on: boresight study FOLDER --resume\n");
    r = (bst_results){.study = &f->study, .done = 20, .differing = 1};
    o = (bst_driver_outcome){.done = 20};
    stream = fmemopen(text, sizeof text, "w");
    bst_study_print_outcome(stream, &r, &o, 1.0, "FOLDER");
    fclose(stream);
    assert_string_equal(text,
                        "test: 20 of 20 runs in 1 setting, 1.0 s\n"
                        "  results in FOLDER/study.sqlite and CSV files beside it\n"
                        "  warning: made twice with different results: 1 run\n");
}

static double camera_value(const cJSON *scenario, const char *key) {
    const cJSON *observer = cJSON_GetArrayItem(cJSON_GetObjectItem(scenario, "observers"), 0);
    const cJSON *sensor = cJSON_GetArrayItem(cJSON_GetObjectItem(observer, "sensors"), 0);
    return cJSON_GetObjectItem(cJSON_GetObjectItem(sensor, "camera"), key)->valuedouble;
}

/* noise.json: read noise 3 to 24 in 4 steps, aperture 0.1, 0.15 and 0.2 m, 20 runs of each. */
static void test_emit(void **state) {
    (void)state;
    static const struct {
        int64_t run;
        double read_noise_e, aperture_m;
    } cases[] = {{0, 3.0, 0.1}, {19, 3.0, 0.1}, {20, 3.0, 0.15}, {239, 24.0, 0.2}};
    bst_ctx ctx = {0};
    bst_study study;
    bst_assert_ok(&ctx, bst_study_open(&ctx, "scenarios/studies/noise.json", NULL, &study));
    const bst_study_kind *kind = bst_study_kind_of(study.config.kind);
    enum { BYTES = 262144 };
    char *text = malloc(BYTES), notes[256] = "";
    assert_non_null(text);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        FILE *stream = fmemopen(text, BYTES, "w"), *command = fmemopen(notes, sizeof notes, "w");
        bst_assert_ok(&ctx, bst_study_emit(&ctx, &study, kind, cases[i].run, stream, command));
        fclose(stream);
        fclose(command);
        cJSON *scenario = cJSON_Parse(text);
        assert_non_null(scenario);
        bst_assert_close(camera_value(scenario, "read_noise_e"), cases[i].read_noise_e, 1e-9);
        bst_assert_close(camera_value(scenario, "aperture_m"), cases[i].aperture_m, 1e-12);
        assert_non_null(strstr(notes, "boresight run"));
        cJSON_Delete(scenario);
    }
    assert_int_equal(bst_study_emit(&ctx, &study, kind, 240, stdout, stderr), BST_ERR_NOT_FOUND);
    assert_non_null(strstr(ctx.message, "runs 0 to 239"));
    free(text);
    bst_study_close(&study);
}

static void test_options_that_exclude_each_other(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_study_request r = {.emit = -1, .resume = true};
    bst_assert_ok(&ctx, bst_study_request_check(&ctx, &r));
    r.emit = 0;
    assert_int_equal(bst_study_request_check(&ctx, &r), BST_ERR_ARGUMENT);
    assert_true(strstr(ctx.message, "--emit") && strstr(ctx.message, "--resume"));
    r = (bst_study_request){.emit = -1, .slurm = true, .workers = 2};
    assert_int_equal(bst_study_request_check(&ctx, &r), BST_ERR_ARGUMENT);
    assert_true(strstr(ctx.message, "--workers") && strstr(ctx.message, "--slurm"));
    /* options without effect; a part that is executed here has cores and a device */
    r = (bst_study_request){.emit = 3, .cores = 5};
    assert_int_equal(bst_study_request_check(&ctx, &r), BST_ERR_ARGUMENT);
    assert_true(strstr(ctx.message, "--cores has no effect with --emit"));
    r = (bst_study_request){.emit = -1, .shard = "1/2", .shard_runs = 7};
    assert_int_equal(bst_study_request_check(&ctx, &r), BST_ERR_ARGUMENT);
    assert_true(strstr(ctx.message, "--shard-runs has no effect with --shard"));
    r = (bst_study_request){.emit = -1, .shard = "1/2", .cores = 2, .device = "x", .out = "y"};
    bst_assert_ok(&ctx, bst_study_request_check(&ctx, &r));
    r = (bst_study_request){
        .emit = -1, .dry_run = true, .workers = 2, .cores = 2, .unpinned = true};
    bst_assert_ok(&ctx, bst_study_request_check(&ctx, &r));
    r = (bst_study_request){.emit = -1, .slurm = true, .device = "x", .shard_runs = 7};
    bst_assert_ok(&ctx, bst_study_request_check(&ctx, &r));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_shards_then_the_rest, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_a_run_that_fails_by_itself, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_outcome, set_up, tear_down),
        cmocka_unit_test(test_emit),
        cmocka_unit_test(test_options_that_exclude_each_other),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
