#include "tracker/mtt/sky_filter.h"

#include <assert.h>
#include <string.h>

#include "sim/core/invariant.h"

/* Rotates the rows, direction and rate, to axes turned by (c, s). */
static void rotate_rows(double p[4][4], double c, double s) {
    for (int j = 0; j < 4; j++) {
        for (int b = 0; b < 4; b += 2) {
            double x = p[b][j], y = p[b + 1][j];
            p[b][j] = c * x + s * y;
            p[b + 1][j] = -s * x + c * y;
        }
    }
}

/* Rotates both 2 x 2 blocks of the covariance to axes turned by (c, s). */
static void rotate_blocks(double p[4][4], double c, double s) {
    rotate_rows(p, c, s);
    for (int i = 0; i < 4; i++) {
        for (int b = 0; b < 4; b += 2) {
            double x = p[i][b], y = p[i][b + 1];
            p[i][b] = c * x + s * y;
            p[i][b + 1] = -s * x + c * y;
        }
    }
}

static void symmetrise(double p[4][4]) {
    for (int i = 0; i < 4; i++) {
        for (int j = i + 1; j < 4; j++) {
            p[i][j] = p[j][i] = 0.5 * (p[i][j] + p[j][i]);
        }
    }
}

/* Congruence transform: out = a p a^T. */
static void congruence(const double a[4][4], double p[4][4]) {
    double t[4][4];
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            t[i][j] = a[i][0] * p[0][j] + a[i][1] * p[1][j] + a[i][2] * p[2][j] + a[i][3] * p[3][j];
        }
    }
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            p[i][j] = t[i][0] * a[j][0] + t[i][1] * a[j][1] + t[i][2] * a[j][2] + t[i][3] * a[j][3];
        }
    }
}

void bst_sky_add_noise(bst_sky_state *state, double dt_s, double noise_rad2ps3) {
    double(*p)[4] = state->covariance;
    double dt = fabs(dt_s);
    double q_pp = noise_rad2ps3 * dt * dt * dt / 3.0, q_pr = noise_rad2ps3 * dt * dt_s / 2.0,
           q_rr = noise_rad2ps3 * dt;
    for (int i = 0; i < 2; i++) {
        p[i][i] += q_pp;
        p[i][i + 2] += q_pr;
        p[i + 2][i] += q_pr;
        p[i + 2][i + 2] += q_rr;
    }
}

/* Motion along a great circle over a time. */
typedef struct motion {
    double f[4][4];                 /* transition in the axes along and across the motion */
    double c0, s0;                  /* from the tangent axes at the start to those */
    double c1, s1;                  /* from those to the tangent axes at the end */
    bst_vec3 direction, rate_radps; /* at the end */
} motion;

static motion motion_of(const bst_sky_state *state, double dt_s) {
    bst_vec3 d0 = state->direction, r0 = state->rate_radps;
    double speed = bst_vec3_norm(r0);
    double angle = speed * dt_s;
    double sinc = fabs(angle) > 1e-4 ? sin(angle) / angle : 1.0 - angle * angle / 6.0;
    motion m = {.f = {{1, 0, dt_s, 0},
                      {0, cos(angle), 0, dt_s * sinc},
                      {0, 0, 1, 0},
                      {0, -speed * sin(angle), 0, cos(angle)}},
                .c0 = 1.0,
                .c1 = 1.0,
                .direction = d0,
                .rate_radps = r0};
    if (speed > 0.0) {
        bst_tangent axes0 = bst_tangent_at(d0);
        bst_vec3 along = bst_vec3_scale(r0, 1.0 / speed);
        m.c0 = bst_vec3_dot(r0, axes0.e1) / speed;
        m.s0 = bst_vec3_dot(r0, axes0.e2) / speed;
        m.direction =
            bst_vec3_unit(bst_vec3_axpy(bst_vec3_scale(d0, cos(angle)), sin(angle), along));
        bst_vec3 along1 = bst_tangent_project(
            m.direction, bst_vec3_axpy(bst_vec3_scale(along, cos(angle)), -sin(angle), d0));
        along1 = bst_vec3_unit(along1);
        bst_tangent axes1 = bst_tangent_at(m.direction);
        m.rate_radps = bst_vec3_scale(along1, speed);
        m.c1 = bst_vec3_dot(along1, axes1.e1);
        m.s1 = -bst_vec3_dot(along1, axes1.e2);
    }
    return m;
}

