/* Chart of the reaction wheels of a sensor's spacecraft: table wheels. */
#include <math.h>
#include <stdlib.h>

#include "sim/report/report_plots.h"

enum { WHEELS_MOST = 8, POINTS_MOST = 100000 };

/* Speeds of the wheels over time, each [POINTS_MOST]. */
typedef struct wheel_speeds {
    double *x[WHEELS_MOST], *y[WHEELS_MOST];
    size_t n[WHEELS_MOST];
    double limit_rpm[WHEELS_MOST]; /* 0: no rows */
    double most_rpm[WHEELS_MOST];  /* largest magnitude */
    bool cut;                      /* there are more rows */
} wheel_speeds;

static void free_speeds(wheel_speeds *w) {
    for (int k = 0; k < WHEELS_MOST; k++) {
        free(w->x[k]);
    }
}

static bst_status add_speed(bst_ctx *ctx, wheel_speeds *w, const bst_io_rows *rows, double unit_s) {
    const int64_t k = bst_io_rows_int(rows, 1);
    const double speed = bst_io_rows_real(rows, 2);
    if (k < 0 || k >= WHEELS_MOST || !isfinite(speed)) {
        return BST_OK;
    }
    if (w->n[k] == POINTS_MOST) {
        w->cut = true;
        return BST_OK;
    }
    if (!w->x[k]) {
        w->x[k] = malloc(2 * POINTS_MOST * sizeof *w->x[k]);
        if (!w->x[k]) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the wheels");
        }
        w->y[k] = w->x[k] + POINTS_MOST;
    }
    w->x[k][w->n[k]] = bst_io_rows_real(rows, 0) / unit_s;
    w->y[k][w->n[k]++] = speed;
    w->most_rpm[k] = fmax(w->most_rpm[k], fabs(speed));
    w->limit_rpm[k] = fmax(w->limit_rpm[k], bst_io_rows_real(rows, 3));
    return BST_OK;
}

static bst_status read_speeds(bst_ctx *ctx, const bst_run_reader *run, int64_t sensor,
                              double unit_s, wheel_speeds *w) {
    bst_io_rows *rows;
    bst_ctx ignored = {0};
    bool more;
    if (bst_io_rows_open(&ignored, run,
                         "SELECT time_s, wheel, speed_rpm, speed_limit_rpm FROM wheels"
                         " WHERE sensor = ?1 ORDER BY rowid",
                         sensor, 0, &rows) != BST_OK) {
        return BST_OK; /* no wheels, or a run of an earlier version */
    }
    bst_status status;
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        status = add_speed(ctx, w, rows, unit_s);
        if (status != BST_OK) {
            break;
        }
    }
    bst_io_rows_close(rows);
    return status;
}

/* Largest speed as a share of the limit, with its wheel. */
static void describe(const wheel_speeds *w, char *text, size_t bytes) {
    int worst = -1;
    double share = -1.0, low = INFINITY, high = 0.0;
    char limits[64];
    static const char cut[] = " The first 100,000 times are drawn.";
    for (int k = 0; k < WHEELS_MOST; k++) {
        if (w->n[k] == 0 || !(w->limit_rpm[k] > 0.0)) {
            continue;
        }
        low = fmin(low, w->limit_rpm[k]);
        high = fmax(high, w->limit_rpm[k]);
        if (w->most_rpm[k] / w->limit_rpm[k] > share) {
            share = w->most_rpm[k] / w->limit_rpm[k];
            worst = k;
        }
    }
    if (worst < 0) {
        snprintf(text, bytes,
                 "Speed of the reaction wheels relative to the body. No limit was recorded.%s",
                 w->cut ? cut : "");
        return;
    }
    if (low < high) {
        snprintf(limits, sizeof limits, "%.6g to %.6g", low, high);
    } else {
        snprintf(limits, sizeof limits, "%.6g", low);
    }
    snprintf(text, bytes,
             "Speed of the reaction wheels relative to the body. Limit: %s rpm in both directions. "
             "Largest: %.4g rpm, %.3g %% of it, wheel %d.%s",
             limits, w->most_rpm[worst], 100.0 * share, worst, w->cut ? cut : "");
}

static void put_chart(FILE *out, const wheel_speeds *w, const char *label, double span,
                      double unit_s) {
    static const int colours[WHEELS_MOST] = {BST_CHART_BLUE,  BST_CHART_ORANGE, BST_CHART_GREEN,
                                             BST_CHART_RED,   BST_CHART_VIOLET, BST_CHART_CYAN,
                                             BST_CHART_BROWN, BST_CHART_GREY};
    char caption[320];
    bst_chart c = {.out = out,
                   .name = "Speed of the reaction wheels over time",
                   .width = 1100.0,
                   .height = 230.0,
                   .x = {.label = label, .low = 0.0, .high = span, .unit_s = unit_s},
                   .y = {.label = "speed, rpm"}};
    double low = INFINITY, high = -INFINITY;
    for (int k = 0; k < WHEELS_MOST; k++) {
        bst_chart_widen(w->y[k], w->n[k], false, &low, &high);
    }
    if (!(high >= low)) {
        return;
    }
    bst_chart_fit(&c.y, low, high, 0.05);
    bst_report_page_figure(out, BST_PAGE_WIDE);
    bst_chart_begin(&c);
    for (int k = 0; k < WHEELS_MOST; k++) {
        if (w->n[k] > 0) {
            bst_chart_line(&c, w->x[k], w->y[k], w->n[k], colours[k], false);
            for (int side = -1; side <= 1; side += 2) {
                const double limit = side * w->limit_rpm[k];
                if (limit > c.y.low && limit < c.y.high) {
                    bst_chart_rule(&c, limit, colours[k]);
                }
            }
        }
    }
    bst_chart_end(&c);
    fputs("<ul class=\"legend\">\n", out);
    for (int k = 0; k < WHEELS_MOST; k++) {
        if (w->n[k] > 0) {
            char name[24];
            snprintf(name, sizeof name, "wheel %d", k);
            bst_chart_legend(out, BST_KEY_LINE, colours[k], name);
        }
    }
    fputs("</ul>\n", out);
    describe(w, caption, sizeof caption);
    bst_report_page_figure_end(out, caption);
}

bst_status bst_report_wheels(bst_ctx *ctx, FILE *out, const bst_run_reader *run, int64_t sensor,
                             double span_s) {
    const char *unit;
    const double unit_s = bst_chart_time_unit(span_s, &unit);
    wheel_speeds w = {.cut = false};
    char label[40];
    snprintf(label, sizeof label, "time since the epoch, %s", unit);
    bst_status status = read_speeds(ctx, run, sensor, unit_s, &w);
    if (status == BST_OK) {
        put_chart(out, &w, label, span_s / unit_s, unit_s);
    }
    free_speeds(&w);
    return status;
}
