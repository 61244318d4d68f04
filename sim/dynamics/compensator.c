#include "boresight/compensator.h"

#include <assert.h>
#include <math.h>

#include "boresight/vec.h"
#include "sim/dynamics/compensator_internal.h"

static const double two_pi = 2.0 * BST_PI;

const char *const bst_compensator_kinds[] = {BST_STAGE_COMPENSATOR, NULL};
const char *const bst_compensator_types[] = {"pi", "pid", "lead_lag", NULL};

const bst_config_desc bst_notch_config_table[] = {
    BST_REAL(bst_dynamics_notch_config, frequency_hz, "Hz", 1e-6, 1e5, NULL, "Centre."),
    BST_REAL(bst_dynamics_notch_config, width_hz, "Hz", 0, 1e5, "0",
             "Width of the dip, 3 dB down from its shoulders when it is deep; 0: its frequency."),
    BST_REAL(bst_dynamics_notch_config, depth_db, "dB", 0, 120, "40", "Attenuation at the centre."),
    BST_CONFIG_END};

const bst_config_desc bst_compensator_config_table[] = {
    BST_COMPENSATOR_KEYS(bst_compensator_types, "\"pid\""), BST_CONFIG_END};

bst_dynamics_biquad bst_dynamics_biquad_tustin(const double num[3], const double den[3],
                                               double dt_s, double prewarp_hz) {
    double w = two_pi * prewarp_hz;
    double k = prewarp_hz > 0.0 ? w / tan(0.5 * w * dt_s) : 2.0 / dt_s;
    if (num[2] == 0.0 && den[2] == 0.0) {
        if (num[1] == 0.0 && den[1] == 0.0) {
            return (bst_dynamics_biquad){.b0 = num[0] / den[0]};
        }
        double a = den[0] + den[1] * k;
        return (bst_dynamics_biquad){.b0 = (num[0] + num[1] * k) / a,
                                     .b1 = (num[0] - num[1] * k) / a,
                                     .a1 = (den[0] - den[1] * k) / a};
    }
    double k2 = k * k, a = den[0] + den[1] * k + den[2] * k2;
    return (bst_dynamics_biquad){.b0 = (num[0] + num[1] * k + num[2] * k2) / a,
                                 .b1 = 2.0 * (num[0] - num[2] * k2) / a,
                                 .b2 = (num[0] - num[1] * k + num[2] * k2) / a,
                                 .a1 = 2.0 * (den[0] - den[2] * k2) / a,
                                 .a2 = (den[0] - den[1] * k + den[2] * k2) / a};
}

double complex bst_dynamics_biquad_response(const bst_dynamics_biquad *q, double omega_per_sample) {
    double complex d = cexp(-I * omega_per_sample);
    return (q->b0 + d * (q->b1 + d * q->b2)) / (1.0 + d * (q->a1 + d * q->a2));
}

static bst_status below_nyquist(bst_ctx *ctx, const char *key, double hz, double dt_s) {
    if (hz * dt_s < 0.5) {
        return BST_OK;
    }
    return bst_fail(ctx, BST_ERR_CONFIG,
                    "%s: %g Hz is not below half of the compensator's rate of %g Hz; lower it or "
                    "raise the rate",
                    key, hz, 1.0 / dt_s);
}

/* Adds a filter section, discretised by the Tustin transform. */
static void add(bst_compensator *c, const double num[3], const double den[3], double prewarp_hz) {
    assert(c->stages < (int)(sizeof c->stage / sizeof c->stage[0]));
    c->stage[c->stages++] = bst_dynamics_biquad_tustin(num, den, c->dt_s, prewarp_hz);
}

static bst_status add_filters(bst_ctx *ctx, bst_compensator *c,
                              const bst_compensator_config *config) {
    const bst_dynamics_notch_config *notches = config->notches.items;
    for (int i = 0; i < config->notches.count; i++) {
        const bst_dynamics_notch_config *n = &notches[i];
        BST_TRY(below_nyquist(ctx, "notches/frequency_hz", n->frequency_hz, c->dt_s));
        double w = two_pi * n->frequency_hz;
        double width = two_pi * (n->width_hz > 0.0 ? n->width_hz : n->frequency_hz);
        double depth = pow(10.0, -n->depth_db / 20.0);
        add(c, (double[]){w * w, depth * width, 1.0}, (double[]){w * w, width, 1.0},
            n->frequency_hz);
    }
    if (config->low_pass_hz > 0.0) {
        BST_TRY(below_nyquist(ctx, "low_pass_hz", config->low_pass_hz, c->dt_s));
        double w = two_pi * config->low_pass_hz;
        add(c, (double[]){w * w, 0.0, 0.0}, (double[]){w * w, sqrt(2.0) * w, 1.0},
            config->low_pass_hz);
    }
    return BST_OK;
}

