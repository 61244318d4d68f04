/* Files that `boresight characterize` writes. */
#define _XOPEN_SOURCE 700 /* realpath */
#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/analysis/characterize/characterize.h"
#include "sim/cli/print_json.h"
#include "sim/core/compare.h"
#include "sim/core/json_number.h"
#include "sim/io/fits_image.h"

/* Statistics below this many standard errors are 0, also where the scenario that is extended has
 * another value. */
static const double LEAST_SIGNIFICANCE = 2.0;
/* Standard deviations of a covariance that is certain. */
static const double CERTAIN = 4.0;

/* Files being written. */
typedef struct writer {
    const bst_characterize_request *request;
    const bst_sensor_stacks *stacks;
    const bst_sensor_figures *figures;
    const bst_characterize_comparison *comparison;
} writer;

/* Noise that deferred charge takes out of the pixels of pairs of bias frames, DN^2: the covariance
 * along columns without that of pick-up, if it is certain. */
static double deferred_noise(const bst_frame_stack *bias, const bst_sensor_figures *f) {
    double sum = 0.0, variance = bst_mean_estimate(bias->variance, BST_STACK_BLOCKS).value;
    double line = isfinite(f->line.pair_power) ? f->line.pair_power : 0.0;
    double turns = f->figures[BST_SENSOR_LINE_PHASE].value;
    for (int rows = 1; rows <= 2; rows++) {
        double of_line =
            line > 0.0 && isfinite(turns) ? line * cos(2.0 * BST_PI * turns * rows) : 0.0;
        double shared = bst_neighbour_covariance_along(&bias->neighbours, rows) - of_line;
        sum += shared > CERTAIN * variance / sqrt(bias->neighbours.count) ? 2.0 * shared : 0.0;
    }
    return sum;
}

/* Read noise without what other keys add to the differences that it was measured by: pick-up, and
 * shot noise of the charge that bias frames gather during read-out, of which traps leave less in
 * the pixels. */
static double white_noise_e(const bst_sensor_stacks *s, const bst_sensor_figures *f) {
    double v = f->figures[BST_SENSOR_READ_NOISE].value,
           line = f->figures[BST_SENSOR_LINE_AMPLITUDE].value;
    double gain = f->figures[BST_SENSOR_GAIN].value, rest = v * v;
    double ramp_e = fabs(f->figures[BST_SENSOR_RAMP].value) * gain;
    if (isfinite(line) && f->noise_of_pairs) { /* a line of one phase in all frames cancels */
        rest -= isfinite(f->line.pair_power) ? f->line.pair_power * gain * gain : 0.0;
    } else if (isfinite(line)) { /* the mean square of a sine's differences of neighbours */
        double turn = cos(2.0 * BST_PI * f->figures[BST_SENSOR_LINE_FREQUENCY].value);
        rest -= 0.5 * line * line * (1.0 - turn);
    }
    if (isfinite(ramp_e) && f->noise_of_pairs) {
        rest += fmin(deferred_noise(&s->bias, f) * gain * gain, 0.5 * ramp_e) - 0.5 * ramp_e;
    }
    return sqrt(fmax(rest, 0.0));
}

/* Value of a figure in detector.json; NAN: left out, as statistics that maps replace with --maps.
 */
static double value_given(const writer *w, int i) {
    const bst_sensor_estimate *e = &w->figures->figures[i];
    const char *key = bst_sensor_figure_names[i].camera_key;
    bool mapped = (i >= BST_SENSOR_DARK && i <= BST_SENSOR_HOT_SPREAD && w->figures->dark_map) ||
                  (i >= BST_SENSOR_PRNU && i <= BST_SENSOR_BAD_COLUMNS && w->figures->prnu_map);
    if (!key || !isfinite(e->value) || (w->request->maps && mapped)) {
        return NAN;
    }
    if (i == BST_SENSOR_READ_NOISE) {
        return white_noise_e(w->stacks, w->figures);
    }
    if (strncmp(key, "detector/", 9) != 0) {
        return fmax(e->value, 0.0);
    }
    if (isnan(e->sigma)) { /* of an unknown error: neither significant nor 0 */
        return NAN;
    }
    return fabs(e->value) > LEAST_SIGNIFICANCE * e->sigma ? e->value : 0.0;
}

