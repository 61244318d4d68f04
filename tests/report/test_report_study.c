/* The page of a study whose tables are written here: axes, means, curves, effects, histograms. */
#include <cjson/cJSON.h>

#include "boresight/vec.h"
#include "sim/core/compare.h"
#include "sim/report/report.h"
#include "sim/report/report_study.h"
#include "tests/report/run_tables.h"
#include "tests/report/svg_chart.h"

enum { GAINS = 4, NOISES = 3, SETTINGS = GAINS * NOISES, EACH = 2, RUNS = SETTINGS * EACH };

/* even in logarithms, and near to what would be even in steps */
static const double gains[GAINS] = {1, 2, 4, 8};
static const double noises[NOISES] = {3, 5, 8};

/* Metrics of a run: one with two values a setting, and one that is missing in some runs. */
static double rms_of(int run) {
    int setting = run / EACH;
    return 0.5 + 0.125 * (setting / NOISES) + 0.03 * (setting % NOISES) * (setting % NOISES) +
           (run % 2 ? 0.02 : -0.02);
}
static double loss_of(int run) {
    return run == 5 ? NAN : 3.0 - 0.1 * (run % 7);
}
static double wall_of(int run) {
    return 2.0 + 0.25 * (run / EACH) + 0.5 * (run % 2);
}

typedef struct fixture {
    run_tables tables;
    bst_report_study_view view;
} fixture;

static void make_tables(run_tables *t, const char *design) {
    run_tables_begin(t, BST_STUDY_DATABASE);
    run_tables_sql(
        t,
        "CREATE TABLE about (key TEXT, value TEXT);"
        "INSERT INTO about VALUES ('name', 'sweep'), ('kind', 'run'), ('seed', '0x7'),"
        " ('version', '9.9'), ('digest', 'abc'), ('runs', '%d'), ('replicates', '%d');"
        "CREATE TABLE axes (axis INT, name TEXT, path TEXT, role TEXT, design TEXT);"
        "INSERT INTO axes VALUES (0, 'gain', '/a/gain', 'sweep', '%s'),"
        " (1, 'noise', '/a/noise', 'sweep', '%s'), (2, 'drawn', '/a/drawn', 'dispersion', ''),"
        " (3, 'orbit', '/a/orbit', 'population', '');"
        "CREATE TABLE scenarios (scenario INT, name TEXT);"
        "INSERT INTO scenarios VALUES (0, 'only');"
        "CREATE TABLE metrics (metric TEXT, unit TEXT, doc TEXT, kind TEXT);"
        "INSERT INTO metrics VALUES ('pointing_rms_px', 'px', 'Pointing error.', 'mean'),"
        " ('loss_db_pd50', 'dB', 'Loss.', 'mean'), ('custody', '', 'Custody.', 'mean'),"
        " ('acquired', '', 'Acquired.', 'rate');"
        "CREATE TABLE settings (setting INT, gain REAL, noise REAL);"
        "CREATE TABLE runs (run INT, setting INT, status TEXT, error TEXT, gain REAL, noise"
        " REAL, drawn REAL, orbit TEXT, pointing_rms_px REAL, loss_db_pd50 REAL, custody"
        " REAL, acquired REAL);"
        "CREATE TABLE speed (run INT, wall_s REAL, cpu_s REAL);"
        "CREATE TABLE statistics (setting INT, metric TEXT, runs INT, missing INT, mean REAL,"
        " low REAL, high REAL, std REAL, minimum REAL, median REAL, p95 REAL, maximum REAL);"
        "CREATE TABLE columns (tab TEXT, name TEXT, unit TEXT);",
        RUNS + 1, EACH, design, design);
    for (int s = 0; s < SETTINGS; s++) {
        run_tables_sql(t, "INSERT INTO settings VALUES (%d, %g, %g)", s, gains[s / NOISES],
                       noises[s % NOISES]);
        double mean = 0.5 * (rms_of(2 * s) + rms_of(2 * s + 1));
        run_tables_sql(
            t,
            "INSERT INTO statistics VALUES (%d, 'pointing_rms_px', 2, 0, %.17g, %.17g, %.17g,"
            " 1, 2, 3, 4, 5)",
            s, mean, mean - 0.015, mean + 0.025);
    }
    for (int r = 0; r < RUNS; r++) {
        char loss[40] = "NULL";
        if (!isnan(loss_of(r))) {
            snprintf(loss, sizeof loss, "%.17g", loss_of(r));
        }
        int s = r / EACH;
        run_tables_sql(
            t,
            "INSERT INTO runs VALUES (%d, %d, '%s', '%s', %g, %g, %g, '%s', %.17g, %s, %.17g, %d)",
            100 + r, s, r == 9 ? "failed" : "done", r == 9 ? "no light" : "", gains[s / NOISES],
            noises[s % NOISES], 0.5 * r, r % 3 ? "leo" : "geo", rms_of(r), loss,
            r == 4 ? 0.25 : 0.9, r != 7 && r != 8);
        if (r != 3) { /* one without a time */
            run_tables_sql(t, "INSERT INTO speed VALUES (%d, %.17g, %.17g)", 100 + r, wall_of(r),
                           3.0 * wall_of(r));
        }
    }
    run_tables_sql(t,
                   "INSERT INTO statistics VALUES (NULL, 'pointing_rms_px', 24, 1, 0.7125, 0.6875,"
                   " 0.7375, 0.125, 0.48, 0.71, 0.96, 1.02)");
}

