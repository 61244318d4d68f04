#include "tracker/orbit/custody.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "sim/astro/sgp4_fit.h"
#include "sim/core/cholesky.h"
#include "tracker/mtt/tangent.h"

enum { N = BST_CUSTODY_STATE, SETS = 2 * N + 1, MOST_ITERATIONS = 5 };
#define DAY_S 86400.0
/* Step of central differences, m: large against the rounding of SGP4 (1e-6 m), small against the
 * range of an object. */
#define STEP_M 20.0
/* Times about that of an observation at which positions give its velocity, s. */
#define APART_S 8.0
enum { PLACES = 5 };

/* ------------------------------------------------------------------ Elements */

bst_status bst_custody_orbit_init(bst_ctx *ctx, const bst_elements *elements, double epoch_offset_s,
                                  bst_custody_orbit *out) {
    double n = elements->mean_motion_radpmin / 60.0;
    if (!(n > 0.0 && elements->eccentricity < 1.0)) {
        return bst_fail(ctx, BST_ERR_NUMERIC,
                        "object %d: mean motion %g rad/min and eccentricity %g are no ellipse",
                        elements->norad, elements->mean_motion_radpmin, elements->eccentricity);
    }
    *out = (bst_custody_orbit){.elements = *elements,
                               .epoch_offset_s = epoch_offset_s,
                               .a_m = cbrt(BST_EARTH_MU_M3PS2 / (n * n))};
    return BST_OK;
}

/* The element set that differs from the catalogued one by x. False: no ellipse. */
static bool elements_at(const bst_custody_orbit *o, const double x[N], bst_elements *out) {
    const bst_elements *e = &o->elements;
    const double perigee = e->raan_rad + e->arg_perigee_rad, t = tan(0.5 * e->inclination_rad);
    const double plane_m = 2.0 * o->a_m / (1.0 + t * t);
    const double dn = x[BST_CUSTODY_DRIFT] / (o->a_m * DAY_S); /* rad/s */
    const double y[N] = {
        e->mean_motion_radpmin + 60.0 * dn,
        e->eccentricity * cos(perigee) + x[BST_CUSTODY_ECC_X] / (2.0 * o->a_m),
        e->eccentricity * sin(perigee) + x[BST_CUSTODY_ECC_Y] / (2.0 * o->a_m),
        t * cos(e->raan_rad) + x[BST_CUSTODY_PLANE_X] / plane_m,
        t * sin(e->raan_rad) + x[BST_CUSTODY_PLANE_Y] / plane_m,
        e->mean_anomaly_rad + perigee + x[BST_CUSTODY_ALONG] / o->a_m - dn * o->epoch_offset_s};
    *out = *e;
    return bst_sgp4_regular_elements(y, out);
}

void bst_custody_filter_init(const bst_custody_config *config, const bst_custody_orbit *orbit,
                             const double normals[N], bst_custody_filter *out) {
    assert(config && orbit && out && config->sigma_m > 0.0 && config->drift_m_per_day > 0.0);
    *out = (bst_custody_filter){.noise_until_s = 0.0};
    /* the error along the orbit has grown since the epoch of the elements by that of the drift */
    const double age = orbit->epoch_offset_s / DAY_S;
    const double s = config->sigma_m, drift = config->drift_m_per_day;
    for (int i = 0; i < N; i++) {
        out->p[i][i] = i == BST_CUSTODY_DRIFT ? drift * drift : s * s;
        out->x[i] = normals ? normals[i] * (i == BST_CUSTODY_DRIFT ? drift : s) : 0.0;
    }
    out->p[BST_CUSTODY_ALONG][BST_CUSTODY_ALONG] += drift * drift * age * age;
    out->p[BST_CUSTODY_ALONG][BST_CUSTODY_DRIFT] = out->p[BST_CUSTODY_DRIFT][BST_CUSTODY_ALONG] =
        drift * drift * age;
    out->x[BST_CUSTODY_ALONG] += out->x[BST_CUSTODY_DRIFT] * age;
}

