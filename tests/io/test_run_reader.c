/* A run's folder as it is found: what became of the run, its tables by queries, its epoch, and what
 * is wrong with it. */
#include "sim/io/run_reader.h"

#include <cjson/cJSON.h>

#include "sim/io/csv.h"
#include "sim/io/manifest.h"
#include "sim/io/run_store.h"
#include "tests/io/scratch.h"

static const bst_io_column columns[] = {
    {"tick", BST_COLUMN_INT, "tick", "when"},
    {"x_px", BST_COLUMN_REAL, "px", "column"},
    {"label", BST_COLUMN_TEXT, "", "what"},
};
static const bst_io_column epochs[] = {{"epoch_utc", BST_COLUMN_TEXT, "", "epoch"}};

/* Begins a run with a table of 50 rows, one of them without values. */
static bst_run *begin(bst_ctx *ctx, const char *out, const char *epoch) {
    bst_run *run;
    bst_io_table *table;
    bst_assert_ok(ctx, bst_run_create(ctx, out, false, &run));
    bst_assert_ok(ctx, bst_io_table_create(ctx, run, "spots", "Spots.", columns, 3, &table));
    for (int i = 0; i < 49; i++) {
        const bst_io_value row[] = {bst_io_int_value(1000000000000LL + i),
                                    bst_io_real_value(0.25 * i),
                                    bst_io_text_value(i % 2 ? "odd" : "even")};
        bst_assert_ok(ctx, bst_io_table_append(ctx, table, row));
    }
    const bst_io_value nulls[] = {bst_io_null_value(BST_COLUMN_INT), bst_io_real_value(NAN),
                                  bst_io_text_value(NULL)};
    bst_assert_ok(ctx, bst_io_table_append(ctx, table, nulls));
    if (epoch) {
        const bst_io_value row[] = {bst_io_text_value(epoch)};
        bst_assert_ok(ctx, bst_io_table_create(ctx, run, "run", "Run.", epochs, 1, &table));
        bst_assert_ok(ctx, bst_io_table_append(ctx, table, row));
    }
    return run;
}

static void write_json(bst_ctx *ctx, bst_run *run, const char *name, const char *text) {
    cJSON *json = cJSON_Parse(text);
    assert_non_null(json);
    bst_assert_ok(ctx, bst_io_run_write_json(ctx, run, name, json));
    cJSON_Delete(json);
}

static void write_text(const char *folder, const char *name, const char *text) {
    char path[800];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fputs(text, f);
    fclose(f);
}

static void expect_problem(const bst_run_reader *r, const char *words) {
    const char *problem;
    for (int i = 0; (problem = bst_run_reader_problem(r, i)) != NULL; i++) {
        if (strstr(problem, words)) {
            return;
        }
    }
    fail_msg("no problem says \"%s\"; the first: %s", words, bst_run_reader_problem(r, 0));
}

static bst_run_reader *open_reader(const char *path) {
    bst_ctx ctx = {0};
    bst_run_reader *r;
    bst_assert_ok(&ctx, bst_run_reader_open(&ctx, path, &r));
    return r;
}

