/* Compensators of control loops: cascades of biquads with feed-forward, limits and anti-windup,
 * from gains or from a specification. */
#ifndef BORESIGHT_COMPENSATOR_H
#define BORESIGHT_COMPENSATOR_H

#include <complex.h>
#include <stdbool.h>
#include <stdint.h>

#include "boresight/archive.h"
#include "boresight/stage.h"

#pragma GCC visibility push(default)

/* (b0 + b1 z^-1 + b2 z^-2) / (1 + a1 z^-1 + a2 z^-2) */
typedef struct bst_dynamics_biquad {
    double b0, b1, b2, a1, a2;
} bst_dynamics_biquad;

/* Discretises a second-order section by Tustin's rule with prewarping.
 *
 * Given:     num, den    coefficients of s^0, s^1, s^2; den not all zero
 *            dt_s        sample time, s
 *            prewarp_hz  frequency at which both responses agree, 0 to below 0.5 / dt_s; 0: no
 *                        prewarping
 * Returned:  the biquad of s = k (z - 1) / (z + 1), k = w / tan(w dt / 2) with w = 2 pi prewarp_hz,
 *            or k = 2 / dt without prewarping
 * Notes:     powers that both polynomials lack are left out, so that a first-order section gets no
 *            pole at z = -1.
 * Reference: Franklin, Powell and Workman, Digital Control of Dynamic Systems, 3rd ed., section 6.1
 */
bst_dynamics_biquad bst_dynamics_biquad_tustin(const double num[3], const double den[3],
                                               double dt_s, double prewarp_hz);

/* Frequency response of a biquad.
 *
 * Given:     omega_per_sample  angular frequency, rad per sample */
double complex bst_dynamics_biquad_response(const bst_dynamics_biquad *biquad,
                                            double omega_per_sample);

typedef enum bst_compensator_type {
    BST_COMPENSATOR_PI = 0,
    BST_COMPENSATOR_PID,
    BST_COMPENSATOR_LEAD_LAG,
    BST_COMPENSATOR_TYPE_COUNT
} bst_compensator_type;

/* (s^2 + 2 d z w s + w^2) / (s^2 + 2 z w s + w^2): w = 2 pi frequency_hz, 2 z w = 2 pi width_hz,
 * d = 10^(-depth_db / 20). Prewarped at its own frequency. */
typedef struct bst_dynamics_notch_config {
    double frequency_hz, width_hz, depth_db;
} bst_dynamics_notch_config;

/* A "compensator" block. With s in rad/s and w = 2 pi f for each frequency f:
 *   pi        kp + ki / s
 *   pid       kp + ki / s + kd s / (1 + s / w_d)
 *   lead_lag  gain (1 + s / w_z) / (1 + s / w_p) (s + w_lz) / (s + w_lp), each pair where its zero
 *             is given; lag_pole_hz 0 integrates
 * times the notches, times w^2 / (s^2 + sqrt(2) w s + w^2) for low_pass_hz. kp = proportional and
 * so on have the unit of the output per unit of the error. */
typedef struct bst_compensator_config {
    int32_t type; /* bst_compensator_type; a user's table may have additional names after these */
    double bandwidth_hz, crossover_hz, phase_margin_deg, integral_ratio;
    double proportional, integral_per_s, derivative_s, derivative_filter_hz;
    double gain, lead_zero_hz, lead_pole_hz, lag_zero_hz, lag_pole_hz;
    bst_config_list notches; /* bst_dynamics_notch_config */
    double low_pass_hz, prewarp_hz;
    double feed_forward;
    double output_limit, output_rate_limit_per_s, anti_windup_s;
    double gain_scale, delay_s;
    bst_stage_use plug; /* desc not NULL: a plug-in replaces it; the members above are defaults */
} bst_compensator_config;

#define BST_STAGE_COMPENSATOR "compensator"

enum { BST_COMPENSATOR_STATE_BYTES = 4096 };

/* Functions of a plug-in's compensator; each axis has a state. The plug-in implements its own
 * limits and delay: those of the block "compensator" do not apply to it. */
