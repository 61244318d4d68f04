/* The run's folder, its tables and atomic files. */
#include "sim/io/run_store.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <sqlite3.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include "sim/io/manifest.h"
#include "tests/io/scratch.h"

static const bst_io_column columns[] = {
    {"tick", BST_COLUMN_INT, "tick", "when"},
    {"x_px", BST_COLUMN_REAL, "px", "column"},
    {"label", BST_COLUMN_TEXT, "", "what"},
};

static int logged;

static void count_log(void *user, bst_log_level level, const char *message) {
    (void)user;
    (void)message;
    logged += level == BST_LOG_WARNING;
}

/* Renaming to this name, or from a name that ends so, fails; NULL: none does. */
static const char *no_name, *no_ending;

int __real_rename(const char *from, const char *to);
int __wrap_rename(const char *from, const char *to);
int __wrap_rename(const char *from, const char *to) {
    size_t length = strlen(from), tail = no_ending ? strlen(no_ending) : 0;
    if ((no_name && strcmp(to, no_name) == 0) ||
        (tail && length > tail && strcmp(from + length - tail, no_ending) == 0)) {
        errno = EIO;
        return -1;
    }
    return __real_rename(from, to);
}

/* The only value of a query on a database file, as text in `out`. */
static void query(const char *path, const char *sql, char *out, size_t bytes) {
    sqlite3 *db;
    sqlite3_stmt *statement;
    assert_int_equal(sqlite3_open_v2(path, &db, SQLITE_OPEN_READWRITE, NULL), SQLITE_OK);
    assert_int_equal(sqlite3_prepare_v2(db, sql, -1, &statement, NULL), SQLITE_OK);
    assert_int_equal(sqlite3_step(statement), SQLITE_ROW);
    const unsigned char *text = sqlite3_column_text(statement, 0);
    snprintf(out, bytes, "%s", text ? (const char *)text : "NULL");
    sqlite3_finalize(statement);
    sqlite3_close(db);
}

static void add_rows(bst_ctx *ctx, bst_io_table *table, int count) {
    for (int i = 0; i < count; i++) {
        const bst_io_value row[] = {bst_io_int_value(i), bst_io_real_value(0.1 * i),
                                    bst_io_text_value("a 'b'")};
        bst_assert_ok(ctx, bst_io_table_append(ctx, table, row));
    }
}

