/* Plot of `boresight characterize`. */
#include <math.h>
#include <stdio.h>

#include "sim/analysis/characterize/characterize.h"
#include "sim/io/plot.h"

enum { HISTOGRAM_BINS = 200, HIT_BINS = 40 };

/* Panels of the plot. */
typedef struct panels {
    bool rows, dark, linearity, hits, comparison;
} panels;

/* Histogram of the dark map from below its 5th percentile, by a fifth of the distance to the 95th,
 * to the 99.9th. */
static void put_dark(FILE *script, const bst_sensor_figures *f) {
    int64_t bins[HISTOGRAM_BINS] = {0};
    double low = f->percentiles_e_per_s[0], high = f->percentiles_e_per_s[6];
    low -= high - low > 0.0 ? 0.2 * (f->percentiles_e_per_s[4] - low) : 1.0;
    double width = (high - low) / HISTOGRAM_BINS;
    size_t pixels = (size_t)f->width * (size_t)f->height;
    for (size_t i = 0; i < pixels && width > 0.0; i++) {
        double at = ((double)f->dark_map[i] - low) / width;
        if (at >= 0.0 && at < HISTOGRAM_BINS) {
            bins[(int)at]++;
        }
    }
    fprintf(script, "$dark << EOD\n");
    for (int k = 0; k < HISTOGRAM_BINS; k++) {
        fprintf(script, "%.6g %lld\n", low + (k + 0.5) * width,
                (long long)bins[k] + (bins[k] == 0));
    }
    fprintf(script, "EOD\n");
}

/* Departure of the signals from the slope at 0 in percent, its fit, and photon transfer. */
static void put_linearity(FILE *script, const bst_sensor_stacks *stacks,
                          const bst_sensor_figures *f) {
    const bst_linearity_series *s = &stacks->linearity;
    const bst_linearity *l = &f->linearity;
    double level = f->figures[BST_SENSOR_OFFSET].value;
    fprintf(script, "$linearity << EOD\n");
    for (int i = 0; i < s->count; i++) {
        double signal = bst_mean_estimate(s->points[i].mean, BST_STACK_BLOCKS).value - level;
        double variance = bst_mean_estimate(s->points[i].variance, BST_STACK_BLOCKS).value;
        double t = s->points[i].exposure_s, u = t / l->longest_s, line = l->slope_dn_per_s * t;
        double curve = u * (l->shape[0] + u * (l->shape[1] + u * l->shape[2]));
        if (t > 0.0) {
            fprintf(script, "%.8g %.6g %.6g %.6g\n", signal, 100.0 * (signal / line - 1.0),
                    signal <= l->largest_dn ? 100.0 * curve : NAN, variance);
        }
    }
    fprintf(script, "EOD\n");
}

/* Histogram of the logarithm of the hits' charge, two decades about its middle. */
static void put_hits(FILE *script, const bst_radiation_hits *h, double gain, double median_e) {
    int bins[HIT_BINS] = {0};
    for (size_t i = 0; i < h->used; i++) {
        double at = HIT_BINS * 0.5 * (1.0 + log10((double)h->items[i].charge_dn * gain / median_e));
        bins[at <= 0.0 ? 0 : at >= HIT_BINS ? HIT_BINS - 1 : (int)at]++;
    }
    fprintf(script, "$hits << EOD\n");
    for (int k = 0; k < HIT_BINS; k++) {
        fprintf(script, "%.6g %d\n", median_e * pow(10.0, 2.0 * (k + 0.5) / HIT_BINS - 1.0),
                bins[k]);
    }
    fprintf(script, "EOD\n");
}

/* Power along the rows, and percentiles, of a real and a simulated frame. */
static void put_comparison(FILE *script, const bst_characterize_comparison *c) {
    fprintf(script, "$power << EOD\n");
    for (int i = 0; i < BST_COMPARISON_BANDS; i++) {
        fprintf(script, "%.6g %.6g %.6g\n", bst_comparison_frequency(i), c->real.spectrum[i],
                c->simulated.spectrum[i]);
    }
    fprintf(script, "EOD\n$correlation << EOD\n");
    for (int i = 0; i < BST_COMPARISON_LAGS; i++) {
        fprintf(script, "%d %.6g %.6g %.6g %.6g\n", i + 1, c->real.along_rows[i],
                c->simulated.along_rows[i], c->real.along_columns[i],
                c->simulated.along_columns[i]);
    }
    fprintf(script, "EOD\n");
}

