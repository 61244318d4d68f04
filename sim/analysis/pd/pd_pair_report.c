#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>

#include "sim/analysis/pd/pd_pair.h"
#include "sim/core/json_number.h"
#include "sim/core/text.h"
#include "sim/eval/detection_theory.h"
#include "sim/io/plot.h"

/* Text of a separation; "-" if it is not determined. */
enum { NUMBER_TEXT = 32 };

static const char *text_of(char out[NUMBER_TEXT], const char *format, double value) {
    if (isfinite(value)) {
        snprintf(out, NUMBER_TEXT, format, value);
    } else {
        snprintf(out, NUMBER_TEXT, "-");
    }
    return out;
}

static void name_curve(const bst_pd_pair_curve *c, char *out, size_t size) {
    if (c->streak_px > 0.0) {
        snprintf(out, size, "streaks of %g px, %g:1", c->streak_px, c->ratio);
    } else {
        snprintf(out, size, "points, %g:1", c->ratio);
    }
}

static double share_of(int64_t count, int64_t all) {
    return all > 0 ? (double)count / (double)all : NAN;
}

static void print_point(const bst_pd_pair_point *p) {
    char found[NUMBER_TEXT], sigma[NUMBER_TEXT], known[NUMBER_TEXT], unknown[NUMBER_TEXT],
        over[NUMBER_TEXT];
    bst_eval_interval w = bst_eval_wilson_interval(p->split, p->singles, BST_NORMAL_95);
    printf("%7g %7.2f  %8s %6s  %7s %8s %6s  %8lld %8.4f  %.4f to %.4f\n", p->snr, p->v_mag,
           text_of(found, "%.3f", p->needed.snr), text_of(sigma, "%.3f", p->needed.sigma),
           text_of(known, "%.3f", p->bound.known_px), text_of(unknown, "%.3f", p->bound.unknown_px),
           text_of(over, "%.2f", p->needed.snr / p->bound.known_px), (long long)p->singles,
           share_of(p->split, p->singles), w.low, w.high);
    printf("%10s", "");
    for (int k = 0; k < p->separations; k++) {
        const bst_pd_pair_count *c = &p->counts[k];
        printf("%s%.3g px: %.3f", k ? ", " : "", c->separation_px, share_of(c->found, c->pairs));
    }
    printf("\n");
}

void bst_pd_pair_print(const bst_pd_pair_result *r) {
    printf("%s: %lld x %lld px, FWHM %.3g px, noise %.3g e- per pixel, %.3g s\n", r->sensor,
           (long long)r->width_px, (long long)r->height_px, r->fwhm_px, r->noise_e, r->exposure_s);
    printf("%s; %.1f s in all\n",
           bst_text_of_count((char[BST_COUNT_TEXT]){0}, r->frames, "frame", "frames"), r->wall_s);
    if (r->false_splits > 0.0) {
        printf("share of single sources that may be split: %g\n", r->false_splits);
    } else if (r->false_splits == 0.0) {
        printf(
            "no test for pairs: imgproc.false_splits is 0 (set one with --false-splits); bounds "
            "are at %g\n",
            r->bound_false_splits);
    } else {
        printf("bounds are at a share of false splits of %g\n", r->bound_false_splits);
    }
    for (int c = 0; c < r->count; c++) {
        char name[80];
        name_curve(&r->curves[c], name, sizeof name);
        printf("\n%s\n%7s %7s  %8s %6s  %7s %8s %6s  %8s %8s  %s\n", name, "SNR", "V", "px at 0.9",
               "sigma", "bound", "unknown", "over", "singles", "split", "95 %");
        for (int i = 0; i < r->curves[c].count; i++) {
            print_point(&r->curves[c].points[i]);
        }
    }
}

static cJSON *count_json(const bst_pd_pair_count *c) {
    cJSON *node = cJSON_CreateObject();
    bst_eval_interval w = bst_eval_wilson_interval(c->found, c->pairs, BST_NORMAL_95);
    bst_json_add_number(node, "separation_px", c->separation_px);
    bst_json_add_number(node, "pairs", (double)c->pairs);
    bst_json_add_number(node, "found", (double)c->found);
    bst_json_add_number(node, "pd", share_of(c->found, c->pairs));
    bst_json_add_number(node, "pd_low", w.low);
    bst_json_add_number(node, "pd_high", w.high);
    return node;
}

