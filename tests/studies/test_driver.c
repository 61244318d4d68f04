/* The driver over the pool of this machine: whatever happens to workers, each run counts once. */
#include "sim/studies/driver.h"
#include "sim/studies/local_pool.h"
#include "sim/studies/tables.h"
#include "tests/studies/fake_kind.h"

enum { RUNS = 200 };

typedef struct fixture {
    char folder[BST_TEST_PATH];
    bst_ctx ctx;
    bst_study study;
    bst_results results;
    bst_driver_outcome outcome;
} fixture;

static int set_up(void **state) {
    fixture *f = calloc(1, sizeof *f);
    char path[512];
    fixture_folder(f->folder);
    /* caches of kernels go there too */
    assert_int_equal(setenv("XDG_CACHE_HOME", f->folder, 1), 0);
    snprintf(path, sizeof path, "%s/shards", f->folder);
    assert_int_equal(mkdir(path, 0777), 0);
    bst_assert_ok(&f->ctx, fixture_open(&f->ctx, f->folder,
                                        "\"replicates\": 50, \"sweeps\": [{\"axes\": [{\"path\": "
                                        "\"/b/c\", \"values\": [1, 2, 3, 4]}]}], \"dispersions\": "
                                        "[{\"path\": \"/a\", \"from\": 0, \"to\": 1}]",
                                        &f->study));
    assert_int_equal(f->study.runs, RUNS);
    *state = f;
    return 0;
}

static int tear_down(void **state) {
    fixture *f = *state;
    bst_results_free(&f->results);
    bst_study_close(&f->study);
    fixture_remove(f->folder);
    free(f);
    return 0;
}

static int reports;
static int64_t done_before;

/* Rate and time left are those of the runs done since the start. */
static void take_progress(void *user, const bst_driver_progress *p) {
    const fixture *f = user;
    assert_int_equal(p->runs, RUNS);
    assert_in_range(p->done, f->results.done, RUNS);
    if (!isnan(p->left_s)) {
        reports++;
        bst_assert_close(p->runs_per_s * p->elapsed_s, (double)(p->done - done_before), 1e-6);
        bst_assert_close(p->left_s * p->runs_per_s, (double)(RUNS - p->done), 1e-6);
    }
}

static bst_status drive(fixture *f, int workers, int64_t shard_runs) {
    bst_executor executor;
    const bst_local_pool_options pool = {.study = &f->study,
                                         .kind = &fake_kind,
                                         .out = f->folder,
                                         .workers = workers,
                                         .lock_fd = -1,
                                         .unpinned = true};
    const bst_driver_options options = {.out = f->folder,
                                        .kind = &fake_kind,
                                        .shard_s = 1.0,
                                        .shard_runs = shard_runs,
                                        .parallel = workers,
                                        .progress = take_progress,
                                        .user = f};
    bst_results_free(&f->results);
    bst_assert_ok(&f->ctx, bst_results_create(&f->ctx, &f->study, &fake_kind, &f->results));
    bst_assert_ok(&f->ctx, bst_results_load_folder(&f->ctx, &f->results, f->folder, 0, RUNS, true));
    bst_assert_ok(&f->ctx, bst_local_pool_open(&f->ctx, &pool, &executor));
    done_before = f->results.done;
    bst_status status = bst_driver_run(&f->ctx, &f->results, &executor, &options, &f->outcome);
    executor.close(executor.self);
    return status;
}

static void read_text(const fixture *f, const char *name, char *out, size_t bytes) {
    char path[512];
    snprintf(path, sizeof path, "%s/%s", f->folder, name);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    size_t n = fread(out, 1, bytes - 1, file);
    assert_in_range(n, 10, bytes - 2);
    out[n] = '\0';
    fclose(file);
}

static void forget_rows(const fixture *f) {
    char command[600];
    snprintf(command, sizeof command, "rm -f '%s'/shards/*", f->folder);
    assert_int_equal(system(command), 0);
}

/* Any number of workers, any size of shards, workers that die: the same tables. */
static void test_same_tables(void **state) {
    fixture *f = *state;
    enum { BYTES = 1 << 17 };
    static const char *const names[] = {"runs.csv", "statistics.csv", "parts_statistics.csv"};
    char *first[3], *now = malloc(BYTES);
    fixture_write(f->folder, "own-33", "");
    for (int pass = 0; pass < 3; pass++) {
        forget_rows(f);
        if (pass == 2) {
            fixture_write(f->folder, "once-7", "");
            fixture_write(f->folder, "once-150", "");
        }
        bst_assert_ok(&f->ctx, drive(f, pass == 0 ? 1 : 3, pass == 1 ? 17 : 0));
        assert_int_equal(f->outcome.missing, 0);
        assert_int_equal(f->outcome.failed, 1);
        assert_true(reports > 0);
        assert_int_equal(f->outcome.attempts_lost, pass == 2 ? 2 : 0);
        bst_assert_ok(&f->ctx, bst_study_write_tables(&f->ctx, &f->results, f->folder));
        for (int i = 0; i < 3; i++) {
            char *text = pass == 0 ? (first[i] = malloc(BYTES)) : now;
            read_text(f, names[i], text, BYTES);
            assert_string_equal(text, first[i]);
        }
    }
    assert_non_null(strstr(first[0], "33,0,33,33,0,failed,\"diverged\nat once\""));
    for (int i = 0; i < 3; i++) {
        free(first[i]);
    }
    free(now);
}