static void open_view(fixture *f) {
    bst_ctx ctx = {0};
    run_tables_close(&f->tables);
    bst_assert_ok(&ctx, bst_run_reader_open_study(&ctx, f->tables.place.folder, &f->tables.run));
    bst_assert_ok(&ctx, bst_report_study_view_read(&ctx, f->tables.run, &f->view));
}

static void close_view(fixture *f) {
    bst_report_study_view_free(&f->view);
    run_tables_end(&f->tables);
}

static void what_is_read(void **state) {
    (void)state;
    fixture f;
    make_tables(&f.tables, "grid");
    open_view(&f);
    const bst_report_study_view *v = &f.view;
    assert_string_equal(v->name, "sweep");
    assert_string_equal(v->seed, "0x7");
    assert_string_equal(v->version, "9.9");
    assert_string_equal(v->digest, "abc");
    assert_int_equal(v->expected_runs, RUNS + 1);
    assert_int_equal(v->replicates, EACH);
    assert_int_equal(v->settings, SETTINGS);
    assert_int_equal(v->runs, RUNS);
    assert_int_equal(v->failed, 1);
    assert_int_equal(v->axis_count, 4);
    assert_int_equal(v->metric_count, 4);
    const bst_report_study_axis_view *gain = &v->axes[0], *noise = &v->axes[1],
                                     *orbit = &v->axes[3];
    assert_true(gain->swept && noise->swept && !v->axes[2].swept && !orbit->swept);
    assert_true(orbit->population && !v->axes[2].population);
    assert_int_equal(gain->level_count, GAINS);
    assert_true(gain->logarithmic && !noise->logarithmic);
    for (int k = 0; k < GAINS; k++) {
        bst_assert_close(gain->levels[k], gains[k], 0);
    }
    assert_int_equal(noise->level_count, NOISES);
    for (int r = 0; r < RUNS; r++) {
        int s = r / EACH;
        assert_int_equal(v->run_numbers[r], 100 + r);
        assert_int_equal(v->setting_of_run[r], s);
        assert_int_equal(v->done[r], r != 9);
        bst_assert_close(gain->of_run[r], gains[s / NOISES], 0);
        bst_assert_close(v->axes[2].of_run[r], 0.5 * r, 0);
        char word[32];
        assert_string_equal(bst_report_study_word(orbit, orbit->of_run[r], word),
                            r % 3 ? "leo" : "geo");
        bst_assert_close(v->metrics[0].of_run[r], rms_of(r), 0);
        assert_int_equal(isnan(v->metrics[1].of_run[r]), r == 5);
        if (r == 3) {
            assert_true(isnan(v->wall.of_run[r]) && isnan(v->cpu.of_run[r]));
        } else {
            bst_assert_close(v->wall.of_run[r], wall_of(r), 0);
            bst_assert_close(v->cpu.of_run[r], 3 * wall_of(r), 0);
        }
    }
    for (int s = 0; s < SETTINGS; s++) {
        bst_assert_close(noise->of_setting[s], noises[s % NOISES], 0);
        double mean = 0.5 * (rms_of(2 * s) + rms_of(2 * s + 1));
        bst_assert_close(v->metrics[0].mean[s], mean, 1e-15);
        bst_assert_close(v->metrics[0].low[s], mean - 0.015, 1e-15);
        bst_assert_close(v->metrics[0].high[s], mean + 0.025, 1e-15);
        assert_true(isnan(v->metrics[1].mean[s]));
        /* the quickest run counts */
        bst_assert_close(v->wall.mean[s], wall_of(2 * s), 0);
        bst_assert_close(v->cpu.mean[s], 3 * wall_of(2 * s), 0);
    }
    assert_true(v->metrics[0].varies && v->metrics[3].varies && v->metrics[3].rate);
    assert_false(v->metrics[0].rate);
    int metrics[6];
    assert_int_equal(bst_report_study_key_metrics(v, metrics, 6), 4);
    assert_int_equal(metrics[0], 3); /* acquired, custody, pointing, loss */
    assert_int_equal(metrics[1], 2);
    assert_int_equal(metrics[2], 0);
    assert_int_equal(metrics[3], 1);
    assert_int_equal(bst_report_study_key_metrics(v, metrics, 3), 3);
    char label[128];
    assert_string_equal(bst_report_study_label(&v->metrics[0], label), "pointing_rms_px");
    assert_string_equal(bst_report_study_label(&v->metrics[1], label), "loss_db_pd50, dB");
    assert_string_equal(bst_report_study_label(&v->metrics[2], label), "custody");
    char word[32];
    assert_string_equal(bst_report_study_word(noise, NAN, word), "-");
    assert_string_equal(bst_report_study_word(noise, 1234567, word), "1.2346e+06");
    close_view(&f);
}