void bst_sky_predict(bst_sky_state *state, double dt_s, double noise_rad2ps3) {
    assert(state && isfinite(dt_s) && noise_rad2ps3 >= 0.0);
    assert(bst_is_unit_vec3(state->direction, BST_UNIT_TOLERANCE));
    double(*p)[4] = state->covariance;
    motion m = motion_of(state, dt_s);
    rotate_blocks(p, m.c0, m.s0);
    congruence(m.f, p);
    bst_sky_add_noise(state, dt_s, noise_rad2ps3);
    rotate_blocks(p, m.c1, m.s1);
    state->direction = m.direction;
    state->rate_radps = m.rate_radps;
    symmetrise(p);
}

/* Moves the mean to direction d1; `rate` is given at the old direction and transported. */
static void transport_mean(bst_sky_state *state, bst_vec3 d1, bst_vec3 rate) {
    bst_vec3 d0 = state->direction;
    bst_tangent axes0 = bst_tangent_at(d0), axes1 = bst_tangent_at(d1);
    double c, s;
    bst_tangent_turn(d0, &axes0, d1, &axes1, &c, &s);
    rotate_blocks(state->covariance, c, s);
    state->direction = d1;
    state->rate_radps = bst_tangent_carry(d0, d1, rate);
}

void bst_sky_shift(bst_sky_state *state, bst_vec3 direction_rad, bst_vec3 rate_radps) {
    bst_vec3 d = state->direction;
    bst_vec3 step = bst_tangent_project(d, direction_rad);
    bst_vec3 rate = bst_vec3_add(state->rate_radps, bst_tangent_project(d, rate_radps));
    transport_mean(state, bst_tangent_exp(d, step), rate);
    symmetrise(state->covariance);
}

bool bst_sky_innovate(const bst_sky_state *state, const bst_sky_measurement *measurement,
                      const double extra[3], bst_sky_innovation *out) {
    assert(state && measurement && out &&
           bst_is_unit_vec3(measurement->direction, BST_UNIT_TOLERANCE));
    bst_vec3 d = state->direction;
    bst_tangent axes = bst_tangent_at(d), own = bst_tangent_at(measurement->direction);
    bst_vec3 step = bst_tangent_log(d, measurement->direction);
    out->nu[0] = bst_vec3_dot(step, axes.e1);
    out->nu[1] = bst_vec3_dot(step, axes.e2);
    const double cov[3] = {measurement->cov_11, measurement->cov_12, measurement->cov_22};
    bst_tangent_turn_covariance(measurement->direction, &own, d, &axes, cov, out->r);
    for (int i = 0; extra && i < 3; i++) {
        out->r[i] += extra[i];
    }
    const double(*p)[4] = state->covariance;
    out->s[0] = p[0][0] + out->r[0];
    out->s[1] = p[0][1] + out->r[1];
    out->s[2] = p[1][1] + out->r[2];
    double det = out->s[0] * out->s[2] - out->s[1] * out->s[1];
    if (!(det > 0.0) || !(out->s[0] > 0.0) || !isfinite(det)) {
        return false;
    }
    out->chi2 = (out->s[2] * out->nu[0] * out->nu[0] - 2 * out->s[1] * out->nu[0] * out->nu[1] +
                 out->s[0] * out->nu[1] * out->nu[1]) /
                det;
    out->log_det_s = log(det);
    return isfinite(out->chi2);
}