/* Who kills every worker is given up alone, and is done when it does so no more. */
static void test_deadly_run(void **state) {
    fixture *f = *state;
    char path[512];
    fixture_write(f->folder, "kill-41", "");
    bst_assert_ok(&f->ctx, drive(f, 2, 100));
    assert_int_equal(f->outcome.missing, 1);
    assert_int_equal(f->results.state[41], BST_ROW_MISSING);
    assert_int_equal(f->outcome.attempts_lost, BST_DRIVER_ATTEMPTS);
    assert_non_null(strstr(f->outcome.why, "killed by signal 9"));
    snprintf(path, sizeof path, "%s/kill-41", f->folder);
    assert_int_equal(unlink(path), 0);
    bst_assert_ok(&f->ctx, drive(f, 2, 100));
    assert_int_equal(f->outcome.missing, 0);
    assert_int_equal(f->results.doubled, 0);
}

/* Where nothing can be written all is given up at once, and done later. */
static void test_no_room(void **state) {
    fixture *f = *state;
    char path[512], away[512];
    snprintf(path, sizeof path, "%s/shards", f->folder);
    snprintf(away, sizeof away, "%s/away", f->folder);
    assert_int_equal(rename(path, away), 0);
    bst_assert_ok(&f->ctx, drive(f, 2, 1));
    assert_int_equal(f->outcome.missing, RUNS);
    assert_in_range(f->outcome.attempts_lost, 1, 20);
    assert_int_equal(rename(away, path), 0);
    bst_assert_ok(&f->ctx, drive(f, 2, 10));
    assert_int_equal(f->outcome.missing, 0);
}

/* A shard whose rows are other runs', and what is no file under a shard's name, hold up no other:
 * they are moved away, and their runs are made again. */
static void test_wrong_shards(void **state) {
    fixture *f = *state;
    enum { SIZE = 10 };
    char command[2000];
    forget_rows(f);
    bst_assert_ok(&f->ctx, drive(f, 1, SIZE));
    snprintf(command, sizeof command,
             "cd '%s/shards' && rm -f 000000010-000000019.rows 00000003?-00000003?.rows "
             "000000040-000000049.rows 000000050-000000059.rows && "
             "cp 000000000-000000009.rows 000000010-000000019.rows && "
             "ln -s nowhere 000000030-000000039.rows && mkdir 000000040-000000049.rows && "
             "mkfifo 000000050-000000059.rows",
             f->folder);
    assert_int_equal(system(command), 0);
    bst_assert_ok(&f->ctx, drive(f, 1, SIZE));
    assert_int_equal(f->outcome.missing, 0);
    assert_int_equal(f->outcome.attempts_lost, 0);
    assert_int_equal(f->results.doubled, 0);
    snprintf(command, sizeof command,
             "cd '%s/shards' && test $(ls -d *.rows.rejected | wc -l) = 4 && "
             "test -f 000000010-000000019.rows && test -f 000000030-000000039.rows",
             f->folder);
    assert_int_equal(system(command), 0);
}

/* An executor whose shards end well and publish nothing. */
typedef struct idle_executor {
    bst_study_shard_job jobs[256];
    int64_t count, started;
} idle_executor;

static int64_t idle_room(void *self) {
    (void)self;
    return 4;
}
static bst_status idle_start(bst_ctx *ctx, void *self, const bst_study_shard_job *jobs,
                             int64_t count) {
    (void)ctx;
    idle_executor *e = self;
    for (int64_t i = 0; i < count; i++) {
        e->jobs[e->count++] = jobs[i];
        e->started++;
    }
    return BST_OK;
}
static bst_status idle_poll(bst_ctx *ctx, void *self, int wait_ms, bst_study_shard_news *news,
                            int room, int *count) {
    (void)ctx;
    (void)wait_ms;
    idle_executor *e = self;
    for (*count = 0; *count < room && e->count > 0; ++*count) {
        const bst_study_shard_job *job = &e->jobs[--e->count];
        news[*count] =
            (bst_study_shard_news){.id = job->id, .kind = BST_SHARD_ENDED, .runs_done = job->count};
    }
    assert_true(e->started < 10000); /* it does not go on for ever */
    return BST_OK;
}
static void idle_cancel(void *self, bool hard) {
    (void)self;
    (void)hard;
}

