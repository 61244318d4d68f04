/* `boresight score`: detections or tracks against truth or annotations. */
#ifndef BST_ANALYSIS_SCORE_SCORE_H
#define BST_ANALYSIS_SCORE_SCORE_H

#include <stdio.h>

#include "sim/analysis/score/score_figures.h"
#include "sim/cli/options.h"

/* What the command line asks for. */
typedef struct bst_score_request {
    const char *truth, *sensor, *json;
    int what; /* BST_SCORE_DETECTIONS or BST_SCORE_TRACKS */
    double radius_px, least_snr, least_score;
    int64_t resamples, seed;
    bool unknown, help;
} bst_score_request;

/* Request without any option given. */
#define BST_SCORE_REQUEST_DEFAULTS \
    { .radius_px = 5.0, .least_snr = -1e9, .least_score = -1e300, .resamples = 1000, .seed = 1 }

/* Table of the options, with offsets in a bst_score_request. */
extern const bst_option bst_score_request_options[];

/* Reads both sources, computes the figures and prints them, or writes them as JSON.
 *
 * Given:     found  path of the detections or tracks
 * Errors:    those of bst_score_points_read, bst_score_compute and of the output */
bst_status bst_score_run(bst_ctx *ctx, const bst_score_request *request, const char *found,
                         FILE *out) BST_MUST_CHECK;

#endif
