#include "tracker/orbit/orbit_initial.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/bodies.h"

#include "sim/astro/gauss_angles.h"
#include "sim/astro/kepler.h"
#include "sim/core/tangent.h"

static const double MU = BST_EARTH_MU_M3PS2;

enum {
    SAMPLES = 10, /* number of observations by which candidates are ranked */
    RANGES = 64,  /* grid of ranges over the admissible region */
    RATES = 17,
    ENDS = 40, /* ranges per end for Lambert's problem */
};
static const double NEAREST_M = 1e4, FARTHEST_M = 1.2e8;

const char *bst_od_method_name(bst_od_method method) {
    static const char *const names[] = {"gauss", "admissible_region", "two_point"};
    return names[method];
}

/* Direction from the observer at reception to the body at emission in geocentric axes: the light
 * path minus the Earth's displacement during the light time, which is proportional to the path.
 * *stretch: geocentric over barycentric length. */
static bst_vec3 geocentric_direction(const bst_od_observation *o, double *stretch) {
    bst_vec3 line =
        bst_vec3_axpy(o->direction, 1.0 / BST_LIGHT_SPEED_MPS, o->observer.earth_bary_mps);
    *stretch = bst_vec3_norm(line);
    return bst_vec3_unit(line);
}

/* Geocentric position of a body at a given range; emission time. */
static bst_vec3 position_at_range(const bst_od_observation *o, double range_m, double *emitted_s) {
    double stretch;
    bst_vec3 q = geocentric_direction(o, &stretch);
    *emitted_s = o->observer.time_s - range_m / (stretch * BST_LIGHT_SPEED_MPS);
    return bst_vec3_axpy(o->observer.position_m, range_m, q);
}

/* True if a state is a bound orbit above the Earth. */
static bool is_bound(const bst_od_state *s) {
    double r = bst_vec3_norm(s->position_m), v2 = bst_vec3_dot(s->velocity_mps, s->velocity_mps);
    double h = bst_vec3_norm(bst_vec3_cross(s->position_m, s->velocity_mps)), p = h * h / MU;
    double energy = 0.5 * v2 - MU / r;
    if (!(energy < 0.0)) {
        return false;
    }
    double e = sqrt(fmax(0.0, 1.0 + 2.0 * energy * p / MU));
    /* perigee may be somewhat inside the Earth: an initial orbit need not be accurate */
    return p / (1.0 + e) > 0.75 * BST_EARTH_RADIUS_M && p / (1.0 - e) < 1e9;
}

/* Direction in which an orbit would be observed at the time of an observation. */
static bst_status predict_direction(const bst_od_state *orbit, const bst_od_observation *o,
                                    bst_od_sight *out) {
    bst_od_state then = {.time_s = o->observer.time_s};
    BST_TRY(bst_kepler_propagate(NULL, MU, orbit->position_m, orbit->velocity_mps,
                                 then.time_s - orbit->time_s, &then.position_m,
                                 &then.velocity_mps));
    bst_od_see(&then, &o->observer, out);
    return BST_OK;
}

/* ------------------------------------------------------------------ Gooding's iteration */

/* Orbit through the first and third observation at given ranges (state at the first emission), and
 * its miss of the middle direction. */
static bool middle_miss(const bst_od_observation o[3], bst_lambert_way way, double range_1_m,
                        double range_3_m, bst_od_state *orbit, double out[2]) {
    double t1, t3;
    bst_vec3 v3;
    bst_vec3 r1 = position_at_range(&o[0], range_1_m, &t1),
             r3 = position_at_range(&o[2], range_3_m, &t3);
    bst_od_sight sight;
    orbit->time_s = t1;
    orbit->position_m = r1;
    if (bst_lambert(NULL, MU, r1, r3, t3 - t1, way, &orbit->velocity_mps, &v3) != BST_OK ||
        predict_direction(orbit, &o[1], &sight) != BST_OK) {
        return false;
    }
    bst_tangent axes = bst_tangent_at(o[1].direction);
    bst_vec3 off = bst_tangent_log(o[1].direction, sight.direction);
    out[0] = bst_vec3_dot(axes.e1, off);
    out[1] = bst_vec3_dot(axes.e2, off);
    return isfinite(out[0] + out[1]);
}

