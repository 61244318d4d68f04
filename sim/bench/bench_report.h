/* Report of speed against error and size: measured points, tables and plots. */
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
    bool best; /* no other point of the scene is both faster and more accurate */
} bst_bench_error_curve_point;

/* Points of one scene, grouped by renderer option. */
typedef struct bst_bench_error_curve {
    char scene[40];
    bst_bench_error_curve_point points[BST_CURVE_POINTS];
    int count;
} bst_bench_error_curve;

/* Table of error and time by number of exposure intervals and by star track (0: common, 1:
 * individual). */
typedef struct bst_bench_factor_column {
    char scene[40];
    double ms[BST_FACTORS][2], error_sigma[BST_FACTORS][2];
} bst_bench_factor_column;
extern const int bst_bench_factors[BST_FACTORS];

typedef struct bst_bench_growth_law {
    double size[BST_GROWTH_POINTS], ms_min[BST_GROWTH_POINTS], cpu_ms[BST_GROWTH_POINTS],
        peak_rss_mib[BST_GROWTH_POINTS];
    int count;
    double offset_ms, slope_ms, worst_rel; /* fit ms = offset + slope size; largest residual
                                              relative to the measured time */
} bst_bench_growth_law;

typedef struct bst_bench_report {
    bst_bench_error_curve curves[BST_CURVE_SCENES];
    bst_bench_factor_column factors[BST_FACTOR_SCENES];
    bst_bench_growth_law stars, streak;
    int curve_count, factor_count;
    bool has_growth;
} bst_bench_report;

/* Measures time per frame by number of stars and by streak length; each point in a process of its
 * own to measure its memory. */
bst_status bst_bench_growth(bst_ctx *ctx, const bst_bench_options *options,
                            bst_bench_growth_law *stars,
                            bst_bench_growth_law *streak) BST_MUST_CHECK;

/* Marks the points of a curve that no other point beats in both time and error. */
void bst_bench_error_curve_mark_best(bst_bench_error_curve *curve);
/* Fits a straight line to times by size with equal weight of relative errors. */
void bst_bench_growth_law_fit(bst_bench_growth_law *growth);

/* Writes folder/speed_error.md and folder/images/speed_error_*.png. Creates the folders. */
bst_status bst_bench_report_write(bst_ctx *ctx, const bst_bench_report *report,
                                  const cJSON *machine, const char *folder) BST_MUST_CHECK;

#endif
