#include "sim/studies/table_out.h"

#include <fcntl.h>
#include <inttypes.h>
#include <sqlite3.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/core/draft.h"
#include "sim/io/csv.h"

static bst_status fail_sql(bst_ctx *ctx, const bst_tables_out *t) {
    return bst_fail(ctx, BST_ERR_IO, "%s: %s", t->draft, sqlite3_errmsg(t->db));
}

static bst_status execute(bst_ctx *ctx, bst_tables_out *t, const char *sql) {
    return sqlite3_exec(t->db, sql, NULL, NULL, NULL) == SQLITE_OK ? BST_OK : fail_sql(ctx, t);
}

bst_status bst_tables_begin(bst_ctx *ctx, const char *folder, bst_tables_out *out) {
    *out = (bst_tables_out){.db = NULL};
    int n = snprintf(out->folder, sizeof out->folder, "%s", folder);
    if (n < 0 || (size_t)n >= sizeof out->folder) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", folder);
    }
    char path[2112];
    int fd;
    snprintf(path, sizeof path, "%s/study.sqlite", folder);
    BST_TRY(bst_draft_make(ctx, path, out->draft, sizeof out->draft, &fd));
    close(fd); /* an empty file is an empty database */
    bst_status status = BST_OK;
    if (sqlite3_open(out->draft, &out->db) != SQLITE_OK) {
        status = fail_sql(ctx, out);
    }
    /* a draft without final name is useless */
    if (status == BST_OK) {
        status = execute(ctx, out,
                         "PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF;"
                         "PRAGMA page_size = 8192; BEGIN;"
                         "CREATE TABLE tables(name TEXT PRIMARY KEY, doc TEXT);"
                         "CREATE TABLE columns(tab TEXT, name TEXT, unit TEXT, doc TEXT);");
    }
    if (status != BST_OK) {
        sqlite3_close(out->db);
        unlink(out->draft);
    }
    return status;
}

static bst_status sync_file(bst_ctx *ctx, const char *path) {
    int fd = open(path, O_RDWR | O_CLOEXEC);
    bool ok = fd >= 0 && fsync(fd) == 0;
    if (fd >= 0) {
        close(fd);
    }
    return ok ? BST_OK : bst_fail(ctx, BST_ERR_IO, "%s: cannot be written", path);
}

bst_status bst_tables_end(bst_ctx *ctx, bst_tables_out *t, bst_status status) {
    char path[2112];
    snprintf(path, sizeof path, "%s/study.sqlite", t->folder);
    if (status == BST_OK) {
        status = execute(ctx, t, "COMMIT");
    }
    if (sqlite3_close(t->db) != SQLITE_OK && status == BST_OK) {
        status = bst_fail(ctx, BST_ERR_IO, "%s: cannot be closed", t->draft);
    }
    if (status == BST_OK) {
        status = sync_file(ctx, t->draft);
    }
    if (status == BST_OK && rename(t->draft, path) != 0) {
        status = bst_fail(ctx, BST_ERR_IO, "%s: cannot be put in its place", path);
    }
    if (status != BST_OK) {
        unlink(t->draft);
    }
    return status;
}

static const char *const type_names[] = {"INTEGER", "REAL", "TEXT"};

static bst_status note_columns(bst_ctx *ctx, bst_tables_out *t, const char *name, const char *doc,
                               const bst_io_column *columns, int count) {
    char *sql = sqlite3_mprintf("INSERT INTO tables VALUES(%Q, %Q)", name, doc);
    bst_status status =
        sql ? execute(ctx, t, sql) : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for tables");
    sqlite3_free(sql);
    for (int i = 0; i < count && status == BST_OK; i++) {
        sql = sqlite3_mprintf("INSERT INTO columns VALUES(%Q, %Q, %Q, %Q)", name, columns[i].name,
                              columns[i].unit, columns[i].doc);
        status =
            sql ? execute(ctx, t, sql) : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for tables");
        sqlite3_free(sql);
    }
    return status;
}