bst_status bst_od_gooding(bst_ctx *ctx, const bst_od_observation o[3], bst_lambert_way way,
                          double range_1_m, double range_3_m, bst_od_state *out) {
    double x[2] = {log(range_1_m), log(range_3_m)}, f[2];
    bst_od_state orbit;
    bool good = middle_miss(o, way, range_1_m, range_3_m, &orbit, f);
    for (int iteration = 0; iteration < 40 && good; iteration++) {
        double slope[2][2];
        const double h = 1e-6;
        for (int k = 0; k < 2 && good; k++) {
            double up[2] = {0.0}, down[2] = {0.0};
            bst_od_state near;
            good = middle_miss(o, way, exp(x[0] + (k == 0 ? h : 0.0)), exp(x[1] + (k ? h : 0.0)),
                               &near, up) &&
                   middle_miss(o, way, exp(x[0] - (k == 0 ? h : 0.0)), exp(x[1] - (k ? h : 0.0)),
                               &near, down);
            slope[0][k] = (up[0] - down[0]) / (2.0 * h);
            slope[1][k] = (up[1] - down[1]) / (2.0 * h);
        }
        double det = slope[0][0] * slope[1][1] - slope[0][1] * slope[1][0];
        double step[2] = {(slope[0][1] * f[1] - slope[1][1] * f[0]) / det,
                          (slope[1][0] * f[0] - slope[0][0] * f[1]) / det};
        double longest = fmax(fabs(step[0]), fabs(step[1]));
        if (!good || !isfinite(longest)) {
            break;
        }
        /* unknowns are logarithms of ranges: a step changes a range by 35 % at most */
        double scale = fmin(1.0, 0.3 / longest), before = hypot(f[0], f[1]);
        bool better = false;
        for (int half = 0; half < 8 && !better; half++, scale *= 0.5) {
            double g[2];
            double y0 = x[0] + scale * step[0], y1 = x[1] + scale * step[1];
            better = middle_miss(o, way, exp(y0), exp(y1), &orbit, g) && hypot(g[0], g[1]) < before;
            if (better) {
                x[0] = y0;
                x[1] = y1;
                f[0] = g[0];
                f[1] = g[1];
            }
        }
        /* limit: rounding of directions, about 1e-16, over slopes down to 1e-4 */
        if (longest < 1e-11 || (!better && before < 1e-12)) {
            good = middle_miss(o, way, exp(x[0]), exp(x[1]), &orbit, f);
            out->time_s = o[1].observer.time_s;
            return good ? bst_kepler_propagate(ctx, MU, orbit.position_m, orbit.velocity_mps,
                                               out->time_s - orbit.time_s, &out->position_m,
                                               &out->velocity_mps)
                        : BST_ERR_NUMERIC;
        }
        if (!better) {
            break;
        }
    }
    return bst_fail(ctx, BST_ERR_NUMERIC,
                    "no two-body orbit through the three directions was found from these ranges");
}

/* ------------------------------------------------------------------ Candidates */

typedef struct search {
    const bst_od_observation *items;
    int count;
    int sample[SAMPLES]; /* indices of the sampled observations */
    int samples;
    bst_od_candidate *best;
    int found;
} search;