void bst_sky_update(bst_sky_state *state, const bst_sky_innovation *innovation) {
    double(*p)[4] = state->covariance;
    const double *s = innovation->s, *r = innovation->r;
    double det = s[0] * s[2] - s[1] * s[1];
    double k[4][2], delta[4], a[4][4] = {{0}};
    for (int i = 0; i < 4; i++) {
        k[i][0] = (p[i][0] * s[2] - p[i][1] * s[1]) / det;
        k[i][1] = (p[i][1] * s[0] - p[i][0] * s[1]) / det;
        delta[i] = k[i][0] * innovation->nu[0] + k[i][1] * innovation->nu[1];
        a[i][i] = 1.0;
        a[i][0] -= k[i][0];
        a[i][1] -= k[i][1];
    }
    congruence(a, p);
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            p[i][j] += k[i][0] * (r[0] * k[j][0] + r[1] * k[j][1]) +
                       k[i][1] * (r[1] * k[j][0] + r[2] * k[j][1]);
        }
    }
    bst_vec3 d = state->direction;
    bst_tangent axes = bst_tangent_at(d);
    bst_vec3 rate = bst_vec3_add(state->rate_radps, bst_tangent_vector(&axes, delta[2], delta[3]));
    transport_mean(state, bst_tangent_exp(d, bst_tangent_vector(&axes, delta[0], delta[1])), rate);
    symmetrise(p);
}

void bst_sky_from_pair(const bst_sky_measurement *first, const bst_sky_measurement *second,
                       double dt_s, double noise_rad2ps3, bst_sky_state *out) {
    assert(first && second && out && dt_s > 0.0 && noise_rad2ps3 >= 0.0);
    bst_vec3 back = bst_tangent_log(second->direction, first->direction);
    out->direction = second->direction;
    out->rate_radps = bst_vec3_scale(back, -1.0 / dt_s);
    bst_sky_state at_second = {.direction = second->direction};
    bst_sky_innovation turned;
    /* the first covariance in the second's axes; the return value concerns only S */
    (void)bst_sky_innovate(&at_second, first, NULL, &turned);
    double r2[3] = {second->cov_11, second->cov_12, second->cov_22};
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            double b = r2[i + j], a = turned.r[i + j];
            out->covariance[i][j] = b;
            out->covariance[i][j + 2] = out->covariance[i + 2][j] = b / dt_s;
            out->covariance[i + 2][j + 2] =
                (a + b) / (dt_s * dt_s) + (i == j ? noise_rad2ps3 * dt_s / 3.0 : 0.0);
        }
    }
}

void bst_sky_turn_covariance(const bst_sky_state *state, bst_vec3 direction, double out[4][4]) {
    bst_tangent from = bst_tangent_at(state->direction), to = bst_tangent_at(direction);
    double c, s;
    bst_tangent_turn(state->direction, &from, direction, &to, &c, &s);
    memcpy(out, state->covariance, sizeof state->covariance);
    rotate_blocks(out, c, s);
}

/* Cholesky factor of P in its lower triangle; false if P is not positive definite. */
static bool factorise(double p[4][4]) {
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j <= i; j++) {
            double v = p[i][j];
            for (int k = 0; k < j; k++) {
                v -= p[i][k] * p[j][k];
            }
            if (i == j) {
                if (!(v > 0.0)) {
                    return false;
                }
                p[i][i] = sqrt(v);
            } else {
                p[i][j] = v / p[j][j];
            }
        }
    }
    return true;
}

/* Quadratic form x^T P^-1 x by Cholesky; INFINITY if P is not positive definite. */
static double quadratic_inverse(double p[4][4], const double x[4]) {
    double y[4], sum = 0.0;
    if (!factorise(p)) {
        return INFINITY;
    }
    for (int i = 0; i < 4; i++) {
        double v = x[i];
        for (int k = 0; k < i; k++) {
            v -= p[i][k] * y[k];
        }
        y[i] = v / p[i][i];
        sum += y[i] * y[i];
    }
    return sum;
}