typedef struct bst_compensator_stage {
    size_t state_bytes; /* at most BST_COMPENSATOR_STATE_BYTES of plain data: copies are independent
                           compensators */
    /* Initialises the state of a compensator at rest with time step dt_s. */
    bst_status (*init)(bst_ctx *ctx, const void *config, double dt_s, void *state);
    /* Output for the error of this sample. */
    double (*step)(void *state, double error);
    /* Bumpless transfer (bst_compensator_set); NULL: the state stays as it is. */
    void (*set)(void *state, double error, double output);
    /* Response from error to output at omega rad per sample, for margins and predicted pointing;
     * NULL: it is not linear, and both are left out. */
    double complex (*response)(const void *state, double omega_per_sample);
    /* Saves the members of a state that steps change, or restores them into a state that init made
     * (boresight/archive.h); NULL: a simulation with this compensator cannot be saved. */
    bst_status (*archive)(void *state, bst_archive *archive);
} bst_compensator_stage;

/* True if stability margins can be computed: for gains, a specification, or a plug-in with a
 * response. */
static inline bool bst_compensator_is_linear(const bst_compensator_config *config) {
    const bst_compensator_stage *stage =
        config->plug.desc ? (const bst_compensator_stage *)config->plug.desc->functions : NULL;
    return !stage || stage->response;
}

extern const char *const bst_compensator_kinds[]; /* BST_STAGE_COMPENSATOR, then NULL */
extern const char *const bst_compensator_types[]; /* names of bst_compensator_type, then NULL */
extern const bst_config_desc bst_notch_config_table[];
extern const bst_config_desc bst_compensator_config_table[];

/* The entries of that table, for a user with more types (`types`: those of bst_compensator_types
 * first) or another default (`fallback`: JSON text). */
