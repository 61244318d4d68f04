#define _XOPEN_SOURCE 700 /* realpath */
#include "sim/analysis/calibration/obsgen_validation.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "boresight/rng.h"
#include "sim/analysis/calibration/pairing.h"
#include "sim/analysis/calibration/watch.h"
#include "sim/core/compare.h"
#include "sim/core/text.h"
#include "sim/io/manifest.h"

/* edges of the SNR bins; fainter sources are ignored */
static const double edges[] = {3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0, 15.0, 30.0, 1e9};
/* A figure beyond its margin by this many standard deviations is wrong; if only its interval
 * exceeds the margin, more runs are needed. */
static const double BEYOND_SIGMAS = 2.0;
enum { BINS = sizeof edges / sizeof *edges - 1, RESAMPLES = 2000, LEAST_TRIALS = 200 };

/* Sums of one run, of which a figure is the ratio. */
typedef struct share {
    double sum, count;
} share;

enum { ALARMS, PLACES, TRACK, CONFIRM, FIGURES };

typedef struct run_sums {
    share pd[BINS];
    share figure[FIGURES];
} run_sums;

typedef struct judging {
    run_sums *sums;
    bst_pairing pairing;
    double fwhm_px;
} judging;

/* Sums detection probability and centroid errors of a frame. */
static bst_status on_frame(void *user, bst_ctx *ctx, const bst_truth *truth,
                           const bst_detections *detections) {
    judging *j = user;
    run_sums *s = j->sums;
    BST_TRY(bst_pairing_make(ctx, &j->pairing, truth, detections, j->fwhm_px));
    for (int i = 0; i < truth->count; i++) {
        const bst_truth_item *t = &truth->items[i];
        if (!(t->flags & BST_TRUTH_IN_FIELD) || (t->flags & BST_TRUTH_OCCULTED) ||
            !(t->snr >= edges[0])) {
            continue;
        }
        int bin = 0;
        while (t->snr >= edges[bin + 1]) {
            bin++;
        }
        int k = j->pairing.detection_of[i];
        s->pd[bin].sum += k >= 0;
        s->pd[bin].count += 1.0;
        /* detections with a sigma of a pixel or more were not fitted */
        const bst_detection *d = k >= 0 ? &detections->items[k] : NULL;
        if (d && t->snr >= 5.0 && fmax(d->cov_xx, d->cov_yy) < 1.0) {
            double dx = d->x_px - t->x_centroid_px, dy = d->y_px - t->y_centroid_px;
            s->figure[PLACES].sum += dx * dx + dy * dy;
            s->figure[PLACES].count += 2.0;
        }
    }
    for (int i = 0; i < detections->count; i++) {
        s->figure[ALARMS].sum += j->pairing.item_of[i] < 0;
    }
    s->figure[ALARMS].count += 1.0;
    return BST_OK;
}

/* Sums the error of the track of interest. */
static void on_track(void *user, double error_px) {
    judging *j = user;
    j->sums->figure[TRACK].sum += error_px * error_px;
    j->sums->figure[TRACK].count += 1.0;
}

/* Runs the scenario once, from images or with the statistical observation generator. */
static bst_status play(bst_ctx *ctx, const bst_obsgen_validation_options *o, bool generator,
                       int number, run_sums *sums) {
    static const char *const sensor = "/observers/0/sensors/0";
    char source[120], file[600], block[120];
    bst_load_options load = *o->load;
    snprintf(source, sizeof source, "%s/observation_source=%s", sensor,
             generator ? "generator" : "image");
    snprintf(block, sizeof block, "%s/modules/obsgen/type=statistical", sensor);
    if (load.set.count + 3 > BST_OPTION_LIST_MAX) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "too many --set");
    }
    load.set.items[load.set.count++] = source;
    if (generator && o->calibration) {
        char *real = realpath(o->calibration, NULL);
        snprintf(file, sizeof file, "%s/modules/obsgen/calibration_file=%s", sensor,
                 real ? real : o->calibration);
        free(real);
        load.set.items[load.set.count++] = block;
        load.set.items[load.set.count++] = file;
    }
    bst_json *json;
    bst_scenario scenario;
    BST_TRY(bst_load_scenario(ctx, o->scenario, &load, &json, &scenario));
    scenario.run += number;
    const bst_observer_config *observer = scenario.observers.items;
    const bst_sensor_config *first = observer->sensors.items;
    judging j = {.sums = sums,
                 .fwhm_px = BST_FWHM_PER_SIGMA * bst_camera_psf_sigma_px(&first->camera)};
    const bst_calibration_watcher watcher = {
        .user = &j, .frame = on_frame, .track_error = on_track};
    bst_loop_figures figures;
    bst_status status = bst_watch_run(ctx, &scenario, &watcher, o->device, o->threads, &figures);
    if (status == BST_OK && isfinite(figures.time_to_confirm_s)) {
        sums->figure[CONFIRM] = (share){figures.time_to_confirm_s, 1.0};
    }
    bst_pairing_free(&j.pairing);
    bst_scenario_free(&scenario);
    bst_json_free(json);
    return status;
}