static cJSON *point_json(const bst_pd_pair_point *p) {
    cJSON *node = cJSON_CreateObject();
    bst_eval_interval w = bst_eval_wilson_interval(p->split, p->singles, BST_NORMAL_95);
    bst_json_add_number(node, "snr", p->snr);
    bst_json_add_number(node, "v_mag", p->v_mag);
    bst_json_add_number(node, "separation_pd90_px", p->needed.snr);
    bst_json_add_number(node, "separation_pd90_sigma_px", p->needed.sigma);
    bst_json_add_number(node, "bound_known_px", p->bound.known_px);
    bst_json_add_number(node, "bound_unknown_px", p->bound.unknown_px);
    bst_json_add_number(node, "singles", (double)p->singles);
    bst_json_add_number(node, "singles_split", (double)p->split);
    bst_json_add_number(node, "false_splits", share_of(p->split, p->singles));
    bst_json_add_number(node, "false_splits_low", w.low);
    bst_json_add_number(node, "false_splits_high", w.high);
    cJSON *separations = cJSON_AddArrayToObject(node, "separations");
    for (int k = 0; k < p->separations; k++) {
        cJSON_AddItemToArray(separations, count_json(&p->counts[k]));
    }
    return node;
}

cJSON *bst_pd_pair_json(const bst_pd_pair_result *r) {
    cJSON *root = cJSON_CreateObject();
    cJSON_AddStringToObject(root, "scenario", r->scenario);
    cJSON_AddStringToObject(root, "sensor", r->sensor);
    cJSON_AddStringToObject(root, "detector", r->detector);
    bst_json_add_number(root, "width_px", (double)r->width_px);
    bst_json_add_number(root, "height_px", (double)r->height_px);
    bst_json_add_number(root, "fwhm_px", r->fwhm_px);
    bst_json_add_number(root, "noise_e", r->noise_e);
    bst_json_add_number(root, "exposure_s", r->exposure_s);
    bst_json_add_number(root, "false_splits_requested",
                        r->false_splits >= 0.0 ? r->false_splits : NAN);
    bst_json_add_number(root, "bound_false_splits", r->bound_false_splits);
    bst_json_add_number(root, "frames", (double)r->frames);
    bst_json_add_number(root, "wall_s", r->wall_s);
    cJSON *curves = cJSON_AddArrayToObject(root, "curves");
    for (int c = 0; c < r->count; c++) {
        cJSON *curve = cJSON_CreateObject();
        bst_json_add_number(curve, "ratio", r->curves[c].ratio);
        bst_json_add_number(curve, "streak_px", r->curves[c].streak_px);
        cJSON *points = cJSON_AddArrayToObject(curve, "points");
        for (int i = 0; i < r->curves[c].count; i++) {
            cJSON_AddItemToArray(points, point_json(&r->curves[c].points[i]));
        }
        cJSON_AddItemToArray(curves, curve);
    }
    return root;
}

/* Colours of the ratios. */
static const char *const colours[BST_PD_PAIR_RATIOS] = {"#1f4e9c", "#c0392b", "#2a8c6e", "#7d5ba6"};

/* Writes the data of all curves as $c0, $c1, ... */
static void put_curves(FILE *o, const bst_pd_pair_result *r) {
    for (int c = 0; c < r->count; c++) {
        fprintf(o, "$c%d << BST_END\n", c);
        for (int i = 0; i < r->curves[c].count; i++) {
            const bst_pd_pair_point *p = &r->curves[c].points[i];
            bst_eval_interval w = bst_eval_wilson_interval(p->split, p->singles, BST_NORMAL_95);
            double sigma = isfinite(p->needed.sigma) ? BST_NORMAL_95 * p->needed.sigma : 0.0;
            fprintf(o, "%.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g\n", p->snr, p->needed.snr, sigma,
                    p->bound.known_px, p->bound.unknown_px, share_of(p->split, p->singles), w.low,
                    w.high);
        }
        fputs("BST_END\n", o);
    }
}

/* Marks the SNRs of a curve; many are left to gnuplot. */
static void put_snr_marks(FILE *o, const bst_pd_pair_curve *c) {
    enum { MOST_MARKS = 9 };
    for (int i = 0; i < c->count && c->count <= MOST_MARKS; i++) {
        fprintf(o, "%s%.9g%s", i ? ", " : "set xtics (", c->points[i].snr,
                i + 1 < c->count ? "" : ")\n");
    }
}

/* Sets a logarithmic axis of separations over all that is drawn in a panel, with marks at 1, 2 and
 * 5. */
static void set_separation_axis(FILE *o, const bst_pd_pair_result *r, int first, int end) {
    double low = INFINITY, high = 0.0;
    for (int c = first; c < end; c++) {
        for (int i = 0; i < r->curves[c].count; i++) {
            const bst_pd_pair_point *p = &r->curves[c].points[i];
            low = fmin(low, fmin(p->bound.known_px, p->needed.snr)); /* fmin ignores NAN */
            high = fmax(high, fmax(p->bound.unknown_px, p->needed.snr));
        }
    }
    if (!(low < high)) {
        low = 0.1 * r->fwhm_px;
        high = 10.0 * r->fwhm_px;
    }
    low *= 0.8;
    high *= 1.5;
    fprintf(o, "set yrange [%.9g:%.9g]\nset ytics (", low, high);
    const char *separator = "";
    for (double decade = pow(10.0, floor(log10(low))); decade < high; decade *= 10.0) {
        for (int k = 1; k <= 9; k++) {
            bool is_minor = k == 4 || k == 6 || k > 7; /* without a label */
            if (is_minor) {
                fprintf(o, "%s'' %.9g 1", separator, decade * k);
            } else {
                fprintf(o, "%s'%.9g' %.9g", separator, decade * k, decade * k);
            }
            separator = ", ";
        }
    }
    fputs(")\n", o);
}

