#include <stdio.h>
#include <string.h>

#include "sim/cli/progress.h"
#include "sim/core/text.h"
#include "sim/export/export.h"
#include "sim/io/csv.h"

/* Checks whether `name` is in the list "a,b". */
static bool is_listed(const char *list, const char *name) {
    size_t length = strlen(name);
    for (const char *word = list; word; word = strchr(word, ',')) {
        word += *word == ',';
        if (strncmp(word, name, length) == 0 && (word[length] == ',' || !word[length])) {
            return true;
        }
    }
    return false;
}

static bst_status check_names(bst_ctx *ctx, const bst_export *e, const char *tables) {
    for (const char *word = tables; word; word = strchr(word, ',')) {
        word += *word == ',';
        bst_io_rows *rows;
        bool more = true, known = false;
        char name[64], all[700] = "";
        snprintf(name, sizeof name, "%.*s", (int)strcspn(word, ","), word);
        BST_TRY(bst_io_rows_open(ctx, e->run, "SELECT \"table\" FROM tables ORDER BY rowid", 0, 0,
                                 &rows));
        bst_status status = BST_OK;
        while (!known && (status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
            known = strcmp(bst_io_rows_text(rows, 0), name) == 0;
            size_t n = strlen(all);
            snprintf(all + n, sizeof all - n, "%s%s", n ? ", " : "", bst_io_rows_text(rows, 0));
        }
        bst_io_rows_close(rows);
        BST_TRY(status);
        if (!known) {
            return bst_fail(ctx, BST_ERR_NOT_FOUND, "%s: has no table \"%s\"; it has %s",
                            bst_run_reader_folder(e->run), name, all);
        }
    }
    return BST_OK;
}

/* Column with the time of a row: the first of these. */
static const char time_column[] =
    "SELECT \"column\" FROM columns WHERE \"table\" = (SELECT \"table\" FROM tables"
    " WHERE rowid = ?1) AND \"column\" IN ('mid_s', 'time_s', 'start_s')"
    " ORDER BY \"column\" = 'mid_s' DESC, \"column\" = 'time_s' DESC LIMIT 1";

static bst_status make_sql(bst_ctx *ctx, const bst_export *e, int64_t number, const char *name,
                           char *sql, size_t bytes) {
    bst_io_rows *rows;
    bool more;
    BST_TRY(bst_io_rows_open(ctx, e->run, time_column, number, 0, &rows));
    bst_status status = bst_io_rows_next(ctx, rows, &more);
    char utc[100] = "";
    if (status == BST_OK && more) {
        snprintf(utc, sizeof utc, "utc(%.60s) AS utc, ", bst_io_rows_text(rows, 0));
    }
    bst_io_rows_close(rows);
    /* stars and objects are numbered separately; the CSV needs a column for both */
    bool truth = strcmp(name, "truth") == 0;
    snprintf(sql, bytes, "SELECT %s%s* FROM \"%s\"", utc,
             truth ? "kind || '-' || id AS source, " : "", name);
    return status;
}

static void report(void *user, int64_t rows) {
    bst_progress_update(user, rows);
}

static bst_status export_table(bst_ctx *ctx, const bst_export *e, int64_t number,
                               const char *name) {
    char sql[400], path[4096];
    bst_progress progress;
    int64_t rows;
    BST_TRY(bst_export_check(ctx));
    BST_TRY(make_sql(ctx, e, number, name, sql, sizeof sql));
    int n = snprintf(path, sizeof path, "%s/%s.csv", e->out, name);
    if (n < 0 || (size_t)n >= sizeof path) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", e->out);
    }
    char count[128];
    snprintf(count, sizeof count, "SELECT count(*) FROM \"%.63s\"", name);
    bst_progress_start(&progress, name, "rows", bst_run_reader_int(e->run, count, 0, 0));
    bst_status status = bst_csv_write(ctx, e->run, sql, path, report, &progress, &rows);
    bst_progress_end(&progress);
    if (status == BST_OK) {
        printf("%s: %s\n", path, bst_text_of_count((char[BST_COUNT_TEXT]){0}, rows, "row", "rows"));
    }
    return status;
}

bst_status bst_export_tables(bst_ctx *ctx, const bst_export *e, const char *tables) {
    bst_io_rows *list;
    BST_TRY(check_names(ctx, e, tables));
    BST_TRY(bst_io_rows_open(ctx, e->run, "SELECT rowid, \"table\" FROM tables ORDER BY rowid", 0,
                             0, &list));
    bst_status status;
    bool more;
    while ((status = bst_io_rows_next(ctx, list, &more)) == BST_OK && more) {
        char name[64];
        snprintf(name, sizeof name, "%s", bst_io_rows_text(list, 1));
        /* the recorder does not create tables with such names */
        if (strpbrk(name, "\"'/.") || (tables && !is_listed(tables, name))) {
            continue;
        }
        status = export_table(ctx, e, bst_io_rows_int(list, 0), name);
        if (status != BST_OK) {
            break;
        }
    }
    bst_io_rows_close(list);
    return status;
}