static void a_whole_run(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx = {0};
    char out[600], slashes[620];
    snprintf(out, sizeof out, "%s/run with %% and ?", s.folder);
    bst_run *run = begin(&ctx, out, "2022-06-16T22:10:00.500Z");
    write_json(&ctx, run, "manifest.json",
               "{\"program\": \"boresight\", \"complete\": true, \"n\": 7}");
    write_json(&ctx, run, "scenario.json", "{\"epoch_utc\": \"2001-01-01T00:00:00Z\", \"m\": 8}");
    bst_assert_ok(&ctx, bst_run_finish(&ctx, run));
    snprintf(slashes, sizeof slashes, "%s//", out);
    bst_run_reader *r = open_reader(slashes);
    assert_string_equal(bst_run_reader_folder(r), out);
    assert_int_equal(bst_run_reader_state(r), BST_RUN_COMPLETE);
    assert_null(bst_run_reader_problem(r, 0));
    assert_null(bst_run_reader_problem(r, -1));
    assert_true(bst_run_reader_has_tables(r));
    assert_int_equal(cJSON_GetObjectItem(bst_run_reader_manifest(r), "n")->valueint, 7);
    assert_int_equal(cJSON_GetObjectItem(bst_run_reader_scenario(r), "m")->valueint, 8);
    /* of the tables, not of the scenario */
    bst_time epoch;
    char text[40];
    assert_true(bst_run_reader_epoch(r, &epoch));
    bst_time_to_utc(epoch, 3, text, sizeof text);
    assert_string_equal(text, "2022-06-16T22:10:00.500Z");
    bst_io_rows *rows;
    bool more = false;
    bst_assert_ok(&ctx,
                  bst_io_rows_open(&ctx, r,
                                   "SELECT tick, x_px, label, utc(x_px) AS t FROM spots WHERE "
                                   "tick >= ?1 AND tick <= ?2 ORDER BY tick",
                                   1000000000010LL, 1000000000012LL, &rows));
    assert_int_equal(bst_io_rows_columns(rows), 4);
    assert_string_equal(bst_io_rows_column_name(rows, 0), "tick");
    assert_string_equal(bst_io_rows_column_name(rows, 3), "t");
    static const char *const when[] = {"2022-06-16T22:10:03.000000Z", "2022-06-16T22:10:03.250000Z",
                                       "2022-06-16T22:10:03.500000Z"};
    for (int i = 0; i < 3; i++) {
        bst_assert_ok(&ctx, bst_io_rows_next(&ctx, rows, &more));
        assert_true(more);
        assert_int_equal(bst_io_rows_kind(rows, 0), BST_CELL_INT);
        assert_int_equal(bst_io_rows_kind(rows, 1), BST_CELL_REAL);
        assert_int_equal(bst_io_rows_kind(rows, 2), BST_CELL_TEXT);
        assert_int_equal(bst_io_rows_int(rows, 0), 1000000000010LL + i);
        assert_true(bst_io_rows_real(rows, 1) == 0.25 * (10 + i));
        assert_string_equal(bst_io_rows_text(rows, 2), i == 1 ? "odd" : "even");
        assert_string_equal(bst_io_rows_text(rows, 3), when[i]);
    }
    bst_assert_ok(&ctx, bst_io_rows_next(&ctx, rows, &more));
    assert_false(more);
    bst_io_rows_close(rows);
    bst_assert_ok(
        &ctx, bst_io_rows_open(&ctx, r, "SELECT *, utc(tick) FROM spots WHERE tick IS NULL", 0, 0,
                               &rows));
    bst_assert_ok(&ctx, bst_io_rows_next(&ctx, rows, &more));
    assert_true(more);
    for (int c = 0; c < 4; c++) {
        assert_int_equal(bst_io_rows_kind(rows, c), BST_CELL_NULL);
        assert_true(bst_io_rows_is_null(rows, c));
    }
    assert_int_equal(bst_io_rows_int(rows, 0), 0);
    assert_true(isnan(bst_io_rows_real(rows, 1)));
    assert_string_equal(bst_io_rows_text(rows, 2), "");
    bst_io_rows_close(rows);
    bst_io_rows_close(NULL);
    assert_int_equal(
        bst_run_reader_int(r, "SELECT count(*) FROM spots WHERE tick > ?1", 1000000000009LL, -5),
        39);
    assert_int_equal(bst_run_reader_int(r, "SELECT tick FROM spots WHERE tick = ?1", 3, -5), -5);
    assert_int_equal(bst_run_reader_int(r, "SELECT max(x_px) FROM spots WHERE tick = ?1", 3, -6),
                     -6);
    assert_int_equal(bst_run_reader_int(r, "SELECT x FROM nowhere", 3, -7), -7);
    assert_int_equal(bst_io_rows_open(&ctx, r, "SELECT x FROM nowhere", 0, 0, &rows),
                     BST_ERR_FORMAT);
    assert_null(rows);
    assert_non_null(strstr(ctx.message, "run.sqlite: no such table: nowhere"));
    /* reading changes nothing */
    assert_int_equal(bst_io_rows_open(&ctx, r, "DELETE FROM spots", 0, 0, &rows), BST_OK);
    assert_int_equal(bst_io_rows_next(&ctx, rows, &more), BST_ERR_FORMAT);
    bst_io_rows_close(rows);
    char file[700], small[20];
    bst_assert_ok(&ctx, bst_run_reader_file(&ctx, r, "frames.fits", file, sizeof file));
    assert_string_equal(file + strlen(out), "/frames.fits");
    assert_int_equal(bst_run_reader_file(&ctx, r, "frames.fits", small, sizeof small),
                     BST_ERR_ARGUMENT);
    for (int i = 0; i < 20; i++) {
        bst_run_reader_note_problem(r, "number %d", i);
    }
    assert_string_equal(bst_run_reader_problem(r, 15), "number 15");
    assert_null(bst_run_reader_problem(r, 16));
    bst_run_reader_close(r);
    bst_run_reader_close(NULL);
    assert_int_equal(scratch_count(out), 3);
    scratch_remove(&s);
}

