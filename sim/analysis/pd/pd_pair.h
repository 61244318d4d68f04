/* Two-point resolution of a detector: the separation at which it finds two sources as two, over
 * their SNR, beside the bound (`boresight pd --pair`). */
#ifndef BST_ANALYSIS_PD_PD_PAIR_H
#define BST_ANALYSIS_PD_PD_PAIR_H

#include "sim/analysis/pd/pd.h"
#include "sim/eval/pair_bound.h"

enum { BST_PD_PAIR_SNRS = 24, BST_PD_PAIR_RATIOS = 4, BST_PD_PAIR_SEPARATIONS = 16 };

/* What is measured. */
typedef struct bst_pd_pair_options {
    double snr[BST_PD_PAIR_SNRS]; /* of both sources as one, ascending */
    int snrs;
    double ratio[BST_PD_PAIR_RATIOS]; /* brightness of the first over the second */
    int ratios;
    double separation_px[BST_PD_PAIR_SEPARATIONS];
    int separations; /* 0: chosen about the bound, for each SNR */
} bst_pd_pair_options;

/* Counts of pairs at one separation. */
typedef struct bst_pd_pair_count {
    double separation_px;
    int64_t pairs, found; /* found: two detections or more */
} bst_pd_pair_count;

/* Counts and bound at one SNR. */
typedef struct bst_pd_pair_point {
    double snr, v_mag; /* of both sources */
    bst_pd_pair_count counts[BST_PD_PAIR_SEPARATIONS];
    int separations;
    int64_t singles, split;     /* single sources, and those found as two or more */
    bst_pd_needed needed;       /* separation at Pd 0.9, px */
    bst_pair_separations bound; /* at Pd 0.9 and the stated share of false splits */
} bst_pd_pair_point;

/* One curve: separation over SNR. */
typedef struct bst_pd_pair_curve {
    double ratio, streak_px; /* streak_px 0: points */
    bst_pd_pair_point points[BST_PD_PAIR_SNRS];
    int count;
} bst_pd_pair_curve;

/* A measurement: curves of points, then of streaks. */
typedef struct bst_pd_pair_result {
    bst_pd_pair_curve curves[2 * BST_PD_PAIR_RATIOS];
    int count;
    char sensor[160];
    const char *scenario, *detector;
    int64_t width_px, height_px;
    double fwhm_px, noise_e, exposure_s;
    double false_splits, bound_false_splits; /* asked of the detector; those of the bound */
    int64_t frames;
    double wall_s;
} bst_pd_pair_result;

/* Measures all curves: points, and with options->streak_px > 0 streaks of that length and known
 * motion.
 *
 * Given:     options  of the scene; pairs, streak_px and trials (pairs of each separation) count
 * Errors:    BST_ERR_INTERRUPTED; BST_ERR_MEMORY; those of opening scene and detector and of
 *            rendering */
bst_status bst_pd_pair_run(bst_ctx *ctx, const bst_scenario *scenario,
                           const bst_pd_options *options, const bst_pd_pair_options *pairs,
                           bst_pd_pair_result *out) BST_MUST_CHECK;

/* Bounds at one SNR, for pairs at the centre of the sensor.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_pd_pair_bound(bst_ctx *ctx, const bst_pd_scene *scene, double snr, double ratio,
                             double false_splits, bst_pair_separations *out) BST_MUST_CHECK;

/* Prints the table of a measurement to stdout. */
void bst_pd_pair_print(const bst_pd_pair_result *result);

/* A measurement as a JSON object.
 *
 * Returned:  NULL if out of memory
 * Ownership: free it with cJSON_Delete */
struct cJSON *bst_pd_pair_json(const bst_pd_pair_result *result);

/* Plots separation over SNR, measured and bound, and the share of false splits.
 *
 * Given:     path  PNG or SVG file to write
 * Errors:    those of bst_plot_begin and bst_plot_end (gnuplot is needed) */
bst_status bst_pd_pair_plot(bst_ctx *ctx, const char *path,
                            const bst_pd_pair_result *result) BST_MUST_CHECK;

#endif
