#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/report/report_study.h"

/* maximum number of columns, besides a few fixed ones */
enum { MOST_COLUMNS = 400, SQL_BYTES = 40000 };

static bool is_name(const char *name) {
    size_t n = strspn(name, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_");
    return n > 0 && name[n] == '\0' && n < BST_STUDY_WORD;
}

static bst_status no_memory(bst_ctx *ctx) {
    return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the study");
}

static double *numbers(int64_t count) {
    double *out = malloc((size_t)(count > 0 ? count : 1) * sizeof *out);
    for (int64_t i = 0; out && i < count; i++) {
        out[i] = NAN;
    }
    return out;
}

/* Calls take(user, rows) for each row of a query. */
static bst_status each_row(bst_ctx *ctx, const bst_report_study_view *v, const char *sql,
                           bst_status (*take)(bst_ctx *ctx, bst_report_study_view *v,
                                              const bst_io_rows *rows),
                           bst_report_study_view *user) {
    bst_io_rows *rows;
    bst_status status;
    bool more;
    BST_TRY(bst_io_rows_open(ctx, v->tables, sql, 0, 0, &rows));
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more &&
           (status = take(ctx, user, rows)) == BST_OK) {
    }
    bst_io_rows_close(rows);
    return status;
}

/* ------------------------------------------------------------------ what there is */

static bst_status take_about(bst_ctx *ctx, bst_report_study_view *v, const bst_io_rows *rows) {
    const char *key = bst_io_rows_text(rows, 0), *value = bst_io_rows_text(rows, 1);
    (void)ctx;
    const struct {
        const char *key;
        char *text;
        size_t bytes;
        int64_t *number;
    } places[] = {{"name", v->name, sizeof v->name, NULL},
                  {"kind", v->kind, sizeof v->kind, NULL},
                  {"seed", v->seed, sizeof v->seed, NULL},
                  {"version", v->version, sizeof v->version, NULL},
                  {"digest", v->digest, sizeof v->digest, NULL},
                  {"runs", NULL, 0, &v->expected_runs},
                  {"replicates", NULL, 0, &v->replicates}};
    for (size_t i = 0; i < sizeof places / sizeof *places; i++) {
        if (strcmp(key, places[i].key) == 0 && places[i].text) {
            snprintf(places[i].text, places[i].bytes, "%s", value);
        } else if (strcmp(key, places[i].key) == 0) {
            *places[i].number = strtoll(value, NULL, 10);
        }
    }
    return BST_OK;
}

static bst_status add_axis(bst_ctx *ctx, bst_report_study_view *v, const char *name,
                           const char *path, const char *design, bool swept) {
    if (!is_name(name) || v->axis_count == MOST_COLUMNS / 2) {
        return BST_OK;
    }
    bst_report_study_axis_view *a = &v->axes[v->axis_count++];
    snprintf(a->name, sizeof a->name, "%s", name);
    snprintf(a->path, sizeof a->path, "%s", path);
    snprintf(a->design, sizeof a->design, "%s", design);
    a->swept = swept;
    a->of_setting = a->swept ? numbers(v->settings) : NULL;
    a->of_run = numbers(v->runs);
    a->levels = numbers(BST_STUDY_LEVELS);
    a->words = calloc(BST_STUDY_LEVELS, sizeof *a->words);
    return (a->of_setting || !a->swept) && a->of_run && a->levels && a->words ? BST_OK
                                                                              : no_memory(ctx);
}

static bst_status take_axis(bst_ctx *ctx, bst_report_study_view *v, const bst_io_rows *rows) {
    int before = v->axis_count;
    BST_TRY(add_axis(ctx, v, bst_io_rows_text(rows, 0), bst_io_rows_text(rows, 1),
                     bst_io_rows_text(rows, 3), strcmp(bst_io_rows_text(rows, 2), "sweep") == 0));
    if (v->axis_count > before) {
        v->axes[before].population = strcmp(bst_io_rows_text(rows, 2), "population") == 0;
    }
    return BST_OK;
}

static bst_status take_scenario(bst_ctx *ctx, bst_report_study_view *v, const bst_io_rows *rows) {
    (void)ctx;
    bst_report_study_axis_view *a = &v->axes[v->axis_count - 1];
    if (a->word_count < BST_STUDY_LEVELS) {
        snprintf(a->words[a->word_count++], BST_STUDY_WORD, "%.60s", bst_io_rows_text(rows, 0));
    }
    return BST_OK;
}

