#include "control/loop/stability.h"

#include <math.h>
#include <stdlib.h>

#include "boresight/vec.h"

static const double two_pi = 2.0 * BST_PI;

#define LOWEST_SHARE                                                            \
    1e-5 /* of half the rate: 1 - z^-1 of a double pole keeps five digits there \
          */
#define GRID_RATIO 1.01
/* largest change of arg(1 + L), rad, or relative change of |L|, between points */
#define TURN_MAX 0.2
#define DEEPEST 30 /* most bisections of a grid interval */
#define BISECTIONS 60

typedef struct point {
    double omega;
    double complex l;
} point;

/* State while the Nyquist curve is followed towards higher frequencies. */
typedef struct walk {
    const bst_loop *loop;
    bool finite;
    double turned;                                 /* arg(1 + L) accumulated */
    double up, down, up_hz, worst_up, worst_up_hz; /* gain factors; see finish */
    double phase_margin, delay_margin;             /* smallest so far */
    double crossover_hz;
    double peak, peak_hz;
} walk;

static double complex open_at(const bst_loop *loop, double omega) {
    return loop->open(loop->user, omega);
}

/* |L| - 1: zero at a gain crossover. */
static double over_one(double complex l) {
    return cabs(l) - 1.0;
}

static double complementary_over_3db(double complex l) {
    return cabs(l) - sqrt(0.5) * cabs(1.0 + l);
}

/* Frequency between low and high at which `of` changes sign. */
static double crossing(const bst_loop *loop, double low, double high,
                       double (*of)(double complex)) {
    bool low_sign = of(open_at(loop, low)) > 0.0;
    for (int i = 0; i < BISECTIONS; i++) {
        double mid = 0.5 * (low + high);
        if ((of(open_at(loop, mid)) > 0.0) == low_sign) {
            low = mid;
        } else {
            high = mid;
        }
    }
    return 0.5 * (low + high);
}

/* Records a crossing of the negative real axis. */
static void phase_crossing(walk *w, double omega) {
    double gain = 1.0 / cabs(open_at(w->loop, omega)), hz = omega / two_pi;
    if (gain > 1.0 && gain < w->up) {
        w->up = gain;
        w->up_hz = hz;
    }
    if (gain < 1.0) {
        w->down = fmax(w->down, gain);
        if (gain < w->worst_up) {
            w->worst_up = gain;
            w->worst_up_hz = hz;
        }
    }
}

/* Records a crossing of |L| = 1. */
static void gain_crossing(walk *w, double omega, bool falling) {
    double margin = bst_wrap_angle(carg(open_at(w->loop, omega)) + BST_PI);
    w->phase_margin = fmin(w->phase_margin, fabs(margin));
    double until = margin < 0.0 ? margin + two_pi : margin;
    w->delay_margin = fmin(w->delay_margin, until / omega);
    if (falling && w->crossover_hz == 0.0) {
        w->crossover_hz = omega / two_pi;
    }
}

static void between(walk *w, point a, point b) {
    w->turned += bst_wrap_angle(carg(1.0 + b.l) - carg(1.0 + a.l));
    if ((cimag(a.l) > 0.0) != (cimag(b.l) > 0.0) && creal(a.l) + creal(b.l) < 0.0) {
        phase_crossing(w, crossing(w->loop, a.omega, b.omega, cimag));
    }
    if ((over_one(a.l) > 0.0) != (over_one(b.l) > 0.0)) {
        gain_crossing(w, crossing(w->loop, a.omega, b.omega, over_one), over_one(a.l) > 0.0);
    }
    double s = 1.0 / cabs(1.0 + b.l);
    if (s > w->peak) {
        w->peak = s;
        w->peak_hz = b.omega / two_pi;
    }
}

static void follow(walk *w, point a, point b, int depth) {
    double turn = fabs(bst_wrap_angle(carg(1.0 + b.l) - carg(1.0 + a.l)));
    double bend = fabs(bst_wrap_angle(carg(b.l) - carg(a.l)));
    double change = fabs(log(cabs(b.l) / cabs(a.l)));
    if (depth < DEEPEST && (turn > TURN_MAX || bend > TURN_MAX || change > TURN_MAX) &&
        b.omega - a.omega > 1e-12 * b.omega) {
        point mid = {.omega = 0.5 * (a.omega + b.omega)};
        mid.l = open_at(w->loop, mid.omega);
        if (isfinite(creal(mid.l)) && isfinite(cimag(mid.l))) {
            follow(w, a, mid, depth + 1);
            follow(w, mid, b, depth + 1);
            return;
        }
    }
    between(w, a, b);
}

