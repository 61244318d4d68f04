#include "gimbal/mount/mount_joints.h"

#include <assert.h>
#include <string.h>

#include "sim/core/invariant.h"

#define PARTS 12 /* of a step, between events */

enum { N = BST_CHAIN_MOST };

/* A constant 2 or 3 helps the compiler to unroll. */
static inline int stages_of(const bst_mount_joints *j) {
    return j->chain.stages == 2 ? 2 : N;
}

/* Sine and cosine of angle + more, given those of angle. */
static inline void rotate_sincos(double s, double c, double more, double *s_out, double *c_out) {
    double d2 = more * more, ds, dc;
    if (d2 < 1e-4) { /* next terms: d^7 / 5040, d^6 / 720 < 2e-15 */
        ds = more * (1.0 - d2 / 6.0 * (1.0 - d2 / 20.0));
        dc = 1.0 - 0.5 * d2 * (1.0 - d2 / 12.0);
    } else {
        ds = sin(more);
        dc = cos(more);
    }
    *s_out = s * dc + c * ds;
    *c_out = c * dc - s * ds;
}

static void refresh(bst_mount_joints *j) {
    for (int k = 0; k < stages_of(j); k++) {
        j->sine[k] = sin(j->state.angle_rad[k]);
        j->cosine[k] = cos(j->state.angle_rad[k]);
    }
}

void bst_mount_joints_init(bst_mount_joints *j, const double angle_rad[N]) {
    memset(&j->state, 0, sizeof j->state);
    for (int k = 0; k < stages_of(j); k++) {
        j->state.angle_rad[k] = angle_rad[k];
        j->slide[k] = 0;
        j->at_stop[k] = false;
    }
    j->events = 0;
    refresh(j);
}

void bst_mount_joints_archive(bst_mount_joints *j, bst_archive *archive) {
    BST_ARCHIVE(archive, j->state);
    BST_ARCHIVE(archive, j->sine);
    BST_ARCHIVE(archive, j->cosine);
    for (int k = 0; k < N; k++) {
        bst_archive_bool(archive, &j->joint[k].stuck);
        j->slide[k] = (int8_t)bst_archive_integer(archive, j->slide[k], -1, 1);
        bst_archive_bool(archive, &j->at_stop[k]);
    }
    j->events = bst_archive_integer(archive, j->events, 0, INT64_MAX / 2);
}

/* Friction torque without its viscous part, opposing a rate. */
static inline double sliding_nm(const bst_mount_joint *joint, double rate) {
    double x = rate / joint->stribeck_radps;
    return joint->coulomb_nm + (joint->breakaway_nm - joint->coulomb_nm) / (1.0 + x * x);
}

/* Constant torques and base motion during a part of a step. */
typedef struct motion {
    const double *torque_nm;
    bst_vec3 rate, slope; /* of the base at the start of the part */
    bool held[N];
} motion;

/* Accelerations of joints and modes. */
typedef struct slopes {
    double accel[N], flex_accel[N];
} slopes;

/* Solves mass x = right for the joints that are not held by friction or stop; the others get zero.
 */
static inline void solve_free(int n, double mass[N][N], const bool held[N], double right[N],
                              double x[N]) {
    for (int k = 0; k < n; k++) {
        if (held[k]) {
            for (int i = 0; i < n; i++) {
                mass[k][i] = mass[i][k] = 0.0;
            }
            mass[k][k] = 1.0;
            right[k] = 0.0;
        }
    }
    /* positive definite: no pivoting needed */
    double l10 = mass[1][0] / mass[0][0];
    double d1 = mass[1][1] - l10 * mass[0][1];
    double y1 = right[1] - l10 * right[0];
    if (n == 2) {
        x[1] = y1 / d1;
        x[0] = (right[0] - mass[0][1] * x[1]) / mass[0][0];
        return;
    }
    double l20 = mass[2][0] / mass[0][0];
    double a12 = mass[1][2] - l10 * mass[0][2];
    double l21 = a12 / d1;
    double d2 = mass[2][2] - l20 * mass[0][2] - l21 * a12;
    x[2] = (right[2] - l20 * right[0] - l21 * y1) / d2;
    x[1] = (y1 - a12 * x[2]) / d1;
    x[0] = (right[0] - mass[0][1] * x[1] - mass[0][2] * x[2]) / mass[0][0];
}