/* Plots the separations of the curves first to end - 1 in one panel. */
static void plot_separations(FILE *o, const bst_pd_pair_result *r, int first, int end) {
    const char *separator = "plot ";
    for (int c = first; c < end; c++) {
        const char *colour = colours[c - first];
        fprintf(o,
                "%s$c%d using 1:2:3 with yerrorlines pointtype 7 pointsize 0.8 linecolor rgb '%s' "
                "title '%g:1, measured, 95 %%', "
                "$c%d using 1:5 with lines dashtype 2 linecolor rgb '%s' title 'bound, unknown', "
                "$c%d using 1:4 with lines dashtype 3 linecolor rgb '%s' title 'bound, known'",
                separator, c, colour, r->curves[c].ratio, c, colour, c, colour);
        separator = ", ";
    }
    fputs("\n", o);
}

/* Plots the shares of single sources that are split, with room for the key above. */
static void plot_splits(FILE *o, const bst_pd_pair_result *r, int first, int end) {
    double high = r->bound_false_splits;
    for (int c = first; c < end; c++) {
        for (int i = 0; i < r->curves[c].count; i++) {
            const bst_pd_pair_point *p = &r->curves[c].points[i];
            bst_eval_interval w = bst_eval_wilson_interval(p->split, p->singles, BST_NORMAL_95);
            high = fmax(high, w.high);
        }
    }
    fprintf(o, "set yrange [0:%.9g]\nplot %.9g with lines linecolor rgb '#6b7787' title 'stated'",
            1.35 * high, r->bound_false_splits);
    for (int c = first; c < end; c++) {
        fprintf(o,
                ", $c%d using 1:6:7:8 with yerrorbars pointtype 7 pointsize 0.7 linecolor rgb "
                "'%s' notitle",
                c, colours[c - first]);
    }
    fputs("\n", o);
}

bst_status bst_pd_pair_plot(bst_ctx *ctx, const char *path, const bst_pd_pair_result *r) {
    int points = 0;
    while (points < r->count && !(r->curves[points].streak_px > 0.0)) {
        points++;
    }
    int panels = r->count > points ? 2 : 1;
    bst_plot plot;
    BST_TRY(bst_plot_begin(ctx, &plot, path, 700 * panels, 800));
    FILE *o = plot.script;
    put_curves(o, r);
    fprintf(o,
            "set multiplot\nset grid linecolor rgb '#d8dde4'\nset lmargin 10\nset rmargin 2\n"
            "set logscale x\nset xrange [%.9g:%.9g]\n",
            0.85 * r->curves[0].points[0].snr,
            1.18 * r->curves[0].points[r->curves[0].count - 1].snr);
    put_snr_marks(o, &r->curves[0]);
    for (int k = 0; k < panels; k++) {
        int first = k ? points : 0, end = k ? r->count : points;
        char kind[64] = "points";
        if (k) {
            snprintf(kind, sizeof kind, "streaks of %g px, known motion",
                     r->curves[first].streak_px);
        }
        fprintf(o,
                "set size %.9g,0.68\nset origin %.9g,0.32\nset bmargin 0.8\nset tmargin 3\n"
                "set format x ''\nunset xlabel\nset logscale y\n"
                "set ylabel 'separation found with probability 0.9 / px'\n"
                "set key top right opaque samplen 2 spacing 1.1\n"
                "set title \"%s; FWHM %.3g px\" font ',12' noenhanced\n",
                1.0 / panels, 1.0 * k / panels, kind, r->fwhm_px);
        set_separation_axis(o, r, first, end);
        plot_separations(o, r, first, end);
        fprintf(o,
                "unset title\nset size %.9g,0.32\nset origin %.9g,0\nset tmargin 0.8\n"
                "set bmargin 3.4\nset format x '%%g'\nset xlabel 'SNR of both sources'\n"
                "unset logscale y\nset ytics autofreq\nset ylabel 'single "
                "sources split'\n",
                1.0 / panels, 1.0 * k / panels);
        plot_splits(o, r, first, end);
    }
    fputs("unset multiplot\n", o);
    return bst_plot_end(ctx, &plot, NULL);
}
