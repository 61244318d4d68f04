#include "control/loop/tracking_loop.h"

#include <math.h>
#include <stdlib.h>

#include "boresight/vec.h"

static const double two_pi = 2.0 * BST_PI;

/* Lag of the mount behind a change of the command, by time since: values at multiples of dt_s and
 * their integrals. */
typedef struct deficit {
    double *value, *integral;
} deficit;

struct bst_tracking_loop {
    bst_tracking_timing timing;
    double dt_s, delay_s;
    int count;
    deficit step, ramp;
    bool observes;
    bst_tracking_observer observer;
    bst_compensator compensator;
};

static bst_status fill(bst_ctx *ctx, deficit *d, const double *source, double sign, double from,
                       int count, double dt_s) {
    d->value = calloc((size_t)count + 1, 2 * sizeof *d->value);
    if (!d->value) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a mount's response");
    }
    d->integral = d->value + count + 1;
    for (int i = 0; i < count; i++) {
        d->value[i] = from + sign * source[i];
        d->integral[i] =
            i > 0 ? d->integral[i - 1] + 0.5 * dt_s * (d->value[i - 1] + d->value[i]) : 0.0;
    }
    return BST_OK;
}

bst_status bst_tracking_loop_create(bst_ctx *ctx, const bst_tracking_timing *timing,
                                    const bst_control_servo_response *servo,
                                    const bst_compensator *compensator,
                                    const bst_tracking_observer *observer,
                                    bst_tracking_loop **out) {
    *out = NULL;
    bst_tracking_loop *loop = calloc(1, sizeof *loop);
    if (!loop) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a tracking loop");
    }
    loop->timing = *timing;
    loop->dt_s = servo->dt_s;
    loop->delay_s = servo->delay_s;
    loop->count = servo->count;
    loop->observes = compensator == NULL;
    if (compensator) {
        loop->compensator = *compensator;
    } else {
        loop->observer = *observer;
    }
    bst_status status = BST_OK;
    if (servo->count > 0) {
        status = fill(ctx, &loop->step, servo->step, -1.0, 1.0, servo->count, servo->dt_s);
        if (status == BST_OK) {
            status = fill(ctx, &loop->ramp, servo->ramp_lag, 1.0, 0.0, servo->count, servo->dt_s);
        }
    }
    if (status != BST_OK) {
        bst_tracking_loop_free(loop);
        return status;
    }
    *out = loop;
    return BST_OK;
}

void bst_tracking_loop_free(bst_tracking_loop *loop) {
    if (loop) {
        free(loop->step.value);
        free(loop->ramp.value);
        free(loop);
    }
}

/* Linear interpolation between samples; 0 before the change and after the mount has settled. */
static double value_of(const bst_tracking_loop *loop, const deficit *d, double x) {
    if (loop->count == 0) {
        return d == &loop->step && x >= 0.0 && x < loop->delay_s ? 1.0 : 0.0;
    }
    double i = floor(x / loop->dt_s);
    if (x < 0.0 || i >= loop->count - 1) {
        return 0.0;
    }
    double part = x / loop->dt_s - i;
    return d->value[(int)i] + part * (d->value[(int)i + 1] - d->value[(int)i]);
}

/* Integral from the change to x. */
static double integral_of(const bst_tracking_loop *loop, const deficit *d, double x) {
    if (x <= 0.0) {
        return 0.0;
    }
    if (loop->count == 0) {
        return d == &loop->step ? fmin(x, loop->delay_s) : 0.0;
    }
    double i = floor(x / loop->dt_s);
    if (i >= loop->count - 1) {
        return d->integral[loop->count - 1];
    }
    double part = x - i * loop->dt_s;
    return d->integral[(int)i] + 0.5 * part * (d->value[(int)i] + value_of(loop, d, x));
}

static double mean_of(const bst_tracking_loop *loop, const deficit *d, double from, double to) {
    return to > from ? (integral_of(loop, d, to) - integral_of(loop, d, from)) / (to - from)
                     : value_of(loop, d, from);
}

/* Mount angle averaged from `from` to `to` after mid-exposure of frame 0, if frame k's correction
 * is (c + r t) exp(j w k T), t from its time of effect. */
