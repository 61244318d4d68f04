/* Designs the gains of a compensator from a specification of the control loop. */
#include <math.h>

#include "boresight/compensator.h"
#include "boresight/vec.h"
#include "sim/dynamics/compensator_internal.h"

static const double two_pi = 2.0 * BST_PI;

#define LEAD_RATIO_MAX 100.0    /* maximum ratio of a lead's pole and zero: 78.6 deg */
#define DERIVATIVE_ZERO_MIN 0.1 /* minimum zero of a derivative, relative to the crossover */
#define DERIVATIVE_FILTER_RATIO 10.0
#define DERIVATIVE_FILTER_RATE 0.2
#define LOWEST_SHARE 1e-4 /* lowest searched frequency relative to the requested one */
/* about 1 % apart up to half the rate, finer than the phase of a delay */
#define PHASE_POINTS 1500

typedef struct design {
    const bst_compensator_config *config;
    double dt_s;
    bst_dynamics_response_fn plant;
    const void *user;
    bst_compensator filters; /* notches and low-pass with unit gain */
    /* unwrapped phase of the remaining loop, from the lowest frequency, where it is within (-270
     * deg, 90 deg]; a delay decreases it without limit */
    double lowest_hz, log_step, phase_rad[PHASE_POINTS];
} design;

/* Required phase and magnitude of the main section at a crossover, and the continuous frequency by
 * Tustin's rule with the configured prewarping. */
typedef struct need {
    double phase_rad, gain, omega_radps, prewarp_hz;
} need;

/* In (-pi, pi]. */
static double complex rest_of_loop(const design *d, double omega) {
    return d->plant(d->user, omega) * bst_compensator_response(&d->filters, omega);
}

/* Computes the unwrapped phase of plant and filters over frequency. */
static void follow_phase(design *d, double lowest_hz) {
    d->lowest_hz = lowest_hz;
    d->log_step = log(0.5 / d->dt_s / lowest_hz) / (PHASE_POINTS - 1);
    for (int i = 0; i < PHASE_POINTS; i++) {
        double now = carg(rest_of_loop(d, two_pi * lowest_hz * exp(i * d->log_step)));
        if (i == 0) {
            d->phase_rad[0] = now > 0.5 * BST_PI ? now - two_pi : now;
        } else {
            d->phase_rad[i] = d->phase_rad[i - 1] + bst_wrap_angle(now - d->phase_rad[i - 1]);
        }
    }
}

static double phase_at(const design *d, double hz, double wrapped) {
    double i = fmax(round(log(hz / d->lowest_hz) / d->log_step), 0.0);
    double near = d->phase_rad[(int)fmin(i, PHASE_POINTS - 1)];
    return near + bst_wrap_angle(wrapped - near);
}

/* Phase and gain that the compensator needs at a crossover frequency. */
static need need_at(const design *d, double hz, double phase_margin_rad) {
    double w = two_pi * hz;
    double complex p = rest_of_loop(d, w);
    double prewarp = d->config->prewarp_hz > 0.0 ? d->config->prewarp_hz : hz;
    double k = two_pi * prewarp / tan(BST_PI * prewarp * d->dt_s);
    return (need){.phase_rad = phase_margin_rad - BST_PI - phase_at(d, hz, carg(p)),
                  .gain = 1.0 / cabs(p),
                  .omega_radps = k * tan(0.5 * w * d->dt_s),
                  .prewarp_hz = prewarp};
}

static double derivative_filter_hz(const design *d, double crossover_hz) {
    return d->config->derivative_filter_hz > 0.0
               ? d->config->derivative_filter_hz
               : fmin(DERIVATIVE_FILTER_RATIO * crossover_hz, DERIVATIVE_FILTER_RATE / d->dt_s);
}