static void test_shards_that_gain_nothing(void **state) {
    fixture *f = *state;
    idle_executor idle = {.count = 0};
    bst_executor executor = {.self = &idle,
                             .room = idle_room,
                             .start = idle_start,
                             .poll = idle_poll,
                             .cancel = idle_cancel};
    const bst_driver_options options = {
        .out = f->folder, .kind = &fake_kind, .shard_s = 1.0, .shard_runs = 10};
    bst_driver_outcome outcome;
    forget_rows(f);
    bst_results_free(&f->results);
    bst_assert_ok(&f->ctx, bst_results_create(&f->ctx, &f->study, &fake_kind, &f->results));
    bst_assert_ok(&f->ctx, bst_driver_run(&f->ctx, &f->results, &executor, &options, &outcome));
    assert_int_equal(outcome.done, 0);
    assert_in_range(outcome.attempts_lost, 1, 100);
    assert_non_null(strstr(outcome.why, "none of its rows could be read"));
}

/* An executor whose runs take 0.4 s and 0.6 s in turns, as its rows say. */
typedef struct timed_executor {
    fixture *f;
    bst_study_shard_job job;
    int64_t sizes[RUNS];
    int count;
    bool busy;
} timed_executor;

static int64_t timed_room(void *self) {
    const timed_executor *e = self;
    return e->busy ? 0 : 1;
}

static bst_status timed_start(bst_ctx *ctx, void *self, const bst_study_shard_job *jobs,
                              int64_t count) {
    timed_executor *e = self;
    bst_study_shard_draft draft;
    assert_int_equal(count, 1);
    e->busy = true;
    e->job = jobs[0];
    e->sizes[e->count++] = jobs[0].count;
    BST_TRY(bst_study_shard_begin(ctx, &e->f->study, &fake_kind, jobs[0].first, &draft));
    for (int64_t i = 0; i < jobs[0].count; i++) {
        const bst_study_result none = {.rows = 0};
        bst_study_shard_add(&draft, &none, i % 2 ? 0.6 : 0.4, NULL);
    }
    return bst_study_shard_publish(ctx, &draft, e->f->folder);
}

static bst_status timed_poll(bst_ctx *ctx, void *self, int wait_ms, bst_study_shard_news *news,
                             int room, int *count) {
    (void)ctx;
    (void)wait_ms;
    timed_executor *e = self;
    *count = e->busy && room > 0;
    if (*count) {
        e->busy = false;
        news[0] = (bst_study_shard_news){
            .id = e->job.id, .kind = BST_SHARD_ENDED, .runs_done = e->job.count};
    }
    return BST_OK;
}

/* Shards get as many runs as fill their time by the mean of the rows and of what was expected, half
 * each; towards the end so few that all workers stay busy; one run alone where that measures. */
static void test_shards_by_time(void **state) {
    fixture *f = *state;
    static const struct {
        double run_s;
        int parallel;
        bool probe;
        int64_t sizes[6];
    } cases[] = {
        /* 10 s of 0.25; 0.375; 0.4375; 0.4672 of shards of 26, 22, 21; then 0.48 */
        {0.25, 0, false, {40, 26, 22, 21, 20, 20}},
        {0.0, 0, true, {1, 25, 22, 21, 20, 20}},
        /* a quarter of what is left: 200, 160, 134, 112, 91 */
        {0.25, 2, false, {40, 26, 22, 21, 20, 18}},
    };
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        timed_executor timed = {.f = f};
        bst_executor executor = {.self = &timed,
                                 .room = timed_room,
                                 .start = timed_start,
                                 .poll = timed_poll,
                                 .cancel = idle_cancel};
        const bst_driver_options options = {.out = f->folder,
                                            .kind = &fake_kind,
                                            .shard_s = 10.0,
                                            .run_s = cases[c].run_s,
                                            .parallel = cases[c].parallel,
                                            .probe = cases[c].probe};
        forget_rows(f);
        bst_results_free(&f->results);
        bst_assert_ok(&f->ctx, bst_results_create(&f->ctx, &f->study, &fake_kind, &f->results));
        bst_assert_ok(&f->ctx,
                      bst_driver_run(&f->ctx, &f->results, &executor, &options, &f->outcome));
        assert_int_equal(f->outcome.done, RUNS);
        assert_memory_equal(timed.sizes, cases[c].sizes, sizeof cases[c].sizes);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_same_tables, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_deadly_run, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_no_room, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_wrong_shards, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_shards_that_gain_nothing, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_shards_by_time, set_up, tear_down),
    };
    signal(SIGPIPE, SIG_IGN);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