#define BST_COMPENSATOR_KEYS(types, fallback)                                                      \
    BST_ENUM(                                                                                      \
        bst_compensator_config, type, types, fallback,                                             \
        "What the error passes through: pi, pid or lead_lag, in cascade with the notches and "     \
        "the low-pass."),                                                                          \
        BST_REAL(bst_compensator_config, bandwidth_hz, "Hz", 0, 1e5, "0",                          \
                 "Specification: where the closed loop falls to -3 dB. The gains follow from it "  \
                 "and from phase_margin_deg; 0: they are given."),                                 \
        BST_REAL(bst_compensator_config, crossover_hz, "Hz", 0, 1e5, "0",                          \
                 "Specification, instead of bandwidth_hz: where the open loop has the gain one."), \
        BST_REAL(bst_compensator_config, phase_margin_deg, "deg", 1, 120, "50",                    \
                 "Specification: phase margin at the crossover."),                                 \
        BST_REAL(bst_compensator_config, integral_ratio, "", 0, 10, "0.1",                         \
                 "Specification, pid and lead_lag: corner of the integral action over the "        \
                 "crossover frequency; 0: none."),                                                 \
        BST_REAL(bst_compensator_config, proportional, "", 0, 1e12, "0",                           \
                 "Gain of pi and pid, output per error."),                                         \
        BST_REAL(bst_compensator_config, integral_per_s, "1/s", 0, 1e12, "0",                      \
                 "Integral gain of pi and pid, output per error and second."),                     \
        BST_REAL(bst_compensator_config, derivative_s, "s", 0, 1e12, "0",                          \
                 "Derivative gain of pid, output per error rate."),                                \
        BST_REAL(bst_compensator_config, derivative_filter_hz, "Hz", 0, 1e5, "0",                  \
                 "Corner of the derivative; 0: ten times the crossover of a specification, at "    \
                 "most a fifth of the rate."),                                                     \
        BST_REAL(bst_compensator_config, gain, "", 0, 1e12, "0",                                   \
                 "Gain of lead_lag between its lag and its lead, output per error."),              \
        BST_REAL(bst_compensator_config, lead_zero_hz, "Hz", 0, 1e5, "0",                          \
                 "Zero of the lead; 0: no lead."),                                                 \
        BST_REAL(bst_compensator_config, lead_pole_hz, "Hz", 0, 1e6, "0", "Pole of the lead."),    \
        BST_REAL(bst_compensator_config, lag_zero_hz, "Hz", 0, 1e5, "0",                           \
                 "Zero of the lag; 0: no lag."),                                                   \
        BST_REAL(bst_compensator_config, lag_pole_hz, "Hz", 0, 1e5, "0",                           \
                 "Pole of the lag; 0: an integrator."),                                            \
        BST_LIST(bst_compensator_config, notches, bst_dynamics_notch_config,                       \
                 bst_notch_config_table, 0, 8, "[]", "Notches in cascade."),                       \
        BST_REAL(bst_compensator_config, low_pass_hz, "Hz", 0, 1e5, "0",                           \
                 "Corner of a second-order Butterworth low-pass in cascade; 0: none."),            \
        BST_REAL(bst_compensator_config, prewarp_hz, "Hz", 0, 1e5, "0",                            \
                 "Frequency at which the discrete compensator is exactly the continuous one; 0: "  \
                 "the crossover of a specification, else none. Notches and low-pass have their "   \
                 "own."),                                                                          \
        BST_REAL(bst_compensator_config, feed_forward, "", 0, 10, "1",                             \
                 "Share of the feed-forward input that is added to the output."),                  \
        BST_REAL(bst_compensator_config, output_limit, "", 0, 1e12, "0",                           \
                 "Greatest output, both ways; 0: no limit of its own."),                           \
        BST_REAL(bst_compensator_config, output_rate_limit_per_s, "1/s", 0, 1e12, "0",             \
                 "Greatest rate of the output, both ways; 0: none."),                              \
        BST_REAL(bst_compensator_config, anti_windup_s, "s", 0, 1e6, "0",                          \
                 "Time in which the integrator follows a limited output (back-calculation); 0: "   \
                 "by the gains."),                                                                 \
        BST_REAL(bst_compensator_config, gain_scale, "", 0, 1e6, "1",                              \
                 "Factor on the output, after any design: for finding gain margins. Of control's " \
                 "observer: how many times the motion that telemetry reports of its correction "   \
                 "the frames show."),                                                              \
        BST_REAL(bst_compensator_config, delay_s, "s", 0, 1e3, "0",                                \
                 "Delay of the output, on top of any design: for finding delay margins. Between "  \
                 "samples it is interpolated. Of control's observer: how much later than "         \
                 "telemetry reports it the frames show the motion, to the tick."),                 \
        BST_STAGE(bst_compensator_config, plug, bst_compensator_kinds,                             \
                  "A shared library with a compensator of one's own, relative to the folder of "   \
                  "the file that says so; the other keys are then that one's.")

#define BST_COMPENSATOR_STAGES 12
#define BST_COMPENSATOR_DELAY 1024 /* samples */

/* One axis. Owns nothing; plain copies are independent compensators. */
typedef struct bst_compensator {
    double dt_s;
    int stages; /* at least 1; the last one holds the integrator and the gain */
    bst_dynamics_biquad stage[BST_COMPENSATOR_STAGES];
    double state[BST_COMPENSATOR_STAGES][2]; /* direct form II transposed */
    bool integrates;                         /* the last stage has a pole at 1 */
    double back; /* fraction of the excess over a limit that is fed back into the last stage */
    double feed_forward, limit, rate_limit; /* limits: INFINITY: none; rate_limit: per step */
    double output;                          /* latest output, limited, before the delay */
    bool limited;                           /* the latest output reached a limit */
    int delay_whole;                        /* delay in steps: integer and fractional part */
    double delay_part;
    int delay_next; /* next write position in `past` */
    double past[BST_COMPENSATOR_DELAY];
    const bst_compensator_stage *plug; /* not NULL: plug-in with its state; no stages */
    const char *plugin;                /* its path, lent by the configuration; NULL: none */
    bool plug_failed;                  /* it gave an output that is not finite */
    _Alignas(16) unsigned char plug_state[BST_COMPENSATOR_STATE_BYTES];
} bst_compensator;

/* Frequency response of the loop without its compensator, from the compensator's output to minus
 * the error, at omega rad/s. For a sampled loop: of the sampled signals, with holds and delays. */
typedef double complex (*bst_dynamics_response_fn)(const void *user, double omega_radps);