void bst_sky_difference(const bst_sky_state *a, const bst_sky_state *b, double out[4]) {
    bst_tangent axes = bst_tangent_at(a->direction);
    bst_vec3 step = bst_tangent_log(a->direction, b->direction);
    bst_vec3 rate =
        bst_vec3_sub(bst_tangent_carry(b->direction, a->direction, b->rate_radps), a->rate_radps);
    out[0] = bst_vec3_dot(step, axes.e1);
    out[1] = bst_vec3_dot(step, axes.e2);
    out[2] = bst_vec3_dot(rate, axes.e1);
    out[3] = bst_vec3_dot(rate, axes.e2);
}

double bst_sky_distance2(const bst_sky_state *a, const bst_sky_state *b) {
    assert(a && b);
    /* beyond 11 degrees the tangent planes differ too much for one covariance; tracks are
     * arcseconds apart */
    if (!(bst_vec3_dot(a->direction, b->direction) > 0.98)) {
        return INFINITY;
    }
    double p[4][4];
    bst_sky_turn_covariance(b, a->direction, p);
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            p[i][j] += a->covariance[i][j];
        }
    }
    double x[4];
    bst_sky_difference(a, b, x);
    return quadratic_inverse(p, x);
}

/* Gain of the smoother: filtered P F^T (predicted P)^-1, from differences in the tangent axes of
 * the predicted state to those of the filtered one. False if the predicted covariance is not
 * positive definite. */
static bool smoother_gain(const bst_sky_state *filtered, double dt_s,
                          const bst_sky_state *predicted, double gain[4][4]) {
    motion m = motion_of(filtered, dt_s);
    double moved[4][4], p[4][4], l[4][4]; /* moved: F P, rows at the end of the motion */
    memcpy(p, filtered->covariance, sizeof p);
    rotate_rows(p, m.c0, m.s0);
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            moved[i][j] = m.f[i][0] * p[0][j] + m.f[i][1] * p[1][j] + m.f[i][2] * p[2][j] +
                          m.f[i][3] * p[3][j];
        }
    }
    rotate_rows(moved, m.c1, m.s1);
    bst_tangent from = bst_tangent_at(m.direction), to = bst_tangent_at(predicted->direction);
    double c, s;
    bst_tangent_turn(m.direction, &from, predicted->direction, &to, &c, &s);
    rotate_rows(moved, c, s);
    memcpy(l, predicted->covariance, sizeof l);
    if (!factorise(l)) {
        return false;
    }
    for (int j = 0; j < 4; j++) {
        double y[4];
        for (int i = 0; i < 4; i++) {
            y[i] = moved[i][j];
            for (int k = 0; k < i; k++) {
                y[i] -= l[i][k] * y[k];
            }
            y[i] /= l[i][i];
        }
        for (int i = 3; i >= 0; i--) {
            for (int k = i + 1; k < 4; k++) {
                y[i] -= l[k][i] * y[k];
            }
            y[i] /= l[i][i];
            gain[j][i] = y[i];
        }
    }
    return true;
}

bool bst_sky_smooth(const bst_sky_state *filtered, double dt_s, const bst_sky_state *predicted,
                    const bst_sky_state *next, bst_sky_state *out) {
    assert(filtered && predicted && next && out && dt_s > 0.0);
    double gain[4][4], change[4][4], x[4], delta[4] = {0}, check[4][4];
    *out = *filtered;
    if (!smoother_gain(filtered, dt_s, predicted, gain)) {
        return false;
    }
    bst_sky_difference(predicted, next, x);
    bst_sky_turn_covariance(next, predicted->direction, change);
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            change[i][j] -= predicted->covariance[i][j];
            delta[i] += gain[i][j] * x[j];
        }
    }
    congruence(gain, change);
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            out->covariance[i][j] += change[i][j];
        }
    }
    symmetrise(out->covariance);
    memcpy(check, out->covariance, sizeof check);
    if (!factorise(check)) {
        *out = *filtered;
        return false;
    }
    bst_tangent axes = bst_tangent_at(filtered->direction);
    bst_sky_shift(out, bst_tangent_vector(&axes, delta[0], delta[1]),
                  bst_tangent_vector(&axes, delta[2], delta[3]));
    return true;
}