/* One run for each setting: its value is the mean. */
static void means_without_statistics(void **state) {
    (void)state;
    fixture f;
    make_tables(&f.tables, "grid");
    run_tables_sql(&f.tables,
                   "UPDATE about SET value = '1' WHERE key = 'replicates';"
                   "DELETE FROM statistics");
    open_view(&f);
    for (int s = 0; s < SETTINGS; s++) {
        double sum = 0.0;
        int n = 0;
        for (int r = 2 * s; r < 2 * s + 2; r++) {
            if (!isnan(loss_of(r))) {
                sum += loss_of(r);
                n++;
            }
        }
        bst_assert_close(f.view.metrics[1].mean[s], sum / n, 1e-14);
        assert_true(isnan(f.view.metrics[1].low[s]));
    }
    close_view(&f);
}

static char *write_text(void (*plot)(FILE *out, const bst_report_study_view *v),
                        const bst_report_study_view *v) {
    char *text;
    size_t bytes;
    FILE *out = open_memstream(&text, &bytes);
    plot(out, v);
    fclose(out);
    return text;
}

static void curves_over_an_axis(void **state) {
    (void)state;
    fixture f;
    make_tables(&f.tables, "grid");
    open_view(&f);
    char *page = write_text(bst_report_study_plot_axes, &f.view);
    static const char *const colours[] = {"l c0", "l c1", "l c2", "l c4"};
    svg_chart c = svg_need(page, "pointing_rms_px against gain", true, false);
    double x[100], y[100], most = gains[GAINS - 1], margin = pow(most, 0.04);
    bst_assert_close(log10(svg_low_x(&c)), log10(1 / margin), 0.01);
    bst_assert_close(log10(svg_high_x(&c)), log10(most * margin), 0.01);
    for (int k = 0; k < NOISES; k++) { /* a line for each noise */
        char class_of[40];
        for (int dots = 0; dots < 2; dots++) {
            snprintf(class_of, sizeof class_of, "l %s%s\"", dots ? "o " : "", colours[k] + 2);
            assert_int_equal(svg_points(&c, class_of, 0, x, y, 100), GAINS);
            for (int g = 0; g < GAINS; g++) {
                bst_assert_close(log10(x[g]), log10(gains[g]), 0.01);
                bst_assert_close(y[g], f.view.metrics[0].mean[g * NOISES + k], 0.002);
            }
        }
        snprintf(class_of, sizeof class_of, "a c%c", colours[k][3]);
        assert_int_equal(svg_points(&c, class_of, 0, x, y, 100), 2 * GAINS);
        bst_assert_close(y[0], f.view.metrics[0].mean[k] + 0.025, 0.002);
        bst_assert_close(y[2 * GAINS - 1], f.view.metrics[0].mean[k] - 0.015, 0.002);
    }
    assert_non_null(strstr(c.caption, "noise 8"));
    c = svg_need(page, "pointing_rms_px against noise", false, false);
    for (int g = 0; g < GAINS; g++) {
        char class_of[40];
        snprintf(class_of, sizeof class_of, "%s\" stroke", colours[g]);
        assert_int_equal(svg_points(&c, class_of, 0, x, y, 100), NOISES);
        for (int k = 0; k < NOISES; k++) {
            bst_assert_close(x[k], noises[k], 0.02);
            bst_assert_close(y[k], f.view.metrics[0].mean[g * NOISES + k], 0.002);
        }
    }
    free(page);
    close_view(&f);
}

