#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/bench/bench_report.h"
#include "sim/bench/bench_scenes.h"
#include "sim/device/device.h"

enum { FRAMES = 7, LARGE = 50000 };

const int bst_bench_factors[BST_FACTORS] = {5, 15, 51, 151, 501, 1501};
static const char *const factor_scenes[BST_FACTOR_SCENES] = {
    "acquisition", "rate_track_slow", "rate_track_medium", "rate_track_fast"};
static const char *const curve_scenes[BST_CURVE_SCENES] = {
    "worst_case", "rate_track_medium", "galactic_core", "worst_case_diffraction_q2"};

/* State of measuring one scene. */
typedef struct sweep {
    const bst_bench_options *options;
    const char *name;
    bst_device *device;
    bst_bench_view view, timed; /* frame of the reference; timed frames */
    bst_bench_truth truth;
} sweep;

static bst_status sweep_open(bst_ctx *ctx, const bst_bench_options *options, const char *name,
                             sweep *s) {
    const bst_bench_scene *scene = bst_bench_find_scene(name);
    *s = (sweep){.options = options, .name = name};
    if (!scene) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s is no scene whose fidelity can be varied", name);
    }
    BST_TRY(
        bst_device_open(ctx, options->device ? options->device : "", options->threads, &s->device));
    BST_TRY(bst_bench_view_open(ctx, scene, &s->view));
    BST_TRY(bst_bench_view_open(ctx, scene, &s->timed));
    bst_bench_view_set(&s->view, 0);
    return bst_bench_truth_make(ctx, &s->view, &s->truth);
}

static void sweep_close(sweep *s) {
    bst_bench_truth_free(&s->truth);
    bst_bench_view_close(&s->timed);
    bst_bench_view_close(&s->view);
    bst_device_close(s->device);
}

/* Measures time and error of one option set. */
static bst_status measure(bst_ctx *ctx, sweep *s, const bst_renderer_options *options,
                          double faintest_e_per_s, bst_bench_result *out) {
    bst_renderer *renderer;
    *out = bst_bench_nothing(s->name);
    BST_TRY(bst_renderer_create(ctx, s->device, &s->view.camera, options, &renderer));
    bst_status status = bst_bench_view_time(ctx, renderer, &s->timed,
                                            s->view.count > LARGE ? 3 : FRAMES, false, out);
    if (status == BST_OK) {
        status = bst_bench_truth_compare(ctx, renderer, &s->truth, faintest_e_per_s, out);
    }
    bst_renderer_free(renderer);
    return status;
}

static bst_status add_point(bst_ctx *ctx, sweep *s, bst_bench_error_curve *curve, const char *knob,
                            const char *value, const bst_renderer_options *options,
                            double faintest_e_per_s) {
    bst_bench_result r;
    if (curve->count == BST_CURVE_POINTS) {
        return bst_fail(ctx, BST_ERR_STATE, "more than %d points in a curve", BST_CURVE_POINTS);
    }
    BST_TRY(measure(ctx, s, options, faintest_e_per_s, &r));
    bst_bench_error_curve_point *p = &curve->points[curve->count++];
    *p = (bst_bench_error_curve_point){.ms_min = r.ms_min,
                                       .ms_median = r.ms_median,
                                       .cpu_ms = r.cpu_ms,
                                       .error_sigma_max = r.error_sigma_max,
                                       .predicted_sigma = r.predicted_error_sigma,
                                       .flux_error_rel = r.flux_error_rel};
    snprintf(p->knob, sizeof p->knob, "%s", knob);
    snprintf(p->value, sizeof p->value, "%s", value);
    printf("%-26s %-20s %-14s %9.2f ms %10.5f sigma\n", s->name, knob, value, p->ms_min,
           p->error_sigma_max);
    fflush(stdout);
    return BST_OK;
}

/* Measures points for several values of an integer renderer option. */
static bst_status vary_int(bst_ctx *ctx, sweep *s, bst_bench_error_curve *curve, const char *knob,
                           size_t offset, const int *values) {
    /* many need a program of their own, which takes seconds to build: half of them in a trial */
    int step = strcmp(s->name, "small") == 0 ? 2 : 1;
    for (int i = 0; values[i] > 0; i++) {
        if (i % step != 0) {
            continue;
        }
        bst_renderer_options options = bst_renderer_default_options();
        char text[24];
        options.tolerance_sigma = s->view.scene.tolerance_sigma;
        memcpy((char *)&options + offset, &values[i], sizeof values[i]);
        snprintf(text, sizeof text, "%d", values[i]);
        BST_TRY(add_point(ctx, s, curve, knob, text, &options, 0.0));
    }
    return BST_OK;
}