/* Traps as keys of the detector. */
static cJSON *traps_json(const bst_detector_traps_config *t) {
    cJSON *node = cJSON_CreateObject();
    cJSON_AddItemToObject(node, "traps_per_px",
                          cJSON_CreateDoubleArray(t->traps_per_px, BST_TRAP_SPECIES));
    cJSON_AddItemToObject(node, "release_px",
                          cJSON_CreateDoubleArray(t->release_px, BST_TRAP_SPECIES));
    cJSON_AddNumberToObject(node, "fill_exponent", t->fill_exponent);
    cJSON_AddNumberToObject(node, "reference_e", t->reference_e);
    return node;
}

/* Adds a key of the detector to a scenario's `set`; takes the value over. */
static void set_detector(const writer *w, cJSON *set, const char *key, cJSON *value) {
    char pointer[512];
    snprintf(pointer, sizeof pointer, "%.400s/detector/%s", w->request->camera, key);
    cJSON_AddItemToObject(set, pointer, value);
}

/* Adds traps, and the output's side that trails or the ramp of the read-out give. */
static void set_transfer(const writer *w, cJSON *set) {
    const bst_sensor_figures *f = w->figures;
    bool parallel = bst_detector_has_traps(&f->traps.parallel);
    if (parallel) {
        set_detector(w, set, "parallel_traps", traps_json(&f->traps.parallel));
    }
    if (parallel || isfinite(f->figures[BST_SENSOR_READOUT].value)) {
        set_detector(w, set, "output/top", cJSON_CreateBool(f->traps.top));
    }
    if (bst_detector_has_traps(&f->traps.serial)) {
        set_detector(w, set, "serial_traps", traps_json(&f->traps.serial));
        set_detector(w, set, "output/right", cJSON_CreateBool(f->traps.right));
    }
}

/* Adds the terms of the non-linearity: their errors are correlated, so that all are written, or all
 * are 0 where the curve does not differ from a line. */
static void set_linearity(const writer *w, cJSON *set) {
    const bst_linearity *l = &w->figures->linearity;
    double terms[BST_LINEARITY_TERMS];
    if (l->used == 0 || !isfinite(l->terms[0].value)) {
        return;
    }
    for (int i = 0; i < BST_LINEARITY_TERMS; i++) {
        terms[i] = l->significance > LEAST_SIGNIFICANCE ? l->terms[i].value : 0.0;
    }
    set_detector(w, set, "nonlinearity", cJSON_CreateDoubleArray(terms, BST_LINEARITY_TERMS));
}

/* The scenario that changes a camera; NULL: out of memory. */
static cJSON *detector_json(const writer *w) {
    char pointer[512], base[4096];
    cJSON *root = cJSON_CreateObject();
    cJSON_AddNumberToObject(root, "boresight", 1);
    if (w->request->extends) {
        char *whole = realpath(w->request->extends, NULL);
        snprintf(base, sizeof base, "%s", whole ? whole : w->request->extends);
        free(whole);
        cJSON_AddStringToObject(root, "extends", base);
    }
    cJSON *set = cJSON_AddObjectToObject(root, "set");
    for (int i = 0; i < BST_SENSOR_FIGURES; i++) {
        double value = value_given(w, i);
        if (isfinite(value)) {
            snprintf(pointer, sizeof pointer, "%.400s/%s", w->request->camera,
                     bst_sensor_figure_names[i].camera_key);
            bst_json_add_number(set, pointer, value);
        }
    }
    set_transfer(w, set);
    if (w->figures->line.locked && isfinite(w->figures->line.phase_deg)) {
        set_detector(w, set, "pick_up/phase_deg", cJSON_CreateNumber(w->figures->line.phase_deg));
    }
    set_linearity(w, set);
    if (isfinite(w->figures->figures[BST_SENSOR_HIT_DEPTH].value)) { /* what lengths refer to */
        set_detector(w, set, "cosmic_rays/pixel_pitch_um",
                     cJSON_CreateNumber(w->stacks->pixel_pitch_um));
    }
    if (w->request->maps && w->figures->dark_map) {
        snprintf(pointer, sizeof pointer, "%.400s/detector/dark_map", w->request->camera);
        cJSON_AddStringToObject(set, pointer, "dark_map.fits");
    }
    if (w->request->maps && w->figures->prnu_map) {
        snprintf(pointer, sizeof pointer, "%.400s/detector/prnu_map", w->request->camera);
        cJSON_AddStringToObject(set, pointer, "prnu_map.fits");
    }
    return root;
}

