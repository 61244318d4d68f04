#include "sim/studies/tables.h"

#include <cjson/cJSON.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/version.h"
#include "sim/eval/detection_theory.h"
#include "sim/studies/statistics.h"
#include "sim/studies/tables_internal.h"

static const char *const metric_kinds[] = {"value", "rate", "key", "trials", "hits"};
static const char *const designs[] = {"grid", "list", "latin_hypercube", "one_at_a_time", "morris"};

static bst_io_column text_column(const char *name, const char *doc) {
    return (bst_io_column){name, BST_COLUMN_TEXT, "", doc};
}
static bst_io_column int_column(const char *name, const char *doc) {
    return (bst_io_column){name, BST_COLUMN_INT, "", doc};
}
static bst_io_column real_column(const char *name, const char *unit, const char *doc) {
    return (bst_io_column){name, BST_COLUMN_REAL, unit, doc};
}

/* ------------------------------------------------------------------ what was varied */

static bst_status write_about(bst_ctx *ctx, const bst_tables_job *j) {
    const bst_study *s = j->results->study;
    const bst_io_column columns[] = {text_column("key", "What."),
                                     text_column("value", "Its value.")};
    char numbers[6][32];
    snprintf(numbers[0], 32, "%" PRId64, s->settings);
    snprintf(numbers[1], 32, "%" PRId64, s->config.replicates);
    snprintf(numbers[2], 32, "%" PRId64, s->runs);
    snprintf(numbers[3], 32, "%" PRId64, j->results->done);
    snprintf(numbers[4], 32, "%" PRId64, j->results->failed);
    snprintf(numbers[5], 32, "0x%" PRIX64, s->config.seed);
    const char *const pairs[][2] = {
        {"format", "1"},          {"program", "boresight"},         {"version", bst_version()},
        {"name", s->config.name}, {"kind", j->results->kind->name}, {"digest", s->digest},
        {"seed", numbers[5]},     {"settings", numbers[0]},         {"replicates", numbers[1]},
        {"runs", numbers[2]},     {"runs_done", numbers[3]},        {"runs_failed", numbers[4]}};
    bst_table_out t;
    const bst_table_design design = {"about", "The study.", columns, 2, false};
    BST_TRY(bst_table_begin(ctx, j->out, &design, &t));
    bst_status status = BST_OK;
    for (size_t i = 0; i < sizeof pairs / sizeof *pairs && status == BST_OK; i++) {
        const bst_io_value row[] = {bst_io_text_value(pairs[i][0]), bst_io_text_value(pairs[i][1])};
        status = bst_table_row(ctx, &t, row);
    }
    for (int i = 0; i < s->note_count && status == BST_OK; i++) {
        const bst_io_value row[] = {bst_io_text_value(s->notes[i].key),
                                    bst_io_text_value(s->notes[i].value)};
        status = bst_table_row(ctx, &t, row);
    }
    return bst_table_end(ctx, &t, status);
}

static bst_status write_scenarios(bst_ctx *ctx, const bst_tables_job *j) {
    const bst_study *s = j->results->study;
    const bst_io_column columns[] = {int_column("scenario", "Its number."),
                                     text_column("name", "Its name.")};
    bst_table_out t;
    const bst_table_design design = {"scenarios", "The scenarios that are varied.", columns, 2,
                                     false};
    BST_TRY(bst_table_begin(ctx, j->out, &design, &t));
    bst_status status = BST_OK;
    for (int i = 0; i < s->base_count && status == BST_OK; i++) {
        const bst_io_value row[] = {bst_io_int_value(i), bst_io_text_value(s->bases[i].name)};
        status = bst_table_row(ctx, &t, row);
    }
    return bst_table_end(ctx, &t, status);
}

static const bst_study_factor *factor_of(const bst_study *s, int axis) {
    for (int f = 0; f < s->factor_count; f++) {
        const bst_study_factor *factor = &s->factors[f];
        if (axis >= factor->first_axis && axis < factor->first_axis + factor->axis_count) {
            return factor;
        }
    }
    return NULL;
}

