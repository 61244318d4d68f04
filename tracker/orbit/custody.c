#include "tracker/orbit/custody.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "sim/core/cholesky.h"
#include "sim/core/tangent.h"
#include "tracker/orbit/arc_outliers.h"
#include "tracker/orbit/custody_motion.h"
#include "tracker/orbit/orbit_photocentre.h"

enum {
    N = BST_CUSTODY_STATE,
    SETS = 2 * N + 1,
    M = 2 * BST_CUSTODY_DIRECTIONS, /* most numbers of a measurement */
    MOST_ITERATIONS = 5,
    MOST_REJECTED = 4 /* of the directions of an arc one in so many may be outliers */
};

/* ------------------------------------------------------------------ Measurement */

/* What was measured: direction and rate of a track, or directions at some times. */
typedef struct measurement {
    int times, size; /* size: numbers in all */
    double time_s[BST_CUSTODY_DIRECTIONS];
    bst_mat3 gcrf_from_teme[BST_CUSTODY_DIRECTIONS];
    const bst_custody_observation *track; /* NULL: directions */
    const bst_od_observation *directions;
    double factor; /* on the stated covariances */
} measurement;

/* What is measured less what is predicted for a state, in the tangent axes at the observed
 * directions; range_m: to the object. False: no state. */
static bool residuals(const bst_custody_orbit *o, const double x[N], const measurement *z,
                      double out[M], double range_m[BST_CUSTODY_DIRECTIONS]) {
    bst_vec3 r[BST_CUSTODY_DIRECTIONS], v[BST_CUSTODY_DIRECTIONS];
    /* directions need velocities for the light time only: 0.01 s of 0.02 m/s */
    if (!bst_custody_motion(o, x, z->track != NULL, z->times, z->time_s, r, v)) {
        return false;
    }
    for (int i = 0; i < z->times; i++) {
        const bst_od_observer *eye = z->track ? &z->track->observer : &z->directions[i].observer;
        const bst_vec3 seen = z->track ? z->track->direction : z->directions[i].direction;
        const bst_od_state state = {.time_s = eye->time_s,
                                    .position_m = bst_mat3_mul_vec(&z->gcrf_from_teme[i], r[i]),
                                    .velocity_mps = bst_mat3_mul_vec(&z->gcrf_from_teme[i], v[i])};
        bst_od_sight sight;
        bst_od_see(&state, eye, &sight);
        const bst_tangent axes = bst_tangent_at(seen);
        const bst_vec3 d = bst_tangent_log(seen, sight.direction);
        out[2 * i] = -bst_vec3_dot(axes.e1, d);
        out[2 * i + 1] = -bst_vec3_dot(axes.e2, d);
        range_m[i] = sight.range_m;
        if (z->track) {
            const bst_vec3 rate = bst_vec3_sub(
                z->track->rate_radps, bst_tangent_carry(sight.direction, seen, sight.rate_radps));
            out[2] = bst_vec3_dot(axes.e1, rate);
            out[3] = bst_vec3_dot(axes.e2, rate);
        }
    }
    return true;
}

/* Correlation of the photocentre's displacement at two directions of a pass. */
static double photocentre_correlation(const bst_custody_orbit *o, const bst_od_observation *a,
                                      const bst_od_observation *b) {
    const double e = o->elements.eccentricity, n = o->elements.mean_motion_radpmin / 60.0;
    const double rate = n * sqrt((1.0 + e) / (1.0 - e)) / (1.0 - e);
    const double turn = rate * (b->observer.time_s - a->observer.time_s);
    return bst_od_photocentre_correlation(turn, a->direction, b->direction);
}