/* Adds the last stage of types pi and pid. Returns the time constant of its anti-windup: 0:
 * immediate, INFINITY: no integrator. */
static double add_pid(bst_compensator *c, const bst_compensator_config *config) {
    double g = config->gain_scale, kp = g * config->proportional, ki = g * config->integral_per_s;
    double kd = config->type == BST_COMPENSATOR_PID ? g * config->derivative_s : 0.0;
    double at = config->prewarp_hz;
    if (kd == 0.0) {
        if (ki == 0.0) {
            add(c, (double[]){kp, 0.0, 0.0}, (double[]){1.0, 0.0, 0.0}, at);
            return INFINITY;
        }
        add(c, (double[]){ki, kp, 0.0}, (double[]){0.0, 1.0, 0.0}, at);
        return kp / ki;
    }
    double hz = config->derivative_filter_hz > 0.0 ? config->derivative_filter_hz : 0.2 / c->dt_s;
    double t = 1.0 / (two_pi * hz);
    if (ki == 0.0) {
        add(c, (double[]){kp, kp * t + kd, 0.0}, (double[]){1.0, t, 0.0}, at);
        return INFINITY;
    }
    add(c, (double[]){ki, kp + ki * t, kp * t + kd}, (double[]){0.0, 1.0, t}, at);
    return kd > 0.0 ? sqrt(kd / ki) : kp / ki;
}

/* Multiplies a polynomial p of first degree: p (root + s). */
static void multiply(double p[3], double root) {
    p[2] = p[1];
    p[1] = p[0] + p[1] * root;
    p[0] *= root;
}

/* Adds the last stage of type lead_lag; returns as add_pid. */
static double add_lead_lag(bst_compensator *c, const bst_compensator_config *config) {
    double num[3] = {config->gain_scale * config->gain, 0.0, 0.0}, den[3] = {1.0, 0.0, 0.0};
    if (config->lead_zero_hz > 0.0) {
        num[1] = num[0] / (two_pi * config->lead_zero_hz);
        den[1] = 1.0 / (two_pi * config->lead_pole_hz);
    }
    bool lag = config->lag_zero_hz > 0.0;
    if (lag) {
        multiply(num, two_pi * config->lag_zero_hz);
        multiply(den, two_pi * config->lag_pole_hz);
    }
    add(c, num, den, config->prewarp_hz);
    return lag ? 1.0 / (two_pi * config->lag_zero_hz) : INFINITY;
}

bool bst_compensator_has_gains(const bst_compensator_config *c) {
    return c->proportional > 0.0 || c->integral_per_s > 0.0 || c->derivative_s > 0.0 ||
           c->gain > 0.0;
}

bst_status bst_compensator_check(bst_ctx *ctx, const bst_compensator_config *config, double dt_s) {
    if (config->type < 0 || config->type >= BST_COMPENSATOR_TYPE_COUNT) {
        return bst_fail(ctx, BST_ERR_CONFIG, "type: this is no cascade of biquads");
    }
    BST_TRY(below_nyquist(ctx, "bandwidth_hz", config->bandwidth_hz, dt_s));
    BST_TRY(below_nyquist(ctx, "crossover_hz", config->crossover_hz, dt_s));
    BST_TRY(below_nyquist(ctx, "prewarp_hz", config->prewarp_hz, dt_s));
    if (config->type == BST_COMPENSATOR_LEAD_LAG && config->lead_zero_hz > 0.0 &&
        !(config->lead_pole_hz > 0.0)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "lead_pole_hz: a lead with its zero at %g Hz needs a pole; give one above "
                        "it",
                        config->lead_zero_hz);
    }
    if (config->delay_s > (BST_COMPENSATOR_DELAY - 2) * dt_s) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "delay_s: %g s are more than %d samples of the compensator; give at most "
                        "%g s",
                        config->delay_s, BST_COMPENSATOR_DELAY - 2,
                        (BST_COMPENSATOR_DELAY - 2) * dt_s);
    }
    return BST_OK;
}

