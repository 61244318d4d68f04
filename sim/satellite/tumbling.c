#include "sim/satellite/tumbling.h"

#include <stdbool.h>
#include <stdlib.h>

enum { STEPS = 4096 };

/* Attitude q_body_from_start and angular velocity in the body. */
typedef struct motion {
    bst_quat q;
    bst_vec3 w;
} motion;

struct bst_tumbling {
    double inertia[3];
    double period_s;   /* 0: the rates are constant */
    bst_vec3 momentum; /* unit, frame of the start */
    double turn_rad;   /* about the momentum in one period */
    motion table[STEPS + 1];
};

/* Change of the motion by Euler's equations. */
static motion slope(const double i[3], motion m) {
    bst_vec3 w = m.w;
    bst_quat q = bst_quat_mul((bst_quat){-0.5 * w.x, -0.5 * w.y, -0.5 * w.z, 0.0}, m.q);
    return (motion){q,
                    {(i[1] - i[2]) / i[0] * w.y * w.z, (i[2] - i[0]) / i[1] * w.z * w.x,
                     (i[0] - i[1]) / i[2] * w.x * w.y}};
}

static motion add(motion m, double h, motion d) {
    return (motion){{m.q.x + h * d.q.x, m.q.y + h * d.q.y, m.q.z + h * d.q.z, m.q.w + h * d.q.w},
                    bst_vec3_axpy(m.w, h, d.w)};
}

/* One step of the classical Runge-Kutta method. */
static motion step(const double i[3], motion m, double h) {
    motion a = slope(i, m), b = slope(i, add(m, 0.5 * h, a)), c = slope(i, add(m, 0.5 * h, b));
    motion d = slope(i, add(m, h, c));
    m = add(add(add(add(m, h / 6.0, a), h / 3.0, b), h / 3.0, c), h / 6.0, d);
    m.q = bst_quat_unit(m.q);
    return m;
}

/* Period of the body rates, s; 0 if they are constant, INFINITY on the separatrix. */
static double period_of(const double inertia[3], bst_vec3 rate) {
    double i[3] = {inertia[0], inertia[1], inertia[2]}, w[3] = {rate.x, rate.y, rate.z};
    for (int a = 0; a < 2; a++) { /* ascending moments */
        for (int b = 0; b < 2 - a; b++) {
            if (i[b] > i[b + 1]) {
                double t = i[b];
                i[b] = i[b + 1], i[b + 1] = t;
                t = w[b], w[b] = w[b + 1], w[b + 1] = t;
            }
        }
    }
    double energy2 = 0.0, momentum2 = 0.0; /* twice the energy */
    for (int a = 0; a < 3; a++) {
        energy2 += i[a] * w[a] * w[a];
        momentum2 += i[a] * i[a] * w[a] * w[a];
    }
    double low = momentum2 - energy2 * i[0], high = energy2 * i[2] - momentum2;
    if (!(momentum2 > 0.0) || low <= 1e-14 * momentum2 || high <= 1e-14 * momentum2) {
        return 0.0; /* spin about the axis of the smallest or largest moment */
    }
    bool about_largest = momentum2 > energy2 * i[1];
    double fast2 = about_largest ? (i[2] - i[1]) * low / (i[0] * i[1] * i[2])
                                 : (i[1] - i[0]) * high / (i[0] * i[1] * i[2]);
    double k2 = about_largest ? (i[1] - i[0]) * high / ((i[2] - i[1]) * low)
                              : (i[2] - i[1]) * low / ((i[1] - i[0]) * high);
    double a = 1.0, g = sqrt(fmax(1.0 - k2, 0.0));
    for (int n = 0; n < 40 && g > 0.0 && fabs(a - g) > 1e-16 * a; n++) {
        double mean = 0.5 * (a + g);
        g = sqrt(a * g);
        a = mean;
    }
    return fast2 > 0.0 && g > 0.0 ? 2.0 * BST_PI / a / sqrt(fast2) : (double)INFINITY;
}

void bst_tumbling_free(bst_tumbling *t) {
    free(t);
}