/* Largest phase that the compensator type can have at a crossover. */
static double greatest_phase(const design *d, double crossover_hz, double omega_radps) {
    double integral = atan(d->config->integral_ratio);
    switch (d->config->type) {
        case BST_COMPENSATOR_PID:
            return atan(1.0 / DERIVATIVE_ZERO_MIN) - integral -
                   atan(omega_radps / (two_pi * derivative_filter_hz(d, crossover_hz)));
        case BST_COMPENSATOR_LEAD_LAG:
            return asin((LEAD_RATIO_MAX - 1.0) / (LEAD_RATIO_MAX + 1.0)) - integral;
        default:
            return 0.0;
    }
}

/* Solves kp + ki / s for a phase (at most 0) and gain. */
static void solve_pi(const need *n, bst_compensator_config *out) {
    double phase = fmax(n->phase_rad, -0.5 * BST_PI);
    out->proportional = fmax(n->gain * cos(phase), 0.0);
    out->integral_per_s = -n->gain * sin(phase) * n->omega_radps;
}

static void solve_pid(const design *d, double crossover_hz, const need *n,
                      bst_compensator_config *out) {
    double w = n->omega_radps, wi = d->config->integral_ratio * w;
    double filter_hz = derivative_filter_hz(d, crossover_hz), wd = two_pi * filter_hz;
    double lead = n->phase_rad + atan(d->config->integral_ratio) + atan(w / wd);
    if (lead <= atan(w / wd)) { /* phase to spare: no derivative */
        solve_pi(n, out);
        return;
    }
    double td = tan(lead) / w;
    double g = n->gain * hypot(1.0, w / wd) / (hypot(1.0, w * td) * hypot(1.0, wi / w));
    out->integral_per_s = g * wi;
    out->proportional = g * (1.0 + wi * td) - g * wi / wd;
    out->derivative_s = g * td - out->proportional / wd;
    out->derivative_filter_hz = filter_hz;
}

static void solve_lead_lag(const design *d, const need *n, bst_compensator_config *out) {
    double w = n->omega_radps, r = d->config->integral_ratio;
    double s = sin(n->phase_rad + atan(r));
    double root = sqrt((1.0 + s) / (1.0 - s));
    out->lead_zero_hz = w / root / two_pi;
    out->lead_pole_hz = w * root / two_pi;
    out->lag_zero_hz = r * w / two_pi;
    out->lag_pole_hz = 0.0;
    out->gain = n->gain / root / hypot(1.0, r);
}

/* Computes the gains for a phase margin at a crossover; false: the type cannot have it. */
static bool solve(const design *d, double crossover_hz, double phase_margin_rad,
                  bst_compensator_config *out) {
    *out = *d->config;
    need n = need_at(d, crossover_hz, phase_margin_rad);
    double most = greatest_phase(d, crossover_hz, n.omega_radps);
    if (!isfinite(n.gain) || !(n.gain > 0.0) || n.phase_rad > most) {
        return false;
    }
    switch (d->config->type) {
        case BST_COMPENSATOR_PI:
            solve_pi(&n, out);
            break;
        case BST_COMPENSATOR_PID:
            solve_pid(d, crossover_hz, &n, out);
            break;
        default:
            if (n.phase_rad < -most) {
                return false;
            }
            solve_lead_lag(d, &n, out);
            break;
    }
    out->crossover_hz = crossover_hz;
    out->prewarp_hz = n.prewarp_hz;
    return true;
}