/* Adds an axis for several scenarios, whose values are indices of names. */
static bst_status add_scenarios(bst_ctx *ctx, bst_report_study_view *v) {
    int before = v->axis_count;
    BST_TRY(add_axis(ctx, v, "scenario", "the scenarios that are varied", "list", true));
    if (v->axis_count == before) {
        return BST_OK;
    }
    v->axes[before].is_text = true;
    return each_row(ctx, v, "SELECT name FROM scenarios ORDER BY scenario", take_scenario, v);
}

static bst_status make_room(bst_ctx *ctx, const bst_report_study_view *v,
                            bst_report_study_metric_view *m) {
    m->of_run = numbers(v->runs);
    m->mean = numbers(v->settings);
    m->low = numbers(v->settings);
    m->high = numbers(v->settings);
    return m->of_run && m->mean && m->low && m->high ? BST_OK : no_memory(ctx);
}

static bst_status take_metric(bst_ctx *ctx, bst_report_study_view *v, const bst_io_rows *rows) {
    if (!is_name(bst_io_rows_text(rows, 0)) || v->metric_count == MOST_COLUMNS / 2) {
        return BST_OK;
    }
    bst_report_study_metric_view *m = &v->metrics[v->metric_count++];
    snprintf(m->name, sizeof m->name, "%s", bst_io_rows_text(rows, 0));
    snprintf(m->unit, sizeof m->unit, "%s", bst_io_rows_text(rows, 1));
    snprintf(m->doc, sizeof m->doc, "%s", bst_io_rows_text(rows, 2));
    m->rate = strcmp(bst_io_rows_text(rows, 3), "rate") == 0;
    return make_room(ctx, v, m);
}

/* ------------------------------------------------------------------ values */

/* Value of an axis in a row: a number, or an index of a word. Words beyond the capacity share the
 * last index. */
static double axis_value(bst_report_study_axis_view *a, const bst_io_rows *rows, int column) {
    if (bst_io_rows_kind(rows, column) != BST_CELL_TEXT) {
        return bst_io_rows_real(rows, column);
    }
    char word[BST_STUDY_WORD];
    snprintf(word, sizeof word, "%.60s", bst_io_rows_text(rows, column));
    a->is_text = true;
    int i = 0;
    while (i < a->word_count && strcmp(a->words[i], word) != 0) {
        i++;
    }
    if (i == a->word_count && i < BST_STUDY_LEVELS) {
        memcpy(a->words[a->word_count++], word, sizeof word);
    }
    return i < BST_STUDY_LEVELS ? i : BST_STUDY_LEVELS - 1;
}

static bst_status take_setting(bst_ctx *ctx, bst_report_study_view *v, const bst_io_rows *rows) {
    (void)ctx;
    int64_t setting = bst_io_rows_int(rows, 0);
    int column = 1;
    for (int i = 0; i < v->axis_count; i++) {
        if (v->axes[i].swept && setting >= 0 && setting < v->settings) {
            v->axes[i].of_setting[setting] = axis_value(&v->axes[i], rows, column++);
        }
    }
    return BST_OK;
}

static bst_status take_run(bst_ctx *ctx, bst_report_study_view *v, const bst_io_rows *rows) {
    (void)ctx;
    if (v->read == v->runs) {
        return BST_OK;
    }
    int64_t r = v->read++;
    int column = 3;
    v->run_numbers[r] = bst_io_rows_int(rows, 0);
    v->setting_of_run[r] = bst_io_rows_int(rows, 1);
    v->done[r] = strcmp(bst_io_rows_text(rows, 2), "done") == 0;
    v->failed += !v->done[r];
    for (int i = 0; i < v->axis_count; i++) {
        v->axes[i].of_run[r] = axis_value(&v->axes[i], rows, column++);
    }
    for (int i = 0; i < v->metric_count; i++) {
        v->metrics[i].of_run[r] = bst_io_rows_real(rows, column++);
    }
    return BST_OK;
}

/* Reads a row of the table speed, which has the order of the table runs. */
static bst_status take_speed(bst_ctx *ctx, bst_report_study_view *v, const bst_io_rows *rows) {
    (void)ctx;
    while (v->read < v->runs && v->run_numbers[v->read] < bst_io_rows_int(rows, 0)) {
        v->read++;
    }
    if (v->read < v->runs && v->run_numbers[v->read] == bst_io_rows_int(rows, 0)) {
        v->wall.of_run[v->read] = bst_io_rows_real(rows, 1);
        v->cpu.of_run[v->read] = bst_io_rows_real(rows, 2);
    }
    return BST_OK;
}

