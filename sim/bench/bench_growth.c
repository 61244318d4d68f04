#include <math.h>
#include <stdio.h>

#include "sim/bench/bench_report.h"
#include "sim/bench/bench_scenes.h"
#include "sim/device/device.h"

enum { FRAMES = 5 };

static const double star_counts[] = {1e2, 3e2, 1e3, 3e3, 1e4, 3e4, 1e5, 3e5, 1e6};
static const double streak_lengths_px[] = {1, 3, 10, 30, 100, 200, 300, 500, 700, 1000};

typedef struct errand {
    const bst_bench_options *options;
    int stars;
    double travel_px;
} errand;

static bst_status time_scene(bst_ctx *ctx, void *user, void *out) {
    const errand *e = user;
    bst_bench_result *result = out;
    bst_bench_scene scene = *bst_bench_find_scene("rate_track_medium");
    scene.stars = e->stars;
    scene.travel_px = e->travel_px;
    scene.tolerance_sigma = 0.05;
    scene.targets = 0;
    bst_device *device;
    BST_TRY(bst_device_open(ctx, e->options->device ? e->options->device : "", e->options->threads,
                            &device));
    bst_renderer_options fidelity = bst_renderer_default_options();
    fidelity.tolerance_sigma = scene.tolerance_sigma;
    bst_bench_view view = {.count = 0};
    bst_renderer *renderer = NULL;
    bst_status status = bst_bench_view_open(ctx, &scene, &view);
    if (status == BST_OK) {
        status = bst_renderer_create(ctx, device, &view.camera, &fidelity, &renderer);
    }
    if (status == BST_OK) {
        status = bst_bench_view_time(ctx, renderer, &view, FRAMES, false, result);
        result->peak_rss_mib = bst_bench_peak_rss_mib();
    }
    bst_renderer_free(renderer);
    bst_bench_view_close(&view);
    bst_device_close(device);
    return status;
}

static bst_status add(bst_ctx *ctx, const errand *e, const char *what, double size,
                      bst_bench_growth_law *growth) {
    bst_bench_result r = bst_bench_nothing("growth");
    errand copy = *e;
    BST_TRY(bst_bench_apart(ctx, time_scene, &copy, &r, sizeof r));
    int n = growth->count++;
    growth->size[n] = size;
    growth->ms_min[n] = r.ms_min;
    growth->cpu_ms[n] = r.cpu_ms;
    growth->peak_rss_mib[n] = r.peak_rss_mib;
    printf("%8.0f %-18s %9.2f ms %9.2f ms cpu %7.0f MiB\n", size, what, r.ms_min, r.cpu_ms,
           r.peak_rss_mib);
    fflush(stdout);
    return BST_OK;
}

/* Fits time against size by least squares of relative errors, (offset + slope x) / y - 1. */
void bst_bench_growth_law_fit(bst_bench_growth_law *g) {
    double a = 0.0, b = 0.0, c = 0.0, u = 0.0, v = 0.0;
    for (int i = 0; i < g->count; i++) {
        double p = 1.0 / g->ms_min[i], q = g->size[i] * p;
        a += p * p;
        b += p * q;
        c += q * q;
        u += p;
        v += q;
    }
    double determinant = a * c - b * b;
    g->offset_ms = determinant > 0.0 ? (u * c - v * b) / determinant : NAN;
    g->slope_ms = determinant > 0.0 ? (v * a - u * b) / determinant : NAN;
    g->worst_rel = 0.0;
    for (int i = 0; i < g->count; i++) {
        g->worst_rel = fmax(g->worst_rel,
                            fabs((g->offset_ms + g->slope_ms * g->size[i]) / g->ms_min[i] - 1.0));
    }
}

bst_status bst_bench_growth(bst_ctx *ctx, const bst_bench_options *options,
                            bst_bench_growth_law *stars, bst_bench_growth_law *streak) {
    stars->count = streak->count = 0;
    printf("\n");
    for (size_t i = 0; i < sizeof star_counts / sizeof *star_counts; i++) {
        errand e = {options, (int)star_counts[i], 5.0};
        BST_TRY(add(ctx, &e, "stars", star_counts[i], stars));
    }
    for (size_t i = 0; i < sizeof streak_lengths_px / sizeof *streak_lengths_px; i++) {
        errand e = {options, 1000, streak_lengths_px[i]};
        BST_TRY(add(ctx, &e, "px of streak", streak_lengths_px[i], streak));
    }
    bst_bench_growth_law_fit(stars);
    bst_bench_growth_law_fit(streak);
    return BST_OK;
}