/* Passive torques about the axes (cable, friction) except static friction. */
static inline double passive_nm(const bst_mount_joint *joint, double angle, double rate,
                                int slide) {
    double friction = slide ? -(double)slide * sliding_nm(joint, rate) : 0.0;
    return friction - joint->viscous_nms * rate -
           joint->spring_nm * (angle - joint->spring_zero_rad);
}

/* State of the chain during a part, with sines and cosines of its angles. */
typedef struct instant {
    const bst_mount_chain_state *state;
    const double *sine, *cosine; /* [N] */
    double after_s;
} instant;

static inline void evaluate(const bst_mount_joints *j, instant at, const motion *m,
                            bst_mount_chain_equations *eq, slopes *out) {
    const bst_mount_chain *chain = &j->chain;
    const bst_mount_chain_state *state = at.state;
    int n = stages_of(j);
    bst_mount_chain_base base = {bst_vec3_axpy(m->rate, at.after_s, m->slope), m->slope};
    bst_mount_chain_equations_at(chain, state, at.sine, at.cosine, &base, eq);
    double right[N], mass[N][N];
    for (int k = 0; k < n; k++) {
        right[k] = m->torque_nm[k] - eq->bias_nm[k] +
                   passive_nm(&j->joint[k], state->angle_rad[k], state->rate_radps[k], j->slide[k]);
        for (int i = 0; i < n; i++) {
            mass[k][i] = eq->mass[k][i];
        }
    }
    solve_free(n, mass, m->held, right, out->accel);
    for (int k = 0; k < n; k++) {
        out->flex_accel[k] = 0.0;
        if (chain->flex_inertia[k] > 0.0) {
            double accel = eq->base_accel_radps2[k];
            for (int i = 0; i <= k; i++) {
                accel += eq->share[k][i] * out->accel[i];
            }
            out->flex_accel[k] = -accel - (chain->flex_stiffness[k] * state->flex_rad[k] +
                                           chain->flex_damping[k] * state->flex_radps[k]) /
                                              chain->flex_inertia[k];
        }
    }
}

/* from + h * (rates of `at`, accelerations) */
static inline void displace(int n, const bst_mount_chain_state *from, double h,
                            const bst_mount_chain_state *at, const slopes *slope,
                            bst_mount_chain_state *out) {
    for (int k = 0; k < n; k++) {
        out->angle_rad[k] = from->angle_rad[k] + h * at->rate_radps[k];
        out->rate_radps[k] = from->rate_radps[k] + h * slope->accel[k];
        out->flex_rad[k] = from->flex_rad[k] + h * at->flex_radps[k];
        out->flex_radps[k] = from->flex_radps[k] + h * slope->flex_accel[k];
    }
}

static inline void turned(const bst_mount_joints *j, const bst_mount_chain_state *state,
                          double s[N], double c[N]) {
    for (int k = 0; k < stages_of(j); k++) {
        rotate_sincos(j->sine[k], j->cosine[k], state->angle_rad[k] - j->state.angle_rad[k], &s[k],
                      &c[k]);
    }
}

static void runge_kutta(const bst_mount_joints *j, const motion *m, double h,
                        bst_mount_chain_state *out, double accel[N]) {
    int n = stages_of(j);
    bst_mount_chain_equations eq;
    slopes a, b, c, d;
    bst_mount_chain_state at2, at3, at4;
    double sine[N], cosine[N];
    const bst_mount_chain_state *from = &j->state;
    evaluate(j, (instant){from, j->sine, j->cosine, 0.0}, m, &eq, &a);
    displace(n, from, 0.5 * h, from, &a, &at2);
    turned(j, &at2, sine, cosine);
    evaluate(j, (instant){&at2, sine, cosine, 0.5 * h}, m, &eq, &b);
    displace(n, from, 0.5 * h, &at2, &b, &at3);
    turned(j, &at3, sine, cosine);
    evaluate(j, (instant){&at3, sine, cosine, 0.5 * h}, m, &eq, &c);
    displace(n, from, h, &at3, &c, &at4);
    turned(j, &at4, sine, cosine);
    evaluate(j, (instant){&at4, sine, cosine, h}, m, &eq, &d);
    double w = h / 6.0;
    for (int k = 0; k < n; k++) {
        accel[k] = a.accel[k];
        out->angle_rad[k] = from->angle_rad[k] +
                            w * (from->rate_radps[k] +
                                 2.0 * (at2.rate_radps[k] + at3.rate_radps[k]) + at4.rate_radps[k]);
        out->rate_radps[k] =
            from->rate_radps[k] + w * (a.accel[k] + 2.0 * (b.accel[k] + c.accel[k]) + d.accel[k]);
        out->flex_rad[k] = from->flex_rad[k] +
                           w * (from->flex_radps[k] +
                                2.0 * (at2.flex_radps[k] + at3.flex_radps[k]) + at4.flex_radps[k]);
        out->flex_radps[k] =
            from->flex_radps[k] +
            w * (a.flex_accel[k] + 2.0 * (b.flex_accel[k] + c.flex_accel[k]) + d.flex_accel[k]);
    }
}

