/* Orbit determination from directions: candidate choice on a first part, then growth to the whole
 * arc. */
#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/bodies.h"

#include "tracker/orbit/orbit_initial.h"

enum {
    FIRST_SAMPLES = 40,   /* observations of the first part to which candidates are fitted */
    GROWING_SAMPLES = 200 /* most observations of an intermediate arc */
};

/* Length of the first part of the arc, if it contains enough observations. */
static const double FIRST_SPAN_S = 1800.0;

/* Fits that others start from: least_gain; most_iterations, which one start of many needs. */
static const double START_GAIN = 1e-3;
enum { START_ITERATIONS = 30 };

typedef struct part {
    int first, last; /* inclusive */
} part;

static double time_of(const bst_od_observation *o, int i) {
    return o[i].observer.time_s;
}

/* Part of length `span_s` with the most observations. */
static part densest_part(const bst_od_observation *o, int count, double span_s) {
    part best = {0, 0};
    for (int first = 0, last = 0; first < count; first++) {
        while (last + 1 < count && time_of(o, last + 1) - time_of(o, first) <= span_s) {
            last++;
        }
        if (last - first > best.last - best.first) {
            best = (part){first, last};
        }
    }
    return best;
}

/* True if a part has enough observations at different times: up to 8, spread over at least half of
 * `span_s` if possible. */
static bool is_enough(const bst_od_observation *o, int count, part p) {
    int times = 1, wanted = count < 8 ? count : 8;
    for (int i = p.first + 1; i <= p.last; i++) {
        times += time_of(o, i) > time_of(o, i - 1);
    }
    return times >= wanted;
}

/* Chooses the first part of the arc. */
static part first_part(const bst_od_observation *o, int count, double *span_s) {
    double whole = time_of(o, count - 1) - time_of(o, 0);
    *span_s = FIRST_SPAN_S;
    part p = densest_part(o, count, *span_s);
    while (!is_enough(o, count, p) && *span_s < whole) {
        *span_s *= 2.0;
        p = densest_part(o, count, *span_s);
    }
    return p;
}

/* Selects up to `most` observations of a part, evenly; returns their number. */
static int select_evenly(const bst_od_observation *o, part p, int most, bst_od_observation *out) {
    int n = p.last - p.first + 1, count = n < most ? n : most;
    for (int i = 0; i < count; i++) {
        out[i] = o[p.first + (count > 1 ? (int)((int64_t)i * (n - 1) / (count - 1)) : 0)];
    }
    return count;
}

static double eccentricity(const bst_od_state *s, double mu) {
    double r = bst_vec3_norm(s->position_m), v2 = bst_vec3_dot(s->velocity_mps, s->velocity_mps);
    double along = bst_vec3_dot(s->position_m, s->velocity_mps);
    bst_vec3 e = bst_vec3_axpy(bst_vec3_scale(s->position_m, (v2 - mu / r) / mu), -along / mu,
                               s->velocity_mps);
    return bst_vec3_norm(e);
}

/* A candidate fitted to the first part. */
typedef struct started {
    bst_od_solution solution;
    bst_od_method method;
} started;

static int by_chi2(const void *a, const void *b) {
    const started *x = a, *y = b;
    double p = x->solution.chi2, q = y->solution.chi2;
    return (p > q) - (p < q);
}