static bst_status write_axes(bst_ctx *ctx, const bst_tables_job *j) {
    const bst_study *s = j->results->study;
    const bst_io_column columns[] = {
        int_column("axis", "Its number."),
        text_column("name", "Its column in other tables."),
        text_column("path", "JSON pointer of what is varied."),
        text_column("role", "sweep, dispersion or population: the number of its objects."),
        text_column("design", "How a sweep takes its values."),
        int_column("sweep", "Number of the sweep in the study.")};
    bst_table_out t;
    const bst_table_design design = {"axes", "What is varied.", columns, 6, false};
    BST_TRY(bst_table_begin(ctx, j->out, &design, &t));
    bst_status status = BST_OK;
    for (int a = 0; a < s->axis_count && status == BST_OK; a++) {
        const bst_study_factor *f = factor_of(s, a);
        const bst_io_value row[] = {
            bst_io_int_value(a),
            bst_io_text_value(s->axes[a].name),
            bst_io_text_value(s->axes[a].path),
            bst_io_text_value(f                       ? "sweep"
                              : s->axes[a].population ? "population"
                                                      : "dispersion"),
            bst_io_text_value(f ? designs[f->design] : NULL),
            f ? bst_io_int_value(f->sweep) : bst_io_null_value(BST_COLUMN_INT)};
        status = bst_table_row(ctx, &t, row);
    }
    return bst_table_end(ctx, &t, status);
}

static bst_status write_metrics(bst_ctx *ctx, const bst_tables_job *j) {
    const bst_io_column columns[] = {
        text_column("metric", "Name."), text_column("unit", "Unit."),
        text_column("doc", "Meaning."),
        text_column("kind", "value, or rate: 1 or 0 in each run, a rate over runs.")};
    bst_table_out t;
    const bst_table_design design = {"metrics", "Figures of a run.", columns, 4, false};
    BST_TRY(bst_table_begin(ctx, j->out, &design, &t));
    bst_status status = BST_OK;
    for (int i = 0; i < j->metric_count && status == BST_OK; i++) {
        const bst_study_metric *m = &j->results->kind->metrics[j->metrics[i]];
        const bst_io_value row[] = {bst_io_text_value(m->name), bst_io_text_value(m->unit),
                                    bst_io_text_value(m->doc),
                                    bst_io_text_value(metric_kinds[m->kind])};
        status = bst_table_row(ctx, &t, row);
    }
    return bst_table_end(ctx, &t, status);
}

/* ------------------------------------------------------------------ values of axes */

/* Checks whether all values of an axis are numbers. */
static bool is_numeric(const bst_study_axis *axis) {
    for (const cJSON *v = axis->values ? axis->values->child : NULL; v; v = v->next) {
        if (!cJSON_IsNumber(v)) {
            return false;
        }
    }
    return true;
}

bst_io_column bst_study_axis_column(const bst_study_axis *axis) {
    return (bst_io_column){axis->name, is_numeric(axis) ? BST_COLUMN_REAL : BST_COLUMN_TEXT, "",
                           axis->path};
}

/* The scenario's own value, where a run does not set the axis. */
static const cJSON *own_value(const bst_study *s, const bst_study_axis *axis, int base) {
    const cJSON *own = bst_study_at(bst_json_root(s->bases[base].json), axis->path);
    return own ? own : bst_study_at(bst_json_root(s->json), axis->path);
}

bst_io_value bst_study_axis_value(const bst_study *s, int a, const bst_study_value *v, int base,
                                  char **text) {
    const bst_study_axis *axis = &s->axes[a];
    const cJSON *json = v->given ? v->json : own_value(s, axis, base);
    *text = NULL;
    if (is_numeric(axis)) {
        return v->given && v->is_number ? bst_io_real_value(v->number)
               : cJSON_IsNumber(json)   ? bst_io_real_value(json->valuedouble)
                                        : bst_io_null_value(BST_COLUMN_REAL);
    }
    if (cJSON_IsString(json)) {
        return bst_io_text_value(json->valuestring);
    }
    *text = json ? cJSON_PrintUnformatted(json) : NULL;
    return bst_io_text_value(*text);
}

