/* Tables of a study's series: several rows per run, such as the points of a curve. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/eval/detection_theory.h"
#include "sim/studies/tables_internal.h"

enum { MOST_KEYS = 4096 };

/* Writes the table of all series rows of all runs. */
static bst_status write_rows(bst_ctx *ctx, const bst_tables_job *j) {
    const bst_results *r = j->results;
    const bst_study_kind *kind = r->kind;
    bst_io_column columns[BST_SERIES_COLUMNS + 1] = {
        {"run", BST_COLUMN_INT, "", "Number of the run."}};
    bst_table_out t;
    for (int c = 0; c < kind->series_count; c++) {
        const bst_study_metric *m = &kind->series[c];
        columns[c + 1] = (bst_io_column){m->name, BST_COLUMN_REAL, m->unit, m->doc};
    }
    const bst_table_design design = {kind->series_name, "Rows of each run.", columns,
                                     kind->series_count + 1, true};
    BST_TRY(bst_table_begin(ctx, j->out, &design, &t));
    bst_status status = BST_OK;
    for (int64_t p = 0; p < r->part_count; p++) {
        for (int i = 0; i < r->parts[p].rows && status == BST_OK; i++) {
            const double *from =
                r->series + (r->parts[p].first + (size_t)i) * (size_t)kind->series_count;
            bst_io_value row[BST_SERIES_COLUMNS + 1] = {bst_io_int_value(r->parts[p].run)};
            for (int c = 0; c < kind->series_count; c++) {
                row[c + 1] = bst_io_real_value(from[c]);
            }
            status = bst_table_row(ctx, &t, row);
        }
    }
    return bst_table_end(ctx, &t, status);
}

/* Sums over the rows with one key. */
typedef struct keyed {
    double key;
    int64_t runs;
    double sums[BST_SERIES_COLUMNS];
    int64_t counts[BST_SERIES_COLUMNS];
} keyed;

/* Adds a series row to the sums of its key. */
static void add_row(const bst_study_kind *kind, const double *row, keyed *list, int *count) {
    int k = 0, key_column = 0;
    while (key_column < kind->series_count - 1 && kind->series[key_column].kind != BST_METRIC_KEY) {
        key_column++;
    }
    while (k < *count && list[k].key != row[key_column]) {
        k++;
    }
    if (k == *count) {
        if (k == MOST_KEYS) {
            return;
        }
        memset(&list[k], 0, sizeof list[k]);
        list[k].key = row[key_column];
        (*count)++;
    }
    list[k].runs++;
    for (int c = 0; c < kind->series_count; c++) {
        if (!isnan(row[c])) {
            list[k].sums[c] += row[c];
            list[k].counts[c]++;
        }
    }
}

/* Columns of the statistics table: setting, runs, then each column of the series; hits also with
 * rate and interval. */
static int statistics_columns(const bst_study_kind *kind, bst_io_column *columns) {
    int n = 0;
    columns[n++] = (bst_io_column){"setting", BST_COLUMN_INT, "", "Number of the setting."};
    columns[n++] = (bst_io_column){"runs", BST_COLUMN_INT, "", "Runs that have such a row."};
    for (int c = 0; c < kind->series_count; c++) {
        const bst_study_metric *m = &kind->series[c];
        columns[n++] = (bst_io_column){m->name, BST_COLUMN_REAL, m->unit, m->doc};
        if (m->kind == BST_METRIC_HITS) {
            columns[n++] = (bst_io_column){"rate", BST_COLUMN_REAL, "", "Of all trials together."};
            columns[n++] =
                (bst_io_column){"rate_low", BST_COLUMN_REAL, "", "Its 95 % interval (Wilson)."};
            columns[n++] = (bst_io_column){"rate_high", BST_COLUMN_REAL, "", "Upper end."};
        }
    }
    return n;
}

/* Writes the statistics of one key of a setting. */
static bst_status put_keyed(bst_ctx *ctx, const bst_study_kind *kind, int64_t setting,
                            const keyed *k, bst_table_out *t) {
    bst_io_value row[4 * BST_SERIES_COLUMNS];
    int n = 0;
    double trials = 0.0;
    row[n++] = bst_io_int_value(setting);
    row[n++] = bst_io_int_value(k->runs);
    for (int c = 0; c < kind->series_count; c++) {
        int what = kind->series[c].kind;
        bool summed = what == BST_METRIC_TRIALS || what == BST_METRIC_HITS;
        double mean = k->counts[c] > 0 ? k->sums[c] / (double)k->counts[c] : NAN;
        row[n++] = bst_io_real_value(what == BST_METRIC_KEY ? k->key : summed ? k->sums[c] : mean);
        trials = what == BST_METRIC_TRIALS ? k->sums[c] : trials;
        if (what == BST_METRIC_HITS) {
            bst_eval_interval wilson =
                bst_eval_wilson_interval((int64_t)k->sums[c], (int64_t)trials, BST_NORMAL_95);
            row[n++] = bst_io_real_value(trials > 0.0 ? k->sums[c] / trials : NAN);
            row[n++] = bst_io_real_value(wilson.low);
            row[n++] = bst_io_real_value(wilson.high);
        }
    }
    return bst_table_row(ctx, t, row);
}

static int compare_keys(const void *a, const void *b) {
    const keyed *x = a, *y = b;
    return (x->key > y->key) - (x->key < y->key);
}

/* Writes the series statistics of each setting, by key. */
static bst_status put_settings(bst_ctx *ctx, const bst_tables_job *j, keyed *list,
                               bst_table_out *t) {
    const bst_results *r = j->results;
    const bst_study_kind *kind = r->kind;
    for (int64_t p = 0; p < r->part_count;) {
        int64_t setting = r->parts[p].run / r->study->config.replicates;
        int count = 0;
        for (; p < r->part_count && r->parts[p].run / r->study->config.replicates == setting; p++) {
            for (int i = 0; i < r->parts[p].rows; i++) {
                add_row(kind,
                        r->series + (r->parts[p].first + (size_t)i) * (size_t)kind->series_count,
                        list, &count);
            }
        }
        qsort(list, (size_t)count, sizeof *list, compare_keys);
        for (int k = 0; k < count; k++) {
            BST_TRY(put_keyed(ctx, kind, setting, &list[k], t));
        }
    }
    return BST_OK;
}

bst_status bst_study_write_series(bst_ctx *ctx, const bst_tables_job *j) {
    char name[80];
    bst_io_column columns[4 * BST_SERIES_COLUMNS];
    bst_table_out t;
    BST_TRY(write_rows(ctx, j));
    snprintf(name, sizeof name, "%s_statistics", j->results->kind->series_name);
    int n = statistics_columns(j->results->kind, columns);
    const bst_table_design design = {name, "Rows of the runs of each setting together.", columns, n,
                                     true};
    BST_TRY(bst_table_begin(ctx, j->out, &design, &t));
    keyed *list = malloc(MOST_KEYS * sizeof *list);
    bst_status status = list ? put_settings(ctx, j, list, &t)
                             : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for tables");
    free(list);
    return bst_table_end(ctx, &t, status);
}