static int by_value(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Next frequency: of the grid, or a hint before it. */
static double next_omega(const bst_loop *loop, const double *stops, int stop_count, int *stop,
                         double omega, double end) {
    double next = fmin(omega * GRID_RATIO, end);
    if (loop->delay_s > 0.0) {
        next = fmin(next, omega + BST_LOOP_PHASE_STEP / loop->delay_s);
    }
    while (*stop < stop_count && stops[*stop] <= omega) {
        ++*stop;
    }
    return *stop < stop_count && stops[*stop] < next ? stops[*stop] : next;
}

/* Number of poles at z = 1, from the slope of |L| at the lowest frequency. */
static int poles_at_one(const point *low, const point *next) {
    double slope = log(cabs(low->l) / cabs(next->l)) / log(next->omega / low->omega);
    return slope > 0.5 ? (int)lround(slope) : 0;
}

static double refined_peak(const walk *w, double *hz) {
    double low = *hz / GRID_RATIO, high = fmin(*hz * GRID_RATIO, 0.5 / w->loop->dt_s);
    for (int i = 0; i < 80; i++) {
        double a = low + (high - low) / 3.0, b = high - (high - low) / 3.0;
        if (cabs(1.0 + open_at(w->loop, two_pi * a)) < cabs(1.0 + open_at(w->loop, two_pi * b))) {
            high = b;
        } else {
            low = a;
        }
    }
    double refined = 1.0 / cabs(1.0 + open_at(w->loop, two_pi * 0.5 * (low + high)));
    if (refined < w->peak) {
        return w->peak;
    }
    *hz = 0.5 * (low + high);
    return refined;
}

static double bandwidth(const bst_loop *loop, double crossover_hz) {
    if (crossover_hz == 0.0) {
        return 0.0;
    }
    double end = BST_PI / loop->dt_s, omega = two_pi * crossover_hz;
    bool up = complementary_over_3db(open_at(loop, omega)) > 0.0;
    double lowest = LOWEST_SHARE * end;
    for (;;) {
        double next = up ? fmin(omega * GRID_RATIO, end) : omega / GRID_RATIO;
        if ((complementary_over_3db(open_at(loop, next)) > 0.0) != up) {
            return crossing(loop, fmin(omega, next), fmax(omega, next), complementary_over_3db) /
                   two_pi;
        }
        if (up && next >= end) {
            return 0.5 / loop->dt_s;
        }
        if (!up && next < lowest) {
            return 0.0;
        }
        omega = next;
    }
}

static void finish(const walk *w, bst_loop_margins *out) {
    bool stable = out->stable;
    out->gain_reduction_db = w->down > 0.0 ? -20.0 * log10(w->down) : INFINITY;
    double up = stable ? w->up : w->worst_up;
    out->gain_margin_db = isfinite(up) ? 20.0 * log10(up) : INFINITY;
    out->phase_crossover_hz = isfinite(up) ? (stable ? w->up_hz : w->worst_up_hz) : 0.0;
    if (!stable && !isfinite(up)) {
        out->gain_margin_db = -INFINITY; /* unstable at any gain */
    }
    out->phase_margin_deg = stable ? w->phase_margin / BST_DEG_RAD : -w->phase_margin / BST_DEG_RAD;
    out->delay_margin_s = stable ? w->delay_margin : 0.0;
    out->crossover_hz = w->crossover_hz;
    out->sensitivity_peak_hz = w->peak_hz;
    out->sensitivity_peak = refined_peak(w, &out->sensitivity_peak_hz);
    out->bandwidth_hz = bandwidth(w->loop, w->crossover_hz);
}

static double complex numerator_and_denominator(const void *user, double omega) {
    const bst_loop *loop = user;
    return loop->denominator(loop->user, omega) * (1.0 + open_at(loop, omega));
}

/* Poles outside the unit circle of the open and the closed loop, from the winding number of 1 + L.
 */
static bst_status count_poles(bst_ctx *ctx, const bst_loop *loop, int turns, int *open_poles,
                              int *closed) {
    *open_poles = loop->unstable_poles;
    int counted = 0;
    if (loop->denominator) {
        BST_TRY(bst_loop_zeros_outside(ctx, loop->denominator, loop->user, loop->dt_s,
                                       loop->delay_s, open_poles));
        BST_TRY(bst_loop_zeros_outside(ctx, numerator_and_denominator, loop, loop->dt_s,
                                       loop->delay_s, &counted));
    }
    *closed = *open_poles - turns;
    if (*closed < 0 || (loop->denominator && *closed != counted)) {
        return bst_fail(ctx, BST_ERR_NUMERIC,
                        "the poles outside the unit circle cannot be counted: %d of the open loop "
                        "less %d turns about -1%s; a compensator or plant is unstable by itself",
                        *open_poles, turns,
                        loop->denominator ? ", and another number as zeros of 1 + L" : "");
    }
    return BST_OK;
}

bst_status bst_loop_analyse(bst_ctx *ctx, const bst_loop *loop, bst_loop_margins *out) {
    double end = BST_PI / loop->dt_s, omega = LOWEST_SHARE * end;
    enum { ROUND_HINT = 5 };
    static const double round_hint[ROUND_HINT] = {0.997, 0.9995, 1.0, 1.0005, 1.003};
    double *stops = malloc(sizeof *stops * (size_t)(loop->hints * ROUND_HINT + 1));
    if (!stops) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the margins of a loop");
    }
    int stop_count = 0, stop = 0;
    for (int i = 0; i < loop->hints; i++) {
        for (int k = 0; k < ROUND_HINT; k++) {
            stops[stop_count++] = two_pi * loop->hint_hz[i] * round_hint[k];
        }
    }
    qsort(stops, (size_t)stop_count, sizeof *stops, by_value);

    walk w = {.loop = loop,
              .up = INFINITY,
              .worst_up = INFINITY,
              .phase_margin = INFINITY,
              .delay_margin = INFINITY};
    point a = {omega, open_at(loop, omega)}, first = a;
    double closing = 0.0;
    bst_status status = BST_OK;
    for (bool start = true; status == BST_OK && a.omega < end; start = false) {
        point b = {.omega = next_omega(loop, stops, stop_count, &stop, a.omega, end)};
        b.l = open_at(loop, b.omega);
        if (!isfinite(creal(b.l)) || !isfinite(cimag(b.l)) || !isfinite(cabs(a.l))) {
            status = bst_fail(ctx, BST_ERR_NUMERIC,
                              "the open loop is not finite near %g Hz: a compensator or plant of "
                              "it has a pole there",
                              b.omega / two_pi);
        } else {
            if (start) {
                w.peak = 1.0 / cabs(1.0 + a.l);
                w.peak_hz = a.omega / two_pi;
                /* from -omega to omega past z = 1: minus half a turn per pole there */
                double there = -BST_PI * poles_at_one(&a, &b);
                closing = there + bst_wrap_angle(2.0 * carg(1.0 + first.l) - there);
            }
            follow(&w, a, b, 0);
        }
        a = b;
    }
    /* at the Nyquist frequency a sampled loop's curve meets its mirror image on the real axis */
    if (creal(a.l) < 0.0 && fabs(cimag(a.l)) < 1e-6 * fabs(creal(a.l))) {
        phase_crossing(&w, end);
    }
    free(stops);
    if (status != BST_OK) {
        return status;
    }
    *out = (bst_loop_margins){0};
    int open_poles;
    int turns = (int)lround((closing + 2.0 * w.turned) / two_pi);
    BST_TRY(count_poles(ctx, loop, turns, &open_poles, &out->unstable_closed));
    out->stable = out->unstable_closed == 0;
    finish(&w, out);
    if (loop->open_later && out->stable && isfinite(out->delay_margin_s)) {
        BST_TRY(bst_loop_delay_margin(ctx, loop, open_poles, w.delay_margin, &out->delay_margin_s));
    }
    return BST_OK;
}

