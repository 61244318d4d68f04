#include <assert.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/io/run_internal.h"

#define BATCH_ROWS 50000
#define BATCH_SECONDS 2.0
#define SQL_BYTES 8192
#define TABLES_MOST 256
/* The end of a run waits up to 2 s for other programs that read its database. */
#define MERGE_TRIALS 40
#define MERGE_PAUSE_NS 50000000

static bst_status fail_sql(bst_ctx *ctx, const bst_run *run, const char *what) {
    int last = errno, code = run->db ? sqlite3_errcode(run->db) & 0xff : 0;
    int error = run->db ? sqlite3_system_errno(run->db) : 0;
    if (error == 0 && (code == SQLITE_IOERR || code == SQLITE_FULL)) {
        error = last; /* SQLite does not always keep errno; it was cleared before the call */
    }
    return bst_fail(ctx, BST_ERR_IO, "%s/%s: %s: %s%s%s%s", run->folder, BST_RUN_DATABASE, what,
                    run->db ? sqlite3_errmsg(run->db) : "out of memory", error ? " (" : "",
                    error ? strerror(error) : "", error ? ")" : "");
}

static bst_status execute(bst_ctx *ctx, bst_run *run, const char *sql, const char *what) {
    errno = 0;
    return sqlite3_exec(run->db, sql, NULL, NULL, NULL) == SQLITE_OK ? BST_OK
                                                                     : fail_sql(ctx, run, what);
}

/* Executes a prepared statement that returns no rows. */
static bst_status step_once(bst_ctx *ctx, bst_run *run, sqlite3_stmt *statement, const char *what) {
    errno = 0;
    bst_status status = sqlite3_step(statement) == SQLITE_DONE ? BST_OK : fail_sql(ctx, run, what);
    sqlite3_reset(statement);
    return status;
}

bst_status bst_run_open_database(bst_ctx *ctx, bst_run *run) {
    char path[BST_RUN_PATH_BYTES + 32];
    /* SQLite may interpret a name that begins with "file:" as a URI */
    snprintf(path, sizeof path, "%s%s/%s", run->folder[0] == '/' ? "" : "./", run->folder,
             BST_RUN_DATABASE);
    int flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX;
    flags |= run->reopened ? 0 : SQLITE_OPEN_CREATE;
    bst_status status = BST_OK;
    if (sqlite3_open_v2(path, &run->db, flags, NULL) != SQLITE_OK) {
        status = fail_sql(ctx, run, run->reopened ? "cannot be opened" : "cannot be made");
    }
    if (status == BST_OK) {
        /* rows are only appended: 128 KiB of cache suffice; the default grows by 2 MB in a long
         * run */
        status = execute(ctx, run,
                         "PRAGMA journal_mode=WAL; PRAGMA synchronous=NORMAL;"
                         "PRAGMA cache_size=-128; PRAGMA temp_store=MEMORY;",
                         "cannot be set up");
    }
    if (status == BST_OK && !run->reopened) {
        status = execute(ctx, run,
                         "PRAGMA user_version=1;"
                         "CREATE TABLE tables (\"table\" TEXT PRIMARY KEY, doc TEXT);"
                         "CREATE TABLE columns (\"table\" TEXT, position INTEGER, \"column\" TEXT,"
                         " type TEXT, unit TEXT, doc TEXT, PRIMARY KEY (\"table\", position));",
                         "cannot be set up");
    }
    if (status == BST_OK &&
        (sqlite3_prepare_v2(run->db, "INSERT INTO tables VALUES (?, ?)", -1, &run->note_table,
                            NULL) != SQLITE_OK ||
         sqlite3_prepare_v2(run->db, "INSERT INTO columns VALUES (?, ?, ?, ?, ?, ?)", -1,
                            &run->note_column, NULL) != SQLITE_OK)) {
        status = fail_sql(ctx, run, "cannot be set up");
    }
    if (status != BST_OK) {
        sqlite3_finalize(run->note_table);
        sqlite3_finalize(run->note_column);
        sqlite3_close(run->db);
        run->db = NULL;
    }
    return status;
}