static void test_finished_run(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    char out[600], partial[640], text[256];
    snprintf(out, sizeof out, "%s/deep/er/run", s.folder);
    snprintf(partial, sizeof partial, "%s.partial", out);
    bst_run *run;
    bst_assert_ok(&ctx, bst_run_create(&ctx, out, false, &run));
    assert_true(scratch_has(partial));
    assert_false(scratch_has(out));
    assert_string_equal(bst_run_folder(run), partial);
    bst_io_table *table;
    bst_assert_ok(&ctx, bst_io_table_create(&ctx, run, "spots", "Spots.", columns, 3, &table));
    add_rows(&ctx, table, 1000);
    const bst_io_value nulls[] = {bst_io_null_value(BST_COLUMN_INT), bst_io_real_value(NAN),
                                  bst_io_text_value(NULL)};
    bst_assert_ok(&ctx, bst_io_table_append(&ctx, table, nulls));
    const bst_io_value infinite[] = {bst_io_null_value(BST_COLUMN_INT),
                                     bst_io_real_value(-INFINITY), bst_io_text_value(NULL)};
    bst_assert_ok(&ctx, bst_io_table_append(&ctx, table, infinite));
    cJSON *json = cJSON_CreateObject();
    cJSON_AddNumberToObject(json, "tenth", 0.1);
    cJSON_AddNumberToObject(json, "third", 1.0 / 3.0);
    bst_assert_ok(&ctx, bst_io_run_write_json(&ctx, run, "manifest.json", json));
    cJSON_Delete(json);
    bst_assert_ok(&ctx, bst_run_finish(&ctx, run));
    assert_false(scratch_has(partial));
    assert_int_equal(scratch_count(out), 2); /* run.sqlite and manifest.json, nothing else */

    char db[700], manifest[700];
    snprintf(db, sizeof db, "%s/run.sqlite", out);
    query(db, "SELECT count(*) FROM spots", text, sizeof text);
    assert_string_equal(text, "1002");
    query(db, "SELECT count(*) FROM spots WHERE tick = 7 AND x_px = 0.1 * 7 AND label = 'a ''b'''",
          text, sizeof text);
    assert_string_equal(text, "1");
    query(db, "SELECT count(*) FROM spots WHERE tick IS NULL AND x_px IS NULL AND label IS NULL",
          text, sizeof text);
    assert_string_equal(text, "2");
    query(db, "SELECT unit || '/' || type || '/' || doc FROM columns WHERE \"column\" = 'x_px'",
          text, sizeof text);
    assert_string_equal(text, "px/REAL/column");
    query(db, "PRAGMA journal_mode", text, sizeof text);
    assert_string_equal(text, "delete");
    query(db, "PRAGMA integrity_check", text, sizeof text);
    assert_string_equal(text, "ok");

    snprintf(manifest, sizeof manifest, "%s/manifest.json", out);
    char content[256];
    FILE *f = fopen(manifest, "r");
    size_t n = fread(content, 1, sizeof content - 1, f);
    fclose(f);
    content[n] = '\0';
    assert_int_equal(content[n - 1], '\n');
    cJSON *back = cJSON_Parse(content);
    assert_true(cJSON_GetObjectItem(back, "tenth")->valuedouble == 0.1);
    assert_true(cJSON_GetObjectItem(back, "third")->valuedouble == 1.0 / 3.0);
    cJSON_Delete(back);
    scratch_remove(&s);
}

static void write_file(const char *path, const char *text) {
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fputs(text, f);
    fclose(f);
}

/* A program that has the database open at the end of the run, as a viewer does, does not fail the
 * run: nothing is lost, the journal stays. */
static void test_database_open_elsewhere(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, count_log, NULL, BST_LOG_INFO);
    char out[600], path[700], text[64];
    snprintf(out, sizeof out, "%s/run", s.folder);
    bst_run *run;
    bst_io_table *table;
    bst_assert_ok(&ctx, bst_run_create(&ctx, out, false, &run));
    bst_assert_ok(&ctx, bst_io_table_create(&ctx, run, "spots", "Spots.", columns, 3, &table));
    add_rows(&ctx, table, 500);
    snprintf(path, sizeof path, "%s/run.sqlite", bst_run_folder(run));
    sqlite3 *reader;
    assert_int_equal(sqlite3_open_v2(path, &reader, SQLITE_OPEN_READONLY, NULL), SQLITE_OK);
    assert_int_equal(sqlite3_exec(reader, "SELECT * FROM tables", NULL, NULL, NULL), SQLITE_OK);
    cJSON *json = cJSON_CreateObject();
    bst_assert_ok(&ctx, bst_io_run_write_json(&ctx, run, "manifest.json", json));
    cJSON_Delete(json);
    logged = 0;
    bst_assert_ok(&ctx, bst_run_finish(&ctx, run));
    assert_int_equal(logged, 1);
    sqlite3_close(reader);
    snprintf(path, sizeof path, "%s/run.sqlite", out);
    query(path, "SELECT count(*) FROM spots", text, sizeof text);
    assert_string_equal(text, "500");
    scratch_remove(&s);
}