/* RMS residual of an orbit over the sampled observations, rad; stops above `give_up`. */
static double rms_of(const search *s, const bst_od_state *orbit, double give_up) {
    double sum = 0.0, most = 2.0 * s->samples * give_up * give_up;
    for (int i = 0; i < s->samples; i++) {
        const bst_od_observation *o = &s->items[s->sample[i]];
        bst_od_sight sight;
        if (predict_direction(orbit, o, &sight) != BST_OK) {
            return INFINITY;
        }
        double off = bst_vec3_angle(o->direction, sight.direction);
        sum += off * off;
        if (sum > most) {
            return INFINITY;
        }
    }
    return sqrt(0.5 * sum / s->samples);
}

/* True if two candidate orbits are equivalent as a start. */
static bool is_equivalent(const search *s, const bst_od_state *a, const bst_od_state *b) {
    bst_od_state there = *b;
    const bst_od_observer *eye = &s->items[s->count / 2].observer;
    if (bst_kepler_propagate(NULL, MU, b->position_m, b->velocity_mps, a->time_s - b->time_s,
                             &there.position_m, &there.velocity_mps) != BST_OK) {
        return false;
    }
    double range = bst_vec3_norm(bst_vec3_sub(a->position_m, eye->position_m));
    double v = bst_vec3_norm(a->velocity_mps);
    return bst_vec3_norm(bst_vec3_sub(a->position_m, there.position_m)) < 0.1 * range &&
           bst_vec3_norm(bst_vec3_sub(a->velocity_mps, there.velocity_mps)) < 0.1 * v;
}

/* Keeps a candidate orbit if it is among the best and not equivalent to a better one. */
static void offer_candidate(search *s, const bst_od_state *orbit, bst_od_method method) {
    if (!is_bound(orbit)) {
        return;
    }
    double worst = s->found == BST_OD_CANDIDATES ? s->best[s->found - 1].rms_rad : 4.0;
    double rms = rms_of(s, orbit, worst);
    if (!(rms < worst)) {
        return;
    }
    int place = s->found;
    for (int i = 0; i < s->found; i++) {
        if (is_equivalent(s, orbit, &s->best[i].state)) {
            if (!(rms < s->best[i].rms_rad)) {
                return;
            }
            place = i;
            break;
        }
    }
    if (place == s->found) {
        s->found += s->found < BST_OD_CANDIDATES;
        place = s->found - 1;
    }
    while (place > 0 && s->best[place - 1].rms_rad > rms) {
        s->best[place] = s->best[place - 1];
        place--;
    }
    s->best[place] = (bst_od_candidate){.state = *orbit, .method = method, .rms_rad = rms};
}

/* Adds the roots of Gauss's method for three observations. */
static void try_gauss(search *s, int first, int middle, int last) {
    const bst_od_observation o[3] = {s->items[first], s->items[middle], s->items[last]};
    bst_gauss_sight sights[3];
    bst_gauss_orbit orbits[BST_GAUSS_ROOTS];
    int count;
    for (int i = 0; i < 3; i++) {
        double stretch;
        sights[i] = (bst_gauss_sight){.time_s = o[i].observer.time_s,
                                      .direction = geocentric_direction(&o[i], &stretch),
                                      .observer_m = o[i].observer.position_m};
    }
    if (bst_gauss_angles(NULL, MU, sights, orbits, &count) != BST_OK) {
        return;
    }
    for (int k = 0; k < count; k++) {
        const bst_gauss_orbit *g = &orbits[k];
        bst_od_state plain = {.time_s = sights[1].time_s,
                              .position_m = g->position_m[1],
                              .velocity_mps = g->velocity_mps};
        offer_candidate(s, &plain, BST_OD_GAUSS);
        bst_vec3 turn = bst_vec3_cross(g->position_m[0], g->position_m[2]);
        bst_vec3 h = bst_vec3_cross(g->position_m[1], g->velocity_mps);
        bst_od_state refined;
        if (bst_od_gooding(NULL, o, (bst_lambert_way){.long_way = bst_vec3_dot(turn, h) < 0.0},
                           g->range_m[0], g->range_m[2], &refined) == BST_OK) {
            offer_candidate(s, &refined, BST_OD_GAUSS);
        }
    }
}