bst_status bst_run_commit(bst_ctx *ctx, bst_run *run) {
    if (!run->in_batch) {
        return BST_OK;
    }
    bst_status status = bst_run_check_folder(ctx, run);
    if (status == BST_OK && run->before_commit) {
        status = run->before_commit(ctx, run->before_commit_user);
    }
    if (status == BST_OK) {
        status = execute(ctx, run, "COMMIT", "cannot store the rows");
    }
    run->in_batch = false;
    if (status != BST_OK) {
        /* a failed COMMIT may leave the transaction open */
        sqlite3_exec(run->db, "ROLLBACK", NULL, NULL, NULL);
    }
    return status;
}

void bst_run_set_before_commit(bst_run *run, bst_run_before_commit before, void *user) {
    run->before_commit = before;
    run->before_commit_user = user;
}

static bst_status begin_batch(bst_ctx *ctx, bst_run *run) {
    if (run->in_batch) {
        return BST_OK;
    }
    BST_TRY(execute(ctx, run, "BEGIN", "cannot store rows"));
    run->in_batch = true;
    run->batch_rows = 0;
    clock_gettime(CLOCK_MONOTONIC, &run->batch_start);
    return BST_OK;
}

/* Merges the journal into the database. While another program has the database open, that is not
 * possible: after some time the journal stays beside it, with the same content. */
static bst_status merge_journal(bst_ctx *ctx, bst_run *run) {
    for (int trial = 0; trial < MERGE_TRIALS; trial++) {
        errno = 0;
        int code =
            sqlite3_exec(run->db, "PRAGMA wal_checkpoint(TRUNCATE); PRAGMA journal_mode=DELETE;",
                         NULL, NULL, NULL) &
            0xff;
        if (code == SQLITE_OK) {
            return BST_OK;
        }
        if (code != SQLITE_BUSY && code != SQLITE_LOCKED) {
            return fail_sql(ctx, run, "cannot be completed");
        }
        nanosleep(&(struct timespec){.tv_nsec = MERGE_PAUSE_NS}, NULL);
    }
    bst_log(ctx, BST_LOG_WARNING,
            "%s/%s: another program has it open: its journal %s-wal stays; keep both together",
            run->folder, BST_RUN_DATABASE, BST_RUN_DATABASE);
    return BST_OK;
}

bst_status bst_run_close_database(bst_ctx *ctx, bst_run *run) {
    if (!run->db) {
        return BST_OK;
    }
    bst_status status = bst_run_commit(ctx, run);
    for (bst_io_table *table = run->tables, *next; table; table = next) {
        next = table->next;
        sqlite3_finalize(table->insert);
        free(table);
    }
    run->tables = NULL;
    sqlite3_finalize(run->note_table);
    sqlite3_finalize(run->note_column);
    run->note_table = run->note_column = NULL;
    if (status == BST_OK) {
        status = merge_journal(ctx, run);
    }
    if (sqlite3_close(run->db) != SQLITE_OK && status == BST_OK) {
        status = fail_sql(ctx, run, "cannot be closed");
    }
    run->db = NULL;
    return status;
}

