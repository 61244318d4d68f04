/* Speed against error and size: points that were measured, and the report on them. */
#ifndef BST_BENCH_BENCH_REPORT_H
#define BST_BENCH_BENCH_REPORT_H

#include <stdbool.h>

#include "sim/bench/bench.h"

enum {
    BST_CURVE_POINTS = 64,
    BST_CURVE_SCENES = 4,
    BST_FACTORS = 6,
    BST_FACTOR_SCENES = 4,
    BST_GROWTH_POINTS = 16
};

typedef struct bst_bench_error_curve_point {
    char knob[24], value[24];
    double ms_min, ms_median, cpu_ms, error_sigma_max, predicted_sigma, flux_error_rel;
    bool best; /* no other point of the scene is both quicker and nearer to the truth */
} bst_bench_error_curve_point;

/* One scene's points: those of a knob follow each other. */
typedef struct bst_bench_error_curve {
    char scene[40];
    bst_bench_error_curve_point points[BST_CURVE_POINTS];
    int count;
} bst_bench_error_curve;

/* The classic table: error and time by equal parts of the exposure and by whose track stars follow
 * (0: one for all, 1: each its own). */
typedef struct bst_bench_factor_column {
    char scene[40];
    double ms[BST_FACTORS][2], error_sigma[BST_FACTORS][2];
} bst_bench_factor_column;
extern const int bst_bench_factors[BST_FACTORS];

typedef struct bst_bench_growth_law {
    double size[BST_GROWTH_POINTS], ms_min[BST_GROWTH_POINTS], cpu_ms[BST_GROWTH_POINTS],
        peak_rss_mib[BST_GROWTH_POINTS];
    int count;
    double offset_ms, slope_ms, worst_rel; /* fit ms = offset + slope size; of its misses the
                                              largest, over the measured time */
} bst_bench_growth_law;

typedef struct bst_bench_report {
    bst_bench_error_curve curves[BST_CURVE_SCENES];
    bst_bench_factor_column factors[BST_FACTOR_SCENES];
    bst_bench_growth_law stars, streak;
    int curve_count, factor_count;
    bool has_growth;
} bst_bench_report;

/* Time per frame by number of stars, and by length of their streaks; each point in a process of its
 * own, so that its memory is its own. */
bst_status bst_bench_growth(bst_ctx *ctx, const bst_bench_options *options,
                            bst_bench_growth_law *stars,
                            bst_bench_growth_law *streak) BST_MUST_CHECK;

/* Marks the points that no other of the curve beats in time and error. */
void bst_bench_error_curve_mark_best(bst_bench_error_curve *curve);
/* Straight line through times by size that weighs relative misses alike. */
void bst_bench_growth_law_fit(bst_bench_growth_law *growth);

/* Writes folder/speed_error.md and folder/images/speed_error_*.png. Folders are made. */
bst_status bst_bench_report_write(bst_ctx *ctx, const bst_bench_report *report,
                                  const cJSON *machine, const char *folder) BST_MUST_CHECK;

#endif