static double complex angle_mean(const bst_tracking_loop *loop, double w, double complex c,
                                 double complex r, double from, double to) {
    const bst_tracking_timing *t = &loop->timing;
    double period = t->period_s, sw = t->switch_s;
    double complex back = cexp(-I * w * period), sum = 0.0;
    /* the correction of frame -n is active from sw - n T to sw - (n - 1) T */
    double first = ceil((sw - to) / period - 1e-9), last = ceil((sw - from) / period - 1e-9);
    for (double n = first; n <= last; n++) {
        double a = n < last ? sw - n * period : from;
        double b = n > first ? sw - (n - 1.0) * period : to;
        double share = to > from ? (b - a) / (to - from) : 1.0;
        sum += share * cexp(-I * w * period * n) *
               (c + r * (0.5 * (a + b) + n * period - t->effect_s));
    }
    /* at each change the mount lags by the jumps of angle and rate */
    double late = sw - t->effect_s;
    double complex jump = c + r * late - back * (c + r * (period + late)), kink = r * (1.0 - back);
    double rest = loop->count > 0 ? loop->count * loop->dt_s : loop->delay_s;
    for (double n = first; n * period + from - sw < rest; n++) {
        double x = n * period - sw;
        sum -= cexp(-I * w * period * n) * (jump * mean_of(loop, &loop->step, from + x, to + x) +
                                            kink * mean_of(loop, &loop->ramp, from + x, to + x));
    }
    return sum;
}

static double complex plant_later(const bst_tracking_loop *loop, double w, double later_s) {
    double period = loop->timing.period_s, half = 0.5 * loop->timing.exposure_s;
    double complex back = cexp(-I * w * period);
    return angle_mean(loop, w, period * back / (1.0 - back), 1.0, -half - later_s, half - later_s);
}

double complex bst_tracking_plant(const void *user, double w) {
    return plant_later(user, w, 0.0);
}

/* Observer's output for a measurement: correction angle at the time of effect, and rate. */
static void observer_output(const bst_tracking_loop *loop, double w, double complex *c,
                            double complex *r) {
    double period = loop->timing.period_s, alpha = loop->observer.alpha, beta = loop->observer.beta;
    double complex back = cexp(-I * w * period);
    double complex predicted = back * (alpha + beta / (1.0 - back)) / (1.0 - back);
    double complex innovation = 1.0 / (1.0 + predicted);
    *r = beta / period / (1.0 - back) * innovation;
    *c = (predicted + alpha) * innovation + *r * loop->timing.effect_s;
}

/* H: motion in the frames, late_s late, relative to the observer's measurement. */
static double complex motion_in_frames(const bst_tracking_loop *loop, double w, double late_s) {
    double half = 0.5 * loop->timing.exposure_s;
    double complex c, r;
    observer_output(loop, w, &c, &r);
    return angle_mean(loop, w, c, r, -half - late_s, half - late_s);
}

double complex bst_tracking_denominator(const void *user, double w) {
    const bst_tracking_loop *loop = user;
    return loop->observes ? 1.0 - motion_in_frames(loop, w, 0.0) : 1.0;
}

double complex bst_tracking_open_later(const void *user, double w, double later_s) {
    const bst_tracking_loop *loop = user;
    if (!loop->observes) {
        return bst_compensator_response(&loop->compensator, w) * plant_later(loop, w, later_s);
    }
    const bst_tracking_observer *o = &loop->observer;
    return o->motion_gain * motion_in_frames(loop, w, o->motion_late_s + later_s) /
           bst_tracking_denominator(loop, w);
}

double complex bst_tracking_open(const void *user, double w) {
    return bst_tracking_open_later(user, w, 0.0);
}

bst_loop bst_tracking_as_loop(const bst_tracking_loop *tracking) {
    return (bst_loop){.open = bst_tracking_open,
                      .user = tracking,
                      .dt_s = tracking->timing.period_s,
                      .delay_s = tracking->timing.switch_s + 0.5 * tracking->timing.exposure_s +
                                 (tracking->observes ? tracking->observer.motion_late_s : 0.0),
                      .denominator = tracking->observes ? bst_tracking_denominator : NULL,
                      .open_later = tracking->observes ? bst_tracking_open_later : NULL};
}