/* Running, left by a killed process, closed before its end, or killed while it closed. */
static void what_became_of_it(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx = {0};
    char out[600], partial[640];
    snprintf(out, sizeof out, "%s/run", s.folder);
    snprintf(partial, sizeof partial, "%s.partial", out);
    bst_run *run = begin(&ctx, out, NULL);
    bst_run_reader *r = open_reader(partial);
    assert_int_equal(bst_run_reader_state(r), BST_RUN_RUNNING);
    assert_string_equal(bst_run_state_name(bst_run_reader_state(r)), "still running");
    bst_time epoch;
    assert_false(bst_run_reader_epoch(r, &epoch));
    bst_run_reader_close(r);
    assert_int_equal(bst_run_reader_open(&ctx, out, &r), BST_ERR_NOT_FOUND);
    assert_non_null(strstr(ctx.message, "there is an unfinished run"));
    bst_run_abandon(run);
    r = open_reader(partial);
    assert_int_equal(bst_run_reader_state(r), BST_RUN_KILLED);
    assert_string_equal(bst_run_state_name(bst_run_reader_state(r)), "left over from a killed run");
    assert_int_equal(bst_run_reader_int(r, "SELECT count(*) FROM spots", 0, -1), 50);
    expect_problem(r, "scenario.json is missing");
    bst_run_reader_close(r);
    /* the scenario gives the epoch where the tables do not */
    write_text(partial, "scenario.json", "{\"epoch_utc\": \"2001-01-01T00:00:00Z\"}");
    write_text(partial, "manifest.json", "{\"program\": \"boresight\", \"complete\": false}");
    r = open_reader(partial);
    assert_int_equal(bst_run_reader_state(r), BST_RUN_INTERRUPTED);
    assert_string_equal(bst_run_state_name(bst_run_reader_state(r)), "interrupted");
    char text[40];
    assert_true(bst_run_reader_epoch(r, &epoch));
    bst_time_to_utc(epoch, 0, text, sizeof text);
    assert_string_equal(text, "2001-01-01T00:00:00Z");
    bst_run_reader_close(r);
    /* complete, it says, and has not got its name; then with its name and a lock without a holder
     */
    write_text(partial, "manifest.json", "{\"program\": \"boresight\", \"complete\": true}");
    r = open_reader(partial);
    assert_int_equal(bst_run_reader_state(r), BST_RUN_KILLED);
    bst_run_reader_close(r);
    assert_int_equal(rename(partial, out), 0);
    write_text(out, "lock", "");
    r = open_reader(out);
    assert_int_equal(bst_run_reader_state(r), BST_RUN_KILLED);
    bst_run_reader_close(r);
    char lock[700];
    snprintf(lock, sizeof lock, "%s/lock", out);
    assert_int_equal(remove(lock), 0);
    r = open_reader(out);
    assert_int_equal(bst_run_reader_state(r), BST_RUN_COMPLETE);
    assert_string_equal(bst_run_state_name(bst_run_reader_state(r)), "complete");
    bst_run_reader_close(r);
    scratch_remove(&s);
}

static void folders_that_are_damaged(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx = {0};
    bst_run_reader *r;
    char path[700];
    bst_io_rows *rows;
    assert_int_equal(bst_run_reader_open(&ctx, "", &r), BST_ERR_ARGUMENT);
    assert_int_equal(bst_run_reader_open(&ctx, s.folder, &r), BST_ERR_FORMAT);
    assert_non_null(strstr(ctx.message, "holds neither manifest.json nor run.sqlite"));
    write_text(s.folder, "manifest.json", "{\"program\": \"another\"}");
    assert_int_equal(bst_run_reader_open(&ctx, s.folder, &r), BST_ERR_FORMAT);
    assert_non_null(strstr(ctx.message, "manifest.json is not one of boresight"));
    snprintf(path, sizeof path, "%s/manifest.json", s.folder);
    assert_int_equal(bst_run_reader_open(&ctx, path, &r), BST_ERR_FORMAT);
    assert_non_null(strstr(ctx.message, "is not a folder"));
    write_text(s.folder, "run.sqlite",
               "this is no database, though it is longer than a header of "
               "a hundred bytes, which a reader has to look at first.");
    write_text(s.folder, "scenario.json", "[1, 2]");
    r = open_reader(s.folder);
    assert_int_equal(bst_run_reader_state(r), BST_RUN_KILLED);
    expect_problem(r, "manifest.json is not one of boresight");
    expect_problem(r, "scenario.json: is not a JSON object");
    expect_problem(r, "run.sqlite: cannot be read");
    assert_false(bst_run_reader_has_tables(r));
    assert_null(bst_run_reader_manifest(r));
    assert_null(bst_run_reader_scenario(r));
    assert_int_equal(bst_io_rows_open(&ctx, r, "SELECT 1", 0, 0, &rows), BST_ERR_NOT_FOUND);
    bst_run_reader_close(r);
    snprintf(path, sizeof path, "%s/run.sqlite", s.folder);
    assert_int_equal(remove(path), 0);
    write_text(s.folder, "manifest.json", "{\"program\": \"boresight\", \"complete\": true}");
    write_text(s.folder, "scenario.json", "{\"epoch_utc\": ");
    r = open_reader(s.folder);
    expect_problem(r, "run.sqlite is missing");
    expect_problem(r, "scenario.json");
    bst_run_reader_close(r);
    /* a study's folder */
    assert_int_equal(bst_run_reader_open_study(&ctx, s.folder, &r), BST_ERR_NOT_FOUND);
    assert_non_null(strstr(ctx.message, "has no study.sqlite yet"));
    write_text(s.folder, "study.sqlite",
               "this is no database either, and longer than a header of "
               "a hundred bytes, which a reader has to look at first.");
    assert_int_equal(bst_run_reader_open_study(&ctx, s.folder, &r), BST_ERR_FORMAT);
    assert_non_null(strstr(ctx.message, "study.sqlite: cannot be read"));
    scratch_remove(&s);
}

