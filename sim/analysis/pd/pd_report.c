#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>

#include "sim/analysis/pd/pd.h"
#include "sim/core/json_number.h"
#include "sim/core/text.h"
#include "sim/eval/detection_theory.h"
#include "sim/io/plot.h"

/* Figures at one SNR. */
typedef struct row {
    double pd, low, high, ideal, matched_filter;
    double over_bound[2], over_bound_both; /* RMS error over the bound: along (x), across (y) */
    double rms_px[2], bias_px[2];
    double flux_over_bound, flux_bias, chi_square;
    double phase_bias_px, phase_sigma_px; /* largest mean error as a function of pixel phase */
} row;

static double ratio(double square, double count, double bound_square, double bounds) {
    return count > 0.0 && bounds > 0.0 ? sqrt(square / count / (bound_square / bounds)) : NAN;
}

static row row_of(const bst_pd_scene *s, const bst_pd_result *r, const bst_pd_figures *f, int i) {
    const bst_pd_tally *t = &r->tallies[i];
    double n = (double)t->matched, bounds = (double)t->bounds;
    bst_eval_interval w = bst_eval_wilson_interval(t->matched, t->trials, BST_NORMAL_95);
    double raw = t->trials > 0 ? n / (double)t->trials : NAN;
    row out = {.pd = bst_pd_without_chance(raw, f->chance),
               .low = bst_pd_without_chance(w.low, f->chance),
               .high = bst_pd_without_chance(w.high, f->chance),
               .ideal = f->pfa > 0.0 ? bst_eval_ideal_pd(f->pfa, s->snr[i]) : NAN,
               .matched_filter =
                   f->pfa > 0.0 ? bst_eval_matched_filter_pd(f->pfa, s->snr[i], s->own_light) : NAN,
               .over_bound_both = ratio(t->error_square[0] + t->error_square[1], n,
                                        t->bound_square[0] + t->bound_square[1], bounds),
               .flux_over_bound = ratio(t->flux_square, n, t->flux_bound_square, bounds),
               .flux_bias = t->flux_sum / n,
               .chi_square = t->chi_square / n,
               .phase_bias_px = NAN,
               .phase_sigma_px = NAN};
    for (int a = 0; a < 2; a++) {
        out.over_bound[a] = ratio(t->error_square[a], n, t->bound_square[a], bounds);
        out.rms_px[a] = sqrt(t->error_square[a] / n);
        out.bias_px[a] = t->error_sum[a] / n;
        for (int b = 0; b < BST_PD_PHASES && !s->sharpness; b++) {
            double count = (double)t->phase_count[a][b], mean = t->phase_sum[a][b] / count;
            if (count > 1.0 && !(fabs(mean) < fabs(out.phase_bias_px))) {
                out.phase_bias_px = fabs(mean);
                out.phase_sigma_px = out.rms_px[a] / sqrt(count);
            }
        }
    }
    return out;
}

static void print_loss(const char *name, bst_pd_needed needed, double ideal, double loss,
                       double sigma, double over_matched) {
    if (isfinite(loss)) {
        printf(
            "  Pd %s at SNR %.3f, ideal %.3f: loss %.2f dB (95 %%: %.2f to %.2f), %.2f dB over the "
            "matched filter\n",
            name, needed.snr, ideal, loss, loss - BST_NORMAL_95 * sigma,
            loss + BST_NORMAL_95 * sigma, over_matched);
        if (loss < 0.0) {
            printf(
                "    below 0: noise of the trials, or the gain of taking the highest of several "
                "places where the ideal detector tests one\n");
        }
    } else if (isfinite(needed.snr)) {
        printf(
            "  Pd %s at SNR %.3f; no loss without a false alarm: give more --empty-frames or "
            "--false-alarms\n",
            name, needed.snr);
    } else {
        printf("  Pd %s is not reached from both sides: widen --snr\n", name);
    }
}

static void print_head(const bst_pd_scene *s, const bst_pd_result *r) {
    printf("%s: %lld x %lld px, FWHM %.3g px, noise %.3g e- per pixel, %.3g s; ", s->name,
           (long long)s->camera.width_px, (long long)s->camera.height_px, s->fwhm_px, s->noise_e,
           s->exposure_s);
    if (s->options.stack > 0) {
        printf("points in stacks of %lld frames, rates to %g px per frame\n",
               (long long)s->options.stack, s->options.rates_px);
    } else if (s->sharpness) {
        printf("streaks of %g px, rate and direction %s\n", s->options.streak_px,
               s->options.known_rate ? "known" : "unknown");
    } else {
        printf("points\n");
    }
    printf(
        "%s with up to %d targets, %lld without; processing %.1f ms a frame, %.1f s in "
        "all\n\n",
        bst_text_of_count((char[BST_COUNT_TEXT]){0}, r->frames, "frame", "frames"),
        bst_pd_scene_room(s), (long long)r->empty_frames, 1e3 * r->process_s, r->wall_s);
    const char *const axes[2] = {s->sharpness ? "along" : "x", s->sharpness ? "across" : "y"};
    printf("%56s RMS error over bound\n%7s %7s %8s %7s  %-16s %6s %7s  %7s %7s %7s %6s %9s", "",
           "SNR", "V", "trials", "Pd", "95 %", "ideal", "matched", axes[0], axes[1], "flux", "chi2",
           "flux off");
    printf(s->sharpness ? "\n" : " %8s\n", "bias px");
}