/* A dot for each setting of a hypercube; charts of effects instead for other designs. */
static void other_designs(void **state) {
    (void)state;
    fixture f;
    make_tables(&f.tables, "latin_hypercube");
    open_view(&f);
    char *page = write_text(bst_report_study_plot_axes, &f.view);
    svg_chart c = svg_need(page, "pointing_rms_px against noise, a dot", false, false);
    double x[100], y[100];
    assert_int_equal(svg_points(&c, "l o c0", 0, x, y, 100), SETTINGS);
    for (int s = 0; s < SETTINGS; s++) {
        bst_assert_close(x[s], noises[s % NOISES], 0.02);
        bst_assert_close(y[s], f.view.metrics[0].mean[s], 0.003);
    }
    free(page);
    close_view(&f);
    make_tables(&f.tables, "morris");
    open_view(&f);
    page = write_text(bst_report_study_plot_axes, &f.view);
    assert_string_equal(page, "");
    free(page);
    close_view(&f);
}

static void histograms(void **state) {
    (void)state;
    fixture f;
    make_tables(&f.tables, "grid");
    /* a value far off does not flatten the others, and is counted */
    run_tables_sql(&f.tables, "UPDATE runs SET pointing_rms_px = 5000 WHERE run = 110");
    open_view(&f);
    char *page = write_text(bst_report_study_plot_histograms, &f.view);
    svg_chart c, none;
    c = svg_need(page, "Histogram of pointing_rms_px", false, false);
    svg_bar bars[64];
    int count = svg_bars(&c, -1, bars, 64);
    double total = 0.0;
    for (int i = 0; i < count; i++) {
        total += bars[i].y1;
    }
    bst_assert_close(total, RUNS - 1, 0.3);
    bst_assert_close(svg_low_x(&c), rms_of(0), 0.02);
    /* eight times the distance of the quartiles above the upper one */
    double values[RUNS];
    for (int r = 0; r < RUNS; r++) {
        values[r] = r == 10 ? 5000.0 : rms_of(r);
    }
    qsort(values, RUNS, sizeof *values, bst_compare_doubles);
    double quarter = values[RUNS / 4], upper = values[RUNS - 1 - RUNS / 4];
    bst_assert_close(svg_high_x(&c), upper + 8.0 * (upper - quarter), 0.02);
    assert_non_null(strstr(c.caption, "Pointing error. 23 runs; 1 more lie outside."));
    c = svg_need(page, "Histogram of loss_db_pd50", false, false);
    bst_assert_close(svg_low_x(&c), 2.4, 0.01);
    bst_assert_close(svg_high_x(&c), 3.0, 0.01);
    assert_non_null(strstr(c.caption, "Loss. 23 runs."));
    assert_false(svg_find(page, "Histogram of acquired", false, false, &none)); /* a rate */
    free(page);
    close_view(&f);
}