static bst_status take_statistics(bst_ctx *ctx, bst_report_study_view *v, const bst_io_rows *rows) {
    (void)ctx;
    int64_t setting = bst_io_rows_int(rows, 0);
    for (int i = 0; i < v->metric_count && setting >= 0 && setting < v->settings; i++) {
        bst_report_study_metric_view *m = &v->metrics[i];
        if (strcmp(m->name, bst_io_rows_text(rows, 1)) == 0) {
            m->mean[setting] = bst_io_rows_real(rows, 2);
            m->low[setting] = bst_io_rows_real(rows, 3);
            m->high[setting] = bst_io_rows_real(rows, 4);
        }
    }
    return BST_OK;
}

/* Builds a query of fixed columns, axes (all or swept) and metrics: "SELECT fixed, "name", ... FROM
 * table". */
static void write_query(const bst_report_study_view *v, const char *fixed, const char *table,
                        bool all, char sql[SQL_BYTES]) {
    size_t n = (size_t)snprintf(sql, SQL_BYTES, "SELECT %s", fixed);
    for (int i = 0; i < v->axis_count; i++) {
        if (all || v->axes[i].swept) {
            n += (size_t)snprintf(sql + n, SQL_BYTES - n, ", \"%s\"", v->axes[i].name);
        }
    }
    for (int i = 0; i < v->metric_count && all; i++) {
        n += (size_t)snprintf(sql + n, SQL_BYTES - n, ", \"%s\"", v->metrics[i].name);
    }
    snprintf(sql + n, SQL_BYTES - n, " FROM %s ORDER BY 1", table);
}

/* ------------------------------------------------------------------ what follows from them */

static void find_levels(bst_report_study_axis_view *a, int64_t settings) {
    for (int64_t i = 0; i < settings && a->level_count <= BST_STUDY_LEVELS; i++) {
        double value = a->of_setting[i];
        int k = 0;
        while (k < a->level_count && a->levels[k] < value) {
            k++;
        }
        if (!isfinite(value) || (k < a->level_count && a->levels[k] == value)) {
            continue;
        }
        if (a->level_count == BST_STUDY_LEVELS) {
            a->level_count++;
            return;
        }
        memmove(a->levels + k + 1, a->levels + k, (size_t)(a->level_count - k) * sizeof *a->levels);
        a->levels[k] = value;
        a->level_count++;
    }
    /* even in logarithms: the middle level is closer to the geometric mean of the ends */
    int n = a->level_count;
    if (n >= 3 && n <= BST_STUDY_LEVELS && !a->is_text && a->levels[0] > 0.0 &&
        a->levels[n - 1] >= 8.0 * a->levels[0]) {
        double low = a->levels[0], high = a->levels[n - 1], middle = a->levels[n / 2];
        double even = (double)(n / 2) / (n - 1);
        double linear = low + even * (high - low), logarithmic = low * pow(high / low, even);
        a->logarithmic = fabs(middle - logarithmic) < fabs(middle - linear);
    }
}

/* Computes means over the runs of each setting; with `least`, the minimum, as the table
 * speed_sensitivity uses for speed. */
static void average(const bst_report_study_view *v, bst_report_study_metric_view *m, bool least) {
    for (int64_t r = 0; r < v->runs;) {
        int64_t setting = v->setting_of_run[r], n = 0;
        double sum = 0.0, quickest = INFINITY;
        for (; r < v->runs && v->setting_of_run[r] == setting; r++) {
            if (isfinite(m->of_run[r])) {
                sum += m->of_run[r];
                quickest = fmin(quickest, m->of_run[r]);
                n++;
            }
        }
        if (setting >= 0 && setting < v->settings && n > 0) {
            m->mean[setting] = least ? quickest : sum / (double)n;
        }
    }
}

static void finish(bst_report_study_view *v) {
    for (int i = 0; i < v->axis_count; i++) {
        if (v->axes[i].swept) {
            find_levels(&v->axes[i], v->settings);
        }
    }
    for (int i = 0; i < v->metric_count; i++) {
        bst_report_study_metric_view *m = &v->metrics[i];
        double low = INFINITY, high = -INFINITY;
        bst_chart_widen(m->of_run, (size_t)v->runs, false, &low, &high);
        m->varies = high > low;
        if (v->replicates <= 1) {
            average(v, m, false); /* settings with one run have no statistics */
        }
    }
    average(v, &v->wall, true);
    average(v, &v->cpu, true);
}