/* Leapfrog step (drift, kick, drift). Rate-dependent torques are evaluated at the mean of the rates
 * before and after the kick, predicted by a first kick. */
static void leapfrog(const bst_mount_joints *j, const motion *m, double h,
                     bst_mount_chain_state *out, double accel[N]) {
    int n = stages_of(j);
    static const slopes none = {{0.0}, {0.0}};
    bst_mount_chain_equations eq;
    slopes kick;
    double sine[N], cosine[N];
    bst_mount_chain_state half, middle;
    displace(n, &j->state, 0.5 * h, &j->state, &none, &half);
    turned(j, &half, sine, cosine);
    evaluate(j, (instant){&half, sine, cosine, 0.5 * h}, m, &eq, &kick);
    middle = half;
    for (int k = 0; k < n; k++) {
        middle.rate_radps[k] += 0.5 * h * kick.accel[k];
        middle.flex_radps[k] += 0.5 * h * kick.flex_accel[k];
    }
    evaluate(j, (instant){&middle, sine, cosine, 0.5 * h}, m, &eq, &kick);
    for (int k = 0; k < n; k++) {
        accel[k] = kick.accel[k];
        out->rate_radps[k] = half.rate_radps[k] + h * kick.accel[k];
        out->flex_radps[k] = half.flex_radps[k] + h * kick.flex_accel[k];
        out->angle_rad[k] = half.angle_rad[k] + 0.5 * h * out->rate_radps[k];
        out->flex_rad[k] = half.flex_rad[k] + 0.5 * h * out->flex_radps[k];
    }
}

/* Torque range that friction and stop can exert on a joint at rest. */
static void holding(const bst_mount_joints *j, int k, double *least, double *most) {
    const bst_mount_joint *joint = &j->joint[k];
    *most =
        joint->stuck || j->state.angle_rad[k] <= joint->min_rad ? INFINITY : joint->breakaway_nm;
    *least =
        joint->stuck || j->state.angle_rad[k] >= joint->max_rad ? -INFINITY : -joint->breakaway_nm;
}

/* Stick-slip decision for joints at rest: all are held first. The joint that exceeds its holding
 * torque most is released, until none does. */
static void resolve_stiction(bst_mount_joints *j, motion *m) {
    int n = stages_of(j);
    bool rest = false;
    for (int k = 0; k < n; k++) {
        m->held[k] = j->state.rate_radps[k] == 0.0 || j->joint[k].stuck;
        if (m->held[k]) {
            rest = true;
            j->slide[k] = 0;
        } else if (j->slide[k] == 0) {
            j->slide[k] = j->state.rate_radps[k] > 0.0 ? 1 : -1;
        }
        j->at_stop[k] = false;
    }
    while (rest) {
        bst_mount_chain_equations eq;
        slopes slope;
        evaluate(j, (instant){&j->state, j->sine, j->cosine, 0.0}, m, &eq, &slope);
        int worst = -1;
        double beyond = 0.0;
        for (int k = 0; k < n; k++) {
            if (!m->held[k]) {
                continue;
            }
            double hold = eq.bias_nm[k] - m->torque_nm[k] -
                          passive_nm(&j->joint[k], j->state.angle_rad[k], 0.0, 0);
            for (int i = 0; i < n; i++) {
                hold += eq.mass[k][i] * slope.accel[i];
            }
            double least, most;
            holding(j, k, &least, &most);
            double over = hold > most ? hold - most : hold < least ? hold - least : 0.0;
            j->at_stop[k] = fabs(hold) > j->joint[k].breakaway_nm && over == 0.0;
            if (fabs(over) > fabs(beyond)) {
                worst = k;
                beyond = over;
            }
        }
        if (worst < 0) {
            return;
        }
        /* it slides opposite to the holding torque that would be needed */
        m->held[worst] = false;
        j->at_stop[worst] = false;
        j->slide[worst] = beyond > 0.0 ? -1 : 1;
        j->events++;
        rest = m->held[0] || m->held[1] || (n > 2 && m->held[2]);
    }
}

