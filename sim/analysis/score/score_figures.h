/* Figures of merit of found points against true ones, with bootstrap intervals. */
#ifndef BST_ANALYSIS_SCORE_SCORE_FIGURES_H
#define BST_ANALYSIS_SCORE_SCORE_FIGURES_H

#include "sim/analysis/score/score_points.h"

/* Tolerances of the spotGEO competition, px. */
#define BST_SPOTGEO_TAU_PX 10.0
#define BST_SPOTGEO_EPSILON_PX 3.0

/* Figures. Errors are those of pairs. */
typedef enum bst_score_figure {
    BST_SCORE_PRECISION,
    BST_SCORE_RECALL,
    BST_SCORE_F1,
    BST_SCORE_RMS_PX, /* of the distance of pairs */
    BST_SCORE_GOSPA_PX,
    BST_SCORE_SPOTGEO_1_F1,        /* 1 - F1 with a radius of BST_SPOTGEO_TAU_PX */
    BST_SCORE_SPOTGEO_MSE,         /* px^2, per true positive, false positive and false negative */
    BST_SCORE_SPOTGEO_COMPETITION, /* MSE as the competition's program added it up */
    BST_SCORE_FIGURES
} bst_score_figure;

/* What is computed. */
typedef struct bst_score_options {
    double radius_px; /* largest distance of a pair; cutoff of GOSPA */
    int64_t resamples;
    uint64_t seed;
} bst_score_options;

/* A figure and its 95 % interval; NAN: not defined. */
typedef struct bst_score_value {
    double value, low, high;
} bst_score_value;

/* Result. */
typedef struct bst_score_result {
    bst_score_value figures[BST_SCORE_FIGURES];
    int64_t frames, sequences;
    int64_t truths, found; /* without the optional ones and the points that are on them */
    int64_t true_positives, false_positives, false_negatives;
    int64_t optional_truths, optional_found;
    int64_t frames_only_found; /* frames that the truth does not list; all in them is false */
    int64_t identity_changes;  /* a true object got a point of another identity; -1: unknown */
    bool by_sequence;          /* the bootstrap draws sequences, else frames */
} bst_score_result;

/* Computes the figures.
 *
 * Given:     truth, found  points sorted by frame
 * Notes:     A pair of a true and a found point is at most `radius_px` apart; the assignment has
 *            most pairs, and of those the least sum of distances. Found points without a pair that
 *            are that near to an optional one do not count. Intervals: percentile bootstrap over
 *            frames, or over sequences if there are several.
 * Errors:    BST_ERR_ARGUMENT: no frame, or one with too many points; BST_ERR_MEMORY
 * Reference: precision, recall and F1: van Rijsbergen 1979. GOSPA (p = 2, alpha = 2):
 *            sim/eval/gospa.h. spotGEO: kelvins.esa.int/spot-the-geo-satellites/scoring; Chen et
 *            al. 2021, spotGEO dataset. Bootstrap: Efron and Tibshirani 1993, section 13.3 */
bst_status bst_score_compute(bst_ctx *ctx, const bst_score_points *truth,
                             const bst_score_points *found, const bst_score_options *options,
                             bst_score_result *out) BST_MUST_CHECK;

#endif