/* Builds the compensator of a servo loop from its configuration. */
static bst_status build(bst_ctx *ctx, bst_compensator *c, const bst_compensator_config *config,
                        double dt_s) {
    BST_TRY(bst_compensator_check(ctx, config, dt_s));
    *c = (bst_compensator){.dt_s = dt_s,
                           .feed_forward = config->feed_forward,
                           .limit = config->output_limit > 0.0 ? config->output_limit : INFINITY,
                           .rate_limit = config->output_rate_limit_per_s > 0.0
                                             ? config->output_rate_limit_per_s * dt_s
                                             : INFINITY};
    BST_TRY(add_filters(ctx, c, config));
    double tracking_s =
        config->type == BST_COMPENSATOR_LEAD_LAG ? add_lead_lag(c, config) : add_pid(c, config);
    if (config->anti_windup_s > 0.0 && isfinite(tracking_s)) {
        tracking_s = config->anti_windup_s;
    }
    c->integrates = config->type == BST_COMPENSATOR_LEAD_LAG
                        ? config->lag_zero_hz > 0.0 && config->lag_pole_hz == 0.0
                        : config->integral_per_s * config->gain_scale > 0.0;
    const bst_dynamics_biquad *last = &c->stage[c->stages - 1];
    /* with poles at 1 and p the excess moves the pole at 1 by -back / (1 - p), and p = a2 */
    c->back = tracking_s > 0.0 ? fmin(1.0, (1.0 - last->a2) * dt_s / tracking_s) : 1.0;
    for (int i = 0; i < c->stages; i++) {
        const bst_dynamics_biquad *q = &c->stage[i];
        if (!isfinite(q->b0 + q->b1 + q->b2 + q->a1 + q->a2)) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "the compensator's coefficients at %g Hz are not finite; lower its "
                            "gains",
                            1.0 / dt_s);
        }
    }
    double steps = config->delay_s / dt_s, whole = floor(steps + 1e-9);
    c->delay_whole = (int)whole;
    c->delay_part = fmax(steps - whole, 0.0);
    return BST_OK;
}

/* Sets up a compensator from a plug-in. */
static bst_status plug(bst_ctx *ctx, bst_compensator *c, const bst_stage_use *use, double dt_s) {
    const bst_compensator_stage *stage = use->desc->functions;
    if (stage->state_bytes > BST_COMPENSATOR_STATE_BYTES || !stage->init || !stage->step) {
        return bst_fail(
            ctx, BST_ERR_CONFIG,
            "plug-in %s: its compensator \"%s\" lacks init or step, or its state of %zu "
            "bytes is larger than %d",
            use->plugin, use->desc->type, stage->state_bytes, BST_COMPENSATOR_STATE_BYTES);
    }
    *c = (bst_compensator){.dt_s = dt_s,
                           .feed_forward = 1.0,
                           .limit = INFINITY,
                           .rate_limit = INFINITY,
                           .plug = stage,
                           .plugin = use->plugin};
    bst_status status = stage->init(ctx, use->config, dt_s, c->plug_state);
    return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "plug-in %s", use->plugin);
}

bst_status bst_compensator_from_gains(bst_ctx *ctx, bst_compensator *c,
                                      const bst_compensator_config *config, double dt_s) {
    assert(c && config && dt_s > 0.0);
    return config->plug.desc ? plug(ctx, c, &config->plug, dt_s) : build(ctx, c, config, dt_s);
}

/* Advances the state of a filter section. */
static double advance(const bst_dynamics_biquad *q, double state[2], double x, double y,
                      double fed_back) {
    state[0] = q->b1 * x - q->a1 * fed_back + state[1];
    state[1] = q->b2 * x - q->a2 * fed_back;
    return y;
}

static double clamp(double x, double low, double high) {
    return x < low ? low : x > high ? high : x;
}

/* Output of the compensator after its delay. */
static double delayed(bst_compensator *c, double output) {
    if (c->delay_whole == 0 && c->delay_part == 0.0) {
        return output;
    }
    c->past[c->delay_next] = output;
    int newer = (c->delay_next - c->delay_whole + BST_COMPENSATOR_DELAY) % BST_COMPENSATOR_DELAY;
    int older = (newer - 1 + BST_COMPENSATOR_DELAY) % BST_COMPENSATOR_DELAY;
    c->delay_next = (c->delay_next + 1) % BST_COMPENSATOR_DELAY;
    return c->past[newer] + c->delay_part * (c->past[older] - c->past[newer]);
}