void bst_pd_print(const bst_pd_scene *s, const bst_pd_result *r, const bst_pd_figures *f) {
    print_head(s, r);
    for (int i = 0; i < s->points; i++) {
        row p = row_of(s, r, f, i);
        printf("%7.3f %7.2f %8lld %7.4f  %.4f to %.4f %6.4f %7.4f  %7.3f %7.3f %7.3f %6.2f %+9.4f",
               s->snr[i], s->v_mag[i], (long long)r->tallies[i].trials, p.pd, p.low, p.high,
               p.ideal, p.matched_filter, p.over_bound[0], p.over_bound[1], p.flux_over_bound,
               p.chi_square, p.flux_bias);
        if (!s->sharpness) {
            printf(" %8.4f", p.phase_bias_px);
        }
        printf("\n");
    }
    if (s->sky) {
        printf("\n  detections per frame without targets that may be stars: %.4g",
               (double)r->stars / fmax((double)r->empty_frames, 1.0));
    }
    printf("\n  false alarms per frame %.4g (95 %%: %.4g to %.4g)", f->false_alarms_per_frame,
           f->false_alarms_low, f->false_alarms_high);
    if (s->options.false_alarms > 0.0) {
        printf(", %g requested", s->options.false_alarms);
    }
    printf("\n");
    print_loss("0.5", f->pd50, bst_eval_ideal_snr(f->pfa, 0.5), f->loss_db_pd50,
               f->loss_db_sigma_pd50, f->own_light_db_pd50);
    print_loss("0.9", f->pd90, bst_eval_ideal_snr(f->pfa, 0.9), f->loss_db_pd90,
               f->loss_db_sigma_pd90, f->own_light_db_pd90);
    if (s->options.stack > 0 && isfinite(f->gain_db_pd50) && isfinite(f->gain_db_pd90)) {
        printf(
            "  gain of the stack at the same false alarms per frame, ideal %.2f dB: Pd 0.5 %.2f dB "
            "over the ideal detector of one frame, %.2f dB over this one's; Pd 0.9 %.2f dB, %.2f "
            "dB\n",
            10.0 * log10((double)s->options.stack), f->gain_db_pd50, f->gain_over_single_db_pd50,
            f->gain_db_pd90, f->gain_over_single_db_pd90);
    }
    if (r->lost > 0) {
        printf("  no room for %s, which are missing\n",
               bst_text_of_count((char[BST_COUNT_TEXT]){0}, r->lost, "detection", "detections"));
    }
}

static cJSON *point_json(const bst_pd_scene *s, const bst_pd_result *r, const bst_pd_figures *f,
                         int i) {
    row p = row_of(s, r, f, i);
    cJSON *node = cJSON_CreateObject();
    bst_json_add_number(node, "snr", s->snr[i]);
    bst_json_add_number(node, "v_mag", s->v_mag[i]);
    bst_json_add_number(node, "flux_e", s->flux_e[i]);
    bst_json_add_number(node, "trials", (double)r->tallies[i].trials);
    bst_json_add_number(node, "detected", (double)r->tallies[i].matched);
    bst_json_add_number(node, "pd", p.pd);
    bst_json_add_number(node, "pd_low", p.low);
    bst_json_add_number(node, "pd_high", p.high);
    bst_json_add_number(node, "ideal_pd", p.ideal);
    bst_json_add_number(node, "matched_filter_pd", p.matched_filter);
    bst_json_add_number(node, "centroid_rms_over_bound", p.over_bound_both);
    const char *const axes[2] = {s->sharpness ? "along" : "x", s->sharpness ? "across" : "y"};
    for (int a = 0; a < 2; a++) {
        char key[64];
        snprintf(key, sizeof key, "centroid_rms_over_bound_%s", axes[a]);
        bst_json_add_number(node, key, p.over_bound[a]);
        snprintf(key, sizeof key, "centroid_rms_%s_px", axes[a]);
        bst_json_add_number(node, key, p.rms_px[a]);
        snprintf(key, sizeof key, "centroid_bias_%s_px", axes[a]);
        bst_json_add_number(node, key, p.bias_px[a]);
    }
    bst_json_add_number(node, "centroid_chi_square", p.chi_square);
    bst_json_add_number(node, "flux_rms_over_bound", p.flux_over_bound);
    bst_json_add_number(node, "flux_bias", p.flux_bias);
    if (!s->sharpness) {
        bst_json_add_number(node, "phase_bias_px", p.phase_bias_px);
        bst_json_add_number(node, "phase_bias_sigma_px", p.phase_sigma_px);
    }
    return node;
}

