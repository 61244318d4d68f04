/* Files of shards: what is written is read, the first one counts, damage is noticed. */
#include "sim/studies/results.h"
#include "sim/studies/shard_run.h"
#include "tests/studies/fake_kind.h"

typedef struct fixture {
    char folder[BST_TEST_PATH];
    bst_ctx ctx;
    bst_study study;
} fixture;

static int set_up(void **state) {
    fixture *f = calloc(1, sizeof *f);
    char path[512];
    fixture_folder(f->folder);
    snprintf(path, sizeof path, "%s/shards", f->folder);
    assert_int_equal(mkdir(path, 0777), 0);
    bst_assert_ok(&f->ctx, fixture_open(&f->ctx, f->folder,
                                        "\"replicates\": 20, \"dispersions\": [{\"path\": \"/a\", "
                                        "\"from\": 0, \"to\": 1}]",
                                        &f->study));
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

static void execute(fixture *f, int64_t first, int64_t count, bst_study_shard_news *news) {
    bst_shard_worker worker = {.study = &f->study, .kind = &fake_kind, .out = f->folder};
    bst_study_shard_job job = {.first = first, .count = count};
    bst_status status = bst_shard_execute(&f->ctx, &worker, &job, NULL, NULL, news);
    assert_int_equal(status == BST_OK, news->text[0] == '\0');
    bst_shard_worker_close(&worker);
}

static void load(fixture *f, bst_results *r) {
    bst_assert_ok(&f->ctx, bst_results_create(&f->ctx, &f->study, &fake_kind, r));
    bst_assert_ok(&f->ctx, bst_results_load_folder(&f->ctx, r, f->folder, 0, 20, true));
}

static void touch(const fixture *f, const char *name) {
    fixture_write(f->folder, name, "");
}

/* Numbers come back bit by bit, failures with their text; what overlaps counts once. */
static void test_round_trip(void **state) {
    fixture *f = *state;
    bst_results r;
    bst_study_shard_news news;
    touch(f, "own-7");
    execute(f, 0, 12, &news);
    assert_int_equal(news.runs_done, 12);
    assert_int_equal(news.runs_failed, 1);
    execute(f, 5, 9, &news);
    load(f, &r);
    assert_int_equal(r.done, 14);
    assert_int_equal(r.failed, 1);
    assert_int_equal(r.doubled, 7);
    assert_int_equal(r.differing, 0);
    bst_results_sort(&r);
    assert_string_equal(bst_results_error(&r, 7), "diverged\nat once");
    assert_null(bst_results_error(&r, 6));
    assert_int_equal(r.part_count, 13);
    for (int64_t run = 0; run < 14; run++) {
        bst_study_value v;
        bst_study_place place = bst_study_place_of(&f->study, run);
        bst_study_values(&f->study, &place, &v);
        if (run == 7) {
            assert_int_equal(r.state[run], BST_ROW_FAILED);
            assert_true(isnan(r.metrics[3 * run]));
            continue;
        }
        assert_int_equal(r.state[run], BST_ROW_DONE);
        assert_true(r.metrics[3 * run] == v.number / 3.0);
        assert_int_equal(isnan(r.metrics[3 * run + 2]), run % 5 == 0);
    }
    assert_int_equal(r.state[14], BST_ROW_MISSING);
    bst_results_free(&r);
}

/* What a shard had done before it could not go on is kept. */
static void test_fault_of_the_place(void **state) {
    fixture *f = *state;
    bst_results r;
    bst_study_shard_news news;
    touch(f, "io-4");
    execute(f, 0, 10, &news);
    assert_int_equal(news.runs_done, 4);
    assert_string_equal(news.text, "run 4: no room");
    load(f, &r);
    assert_int_equal(r.done, 4);
    bst_results_free(&r);
}

static void first_file(const fixture *f, char *path, size_t bytes) {
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_study_shard_path(&ctx, f->folder, 0, 5, path, bytes));
}

/* A name that is taken stays as it is. */
static void test_first_wins(void **state) {
    fixture *f = *state;
    char path[512];
    bst_study_shard_news news;
    struct stat before, after;
    execute(f, 0, 5, &news);
    first_file(f, path, sizeof path);
    assert_int_equal(stat(path, &before), 0);
    execute(f, 0, 5, &news);
    assert_int_equal(news.runs_done, 5);
    assert_int_equal(stat(path, &after), 0);
    assert_int_equal(before.st_ino, after.st_ino);
}