/* Covariance of the measurement's errors, with that of the photocentre. */
static void noise(const bst_custody_orbit *o, const measurement *z,
                  const double range_m[BST_CUSTODY_DIRECTIONS], double r[M][M]) {
    if (z->track) {
        const double spread =
            bst_od_photocentre_rad(o->photocentre_m, z->track->photocentre_factor, range_m[0]);
        for (int i = 0; i < 4; i++) {
            memcpy(r[i], z->track->covariance[i], sizeof z->track->covariance[i]);
        }
        r[0][0] += spread * spread;
        r[1][1] += spread * spread;
        return;
    }
    for (int i = 0; i < z->times; i++) {
        const bst_od_observation *a = &z->directions[i];
        const bst_tangent axes = bst_tangent_at(a->direction);
        const bst_vec3 ea[2] = {axes.e1, axes.e2};
        double kept = 1.0;
        for (int k = i; k < z->times; k++) {
            const bst_od_observation *b = &z->directions[k];
            const bst_tangent other = bst_tangent_at(b->direction);
            const bst_vec3 eb[2] = {other.e1, other.e2};
            const double spread2 =
                bst_od_photocentre_rad(o->photocentre_m, a->photocentre_factor, range_m[i]) *
                bst_od_photocentre_rad(o->photocentre_m, b->photocentre_factor, range_m[k]) *
                photocentre_correlation(o, a, b);
            const double own[2][2] = {{a->cov_11, a->cov_12}, {a->cov_12, a->cov_22}};
            kept *= k > i ? exp(-b->shared_change) : 1.0;
            for (int p = 0; p < 2; p++) {
                for (int q = 0; q < 2; q++) {
                    double sum = k == i ? own[p][q]
                                        : kept * (a->shared_rad[p][0] * b->shared_rad[q][0] +
                                                  a->shared_rad[p][1] * b->shared_rad[q][1]);
                    sum = z->factor * sum + spread2 * bst_vec3_dot(ea[p], eb[q]);
                    r[2 * i + p][2 * k + q] = r[2 * k + q][2 * i + p] = sum;
                }
            }
        }
    }
}

/* A measurement as a linear function of the state. */
typedef struct linear {
    double y[M]; /* measured minus predicted, at the middle */
    double slope[M][N];
    double r[M][M]; /* covariance of errors, and of what the slope leaves of the curvature */
} linear;

/* Linear function over the states that the middle x and its covariance p allow. False: no state, or
 * a covariance is singular. */
static bool linearise(const bst_custody_orbit *o, const double x[N], const double p[N][N],
                      const measurement *z, linear *out) {
    double root[N][N], y[M], range_m[BST_CUSTODY_DIRECTIONS], unused[BST_CUSTODY_DIRECTIONS];
    if (!bst_custody_root(p, root) || !residuals(o, x, z, y, range_m)) {
        return false;
    }
    memcpy(out->y, y, sizeof y);
    noise(o, z, range_m, out->r);
    for (int i = 0; i < z->size; i++) {
        if (!(out->r[i][i] > 0.0)) {
            return false;
        }
    }
    for (int k = 0; k < N; k++) {
        double at[2][N], seen[2][M], bend[M];
        for (int i = 0; i < N; i++) {
            at[0][i] = x[i] + BST_CUSTODY_SPREAD * root[i][k];
            at[1][i] = x[i] - BST_CUSTODY_SPREAD * root[i][k];
        }
        if (!residuals(o, at[0], z, seen[0], unused) || !residuals(o, at[1], z, seen[1], unused)) {
            return false;
        }
        for (int i = 0; i < z->size; i++) {
            out->slope[i][k] =
                (seen[1][i] - seen[0][i]) / (2.0 * BST_CUSTODY_SPREAD); /* for one column */
            bend[i] =
                (seen[0][i] + seen[1][i] - 2.0 * y[i]) / (BST_CUSTODY_SPREAD * BST_CUSTODY_SPREAD);
            out->y[i] += 0.5 * bend[i];
        }
        for (int i = 0; i < z->size; i++) {
            for (int j = 0; j < z->size; j++) {
                out->r[i][j] += 0.5 * bend[i] * bend[j];
            }
        }
    }
    /* slopes by columns are slope times root */
    for (int i = 0; i < z->size; i++) {
        for (int k = N - 1; k >= 0; k--) {
            for (int j = k + 1; j < N; j++) {
                out->slope[i][k] -= out->slope[i][j] * root[j][k];
            }
            out->slope[i][k] /= root[k][k];
        }
    }
    return true;
}

/* P H', H P H' + R and its Cholesky factor, in units in which R's diagonal is 1. */
typedef struct gain {
    int size;
    double ph[N][M];
    double s[M][M], l[M][M], unit[M];
} gain;

static bool make_gain(const double p[N][N], const linear *at, int size, gain *g) {
    g->size = size;
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < size; j++) {
            g->ph[i][j] = 0.0;
            for (int k = 0; k < N; k++) {
                g->ph[i][j] += p[i][k] * at->slope[j][k];
            }
        }
    }
    for (int i = 0; i < size; i++) {
        g->unit[i] = sqrt(at->r[i][i]);
        for (int j = 0; j < size; j++) {
            g->s[i][j] = at->r[i][j];
            for (int k = 0; k < N; k++) {
                g->s[i][j] += at->slope[i][k] * g->ph[k][j];
            }
        }
    }
    for (int i = 0; i < size; i++) {
        for (int j = 0; j < size; j++) {
            g->l[i][j] = 0.5 * (g->s[i][j] + g->s[j][i]) / (g->unit[i] * g->unit[j]);
        }
    }
    return bst_cholesky_factor(&g->l[0][0], M, size, 1e-14);
}