/* Computes the gains that meet a specification (bandwidth_hz or crossover_hz, and
 * phase_margin_deg).
 *
 * Given:     config       copied to *out unchanged if it has no specification
 *            dt_s         sample time, s
 *            plant, user  frequency response of the rest of the loop, and its first argument
 * Returned:  *out  the configuration with gains instead of the specification; shares the list of
 *                  notches with config
 * Errors:    BST_ERR_CONFIG if the specification cannot be met; the message gives the best that can
 *            be achieved
 * Notes:     gain_scale and delay_s do not enter the design and are copied. The crossover is the
 *            frequency at which |L| = 1, where L = compensator * plant; there arg L = -180 deg +
 *            phase margin.
 *            pi: chooses kp and ki. If a pure integrator already has more phase margin than asked
 *            for, it is used.
 *            pid: integral corner at integral_ratio times the crossover; chooses gain and
 *            derivative, and more integral action if there is phase to spare.
 *            lead_lag: as pid, with a lead centred on the crossover whose pole is at most 100 times
 *            its zero. */
bst_status bst_compensator_design(bst_ctx *ctx, const bst_compensator_config *config, double dt_s,
                                  bst_dynamics_response_fn plant, const void *user,
                                  bst_compensator_config *out) BST_MUST_CHECK;

/* Initialises a compensator at rest.
 *
 * Given:     config       gains, or a specification that bst_compensator_design meets first, or a
 *                         plug-in
 *            dt_s         sample time, s
 *            plant, user  rest of the loop, for a specification; plant NULL: only gains or a
 *                         plug-in are allowed
 * Errors:    BST_ERR_CONFIG for frequencies beyond half the sample rate, a delay of more than 1022
 *            samples, gains with coefficients that are not finite, gains beside a specification, a
 *            specification without a plant or one that cannot be met; errors of the plug-in's init
 */
bst_status bst_compensator_init(bst_ctx *ctx, bst_compensator *compensator,
                                const bst_compensator_config *config, double dt_s,
                                bst_dynamics_response_fn plant, const void *user) BST_MUST_CHECK;

/* Output for one sample.
 *
 * Given:     error         error at this sample
 *            feed_forward  input that is multiplied by the compensator's feed_forward and added
 * Returned:  output, limited in value and rate and delayed; its unit follows from the gains
 * Notes:     the part that the limits cut off is fed back into the last stage's state
 *            (anti-windup). In direct form II transposed, y + back * excess takes the place of y in
 *            the feedback. For pi this is back-calculation with the time constant dt / back. A
 *            plug-in's output has neither a rate limit nor a delay.
 * Reference: Astrom and Wittenmark, Computer-Controlled Systems, 3rd ed., section 9.4 */
double bst_compensator_step(bst_compensator *compensator, double error, double feed_forward);

/* Checks the outputs that a plug-in has given so far: BST_ERR_STATE if one was not finite. 0 took
 * its place in bst_compensator_step. */
bst_status bst_compensator_plug_status(bst_ctx *ctx,
                                       const bst_compensator *compensator) BST_MUST_CHECK;

/* Bumpless transfer: sets the states so that the next step with the same inputs returns `output`.
 *
 * Given:     error, feed_forward  inputs of the next step
 *            output               desired output; limited as in bst_compensator_step
 * Notes:     the integrator continues from there. A plug-in without `set` keeps its state. */
void bst_compensator_set(bst_compensator *compensator, double error, double feed_forward,
                         double output);

/* Archives the state of a compensator; a restore goes into one with the same configuration.
 *
 * Errors:    BST_ERR_STATE: it is a plug-in without `archive`; those of the plug-in's `archive` */
bst_status bst_compensator_archive(bst_compensator *compensator,
                                   bst_archive *archive) BST_MUST_CHECK;

/* Frequency response from error to output, with gain_scale and delay, without the limits.
 *
 * Given:     omega_radps  angular frequency, rad/s
 * Returned:  infinite at the pole of an integrator; NAN for a plug-in without a response */
double complex bst_compensator_response(const bst_compensator *compensator, double omega_radps);

#pragma GCC visibility pop

#endif