/* Direction and rate (attributable) at an observation: a polynomial through observations within 17
 * degrees, in the tangent plane. Returns false if there are too few. */
static bool attributable(const search *s, int middle, bst_vec3 *q, bst_vec3 *w) {
    const bst_od_observation *m = &s->items[middle];
    double stretch, t0 = m->observer.time_s;
    bst_vec3 q0 = geocentric_direction(m, &stretch);
    int first = middle, last = middle;
    while (first > 0 && bst_vec3_dot(s->items[first - 1].direction, m->direction) > 0.955) {
        first--;
    }
    while (last + 1 < s->count &&
           bst_vec3_dot(s->items[last + 1].direction, m->direction) > 0.955) {
        last++;
    }
    double span = fmax(s->items[last].observer.time_s - t0, t0 - s->items[first].observer.time_s);
    int n = last - first + 1, terms = n >= 8 ? 4 : 3;
    if (n < 3 || !(span > 0.0)) {
        return false;
    }
    bst_tangent axes = bst_tangent_at(q0);
    double a[4][6] = {{0}};
    for (int i = first; i <= last; i++) {
        bst_vec3 d = geocentric_direction(&s->items[i], &stretch);
        double x = (s->items[i].observer.time_s - t0) / span, z = bst_vec3_dot(d, q0);
        const double power[4] = {1.0, x, x * x, x * x * x};
        for (int k = 0; k < terms; k++) {
            for (int l = 0; l < terms; l++) {
                a[k][l] += power[k] * power[l];
            }
            a[k][4] += power[k] * bst_vec3_dot(axes.e1, d) / z;
            a[k][5] += power[k] * bst_vec3_dot(axes.e2, d) / z;
        }
    }
    for (int k = 0; k < terms;
         k++) { /* Gauss-Jordan elimination; the matrix is positive definite */
        if (!(a[k][k] > 1e-9)) {
            return false;
        }
        for (int l = 0; l < terms; l++) {
            double f = a[l][k] / a[k][k];
            for (int c = 0; c < 6 && l != k; c++) {
                a[l][c] -= f * a[k][c];
            }
        }
    }
    double c[2][2];
    for (int k = 0; k < 2; k++) {
        c[k][0] = a[k][4] / a[k][k];
        c[k][1] = a[k][5] / a[k][k];
    }
    bst_vec3 line = bst_vec3_add(q0, bst_tangent_vector(&axes, c[0][0], c[0][1]));
    bst_vec3 rate = bst_tangent_vector(&axes, c[1][0] / span, c[1][1] / span);
    *q = bst_vec3_unit(line);
    *w = bst_vec3_scale(bst_tangent_project(*q, rate), 1.0 / bst_vec3_norm(line));
    return true;
}

/* Searches the admissible region of range and range rate at an observation. */
static void try_admissible(search *s, int middle) {
    bst_vec3 q, w;
    if (!attributable(s, middle, &q, &w)) {
        return;
    }
    const bst_od_observer *eye = &s->items[middle].observer;
    double stretch;
    (void)geocentric_direction(&s->items[middle], &stretch);
    double v_along = bst_vec3_dot(eye->velocity_mps, q);
    for (int i = 0; i < RANGES; i++) {
        double range = NEAREST_M * pow(FARTHEST_M / NEAREST_M, i / (RANGES - 1.0));
        bst_vec3 place = bst_vec3_axpy(eye->position_m, range, q);
        bst_vec3 across = bst_vec3_axpy(bst_vec3_axpy(eye->velocity_mps, -v_along, q), range, w);
        double room = 2.0 * MU / bst_vec3_norm(place) - bst_vec3_dot(across, across);
        for (int k = 0; k < RATES && room > 0.0; k++) {
            double along = sqrt(room) * (2.0 * (k + 0.5) / RATES - 1.0);
            bst_od_state orbit = {.time_s = eye->time_s - range / (stretch * BST_LIGHT_SPEED_MPS),
                                  .position_m = place,
                                  .velocity_mps = bst_vec3_axpy(across, along, q)};
            offer_candidate(s, &orbit, BST_OD_ADMISSIBLE);
        }
    }
}