/* Correction from a frame's measurement without the mount's own contribution: angle at its time of
 * effect, and rate. */
static void correction_of(const bst_tracking_loop *loop, double w, double complex *c,
                          double complex *r) {
    if (loop->observes) {
        const bst_tracking_observer *o = &loop->observer;
        observer_output(loop, w, c, r);
        if (o->motion_gain != 1.0 || o->motion_late_s != 0.0) {
            double complex wrong = o->motion_gain * motion_in_frames(loop, w, o->motion_late_s) -
                                   motion_in_frames(loop, w, 0.0);
            *c /= 1.0 + wrong;
            *r /= 1.0 + wrong;
        }
        return;
    }
    double period = loop->timing.period_s;
    double complex back = cexp(-I * w * period);
    *r = bst_compensator_response(&loop->compensator, w) / (1.0 + bst_tracking_open(loop, w));
    *c = *r * period * back / (1.0 - back);
}

/* Mount angle at an offset relative to the frames' measurement without the mount's own
 * contribution. */
static double complex correction(const bst_tracking_loop *loop, double w, double offset_s) {
    double complex c, r;
    correction_of(loop, w, &c, &r);
    return angle_mean(loop, w, c, r, offset_s, offset_s);
}

double complex bst_tracking_rejection(const bst_tracking_loop *loop, double w, double offset_s) {
    double x = 0.5 * w * loop->timing.exposure_s;
    double averaged = fabs(x) > 1e-6 ? sin(x) / x : 1.0;
    return cexp(I * w * offset_s) - averaged * correction(loop, w, offset_s);
}

double complex bst_tracking_noise(const bst_tracking_loop *loop, double w, double offset_s) {
    return -correction(loop, w, offset_s);
}

/* Midpoints of the integral over a band: enough per frame rate to cover its aliased parts. */
enum { BAND_POINTS = 400, BAND_POINTS_MAX = 20000, NOISE_POINTS = 2000 };

double bst_tracking_variance(const bst_tracking_loop *loop, const bst_tracking_band *bands,
                             int count) {
    double sum = 0.0;
    for (int b = 0; b < count; b++) {
        double width = bands[b].high_hz - bands[b].low_hz;
        double wanted = fmax(BAND_POINTS, 20.0 * width * loop->timing.period_s);
        int points = width > 0.0 ? (int)fmin(wanted, BAND_POINTS_MAX) : 1;
        for (int i = 0; i < points; i++) {
            double hz = bands[b].low_hz + width * (i + 0.5) / points;
            double e = cabs(bst_tracking_rejection(loop, two_pi * hz, 0.0));
            sum += bands[b].variance / points * e * e;
        }
    }
    return sum;
}

double bst_tracking_noise_gain(const bst_tracking_loop *loop) {
    double sum = 0.0;
    for (int i = 0; i < NOISE_POINTS; i++) {
        double w = BST_PI / loop->timing.period_s * (i + 0.5) / NOISE_POINTS;
        double e = cabs(bst_tracking_noise(loop, w, 0.0));
        sum += e * e / NOISE_POINTS;
    }
    return sum;
}

double bst_tracking_lag(const bst_tracking_loop *loop) {
    /* rejection is j w lag towards zero frequency */
    double w = 1e-5 * BST_PI / loop->timing.period_s;
    return cabs(bst_tracking_rejection(loop, w, 0.0)) / w;
}

void bst_tracking_observer_gains(double density, double sigma_rad, double period_s, double *alpha,
                                 double *beta) {
    /* scaled: variances by sigma^2, time by the period */
    double q = density * period_s * period_s * period_s / (sigma_rad * sigma_rad);
    double ee = 1.0, er = 1.0, rr = 2.0;
    *alpha = *beta = 1.0;
    for (int i = 0; i < 100000; i++) {
        double pee = ee + 2.0 * er + rr + q / 3.0, per = er + rr + q / 2.0, prr = rr + q;
        double a = pee / (pee + 1.0), b = per / (pee + 1.0);
        ee = pee * (1.0 - a);
        er = per * (1.0 - a);
        rr = prr - b * per;
        bool still = fabs(a - *alpha) + fabs(b - *beta) < 1e-15;
        *alpha = a;
        *beta = b;
        if (still) {
            return;
        }
    }
}