/* Values of the first `count` axes as cells of a row; the caller frees texts[count]. */
static void axis_values(const bst_study *s, int count, const bst_study_value *values, int base,
                        bst_io_value *row, char **texts) {
    for (int a = 0; a < count; a++) {
        row[a] = bst_study_axis_value(s, a, &values[a], base, &texts[a]);
    }
}

static void free_texts(char **texts, int count) {
    for (int a = 0; a < count; a++) {
        free(texts[a]);
        texts[a] = NULL;
    }
}

static bst_status write_settings(bst_ctx *ctx, const bst_tables_job *j) {
    const bst_study *s = j->results->study;
    int fixed = 2, n = fixed + s->swept_count;
    j->columns[0] = int_column("setting", "Its number: of its runs run / replicates.");
    j->columns[1] = int_column("scenario", "Number of the scenario that is varied.");
    for (int a = 0; a < s->swept_count; a++) {
        j->columns[fixed + a] = bst_study_axis_column(&s->axes[a]);
    }
    bst_table_out t;
    const bst_table_design design = {"settings", "Values of the settings.", j->columns, n, true};
    BST_TRY(bst_table_begin(ctx, j->out, &design, &t));
    bst_status status = BST_OK;
    for (int64_t i = 0; i < s->settings && status == BST_OK; i++) {
        bst_study_place place = bst_study_place_of(s, i * s->config.replicates);
        bst_study_values(s, &place, j->values);
        j->row[0] = bst_io_int_value(i);
        j->row[1] = bst_io_int_value(place.base);
        axis_values(s, s->swept_count, j->values, place.base, j->row + fixed, j->texts);
        status = bst_table_row(ctx, &t, j->row);
        free_texts(j->texts, s->swept_count);
    }
    return bst_table_end(ctx, &t, status);
}

/* ------------------------------------------------------------------ runs */

static void run_columns(const bst_tables_job *j) {
    const bst_study *s = j->results->study;
    bst_io_column *c = j->columns;
    *c++ = int_column("run", "Its number: boresight study STUDY --emit RUN writes its scenario.");
    *c++ = int_column("setting", "Number of its setting.");
    *c++ = int_column("replicate", "Number among the runs of the setting.");
    *c++ = int_column("run_number", "The scenario's /run: which random numbers it has.");
    *c++ = int_column("scenario", "Number of the scenario that is varied.");
    *c++ = text_column("status", "done or failed.");
    *c++ = text_column("error", "Why it failed.");
    for (int a = 0; a < s->axis_count; a++) {
        *c++ = bst_study_axis_column(&s->axes[a]);
    }
    for (int i = 0; i < j->metric_count; i++) {
        const bst_study_metric *m = &j->results->kind->metrics[j->metrics[i]];
        *c++ = real_column(m->name, m->unit, m->doc);
    }
}

static bst_status write_runs(bst_ctx *ctx, const bst_tables_job *j) {
    const bst_results *r = j->results;
    const bst_study *s = r->study;
    int fixed = 7, n = fixed + s->axis_count + j->metric_count;
    int64_t error = 0;
    bst_table_out t;
    run_columns(j);
    const bst_table_design design = {"runs", "A row for each run.", j->columns, n, true};
    BST_TRY(bst_table_begin(ctx, j->out, &design, &t));
    bst_status status = BST_OK;
    for (int64_t i = 0; i < s->runs && status == BST_OK; i++) {
        if (r->state[i] == BST_ROW_MISSING) {
            continue;
        }
        bool failed = r->state[i] == BST_ROW_FAILED;
        while (failed && error < r->error_count && r->errors[error].run < i) {
            error++;
        }
        bst_study_place place = bst_study_place_of(s, i);
        bst_study_values(s, &place, j->values);
        j->row[0] = bst_io_int_value(i);
        j->row[1] = bst_io_int_value(place.setting);
        j->row[2] = bst_io_int_value(place.replicate);
        j->row[3] = bst_io_int_value((int64_t)place.run_number);
        j->row[4] = bst_io_int_value(place.base);
        j->row[5] = bst_io_text_value(failed ? "failed" : "done");
        j->row[6] = bst_io_text_value(failed ? r->errors[error].text : NULL);
        axis_values(s, s->axis_count, j->values, place.base, j->row + fixed, j->texts);
        for (int m = 0; m < j->metric_count; m++) {
            j->row[fixed + s->axis_count + m] =
                bst_io_real_value(r->metrics[i * r->kind->metric_count + j->metrics[m]]);
        }
        status = bst_table_row(ctx, &t, j->row);
        free_texts(j->texts, s->axis_count);
    }
    return bst_table_end(ctx, &t, status);
}