/* Rows of a table of effects, ranked. */
static void add_effects(run_tables *t, const char *table, const char *design, const char *metric) {
    run_tables_sql(
        t,
        "CREATE TABLE IF NOT EXISTS %s (sweep INT, rank INT, design TEXT, metric TEXT, axis"
        " TEXT, effect REAL, effect_error REAL, spread REAL, effects INT);"
        "INSERT INTO %s VALUES (0, 2, '%s', '%s', 'noise', 0.4, NULL, 0.6, 20),"
        " (0, 1, '%s', '%s', 'gain', 1.5, 0.25, 0.3, 20), (0, 1, 'x', '%s', 'gain', 9, 9, 9, 9),"
        " (0, 3, '%s', 'x', 'gain', 9, 9, 9, 9), (0, 3, '%s', '%s', 'drawn', 9, 9, 9, 9)",
        table, table, design, metric, design, metric, metric, design, design, metric);
}

static void effects_of_morris(void **state) {
    (void)state;
    fixture f;
    bst_ctx ctx = {0};
    char *page;
    size_t bytes;
    make_tables(&f.tables, "morris");
    add_effects(&f.tables, "sensitivity", "morris", "pointing_rms_px");
    add_effects(&f.tables, "speed_sensitivity", "morris", "wall_s");
    open_view(&f);
    FILE *out = open_memstream(&page, &bytes);
    bst_assert_ok(&ctx, bst_report_study_plot_sensitivity(&ctx, out, &f.view));
    fclose(out);
    svg_chart c = svg_need(page, "Ranked effects on pointing_rms_px", false, false), none;
    svg_bar bars[8];
    bst_assert_close(svg_high_x(&c), 1.05 * (1.5 + 1.96 * 0.25), 0.01);
    assert_int_equal(svg_bars(&c, 0, bars, 8), 2);
    bst_assert_close(bars[0].x1, 1.5, 0.01);
    bst_assert_close(2 * bars[0].y0, 1.2, 0.02);
    bst_assert_close(2 * bars[0].y1, 1.8, 0.02);
    assert_string_equal(bars[0].title, "gain");
    bst_assert_close(bars[1].x1, 0.4, 0.01);
    bst_assert_close(2 * bars[1].y0, 0.2, 0.02);
    assert_int_equal(svg_bars(&c, 1, bars, 8), 2);
    bst_assert_close(bars[0].x0, 1.5 - 0.49, 0.01);
    bst_assert_close(bars[0].x1, 1.5 + 0.49, 0.01);
    bst_assert_close(2 * bars[0].y0, 1.46, 0.02);
    bst_assert_close(bars[1].x0, 0.4, 0.01); /* no error is known */
    bst_assert_close(bars[1].x1, 0.4, 0.01);
    assert_non_null(strstr(c.from, "1  gain"));
    assert_non_null(strstr(c.caption, "Mean size of 20 elementary effects"));
    c = svg_need(page, "Spread against size of the effects on pointing_rms_px", false, false);
    double x, y;
    assert_int_equal(svg_points(&c, "l o c0", 0, &x, &y, 1), 1);
    bst_assert_close(x, 1.5, 0.01);
    bst_assert_close(y, 0.3, 0.01);
    assert_int_equal(svg_points(&c, "l o c0", 1, &x, &y, 1), 1);
    bst_assert_close(x, 0.4, 0.01);
    bst_assert_close(y, 0.6, 0.01);
    bst_assert_close(svg_high_y(&c), 1.15 * 0.6, 0.01);
    assert_true(svg_find(page, "Ranked effects on wall_s", false, false, &c));
    assert_false(svg_find(page, "Ranked effects on cpu_s", false, false, &none));
    free(page);
    close_view(&f);
}

