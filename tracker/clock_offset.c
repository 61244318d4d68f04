#include "tracker/clock_offset.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "sim/astro/bodies.h"

enum { N = BST_CLOCK_STATES, OBSERVER = 1, OBJECTS = 4 };

/* Largest chi-square of a measurement, 2 degrees of freedom: 99.99 %. */
static const double GATE_CHI2 = 18.4;
/* Largest error of an object's direction, rad, for which the tangent plane is exact enough. */
static const double MOST_ERROR_RAD = 0.05;
/* Time in which the navigated position gets a new error, s. */
static const double OBSERVER_TIME_S = 600.0;
/* Random walk of the clock: variance per time, s^2/s (0.3 ms in a day). */
static const double CLOCK_WALK_S = 1e-12;

double bst_clock_sigma_s(const bst_clock *c, const bst_clock_params *p) {
    return c->started ? sqrt(c->covariance[0][0]) : p->sigma_s;
}

static void start(bst_clock *c, const bst_clock_params *p, double seconds) {
    *c = (bst_clock){.started = true, .time_s = seconds};
    c->covariance[0][0] = p->sigma_s * p->sigma_s;
    for (int i = 0; i < 3; i++) {
        c->covariance[OBSERVER + i][OBSERVER + i] = p->observer_sigma_m * p->observer_sigma_m;
    }
    for (int k = 0; k < BST_CLOCK_OBJECTS; k++) {
        c->object[k] = -1;
    }
}

void bst_clock_predict(bst_clock *c, const bst_clock_params *p, double seconds) {
    if (!c->started) {
        start(c, p, seconds);
        return;
    }
    double dt = seconds - c->time_s;
    assert(dt >= 0.0);
    c->time_s = seconds;
    c->covariance[0][0] += CLOCK_WALK_S * dt;
    for (int i = 0; i < 3; i++) {
        c->covariance[OBSERVER + i][OBSERVER + i] +=
            p->observer_sigma_m * p->observer_sigma_m / OBSERVER_TIME_S * dt;
    }
    for (int k = 0; k < BST_CLOCK_OBJECTS; k++) {
        for (int i = 0; i < 3 && c->object[k] >= 0; i++) {
            int n = OBJECTS + 3 * k + i;
            c->covariance[n][n] += p->object_sigma_m * p->object_sigma_mps * dt;
        }
    }
}

/* First state of an object's error; a new object takes the room of that seen least recently. */
static int slot_of(bst_clock *c, const bst_clock_params *p, int32_t object) {
    int oldest = 0;
    for (int k = 0; k < BST_CLOCK_OBJECTS; k++) {
        if (c->object[k] == object) {
            return OBJECTS + 3 * k;
        }
        bool older = c->object[k] < 0 || c->seen_s[k] < c->seen_s[oldest];
        oldest = c->object[oldest] >= 0 && older ? k : oldest;
    }
    c->object[oldest] = object;
    c->seen_s[oldest] = -INFINITY; /* until a measurement is used */
    int first = OBJECTS + 3 * oldest;
    for (int n = first; n < first + 3; n++) {
        for (int i = 0; i < N; i++) {
            c->covariance[n][i] = c->covariance[i][n] = 0.0;
        }
        c->state[n] = 0.0;
        c->covariance[n][n] = p->object_sigma_m * p->object_sigma_m;
    }
    return first;
}

/* Radial, along-track and across-track axis of an orbit. False: it has none. */
static bool axes_of(bst_vec3 position, bst_vec3 velocity, bst_vec3 axes[3]) {
    bst_vec3 momentum = bst_vec3_cross(position, velocity);
    if (!(bst_vec3_norm(momentum) > 1e-9 * bst_vec3_norm(position) * bst_vec3_norm(velocity))) {
        return false;
    }
    axes[0] = bst_vec3_unit(position);
    axes[2] = bst_vec3_unit(momentum);
    axes[1] = bst_vec3_cross(axes[2], axes[0]);
    return true;
}

static bst_vec3 gravity(bst_vec3 position) {
    double r = bst_vec3_norm(position);
    return bst_vec3_scale(position, -BST_EARTH_MU_M3PS2 / (r * r * r));
}

/* Derivatives of a measured direction's component along a tangent vector. */
static void derivatives(const bst_clock_sight *s, bst_vec3 along, bst_vec3 rate,
                        const bst_vec3 object_axes[3], const bst_vec3 observer_axes[3], int first,
                        double h[N]) {
    memset(h, 0, N * sizeof *h);
    h[0] = -bst_vec3_dot(along, rate);
    for (int i = 0; i < 3; i++) {
        h[OBSERVER + i] = -bst_vec3_dot(along, observer_axes[i]) / s->range_m;
        h[first + i] = bst_vec3_dot(along, object_axes[i]) / s->range_m;
    }
}