void bst_custody_age(const bst_custody_config *config, double time_s, bst_custody_filter *filter) {
    double days = (time_s - filter->noise_until_s) / DAY_S;
    if (!(days > 0.0)) {
        return;
    }
    /* a change of the drift at time t changes the place at time 0 by minus t times it */
    double q = config->noise_m_per_day * config->noise_m_per_day * days, back = -time_s / DAY_S;
    double(*p)[N] = filter->p;
    p[BST_CUSTODY_DRIFT][BST_CUSTODY_DRIFT] += q;
    p[BST_CUSTODY_DRIFT][BST_CUSTODY_ALONG] += q * back;
    p[BST_CUSTODY_ALONG][BST_CUSTODY_DRIFT] += q * back;
    p[BST_CUSTODY_ALONG][BST_CUSTODY_ALONG] += q * back * back;
    filter->noise_until_s = time_s;
}

/* ------------------------------------------------------------------ Prediction */

/* Element sets about a state: x itself, then x plus and minus a step in each component. */
typedef struct bundle {
    bst_sgp4 *sgp4[SETS];
} bundle;

static void free_bundle(bundle *b) {
    for (int i = 0; i < SETS; i++) {
        bst_sgp4_free(b->sgp4[i]);
    }
}

static bool make_bundle(const bst_custody_orbit *o, const double x[N], bundle *out) {
    *out = (bundle){.sgp4 = {NULL}};
    for (int i = 0; i < SETS; i++) {
        bst_elements set;
        double y[N];
        memcpy(y, x, sizeof y);
        if (i > 0) {
            y[(i - 1) / 2] += i % 2 ? STEP_M : -STEP_M;
        }
        if (!elements_at(o, y, &set) ||
            bst_sgp4_create(NULL, &set, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &out->sgp4[i]) !=
                BST_OK) {
            free_bundle(out);
            return false;
        }
    }
    return true;
}

/* Positions of the sets at APART_S times -2 to 2 about a time. */
static bool propagate(const bst_custody_orbit *o, const bundle *b, double time_s,
                      bst_sgp4_state out[SETS][PLACES]) {
    const bst_sgp4 *sets[SETS * PLACES];
    double minutes[SETS * PLACES];
    for (int i = 0; i < SETS * PLACES; i++) {
        sets[i] = b->sgp4[i / PLACES];
        minutes[i] = (o->epoch_offset_s + time_s + APART_S * (i % PLACES - PLACES / 2)) / 60.0;
    }
    bst_sgp4_propagate_many(sets, minutes, SETS * PLACES, &out[0][0]);
    for (int i = 0; i < SETS * PLACES; i++) {
        if (out[i / PLACES][i % PLACES].error != BST_SGP4_OK) {
            return false;
        }
    }
    return true;
}

static bst_vec3 place_of(const bst_sgp4_state *s) {
    const double *r = s->position_teme_km;
    return (bst_vec3){1e3 * r[0], 1e3 * r[1], 1e3 * r[2]};
}

/* Direction and rate of a set from the observer, relative to the observed direction in its tangent
 * axes. The velocity is the derivative of the polynomial through five positions. */
static void see(const bst_custody_observation *z, const bst_sgp4_state states[PLACES],
                double out[4]) {
    bst_vec3 far = bst_vec3_sub(place_of(&states[4]), place_of(&states[0]));
    bst_vec3 near = bst_vec3_sub(place_of(&states[3]), place_of(&states[1]));
    bst_vec3 v =
        bst_vec3_scale(bst_vec3_axpy(bst_vec3_scale(near, 8.0), -1.0, far), 1.0 / (12.0 * APART_S));
    const bst_od_state state = {
        .time_s = z->observer.time_s,
        .position_m = bst_mat3_mul_vec(&z->gcrf_from_teme, place_of(&states[2])),
        .velocity_mps = bst_mat3_mul_vec(&z->gcrf_from_teme, v)};
    bst_od_sight sight;
    bst_od_see(&state, &z->observer, &sight);
    const bst_tangent axes = bst_tangent_at(z->direction);
    const bst_vec3 d = bst_tangent_log(z->direction, sight.direction);
    const bst_vec3 r = bst_tangent_carry(sight.direction, z->direction, sight.rate_radps);
    out[0] = bst_vec3_dot(axes.e1, d);
    out[1] = bst_vec3_dot(axes.e2, d);
    out[2] = bst_vec3_dot(axes.e1, r);
    out[3] = bst_vec3_dot(axes.e2, r);
}