static bst_status create_table(bst_ctx *ctx, bst_table_out *out, const bst_io_column *columns) {
    sqlite3_str *create = sqlite3_str_new(NULL), *insert = sqlite3_str_new(NULL);
    sqlite3_str_appendf(create, "CREATE TABLE \"%w\"(", out->name);
    sqlite3_str_appendf(insert, "INSERT INTO \"%w\" VALUES(", out->name);
    for (int i = 0; i < out->columns; i++) {
        sqlite3_str_appendf(create, "%s\"%w\" %s", i ? ", " : "", columns[i].name,
                            type_names[columns[i].type]);
        sqlite3_str_appendf(insert, i ? ", ?" : "?");
    }
    sqlite3_str_appendf(create, ")");
    sqlite3_str_appendf(insert, ")");
    char *text = sqlite3_str_finish(create), *row = sqlite3_str_finish(insert);
    bst_status status = text && row ? execute(ctx, out->tables, text)
                                    : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for tables");
    if (status == BST_OK &&
        sqlite3_prepare_v2(out->tables->db, row, -1, &out->insert, NULL) != SQLITE_OK) {
        status = fail_sql(ctx, out->tables);
    }
    sqlite3_free(text);
    sqlite3_free(row);
    return status;
}

bst_status bst_table_begin(bst_ctx *ctx, bst_tables_out *tables, const bst_table_design *design,
                           bst_table_out *out) {
    const bst_io_column *columns = design->columns;
    int count = design->count;
    char path[2200];
    *out = (bst_table_out){.tables = tables, .columns = count};
    snprintf(out->name, sizeof out->name, "%s", design->name);
    BST_TRY(note_columns(ctx, tables, design->name, design->doc, columns, count));
    BST_TRY(create_table(ctx, out, columns));
    if (design->csv) {
        snprintf(path, sizeof path, "%s/%s.csv", tables->folder, design->name);
        bst_status status = bst_draft_open(ctx, path, &out->csv);
        if (status != BST_OK) {
            sqlite3_finalize(out->insert);
            return status;
        }
        out->with_csv = true;
        for (int i = 0; i < count; i++) {
            bst_csv_put_text(out->csv.stream, columns[i].name);
            fputs(i + 1 < count ? "," : "\r\n", out->csv.stream);
        }
    }
    return BST_OK;
}

static void put_cell(FILE *file, const bst_io_value *v) {
    if (v->is_null) {
        return;
    }
    switch (v->type) {
        case BST_COLUMN_INT:
            fprintf(file, "%" PRId64, v->as.integer);
            break;
        case BST_COLUMN_REAL:
            fprintf(file, "%.17g", v->as.real);
            break;
        case BST_COLUMN_TEXT:
            bst_csv_put_text(file, v->as.text);
            break;
    }
}

bst_status bst_table_row(bst_ctx *ctx, bst_table_out *table, const bst_io_value *values) {
    for (int i = 0; i < table->columns; i++) {
        const bst_io_value *v = &values[i];
        int code = v->is_null ? sqlite3_bind_null(table->insert, i + 1)
                   : v->type == BST_COLUMN_INT
                       ? sqlite3_bind_int64(table->insert, i + 1, v->as.integer)
                   : v->type == BST_COLUMN_REAL
                       ? sqlite3_bind_double(table->insert, i + 1, v->as.real)
                       : sqlite3_bind_text(table->insert, i + 1, v->as.text, -1, SQLITE_STATIC);
        if (code != SQLITE_OK) {
            return fail_sql(ctx, table->tables);
        }
        if (table->with_csv) {
            put_cell(table->csv.stream, v);
            fputs(i + 1 < table->columns ? "," : "\r\n", table->csv.stream);
        }
    }
    bool ok = sqlite3_step(table->insert) == SQLITE_DONE;
    ok = sqlite3_reset(table->insert) == SQLITE_OK && ok;
    return ok ? BST_OK : fail_sql(ctx, table->tables);
}

bst_status bst_table_end(bst_ctx *ctx, bst_table_out *table, bst_status status) {
    sqlite3_finalize(table->insert);
    table->insert = NULL;
    if (table->with_csv) {
        status = bst_draft_close(ctx, &table->csv, status);
    }
    return status;
}