static void draw(FILE *script, const panels *p, const bst_sensor_figures *f) {
    if (p->rows) {
        fprintf(script,
                "set xlabel 'frequency along a row, cycles/px'\nset ylabel 'power over continuum'\n"
                "plot $rows with lines, %.6g with lines dashtype 2\n",
                f->line.least_ratio);
    }
    if (p->linearity) {
        fprintf(script,
                "set xlabel 'signal, DN'\nset ylabel 'departure from the slope at 0, %%'\n"
                "plot $linearity using 1:2 with points, $linearity using 1:3 with lines\n"
                "set ylabel 'variance between two flats, DN^2'\n"
                "plot $linearity using 1:4 with linespoints\n");
    }
    if (p->hits) {
        fprintf(script,
                "set logscale x\nset xlabel 'charge of a radiation hit, e-'\nset ylabel 'hits'\n"
                "plot $hits with steps\nunset logscale x\n");
    }
    if (p->comparison) {
        fprintf(script,
                "set key\nset xlabel 'frequency along a row, cycles/px'\nset ylabel 'power, DN^2 "
                "px'\nplot $power using 1:2 with lines title 'real', $power using 1:3 with lines "
                "title 'simulated'\nset xlabel 'distance, px'\nset ylabel 'correlation'\n"
                "plot $correlation using 1:2 with lines title 'real, along rows', "
                "$correlation using 1:3 with lines title 'simulated', "
                "$correlation using 1:4 with lines title 'real, along columns', "
                "$correlation using 1:5 with lines title 'simulated'\nunset key\n");
    }
    if (p->dark) {
        fprintf(script,
                "set logscale y\nset xlabel 'dark current, e-/s'\nset ylabel 'pixels'\n"
                "plot $dark with steps\n");
    }
}

bst_status bst_characterize_plot(bst_ctx *ctx, const char *folder, const bst_sensor_stacks *stacks,
                                 const bst_sensor_figures *f,
                                 const bst_characterize_comparison *comparison) {
    char path[4096 + 32];
    bst_plot plot;
    double charge = f->figures[BST_SENSOR_HIT_CHARGE].value;
    const panels p = {f->line.power != NULL,
                      f->dark_map && isfinite(f->percentiles_e_per_s[0]), /* a pixel has a value */
                      f->linearity.used > 0 && isfinite(f->linearity.slope_dn_per_s), charge > 0.0,
                      comparison->made};
    int count = p.rows + p.dark + 2 * p.linearity + p.hits + 2 * p.comparison;
    if (count == 0) {
        return BST_OK;
    }
    snprintf(path, sizeof path, "%s/plot.png", folder);
    BST_TRY(bst_plot_begin(ctx, &plot, path, 900, 380 * count));
    if (p.rows) {
        fprintf(plot.script, "$rows << EOD\n");
        for (int k = 1; k < f->line.bins; k++) {
            fprintf(plot.script, "%.6g %.6g\n", (double)k / f->width, f->line.power[k]);
        }
        fprintf(plot.script, "EOD\n");
    }
    if (p.dark) {
        put_dark(plot.script, f);
    }
    if (p.linearity) {
        put_linearity(plot.script, stacks, f);
    }
    if (p.hits) {
        put_hits(plot.script, &stacks->dark.hits, f->figures[BST_SENSOR_GAIN].value, charge);
    }
    if (p.comparison) {
        put_comparison(plot.script, comparison);
    }
    fprintf(plot.script, "set multiplot layout %d,1\nset grid\nunset key\n", count);
    draw(plot.script, &p, f);
    fprintf(plot.script, "unset multiplot\n");
    return bst_plot_end(ctx, &plot, NULL);
}
