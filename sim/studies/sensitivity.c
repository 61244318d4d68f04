#include "sim/studies/sensitivity.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/studies/tables_internal.h"

typedef struct sums {
    int64_t count;
    double magnitude, magnitude_square, value, value_square;
} sums;

/* Mean of a metric over the runs of a setting; of speed the minimum, because start-up and other
 * load only add time. */
static double setting_value(const bst_results *r, int metric, int64_t setting) {
    int64_t replicates = r->study->config.replicates, n = 0;
    double sum = 0.0, least = INFINITY;
    for (int64_t i = setting * replicates; i < (setting + 1) * replicates; i++) {
        double x = r->state[i] != BST_ROW_DONE ? NAN
                   : metric == BST_SPEED_WALL  ? r->wall_s[i]
                   : metric == BST_SPEED_CPU   ? r->cpu_s[i]
                                               : r->metrics[i * r->kind->metric_count + metric];
        if (!isnan(x)) {
            sum += x;
            least = fmin(least, x);
            n++;
        }
    }
    return n == 0 ? NAN : metric < 0 ? least : sum / (double)n;
}

/* Adds the magnitude and the signed value of an effect; NAN is skipped. */
static void add(sums *s, double magnitude, double value) {
    if (isnan(magnitude) || isnan(value)) {
        return;
    }
    s->count++;
    s->magnitude += magnitude;
    s->magnitude_square += magnitude * magnitude;
    s->value += value;
    s->value_square += value * value;
}

/* Adds the elementary effects of all Morris paths: each step changes one axis. first: setting of
 * the factor's level 0. */
static void add_paths(const bst_results *r, const bst_study_factor *f, int metric, int64_t first,
                      int64_t stride, sums *list) {
    int k = f->axis_count;
    for (int64_t level = 0; level + 1 < f->levels; level++) {
        if (level % (k + 1) == k) {
            continue; /* from one path to the next */
        }
        const double *from = f->unit + level * k, *to = from + k;
        for (int a = 0; a < k; a++) {
            double by = to[a] - from[a];
            if (by != 0.0) {
                double effect = (setting_value(r, metric, first + (level + 1) * stride) -
                                 setting_value(r, metric, first + level * stride)) /
                                by;
                add(&list[a], fabs(effect), effect);
            }
        }
    }
}

/* Adds the effect of each axis of a one_at_a_time sweep: range and end-to-end difference. */
static void add_axes(const bst_results *r, const bst_study_factor *f, int metric, int64_t first,
                     int64_t stride, sums *list) {
    double own = setting_value(r, metric, first);
    int64_t level = 1;
    for (int a = 0; a < f->axis_count; a++) {
        const bst_study_axis *axis = &r->study->axes[f->first_axis + a];
        int64_t count = axis->values ? axis->value_count : axis->axis->count;
        double least = own, most = own, begin = NAN, end = NAN;
        for (int64_t i = 0; i < count; i++, level++) {
            double y = setting_value(r, metric, first + level * stride);
            least = fmin(least, y); /* fmin and fmax ignore NAN */
            most = fmax(most, y);
            begin = i == 0 ? y : begin;
            end = y;
        }
        add(&list[a], most - least, count > 1 ? end - begin : end - own);
    }
}

static int compare(const void *a, const void *b) {
    const bst_sensitivity *x = a, *y = b;
    if (isnan(x->effect) || isnan(y->effect)) {
        return isnan(x->effect) - isnan(y->effect);
    }
    return x->effect != y->effect ? (x->effect < y->effect ? 1 : -1) : x->axis - y->axis;
}

static double deviation(int64_t n, double sum, double square) {
    double mean = sum / (double)n;
    return n > 1 ? sqrt(fmax(square - (double)n * mean * mean, 0.0) / (double)(n - 1)) : NAN;
}

void bst_sensitivity_of(const bst_results *r, int factor, int metric, bst_sensitivity *out) {
    const bst_study *study = r->study;
    const bst_study_factor *f = &study->factors[factor];
    sums list[BST_STUDY_AXES];
    int64_t stride = 1;
    memset(list, 0, sizeof list);
    for (int i = factor + 1; i < study->factor_count; i++) {
        stride *= study->factors[i].levels;
    }
    for (int64_t outer = 0; outer < study->settings; outer += stride * f->levels) {
        for (int64_t inner = 0; inner < stride; inner++) {
            if (f->design == BST_SWEEP_MORRIS) {
                add_paths(r, f, metric, outer + inner, stride, list);
            } else {
                add_axes(r, f, metric, outer + inner, stride, list);
            }
        }
    }
    for (int a = 0; a < f->axis_count; a++) {
        const sums *s = &list[a];
        double n = (double)s->count;
        out[a] = (bst_sensitivity){
            .axis = f->first_axis + a,
            .count = s->count,
            .effect = s->count > 0 ? s->magnitude / n : NAN,
            .error = deviation(s->count, s->magnitude, s->magnitude_square) / sqrt(n),
            .mean_effect = s->count > 0 ? s->value / n : NAN,
            .spread = deviation(s->count, s->value, s->value_square)};
    }
    qsort(out, (size_t)f->axis_count, sizeof *out, compare);
}

