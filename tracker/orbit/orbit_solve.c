/* The whole way from directions to an orbit. */
#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/bodies.h"

#include "tracker/orbit/orbit_initial.h"

enum {
    FIRST_SAMPLES = 40,   /* observations of the first part that candidates are fitted to */
    GROWING_SAMPLES = 200 /* of an arc that is not the whole one */
};

/* The first part is as long as this, where it holds enough. */
static const double FIRST_SPAN_S = 1800.0;

typedef struct part {
    int first, last; /* inclusive */
} part;

static double time_of(const bst_od_observation *o, int i) {
    return o[i].observer.time_s;
}

/* The stretch of `span_s` with the most observations. */
static part fullest(const bst_od_observation *o, int count, double span_s) {
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

/* Different times among the observations of a part, counted up to 8, spread over half of `span_s`
 * at least unless there are no others. */
static bool is_enough(const bst_od_observation *o, int count, part p) {
    int times = 1, wanted = count < 8 ? count : 8;
    for (int i = p.first + 1; i <= p.last; i++) {
        times += time_of(o, i) > time_of(o, i - 1);
    }
    return times >= wanted;
}

static part first_part(const bst_od_observation *o, int count, double *span_s) {
    double whole = time_of(o, count - 1) - time_of(o, 0);
    *span_s = FIRST_SPAN_S;
    part p = fullest(o, count, *span_s);
    while (!is_enough(o, count, p) && *span_s < whole) {
        *span_s *= 2.0;
        p = fullest(o, count, *span_s);
    }
    return p;
}

/* Up to `most` observations of a part, evenly; returns how many. */
static int thin(const bst_od_observation *o, part p, int most, bst_od_observation *out) {
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

typedef struct started {
    bst_od_solution solution;
    bst_od_method method;
} started;

static int by_chi2(const void *a, const void *b) {
    const started *x = a, *y = b;
    double p = x->solution.chi2, q = y->solution.chi2;
    return (p > q) - (p < q);
}

/* Fits each candidate to the first part, two bodies; the ones that converge, best first. */
static bst_status start(bst_ctx *ctx, const bst_od_observation *items, int count,
                        started out[BST_OD_CANDIDATES], int *found, int *tried) {
    bst_od_candidate candidates[BST_OD_CANDIDATES];
    const bst_od_options options = {0};
    BST_TRY(bst_od_initial(ctx, items, count, candidates, tried));
    bst_ctx quiet = {0};
    bst_status worst = BST_OK;
    bool hyperbolic = false;
    *found = 0;
    for (int i = 0; i < *tried; i++) {
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

/* Whether two solutions of one part are the same minimum. */
static bool is_same(const bst_od_solution *a, const bst_od_solution *b) {
    return fabs(log(a->range_m / b->range_m)) < 0.02 &&
           bst_vec3_norm(bst_vec3_sub(a->state.velocity_mps, b->state.velocity_mps)) <
               0.02 * bst_vec3_norm(a->state.velocity_mps);
}

/* All observations, how they are to be fitted, and room for GROWING_SAMPLES of them. */
typedef struct arc {
    const bst_od_observation *items;
    int count;
    const bst_od_options *options;
    bst_od_observation *room;
} arc;

/* From an orbit that fits the part to one that fits all. */
static bst_status grow(bst_ctx *ctx, const arc *a, part p, double span_s, const bst_od_state *from,
                       bst_od_solution *out) {
    const bst_od_observation *o = a->items;
    const int count = a->count;
    bst_od_state state = *from;
    double middle = 0.5 * (time_of(o, p.first) + time_of(o, p.last));
    double whole = time_of(o, count - 1) - time_of(o, 0);
    bst_od_options growing = *a->options;
    growing.scale_variance = false;
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
            int used = thin(o, p, GROWING_SAMPLES, a->room);
            BST_TRY(bst_od_fit(ctx, a->room, used, &growing, &state, NULL, out));
            state = out->state;
        }
    }
    if (count > GROWING_SAMPLES) { /* near first, then all */
        int used = thin(o, (part){0, count - 1}, GROWING_SAMPLES, a->room);
        BST_TRY(bst_od_fit(ctx, a->room, used, &growing, &state, NULL, out));
        state = out->state;
    }
    return bst_od_fit(ctx, o, count, a->options, &state, NULL, out);
}

/* From a first part of the arc. */
static bst_status solve_from(bst_ctx *ctx, const arc *a, part p, double span_s,
                             double *residual_chi2, bst_od_solution *out, bst_od_report *report) {
    started starts[BST_OD_CANDIDATES];
    int found, used = thin(a->items, p, FIRST_SAMPLES, a->room);
    BST_TRY(start(ctx, a->room, used, starts, &found, &report->candidates));
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
        /* a whole arc that fits needs no other orbit */
        if (done && best < 3.0) {
            break;
        }
        bst_od_solution solution;
        bst_status grown = grow(&quiet, a, p, span_s, &starts[i].solution.state, &solution);
        double excess = grown == BST_OK && solution.dof > 0 ? solution.chi2 / solution.dof : 1.0;
        /* leaving observations out is no way to fit */
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

static bst_status solve(bst_ctx *ctx, const arc *a, double *residual_chi2, bst_od_solution *out,
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
        /* what a part does not tell, a longer one may */
        span_s *= 2.0;
        p = fullest(o, count, span_s);
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
    bst_status status = solve(ctx, &all, residual_chi2, out, report);
    free(room);
    return status;
}