static void test_refusals(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, count_log, NULL, BST_LOG_INFO);
    logged = 0;
    bst_run *run, *second;
    static const char *const bad[] = {"", "/", ".", "..", "a/..", "a/.", "a/../", ".//"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_int_equal(bst_run_create(&ctx, bad[i], false, &run), BST_ERR_ARGUMENT);
    }
    /* a file where a parent folder should be */
    write_file(scratch_path(&s, "file"), "x");
    assert_int_equal(bst_run_create(&ctx, scratch_path(&s, "file/run"), false, &run), BST_ERR_IO);
    assert_non_null(strstr(ctx.message, "file"));
    assert_non_null(strstr(ctx.message, strerror(ENOTDIR)));

    char out[600];
    snprintf(out, sizeof out, "%s/run", s.folder);
    bst_assert_ok(&ctx, bst_run_create(&ctx, out, false, &run));
    /* a living run keeps its name, in this process too */
    assert_int_equal(bst_run_create(&ctx, out, false, &second), BST_ERR_IO);
    assert_non_null(strstr(ctx.message, "another run is writing it"));
    bst_assert_ok(&ctx, bst_run_finish(&ctx, run));
    assert_int_equal(bst_run_create(&ctx, out, false, &run), BST_ERR_IO);
    assert_non_null(strstr(ctx.message, "exists already"));
    assert_int_equal(scratch_count(s.folder), 2); /* no .partial left */

    /* overwriting: the old run stays until the new one is whole, and what is not its own stays */
    write_file(scratch_path(&s, "run/frames.fits"), "x");
    write_file(scratch_path(&s, "run/notes"), "x");
    bst_assert_ok(&ctx, bst_run_create(&ctx, out, true, &run));
    assert_true(scratch_has(scratch_path(&s, "run/frames.fits")));
    bst_assert_ok(&ctx, bst_run_finish(&ctx, run));
    assert_false(scratch_has(scratch_path(&s, "run/frames.fits")));
    assert_true(scratch_has(scratch_path(&s, "run/notes")));
    assert_true(scratch_has(scratch_path(&s, "run/run.sqlite")));

    /* ... but never a folder that is not a run's */
    assert_int_equal(mkdir(scratch_path(&s, "mine"), 0755), 0);
    write_file(scratch_path(&s, "mine/thesis.tex"), "x");
    assert_int_equal(bst_run_create(&ctx, scratch_path(&s, "mine"), true, &run), BST_ERR_IO);
    assert_non_null(strstr(ctx.message, "not the folder of a run"));
    /* ... whatever a run's files share names with */
    write_file(scratch_path(&s, "mine/manifest.json"), "{}");
    write_file(scratch_path(&s, "mine/lock"), "");
    assert_int_equal(bst_run_create(&ctx, scratch_path(&s, "mine"), true, &run), BST_ERR_IO);
    assert_non_null(strstr(ctx.message, "not the folder of a run"));
    assert_true(scratch_has(scratch_path(&s, "mine/thesis.tex")));
    assert_int_equal(mkdir(scratch_path(&s, "yours.partial"), 0755), 0);
    write_file(scratch_path(&s, "yours.partial/manifest.json"), "{}");
    write_file(scratch_path(&s, "yours.partial/thesis.tex"), "x");
    assert_int_equal(bst_run_create(&ctx, scratch_path(&s, "yours"), true, &run), BST_ERR_IO);
    assert_true(scratch_has(scratch_path(&s, "yours.partial/thesis.tex")));
    assert_int_equal(logged, 0);

    /* a folder that takes nothing; root may write anywhere */
    if (geteuid() != 0) {
        assert_int_equal(mkdir(scratch_path(&s, "locked"), 0555), 0);
        assert_int_equal(bst_run_create(&ctx, scratch_path(&s, "locked/run"), false, &run),
                         BST_ERR_IO);
        assert_non_null(strstr(ctx.message, strerror(EACCES)));
    }
    scratch_remove(&s);
}

/* Names that only look like this folder or the one above. */
static void test_names_of_dots(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    static const char *const good[] = {"..a", ".a", "a..", "..."};
    for (size_t i = 0; i < sizeof good / sizeof *good; i++) {
        bst_run *run;
        bst_assert_ok(&ctx, bst_run_create(&ctx, scratch_path(&s, good[i]), false, &run));
        bst_assert_ok(&ctx, bst_run_finish(&ctx, run));
        assert_true(scratch_has(scratch_path(&s, good[i])));
    }
    scratch_remove(&s);
}