/* Searches Lambert's problem over a grid of both end ranges. */
static void try_lambert(search *s, int first, int last, bst_lambert_way way) {
    const bst_od_observation *a = &s->items[first], *b = &s->items[last];
    for (int i = 0; i < ENDS; i++) {
        for (int k = 0; k < ENDS; k++) {
            const double steps = ENDS - 1.0, reach = FARTHEST_M / (10.0 * NEAREST_M);
            double t1, t3;
            bst_vec3 v3, r1 = position_at_range(a, 10.0 * NEAREST_M * pow(reach, i / steps), &t1);
            bst_vec3 r3 = position_at_range(b, 10.0 * NEAREST_M * pow(reach, k / steps), &t3);
            bst_od_state orbit = {.time_s = t1, .position_m = r1};
            if (t3 > t1 &&
                bst_lambert(NULL, MU, r1, r3, t3 - t1, way, &orbit.velocity_mps, &v3) == BST_OK) {
                offer_candidate(s, &orbit, BST_OD_LAMBERT);
            }
        }
    }
}

/* Indices of up to SAMPLES observations at different times, evenly spaced. */
static void choose_samples(search *s) {
    for (int i = 0; i < SAMPLES; i++) {
        int index = (int)((int64_t)i * (s->count - 1) / (SAMPLES - 1));
        if (s->samples == 0 ||
            s->items[index].observer.time_s > s->items[s->sample[s->samples - 1]].observer.time_s) {
            assert(s->samples < SAMPLES && index >= 0 && index < s->count);
            s->sample[s->samples++] = index;
        }
    }
}

bst_status bst_od_initial(bst_ctx *ctx, const bst_od_observation *observations, int count,
                          bst_od_candidate candidates[BST_OD_CANDIDATES], int *found) {
    assert(candidates && found && count >= 0 && (observations || count == 0));
    search s = {.items = observations, .count = count, .best = candidates};
    *found = 0;
    if (count < BST_OD_LEAST) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%d observations are too few: an orbit needs %d",
                        count, BST_OD_LEAST);
    }
    choose_samples(&s);
    if (s.samples < 3) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "the observations are of %d different times: an orbit needs 3", s.samples);
    }
    const int *k = s.sample, n = s.samples;
    double span = observations[count - 1].observer.time_s - observations[0].observer.time_s;
    try_gauss(&s, k[0], k[n / 2], k[n - 1]);
    if (n >= 5) {
        try_gauss(&s, k[0], k[n / 4], k[n / 2]);
        try_gauss(&s, k[n / 4], k[n / 2], k[3 * n / 4]);
        try_gauss(&s, k[n / 2], k[3 * n / 4], k[n - 1]);
    }
    try_admissible(&s, k[n / 2]);
    if (n >= 5) {
        try_admissible(&s, k[n / 4]);
        try_admissible(&s, k[3 * n / 4]);
    }
    /* 84 minutes is the shortest orbital period */
    int most = (int)fmin(span / 5040.0, 16.0);
    for (int turns = 0; turns <= most; turns++) {
        for (int kind = 0; kind < (turns ? 4 : 2); kind++) {
            try_lambert(
                &s, k[0], k[n - 1],
                (bst_lambert_way){
                    .long_way = kind % 2 == 1, .revolutions = turns, .high_energy = kind >= 2});
        }
    }
    *found = s.found;
    return s.found > 0 ? BST_OK
                       : bst_fail(ctx, BST_ERR_NUMERIC,
                                  "no bound orbit about the Earth comes near the %d observations; "
                                  "they are of several objects, or on a hyperbola",
                                  count);
}