static bst_status vary_tolerance(bst_ctx *ctx, sweep *s, bst_bench_error_curve *curve) {
    static const double values[] = {1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005};
    for (size_t i = 0; i < sizeof values / sizeof *values; i++) {
        bst_renderer_options options = bst_renderer_default_options();
        char text[24];
        options.tolerance_sigma = values[i];
        snprintf(text, sizeof text, "%g", values[i]);
        BST_TRY(add_point(ctx, s, curve, "tolerance_sigma", text, &options, 0.0));
    }
    return BST_OK;
}

static bst_status vary_motion(bst_ctx *ctx, sweep *s, bst_bench_error_curve *curve) {
    static const char *const names[] = {"auto", "single_kernel", "multi_kernel"};
    for (int i = 0; i < 3; i++) {
        bst_renderer_options options = bst_renderer_default_options();
        options.tolerance_sigma = s->view.scene.tolerance_sigma;
        options.motion = (bst_smear_star_motion)i;
        BST_TRY(add_point(ctx, s, curve, "renderer", names[i], &options, 0.0));
    }
    return BST_OK;
}

/* Keeps the stars with at least that rate. */
static void drop_faint(bst_bench_view *v, double faintest_e_per_s) {
    int kept = 0;
    for (int i = 0; i < v->scene.stars; i++) {
        if (v->sources[i].electrons_per_s >= faintest_e_per_s) {
            v->sources[kept++] = v->sources[i];
        }
    }
    v->scene.stars = kept;
    v->count = kept + v->scene.targets;
}

/* runs last, because it removes stars from the timed scene */
static bst_status vary_faint_limit(bst_ctx *ctx, sweep *s, bst_bench_error_curve *curve) {
    double brightest = 0.0;
    for (int i = 0; i < s->view.scene.stars; i++) {
        brightest = fmax(brightest, s->view.sources[i].electrons_per_s);
    }
    for (double magnitudes = s->view.scene.magnitudes - 0.5; magnitudes > 2.0; magnitudes -= 1.0) {
        bst_renderer_options options = bst_renderer_default_options();
        options.tolerance_sigma = s->view.scene.tolerance_sigma;
        char text[24];
        snprintf(text, sizeof text, "%.1f", magnitudes);
        double faintest = brightest * pow(10.0, -0.4 * magnitudes);
        drop_faint(&s->timed, faintest);
        BST_TRY(add_point(ctx, s, curve, "faint_limit_mag", text, &options, faintest));
    }
    return BST_OK;
}

static bst_status vary_all(bst_ctx *ctx, sweep *s, bst_bench_error_curve *curve) {
    static const int temporal[] = {15, 51, 151, 501, 1501, 0}, spatial[] = {1, 3, 5, 11, 33, 99, 0},
                     stamp[] = {1, 2, 3, 4, 5, 6, 0}, degree[] = {1, 3, 5, 7, 9, 0},
                     taps[] = {4, 6, 8, 0}, quick_degree[] = {5, 7, 0};
    bool large = s->view.count > LARGE; /* only its fast options */
    bool stamps = s->view.scene.q == 0.0;
    BST_TRY(vary_tolerance(ctx, s, curve));
    if (!large) {
        BST_TRY(vary_int(ctx, s, curve, "temporal_oversample",
                         offsetof(bst_renderer_options, temporal_oversample), temporal));
    }
    if (stamps && !large) {
        BST_TRY(vary_motion(ctx, s, curve));
        BST_TRY(vary_int(ctx, s, curve, "spatial_oversample",
                         offsetof(bst_renderer_options, spatial_oversample), spatial));
        BST_TRY(vary_int(ctx, s, curve, "stamp_radius_px",
                         offsetof(bst_renderer_options, stamp_radius_px), stamp));
        /* each degree is compiled, for seconds: few in the quick trial */
        BST_TRY(vary_int(ctx, s, curve, "psf_degree", offsetof(bst_renderer_options, psf_degree),
                         strcmp(curve->scene, "small") == 0 ? quick_degree : degree));
    }
    if (!stamps) {
        return vary_int(ctx, s, curve, "fft_taps", offsetof(bst_renderer_options, fft_taps), taps);
    }
    return vary_faint_limit(ctx, s, curve);
}

