/* Space-filling designs: points in the unit cube of a study's axes. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/rng.h"
#include "sim/studies/study_internal.h"

/* limit of all designs of a study: 128 MiB */
static const double MOST_PLACED = 16777216.0;

typedef struct ranked {
    double key;
    int64_t index;
} ranked;

static int compare(const void *a, const void *b) {
    const ranked *x = a, *y = b;
    return x->key != y->key ? (x->key < y->key ? -1 : 1)
                            : (x->index > y->index) - (x->index < y->index);
}

/* Random permutation of 0 .. n - 1, by sorting uniform keys. */
static void shuffle(bst_rng_key key, uint64_t a, int64_t n, ranked *out) {
    for (int64_t i = 0; i < n; i++) {
        out[i] = (ranked){bst_rng_uniform(key, a, (uint64_t)i), i};
    }
    qsort(out, (size_t)n, sizeof *out, compare);
}

/* Latin hypercube: McKay, Beckman and Conover 1979, Technometrics 21, 239. */
static void latin_hypercube(bst_rng_key order, bst_rng_key within, int axes, int64_t points,
                            ranked *scratch, double *unit) {
    for (int a = 0; a < axes; a++) {
        shuffle(order, (uint64_t)a, points, scratch);
        for (int64_t i = 0; i < points; i++) {
            double u = bst_rng_uniform(within, (uint64_t)a, (uint64_t)i);
            unit[i * axes + a] = ((double)scratch[i].index + u) / (double)points;
        }
    }
}

/* One path of a Morris design (1991, Technometrics 33, 161): from a random point on the lower part
 * of the grid of `levels` levels, each axis moves once by delta = levels / (2 (levels - 1)), in
 * random order, up or down. */
static void morris_path(bst_rng_key key, uint64_t path, int axes, int levels, ranked *scratch,
                        double *unit) {
    double delta = levels / (2.0 * (levels - 1.0));
    int lower = levels / 2; /* levels from which delta leads to another level */
    for (int a = 0; a < axes; a++) {
        bst_philox_words w = bst_rng_words(key, path, (uint64_t)a);
        double base = (double)(w.w[0] % (uint32_t)lower) / (levels - 1.0);
        bool down = w.w[1] & 1u;
        unit[a] = down ? base + delta : base;
    }
    for (int a = 0; a < axes; a++) {
        scratch[a] = (ranked){bst_rng_uniform(key, path, (uint64_t)axes + (uint64_t)a), a};
    }
    qsort(scratch, (size_t)axes, sizeof *scratch, compare);
    for (int s = 1; s <= axes; s++) {
        double *point = unit + s * axes;
        memcpy(point, point - axes, (size_t)axes * sizeof *point);
        double *moved = &point[scratch[s - 1].index];
        *moved += *moved > delta - 1e-9 ? -delta : delta; /* larger than all lower levels */
    }
}

/* Checks that a design fits in memory with the earlier ones. */
static bst_status check_size(bst_ctx *ctx, const bst_study *study, const bst_study_factor *factor) {
    double here = (double)factor->levels * factor->axis_count, placed = here;
    for (int f = 0; f < study->factor_count; f++) {
        const bst_study_factor *before = &study->factors[f];
        placed += before->unit ? (double)before->levels * before->axis_count : 0.0;
    }
    return placed <= MOST_PLACED
               ? BST_OK
               : bst_fail(ctx, BST_ERR_CONFIG,
                          "%s: /sweeps/%d/%s: the design has %lld points of %d axes, %.0f values "
                          "(allowed: %.0f values in all designs latin_hypercube and morris of a "
                          "study); take fewer points, or draw the values by dispersions, whose "
                          "number of runs is not limited by memory",
                          study->file, factor->sweep, factor->steps ? "trajectories" : "points",
                          (long long)factor->levels, factor->axis_count, here, MOST_PLACED);
}

bst_status bst_study_place_points(bst_ctx *ctx, const bst_study *study,
                                  const bst_study_sweep_config *sweep, bst_study_factor *factor) {
    bool morris = sweep->design == BST_SWEEP_MORRIS;
    int axes = factor->axis_count;
    if (morris && sweep->levels % 2 != 0) {
        return bst_fail(ctx, BST_ERR_CONFIG, "%s: /sweeps/%d/levels: not even (found %lld)",
                        study->file, factor->sweep, (long long)sweep->levels);
    }
    factor->levels = morris ? sweep->trajectories * (axes + 1) : sweep->points;
    factor->steps = morris ? (int)sweep->levels : 0;
    BST_TRY(check_size(ctx, study, factor));
    int64_t room = factor->levels > axes ? factor->levels : axes;
    ranked *scratch = malloc((size_t)room * sizeof *scratch);
    factor->unit = malloc((size_t)factor->levels * (size_t)axes * sizeof *factor->unit);
    if (!scratch || !factor->unit) {
        free(scratch);
        free(factor->unit);
        factor->unit = NULL;
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the study's points");
    }
    char name[32];
    snprintf(name, sizeof name, "sweep %d", factor->sweep);
    if (morris) {
        bst_rng_key key = bst_rng_make_key(study->config.seed, 0, name, "morris");
        for (int64_t t = 0; t < sweep->trajectories; t++) {
            morris_path(key, (uint64_t)t, axes, factor->steps, scratch,
                        factor->unit + t * (axes + 1) * axes);
        }
    } else {
        latin_hypercube(bst_rng_make_key(study->config.seed, 0, name, "order"),
                        bst_rng_make_key(study->config.seed, 0, name, "place"), axes, sweep->points,
                        scratch, factor->unit);
    }
    free(scratch);
    return BST_OK;
}