cJSON *bst_pd_json(const bst_pd_scene *s, const bst_pd_result *r, const bst_pd_figures *f) {
    cJSON *root = cJSON_CreateObject();
    cJSON_AddStringToObject(root, "scenario", s->scenario->name);
    cJSON_AddStringToObject(root, "sensor", s->name);
    cJSON_AddStringToObject(root, "detector", s->imgproc->desc->type);
    bst_json_add_number(root, "width_px", (double)s->camera.width_px);
    bst_json_add_number(root, "height_px", (double)s->camera.height_px);
    bst_json_add_number(root, "fwhm_px", s->fwhm_px);
    bst_json_add_number(root, "jitter_px", s->options.jitter_px);
    bst_json_add_number(root, "noise_e", s->noise_e);
    bst_json_add_number(root, "background_e", s->sky_e + s->dark_e);
    bst_json_add_number(root, "exposure_s", s->exposure_s);
    bst_json_add_number(root, "streak_px", s->options.streak_px);
    cJSON_AddBoolToObject(root, "known_rate", s->options.known_rate);
    cJSON_AddBoolToObject(root, "stars", s->options.stars);
    bst_json_add_number(root, "star_streak_px", s->options.star_streak_px);
    bst_json_add_number(root, "targets_per_frame", bst_pd_scene_room(s));
    bst_json_add_number(root, "frames", (double)r->frames);
    bst_json_add_number(root, "empty_frames", (double)r->empty_frames);
    bst_json_add_number(root, "threshold_snr", r->threshold_snr);
    bst_json_add_number(root, "false_alarms_requested",
                        s->options.false_alarms > 0.0 ? s->options.false_alarms : NAN);
    bst_json_add_number(root, "false_alarms_per_frame", f->false_alarms_per_frame);
    bst_json_add_number(root, "false_alarms_low", f->false_alarms_low);
    bst_json_add_number(root, "false_alarms_high", f->false_alarms_high);
    bst_json_add_number(root, "star_detections_per_frame",
                        (double)r->stars / fmax((double)r->empty_frames, 1.0));
    bst_json_add_number(root, "unmatched_per_frame_with_targets",
                        (double)r->unmatched / fmax((double)r->frames, 1.0));
    bst_json_add_number(root, "further_per_frame_with_targets",
                        (double)r->second / fmax((double)r->frames, 1.0));
    bst_json_add_number(root, "chance", f->chance);
    bst_json_add_number(root, "snr_pd50", f->pd50.snr);
    bst_json_add_number(root, "snr_pd90", f->pd90.snr);
    bst_json_add_number(root, "loss_db_pd50", f->loss_db_pd50);
    bst_json_add_number(root, "loss_db_pd90", f->loss_db_pd90);
    bst_json_add_number(root, "loss_db_pd50_sigma", f->loss_db_sigma_pd50);
    bst_json_add_number(root, "loss_db_pd90_sigma", f->loss_db_sigma_pd90);
    bst_json_add_number(root, "loss_over_matched_filter_db_pd50", f->own_light_db_pd50);
    bst_json_add_number(root, "loss_over_matched_filter_db_pd90", f->own_light_db_pd90);
    if (s->options.stack > 0) {
        bst_json_add_number(root, "stack_frames", (double)s->options.stack);
        bst_json_add_number(root, "stack_rate_px_per_frame", s->options.rates_px);
        bst_json_add_number(root, "gain_ideal_db", 10.0 * log10((double)s->options.stack));
        bst_json_add_number(root, "gain_db_pd50", f->gain_db_pd50);
        bst_json_add_number(root, "gain_db_pd90", f->gain_db_pd90);
        bst_json_add_number(root, "gain_over_single_db_pd50", f->gain_over_single_db_pd50);
        bst_json_add_number(root, "gain_over_single_db_pd90", f->gain_over_single_db_pd90);
    }
    bst_json_add_number(root, "process_ms", 1e3 * r->process_s);
    bst_json_add_number(root, "wall_s", r->wall_s);
    cJSON *points = cJSON_AddArrayToObject(root, "points");
    for (int i = 0; i < s->points; i++) {
        cJSON_AddItemToArray(points, point_json(s, r, f, i));
    }
    return root;
}

