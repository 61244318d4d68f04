#include "view/study_view.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "sim/core/json_member.h"
#include "sim/core/json_number.h"
#include "sim/io/run_files.h"
#include "sim/io/run_reader.h"
#include "view/start_page.h"

/* Work of all queries of a request, steps of SQLite's virtual machine: some seconds. */
static const int64_t STEPS_MOST = INT64_C(400000000);

bool bst_view_is_study(const char *folder) {
    char path[4200];
    struct stat found;
    int n = snprintf(path, sizeof path, "%s/" BST_STUDY_DATABASE, folder);
    return n > 0 && (size_t)n < sizeof path && stat(path, &found) == 0;
}

/* Folder of a run of the study; false: it was not kept, or is no run's. */
static bool run_folder(const char *study, int64_t number, char path[4200]) {
    int n = snprintf(path, 4200, "%s/runs/%06lld", study, (long long)number);
    return n > 0 && n < 4200 && bst_io_folder_is_run(path);
}

static cJSON *cell_of(const bst_io_rows *rows, int column) {
    switch (bst_io_rows_kind(rows, column)) {
        case BST_CELL_INT:
        case BST_CELL_REAL: {
            cJSON *holder = cJSON_CreateObject();
            bst_json_add_number(holder, "value", bst_io_rows_real(rows, column));
            cJSON *cell = cJSON_DetachItemFromObject(holder, "value");
            cJSON_Delete(holder);
            return cell ? cell : cJSON_CreateNull();
        }
        case BST_CELL_TEXT:
            return cJSON_CreateString(bst_io_rows_text(rows, column));
        default:
            return cJSON_CreateNull();
    }
}

/* Gives the columns that a table names what it says about them. `sql` yields name, unit, doc. */
static void describe_columns(const bst_run_reader *reader, const char *sql, const char *role,
                             cJSON *columns) {
    bst_ctx ignored = {0};
    bst_io_rows *rows;
    bool more;
    if (bst_io_rows_open(&ignored, reader, sql, 0, 0, &rows) != BST_OK) {
        return;
    }
    while (bst_io_rows_next(&ignored, rows, &more) == BST_OK && more) {
        cJSON *column;
        cJSON_ArrayForEach(column, columns) {
            if (strcmp(bst_json_member_text(column, "name", ""), bst_io_rows_text(rows, 0)) == 0) {
                cJSON_ReplaceItemInObject(column, "role", cJSON_CreateString(role));
                cJSON_ReplaceItemInObject(column, "unit",
                                          cJSON_CreateString(bst_io_rows_text(rows, 1)));
                cJSON_ReplaceItemInObject(column, "doc",
                                          cJSON_CreateString(bst_io_rows_text(rows, 2)));
            }
        }
    }
    bst_io_rows_close(rows);
}

static void list_columns(const bst_run_reader *reader, const bst_io_rows *rows, int count,
                         cJSON *columns) {
    for (int i = 0; i < count; i++) {
        cJSON *column = cJSON_CreateObject();
        cJSON_AddStringToObject(column, "name", bst_io_rows_column_name(rows, i));
        cJSON_AddStringToObject(column, "unit", "");
        cJSON_AddStringToObject(column, "doc", "");
        cJSON_AddStringToObject(column, "role", "");
        cJSON_AddItemToArray(columns, column);
    }
    describe_columns(reader, "SELECT name, '', path FROM axes", "parameter", columns);
    describe_columns(reader, "SELECT metric, unit, doc FROM metrics", "figure", columns);
}

static void add_about(const bst_run_reader *reader, const char *key, cJSON *out) {
    bst_ctx ignored = {0};
    bst_io_rows *rows;
    bool more;
    char sql[80];
    snprintf(sql, sizeof sql, "SELECT value FROM about WHERE key = '%s'", key);
    if (bst_io_rows_open(&ignored, reader, sql, 0, 0, &rows) == BST_OK) {
        if (bst_io_rows_next(&ignored, rows, &more) == BST_OK && more) {
            cJSON_AddStringToObject(out, key, bst_io_rows_text(rows, 0));
        }
        bst_io_rows_close(rows);
    }
}