static bst_status write_speed(bst_ctx *ctx, const bst_tables_job *j) {
    const bst_results *r = j->results;
    const bst_io_column columns[] = {
        int_column("run", "Its number."), real_column("wall_s", "s", "Wall time of the run."),
        real_column("cpu_s", "s", "Processor time of the run, on all threads.")};
    bst_table_out t;
    const bst_table_design design = {
        "speed", "What differs from machine to machine, and is in no other table.", columns, 3,
        true};
    BST_TRY(bst_table_begin(ctx, j->out, &design, &t));
    bst_status status = BST_OK;
    for (int64_t i = 0; i < r->study->runs && status == BST_OK; i++) {
        if (r->state[i] != BST_ROW_MISSING) {
            const bst_io_value row[] = {bst_io_int_value(i), bst_io_real_value(r->wall_s[i]),
                                        bst_io_real_value(r->cpu_s[i])};
            status = bst_table_row(ctx, &t, row);
        }
    }
    return bst_table_end(ctx, &t, status);
}

/* ------------------------------------------------------------------ statistics */

enum { STATISTICS_COLUMNS = 17 };

static void statistics_columns(bst_io_column *c) {
    *c++ = int_column("setting", "Number of the setting; NULL: all runs of the study.");
    *c++ = text_column("metric", "Name of the metric.");
    *c++ = text_column("method",
                       "Of the interval: wilson (of a rate), bootstrap or normal (of a mean).");
    *c++ = int_column("runs", "Runs that have a number.");
    *c++ = int_column("missing", "Runs that have none, failed ones among them.");
    *c++ = real_column("mean", "", "Mean, or rate.");
    *c++ = real_column("low", "", "Lower end of its 95 % interval.");
    *c++ = real_column("high", "", "Upper end.");
    *c++ = real_column("std", "", "Standard deviation of the runs.");
    *c++ = real_column("minimum", "", "Least.");
    *c++ = real_column("p05", "", "5th percentile.");
    *c++ = real_column("p25", "", "25th percentile.");
    *c++ = real_column("median", "", "Median.");
    *c++ = real_column("p75", "", "75th percentile.");
    *c++ = real_column("p95", "", "95th percentile.");
    *c++ = real_column("maximum", "", "Greatest.");
}

static bst_status put_statistics(bst_ctx *ctx, const bst_tables_job *j, bst_table_out *t,
                                 int64_t setting, int64_t first, int64_t count) {
    const bst_results *r = j->results;
    int columns = r->kind->metric_count;
    bst_statistics list[BST_STUDY_METRICS];
    bst_rng_key key =
        bst_rng_make_key(r->study->config.seed, (uint64_t)(setting + 1), "statistics", "bootstrap");
    BST_TRY(bst_statistics_of(ctx, r->metrics + first * columns, count, columns,
                              r->study->config.resamples, key, list));
    for (int i = 0; i < j->metric_count; i++) {
        const bst_study_metric *m = &r->kind->metrics[j->metrics[i]];
        bst_statistics *s = &list[j->metrics[i]];
        if (m->kind == BST_METRIC_FLAG && s->count > 0) {
            int64_t hits = llround(s->mean * (double)s->count);
            bst_eval_interval wilson = bst_eval_wilson_interval(hits, s->count, BST_NORMAL_95);
            s->low = wilson.low;
            s->high = wilson.high;
        }
        const bst_io_value row[] = {
            setting < 0 ? bst_io_null_value(BST_COLUMN_INT) : bst_io_int_value(setting),
            bst_io_text_value(m->name),
            bst_io_text_value(m->kind == BST_METRIC_FLAG   ? "wilson"
                              : count > BST_BOOTSTRAP_RUNS ? "normal"
                                                           : "bootstrap"),
            bst_io_int_value(s->count),
            bst_io_int_value(s->missing),
            bst_io_real_value(s->mean),
            bst_io_real_value(s->low),
            bst_io_real_value(s->high),
            bst_io_real_value(s->std),
            bst_io_real_value(s->minimum),
            bst_io_real_value(s->p05),
            bst_io_real_value(s->p25),
            bst_io_real_value(s->median),
            bst_io_real_value(s->p75),
            bst_io_real_value(s->p95),
            bst_io_real_value(s->maximum)};
        BST_TRY(bst_table_row(ctx, t, row));
    }
    return BST_OK;
}