/* Definition of a figure: its sums in run_sums, name and margin. */
typedef struct figure_of {
    char name[64];
    size_t offset;
    bool root, ratio;
    double margin;
} figure_of;

/* Value of a validation figure over the chosen seeds. */
static double value_of(const figure_of *f, const run_sums *runs, const int *chosen, int seeds) {
    double sum = 0.0, count = 0.0;
    for (int i = 0; i < seeds; i++) {
        share s;
        memcpy(&s, (const char *)&runs[chosen ? chosen[i] : i] + f->offset, sizeof s);
        sum += s.sum;
        count += s.count;
    }
    double value = count > 0.0 ? sum / count : NAN;
    return f->root ? sqrt(value) : value;
}

/* Bootstrap result of a figure. */
typedef struct sampling {
    double low, high; /* 95 % interval */
    double sigma;     /* standard error */
} sampling;

/* Bootstrap over runs. A sample takes the same runs from both sides: run i has one seed, and
 * therefore equal cue, drift, jitter and stars, which cancel in the difference. */
static sampling bootstrap(const figure_of *f, const run_sums *image, const run_sums *generator,
                          int seeds, int *chosen) {
    static const double low = 0.025;
    double values[RESAMPLES], sum = 0.0, square = 0.0;
    int n = 0;
    bst_rng_key key = bst_rng_make_key(1, 0, "equivalence", f->name);
    for (int r = 0; r < RESAMPLES; r++) {
        for (int i = 0; i < seeds; i++) {
            chosen[i] = (int)(bst_rng_uniform(key, (uint64_t)r, (uint64_t)i) * seeds);
        }
        double a = value_of(f, image, chosen, seeds), b = value_of(f, generator, chosen, seeds);
        double value = f->ratio ? b / a : b - a;
        if (isfinite(value)) {
            values[n++] = value;
            sum += value;
            square += value * value;
        }
    }
    if (n == 0) {
        return (sampling){NAN, NAN, NAN};
    }
    qsort(values, (size_t)n, sizeof *values, bst_compare_doubles);
    /* resampling n runs gives the variance about their own mean, (n - 1) / n of the true one */
    double mean = sum / n;
    return (sampling){values[(int)(low * (n - 1))], values[(int)((1.0 - low) * (n - 1))],
                      sqrt(fmax(square / n - mean * mean, 0.0) * seeds / fmax(seeds - 1.0, 1.0))};
}

/* Results in JSON: figures that both sides have, and those that one side lacks. */
typedef struct results {
    cJSON *figures, *one_sided;
} results;

/* Reports a figure without ratio or difference: one side has no value, or only images have 0. */
static bool report_one_sided(const figure_of *f, double image, double generator, cJSON *list) {
    const double values[2] = {image, generator};
    static const char *const names[2] = {"image", "generator"};
    char text[2][16] = {"-", "-"};
    cJSON *item = cJSON_CreateObject();
    cJSON_AddStringToObject(item, "name", f->name);
    for (int k = 0; k < 2; k++) {
        if (isfinite(values[k])) {
            snprintf(text[k], sizeof text[k], "%.4f", values[k]);
            cJSON_AddNumberToObject(item, names[k], values[k]);
        }
    }
    cJSON_AddItemToArray(list, item);
    printf("  %-22s %9s %9s  no %s: not shown\n", f->name, text[0], text[1],
           f->ratio ? "ratio" : "difference");
    return false;
}

/* Compares a figure of generator and image processing; bootstrap interval against the margin. */
static bool judge(const figure_of *f, const run_sums *image, const run_sums *generator, int seeds,
                  int *chosen, const results *out) {
    double a = value_of(f, image, NULL, seeds), b = value_of(f, generator, NULL, seeds);
    bool none = !isfinite(a) && !isfinite(b);
    if (none || (f->ratio && a == 0.0 && b == 0.0)) {
        return true;
    }
    if (!isfinite(a) || !isfinite(b) || (f->ratio && a == 0.0)) {
        return report_one_sided(f, a, b, out->one_sided);
    }
    double middle = f->ratio ? 1.0 : 0.0, value = f->ratio ? b / a : b - a;
    sampling s = bootstrap(f, image, generator, seeds, chosen);
    bool inside = s.low >= middle - f->margin && s.high <= middle + f->margin;
    bool beyond = fabs(value - middle) > f->margin + BEYOND_SIGMAS * s.sigma;
    printf("  %-22s %9.4f %9.4f  %s %7.4f +- %.4f  [%7.4f, %7.4f]  within %.2f: %s\n", f->name, a,
           b, f->ratio ? "ratio     " : "difference", value, s.sigma, s.low, s.high, f->margin,
           inside   ? "yes"
           : beyond ? "no"
                    : "not shown");
    cJSON *item = cJSON_CreateObject();
    cJSON_AddStringToObject(item, "name", f->name);
    cJSON_AddNumberToObject(item, "image", a);
    cJSON_AddNumberToObject(item, "generator", b);
    cJSON_AddNumberToObject(item, f->ratio ? "ratio" : "difference", value);
    cJSON_AddNumberToObject(item, "low", s.low);
    cJSON_AddNumberToObject(item, "high", s.high);
    cJSON_AddNumberToObject(item, "sigma", s.sigma);
    cJSON_AddNumberToObject(item, "margin", f->margin);
    cJSON_AddBoolToObject(item, "inside", inside);
    cJSON_AddBoolToObject(item, "beyond", beyond);
    cJSON_AddItemToArray(out->figures, item);
    return inside;
}