static bst_status list_runs(bst_ctx *ctx, const bst_run_reader *reader, const char *study,
                            cJSON *out) {
    bst_io_rows *rows;
    bst_status status;
    bool more;
    char sql[80], path[4200];
    snprintf(sql, sizeof sql, "SELECT * FROM runs ORDER BY run LIMIT %d", BST_VIEW_STUDY_RUNS);
    BST_TRY(bst_io_rows_open(ctx, reader, sql, 0, 0, &rows));
    const int all = bst_io_rows_columns(rows);
    const int count = all < BST_VIEW_STUDY_COLUMNS ? all : BST_VIEW_STUDY_COLUMNS;
    list_columns(reader, rows, count, cJSON_AddArrayToObject(out, "columns"));
    cJSON *list = cJSON_AddArrayToObject(out, "runs");
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        cJSON *run = cJSON_CreateObject(), *cells = cJSON_AddArrayToObject(run, "cells");
        const int64_t number = bst_io_rows_int(rows, 0);
        cJSON_AddNumberToObject(run, "run", (double)number);
        cJSON_AddBoolToObject(run, "folder", run_folder(study, number, path));
        for (int i = 0; i < count; i++) {
            cJSON_AddItemToArray(cells, cell_of(rows, i));
        }
        cJSON_AddItemToArray(list, run);
    }
    bst_io_rows_close(rows);
    return status;
}

static bst_status check_study(bst_ctx *ctx, const bst_view_exchange *x, const char **study) {
    *study = bst_view_subject_study(x->subject);
    return *study ? BST_OK : bst_fail(ctx, BST_ERR_NOT_FOUND, "no study is shown here");
}

bst_status bst_view_route_study(bst_ctx *ctx, bst_view_exchange *x) {
    const char *study;
    bst_run_reader *reader;
    BST_TRY(check_study(ctx, x, &study));
    BST_TRY(bst_run_reader_open_study(ctx, study, &reader));
    bst_run_reader_allow(reader, STEPS_MOST);
    x->json = cJSON_CreateObject();
    add_about(reader, "name", x->json);
    add_about(reader, "kind", x->json);
    cJSON_AddNumberToObject(x->json, "total",
                            (double)bst_run_reader_int(reader, "SELECT count(*) FROM runs", 0, 0));
    bst_status status = list_runs(ctx, reader, study, x->json);
    bst_run_reader_close(reader);
    return status;
}

bst_status bst_view_route_study_open(bst_ctx *ctx, bst_view_exchange *x) {
    const char *study;
    char path[4200];
    BST_TRY(check_study(ctx, x, &study));
    cJSON *root = cJSON_Parse(x->body);
    const cJSON *item = bst_json_member(root, "number");
    const double number = cJSON_IsNumber(item) ? item->valuedouble : -1.0;
    cJSON_Delete(root);
    if (!(number >= 0.0 && number < 1e12) || !run_folder(study, (int64_t)number, path)) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND,
                        "the folder of this run was not kept: give the study \"keep\": \"tables\" "
                        "or \"run\"");
    }
    int64_t opened;
    BST_TRY(bst_view_subject_open(ctx, x->subject, path, &opened));
    x->json = cJSON_CreateObject();
    cJSON_AddNumberToObject(x->json, "run", (double)opened);
    return BST_OK;
}

bst_status bst_view_route_runs(bst_ctx *ctx, bst_view_exchange *x) {
    cJSON *start;
    BST_TRY(bst_view_start_list(ctx, &start));
    x->json = cJSON_CreateObject();
    cJSON *open = cJSON_AddArrayToObject(x->json, "open");
    cJSON *names = cJSON_AddArrayToObject(x->json, "runs");
    const int64_t count = bst_view_subject_count(x->subject);
    for (int64_t i = 0; i < count; i++) {
        cJSON *node = cJSON_CreateObject();
        cJSON_AddNumberToObject(node, "number", (double)i);
        cJSON_AddStringToObject(node, "name", bst_view_subject_path(x->subject, i));
        cJSON_AddItemToArray(open, node);
    }
    const cJSON *run;
    cJSON_ArrayForEach(run, bst_json_member(start, "runs")) {
        cJSON_AddItemToArray(names, cJSON_CreateString(bst_json_member_text(run, "name", "")));
    }
    cJSON_Delete(start);
    return BST_OK;
}
