/* Report charts of a study's series: a rate against a key, such as detection against SNR, for each
 * setting. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/report/report_study.h"

/* maximum settings per chart, and charts; points per curve */
enum { CURVES = 6, CHARTS = 12, POINTS = 256 };

typedef struct series {
    char table[80], ideal[64];  /* ideal: column of an upper limit; "": none */
    char x[2][64], unit[2][32]; /* key, and a corresponding magnitude; "": none */
} series;

/* Finds the series with a rate against a key: its statistics begin with the columns setting, runs,
 * key. */
static bool find_series(const bst_report_study_view *v, series *out) {
    bst_ctx unheard = {0};
    bst_io_rows *rows;
    bool more;
    *out = (series){.table = ""};
    if (bst_io_rows_open(
            &unheard, v->tables,
            "SELECT tab, name, unit FROM columns WHERE tab LIKE '%\\_statistics' ESCAPE"
            " '\\' AND tab IN (SELECT tab FROM columns WHERE name = 'rate_low')"
            " ORDER BY rowid",
            0, 0, &rows) != BST_OK) {
        return false;
    }
    while (bst_io_rows_next(&unheard, rows, &more) == BST_OK && more) {
        const char *name = bst_io_rows_text(rows, 1);
        bool plain = strspn(name, "abcdefghijklmnopqrstuvwxyz0123456789_") == strlen(name);
        if (!plain || (out->table[0] && strcmp(out->table, bst_io_rows_text(rows, 0)) != 0)) {
            continue;
        }
        snprintf(out->table, sizeof out->table, "%s", bst_io_rows_text(rows, 0));
        bool key = !out->x[0][0] && strcmp(name, "setting") != 0 && strcmp(name, "runs") != 0;
        bool magnitude = strcmp(name, "v_mag") == 0;
        if (key || magnitude) {
            snprintf(out->x[!key], sizeof out->x[0], "%s", name);
            snprintf(out->unit[!key], sizeof out->unit[0], "%s", bst_io_rows_text(rows, 2));
        }
        if (strstr(name, "ideal") == name) {
            snprintf(out->ideal, sizeof out->ideal, "%s", name);
        }
    }
    bst_io_rows_close(rows);
    return out->table[0] && out->x[0][0] &&
           strspn(out->table, "abcdefghijklmnopqrstuvwxyz0123456789_") == strlen(out->table);
}

typedef struct curve {
    double x[POINTS], rate[POINTS], low[POINTS], high[POINTS], ideal[POINTS];
    int count;
} curve;

static bst_status read_curve(bst_ctx *ctx, const bst_report_study_view *v, const series *s, int x,
                             int64_t setting, curve *out) {
    char sql[500];
    bst_io_rows *rows;
    bst_status status;
    bool more;
    out->count = 0;
    snprintf(sql, sizeof sql,
             "SELECT \"%s\", rate, rate_low, rate_high, %s%s%s FROM \"%s\" WHERE setting = ?1"
             " ORDER BY 1",
             s->x[x], s->ideal[0] ? "\"" : "", s->ideal[0] ? s->ideal : "NULL",
             s->ideal[0] ? "\"" : "", s->table);
    BST_TRY(bst_io_rows_open(ctx, v->tables, sql, setting, 0, &rows));
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more && out->count < POINTS) {
        int i = out->count++;
        out->x[i] = bst_io_rows_real(rows, 0);
        out->rate[i] = bst_io_rows_real(rows, 1);
        out->low[i] = bst_io_rows_real(rows, 2);
        out->high[i] = bst_io_rows_real(rows, 3);
        out->ideal[i] = bst_io_rows_real(rows, 4);
    }
    bst_io_rows_close(rows);
    return status;
}

/* Text of a setting: "read_noise_e 3, aperture_m 0.1". */
static void describe(const bst_report_study_view *v, int64_t setting,
                     const bst_report_study_axis_view *without,
                     const bst_report_study_axis_view *only, char text[200]) {
    size_t n = 0;
    text[0] = '\0';
    for (int i = 0; i < v->axis_count; i++) {
        const bst_report_study_axis_view *a = &v->axes[i];
        char word[32];
        if (a->swept && a->level_count > 1 && a != without && (!only || a == only) && n < 190) {
            n += (size_t)snprintf(text + n, 200 - n, "%s%s %s", n ? ", " : "", a->name,
                                  bst_report_study_word(a, a->of_setting[setting], word));
        }
    }
}

/* Settings whose curves share a chart. */
typedef struct chart_group {
    int64_t settings[CURVES];
    int count;
    const bst_report_study_axis_view *lines; /* the axis in which they differ; NULL: one curve */
} chart_group;