/* The name is taken while a run is on its way: the first one wins. */
static void test_name_taken_meanwhile(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    bst_run *run;
    char out[600];
    snprintf(out, sizeof out, "%s/run", s.folder);
    bst_assert_ok(&ctx, bst_run_create(&ctx, out, false, &run));
    assert_int_equal(mkdir(out, 0755), 0);
    write_file(scratch_path(&s, "run/manifest.json"), "{}");
    assert_int_equal(bst_run_finish(&ctx, run), BST_ERR_IO);
    assert_non_null(strstr(ctx.message, "took this name"));
    assert_true(scratch_has(scratch_path(&s, "run.partial/run.sqlite")));
    assert_int_equal(scratch_count(out), 1);
    scratch_remove(&s);
}

/* A finished run that cannot take its name stays beside the former one, which keeps its own; where
 * that cannot be renamed back, a warning says where it is. */
static void test_former_run_stays(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, count_log, NULL, BST_LOG_INFO);
    bst_run *run;
    char out[600];
    snprintf(out, sizeof out, "%s/run", s.folder);
    bst_assert_ok(&ctx, bst_run_create(&ctx, out, false, &run));
    bst_assert_ok(&ctx, bst_run_finish(&ctx, run));
    write_file(scratch_path(&s, "run/former"), "x");
    for (int back = 1; back >= 0; back--) {
        logged = 0;
        bst_assert_ok(&ctx, bst_run_create(&ctx, out, true, &run));
        int before = logged;
        no_ending = back ? ".partial" : NULL;
        no_name = back ? NULL : out;
        assert_int_equal(bst_run_finish(&ctx, run), BST_ERR_IO);
        no_name = no_ending = NULL;
        assert_non_null(strstr(ctx.message, "cannot name the finished run"));
        assert_true(scratch_has(scratch_path(&s, "run.partial/run.sqlite")));
        assert_int_equal(scratch_has(scratch_path(&s, "run/former")), back);
        assert_int_equal(scratch_count(s.folder), 2); /* under either name */
        assert_int_equal(logged - before, !back);
    }
    scratch_remove(&s);
}

/* A killed run: what was committed can be read; the next run says that it replaces it. */
static void test_killed_run(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, count_log, NULL, BST_LOG_INFO);
    char out[600], text[64];
    snprintf(out, sizeof out, "%s/run", s.folder);
    pid_t child = fork();
    if (child == 0) {
        bst_run *run;
        bst_io_table *table;
        if (bst_run_create(&ctx, out, false, &run) != BST_OK ||
            bst_io_table_create(&ctx, run, "spots", "Spots.", columns, 3, &table) != BST_OK) {
            _exit(1);
        }
        add_rows(&ctx, table, 60000); /* one full batch of 50,000 and a part of the next */
        raise(SIGKILL);
    }
    int status;
    waitpid(child, &status, 0);
    assert_true(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
    assert_false(scratch_has(out));
    query(scratch_path(&s, "run.partial/run.sqlite"), "SELECT count(*) FROM spots", text,
          sizeof text);
    /* batches end after 50,000 rows or 2 s: on a slow machine more may be there */
    long kept = strtol(text, NULL, 10);
    assert_true(kept >= 49990 && kept <= 60000);
    logged = 0;
    bst_run *run;
    bst_assert_ok(&ctx, bst_run_create(&ctx, out, false, &run));
    assert_int_equal(logged, 1);
    bst_run_abandon(run);
    assert_true(scratch_has(scratch_path(&s, "run.partial/run.sqlite")));
    assert_false(scratch_has(scratch_path(&s, "run.partial/run.sqlite-wal")));
    assert_int_equal(scratch_count(s.folder), 1);
    scratch_remove(&s);
}