/* Innovation and slope at a state. */
static bool linearise(const bst_custody_orbit *o, const double x[N],
                      const bst_custody_observation *z, bst_custody_prediction *out) {
    bundle b;
    bst_sgp4_state states[SETS][PLACES] = {0};
    if (!make_bundle(o, x, &b)) {
        return false;
    }
    bool good = propagate(o, &b, z->observer.time_s, states);
    free_bundle(&b);
    if (!good) {
        return false;
    }
    const bst_tangent axes = bst_tangent_at(z->direction);
    double seen[4];
    see(z, states[0], seen);
    out->innovation[0] = -seen[0];
    out->innovation[1] = -seen[1];
    out->innovation[2] = bst_vec3_dot(axes.e1, z->rate_radps) - seen[2];
    out->innovation[3] = bst_vec3_dot(axes.e2, z->rate_radps) - seen[3];
    for (int k = 0; k < N; k++) {
        double plus[4], minus[4];
        see(z, states[1 + 2 * k], plus);
        see(z, states[2 + 2 * k], minus);
        for (int i = 0; i < 4; i++) {
            out->slope[i][k] = (plus[i] - minus[i]) / (2.0 * STEP_M);
        }
    }
    return true;
}

/* P H', H P H' + R and its Cholesky factor, in units in which R's diagonal is 1. */
typedef struct gain {
    double ph[N][4];
    double s[4][4], l[4][4], unit[4];
} gain;

static bool make_gain(const double p[N][N], const bst_custody_prediction *at,
                      const bst_custody_observation *z, gain *g) {
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < 4; j++) {
            g->ph[i][j] = 0.0;
            for (int k = 0; k < N; k++) {
                g->ph[i][j] += p[i][k] * at->slope[j][k];
            }
        }
    }
    for (int i = 0; i < 4; i++) {
        g->unit[i] = sqrt(z->covariance[i][i]);
        if (!(g->unit[i] > 0.0)) {
            return false;
        }
        for (int j = 0; j < 4; j++) {
            g->s[i][j] = z->covariance[i][j];
            for (int k = 0; k < N; k++) {
                g->s[i][j] += at->slope[i][k] * g->ph[k][j];
            }
        }
    }
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            g->l[i][j] = 0.5 * (g->s[i][j] + g->s[j][i]) / (g->unit[i] * g->unit[j]);
        }
    }
    return bst_cholesky_factor(&g->l[0][0], 4, 4, 1e-14);
}

/* S^-1 y */
static void solve(const gain *g, const double y[4], double out[4]) {
    for (int i = 0; i < 4; i++) {
        out[i] = y[i] / g->unit[i];
    }
    bst_cholesky_solve(&g->l[0][0], 4, 4, out);
    for (int i = 0; i < 4; i++) {
        out[i] /= g->unit[i];
    }
}

bool bst_custody_predict(const bst_custody_orbit *orbit, const bst_custody_filter *filter,
                         const bst_custody_observation *observation, bst_custody_prediction *out) {
    assert(orbit && filter && observation && out);
    gain g;
    double w[4];
    if (!linearise(orbit, filter->x, observation, out) ||
        !make_gain(filter->p, out, observation, &g)) {
        return false;
    }
    solve(&g, out->innovation, w);
    out->chi2 = out->log_determinant = 0.0;
    for (int i = 0; i < 4; i++) {
        out->chi2 += w[i] * out->innovation[i];
        out->log_determinant += 2.0 * log(g.l[i][i] * g.unit[i]);
        memcpy(out->covariance[i], g.s[i], sizeof g.s[i]);
    }
    return isfinite(out->chi2);
}

/* ------------------------------------------------------------------ Update */