/* Fits each candidate orbit to the first part with two-body motion; converged ones, best first. */
static bst_status fit_candidates(bst_ctx *ctx, const bst_od_observation *items, int count,
                                 int most_failures, started out[BST_OD_CANDIDATES], int *found,
                                 int *tried) {
    bst_od_candidate candidates[BST_OD_CANDIDATES];
    const bst_od_options options = {.least_gain = START_GAIN, .most_iterations = START_ITERATIONS};
    BST_TRY(bst_od_initial(ctx, items, count, candidates, tried));
    bst_ctx quiet = {0};
    bst_status worst = BST_OK;
    bool hyperbolic = false;
    *found = 0;
    const int most = most_failures > 0 && most_failures < *tried ? most_failures : *tried;
    for (int i = 0; i < *tried && (*found > 0 || i < most); i++) {
        bst_od_solution solution;
        bst_status status =
            bst_od_fit(&quiet, items, count, &options, &candidates[i].state, NULL, &solution);
        if (status == BST_ERR_MEMORY || status == BST_ERR_ARGUMENT) {
            return bst_fail(ctx, status, "%s", quiet.message);
        }
        if (status == BST_OK && !(eccentricity(&solution.state, BST_EARTH_MU_M3PS2) < 1.0)) {
            hyperbolic = true;
        } else if (status == BST_OK) {
            out[(*found)++] = (started){solution, candidates[i].method};
        } else if (worst == BST_OK) {
            worst = bst_fail(ctx, status, "%s", quiet.message);
        }
    }
    if (*found == 0) {
        return hyperbolic ? bst_fail(ctx, BST_ERR_NUMERIC,
                                     "only hyperbolic orbits fit the observations, which nothing "
                                     "about the Earth has: the arc is too short for their errors, "
                                     "or they are of several objects")
                          : worst;
    }
    qsort(out, (size_t)*found, sizeof *out, by_chi2);
    return BST_OK;
}

/* True if two solutions of a part are the same minimum. */
static bool is_same(const bst_od_solution *a, const bst_od_solution *b) {
    /* minima of one part differ by more than 2 % in range or velocity; the iteration converges far
     * closer */
    return fabs(log(a->range_m / b->range_m)) < 0.02 &&
           bst_vec3_norm(bst_vec3_sub(a->state.velocity_mps, b->state.velocity_mps)) <
               0.02 * bst_vec3_norm(a->state.velocity_mps);
}

/* The arc: all observations, fit options, and room for GROWING_SAMPLES of them. */
typedef struct arc {
    const bst_od_observation *items;
    int count;
    const bst_od_options *options;
    bst_od_observation *room;
} arc;

/* Extends a fit from a part to the whole arc. */
static bst_status extend_to_arc(bst_ctx *ctx, const arc *a, part p, double span_s,
                                const bst_od_state *from, bst_od_solution *out) {
    const bst_od_observation *o = a->items;
    const int count = a->count;
    bst_od_state state = *from;
    double middle = 0.5 * (time_of(o, p.first) + time_of(o, p.last));
    double whole = time_of(o, count - 1) - time_of(o, 0);
    bst_od_options growing = *a->options;
    growing.scale_variance = false;
    growing.least_gain = START_GAIN;
    while (span_s < whole) {
        int n = p.last - p.first + 1;
        span_s *= 2.0;
        while (p.first > 0 && middle - time_of(o, p.first - 1) <= 0.5 * span_s) {
            p.first--;
        }
        while (p.last + 1 < count && time_of(o, p.last + 1) - middle <= 0.5 * span_s) {
            p.last++;
        }
        if (p.last - p.first + 1 > n && p.last - p.first + 1 < count) {
            int used = select_evenly(o, p, GROWING_SAMPLES, a->room);
            BST_TRY(bst_od_fit(ctx, a->room, used, &growing, &state, NULL, out));
            state = out->state;
        }
    }
    if (count > GROWING_SAMPLES) { /* a selection first, then all observations */
        int used = select_evenly(o, (part){0, count - 1}, GROWING_SAMPLES, a->room);
        BST_TRY(bst_od_fit(ctx, a->room, used, &growing, &state, NULL, out));
        state = out->state;
    }
    return bst_od_fit(ctx, o, count, a->options, &state, NULL, out);
}