/* Time within a part of length h at which a coordinate passes a limit, by a parabola. It starts at
 * x (at or below the limit) with rate v and ends at `end` beyond it, all relative to the limit,
 * outwards positive. */
static double time_of_passing(double x, double v, double end, double h) {
    double a = (end - x - v * h) / (h * h);
    if (x >= 0.0 && v >= 0.0) {
        return 0.0;
    }
    double root = sqrt(fmax(v * v - 4.0 * a * x, 0.0));
    /* outward passage: the root with positive rate 2 a t + v */
    double t = v > 0.0 ? -2.0 * x / (v + root) : a != 0.0 ? (root - v) / (2.0 * a) : h;
    return t >= 0.0 && t <= h ? t : h;
}

enum event_kind { EVENT_NONE, EVENT_REST, EVENT_STOP };

/* First event between the present state and `end`: its kind, time and joint. */
static enum event_kind first_event(const bst_mount_joints *j, const motion *m,
                                   const bst_mount_chain_state *end, double h, double *time,
                                   int *which) {
    enum event_kind kind = EVENT_NONE;
    *time = h;
    *which = 0;
    for (int k = 0; k < stages_of(j); k++) {
        const bst_mount_joint *joint = &j->joint[k];
        if (m->held[k]) {
            continue;
        }
        double v0 = j->state.rate_radps[k], v1 = end->rate_radps[k];
        if (joint->breakaway_nm > 0.0 && v1 * j->slide[k] < 0.0) {
            double t = v0 * j->slide[k] > 0.0 ? h * v0 / (v0 - v1) : 0.0;
            if (kind == EVENT_NONE || t < *time) {
                *time = t;
                *which = k;
                kind = EVENT_REST;
            }
        }
        double x0 = j->state.angle_rad[k], x1 = end->angle_rad[k];
        if (x1 > joint->max_rad || x1 < joint->min_rad) {
            double t = x1 > joint->max_rad
                           ? time_of_passing(x0 - joint->max_rad, v0, x1 - joint->max_rad, h)
                           : time_of_passing(joint->min_rad - x0, -v0, joint->min_rad - x1, h);
            if (kind == EVENT_NONE || t < *time) {
                *time = t;
                *which = k;
                kind = EVENT_STOP;
            }
        }
    }
    return kind;
}

/* Impact of joint k on its stop: an impulse about its axis reverses its rate; held joints stay. */
static void bounce(bst_mount_joints *j, const motion *m, int k) {
    const bst_mount_joint *joint = &j->joint[k];
    int n = stages_of(j);
    double v = j->state.rate_radps[k], back = -joint->restitution * v;
    double over = j->state.angle_rad[k] - joint->max_rad;
    bool top = fabs(over) < fabs(j->state.angle_rad[k] - joint->min_rad);
    j->state.angle_rad[k] = top ? joint->max_rad : joint->min_rad;
    refresh(j);
    if (top ? v <= 0.0 : v >= 0.0) {
        return;
    }
    bst_mount_chain_equations eq;
    bst_mount_chain_base still = {{0, 0, 0}, {0, 0, 0}};
    bst_mount_chain_equations_at(&j->chain, &j->state, j->sine, j->cosine, &still, &eq);
    /* unit impulse on k; masses on springs are not moved yet */
    double right[N] = {0.0}, jump[N];
    right[k] = 1.0;
    solve_free(n, eq.mass, m->held, right, jump);
    double impulse = (back - v) / jump[k];
    /* a mass on a spring keeps its inertial rate */
    for (int i = 0; i < n; i++) {
        double change = 0.0;
        for (int b = 0; b <= i; b++) {
            change += eq.share[i][b] * impulse * jump[b];
        }
        if (j->chain.flex_inertia[i] > 0.0) {
            j->state.flex_radps[i] -= change;
        }
    }
    for (int i = 0; i < n; i++) {
        if (!m->held[i]) {
            j->state.rate_radps[i] += impulse * jump[i];
            if (j->state.rate_radps[i] * j->slide[i] < 0.0) {
                j->slide[i] = (int8_t)-j->slide[i];
            }
        }
    }
    j->state.rate_radps[k] = back;
}