static void test_table_arguments(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    bst_run *run;
    bst_io_table *table;
    bst_assert_ok(&ctx, bst_run_create(&ctx, scratch_path(&s, "run"), false, &run));
    assert_int_equal(bst_io_table_create(&ctx, run, "a\"b", "", columns, 3, &table),
                     BST_ERR_ARGUMENT);
    assert_int_equal(bst_io_table_create(&ctx, run, "a", "", columns, 0, &table), BST_ERR_ARGUMENT);
    const bst_io_column quoted = {"x\"", BST_COLUMN_INT, "", ""};
    assert_int_equal(bst_io_table_create(&ctx, run, "a", "", &quoted, 1, &table), BST_ERR_ARGUMENT);
    bst_assert_ok(&ctx, bst_io_table_create(&ctx, run, "spots", "", columns, 3, &table));
    const bst_io_value wrong[] = {bst_io_real_value(1.0), bst_io_real_value(1.0),
                                  bst_io_text_value("a")};
    assert_int_equal(bst_io_table_append(&ctx, table, wrong), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "spots"));
    assert_int_equal(bst_io_table_create(&ctx, run, "spots", "", columns, 3, &table), BST_ERR_IO);
    bst_run_abandon(run);
    scratch_remove(&s);
}

/* A disk that is full, played by a limit on the size of files: every write says file and reason. */
static void test_full_disk(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    pid_t child = fork();
    if (child == 0) {
        bst_ctx ctx;
        bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
        signal(SIGXFSZ, SIG_IGN);
        const struct rlimit limit = {200000, 200000};
        bst_run *run;
        bst_io_table *table;
        if (bst_run_create(&ctx, scratch_path(&s, "run"), false, &run) != BST_OK ||
            bst_io_table_create(&ctx, run, "spots", "Spots.", columns, 3, &table) != BST_OK ||
            bst_run_commit(&ctx, run) != BST_OK || setrlimit(RLIMIT_FSIZE, &limit) != 0) {
            _exit(1);
        }
        bst_status status = BST_OK;
        for (int i = 0; i < 400000 && status == BST_OK; i++) {
            const bst_io_value row[] = {bst_io_int_value(i), bst_io_real_value(i),
                                        bst_io_text_value("text")};
            status = bst_io_table_append(&ctx, table, row);
        }
        if (status != BST_ERR_IO || !strstr(ctx.message, "run.sqlite")) {
            _exit(2);
        }
        char *big = calloc(1, 300000);
        status =
            big ? bst_io_write_file_atomic(&ctx, scratch_path(&s, "big"), big, 300000) : BST_OK;
        free(big);
        if (status != BST_ERR_IO || !strstr(ctx.message, "big") ||
            !strstr(ctx.message, strerror(EFBIG))) {
            _exit(3);
        }
        bst_run_abandon(run);
        _exit(0);
    }
    int status;
    waitpid(child, &status, 0);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
    assert_int_equal(scratch_count(s.folder), 1); /* run.partial; no draft of `big` */
    scratch_remove(&s);
}

static void test_atomic_file(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_INFO);
    bst_assert_ok(&ctx, bst_io_write_file_atomic(&ctx, scratch_path(&s, "a"), "one", 3));
    bst_assert_ok(&ctx, bst_io_write_file_atomic(&ctx, scratch_path(&s, "a"), "four", 4));
    char text[8] = "";
    FILE *f = fopen(scratch_path(&s, "a"), "r");
    assert_int_equal(fread(text, 1, sizeof text, f), 4);
    fclose(f);
    assert_memory_equal(text, "four", 4);
    assert_int_equal(bst_io_write_file_atomic(&ctx, scratch_path(&s, "no/a"), "x", 1), BST_ERR_IO);
    assert_non_null(strstr(ctx.message, "no/a"));
    assert_int_equal(scratch_count(s.folder), 1);
    scratch_remove(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_finished_run),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_database_open_elsewhere),
        cmocka_unit_test(test_name_taken_meanwhile),
        cmocka_unit_test(test_former_run_stays),
        cmocka_unit_test(test_killed_run),
        cmocka_unit_test(test_table_arguments),
        cmocka_unit_test(test_full_disk),
        cmocka_unit_test(test_atomic_file),
        cmocka_unit_test(test_names_of_dots),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