void bst_loop_step_response(const bst_loop *loop, int length, double zero_hz_response, double *out,
                            int count) {
    /* impulse response by the inverse transform of the Hermitian spectrum, summed */
    double at_zero = isnan(zero_hz_response) ? 1.0 : zero_hz_response;
    for (int n = 0; n < count; n++) {
        out[n] = (n + 1) * at_zero / length;
    }
    for (int k = 1; 2 * k <= length; k++) {
        double theta = two_pi * k / length;
        double complex l = open_at(loop, theta / loop->dt_s);
        double complex t = l / (1.0 + l) * (2 * k == length ? 1.0 : 2.0) / length;
        /* sum over m <= n of exp(j theta m) */
        double complex turn = cexp(I * theta), power = turn, scale = t / (turn - 1.0);
        for (int n = 0; n < count; n++) {
            out[n] += creal(scale * (power - 1.0));
            power *= turn;
        }
    }
}

const char *bst_loop_verdict(const bst_loop_margins *m) {
    if (!m->stable) {
        return "is unstable";
    }
    bool thin = m->gain_margin_db < 6.0 || m->gain_reduction_db < 6.0 ||
                m->phase_margin_deg < 30.0 || m->sensitivity_peak > 2.0;
    return thin ? "has thin margins" : NULL;
}