/* Setting 0 is the scenario's own; those that differ from it in one axis are the ends. */
static void effects_one_at_a_time(void **state) {
    (void)state;
    fixture f;
    bst_ctx ctx = {0};
    char *page;
    size_t bytes;
    make_tables(&f.tables, "one_at_a_time");
    add_effects(&f.tables, "sensitivity", "one_at_a_time", "pointing_rms_px");
    run_tables_sql(&f.tables,
                   "CREATE TABLE speed_sensitivity (sweep INT, rank INT, design TEXT, metric"
                   " TEXT, axis TEXT, effect REAL, effect_error REAL, spread REAL,"
                   " effects INT)");
    open_view(&f);
    FILE *out = open_memstream(&page, &bytes);
    bst_assert_ok(&ctx, bst_report_study_plot_sensitivity(&ctx, out, &f.view));
    fclose(out);
    svg_chart c = svg_need(page, "Change of pointing_rms_px with one axis", false, false);
    const double *mean = f.view.metrics[0].mean;
    svg_bar bars[8];
    /* gain first: settings 3 (10) and 9 (1000); noise: settings 1 (5) and 2 (8) */
    const int ends[2][2] = {{3, 1}, {9, 2}};
    for (int end = 0; end < 2; end++) {
        assert_int_equal(svg_bars(&c, end, bars, 8), 2);
        for (int k = 0; k < 2; k++) {
            bst_assert_close(bars[k].x0, mean[0], 0.003);
            bst_assert_close(bars[k].x1, mean[ends[end][k]], 0.003);
            bst_assert_close(2 * bars[k].y1, 2 - k - (end ? 0.5 : 0.1), 0.02);
            bst_assert_close(2 * (bars[k].y1 - bars[k].y0), 0.36, 0.02);
        }
    }
    double low = mean[0], high = fmax(mean[9], mean[2]);
    bst_assert_close(svg_low_x(&c), low - 0.2 * (high - low), 0.01);
    bst_assert_close(svg_high_x(&c), high + 0.2 * (high - low), 0.01);
    free(page);
    close_view(&f);
}

/* A rate against a key: a chart for each gain or noise, with the ideal beside. */
static void curves_of_a_series(void **state) {
    (void)state;
    fixture f;
    bst_ctx ctx = {0};
    char *page;
    size_t bytes;
    make_tables(&f.tables, "grid");
    run_tables_sql(
        &f.tables,
        "INSERT INTO columns VALUES ('runs', 'run', ''), ('pd_statistics', 'setting', ''),"
        " ('pd_statistics', 'runs', ''), ('pd_statistics', 'snr', ''), ('pd_statistics',"
        " 'v_mag', 'mag'), ('pd_statistics', 'rate', ''), ('pd_statistics', 'rate_low', ''),"
        " ('pd_statistics', 'rate_high', ''), ('pd_statistics', 'ideal_pd', '');"
        "CREATE TABLE pd_statistics (setting INT, runs INT, snr REAL, v_mag REAL, rate REAL,"
        " rate_low REAL, rate_high REAL, ideal_pd REAL)");
    for (int s = 0; s < SETTINGS; s++) {
        for (int k = 0; k < 5; k++) {
            run_tables_sql(&f.tables,
                           "INSERT INTO pd_statistics VALUES (%d, 2, %g, %g, %g, %g, %g, %g)", s,
                           2.0 + k, 15.0 - k, 0.02 * s + 0.1 * k, 0.02 * s + 0.1 * k - 0.015,
                           0.02 * s + 0.1 * k + 0.01, 0.02 * s + 0.12 * k);
        }
    }
    open_view(&f);
    FILE *out = open_memstream(&page, &bytes);
    bst_assert_ok(&ctx, bst_report_study_plot_curves(&ctx, out, &f.view));
    fclose(out);
    /* lines of the axis with most values: charts of noise 3, 5, 8, each against SNR and V */
    static const char *const colours[] = {"c0", "c1", "c2", "c4"};
    const char *at = page;
    for (int chart = 0; chart < 6; chart++) {
        svg_chart c = svg_need(at, "Rate of detection", false, false);
        double x[10], y[10];
        for (int g = 0; g < GAINS; g++) {
            int setting = g * NOISES + chart / 2;
            for (int kind = 0; kind < 3; kind++) {
                char class_of[40];
                snprintf(class_of, sizeof class_of,
                         kind == 0   ? "l s %s"
                         : kind == 1 ? "l %s\" stroke"
                                     : "l o %s",
                         colours[g]);
                assert_int_equal(svg_points(&c, class_of, 0, x, y, 10), 5);
                for (int k = 0; k < 5; k++) {
                    int j = chart % 2 ? 4 - k : k; /* by ascending V */
                    bst_assert_close(x[k], chart % 2 ? 15.0 - j : 2.0 + j, 0.02);
                    bst_assert_close(y[k], 0.02 * setting + (kind == 0 ? 0.12 : 0.1) * j, 0.004);
                }
            }
        }
        at = c.caption;
        char where[60];
        snprintf(where, sizeof where, "noise %g. Of all trials", noises[chart / 2]);
        assert_non_null(svg_after(at, strstr(at, "</figcaption>"), where));
    }
    svg_chart none;
    assert_false(svg_find(at, "Rate of detection", false, false, &none));
    free(page);
    close_view(&f);
}