static bst_status write_statistics(bst_ctx *ctx, const bst_tables_job *j) {
    const bst_study *s = j->results->study;
    bst_io_column columns[STATISTICS_COLUMNS];
    bst_table_out t;
    statistics_columns(columns);
    const bst_table_design design = {"statistics", "Metrics over the runs of each setting.",
                                     columns, 16, true};
    BST_TRY(bst_table_begin(ctx, j->out, &design, &t));
    bst_status status = put_statistics(ctx, j, &t, -1, 0, s->runs);
    int64_t n = s->config.replicates;
    for (int64_t i = 0; i < s->settings && n > 1 && status == BST_OK; i++) {
        status = put_statistics(ctx, j, &t, i, i * n, n);
    }
    return bst_table_end(ctx, &t, status);
}

/* ------------------------------------------------------------------ all of it */

static void choose_metrics(bst_tables_job *j) {
    const bst_study_kind *kind = j->results->kind;
    const cJSON *list =
        cJSON_GetObjectItemCaseSensitive(bst_json_root(j->results->study->json), "metrics");
    for (const cJSON *item = list ? list->child : NULL; item; item = item->next) {
        int m = cJSON_IsString(item) ? bst_kind_metric(kind, item->valuestring) : -1;
        bool twice = false;
        for (int i = 0; i < j->metric_count; i++) {
            twice = twice || j->metrics[i] == m;
        }
        if (m >= 0 && !twice) {
            j->metrics[j->metric_count++] = m;
        }
    }
    for (int m = 0; m < kind->metric_count && !(list && list->child); m++) {
        j->metrics[j->metric_count++] = m;
    }
}

static bst_status write_all(bst_ctx *ctx, const bst_tables_job *j) {
    BST_TRY(write_about(ctx, j));
    BST_TRY(write_scenarios(ctx, j));
    BST_TRY(write_axes(ctx, j));
    BST_TRY(write_metrics(ctx, j));
    BST_TRY(write_settings(ctx, j));
    BST_TRY(write_runs(ctx, j));
    BST_TRY(write_speed(ctx, j));
    BST_TRY(write_statistics(ctx, j));
    BST_TRY(bst_study_write_sensitivity(ctx, j));
    return j->results->kind->series_count > 0 ? bst_study_write_series(ctx, j) : BST_OK;
}

bst_status bst_study_write_tables(bst_ctx *ctx, bst_results *results, const char *out) {
    bst_tables_out tables;
    size_t wide = BST_STUDY_AXES + BST_STUDY_METRICS + 16;
    bst_tables_job j = {.results = results,
                        .out = &tables,
                        .columns = calloc(wide, sizeof *j.columns),
                        .row = calloc(wide, sizeof *j.row),
                        .values = calloc(BST_STUDY_AXES, sizeof *j.values),
                        .texts = calloc(BST_STUDY_AXES, sizeof *j.texts)};
    bst_status status = BST_OK;
    choose_metrics(&j);
    bst_results_sort(results);
    if (!j.columns || !j.row || !j.values || !j.texts) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "out of memory for tables");
    }
    if (status == BST_OK) {
        status = bst_tables_begin(ctx, out, &tables);
        if (status == BST_OK) {
            status = write_all(ctx, &j);
            status = bst_tables_end(ctx, &tables, status);
        }
    }
    free(j.columns);
    free(j.row);
    free(j.values);
    free(j.texts);
    return status;
}