/* Frequency at which the closed loop falls to -3 dB, Hz; half the rate if it does not. */
static bst_status closed_loop_bandwidth(bst_ctx *ctx, const design *d,
                                        const bst_compensator_config *gains, double *out) {
    bst_compensator c;
    bst_compensator_config plain = *gains;
    plain.bandwidth_hz = plain.crossover_hz = 0.0;
    BST_TRY(bst_compensator_from_gains(ctx, &c, &plain, d->dt_s));
    double nyquist = 0.5 / d->dt_s, hz = gains->crossover_hz, inside = hz;
    /* search upwards from the crossover; with more than 90 deg of phase margin it is below */
    for (int up = 0;; up++) {
        double complex l =
            bst_compensator_response(&c, two_pi * hz) * d->plant(d->user, two_pi * hz);
        bool within = cabs(l / (1.0 + l)) > sqrt(0.5);
        if (up == 0 && !within) {
            for (; hz > LOWEST_SHARE * gains->crossover_hz && !within; hz /= 1.01) {
                l = bst_compensator_response(&c, two_pi * hz) * d->plant(d->user, two_pi * hz);
                within = cabs(l / (1.0 + l)) > sqrt(0.5);
                inside = hz;
            }
            hz = 1.01 * inside;
            break;
        }
        if (!within) {
            break;
        }
        inside = hz;
        if (hz >= nyquist) {
            *out = nyquist;
            return BST_OK;
        }
        hz = fmin(1.01 * hz, nyquist);
    }
    double outside = hz;
    for (int i = 0; i < 40; i++) {
        hz = 0.5 * (inside + outside);
        double complex l =
            bst_compensator_response(&c, two_pi * hz) * d->plant(d->user, two_pi * hz);
        *(cabs(l / (1.0 + l)) > sqrt(0.5) ? &inside : &outside) = hz;
    }
    *out = outside;
    return BST_OK;
}

/* Highest crossover up to `hz` with this phase margin; 0: none. */
static double highest_crossover(const design *d, double hz, double margin_rad) {
    bst_compensator_config unused;
    double low = hz, high = hz;
    while (!solve(d, low, margin_rad, &unused)) {
        high = low;
        low /= 1.02;
        if (low < LOWEST_SHARE * hz) {
            return 0.0;
        }
    }
    for (int i = 0; i < 40 && high > low; i++) {
        double mid = 0.5 * (low + high);
        *(solve(d, mid, margin_rad, &unused) ? &low : &high) = mid;
    }
    return low;
}

/* Fails: the compensator cannot reach the phase margin. */
static bst_status cannot(bst_ctx *ctx, const design *d, double crossover_hz, double best_hz,
                         const char *what) {
    const bst_compensator_config *config = d->config;
    double margin = config->phase_margin_deg * BST_DEG_RAD;
    need n = need_at(d, crossover_hz, margin);
    double most = greatest_phase(d, crossover_hz, n.omega_radps);
    double best_margin = (margin + most - n.phase_rad) / BST_DEG_RAD;
    const char *type = bst_compensator_types[config->type];
    if (!(best_hz > 0.0)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s of %g Hz: a compensator %s has at most a phase margin of %.4g deg "
                        "there, not %g, and does not reach it at lower frequencies; lower "
                        "phase_margin_deg or take another type",
                        what, *what == 'b' ? config->bandwidth_hz : config->crossover_hz, type,
                        best_margin, config->phase_margin_deg);
    }
    return bst_fail(ctx, BST_ERR_CONFIG,
                    "%s of %g Hz: with a phase margin of %g deg a compensator %s reaches at most "
                    "%.4g Hz here (at %.4g Hz crossover its phase margin is at most %.4g deg); "
                    "lower one of the two",
                    what, *what == 'b' ? config->bandwidth_hz : config->crossover_hz,
                    config->phase_margin_deg, type, best_hz, crossover_hz, best_margin);
}