static bool is_name(const char *name, size_t limit) {
    size_t n = strspn(name, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_");
    return n > 0 && n < limit && name[n] == '\0';
}

static const char *type_name(bst_io_column_type type) {
    return type == BST_COLUMN_INT ? "INTEGER" : type == BST_COLUMN_REAL ? "REAL" : "TEXT";
}

/* Writes the SQL texts that create a table and insert a row. */
static bst_status write_sql(bst_ctx *ctx, const char *name, const bst_io_column *columns, int count,
                            char create[SQL_BYTES], char insert[SQL_BYTES]) {
    size_t c = (size_t)snprintf(create, SQL_BYTES, "CREATE TABLE \"%s\" (", name);
    size_t i = (size_t)snprintf(insert, SQL_BYTES, "INSERT INTO \"%s\" VALUES (", name);
    for (int k = 0; k < count; k++) {
        if (!is_name(columns[k].name, 64)) {
            return bst_fail(ctx, BST_ERR_ARGUMENT, "table %s: '%s' is not a name for a column",
                            name, columns[k].name);
        }
        const char *end = k + 1 < count ? ", " : ")";
        c += (size_t)snprintf(create + c, SQL_BYTES - c, "\"%s\" %s%s", columns[k].name,
                              type_name(columns[k].type), end);
        i += (size_t)snprintf(insert + i, SQL_BYTES - i, "?%s", end);
    }
    return BST_OK;
}

static bst_status note_columns(bst_ctx *ctx, bst_run *run, const char *name, const char *doc,
                               const bst_io_column *columns, int count) {
    sqlite3_bind_text(run->note_table, 1, name, -1, SQLITE_STATIC);
    sqlite3_bind_text(run->note_table, 2, doc, -1, SQLITE_STATIC);
    BST_TRY(step_once(ctx, run, run->note_table, name));
    for (int k = 0; k < count; k++) {
        sqlite3_stmt *note = run->note_column;
        sqlite3_bind_text(note, 1, name, -1, SQLITE_STATIC);
        sqlite3_bind_int(note, 2, k);
        sqlite3_bind_text(note, 3, columns[k].name, -1, SQLITE_STATIC);
        sqlite3_bind_text(note, 4, type_name(columns[k].type), -1, SQLITE_STATIC);
        sqlite3_bind_text(note, 5, columns[k].unit, -1, SQLITE_STATIC);
        sqlite3_bind_text(note, 6, columns[k].doc, -1, SQLITE_STATIC);
        BST_TRY(step_once(ctx, run, note, name));
    }
    return BST_OK;
}

bool bst_run_has_table(const bst_run *run, const char *name) {
    return run->db && sqlite3_table_column_metadata(run->db, NULL, name, NULL, NULL, NULL, NULL,
                                                    NULL, NULL) == SQLITE_OK;
}

bst_status bst_io_table_create(bst_ctx *ctx, bst_run *run, const char *name, const char *doc,
                               const bst_io_column *columns, int count, bst_io_table **out) {
    assert(run && name && columns && out);
    *out = NULL;
    if (!is_name(name, sizeof((bst_io_table *)0)->name) || count < 1 || count > BST_TABLE_COLUMNS) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "table '%s' with %d columns cannot be made", name,
                        count);
    }
    /* 64 names of 63 characters with quotes fit into SQL_BYTES */
    char create[SQL_BYTES], insert[SQL_BYTES];
    BST_TRY(write_sql(ctx, name, columns, count, create, insert));
    if (!run->reopened || !bst_run_has_table(run, name)) {
        BST_TRY(begin_batch(ctx, run));
        BST_TRY(execute(ctx, run, create, "cannot make a table"));
        BST_TRY(note_columns(ctx, run, name, doc, columns, count));
    }
    bst_io_table *table = calloc(1, sizeof *table);
    if (!table) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    table->run = run;
    table->columns = count;
    memcpy(table->name, name, strlen(name));
    for (int k = 0; k < count; k++) {
        table->types[k] = columns[k].type;
    }
    if (sqlite3_prepare_v3(run->db, insert, -1, SQLITE_PREPARE_PERSISTENT, &table->insert, NULL) !=
        SQLITE_OK) {
        free(table);
        return fail_sql(ctx, run, name);
    }
    table->next = run->tables;
    run->tables = table;
    *out = table;
    return BST_OK;
}

bst_status bst_io_table_append(bst_ctx *ctx, bst_io_table *table, const bst_io_value *values) {
    assert(table && values);
    bst_run *run = table->run;
    BST_TRY(begin_batch(ctx, run));
    for (int k = 0; k < table->columns; k++) {
        int code;
        if (values[k].type != table->types[k]) {
            return bst_fail(ctx, BST_ERR_ARGUMENT, "table %s: column %d takes %s", table->name,
                            k + 1, type_name(table->types[k]));
        }
        if (values[k].is_null) {
            code = sqlite3_bind_null(table->insert, k + 1);
        } else if (values[k].type == BST_COLUMN_INT) {
            code = sqlite3_bind_int64(table->insert, k + 1, values[k].as.integer);
        } else if (values[k].type == BST_COLUMN_REAL) {
            code = sqlite3_bind_double(table->insert, k + 1, values[k].as.real);
        } else {
            code = sqlite3_bind_text(table->insert, k + 1, values[k].as.text, -1, SQLITE_STATIC);
        }
        if (code != SQLITE_OK) {
            return fail_sql(ctx, run, table->name);
        }
    }
    BST_TRY(step_once(ctx, run, table->insert, "cannot store a row"));
    run->batch_rows++;
    table->rows++;
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    double age_s = (double)(now.tv_sec - run->batch_start.tv_sec) +
                   1e-9 * (double)(now.tv_nsec - run->batch_start.tv_nsec);
    return run->batch_rows >= BATCH_ROWS || age_s >= BATCH_SECONDS ? bst_run_commit(ctx, run)
                                                                   : BST_OK;
}