/* Determines the orbit from a given first part of the arc. */
static bst_status solve_from(bst_ctx *ctx, const arc *a, part p, double span_s,
                             double *residual_chi2, bst_od_solution *out, bst_od_report *report) {
    started starts[BST_OD_CANDIDATES];
    int found, used = select_evenly(a->items, p, FIRST_SAMPLES, a->room);
    BST_TRY(fit_candidates(ctx, a->room, used, a->options->most_failures, starts, &found,
                           &report->candidates));
    bst_status status = BST_OK;
    bool done = false;
    bst_ctx quiet = {0};
    double best = INFINITY;
    for (int i = 0; i < found; i++) {
        bool again = false;
        for (int k = 0; k < i; k++) {
            again = again || is_same(&starts[i].solution, &starts[k].solution);
        }
        if (again) {
            continue;
        }
        if (done && !isfinite(report->other_chi2)) {
            report->other_chi2 = starts[i].solution.chi2;
        }
        /* a good fit to the whole arc needs no other candidate */
        if (done && best < 3.0) {
            break;
        }
        bst_od_solution solution;
        bst_status grown =
            extend_to_arc(&quiet, a, p, span_s, &starts[i].solution.state, &solution);
        double excess = grown == BST_OK && solution.dof > 0 ? solution.chi2 / solution.dof : 1.0;
        /* penalty: rejecting observations must not improve the rank */
        excess += grown == BST_OK ? 100.0 * solution.rejected / a->count : 0.0;
        if (grown == BST_OK &&
            !(eccentricity(&solution.state, bst_od_gm(&a->options->motion)) < 1.0)) {
            grown = bst_fail(&quiet, BST_ERR_NUMERIC,
                             "only a hyperbolic orbit fits the observations, which nothing about "
                             "the Earth has: the arc is too short for their errors, or they are "
                             "of several objects");
        }
        if (grown == BST_OK && excess < best) {
            best = excess;
            *out = solution;
            report->method = starts[i].method;
            report->first_chi2 = starts[i].solution.chi2;
            done = true;
        } else if (grown != BST_OK && !done && status == BST_OK) {
            status = bst_fail(ctx, grown, "%s", quiet.message);
        }
    }
    if (!done) {
        return status;
    }
    if (residual_chi2) {
        bst_od_state chosen = out->state;
        return bst_od_fit(ctx, a->items, a->count, a->options, &chosen, residual_chi2, out);
    }
    return BST_OK;
}

/* Determines the orbit; on failure with longer first parts. */
static bst_status solve_arc(bst_ctx *ctx, const arc *a, double *residual_chi2, bst_od_solution *out,
                            bst_od_report *report) {
    const bst_od_observation *o = a->items;
    const int count = a->count;
    double span_s, whole = time_of(o, count - 1) - time_of(o, 0);
    part p = first_part(o, count, &span_s);
    for (;;) {
        bst_status status = solve_from(ctx, a, p, span_s, residual_chi2, out, report);
        if (status != BST_ERR_NUMERIC || span_s >= whole) {
            return status;
        }
        /* a longer part may determine what a shorter one does not */
        const part failed = p;
        while (span_s < whole && p.first == failed.first && p.last == failed.last) {
            span_s *= 2.0;
            p = densest_part(o, count, span_s);
        }
    }
}

bst_status bst_od_determine(bst_ctx *ctx, const bst_od_observation *observations, int count,
                            const bst_od_options *options, double *residual_chi2,
                            bst_od_solution *out, bst_od_report *report) {
    assert(options && out && count >= 0 && (observations || count == 0));
    bst_od_report unused;
    report = report ? report : &unused;
    *report = (bst_od_report){.other_chi2 = INFINITY};
    *out = (bst_od_solution){0};
    if (count < BST_OD_LEAST) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%d observations are too few: an orbit needs %d",
                        count, BST_OD_LEAST);
    }
    bst_od_observation *room = malloc(GROWING_SAMPLES * sizeof *room);
    if (!room) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for observations");
    }
    const arc all = {observations, count, options, room};
    bst_status status = solve_arc(ctx, &all, residual_chi2, out, report);
    free(room);
    return status;
}
