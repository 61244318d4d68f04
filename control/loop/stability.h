/* Margins of a sampled control loop from its open-loop frequency response. */
#ifndef BST_CONTROL_LOOP_STABILITY_H
#define BST_CONTROL_LOOP_STABILITY_H

#include "boresight/compensator.h"
#include "boresight/status.h"

/* Response at omega rad/s of a loop with later_s of delay more. */
typedef double complex (*bst_stability_delayed_response_fn)(const void *user, double omega_radps,
                                                            double later_s);

/* An open loop L, negative feedback: closed loop L / (1 + L), sensitivity 1 / (1 + L). */
typedef struct bst_loop {
    bst_dynamics_response_fn open; /* L(exp(j omega dt_s)) at omega rad/s, up to half the rate */
    const void *user;
    double dt_s;    /* sampling interval; for a continuous loop one far shorter than its dynamics */
    double delay_s; /* in L, so that the walk is fine enough for its phase; 0: short */
    int unstable_poles;    /* of L, strictly outside the unit circle; see `denominator` */
    const double *hint_hz; /* frequencies of resonances too narrow to be met by chance */
    int hints;
    /* Of a loop L = N / D whose unstable poles are not known beforehand: D, where N and D have no
     * poles outside the unit circle and tend to 0 and 1 at infinity. The zeros of D there are then
     * counted, and unstable_poles is not read. NULL: unstable_poles holds. */
    bst_dynamics_response_fn denominator;
    /* L when the plant answers later_s later; NULL: L exp(-j omega later_s). */
    bst_stability_delayed_response_fn open_later;
} bst_loop;

typedef struct bst_loop_margins {
    bool stable;
    int unstable_closed;       /* poles of the closed loop outside the unit circle (Nyquist) */
    double gain_margin_db;     /* factor on L up to instability; INFINITY: none. Of an unstable loop
                                  negative: what would have to be taken off */
    double gain_reduction_db;  /* how far L may be lowered; INFINITY: to nothing */
    double phase_margin_deg;   /* least, over all crossovers; INFINITY without one; negative when
                                  unstable */
    double delay_margin_s;     /* delay that L takes more; INFINITY without a crossover; 0 when
                                  unstable */
    double crossover_hz;       /* lowest frequency at which |L| falls through one; 0: none */
    double phase_crossover_hz; /* of gain_margin_db; 0: none */
    double sensitivity_peak, sensitivity_peak_hz; /* max |1 / (1 + L)| */
    double bandwidth_hz; /* where |L / (1 + L)| falls through -3 dB, followed from the crossover
                            upwards (below it where it is under -3 dB already there); half the rate
                            when it never does; 0 without a crossover */
} bst_loop_margins;

/* Works the margins out. Frequencies are followed from 1e-5 of half the rate to half the rate,
 * finer where the curve turns, and crossings bisected to rounding. Stability by the argument
 * principle on the unit circle: with n the turns of 1 + L about zero, poles of L at z = 1 passed by
 * on the outside, the closed loop has unstable_poles - n poles outside (Franklin, Powell, Workman,
 * Digital Control of Dynamic Systems, 3rd ed., section 7.4). The number of poles at z = 1 is the
 * slope of |L| at the lowest frequency. With a denominator D the closed loop's poles are counted a
 * second time, as zeros of N + D, and both counts have to agree. The delay margin is that of
 * open_later where it is given, by bisection of the delay. BST_ERR_NUMERIC: L is not finite
 * somewhere; the counts differ, or are negative: L has more poles outside than was said. */
bst_status bst_loop_analyse(bst_ctx *ctx, const bst_loop *loop,
                            bst_loop_margins *out) BST_MUST_CHECK;

/* Zeros outside the unit circle of a function without poles there that tends to 1 at infinity,
 * given on the circle at omega rad/s, with a delay of up to delay_s in it; zeros at z = 1 do not
 * count. By the argument principle, so never negative. BST_ERR_NUMERIC: the function is not finite,
 * is zero on the circle, or has poles outside. */
bst_status bst_loop_zeros_outside(bst_ctx *ctx, bst_dynamics_response_fn of, const void *user,
                                  double dt_s, double delay_s, int *out) BST_MUST_CHECK;

/* ---- what stability.c and winding.c share ---- */

/* Turns about zero of a function on the unit circle, zeros and poles at z = 1 passed by on the
 * outside: zeros less poles inside. Errors as above. */
bst_status bst_loop_turns(bst_ctx *ctx, bst_dynamics_response_fn of, const void *user, double dt_s,
                          double delay_s, int *out) BST_MUST_CHECK;

/* Greatest change of the phase of a delay between two points of a walk, rad: what is more could be
 * taken for a turn the other way. */
#define BST_LOOP_PHASE_STEP 0.5

/* Least delay that makes a stable loop with open_later unstable, by bisection. estimate_s > 0:
 * where the search may begin to be coarser. INFINITY: none up to 50 sampling intervals;
 * an estimate beyond that is returned as it is. */
bst_status bst_loop_delay_margin(bst_ctx *ctx, const bst_loop *loop, int unstable_poles,
                                 double estimate_s, double *out) BST_MUST_CHECK;

/* Step response of the closed loop at count multiples of dt_s, from the frequency response by
 * inverse transform over `length` samples (a power of two is not needed), in which it must have
 * settled. L must be infinite at zero frequency (an integrator), or zero_hz_response be given: the
 * closed loop's response there, NAN for one. */
void bst_loop_step_response(const bst_loop *loop, int length, double zero_hz_response, double *out,
                            int count);

/* What is thin about a loop: NULL when gain margin >= 6 dB, phase margin >= 30 deg and sensitivity
 * peak <= 2; else "is unstable", "has thin margins". */
const char *bst_loop_verdict(const bst_loop_margins *margins);

#endif
