/* Generalised optimal sub-pattern assignment metric between a set of true objects and a set of
 * tracks (Rahmathullah, Garcia-Fernandez and Svensson, 20th Int. Conf. on Information Fusion,
 * 2017), alpha = 2: the form that splits into localisation, missed and false. */
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

/* distance[i * tracks + j] >= 0 is that of object i and track j, in the unit of cutoff > 0; order p
 * is at least 1. A pair is made only when it is nearer than the cutoff. pair_of_truth (`truths`
 * places; may be NULL) receives each object's track or -1. Exact, O(n^2 m) of the smaller and the
 * larger set. Errors: BST_ERR_ARGUMENT, BST_ERR_MEMORY. */
bst_status bst_gospa(bst_ctx *ctx, const double *distance, int truths, int tracks, double cutoff,
                     double order, int *pair_of_truth, bst_gospa_result *out) BST_MUST_CHECK;

#endif