/* S^-1 y */
static void solve(const gain *g, const double y[M], double out[M]) {
    for (int i = 0; i < g->size; i++) {
        out[i] = y[i] / g->unit[i];
    }
    bst_cholesky_solve(&g->l[0][0], M, g->size, out);
    for (int i = 0; i < g->size; i++) {
        out[i] /= g->unit[i];
    }
}

static measurement of_track(const bst_custody_observation *z) {
    return (measurement){.times = 1,
                         .size = 4,
                         .factor = 1.0,
                         .time_s = {z->observer.time_s},
                         .gcrf_from_teme = {z->gcrf_from_teme},
                         .track = z};
}

bool bst_custody_predict(const bst_custody_orbit *orbit, const bst_custody_filter *filter,
                         const bst_custody_observation *observation, bst_custody_prediction *out) {
    assert(orbit && filter && observation && out);
    const measurement z = of_track(observation);
    linear at;
    gain g;
    double w[M];
    if (!linearise(orbit, filter->x, filter->p, &z, &at) ||
        !make_gain(filter->p, &at, z.size, &g)) {
        return false;
    }
    solve(&g, at.y, w);
    out->chi2 = out->log_determinant = 0.0;
    for (int i = 0; i < z.size; i++) {
        out->chi2 += w[i] * at.y[i];
        out->log_determinant += 2.0 * log(g.l[i][i] * g.unit[i]);
        out->innovation[i] = at.y[i];
        memcpy(out->covariance[i], g.s[i], sizeof out->covariance[i]);
    }
    return isfinite(out->chi2);
}

/* ------------------------------------------------------------------ Update */

/* P = (1 - K H) P (1 - K H)' + K R K' with K = P H' S^-1. */
static void update_covariance(const gain *g, const linear *at, double p[N][N]) {
    double k[N][M], kr[N][M], left[N][N], half[N][N], out[N][N];
    for (int i = 0; i < N; i++) {
        solve(g, g->ph[i], k[i]);
        for (int j = 0; j < N; j++) {
            left[i][j] = i == j ? 1.0 : 0.0;
            for (int a = 0; a < g->size; a++) {
                left[i][j] -= k[i][a] * at->slope[a][j];
            }
        }
        for (int a = 0; a < g->size; a++) {
            kr[i][a] = 0.0;
            for (int b = 0; b < g->size; b++) {
                kr[i][a] += k[i][b] * at->r[b][a];
            }
        }
    }
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            half[i][j] = 0.0;
            for (int a = 0; a < N; a++) {
                half[i][j] += left[i][a] * p[a][j];
            }
        }
    }
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            out[i][j] = 0.0;
            for (int a = 0; a < N; a++) {
                out[i][j] += half[i][a] * left[j][a];
            }
            for (int a = 0; a < g->size; a++) {
                out[i][j] += kr[i][a] * k[j][a];
            }
        }
    }
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            p[i][j] = 0.5 * (out[i][j] + out[j][i]);
        }
    }
}

/* Chi-square above which directions are not those of one object: what innovations of this size
 * exceed with probability 2e-5, z = 4.11 (Wilson and Hilferty, PNAS 17, 1931), if their errors are
 * twice as large as stated. */
static double most_chi2(int size) {
    const double s = 2.0 / (9.0 * size), root = 1.0 - s + 4.11 * sqrt(s);
    return 4.0 * size * root * root * root;
}

/* How an update fits its measurement. */
typedef struct fit {
    double innovations; /* chi-square of them, by the covariance before the update */
    /* chi-square of what the update leaves, by the covariance of the errors; its expectation */
    double rest, expected;
    double each[BST_CUSTODY_DIRECTIONS]; /* of a direction, by its own covariance */
} fit;

/* With w = S^-1 y the update leaves e = R w, and e' R^-1 e has the expectation tr(S^-1 R). */
static void judge_fit(const gain *g, const linear *at, const double w[M], fit *out) {
    double e[M];
    out->rest = out->expected = 0.0;
    for (int i = 0; i < g->size; i++) {
        double column[M];
        e[i] = 0.0;
        for (int k = 0; k < g->size; k++) {
            e[i] += at->r[i][k] * w[k];
        }
        out->rest += w[i] * e[i];
        solve(g, at->r[i], column);
        out->expected += column[i];
    }
    for (int i = 0; i + 1 < g->size; i += 2) {
        const double xx = at->r[i][i], xy = at->r[i][i + 1], yy = at->r[i + 1][i + 1];
        out->each[i / 2] =
            (e[i] * e[i] * yy - 2.0 * e[i] * e[i + 1] * xy + e[i + 1] * e[i + 1] * xx) /
            (xx * yy - xy * xy);
    }
}

