/* A run's folder with tables that a test writes row by row, as its recorder would. */
#ifndef BST_TESTS_REPORT_RUN_TABLES_H
#define BST_TESTS_REPORT_RUN_TABLES_H

#include <sqlite3.h>
#include <stdarg.h>

#include "sim/io/run_reader.h"
#include "tests/io/scratch.h"

typedef struct run_tables {
    scratch place;
    sqlite3 *db;
    bst_run_reader *run;
} run_tables;

/* Runs SQL; %s and numbers as of printf. */
static inline void run_tables_sql(run_tables *t, const char *format, ...) BST_PRINTF(2, 3);
static inline void run_tables_sql(run_tables *t, const char *format, ...) {
    char sql[4000], *message = NULL;
    va_list arguments;
    va_start(arguments, format);
    int n = vsnprintf(sql, sizeof sql, format, arguments);
    va_end(arguments);
    assert_true(n > 0 && n < (int)sizeof sql);
    if (sqlite3_exec(t->db, sql, NULL, NULL, &message) != SQLITE_OK) {
        fail_msg("%s: %s", sql, message);
    }
}

/* Makes an empty folder with a database of this name. */
static inline void run_tables_begin(run_tables *t, const char *database) {
    *t = (run_tables){.db = NULL};
    scratch_make(&t->place);
    assert_int_equal(sqlite3_open(scratch_path(&t->place, database), &t->db), SQLITE_OK);
    run_tables_sql(t, "PRAGMA synchronous=OFF; PRAGMA user_version=1; BEGIN");
}

static inline void run_tables_file(run_tables *t, const char *name, const char *text) {
    FILE *file = fopen(scratch_path(&t->place, name), "w");
    assert_non_null(file);
    fputs(text, file);
    assert_int_equal(fclose(file), 0);
}

static inline void run_tables_close(run_tables *t) {
    run_tables_sql(t, "COMMIT");
    assert_int_equal(sqlite3_close(t->db), SQLITE_OK);
}

/* Closes the tables and opens the folder as that of a run. */
static inline bst_run_reader *run_tables_open(run_tables *t) {
    bst_ctx ctx = {0};
    run_tables_close(t);
    bst_assert_ok(&ctx, bst_run_reader_open(&ctx, t->place.folder, &t->run));
    return t->run;
}

static inline void run_tables_end(run_tables *t) {
    bst_run_reader_close(t->run);
    scratch_remove(&t->place);
}

#endif