/* Cut anywhere, or with any byte changed, a file gives nothing, and is removed. */
static void test_damage(void **state) {
    fixture *f = *state;
    char path[512], text[8192];
    bst_results r;
    bst_study_shard_news news;
    execute(f, 0, 5, &news);
    first_file(f, path, sizeof path);
    FILE *file = fopen(path, "r");
    size_t bytes = fread(text, 1, sizeof text - 1, file);
    fclose(file);
    assert_in_range(bytes, 200, sizeof text - 2);
    for (size_t at = 0; at < bytes; at += bytes / 40) {
        for (int cut = 0; cut < 2; cut++) {
            file = fopen(path, "w");
            char kept = text[at];
            text[at] = (char)(kept ^ 1);
            assert_true(fwrite(text, 1, cut ? at : bytes, file) == (cut ? at : bytes));
            fclose(file);
            text[at] = kept;
            load(f, &r);
            assert_int_equal(r.done, 0);
            assert_int_equal(access(path, F_OK), -1);
            bst_results_free(&r);
        }
    }
}

/* Puts `text` in place of `old` and a right checksum (FNV-1a, 64 bits) at the end. */
static void rewrite(const char *path, const char *old, const char *text) {
    char before[8192], after[8192];
    FILE *file = fopen(path, "r");
    before[fread(before, 1, sizeof before - 1, file)] = '\0';
    fclose(file);
    char *at = strstr(before, old), *end = strstr(before, "\nend ");
    assert_true(at && end);
    int count = atoi(end + 5), n;
    end[1] = '\0';
    n = snprintf(after, sizeof after, "%.*s%s%s", (int)(at - before), before, text,
                 at + strlen(old));
    uint64_t sum = UINT64_C(0xcbf29ce484222325);
    for (int i = 0; i < n; i++) {
        sum = (sum ^ (unsigned char)after[i]) * UINT64_C(0x100000001b3);
    }
    file = fopen(path, "w");
    fprintf(file, "%send %d %016llx\n", after, count, (unsigned long long)sum);
    fclose(file);
}

/* A right checksum round a row that is none: no row of the shard is taken, also not those before
 * it. */
static void test_malformed_middle(void **state) {
    static const char *const faults[][2] = {
        {"\nR 3 ", "\nR 3 x"},         /* a number that is none */
        {"\nR 3 ", "\nR 3 7 "},        /* one number too many */
        {"\nR 3 ", "\nS 1 2\nR 3 "},   /* a row of the series that is too short */
        {"\nR 3 ", "\nQ\nR 3 "},       /* a row of no kind */
        {"\nR 0 ", "\nS 1 2 3\nR 0 "}, /* a series of no run */
    };
    fixture *f = *state;
    char path[512];
    bst_results r;
    bst_study_shard_news news;
    for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
        execute(f, 0, 5, &news);
        first_file(f, path, sizeof path);
        rewrite(path, "\nR 3 ", "\nR 3 ");
        load(f, &r);
        assert_int_equal(r.done, 5); /* the checksum above is that of the format */
        bst_results_free(&r);
        rewrite(path, faults[i][0], faults[i][1]);
        load(f, &r);
        assert_int_equal(r.done, 0);
        assert_int_equal(r.part_count, 0);
        assert_int_equal(r.series_rows, 0);
        for (int run = 0; run < 5; run++) {
            assert_int_equal(r.state[run], BST_ROW_MISSING);
        }
        assert_int_equal(access(path, F_OK), -1); /* moved away */
        bst_results_free(&r);
    }
}

/* Rows of a study that has changed since are not taken for its own. */
static void test_other_study(void **state) {
    fixture *f = *state;
    bst_results r;
    bst_study_shard_news news;
    execute(f, 0, 5, &news);
    strcpy(f->study.digest, "0123456789abcdef");
    bst_assert_ok(&f->ctx, bst_results_create(&f->ctx, &f->study, &fake_kind, &r));
    assert_int_equal(bst_results_load_folder(&f->ctx, &r, f->folder, 0, 20, true), BST_ERR_STATE);
    assert_non_null(strstr(f->ctx.message, "belongs to another study"));
    bst_results_free(&r);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_round_trip, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_fault_of_the_place, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_first_wins, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_damage, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_malformed_middle, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_other_study, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