static void the_whole_page(void **state) {
    (void)state;
    fixture f;
    bst_ctx ctx = {0};
    char *page;
    size_t bytes;
    make_tables(&f.tables, "grid");
    run_tables_close(&f.tables);
    bst_assert_ok(&ctx, bst_run_reader_open_study(&ctx, f.tables.place.folder, &f.tables.run));
    FILE *out = open_memstream(&page, &bytes);
    bst_assert_ok(&ctx, bst_report_study(&ctx, f.tables.run, out));
    fclose(out);
    const char *const words[] = {
        "Study sweep",
        "badge bad\">not complete<",
        "1 of 25 runs are missing",
        "1 of 24 runs failed.",
        "In 2 of 23 runs the target was never acquired",
        "Settings have 2 runs each",
        "<td class=\"n\">1</td><td class=\"n\">109</td><td>no light</td>",
        "<td>gain</td><td>sweep, grid</td><td>1, 2, 4, 8</td><td>/a/gain</td>",
        "<td>drawn</td><td>dispersion</td><td>drawn from 0 to 11.5</td>",
        "<td>orbit</td><td>population</td><td>2 values</td>",
        "24 of 25, 2 a setting",
        "runs done</small><b>23<",
        "of 25; 1 failed",
        "From the least to the greatest mean of the 12 settings",
        "<td>pointing_rms_px</td><td>px</td><td class=\"n\">0.7125</td><td class=\"n\">0.6875</td>"
        "<td class=\"n\">0.7375</td><td class=\"n\">0.1250</td><td class=\"n\">0.4800</td>"
        "<td class=\"n\">0.7100</td><td class=\"n\">0.9600</td><td class=\"n\">1.020</td>"
        "<td class=\"n\">24</td><td class=\"n\">1</td><td>Pointing error.</td>",
        /* the worst first: run 104 with the least custody, then the largest error */
        "Runs with the least custody",
        "</thead>\n<tbody>\n<tr><td class=\"n\">104</td><td class=\"n\">1</td><td "
        "class=\"n\">8</td>",
        "<tr><td class=\"n\">123</td>",
        "<td class=\"n\">0</td><td class=\"n\">1</td><td class=\"n\">3</td>",
        "<td class=\"n\">0.500 [0.485, 0.525]</td>",
    };
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        if (!strstr(page, words[i])) {
            fail_msg("the page does not have \"%s\"", words[i]);
        }
    }
    char range[100];
    snprintf(range, sizeof range, "pointing_rms_px</small><b>%.3f to %.3f", 0.5,
             0.5 + 0.375 + 0.12);
    assert_non_null(strstr(page, range));
    free(page);
    run_tables_end(&f.tables);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_read),
        cmocka_unit_test(means_without_statistics),
        cmocka_unit_test(curves_over_an_axis),
        cmocka_unit_test(other_designs),
        cmocka_unit_test(histograms),
        cmocka_unit_test(effects_of_morris),
        cmocka_unit_test(effects_one_at_a_time),
        cmocka_unit_test(curves_of_a_series),
        cmocka_unit_test(the_whole_page),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
