/* GOSPA metric (generalised optimal sub-pattern assignment) between true objects and tracks, alpha
 * = 2: the form that splits into localisation, missed and false (Rahmathullah, Garcia-Fernandez and
 * Svensson, 20th Int. Conf. on Information Fusion, 2017). */
#ifndef BST_EVAL_GOSPA_H
#define BST_EVAL_GOSPA_H

#include "boresight/status.h"

typedef struct bst_gospa_result {
    double gospa;
    /* parts of gospa^p: sum of distances^p of the pairs; cutoff^p / 2 per missed object and per
     * false track */
    double localisation, missed, false_tracks;
    int pairs, missed_count, false_count;
} bst_gospa_result;

/* Computes GOSPA of order p >= 1. distance[i * tracks + j] >= 0: between object i and track j, in
 * the unit of cutoff > 0. Only pairs nearer than the cutoff are assigned. pair_of_truth (`truths`
 * items; may be NULL): track of each object or -1. Exact. Errors: BST_ERR_ARGUMENT,
 * BST_ERR_MEMORY. */
bst_status bst_gospa(bst_ctx *ctx, const double *distance, int truths, int tracks, double cutoff,
                     double order, int *pair_of_truth, bst_gospa_result *out) BST_MUST_CHECK;

/* An object and a track, and their distance. */
typedef struct bst_gospa_pair {
    int truth, track;
    double distance;
} bst_gospa_pair;

typedef struct bst_gospa_problem {
    const bst_gospa_pair *pairs; /* [count] at least all pairs nearer than the cutoff, once each */
    int count;
    int truths, tracks;
    double cutoff, order;
} bst_gospa_problem;

/* Computes GOSPA from the pairs that are nearer than the cutoff.
 *
 * Returned:  pair_of_truth  [truths] track of each object or -1; may be NULL
 * Notes:     exact. Sets of objects and tracks that no such pair connects are assigned each on
 *            their own, O(n^2 m) of the smaller and the larger side of a set.
 * Errors:    BST_ERR_ARGUMENT, BST_ERR_MEMORY */
bst_status bst_gospa_near(bst_ctx *ctx, const bst_gospa_problem *problem, int *pair_of_truth,
                          bst_gospa_result *out) BST_MUST_CHECK;

#endif