/* Says why there is no figure at all: what both sides had to compare. */
static void explain_none(const run_sums *image, const run_sums *generator, int seeds) {
    double frames = 0.0, most = 0.0;
    for (int b = 0; b < BINS; b++) {
        double trials = 0.0;
        for (int i = 0; i < seeds; i++) {
            trials += image[i].pd[b].count;
        }
        most = fmax(most, trials);
    }
    for (int i = 0; i < seeds; i++) {
        frames += image[i].figure[ALARMS].count + generator[i].figure[ALARMS].count;
    }
    printf(
        "  no figure: in %.0f frames no detection and no track, and at most %.0f sources in an SNR "
        "bin, %d are needed; is the sky full, or the target never in the field?\n",
        frames, most, LEAST_TRIALS);
}

/* Compares all figures of generator and image processing. */
static bool judge_all(const run_sums *image, const run_sums *generator, int seeds, int *chosen,
                      const results *out) {
    bool all = true;
    for (int b = 0; b < BINS; b++) {
        figure_of f = {.offset = offsetof(run_sums, pd) + (size_t)b * sizeof(share),
                       .margin = 0.02};
        if (b + 1 < BINS) {
            snprintf(f.name, sizeof f.name, "Pd at SNR %g to %g", edges[b], edges[b + 1]);
        } else {
            snprintf(f.name, sizeof f.name, "Pd above SNR %g", edges[b]);
        }
        double trials = 0.0;
        for (int i = 0; i < seeds; i++) {
            trials += image[i].pd[b].count;
        }
        if (trials >= LEAST_TRIALS) {
            all = judge(&f, image, generator, seeds, chosen, out) && all;
        }
    }
    static const figure_of others[FIGURES] = {
        {"false alarms per frame", offsetof(run_sums, figure[ALARMS]), false, true, 0.1},
        {"RMS of places, px", offsetof(run_sums, figure[PLACES]), true, true, 0.05},
        {"RMS of the track, px", offsetof(run_sums, figure[TRACK]), true, true, 0.05},
        {"time to confirm, s", offsetof(run_sums, figure[CONFIRM]), false, true, 0.1}};
    for (int k = 0; k < FIGURES; k++) {
        all = judge(&others[k], image, generator, seeds, chosen, out) && all;
    }
    if (cJSON_GetArraySize(out->figures) + cJSON_GetArraySize(out->one_sided) == 0) {
        explain_none(image, generator, seeds);
        all = false;
    }
    return all;
}

bst_status bst_obsgen_validation_run(bst_ctx *ctx, const bst_obsgen_validation_options *o,
                                     bool *equivalent) {
    size_t seeds = (size_t)o->seeds;
    run_sums *sums = calloc(2 * seeds, sizeof *sums);
    int *chosen = calloc(seeds, sizeof *chosen);
    cJSON *root = cJSON_CreateObject();
    const results out = {cJSON_AddArrayToObject(root, "figures"),
                         cJSON_AddArrayToObject(root, "one_sided")};
    bst_status status = sums && chosen && out.figures && out.one_sided
                            ? BST_OK
                            : bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d runs", o->seeds);
    for (int i = 0; i < o->seeds && status == BST_OK; i++) {
        for (int g = 0; g < 2 && status == BST_OK; g++) {
            status = play(ctx, o, g == 1, i, &sums[(size_t)g * seeds + (size_t)i]);
        }
    }
    if (status == BST_OK) {
        printf(
            "%s, %s each: image, generator, standard error and 95 %% interval "
            "over runs\n",
            o->scenario, bst_text_of_count((char[BST_COUNT_TEXT]){0}, o->seeds, "run", "runs"));
        *equivalent = judge_all(sums, sums + seeds, o->seeds, chosen, &out);
        cJSON_AddStringToObject(root, "scenario", o->scenario);
        cJSON_AddNumberToObject(root, "runs", o->seeds);
        cJSON_AddBoolToObject(root, "equivalent", *equivalent);
    }
    if (status == BST_OK && o->json) {
        char *text = cJSON_Print(root);
        status = text ? bst_io_write_file_atomic(ctx, o->json, text, strlen(text))
                      : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %s", o->json);
        free(text);
    }
    cJSON_Delete(root);
    free(sums);
    free(chosen);
    return status;
}