/* P h, and h^T P h. */
static double spread(const bst_clock *c, const double h[N], double ph[N]) {
    double variance = 0.0;
    for (int i = 0; i < N; i++) {
        ph[i] = 0.0;
        for (int k = 0; k < N; k++) {
            ph[i] += c->covariance[i][k] * h[k];
        }
        variance += h[i] * ph[i];
    }
    return variance;
}

/* Updates by one component with an error of its own.
 *
 * Given:     ph  P times its derivatives
 *            s   variance of the innovation */
static void update(bst_clock *c, const double ph[N], double s, double innovation) {
    for (int i = 0; i < N; i++) {
        c->state[i] += ph[i] / s * innovation;
        for (int k = 0; k <= i; k++) {
            c->covariance[i][k] -= ph[i] * ph[k] / s;
            c->covariance[k][i] = c->covariance[i][k];
        }
        c->covariance[i][i] = fmax(c->covariance[i][i], 0.0);
    }
}

static double product(const double a[N], const double b[N]) {
    double sum = 0.0;
    for (int i = 0; i < N; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

bool bst_clock_measure(bst_clock *c, const bst_clock_params *p, const bst_clock_sight *s,
                       const bst_sky_measurement *m) {
    assert(c->started && s->object >= 0);
    bst_vec3 object_axes[3], observer_axes[3];
    bst_vec3 off = bst_tangent_log(s->direction, m->direction);
    if (!(p->object_sigma_m < MOST_ERROR_RAD * s->range_m) ||
        !(bst_vec3_dot(s->direction, m->direction) > 0.0) ||
        !(bst_vec3_norm(off) < 4.0 * MOST_ERROR_RAD) ||
        !axes_of(s->object_m, s->object_mps, object_axes) ||
        !axes_of(s->observer_m, s->observer_mps, observer_axes)) {
        return false;
    }
    bst_vec3 d = s->direction, v = bst_vec3_sub(s->object_mps, s->observer_mps);
    bst_vec3 a = bst_vec3_sub(gravity(s->object_m), gravity(s->observer_m));
    bst_vec3 rate = bst_vec3_scale(bst_tangent_project(d, v), 1.0 / s->range_m);
    bst_vec3 turn =
        bst_vec3_scale(bst_tangent_project(d, bst_vec3_axpy(a, -2.0 * bst_vec3_dot(d, v), rate)),
                       1.0 / s->range_m);
    /* second order of the offset: mean square of half the acceleration times its square */
    double left_s = c->state[0] - s->corrected_s;
    double open = left_s * left_s + c->covariance[0][0];
    bst_vec3 bend = bst_vec3_scale(turn, 0.5 * sqrt(3.0) * open);
    bst_tangent at = bst_tangent_at(d), from = bst_tangent_at(m->direction);
    double r[3];
    bst_tangent_turn_covariance(m->direction, &from, d, &at,
                                (const double[3]){m->cov_11, m->cov_12, m->cov_22}, r);
    double bend_1 = bst_vec3_dot(bend, at.e1), bend_2 = bst_vec3_dot(bend, at.e2);
    r[0] += bend_1 * bend_1;
    r[1] += bend_1 * bend_2;
    r[2] += bend_2 * bend_2;
    double det_r = r[0] * r[2] - r[1] * r[1];
    if (!(r[0] > 0.0) || !(det_r > 0.0)) {
        return false;
    }
    double h[2][N], ph[2][N], nu[2];
    int slot = slot_of(c, p, s->object);
    const bst_vec3 along[2] = {at.e1, at.e2};
    for (int i = 0; i < 2; i++) {
        derivatives(s, along[i], rate, object_axes, observer_axes, slot, h[i]);
        nu[i] = bst_vec3_dot(along[i], off) - product(h[i], c->state) + h[i][0] * s->corrected_s;
    }
    double s11 = spread(c, h[0], ph[0]) + r[0], s22 = spread(c, h[1], ph[1]) + r[2];
    double s12 = product(h[0], ph[1]) + r[1], det = s11 * s22 - s12 * s12;
    double chi2 = (s22 * nu[0] * nu[0] - 2.0 * s12 * nu[0] * nu[1] + s11 * nu[1] * nu[1]) / det;
    if (!(det > 0.0) || !(chi2 <= GATE_CHI2)) {
        return false;
    }
    /* the second component without what its error shares with the first one's */
    double share = r[1] / r[0];
    for (int i = 0; i < N; i++) {
        h[1][i] -= share * h[0][i];
    }
    double rest = bst_vec3_dot(at.e2, off) - share * bst_vec3_dot(at.e1, off);
    update(c, ph[0], s11, nu[0]);
    s22 = spread(c, h[1], ph[1]) + det_r / r[0];
    update(c, ph[1], s22, rest - product(h[1], c->state) + h[1][0] * s->corrected_s);
    c->seen_s[(slot - OBJECTS) / 3] = c->time_s;
    c->measurements++;
    return true;
}