static double step_plug(bst_compensator *c, double error, double feed_forward) {
    double given = c->plug->step(c->plug_state, error);
    if (!isfinite(given)) {
        c->plug_failed = true;
        given = 0.0;
    }
    double wanted = given + c->feed_forward * feed_forward;
    c->output = clamp(wanted, -c->limit, c->limit);
    c->limited = c->output != wanted;
    return c->output;
}

bst_status bst_compensator_plug_status(bst_ctx *ctx, const bst_compensator *c) {
    return c->plug_failed
               ? bst_fail(ctx, BST_ERR_STATE,
                          "plug-in %s: its compensator gave an output that is not finite",
                          c->plugin)
               : BST_OK;
}

double bst_compensator_step(bst_compensator *c, double error, double feed_forward) {
    assert(c);
    if (c->plug) {
        return step_plug(c, error, feed_forward);
    }
    double x = error;
    int last = c->stages - 1;
    for (int i = 0; i < last; i++) {
        double y = c->stage[i].b0 * x + c->state[i][0];
        x = advance(&c->stage[i], c->state[i], x, y, y);
    }
    double y = c->stage[last].b0 * x + c->state[last][0];
    double wanted = y + c->feed_forward * feed_forward;
    double given = clamp(wanted, c->output - c->rate_limit, c->output + c->rate_limit);
    given = clamp(given, -c->limit, c->limit);
    c->limited = given != wanted;
    advance(&c->stage[last], c->state[last], x, y, c->limited ? y + c->back * (given - wanted) : y);
    c->output = given;
    return delayed(c, given);
}

/* States for a constant input x and output y, between y - ramp and y + ramp. */
static void rest(const bst_dynamics_biquad *q, double state[2], double x, double y, double ramp) {
    state[0] = y - q->b0 * x;
    state[1] = q->b2 * x - q->a2 * (y - ramp);
}

void bst_compensator_set(bst_compensator *c, double error, double feed_forward, double output) {
    double x = error, given = clamp(output, -c->limit, c->limit);
    int last = c->stages - 1;
    if (c->plug) {
        if (c->plug->set) {
            c->plug->set(c->plug_state, error, given - c->feed_forward * feed_forward);
        }
        c->output = given;
        c->limited = false;
        return;
    }
    for (int i = 0; i < last; i++) {
        const bst_dynamics_biquad *q = &c->stage[i];
        double y = x * (q->b0 + q->b1 + q->b2) / (1.0 + q->a1 + q->a2);
        rest(q, c->state[i], x, y, 0.0);
        x = y;
    }
    /* poles at 1 and p = a2 */
    const bst_dynamics_biquad *q = &c->stage[last];
    double ramp = c->integrates ? (q->b0 + q->b1 + q->b2) * x / (1.0 - q->a2) : 0.0;
    rest(q, c->state[last], x, given - c->feed_forward * feed_forward, ramp);
    c->output = given;
    c->limited = false;
    for (int i = 0; i < BST_COMPENSATOR_DELAY; i++) {
        c->past[i] = given;
    }
}

bst_status bst_compensator_archive(bst_compensator *c, bst_archive *archive) {
    BST_ARCHIVE(archive, c->limit); /* a mount's servo changes it */
    BST_ARCHIVE(archive, c->output);
    bst_archive_bool(archive, &c->limited);
    if (c->plug) {
        bst_archive_bool(archive, &c->plug_failed);
        return c->plug->archive ? c->plug->archive(c->plug_state, archive)
                                : bst_fail(bst_archive_ctx(archive), BST_ERR_STATE,
                                           "plug-in %s: the state of its compensator cannot be "
                                           "saved: it has no function `archive`",
                                           c->plugin);
    }
    bst_archive_bytes(archive, c->state, (size_t)c->stages * sizeof *c->state);
    c->delay_next = (int)bst_archive_integer(archive, c->delay_next, 0, BST_COMPENSATOR_DELAY - 1);
    if (c->delay_whole > 0 || c->delay_part > 0.0) {
        BST_ARCHIVE(archive, c->past);
    }
    return BST_OK;
}

double complex bst_compensator_response(const bst_compensator *c, double omega_radps) {
    double w = omega_radps * c->dt_s;
    if (c->plug) {
        return c->plug->response ? c->plug->response(c->plug_state, w) : NAN;
    }
    double complex out =
        cexp(-I * w * c->delay_whole) * (1.0 - c->delay_part + c->delay_part * cexp(-I * w));
    for (int i = 0; i < c->stages; i++) {
        out *= bst_dynamics_biquad_response(&c->stage[i], w);
    }
    return out;
}