/* Removes the rows of a table after the saved ones, and checks that these are there. */
static bst_status cut_table(bst_ctx *ctx, bst_run *run, bst_io_table *table) {
    char sql[256];
    sqlite3_stmt *newest = NULL;
    snprintf(sql, sizeof sql, "DELETE FROM \"%s\" WHERE rowid > %lld", table->name,
             (long long)table->rows);
    BST_TRY(begin_batch(ctx, run));
    BST_TRY(execute(ctx, run, sql, "cannot remove rows"));
    snprintf(sql, sizeof sql, "SELECT max(rowid) FROM \"%s\"", table->name);
    if (sqlite3_prepare_v2(run->db, sql, -1, &newest, NULL) != SQLITE_OK ||
        sqlite3_step(newest) != SQLITE_ROW) {
        sqlite3_finalize(newest);
        return fail_sql(ctx, run, "cannot be read");
    }
    long long rows = sqlite3_column_int64(newest, 0); /* rows are only appended: numbered from 1 */
    sqlite3_finalize(newest);
    return rows == table->rows
               ? BST_OK
               : bst_fail(ctx, BST_ERR_FORMAT,
                          "%s/%s: table %s has %lld rows, the saved state needs %lld: the run "
                          "cannot go on from it; run it again from the start",
                          run->folder, BST_RUN_DATABASE, table->name, rows, (long long)table->rows);
}

/* Restores how many rows each table has. Tables that the saved run did not have yet are emptied. */
static bst_status restore_rows(bst_ctx *ctx, bst_run *run, bst_archive *archive) {
    bst_io_table *table;
    for (table = run->tables; table; table = table->next) {
        table->rows = 0;
    }
    const int64_t count = bst_archive_integer(archive, 0, 0, TABLES_MOST);
    for (int64_t i = 0; i < count; i++) {
        char name[sizeof table->name] = "";
        BST_ARCHIVE(archive, name);
        name[sizeof name - 1] = '\0';
        for (table = run->tables; table && strcmp(table->name, name) != 0; table = table->next) {
        }
        const int64_t rows = bst_archive_integer(archive, 0, 0, INT64_MAX);
        if (!table) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "%s/%s: the saved state has a table that this run does not write: the "
                            "run cannot go on from it; run it again from the start",
                            run->folder, BST_RUN_DATABASE);
        }
        table->rows = rows;
    }
    for (table = run->tables; table; table = table->next) {
        BST_TRY(cut_table(ctx, run, table));
    }
    return bst_run_commit(ctx, run);
}

bst_status bst_run_archive(bst_ctx *ctx, bst_run *run, bst_archive *archive) {
    BST_TRY(bst_run_commit(ctx, run));
    if (bst_archive_is_restoring(archive)) {
        return restore_rows(ctx, run, archive);
    }
    int64_t count = 0;
    for (const bst_io_table *table = run->tables; table; table = table->next) {
        count++;
    }
    (void)bst_archive_integer(archive, count, 0, TABLES_MOST);
    for (bst_io_table *table = run->tables; table; table = table->next) {
        BST_ARCHIVE(archive, table->name);
        (void)bst_archive_integer(archive, table->rows, 0, INT64_MAX);
    }
    /* to disk: a commit alone may be lost with the power */
    return execute(ctx, run, "PRAGMA wal_checkpoint(PASSIVE)", "cannot be flushed to disk");
}