/* Integrates to time h. Returns the earliest time at which a sliding joint would come to rest at
 * its initial deceleration, at most h. */
static double advance(const bst_mount_joints *j, const motion *m, double h,
                      bst_mount_chain_state *end) {
    double accel[N], soonest = h;
    if (j->method == BST_JOINT_LEAPFROG) {
        leapfrog(j, m, h, end, accel);
    } else {
        runge_kutta(j, m, h, end, accel);
    }
    for (int k = 0; k < stages_of(j); k++) {
        double rate = j->state.rate_radps[k];
        if (!m->held[k] && j->joint[k].breakaway_nm > 0.0 && rate * accel[k] < 0.0 &&
            fabs(rate) < soonest * fabs(accel[k])) {
            soonest = fabs(rate / accel[k]);
        }
    }
    return soonest;
}

static bool nothing_moves(const bst_mount_joints *j, const motion *m) {
    for (int k = 0; k < stages_of(j); k++) {
        if (!m->held[k] || j->chain.flex_inertia[k] > 0.0) {
            return false;
        }
    }
    return true;
}

static void accept(bst_mount_joints *j, const bst_mount_chain_state *end) {
    double s[N], c[N];
    turned(j, end, s, c);
    int n = stages_of(j);
    for (int k = 0; k < n; k++) {
        j->sine[k] = s[k];
        j->cosine[k] = c[k];
    }
    j->state = *end;
}

void bst_mount_joints_step(bst_mount_joints *j, double dt_s, const double torque_nm[N],
                           bst_vec3 rate_before, bst_vec3 rate_after) {
    assert(j && bst_is_positive(dt_s) && torque_nm);
    assert(bst_is_finite_vec3(rate_before) && bst_is_finite_vec3(rate_after));
    motion m = {.torque_nm = torque_nm,
                .rate = rate_before,
                .slope = bst_vec3_scale(bst_vec3_sub(rate_after, rate_before), 1.0 / dt_s)};
    double left = dt_s;
    bst_mount_chain_state end = {{0.0}, {0.0}, {0.0}, {0.0}};
    resolve_stiction(j, &m);
    for (int part = 0; left > 0.0; part++) {
        if (nothing_moves(j, &m)) {
            break;
        }
        /* a joint that comes to rest early would be driven far backwards: first integrate slightly
         * beyond that time, so that the reversal is detected */
        double span = left, soonest = advance(j, &m, span, &end);
        if (soonest < 0.25 * span && part < PARTS) {
            span = 2.0 * soonest;
            (void)advance(j, &m, span, &end);
        }
        double time;
        int which;
        enum event_kind kind = first_event(j, &m, &end, span, &time, &which);
        if (kind == EVENT_NONE) {
            accept(j, &end);
            m.rate = bst_vec3_axpy(m.rate, span, m.slope);
            left -= span;
            continue;
        }
        if (part >= PARTS) {
            m.held[which] = true;
            j->state.rate_radps[which] = 0.0;
            j->slide[which] = 0;
            continue; /* at most once per joint */
        }
        if (time > 1e-12 * dt_s) {
            if (time < span) {
                (void)advance(j, &m, time, &end);
            }
            accept(j, &end);
            m.rate = bst_vec3_axpy(m.rate, time, m.slope);
            left -= time;
        }
        j->events++;
        if (kind == EVENT_REST) {
            j->state.rate_radps[which] = 0.0;
        } else {
            bounce(j, &m, which);
        }
        resolve_stiction(j, &m);
    }
    refresh(j);
}

double bst_mount_joints_energy(const bst_mount_joints *j, bst_vec3 base_rate_radps) {
    double energy = bst_mount_chain_energy(&j->chain, &j->state, base_rate_radps);
    for (int k = 0; k < stages_of(j); k++) {
        double bend = j->state.angle_rad[k] - j->joint[k].spring_zero_rad;
        energy += 0.5 * j->joint[k].spring_nm * bend * bend;
    }
    return energy;
}