typedef struct errand {
    const bst_bench_options *options;
    const char *name;
} errand;

static bst_status make_curve(bst_ctx *ctx, void *user, void *out) {
    const errand *e = user;
    bst_bench_error_curve *curve = out;
    sweep s;
    bst_status status = sweep_open(ctx, e->options, e->name, &s);
    curve->count = 0;
    snprintf(curve->scene, sizeof curve->scene, "%s", e->name);
    if (status == BST_OK) {
        status = vary_all(ctx, &s, curve);
    }
    sweep_close(&s);
    bst_bench_error_curve_mark_best(curve);
    return status;
}

static bst_status make_factors(bst_ctx *ctx, void *user, void *out) {
    const errand *e = user;
    bst_bench_factor_column *column = out;
    sweep s;
    bst_status status = sweep_open(ctx, e->options, e->name, &s);
    snprintf(column->scene, sizeof column->scene, "%s", e->name);
    for (int i = 0; status == BST_OK && i < 2 * BST_FACTORS; i++) {
        bst_renderer_options options = bst_renderer_default_options();
        bst_bench_result r = bst_bench_nothing(e->name);
        options.tolerance_sigma = s.view.scene.tolerance_sigma;
        options.temporal_oversample = bst_bench_factors[i / 2];
        options.motion = i % 2 ? BST_STAR_MOTION_MULTI : BST_STAR_MOTION_SINGLE;
        status = measure(ctx, &s, &options, 0.0, &r);
        column->ms[i / 2][i % 2] = r.ms_min;
        column->error_sigma[i / 2][i % 2] = r.error_sigma_max;
    }
    sweep_close(&s);
    return status;
}

static void print_factors(const bst_bench_report *r) {
    printf(
        "\ntemporal factor: ms and largest error in sigma, with one track for all and each its "
        "own\n%-8s %-7s",
        "factor", "kernel");
    for (int c = 0; c < r->factor_count; c++) {
        printf(" %22s", r->factors[c].scene);
    }
    for (int i = 0; i < 2 * BST_FACTORS; i++) {
        printf("\n%-8d %-7s", bst_bench_factors[i / 2], i % 2 ? "multi" : "single");
        for (int c = 0; c < r->factor_count; c++) {
            printf("    %8.2f %10.4f", r->factors[c].ms[i / 2][i % 2],
                   r->factors[c].error_sigma[i / 2][i % 2]);
        }
    }
    printf("\n");
}

bst_status bst_bench_curve(bst_ctx *ctx, const bst_bench_options *options, const char *scene,
                           const char *folder) {
    bst_bench_report *report = calloc(1, sizeof *report);
    if (!report) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the report");
    }
    bst_bench_device device;
    bst_status status = bst_bench_describe_device(ctx, options, &device);
    cJSON *machine = bst_bench_machine(&device);
    int curves = scene ? 1 : BST_CURVE_SCENES, factors = scene ? 1 : BST_FACTOR_SCENES;
    for (int i = 0; status == BST_OK && i < curves; i++) {
        errand e = {options, scene ? scene : curve_scenes[i]};
        status = bst_bench_apart(ctx, make_curve, &e, &report->curves[i], sizeof report->curves[i]);
        report->curve_count += status == BST_OK;
    }
    for (int i = 0; status == BST_OK && i < factors; i++) {
        errand e = {options, scene ? scene : factor_scenes[i]};
        status =
            bst_bench_apart(ctx, make_factors, &e, &report->factors[i], sizeof report->factors[i]);
        report->factor_count += status == BST_OK;
    }
    if (status == BST_OK) {
        print_factors(report);
    }
    if (status == BST_OK && !scene) {
        report->has_growth = true;
        status = bst_bench_growth(ctx, options, &report->stars, &report->streak);
    }
    if (status == BST_OK) {
        status = bst_bench_report_write(ctx, report, machine, folder);
    }
    cJSON_Delete(machine);
    free(report);
    return status;
}