static void add_trail(cJSON *root, const writer *w) {
    const bst_charge_trail *t = &w->figures->trail;
    static const char *const sides[BST_TRAIL_SIDES] = {"rows_above", "rows_below", "columns_right",
                                                       "columns_left"};
    cJSON *node = cJSON_AddObjectToObject(root, "charge_trail");
    cJSON_AddNumberToObject(node, "hot_pixels", t->used);
    if (!isfinite(t->parallel.value)) {
        return;
    }
    cJSON_AddStringToObject(node, "parallel_direction",
                            t->parallel_up ? "rows_above" : "rows_below");
    cJSON_AddStringToObject(node, "serial_direction",
                            t->serial_right ? "columns_right" : "columns_left");
    cJSON *classes = cJSON_AddArrayToObject(node, "by_charge");
    for (int c = 0; c < BST_TRAIL_CLASSES; c++) {
        cJSON *class = cJSON_CreateObject();
        cJSON_AddItemToArray(classes, class);
        bst_json_add_number(class, "charge_dn", t->class_charge[c]);
        bst_json_add_number(class, "parallel", t->class_parallel[c]);
        bst_json_add_number(class, "serial", t->class_serial[c]);
    }
    for (int side = 0; side < BST_TRAIL_SIDES; side++) {
        cJSON *list = cJSON_AddArrayToObject(node, sides[side]);
        for (int k = 0; k < BST_TRAIL_PIXELS; k++) {
            cJSON_AddItemToArray(list, cJSON_CreateNumber(t->profile[side][k]));
        }
    }
    const bst_detector_traps_config *const fitted[2] = {&w->figures->traps.parallel,
                                                        &w->figures->traps.serial};
    for (int i = 0; i < 2; i++) {
        if (bst_detector_has_traps(fitted[i])) {
            cJSON *traps = traps_json(fitted[i]);
            cJSON_AddNumberToObject(traps, "misfit_rms", w->figures->trap_misfit[i]);
            cJSON_AddItemToObject(node, i == 0 ? "parallel_traps" : "serial_traps", traps);
        }
    }
}

/* Signals and variances of the flats of several exposures, means of the blocks. */
static void add_linearity(cJSON *root, const writer *w) {
    const bst_linearity_series *s = &w->stacks->linearity;
    double level = w->figures->figures[BST_SENSOR_OFFSET].value;
    if (s->count == 0) {
        return;
    }
    cJSON *node = cJSON_AddObjectToObject(root, "linearity");
    cJSON_AddNumberToObject(node, "exposures_used", w->figures->linearity.used);
    cJSON_AddBoolToObject(node, "saturates", w->figures->linearity.saturates);
    cJSON *list = cJSON_AddArrayToObject(node, "exposures");
    for (int i = 0; i < s->count; i++) {
        cJSON *point = cJSON_CreateObject();
        cJSON_AddItemToArray(list, point);
        bst_json_add_number(point, "exposure_s", s->points[i].exposure_s);
        double mean = bst_mean_estimate(s->points[i].mean, BST_STACK_BLOCKS).value;
        double variance = bst_mean_estimate(s->points[i].variance, BST_STACK_BLOCKS).value;
        bst_json_add_number(point, "signal_dn", mean - level);
        bst_json_add_number(point, "variance_dn2", variance);
    }
}