/* Draws one chart against s->x[x]. */
static bst_status put_chart(bst_ctx *ctx, FILE *out, const bst_report_study_view *v,
                            const series *s, int x, const chart_group *g) {
    const int64_t *group = g->settings;
    const bst_report_study_axis_view *lines = g->lines;
    int count = g->count;
    static const int colours[CURVES] = {BST_CHART_BLUE,   BST_CHART_ORANGE, BST_CHART_GREEN,
                                        BST_CHART_VIOLET, BST_CHART_CYAN,   BST_CHART_BROWN};
    curve *curves = calloc((size_t)count, sizeof *curves);
    bst_status status = curves ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for curves");
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < count && status == BST_OK; i++) {
        status = read_curve(ctx, v, s, x, group[i], &curves[i]);
        bst_chart_widen(curves[i].x, (size_t)curves[i].count, false, &low, &high);
    }
    if (status == BST_OK && low <= high) {
        char label[100], where[200], caption[400];
        snprintf(label, sizeof label, "%s%s%s", strcmp(s->x[x], "snr") == 0 ? "SNR" : s->x[x],
                 s->unit[x][0] ? ", " : "", s->unit[x]);
        describe(v, group[0], lines, NULL, where);
        bst_report_page_figure(out, BST_PAGE_HALF);
        bst_chart c = {.out = out,
                       .name = "Rate of detection with 95 % intervals and the ideal",
                       .width = 540.0,
                       .height = 300.0,
                       .margin_left = 60.0,
                       .x = {.label = label},
                       .y = {.label = "rate of detection", .low = 0.0, .high = 1.02}};
        bst_chart_fit(&c.x, low, high, 0.03);
        bst_chart_begin(&c);
        for (int i = 0; i < count; i++) {
            const curve *k = &curves[i];
            size_t n = (size_t)k->count;
            if (s->ideal[0]) {
                bst_chart_line(&c, k->x, k->ideal, n, count == 1 ? BST_CHART_RED : colours[i],
                               true);
            }
            bst_chart_line(&c, k->x, k->rate, n, colours[i], false);
            bst_chart_whiskers(&c, k->x, k->low, k->high, n, colours[i]);
            bst_chart_dots(&c, k->x, k->rate, n, colours[i]);
        }
        bst_chart_end(&c);
        fputs("<ul class=\"legend\">\n", out);
        for (int i = 0; i < count; i++) {
            char entry[200] = "measured, 95 %";
            if (lines) {
                describe(v, group[i], NULL, lines, entry);
            }
            bst_chart_legend(out, BST_KEY_LINE, colours[i], entry);
        }
        if (s->ideal[0]) {
            bst_chart_legend(out, BST_KEY_DASHED, count == 1 ? BST_CHART_RED : BST_CHART_GREY,
                             "ideal, place and shape known");
        }
        fputs("</ul>\n", out);
        snprintf(caption, sizeof caption,
                 "%s%sOf all trials of the runs, with 95 %% intervals. The ideal detector knows "
                 "the place: noise "
                 "of the trials, or the highest of several places, can lie above it.",
                 where, where[0] ? ". " : "");
        bst_report_page_figure_end(out, caption);
    }
    free(curves);
    return status;
}

/* Selects the axis whose values become the lines of a chart: fewest values, at most CURVES. */
static const bst_report_study_axis_view *choose_lines(const bst_report_study_view *v) {
    const bst_report_study_axis_view *best = NULL;
    for (int i = 0; i < v->axis_count; i++) {
        const bst_report_study_axis_view *a = &v->axes[i];
        bool grid = strcmp(a->design, "grid") == 0 || strcmp(a->design, "list") == 0;
        if (a->swept && grid && a->level_count > 1 && a->level_count <= CURVES &&
            (!best || a->level_count > best->level_count)) {
            best = a;
        }
    }
    return best;
}

/* Checks whether two settings differ in no axis except `free_axis`. */
static bool alike(const bst_report_study_view *v, int64_t a, int64_t b,
                  const bst_report_study_axis_view *free_axis) {
    for (int i = 0; i < v->axis_count; i++) {
        const bst_report_study_axis_view *x = &v->axes[i];
        if (x->swept && x != free_axis && x->of_setting[a] != x->of_setting[b]) {
            return false;
        }
    }
    return true;
}

bst_status bst_report_study_plot_curves(bst_ctx *ctx, FILE *out, const bst_report_study_view *v) {
    series s;
    if (v->settings < 1 || !find_series(v, &s)) {
        return BST_OK;
    }
    const bst_report_study_axis_view *lines = choose_lines(v);
    bool *taken = calloc((size_t)v->settings, sizeof *taken);
    if (!taken) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for curves");
    }
    bst_status status = BST_OK;
    int charts = 0;
    int64_t left_out = 0;
    bst_report_page_section(out, 2, "Curves");
    bst_report_page_grid(out, BST_PAGE_HALF);
    for (int64_t i = 0; i < v->settings && status == BST_OK; i++) {
        chart_group g = {.lines = lines};
        if (taken[i]) {
            continue;
        }
        for (int64_t k = i; k < v->settings && g.count < (lines ? CURVES : 1); k++) {
            if (!taken[k] && (k == i || alike(v, i, k, lines))) {
                taken[k] = true;
                g.settings[g.count++] = k;
            }
        }
        if (charts < CHARTS) {
            charts++;
            for (int x = 0; x < 2 && s.x[x][0] && status == BST_OK; x++) {
                status = put_chart(ctx, out, v, &s, x, &g);
            }
        } else {
            left_out += g.count;
        }
    }
    free(taken);
    bst_report_page_grid_end(out);
    if (left_out > 0) {
        fprintf(out, "<p class=\"note\">%lld more settings are in the table %s.</p>\n",
                (long long)left_out, s.table);
    }
    bst_report_page_section_end(out);
    return status;
}