static bst_status allocate(bst_ctx *ctx, bst_report_study_view *v) {
    v->settings = bst_run_reader_int(v->tables, "SELECT count(*) FROM settings", 0, -1);
    v->runs = bst_run_reader_int(v->tables, "SELECT count(*) FROM runs", 0, -1);
    if (v->settings < 0 || v->runs < 0) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "%s/" BST_STUDY_DATABASE ": is not the tables of a study, or is damaged",
                        bst_run_reader_folder(v->tables));
    }
    size_t runs = (size_t)v->runs + 1;
    v->axes = calloc(MOST_COLUMNS / 2, sizeof *v->axes);
    v->metrics = calloc(MOST_COLUMNS / 2, sizeof *v->metrics);
    v->setting_of_run = calloc(runs, sizeof *v->setting_of_run);
    v->run_numbers = calloc(runs, sizeof *v->run_numbers);
    v->done = calloc(runs, sizeof *v->done);
    v->wall = (bst_report_study_metric_view){
        .name = "wall_s", .unit = "s", .doc = "Wall time of a run.", .varies = true};
    v->cpu = (bst_report_study_metric_view){.name = "cpu_s",
                                            .unit = "s",
                                            .doc = "Processor time of a run, on all threads.",
                                            .varies = true};
    return v->axes && v->metrics && v->setting_of_run && v->run_numbers && v->done &&
                   make_room(ctx, v, &v->wall) == BST_OK
               ? make_room(ctx, v, &v->cpu)
               : no_memory(ctx);
}

bst_status bst_report_study_view_read(bst_ctx *ctx, bst_run_reader *tables,
                                      bst_report_study_view *v) {
    char *sql = malloc(SQL_BYTES);
    *v = (bst_report_study_view){.tables = tables, .replicates = 1};
    bst_status status = sql ? allocate(ctx, v) : no_memory(ctx);
    if (status == BST_OK) {
        status = each_row(ctx, v, "SELECT key, value FROM about", take_about, v);
    }
    if (status == BST_OK) {
        status = each_row(ctx, v, "SELECT name, path, role, design FROM axes ORDER BY axis",
                          take_axis, v);
    }
    if (status == BST_OK &&
        bst_run_reader_int(tables, "SELECT count(*) FROM scenarios", 0, 0) > 1) {
        status = add_scenarios(ctx, v);
    }
    if (status == BST_OK) {
        status = each_row(ctx, v, "SELECT metric, unit, doc, kind FROM metrics", take_metric, v);
    }
    if (status == BST_OK) {
        write_query(v, "setting", "settings", false, sql);
        status = each_row(ctx, v, sql, take_setting, v);
    }
    if (status == BST_OK) {
        write_query(v, "run, setting, status", "runs", true, sql);
        status = each_row(ctx, v, sql, take_run, v);
    }
    if (status == BST_OK) {
        v->read = 0;
        bool both =
            bst_run_reader_int(
                tables, "SELECT 1 FROM pragma_table_info('speed') WHERE name = 'cpu_s'", 0, 0) == 1;
        status = each_row(ctx, v,
                          both ? "SELECT run, wall_s, cpu_s FROM speed ORDER BY run"
                               : "SELECT run, wall_s, NULL FROM speed ORDER BY run",
                          take_speed, v);
    }
    if (status == BST_OK) {
        status = each_row(ctx, v,
                          "SELECT setting, metric, mean, low, high FROM statistics"
                          " WHERE setting IS NOT NULL",
                          take_statistics, v);
    }
    if (status == BST_OK) {
        finish(v);
    }
    free(sql);
    return status;
}

static void free_metric(bst_report_study_metric_view *m) {
    free(m->of_run);
    free(m->mean);
    free(m->low);
    free(m->high);
}

void bst_report_study_view_free(bst_report_study_view *v) {
    for (int i = 0; i < v->axis_count; i++) {
        free(v->axes[i].of_setting);
        free(v->axes[i].of_run);
        free(v->axes[i].levels);
        free(v->axes[i].words);
    }
    for (int i = 0; i < v->metric_count; i++) {
        free_metric(&v->metrics[i]);
    }
    free_metric(&v->wall);
    free_metric(&v->cpu);
    free(v->axes);
    free(v->metrics);
    free(v->setting_of_run);
    free(v->run_numbers);
    free(v->done);
    *v = (bst_report_study_view){.tables = NULL};
}

const char *bst_report_study_word(const bst_report_study_axis_view *axis, double value,
                                  char text[32]) {
    if (axis->is_text && value >= 0.0 && value < axis->word_count) {
        snprintf(text, 32, "%.31s", axis->words[(int)value]);
    } else if (isnan(value)) {
        snprintf(text, 32, "-"); /* the scenario does not set it */
    } else {
        snprintf(text, 32, "%.5g", value);
    }
    return text;
}
