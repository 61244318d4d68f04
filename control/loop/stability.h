/* Stability margins of a sampled control loop from its open-loop frequency response. */
#ifndef BST_CONTROL_LOOP_STABILITY_H
#define BST_CONTROL_LOOP_STABILITY_H

#include "boresight/compensator.h"
#include "boresight/status.h"

/* Open-loop response at omega rad/s with an additional delay of later_s. */
typedef double complex (*bst_stability_delayed_response_fn)(const void *user, double omega_radps,
                                                            double later_s);

/* An open loop L with negative feedback: closed loop L / (1 + L), sensitivity 1 / (1 + L). */
typedef struct bst_loop {
    /* L(exp(j omega dt_s)) at omega rad/s, up to half the sampling rate */
    bst_dynamics_response_fn open;
    const void *user;
    double dt_s;    /* sampling interval; for a continuous loop much shorter than its dynamics */
    double delay_s; /* delay contained in L, for the frequency step; 0: short */
    int unstable_poles;    /* number of poles of L outside the unit circle; see `denominator` */
    const double *hint_hz; /* resonance frequencies too narrow for the grid */
    int hints;
    /* Denominator D of a loop L = N / D with an unknown number of unstable poles; N and D have no
     * poles outside the unit circle and tend to 0 and 1 at infinity. The zeros of D outside are
     * then counted, and unstable_poles is ignored. NULL: unstable_poles is used. */
    bst_dynamics_response_fn denominator;
    /* L with an additional plant delay later_s; NULL: L exp(-j omega later_s). */
    bst_stability_delayed_response_fn open_later;
} bst_loop;

typedef struct bst_loop_margins {
    bool stable;
    int unstable_closed; /* number of closed-loop poles outside the unit circle (Nyquist) */
    /* factor on L up to instability; INFINITY: none. Negative for an unstable loop: required
     * reduction */
    double gain_margin_db;
    double gain_reduction_db; /* possible reduction of L; INFINITY: unlimited */
    /* smallest over all crossovers; INFINITY without one; negative if unstable */
    double phase_margin_deg;
    /* additional delay up to instability; INFINITY without a crossover; 0 if unstable */
    double delay_margin_s;
    double crossover_hz;       /* lowest frequency at which |L| falls below one; 0: none */
    double phase_crossover_hz; /* frequency of gain_margin_db; 0: none */
    double sensitivity_peak, sensitivity_peak_hz; /* max |1 / (1 + L)| */
    /* frequency at which |L / (1 + L)| falls below -3 dB, searched upwards from the crossover
     * (downwards if it is already below); half the sampling rate if it never does; 0 without a
     * crossover */
    double bandwidth_hz;
} bst_loop_margins;

/* Computes the stability margins of a loop.
 *
 * The Nyquist curve is followed from 1e-5 of half the sampling rate to half the rate, refined where
 * it turns; crossings are bisected to rounding. Stability follows from the argument principle on
 * the unit circle: if n is the winding number of 1 + L about zero, with poles of L at z = 1 passed
 * on the outside, the closed loop has unstable_poles - n poles outside. The number of poles at z =
 * 1 is the slope of |L| at the lowest frequency. With a denominator D the closed-loop poles are
 * also counted as zeros of N + D, and both counts must agree. The delay margin with open_later is
 * found by bisection of the delay.
 *
 * Errors:    BST_ERR_NUMERIC if L is not finite, or if the counts differ or are negative (L has
 *            more unstable poles than stated)
 * Reference: Franklin, Powell, Workman, Digital Control of Dynamic Systems, 3rd ed., section 7.4 */
bst_status bst_loop_analyse(bst_ctx *ctx, const bst_loop *loop,
                            bst_loop_margins *out) BST_MUST_CHECK;

/* Number of zeros outside the unit circle, by the argument principle, of a function without poles
 * there that tends to 1 at infinity. Zeros at z = 1 do not count.
 *
 * Given:     of       the function on the circle at omega rad/s
 *            delay_s  largest delay contained in it
 * Errors:    BST_ERR_NUMERIC if the function is not finite, is zero on the circle, or has poles
 *            outside */
bst_status bst_loop_zeros_outside(bst_ctx *ctx, bst_dynamics_response_fn of, const void *user,
                                  double dt_s, double delay_s, int *out) BST_MUST_CHECK;

/* ---- Shared by stability.c and winding.c ---- */

/* Winding number about zero of a function on the unit circle, zeros and poles at z = 1 passed on
 * the outside: zeros minus poles inside. Errors as above. */
bst_status bst_loop_turns(bst_ctx *ctx, bst_dynamics_response_fn of, const void *user, double dt_s,
                          double delay_s, int *out) BST_MUST_CHECK;

/* Largest phase change of a delay between two points, rad; a larger one could be mistaken for a
 * turn in the other direction. */
#define BST_LOOP_PHASE_STEP 0.5

/* Smallest delay that makes a stable loop with open_later unstable, by bisection.
 *
 * Given:     estimate_s  > 0: delay at which the search may become coarser
 * Returned:  INFINITY: none up to 50 sampling intervals; an estimate beyond that is returned
 *            unchanged */
bst_status bst_loop_delay_margin(bst_ctx *ctx, const bst_loop *loop, int unstable_poles,
                                 double estimate_s, double *out) BST_MUST_CHECK;

/* Step response of the closed loop at count multiples of dt_s, from the frequency response by
 * inverse transform over `length` samples (any number), within which it must settle. L must be
 * infinite at zero frequency (an integrator), or zero_hz_response is the closed-loop response
 * there; NAN: one. */
void bst_loop_step_response(const bst_loop *loop, int length, double zero_hz_response, double *out,
                            int count);

/* Weakness of a loop: NULL if gain margin >= 6 dB, phase margin >= 30 deg and sensitivity peak <=
 * 2; else "is unstable" or "has thin margins". */
const char *bst_loop_verdict(const bst_loop_margins *margins);

#endif
