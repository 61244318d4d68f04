#include "sim/eval/gospa.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

typedef struct solver {
    int rows, columns; /* rows <= columns */
    const double *distance;
    int stride_row, stride_column;
    double cutoff, order;
    double *u, *v, *least;
    int *row_of, *way;
    char *done;
} solver;

/* Cost of assigning a truth object to a track: distance^order, cut off. */
static double cost(const solver *s, int row, int column) {
    double d = s->distance[row * s->stride_row + column * s->stride_column];
    return pow(d < s->cutoff ? d : s->cutoff, s->order);
}

/* Finds the shortest augmenting path from one row to a free column of the assignment (Kuhn 1955,
 * Munkres 1957, with dual variables). Row and column 0 mean none. */
static void augment(solver *s, int row) {
    int column = 0;
    s->row_of[0] = row;
    for (int j = 0; j <= s->columns; j++) {
        s->least[j] = INFINITY;
        s->done[j] = 0;
    }
    do {
        s->done[column] = 1;
        int from = s->row_of[column], next = 0;
        double step = INFINITY;
        for (int j = 1; j <= s->columns; j++) {
            if (s->done[j]) {
                continue;
            }
            double reduced = cost(s, from - 1, j - 1) - s->u[from] - s->v[j];
            if (reduced < s->least[j]) {
                s->least[j] = reduced;
                s->way[j] = column;
            }
            if (s->least[j] < step) {
                step = s->least[j];
                next = j;
            }
        }
        for (int j = 0; j <= s->columns; j++) {
            if (s->done[j]) {
                s->u[s->row_of[j]] += step;
                s->v[j] -= step;
            } else {
                s->least[j] -= step;
            }
        }
        column = next;
    } while (s->row_of[column] != 0);
    while (column != 0) {
        int before = s->way[column];
        s->row_of[column] = s->row_of[before];
        column = before;
    }
}

/* Adds an assigned pair to the localisation error of GOSPA. */
static void add_pair(const solver *s, bool turned, int row, int column, int *pair_of_truth,
                     bst_gospa_result *out) {
    double d = s->distance[row * s->stride_row + column * s->stride_column];
    if (!(d < s->cutoff)) {
        return;
    }
    out->pairs++;
    out->localisation += pow(d, s->order);
    if (pair_of_truth) {
        pair_of_truth[turned ? column : row] = turned ? row : column;
    }
}

bst_status bst_gospa(bst_ctx *ctx, const double *distance, int truths, int tracks, double cutoff,
                     double order, int *pair_of_truth, bst_gospa_result *out) {
    memset(out, 0, sizeof *out);
    if (truths < 0 || tracks < 0 || !(cutoff > 0.0) || !(order >= 1.0) || !isfinite(order) ||
        !isfinite(cutoff)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "gospa: needs counts >= 0, a finite cutoff > 0 and an order >= 1");
    }
    for (size_t i = 0; i < (size_t)truths * (size_t)tracks; i++) {
        if (!(distance[i] >= 0.0)) {
            return bst_fail(ctx, BST_ERR_ARGUMENT, "gospa: distance %zu is not >= 0", i);
        }
    }
    for (int i = 0; pair_of_truth && i < truths; i++) {
        pair_of_truth[i] = -1;
    }
    bool turned = truths > tracks;
    solver s = {.rows = turned ? tracks : truths,
                .columns = turned ? truths : tracks,
                .distance = distance,
                .stride_row = turned ? 1 : tracks,
                .stride_column = turned ? tracks : 1,
                .cutoff = cutoff,
                .order = order};
    size_t n = (size_t)s.columns + 1;
    double *reals = calloc(3 * n, sizeof *reals);
    int *ints = calloc(2 * n, sizeof *ints);
    s.done = calloc(n, 1);
    bst_status status = BST_OK;
    if (!reals || !ints || !s.done) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "gospa: out of memory");
        goto exit;
    }
    s.u = reals;
    s.v = reals + n;
    s.least = reals + 2 * n;
    s.row_of = ints;
    s.way = ints + n;
    for (int row = 1; row <= s.rows; row++) {
        augment(&s, row);
    }
    for (int j = 1; j <= s.columns; j++) {
        if (s.row_of[j] != 0) {
            add_pair(&s, turned, s.row_of[j] - 1, j - 1, pair_of_truth, out);
        }
    }
    double half = 0.5 * pow(cutoff, order);
    out->missed_count = truths - out->pairs;
    out->false_count = tracks - out->pairs;
    out->missed = half * out->missed_count;
    out->false_tracks = half * out->false_count;
    out->gospa = pow(out->localisation + out->missed + out->false_tracks, 1.0 / order);
exit:
    free(reals);
    free(ints);
    free(s.done);
    return status;
}
