#include "tracker/orbit/custody.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "sim/astro/kepler.h"
#include "sim/astro/sgp4_fit.h"
#include "sim/core/cholesky.h"
#include "tracker/mtt/tangent.h"

enum { N = BST_CUSTODY_STATE, SETS = 2 * N + 1, MOST_ITERATIONS = 5 };
#define DAY_S 86400.0
/* Below this inclination SGP4's periodics are not smooth in its elements (Lyddane's, by Sun and
 * Moon: 0.02 degrees), and differences are those of osculating elements. */
#define LEAST_INCLINATION_RAD (0.2 * BST_DEG_RAD)

/* ------------------------------------------------------------------ Elements */

bst_status bst_custody_orbit_init(bst_ctx *ctx, const bst_elements *elements, double epoch_offset_s,
                                  double photocentre_m, bst_custody_orbit *out) {
    double n = elements->mean_motion_radpmin / 60.0;
    if (!(n > 0.0 && elements->eccentricity >= 0.0 && elements->eccentricity < 1.0)) {
        return bst_fail(ctx, BST_ERR_NUMERIC,
                        "object \"%s\" (catalogue number %d): mean motion %g rad/min and "
                        "eccentricity %g are no ellipse: allowed are mean motions above 0 and "
                        "eccentricities from 0 to below 1",
                        elements->name, elements->norad, elements->mean_motion_radpmin,
                        elements->eccentricity);
    }
    *out = (bst_custody_orbit){.elements = *elements,
                               .epoch_offset_s = epoch_offset_s,
                               .a_m = cbrt(BST_EARTH_MU_M3PS2 / (n * n)),
                               .photocentre_m = photocentre_m};
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

void bst_custody_add_process_noise(const bst_custody_config *config, double time_s,
                                   bst_custody_filter *filter) {
    if (!(time_s > filter->noise_until_s)) {
        return;
    }
    /* A change dD of the drift at time u displaces the object by (s - u) dD at time s, which is
     * the state's DRIFT + dD and ALONG - u dD. The sums over u of a random walk with variance
     * `rate` per day are integrals of 1, -u and u^2. */
    const double rate = config->noise_m_per_day * config->noise_m_per_day;
    const double from = filter->noise_until_s / DAY_S, to = time_s / DAY_S;
    const double cross = -rate * (to * to - from * from) / 2.0;
    double(*p)[N] = filter->p;
    p[BST_CUSTODY_DRIFT][BST_CUSTODY_DRIFT] += rate * (to - from);
    p[BST_CUSTODY_DRIFT][BST_CUSTODY_ALONG] += cross;
    p[BST_CUSTODY_ALONG][BST_CUSTODY_DRIFT] += cross;
    p[BST_CUSTODY_ALONG][BST_CUSTODY_ALONG] += rate * (to * to * to - from * from * from) / 3.0;
    filter->noise_until_s = time_s;
}

/* ------------------------------------------------------------------ Prediction */

/* Least step of central differences, m, large against the rounding of SGP4 (1e-6 m). Otherwise it
 * is the standard deviation of the component, so that a slope is the mean one over what is possible
 * (Norgaard, Poulsen and Ravn, "New developments in state estimation for nonlinear systems",
 * Automatica 36, 2000). */
#define LEAST_STEP_M 20.0

/* Motion at one time of the sets about a state: of x itself, then of x plus and minus a step in
 * each component; TEME, m and m/s. */
typedef struct bundle {
    bst_vec3 r[SETS], v[SETS];
    double step_m[N];
} bundle;

/* State x of a set of a bundle. */
static void deviation(const double x[N], const bundle *b, int set, double y[N]) {
    memcpy(y, x, N * sizeof *y);
    if (set > 0) {
        int k = (set - 1) / 2;
        y[k] += set % 2 ? b->step_m[k] : -b->step_m[k];
    }
}

/* Motion on the elements that differ from the catalogued ones by x. */
static bool sgp4_motion(const bst_custody_orbit *o, const double x[N], double time_s, bst_vec3 *r,
                        bst_vec3 *v) {
    bst_elements set;
    bst_sgp4 *sgp4;
    if (!elements_at(o, x, &set) ||
        bst_sgp4_create(NULL, &set, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &sgp4) != BST_OK) {
        return false;
    }
    bool good = bst_sgp4_motion(sgp4, (o->epoch_offset_s + time_s) / 60.0, r, v);
    bst_sgp4_free(sgp4);
    return good;
}

/* State of an ellipse with these elements about a point mass. */
static void ellipse_state(const bst_elements *set, bst_vec3 *r, bst_vec3 *v) {
    const double n = set->mean_motion_radpmin / 60.0, e = set->eccentricity;
    const double a = cbrt(BST_EARTH_MU_M3PS2 / (n * n));
    const double anomaly = bst_kepler_eccentric_anomaly(set->mean_anomaly_rad, e);
    const double c = cos(anomaly), s = sin(anomaly), root = sqrt(1.0 - e * e);
    const double rate = n * a / (1.0 - e * c);
    const double cw = cos(set->arg_perigee_rad), sw = sin(set->arg_perigee_rad);
    const double co = cos(set->raan_rad), so = sin(set->raan_rad);
    const double ci = cos(set->inclination_rad), si = sin(set->inclination_rad);
    const bst_vec3 p = {co * cw - so * sw * ci, so * cw + co * sw * ci, sw * si};
    const bst_vec3 q = {-co * sw - so * cw * ci, -so * sw + co * cw * ci, cw * si};
    *r = bst_vec3_axpy(bst_vec3_scale(p, a * (c - e)), a * root * s, q);
    *v = bst_vec3_axpy(bst_vec3_scale(p, -rate * s), rate * root * c, q);
}

/* Motion of an orbit near the equator: the catalogued one, whose osculating elements differ by x.
 * What perturbations do to the difference, a thousandth of it in a revolution, is left out. */
static bool near_equator_motion(const bst_custody_orbit *o, bst_vec3 cat_r, bst_vec3 cat_v,
                                const double x[N], double time_s, bst_vec3 *r, bst_vec3 *v) {
    const bst_astro_kepler_elements k =
        bst_astro_kepler_elements_of(BST_EARTH_MU_M3PS2, cat_r, cat_v);
    if (!(k.semi_major_axis_m > 0.0)) {
        return false;
    }
    const double a = k.semi_major_axis_m;
    const bst_custody_orbit osculating = {
        .elements = {.mean_motion_radpmin = 60.0 * sqrt(BST_EARTH_MU_M3PS2 / a) / a,
                     .eccentricity = k.eccentricity,
                     .inclination_rad = k.inclination_rad,
                     .raan_rad = k.raan_rad,
                     .arg_perigee_rad = k.arg_perigee_rad,
                     .mean_anomaly_rad = k.mean_anomaly_rad},
        .epoch_offset_s = -time_s, /* its elements are those of time_s */
        .a_m = o->a_m};
    bst_elements set;
    if (!elements_at(&osculating, x, &set)) {
        return false;
    }
    ellipse_state(&set, r, v);
    return true;
}

static bool make_bundle(const bst_custody_orbit *o, const double x[N], const double p[N][N],
                        double time_s, bundle *out) {
    bst_vec3 r = {0}, v = {0};
    const double none[N] = {0.0};
    const bool flat = o->elements.inclination_rad < LEAST_INCLINATION_RAD;
    for (int k = 0; k < N; k++) {
        out->step_m[k] = fmax(sqrt(p[k][k]), LEAST_STEP_M);
    }
    bool good = !flat || sgp4_motion(o, none, time_s, &r, &v);
    for (int i = 0; good && i < SETS; i++) {
        double y[N];
        deviation(x, out, i, y);
        good = flat ? near_equator_motion(o, r, v, y, time_s, &out->r[i], &out->v[i])
                    : sgp4_motion(o, y, time_s, &out->r[i], &out->v[i]);
    }
    return good;
}

/* Direction and rate of a set from the observer, relative to the observed direction in its tangent
 * axes. */
static void measurement(const bst_custody_observation *z, bst_vec3 r_teme, bst_vec3 v_teme,
                        double out[4]) {
    const bst_od_state state = {.time_s = z->observer.time_s,
                                .position_m = bst_mat3_mul_vec(&z->gcrf_from_teme, r_teme),
                                .velocity_mps = bst_mat3_mul_vec(&z->gcrf_from_teme, v_teme)};
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

/* Innovation and slope at a state; *seen_as: the observation with the variance of the object's
 * photocentre at the range of that state. */
static bool linearise(const bst_custody_orbit *o, const double x[N], const double p[N][N],
                      const bst_custody_observation *z, bst_custody_prediction *out,
                      bst_custody_observation *seen_as) {
    bundle b;
    if (!make_bundle(o, x, p, z->observer.time_s, &b)) {
        return false;
    }
    const bst_vec3 line =
        bst_vec3_sub(bst_mat3_mul_vec(&z->gcrf_from_teme, b.r[0]), z->observer.position_m);
    const double spread = o->photocentre_m / bst_vec3_norm(line);
    *seen_as = *z;
    seen_as->covariance[0][0] += spread * spread;
    seen_as->covariance[1][1] += spread * spread;
    const bst_tangent axes = bst_tangent_at(z->direction);
    double seen[4];
    measurement(z, b.r[0], b.v[0], seen);
    out->innovation[0] = -seen[0];
    out->innovation[1] = -seen[1];
    out->innovation[2] = bst_vec3_dot(axes.e1, z->rate_radps) - seen[2];
    out->innovation[3] = bst_vec3_dot(axes.e2, z->rate_radps) - seen[3];
    for (int k = 0; k < N; k++) {
        double plus[4], minus[4];
        measurement(z, b.r[1 + 2 * k], b.v[1 + 2 * k], plus);
        measurement(z, b.r[2 + 2 * k], b.v[2 + 2 * k], minus);
        for (int i = 0; i < 4; i++) {
            out->slope[i][k] = (plus[i] - minus[i]) / (2.0 * b.step_m[k]);
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
    bst_custody_observation z;
    gain g;
    double w[4];
    if (!linearise(orbit, filter->x, filter->p, observation, out, &z) ||
        !make_gain(filter->p, out, &z, &g)) {
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
    bst_custody_observation z;
    gain g;
    for (int iteration = 0; iteration < MOST_ITERATIONS; iteration++) {
        if (!linearise(orbit, x, filter->p, observation, &at, &z) ||
            !make_gain(filter->p, &at, &z, &g)) {
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
    update_covariance(&g, &at, &z, filter->p);
    return true;
}

bool bst_custody_predict_position(const bst_custody_orbit *orbit, const bst_custody_filter *filter,
                                  double time_s, bst_vec3 *position_teme_m, double *sigma_m) {
    bundle b;
    if (!make_bundle(orbit, filter->x, filter->p, time_s, &b)) {
        return false;
    }
    *position_teme_m = b.r[0];
    bst_vec3 slope[N];
    double sum = 0.0;
    for (int k = 0; k < N; k++) {
        slope[k] =
            bst_vec3_scale(bst_vec3_sub(b.r[1 + 2 * k], b.r[2 + 2 * k]), 1.0 / (2.0 * b.step_m[k]));
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