/* A list of what both frames have at a place: frequency or percentile; NULL: distances from 1 px.
 */
static void add_both(cJSON *root, const char *name, const char *place, const double *places,
                     const double *real, const double *simulated, int count) {
    cJSON *list = cJSON_AddArrayToObject(root, name);
    for (int i = 0; i < count; i++) {
        cJSON *item = cJSON_CreateObject();
        cJSON_AddItemToArray(list, item);
        cJSON_AddNumberToObject(item, place, places ? places[i] : 1.0 + i);
        bst_json_add_number(item, "real", real[i]);
        bst_json_add_number(item, "simulated", simulated[i]);
    }
}

/* How the simulated frame reproduces the real one. */
static void add_comparison(cJSON *root, const bst_characterize_comparison *c) {
    const bst_frame_statistics *r = &c->real, *s = &c->simulated;
    double frequencies[BST_COMPARISON_BANDS];
    if (!c->made) {
        return;
    }
    for (int i = 0; i < BST_COMPARISON_BANDS; i++) {
        frequencies[i] = bst_comparison_frequency(i);
    }
    cJSON *node = cJSON_AddObjectToObject(root, "reproduction");
    cJSON_AddStringToObject(node, "kind", c->kind);
    cJSON *median = cJSON_AddObjectToObject(node, "median_dn");
    bst_json_add_number(median, "real", r->median_dn);
    bst_json_add_number(median, "simulated", s->median_dn);
    add_both(node, "percentiles_over_median_dn", "percentile", bst_sensor_percentiles,
             r->percentiles_dn, s->percentiles_dn, BST_SENSOR_PERCENTILES);
    add_both(node, "power_along_rows_dn2_px", "cycles_per_px", frequencies, r->spectrum,
             s->spectrum, BST_COMPARISON_BANDS);
    add_both(node, "correlation_along_rows", "distance_px", NULL, r->along_rows, s->along_rows,
             BST_COMPARISON_LAGS);
    add_both(node, "correlation_along_columns", "distance_px", NULL, r->along_columns,
             s->along_columns, BST_COMPARISON_LAGS);
}

