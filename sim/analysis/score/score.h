/* `boresight score`: detections or tracks against truth or annotations. */
#ifndef BST_ANALYSIS_SCORE_SCORE_H
#define BST_ANALYSIS_SCORE_SCORE_H

#include <math.h>
#include <stdio.h>

#include "sim/analysis/score/score_figures.h"
#include "sim/cli/options.h"

/* What the command line asks for. */
typedef struct bst_score_request {
    const char *truth, *sensor, *json;
    int what; /* BST_SCORE_DETECTIONS or BST_SCORE_TRACKS; -1: not given, detections */
    double radius_px;
    double least_snr, least_score; /* -INFINITY: not given */
    int64_t resamples, seed;
    bool unknown, help;
} bst_score_request;

/* Request without any option given. */
#define BST_SCORE_REQUEST_DEFAULTS                                                      \
    {                                                                                   \
        .what = -1, .radius_px = 5.0, .least_snr = -INFINITY, .least_score = -INFINITY, \
        .resamples = 1000, .seed = 1                                                    \
    }

/* Table of the options, with offsets in a bst_score_request. */
extern const bst_option bst_score_request_options[];

/* Checks that the options given have an effect on the sources, if these exist.
 *
 * Given:     found  path of the detections or tracks
 * Errors:    BST_ERR_ARGUMENT: --what, --unknown or --sensor without the folder of a run, --unknown
 *            with tracks */
bst_status bst_score_request_check(bst_ctx *ctx, const bst_score_request *request,
                                   const char *found) BST_MUST_CHECK;

/* Reads both sources, computes the figures and prints them, or writes them as JSON.
 *
 * Given:     found  path of the detections or tracks
 * Errors:    those of bst_score_points_read, bst_score_compute and of the output */
bst_status bst_score_run(bst_ctx *ctx, const bst_score_request *request, const char *found,
                         FILE *out) BST_MUST_CHECK;

#endif
