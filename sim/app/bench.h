/* Benchmarks: what each measures and how it reports. */
#ifndef BST_APP_BENCH_H
#define BST_APP_BENCH_H

#include "sim/core/status.h"

/* One line of the report. Members that do not apply are NAN. */
typedef struct bst_bench_result {
    const char *name;
    double frames_per_s;              /* or calls per second */
    double ms_median, ms_min, cpu_ms; /* per frame (or call) */
    double error_sigma_max, error_sigma_rms, flux_error_rel;
    int error_sources; /* how many sources the error was measured on, 0: does not apply */
    double peak_rss_mib;
    double setup_s, ms_max, error_px;
} bst_bench_result;

typedef struct bst_bench_options {
    const char *device;   /* selector, NULL: default */
    int threads;          /* 0: all */
    const char *tle_file; /* NULL: each benchmark's own */
    const char *scenario;
} bst_bench_options;

typedef struct bst_bench {
    const char *name, *doc;
    bst_status (*run)(bst_ctx *ctx, const struct bst_bench *self, const bst_bench_options *options,
                      bst_bench_result *out);
} bst_bench;

/* Orbits and catalogue (bench_foundations.c). */
bst_status bst_bench_sgp4(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                          bst_bench_result *out) BST_MUST_CHECK;
bst_status bst_bench_star_cull(bst_ctx *ctx, const bst_bench *self,
                               const bst_bench_options *options,
                               bst_bench_result *out) BST_MUST_CHECK;
/* Objects by the thousand (bench_ephemeris.c). */
bst_status bst_bench_ephemeris(bst_ctx *ctx, const bst_bench *self,
                               const bst_bench_options *options,
                               bst_bench_result *out) BST_MUST_CHECK;
/* Rendering scenes, by self->name (bench_scenes.c). */
bst_status bst_bench_scene(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                           bst_bench_result *out) BST_MUST_CHECK;
/* The closed loop (bench_foundations.c). */
bst_status bst_bench_loop(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                          bst_bench_result *out) BST_MUST_CHECK;

/* Times of repeated calls. */
enum { BST_BENCH_TIMES = 4096 };
typedef struct bst_bench_clock {
    double ms[BST_BENCH_TIMES];
    int count;
    double started_ms, cpu_started_ms, cpu_total_ms;
} bst_bench_clock;

void bst_bench_start(bst_bench_clock *clock);
/* Ends what bst_bench_start began; the time is divided by `calls`. */
void bst_bench_stop(bst_bench_clock *clock, int calls);
/* Fills the time members of a result. */
void bst_bench_summarise(bst_bench_clock *clock, bst_bench_result *out);

#endif