/* All figures with their uncertainties; NULL: out of memory. */
static cJSON *report_json(const writer *w) {
    const bst_sensor_figures *f = w->figures;
    cJSON *root = cJSON_CreateObject(), *frames = cJSON_AddObjectToObject(root, "frames");
    cJSON_AddNumberToObject(frames, "bias", w->stacks->bias.count);
    cJSON_AddNumberToObject(frames, "dark", w->stacks->dark.count);
    cJSON_AddNumberToObject(frames, "flat", w->stacks->flat.count);
    cJSON_AddNumberToObject(frames, "linearity", w->stacks->linearity.count);
    cJSON_AddNumberToObject(frames, "hits_found", w->stacks->dark.hits.count);
    cJSON_AddNumberToObject(frames, "width_px", f->width);
    cJSON_AddNumberToObject(frames, "height_px", f->height);
    bst_json_add_number(frames, "dark_exposure_s",
                        w->stacks->dark.count > 0 ? w->stacks->dark.exposure_s : NAN);
    cJSON *figures = cJSON_AddObjectToObject(root, "figures");
    for (int i = 0; i < BST_SENSOR_FIGURES; i++) {
        const bst_sensor_estimate *e = &f->figures[i];
        cJSON *node = cJSON_AddObjectToObject(figures, bst_sensor_figure_names[i].key);
        bst_json_add_number(node, "value", e->value);
        bst_json_add_number(node, "standard_error", e->sigma);
        double low, high;
        bst_sensor_interval(f, (bst_sensor_figure)i, &low, &high);
        bst_json_add_number(node, "low_95", low);
        bst_json_add_number(node, "high_95", high);
        cJSON_AddStringToObject(node, "method", f->method[i]);
        cJSON_AddBoolToObject(node, "in_detector_model",
                              bst_sensor_figure_names[i].camera_key != NULL);
    }
    cJSON_AddNumberToObject(root, "shielded_columns", f->shielded_columns);
    cJSON_AddNumberToObject(root, "hot_pixels", (double)f->hot_found);
    bst_json_add_number(root, "hot_limit_e_per_s", f->dark_map ? f->hot_limit_e_per_s : NAN);
    cJSON *percentiles = cJSON_AddObjectToObject(root, "dark_current_percentiles_e_per_s");
    for (int i = 0; i < BST_SENSOR_PERCENTILES; i++) {
        char key[16];
        snprintf(key, sizeof key, "%g", bst_sensor_percentiles[i]);
        bst_json_add_number(percentiles, key, f->percentiles_e_per_s[i]);
    }
    if (f->line.found) {
        cJSON *line = cJSON_AddObjectToObject(root, "pick_up");
        cJSON_AddBoolToObject(line, "locked", f->line.locked);
        bst_json_add_number(line, "phase_deg", f->line.phase_deg);
        double power_e2 = f->line.pair_power * pow(f->figures[BST_SENSOR_GAIN].value, 2.0);
        bst_json_add_number(line, "power_in_pairs_e2", power_e2);
    }
    add_trail(root, w);
    add_linearity(root, w);
    add_comparison(root, w->comparison);
    return root;
}

/* Writes a map without values that are NAN or below 0. */
static bst_status write_map(bst_ctx *ctx, const writer *w, const char *name, const float *map,
                            const char *unit) {
    char path[4096 + 32];
    size_t pixels = (size_t)w->figures->width * (size_t)w->figures->height;
    float *good = malloc(pixels * sizeof *good);
    if (!good) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", pixels);
    }
    for (size_t i = 0; i < pixels; i++) {
        good[i] = map[i] > 0.0F ? map[i] : 0.0F;
    }
    snprintf(path, sizeof path, "%s/%s", w->request->out, name);
    bst_status status =
        bst_fits_write_map(ctx, path, w->figures->width, w->figures->height, good, unit);
    free(good);
    return status;
}

/* Removes maps and plot of an earlier run, which would not belong to the new report. */
static void remove_earlier(const bst_characterize_request *request) {
    static const char *const names[] = {"dark_map.fits", "prnu_map.fits", "plot.png"};
    char path[4096 + 32];
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        snprintf(path, sizeof path, "%s/%s", request->out, names[i]);
        (void)remove(path); /* mostly there is none; what remains is overwritten below */
    }
}

bst_status bst_characterize_write(bst_ctx *ctx, const bst_characterize_request *request,
                                  const bst_sensor_stacks *stacks,
                                  const bst_sensor_figures *figures,
                                  const bst_characterize_comparison *comparison) {
    const writer w = {request, stacks, figures, comparison};
    char path[4096 + 32];
    if (request->overwrite) {
        remove_earlier(request);
    }
    if (figures->dark_map) {
        BST_TRY(write_map(ctx, &w, "dark_map.fits", figures->dark_map, "electron/s"));
    }
    if (figures->prnu_map) {
        BST_TRY(write_map(ctx, &w, "prnu_map.fits", figures->prnu_map, ""));
    }
    BST_TRY(bst_characterize_plot(ctx, request->out, stacks, figures, comparison));
    snprintf(path, sizeof path, "%s/detector.json", request->out);
    BST_TRY(bst_cli_write_json(ctx, path, detector_json(&w)));
    snprintf(path, sizeof path, "%s/report.json", request->out);
    return bst_cli_write_json(ctx, path, report_json(&w));
}