/* A query as a table of comma-separated values: names, then rows; reals that read back the same. */
static int reported;
static void tell(void *user, int64_t rows) {
    assert_int_equal(rows, 1024 * ++reported);
    *(int64_t *)user = rows;
}

static void queries_become_csv(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx = {0};
    char out[600], text[400] = "";
    snprintf(out, sizeof out, "%s/run", s.folder);
    bst_run *run = begin(&ctx, out, NULL);
    bst_assert_ok(&ctx, bst_run_finish(&ctx, run));
    bst_run_reader *r = open_reader(out);
    int64_t rows = -1, last = -1;
    bst_assert_ok(&ctx, bst_csv_write(&ctx, r,
                                      "SELECT tick, x_px / 3.0 AS third, label FROM spots WHERE "
                                      "tick IS NULL OR tick < 1000000000002 ORDER BY tick",
                                      scratch_path(&s, "a.csv"), tell, &last, &rows));
    assert_int_equal(rows, 3);
    assert_int_equal(last, -1); /* too few to tell */
    FILE *f = fopen(scratch_path(&s, "a.csv"), "rb");
    assert_non_null(f);
    assert_true(fread(text, 1, sizeof text - 1, f) > 0);
    fclose(f);
    /* 0.25 / 3 to 17 digits, by Python's repr of 17 */
    assert_string_equal(text,
                        "tick,third,label\r\n,,\r\n1000000000000,0,even\r\n"
                        "1000000000001,0.083333333333333329,odd\r\n");
    bst_assert_ok(&ctx, bst_csv_write(&ctx, r, "SELECT a.tick FROM spots a, spots b",
                                      scratch_path(&s, "b.csv"), tell, &last, &rows));
    assert_int_equal(rows, 2500);
    assert_int_equal(last, 2048);
    assert_int_equal(reported, 2);
    assert_int_equal(bst_csv_write(&ctx, r, "SELECT x FROM nowhere", scratch_path(&s, "c.csv"),
                                   NULL, NULL, NULL),
                     BST_ERR_FORMAT);
    assert_false(scratch_has(scratch_path(&s, "c.csv")));
    assert_int_equal(bst_csv_write(&ctx, r, "SELECT 1", "/nowhere/at/all.csv", NULL, NULL, NULL),
                     BST_ERR_IO);
    bst_run_reader_close(r);
    scratch_remove(&s);
}

/* A product of the table with itself: 50^3 rows. */
static void long_queries_end(void **state) {
    (void)state;
    static const char product[] =
        "SELECT count(*) FROM spots a, spots b, spots c WHERE a.tick > b.tick + c.tick";
    scratch s;
    scratch_make(&s);
    bst_ctx ctx = {0};
    char out[1100];
    snprintf(out, sizeof out, "%s", scratch_path(&s, "run"));
    bst_assert_ok(&ctx, bst_run_finish(&ctx, begin(&ctx, out, NULL)));
    bst_run_reader *r = open_reader(out);
    bst_io_rows *rows;
    bool more;
    bst_run_reader_allow(r, 100000);
    bst_assert_ok(&ctx, bst_io_rows_open(&ctx, r, product, 0, 0, &rows));
    assert_int_equal(bst_io_rows_next(&ctx, rows, &more), BST_ERR_FORMAT);
    assert_non_null(strstr(ctx.message, "a query takes too long"));
    bst_io_rows_close(rows);
    /* what is left counts for all queries until the next call */
    assert_int_equal(bst_run_reader_int(r, product, 0, -7), -7);
    assert_int_equal(bst_run_reader_int(r, "SELECT count(*) FROM spots", 0, -7), 50);
    bst_run_reader_allow(r, 0);
    assert_int_equal(bst_run_reader_int(r, product, 0, -7), 0);
    bst_run_reader_close(r);
    scratch_remove(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_whole_run),
        cmocka_unit_test(what_became_of_it),
        cmocka_unit_test(folders_that_are_damaged),
        cmocka_unit_test(long_queries_end),
        cmocka_unit_test(queries_become_csv),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