/* quality: NULL if it is not asked for. */
static bool update(const bst_custody_orbit *o, const measurement *z, bst_custody_filter *filter,
                   fit *quality) {
    bst_custody_filter next = *filter;
    for (int iteration = 0; iteration < MOST_ITERATIONS; iteration++) {
        linear at;
        gain g;
        if (!linearise(o, next.x, next.p, z, &at) || !make_gain(filter->p, &at, z->size, &g)) {
            return false;
        }
        /* x = x0 + K (y(x) - H (x0 - x)) */
        double y[M], w[M], moved = 0.0;
        for (int i = 0; i < z->size; i++) {
            y[i] = at.y[i];
            for (int k = 0; k < N; k++) {
                y[i] -= at.slope[i][k] * (filter->x[k] - next.x[k]);
            }
        }
        solve(&g, y, w);
        if (iteration == 0 && quality) {
            quality->innovations = 0.0;
            for (int i = 0; i < z->size; i++) {
                quality->innovations += y[i] * w[i];
            }
        }
        memcpy(next.p, filter->p, sizeof next.p);
        update_covariance(&g, &at, next.p);
        for (int k = 0; k < N; k++) {
            double to = filter->x[k];
            for (int i = 0; i < z->size; i++) {
                to += g.ph[k][i] * w[i];
            }
            moved = fmax(moved, fabs(to - next.x[k]) / sqrt(next.p[k][k]));
            next.x[k] = to;
        }
        if (moved < 1e-2 || iteration + 1 == MOST_ITERATIONS) {
            if (quality) {
                judge_fit(&g, &at, w, quality);
            }
            break;
        }
    }
    *filter = next;
    return true;
}

bool bst_custody_update(const bst_custody_orbit *orbit, const bst_custody_observation *observation,
                        bst_custody_filter *filter) {
    assert(orbit && observation && filter);
    const measurement z = of_track(observation);
    return update(orbit, &z, filter, NULL);
}

/* Directions; axes: orientation of TEME at two times, linear between and beyond them. */
static measurement of_directions(const bst_mat3 axes[2], const double axes_s[2],
                                 const bst_od_observation *directions, int count) {
    measurement z = {.times = count, .size = 2 * count, .directions = directions, .factor = 1.0};
    const double span = axes_s[1] - axes_s[0];
    for (int i = 0; i < count; i++) {
        z.time_s[i] = directions[i].observer.time_s;
        const double part = span > 0.0 ? (z.time_s[i] - axes_s[0]) / span : 0.0;
        for (int k = 0; k < 9; k++) {
            const double first = axes[0].m[k / 3][k % 3], last = axes[1].m[k / 3][k % 3];
            z.gcrf_from_teme[i].m[k / 3][k % 3] = first + part * (last - first);
        }
    }
    return z;
}

bool bst_custody_update_directions(const bst_custody_orbit *orbit, const bst_mat3 gcrf_from_teme[2],
                                   const bst_od_observation *directions, int count,
                                   bst_custody_filter *filter) {
    assert(orbit && gcrf_from_teme && directions && filter);
    assert(count > 0 && count <= BST_CUSTODY_DIRECTIONS);
    bst_od_observation kept[BST_CUSTODY_DIRECTIONS];
    memcpy(kept, directions, (size_t)count * sizeof *kept);
    const int least = count - count / MOST_REJECTED;
    const double axes_s[2] = {kept[0].observer.time_s, kept[count - 1].observer.time_s};
    measurement z = of_directions(gcrf_from_teme, axes_s, kept, count);
    bst_custody_filter next;
    fit quality;
    for (;;) {
        next = *filter;
        if (!update(orbit, &z, &next, &quality)) {
            return false;
        }
        const int worst = bst_arc_outlier(quality.each, z.times);
        if (worst < 0 || z.times == least) {
            break;
        }
        bst_arc_drop(kept, z.times, worst);
        z = of_directions(gcrf_from_teme, axes_s, kept, z.times - 1);
    }
    if (!(quality.innovations < most_chi2(z.size))) {
        return false;
    }
    z.factor = (BST_OD_PRIOR_DOF + quality.rest) / (BST_OD_PRIOR_DOF + quality.expected);
    return update(orbit, &z, filter, NULL);
}