/* P = (1 - K H) P (1 - K H)' + K R K' with K = P H' S^-1. */
static void update_covariance(const gain *g, const bst_custody_prediction *at,
                              const bst_custody_observation *z, double p[N][N]) {
    double k[N][4], left[N][N], half[N][N], out[N][N];
    for (int i = 0; i < N; i++) {
        solve(g, g->ph[i], k[i]);
        for (int j = 0; j < N; j++) {
            left[i][j] = i == j ? 1.0 : 0.0;
            for (int a = 0; a < 4; a++) {
                left[i][j] -= k[i][a] * at->slope[a][j];
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
            for (int a = 0; a < 4; a++) {
                for (int b = 0; b < 4; b++) {
                    out[i][j] += k[i][a] * z->covariance[a][b] * k[j][b];
                }
            }
        }
    }
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            p[i][j] = 0.5 * (out[i][j] + out[j][i]);
        }
    }
}

bool bst_custody_update(const bst_custody_orbit *orbit, const bst_custody_observation *observation,
                        bst_custody_filter *filter) {
    assert(orbit && observation && filter);
    double x[N];
    memcpy(x, filter->x, sizeof x);
    bst_custody_prediction at;
    gain g;
    for (int iteration = 0; iteration < MOST_ITERATIONS; iteration++) {
        if (!linearise(orbit, x, observation, &at) || !make_gain(filter->p, &at, observation, &g)) {
            return false;
        }
        /* x = x0 + K (y(x) - H (x0 - x)) */
        double y[4], w[4], moved = 0.0;
        for (int i = 0; i < 4; i++) {
            y[i] = at.innovation[i];
            for (int k = 0; k < N; k++) {
                y[i] -= at.slope[i][k] * (filter->x[k] - x[k]);
            }
        }
        solve(&g, y, w);
        for (int k = 0; k < N; k++) {
            double next = filter->x[k];
            for (int i = 0; i < 4; i++) {
                next += g.ph[k][i] * w[i];
            }
            moved = fmax(moved, fabs(next - x[k]) / sqrt(filter->p[k][k]));
            x[k] = next;
        }
        if (moved < 1e-3) {
            break;
        }
    }
    memcpy(filter->x, x, sizeof x);
    update_covariance(&g, &at, observation, filter->p);
    return true;
}

bool bst_custody_place(const bst_custody_orbit *orbit, const bst_custody_filter *filter,
                       double time_s, bst_vec3 *position_teme_m, double *sigma_m) {
    bundle b;
    bst_sgp4_state states[SETS][PLACES] = {0};
    if (!make_bundle(orbit, filter->x, &b)) {
        return false;
    }
    bool good = propagate(orbit, &b, time_s, states);
    free_bundle(&b);
    if (!good) {
        return false;
    }
    *position_teme_m = place_of(&states[0][PLACES / 2]);
    bst_vec3 slope[N];
    double sum = 0.0;
    for (int k = 0; k < N; k++) {
        slope[k] = bst_vec3_scale(bst_vec3_sub(place_of(&states[1 + 2 * k][PLACES / 2]),
                                               place_of(&states[2 + 2 * k][PLACES / 2])),
                                  1.0 / (2.0 * STEP_M));
    }
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            sum += filter->p[i][j] * bst_vec3_dot(slope[i], slope[j]);
        }
    }
    *sigma_m = sqrt(fmax(sum, 0.0));
    return true;
}

double bst_custody_nees(const bst_custody_filter *filter) {
    double l[N][N], y[N], sum = 0.0;
    for (int i = 0; i < N; i++) {
        double unit = sqrt(filter->p[i][i]);
        y[i] = filter->x[i] / unit;
        for (int j = 0; j < N; j++) {
            l[i][j] = filter->p[i][j] / (unit * sqrt(filter->p[j][j]));
        }
    }
    double w[N];
    memcpy(w, y, sizeof w);
    if (!bst_cholesky_factor(&l[0][0], N, N, 1e-15)) {
        return NAN;
    }
    bst_cholesky_solve(&l[0][0], N, N, w);
    for (int i = 0; i < N; i++) {
        sum += w[i] * y[i];
    }
    return sum;
}