/* Writes the data of the error panel, limited to values near 1. */
static void put_points(FILE *o, const bst_pd_scene *s, const bst_pd_result *r,
                       const bst_pd_figures *f) {
    fputs("$points << BST_END\n", o);
    for (int i = 0; i < s->points; i++) {
        row p = row_of(s, r, f, i);
        fprintf(o, "%.9g %.9g %.9g %.9g %.9g %.9g %.9g\n", s->snr[i], p.pd, p.low, p.high,
                p.over_bound[0], p.over_bound[1], p.flux_over_bound);
    }
    fputs("BST_END\n", o);
    double low = fmin(s->snr[0], s->snr[s->points - 1]),
           high = fmax(s->snr[0], s->snr[s->points - 1]);
    fputs("$ideal << BST_END\n", o);
    for (int i = 0; i <= 200 && f->pfa > 0.0; i++) {
        double snr = low + (high - low) * i / 200.0;
        fprintf(o, "%.9g %.9g %.9g\n", snr, bst_eval_ideal_pd(f->pfa, snr),
                bst_eval_matched_filter_pd(f->pfa, snr, s->own_light));
    }
    fputs("0 nan nan\nBST_END\n", o);
    fprintf(o, "set xrange [%.9g:%.9g]\n", low - 0.02 * (high - low), high + 0.02 * (high - low));
}

bst_status bst_pd_plot(bst_ctx *ctx, const char *path, const bst_pd_scene *s,
                       const bst_pd_result *r, const bst_pd_figures *f) {
    bst_plot plot;
    BST_TRY(bst_plot_begin(ctx, &plot, path, 900, 800));
    FILE *o = plot.script;
    put_points(o, s, r, f);
    fputs(
        "set multiplot\nset grid linecolor rgb '#d8dde4'\nset lmargin 9\nset rmargin 3\n"
        "set origin 0,0.42\nset size 1,0.58\nset bmargin 0.8\nset tmargin 3\n"
        "set format x ''\nset yrange [0:1.02]\nset ylabel 'probability of detection'\n"
        "set key bottom right opaque samplen 2 spacing 1.2\n",
        o);
    fprintf(o, "set title \"");
    if (s->sharpness) {
        fprintf(o, "streaks of %g px, rate and direction %s", s->options.streak_px,
                s->options.known_rate ? "known" : "unknown");
    } else {
        fprintf(o, "points");
    }
    fprintf(o, ", %.3g false alarms per %lld x %lld px", f->false_alarms_per_frame,
            (long long)s->camera.width_px, (long long)s->camera.height_px);
    if (isfinite(f->loss_db_pd50) && isfinite(f->loss_db_pd90)) {
        fprintf(o, "; loss %.2f dB at 0.5, %.2f dB at 0.9", f->loss_db_pd50, f->loss_db_pd90);
    }
    fputs(
        "\" font ',12' noenhanced\n"
        "plot $ideal using 1:2 with lines linecolor rgb '#c0392b' linewidth 1.6 "
        "title 'ideal, place and shape known', "
        "$ideal using 1:3 with lines linecolor rgb '#c0392b' linewidth 1.2 dashtype 2 "
        "title \"with the target's own photon noise\", "
        "$points using 1:2:3:4 with yerrorbars pointtype 7 pointsize 0.7 "
        "linecolor rgb '#1f4e9c' title 'measured, 95 %'\n"
        "unset title\nset origin 0,0\nset size 1,0.42\nset tmargin 0.8\nset bmargin 3.4\n"
        "set format x '%g'\nset xlabel 'signal-to-noise ratio'\nset yrange [0.5:2]\n"
        "set ylabel 'RMS error / bound'\nset key top right\n",
        o);
    fprintf(o,
            "plot 1 with lines linecolor rgb '#c0392b' linewidth 1.6 notitle, "
            "$points using 1:5 with linespoints pointtype 7 pointsize 0.7 "
            "linecolor rgb '#1f4e9c' title '%s', "
            "$points using 1:6 with linespoints pointtype 7 pointsize 0.7 "
            "linecolor rgb '#2a8c6e' title '%s', "
            "$points using 1:7 with linespoints pointtype 6 pointsize 0.7 "
            "linecolor rgb '#8a97a8' title 'flux'\nunset multiplot\n",
            s->sharpness ? "along" : "x", s->sharpness ? "across" : "y");
    return bst_plot_end(ctx, &plot, NULL);
}