/* Finds the crossover whose closed loop has the requested bandwidth. */
static bst_status for_bandwidth(bst_ctx *ctx, const design *d, double margin_rad,
                                bst_compensator_config *out) {
    double wanted = d->config->bandwidth_hz, nyquist = 0.5 / d->dt_s, reached = 0.0;
    double start = fmin(2.0 * wanted, 0.999 * nyquist);
    double high = highest_crossover(d, start, margin_rad);
    if (high == 0.0) {
        return cannot(ctx, d, wanted, 0.0, "bandwidth_hz");
    }
    double low = LOWEST_SHARE * wanted;
    (void)solve(d, high, margin_rad, out);
    BST_TRY(closed_loop_bandwidth(ctx, d, out, &reached));
    if (reached < wanted) {
        return cannot(ctx, d, wanted, reached, "bandwidth_hz");
    }
    for (int i = 0; i < 50 && high - low > 1e-9 * high; i++) {
        double mid = 0.5 * (low + high);
        bool can = solve(d, mid, margin_rad, out);
        if (can) {
            BST_TRY(closed_loop_bandwidth(ctx, d, out, &reached));
        }
        *(!can || reached < wanted ? &low : &high) = mid;
    }
    if (!solve(d, high, margin_rad, out)) {
        return cannot(ctx, d, high, 0.0, "bandwidth_hz");
    }
    BST_TRY(closed_loop_bandwidth(ctx, d, out, &reached));
    if (fabs(reached - wanted) > 0.005 * wanted) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "bandwidth_hz: the closed loop has its -3 dB point at %.4g or at %.4g Hz, "
                        "nowhere between; give crossover_hz instead",
                        wanted < reached ? wanted : reached, fmax(wanted, reached));
    }
    return BST_OK;
}

bst_status bst_compensator_design(bst_ctx *ctx, const bst_compensator_config *config, double dt_s,
                                  bst_dynamics_response_fn plant, const void *user,
                                  bst_compensator_config *out) {
    *out = *config;
    if (config->bandwidth_hz == 0.0 && config->crossover_hz == 0.0) {
        return BST_OK;
    }
    if (config->bandwidth_hz > 0.0 && config->crossover_hz > 0.0) {
        return bst_fail(ctx, BST_ERR_CONFIG, "give bandwidth_hz or crossover_hz, not both");
    }
    design d = {.config = config, .dt_s = dt_s, .plant = plant, .user = user};
    bst_compensator_config filters = {.type = BST_COMPENSATOR_PI,
                                      .proportional = 1.0,
                                      .notches = config->notches,
                                      .low_pass_hz = config->low_pass_hz,
                                      .gain_scale = 1.0};
    BST_TRY(bst_compensator_from_gains(ctx, &d.filters, &filters, dt_s));
    bst_compensator_config as_asked = *config; /* gain_scale and delay are not part of the design */
    as_asked.gain_scale = 1.0;
    as_asked.delay_s = 0.0;
    d.config = &as_asked;
    follow_phase(&d, LOWEST_SHARE * fmax(config->bandwidth_hz, config->crossover_hz));
    double margin = config->phase_margin_deg * BST_DEG_RAD;
    if (config->bandwidth_hz > 0.0) {
        BST_TRY(for_bandwidth(ctx, &d, margin, out));
    } else {
        if (!solve(&d, config->crossover_hz, margin, out)) {
            double best = highest_crossover(&d, config->crossover_hz, margin);
            return cannot(ctx, &d, config->crossover_hz, best, "crossover_hz");
        }
    }
    out->bandwidth_hz = out->crossover_hz = 0.0;
    out->gain_scale = config->gain_scale;
    out->delay_s = config->delay_s;
    return BST_OK;
}

bst_status bst_compensator_init(bst_ctx *ctx, bst_compensator *c,
                                const bst_compensator_config *config, double dt_s,
                                bst_dynamics_response_fn plant, const void *user) {
    if (config->plug.desc || !(config->bandwidth_hz > 0.0 || config->crossover_hz > 0.0)) {
        return bst_compensator_from_gains(ctx, c, config, dt_s);
    }
    BST_TRY(bst_compensator_check(ctx, config, dt_s));
    if (bst_compensator_has_gains(config)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "both gains and a specification (bandwidth_hz or crossover_hz) are given; "
                        "leave one out");
    }
    if (!plant) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "a specification (bandwidth_hz or crossover_hz) cannot be used here; give "
                        "gains");
    }
    bst_compensator_config designed;
    BST_TRY(bst_compensator_design(ctx, config, dt_s, plant, user, &designed));
    return bst_compensator_from_gains(ctx, c, &designed, dt_s);
}
