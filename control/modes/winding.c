/* Winding numbers and delay margin: zeros outside the unit circle by the argument principle. */
#include <math.h>

#include "boresight/vec.h"
#include "control/loop/stability.h"

static const double two_pi = 2.0 * BST_PI;

#define LOWEST_SHARE 1e-5 /* as in stability.c */
#define GRID_RATIO 1.05
#define TURN_MAX 0.2 /* rad, or relative change of magnitude, between two points */
#define DEEPEST 30   /* most bisections of a grid interval */

typedef struct curve {
    bst_dynamics_response_fn of;
    const void *user;
} curve;

/* Angle from a to b in (-pi, pi]. */
static double angle_between(double complex a, double complex b) {
    double angle = carg(b) - carg(a);
    return angle - two_pi * ceil(angle / two_pi - 0.5);
}

/* Phase turned along a curve between two frequencies, with bisection. */
static double phase_change(const curve *c, double low, double complex a, double high,
                           double complex b, int depth) {
    double turn = angle_between(a, b);
    bool bends = fabs(turn) > TURN_MAX || fabs(log(cabs(b) / cabs(a))) > TURN_MAX;
    if (depth == DEEPEST || !bends || high - low <= 1e-12 * high) {
        return turn;
    }
    double middle = 0.5 * (low + high);
    double complex m = c->of(c->user, middle);
    return phase_change(c, low, a, middle, m, depth + 1) +
           phase_change(c, middle, m, high, b, depth + 1);
}

bst_status bst_loop_turns(bst_ctx *ctx, bst_dynamics_response_fn of, const void *user, double dt_s,
                          double delay_s, int *out) {
    const curve c = {of, user};
    double end = BST_PI / dt_s, omega = LOWEST_SHARE * end;
    double complex a = of(user, omega), start = a;
    double sum = 0.0, at_one = 0.0;
    for (bool first = true; omega < end; first = false) {
        double next = fmin(omega * GRID_RATIO, end);
        next = delay_s > 0.0 ? fmin(next, omega + BST_LOOP_PHASE_STEP / delay_s) : next;
        double complex b = of(user, next);
        if (!isfinite(cabs(b)) || !(cabs(a) > 0.0)) {
            return bst_fail(ctx, BST_ERR_NUMERIC,
                            "the loop's response is not finite, or zero, near %g Hz",
                            next / two_pi);
        }
        if (first) { /* zeros (or, negative, poles) at z = 1, passed on the outside */
            at_one = BST_PI * round(log(cabs(b) / cabs(a)) / log(next / omega));
        }
        sum += phase_change(&c, omega, a, next, b, 0);
        omega = next;
        a = b;
    }
    double conjugates = 2.0 * carg(start) - at_one;
    double closing = at_one + conjugates - two_pi * ceil(conjugates / two_pi - 0.5);
    *out = (int)lround((closing + 2.0 * sum) / two_pi);
    return BST_OK;
}

bst_status bst_loop_zeros_outside(bst_ctx *ctx, bst_dynamics_response_fn of, const void *user,
                                  double dt_s, double delay_s, int *out) {
    int turns = 0;
    BST_TRY(bst_loop_turns(ctx, of, user, dt_s, delay_s, &turns));
    *out = -turns;
    return turns <= 0 ? BST_OK
                      : bst_fail(ctx, BST_ERR_NUMERIC,
                                 "a response has %d poles outside the unit circle: a module of "
                                 "the loop is unstable by itself",
                                 turns);
}

/* 1 + L with an additional delay. */
typedef struct delayed_loop {
    const bst_loop *loop;
    double later_s;
} delayed_loop;

static double complex one_plus_delayed(const void *user, double omega) {
    const delayed_loop *d = user;
    return 1.0 + d->loop->open_later(d->loop->user, omega, d->later_s);
}

static bst_status is_unstable(bst_ctx *ctx, const bst_loop *loop, int unstable_poles,
                              double later_s, bool *out) {
    const delayed_loop d = {loop, later_s};
    int turns = 0;
    BST_TRY(bst_loop_turns(ctx, one_plus_delayed, &d, loop->dt_s, loop->delay_s + later_s, &turns));
    *out = unstable_poles - turns != 0;
    return BST_OK;
}

/* Delay steps: an eighth of the first estimate, then this share of the sampling interval, finer
 * than the delay intervals in which a loop is unstable; and bisections of the last step. */
#define STEP_SHARE 0.15
enum { STEPS_TO_ESTIMATE = 8, STEPS_MAX = 400, HALVINGS = 14 };

bst_status bst_loop_delay_margin(bst_ctx *ctx, const bst_loop *loop, int unstable_poles,
                                 double estimate_s, double *out) {
    double low = 0.0, high = INFINITY;
    double fine = fmin(estimate_s / STEPS_TO_ESTIMATE, STEP_SHARE * loop->dt_s);
    *out = INFINITY;
    for (int i = 0; i < STEPS_MAX && isinf(high); i++) {
        double next = low + (low < estimate_s ? fine : STEP_SHARE * loop->dt_s);
        bool unstable;
        BST_TRY(is_unstable(ctx, loop, unstable_poles, next, &unstable));
        if (unstable) {
            high = next;
        } else {
            low = next;
        }
    }
    if (isinf(high)) { /* so long a delay that the phase estimate suffices */
        *out = estimate_s > low ? estimate_s : INFINITY;
    }
    for (int i = 0; i < HALVINGS && isfinite(high); i++) {
        double middle = 0.5 * (low + high);
        bool unstable;
        BST_TRY(is_unstable(ctx, loop, unstable_poles, middle, &unstable));
        if (unstable) {
            high = middle;
        } else {
            low = middle;
        }
        *out = 0.5 * (low + high);
    }
    return BST_OK;
}