bst_status bst_tumbling_check(bst_ctx *ctx, const double inertia[3]) {
    for (int k = 0; k < 3; k++) {
        if (!(inertia[k] > 0.0 &&
              inertia[k] <= (inertia[(k + 1) % 3] + inertia[(k + 2) % 3]) * (1.0 + 1e-9))) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "inertia_kg_m2: found [%g, %g, %g] (allowed: above 0, each at most the "
                            "sum of the others)",
                            inertia[0], inertia[1], inertia[2]);
        }
    }
    return BST_OK;
}

void bst_tumbling_turn(const double inertia[3], double seconds, double step_rad, bst_quat *q,
                       bst_vec3 *rate) {
    const double most = fmax(fmax(inertia[0], inertia[1]), inertia[2]);
    const double least = fmin(fmin(inertia[0], inertia[1]), inertia[2]);
    /* energy bounds the rate about the axis of the smallest moment */
    double turned = fabs(seconds) * bst_vec3_norm(*rate) * sqrt(most / least);
    int steps = (int)fmin(ceil(turned / step_rad), 1e8);
    motion m = {*q, *rate};
    for (int k = 0; k < steps; k++) {
        m = step(inertia, m, seconds / steps);
    }
    *q = m.q;
    *rate = m.w;
}

bst_status bst_tumbling_create(bst_ctx *ctx, const double inertia[3], bst_vec3 rate,
                               bst_tumbling **out) {
    *out = NULL;
    BST_TRY(bst_tumbling_check(ctx, inertia));
    bst_tumbling *t = calloc(1, sizeof *t);
    if (!t) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a tumbling body");
    }
    double speed = bst_vec3_norm(rate);
    for (int k = 0; k < 3; k++) {
        t->inertia[k] = inertia[k];
    }
    bst_vec3 l = {inertia[0] * rate.x, inertia[1] * rate.y, inertia[2] * rate.z};
    t->momentum = bst_vec3_unit(l);
    t->table[0] = (motion){BST_QUAT_IDENTITY, rate};
    t->period_s = period_of(inertia, rate);
    if (!isfinite(t->period_s) || t->period_s * speed > 1000.0) {
        /* near the separatrix, or of nearly equal moments: the table would be too coarse */
        t->period_s = speed > 0.0 ? 1000.0 / speed : 0.0;
        t->turn_rad = NAN;
    }
    for (int n = 0; n < STEPS && t->period_s > 0.0; n++) {
        motion m = t->table[n];
        for (int k = 0; k < 8; k++) {
            m = step(inertia, m, t->period_s / (8 * STEPS));
        }
        t->table[n + 1] = m;
    }
    if (t->period_s > 0.0 && !isnan(t->turn_rad)) {
        /* a vector fixed in the body across the momentum, before and after */
        bst_vec3 before = bst_vec3_perpendicular(t->momentum);
        bst_vec3 after = bst_quat_rotate(bst_quat_conj(t->table[STEPS].q), before);
        t->turn_rad = atan2(bst_vec3_dot(t->momentum, bst_vec3_cross(before, after)),
                            bst_vec3_dot(before, after));
    }
    *out = t;
    return BST_OK;
}

bst_quat bst_tumbling_at(const bst_tumbling *t, double seconds, bst_vec3 *rate) {
    if (!(t->period_s > 0.0)) {
        if (rate) {
            *rate = t->table[0].w;
        }
        return bst_quat_from_rotvec(bst_vec3_scale(t->table[0].w, -seconds));
    }
    double turns = floor(seconds / t->period_s);
    if (isnan(t->turn_rad)) { /* no period: integrated from the nearest end of the table */
        turns = 0.0;
    }
    double at = (seconds - turns * t->period_s) / t->period_s * STEPS;
    int n = (int)fmin(fmax(at, 0.0), STEPS - 1.0);
    motion m = t->table[n];
    double left = (at - n) * t->period_s / STEPS, h = t->period_s / (8 * STEPS);
    int steps = (int)fmin(ceil(fabs(left) / h), 1e7);
    for (int k = 0; k < steps; k++) {
        m = step(t->inertia, m, left / steps);
    }
    if (rate) {
        *rate = m.w;
    }
    if (turns == 0.0) {
        return m.q;
    }
    double angle = bst_wrap_angle(fmod(turns * t->turn_rad, 2.0 * BST_PI));
    return bst_quat_mul(m.q, bst_quat_from_rotvec(bst_vec3_scale(t->momentum, -angle)));
}