/* ------------------------------------------------------------------ tables */

/* Writes the ranked effects of a sweep's axes on one metric. */
static bst_status put_figure(bst_ctx *ctx, const bst_results *r, int factor, int metric,
                             bst_table_out *t) {
    const bst_study_factor *f = &r->study->factors[factor];
    bst_sensitivity list[BST_STUDY_AXES];
    bst_sensitivity_of(r, factor, metric, list);
    for (int i = 0; i < f->axis_count; i++) {
        const bst_io_value row[] = {
            bst_io_int_value(f->sweep),
            bst_io_text_value(f->design == BST_SWEEP_MORRIS ? "morris" : "one_at_a_time"),
            bst_io_text_value(metric == BST_SPEED_WALL  ? "wall_s"
                              : metric == BST_SPEED_CPU ? "cpu_s"
                                                        : r->kind->metrics[metric].name),
            bst_io_int_value(i + 1),
            bst_io_text_value(r->study->axes[list[i].axis].name),
            bst_io_real_value(list[i].effect),
            bst_io_real_value(list[i].error),
            bst_io_real_value(list[i].mean_effect),
            bst_io_real_value(list[i].spread),
            bst_io_int_value(list[i].count)};
        BST_TRY(bst_table_row(ctx, t, row));
    }
    return BST_OK;
}

/* True if the sampling design yields effects: morris or one_at_a_time. */
static bool has_effects(const bst_study_factor *f) {
    return f->design == BST_SWEEP_MORRIS || f->design == BST_SWEEP_ONE_AT_A_TIME;
}

/* Writes the table sensitivity, or speed_sensitivity if `speed`. */
static bst_status write_table(bst_ctx *ctx, const bst_tables_job *j, const char *name,
                              const char *doc, bool speed) {
    static const bst_io_column columns[] = {
        {"sweep", BST_COLUMN_INT, "", "Number of the sweep in the study."},
        {"design", BST_COLUMN_TEXT, "", "morris or one_at_a_time."},
        {"metric", BST_COLUMN_TEXT, "", "The figure."},
        {"rank", BST_COLUMN_INT, "", "1: the axis with the largest effect."},
        {"axis", BST_COLUMN_TEXT, "", "Name of the axis."},
        {"effect", BST_COLUMN_REAL, "",
         "Change of the figure over the axis' range: mean magnitude of elementary effects "
         "(morris), greatest less least (one_at_a_time)."},
        {"effect_error", BST_COLUMN_REAL, "", "Its standard error."},
        {"mean_effect", BST_COLUMN_REAL, "", "The same with its sign."},
        {"spread", BST_COLUMN_REAL, "",
         "Standard deviation of the effects: large if the effect is nonlinear or depends on other "
         "axes."},
        {"effects", BST_COLUMN_INT, "", "Number of effects averaged."}};
    const bst_study *s = j->results->study;
    bst_table_out t;
    const bst_table_design design = {name, doc, columns, 10, true};
    BST_TRY(bst_table_begin(ctx, j->out, &design, &t));
    bst_status status = BST_OK;
    for (int f = 0; f < s->factor_count && status == BST_OK; f++) {
        if (!has_effects(&s->factors[f])) {
            continue;
        }
        for (int m = 0; m < (speed ? 2 : j->metric_count) && status == BST_OK; m++) {
            static const int figures[2] = {BST_SPEED_WALL, BST_SPEED_CPU};
            status = put_figure(ctx, j->results, f, speed ? figures[m] : j->metrics[m], &t);
        }
    }
    return bst_table_end(ctx, &t, status);
}

bst_status bst_study_write_sensitivity(bst_ctx *ctx, const bst_tables_job *j) {
    const bst_study *s = j->results->study;
    bool any = false;
    for (int f = 0; f < s->factor_count; f++) {
        any = any || has_effects(&s->factors[f]);
    }
    if (!any) {
        return BST_OK;
    }
    BST_TRY(write_table(ctx, j, "sensitivity", "Which axes matter for which figure.", false));
    return write_table(ctx, j, "speed_sensitivity", "Which axes matter for the time of a run.",
                       true);
}
