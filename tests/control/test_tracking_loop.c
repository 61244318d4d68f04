/* The linear model of the tracking loop against that loop stepped in time: the mount's servo at
 * 1 kHz, frames averaged over their exposure, corrections late. */
#include "boresight/vec.h"
#include "control/loop/tracking_loop.h"
#include "gimbal/mount/axis.h"
#include "tests/test_support.h"

#define DT 1e-3
enum { RESPONSE = 1500 };
/* So small that the axis meets no limit. */
#define TINY 1e-9

static const bst_axis_spec spec = {.rate_limit_radps = 10.0,
                                   .accel_limit_radps2 = 1000.0,
                                   .natural_frequency_radps = 50.0,
                                   .damping = 0.7,
                                   .dt_s = DT};
/* 10 frames a second, 60 ms exposures, control 130 ms after an exposure's middle, commands 20 ms on
 * their way (and believed to be 50). */
static const bst_tracking_timing timing = {0.1, 0.06, 0.13, 0.18, 0.15};

typedef struct responses {
    double step[RESPONSE], lag[RESPONSE];
} responses;

static bst_control_servo_response servo_of(responses *r) {
    bst_axis axis;
    bst_axis_init(&axis, &spec);
    for (int n = 0; n < RESPONSE; n++) {
        bst_axis_step(&axis, TINY, 0.0, 0.0);
        r->step[n] = axis.angle_rad / TINY;
    }
    bst_axis_init(&axis, &spec);
    for (int n = 0; n < RESPONSE; n++) {
        bst_axis_step(&axis, TINY * n * DT, TINY, 0.0);
        r->lag[n] = n * DT - axis.angle_rad / TINY;
    }
    return (bst_control_servo_response){
        .dt_s = DT, .count = RESPONSE, .step = r->step, .ramp_lag = r->lag};
}

static bst_compensator pi_with(double crossover_hz, const bst_control_servo_response *servo,
                               double gain_scale, double delay_s) {
    bst_ctx ctx = {0};
    bst_tracking_loop *plant;
    bst_compensator c = {.dt_s = timing.period_s, .stages = 1, .stage = {{.b0 = 1.0}}};
    bst_assert_ok(&ctx, bst_tracking_loop_create(&ctx, &timing, servo, &c, NULL, &plant));
    bst_compensator_config config = {.type = BST_COMPENSATOR_PI,
                                     .crossover_hz = crossover_hz,
                                     .phase_margin_deg = 45.0,
                                     .gain_scale = gain_scale,
                                     .delay_s = delay_s};
    bst_assert_ok(
        &ctx, bst_compensator_init(&ctx, &c, &config, timing.period_s, bst_tracking_plant, plant));
    bst_tracking_loop_free(plant);
    return c;
}

typedef struct simulated {
    double complex error; /* over the amplitude of a sinusoid, at the exposures' middles */
    double growth;        /* of the error's envelope, last tenth over first tenth of a free run */
} simulated;

enum { PENDING = 64, MOTION = 4096 };

/* Steps the loop. omega > 0: driven by a sinusoid that repeats after `frames` frames; 0: from an
 * error at the start. `timed` is `timing` but
 * for its latencies. */
static simulated simulate_at(const bst_tracking_timing *timed, const bst_compensator *compensator,
                             const bst_tracking_observer *observer, double omega, int frames) {
    bst_axis axis;
    bst_axis_init(&axis, &spec);
    bst_compensator c = compensator ? *compensator : (bst_compensator){0};
    int period = 100, half = 30; /* steps */
    int late = (int)lround(timed->switch_s / DT);
    int shown_late = observer ? (int)lround(observer->motion_late_s / DT) : 0;
    double motion[MOTION] = {0};                    /* of the mount, ring */
    double value = 0.0, rate = 0.0, value_at = 0.0; /* of the correction, at a time */
    double estimate = 0.0, estimate_rate = 0.0;
    double sum = 0.0, pending[PENDING];
    simulated out = {0};
    double first = 0.0, last = 0.0;
    int settle = omega > 0.0 ? 400 : 0, total = settle + frames;
    for (int n = 0; n < total * period; n++) {
        /* frame k is exposed from k period - half to k period + half, acted on `late` after it */
        int k = (n - late) / period;
        if (n >= late && (n - late) % period == 0) {
            double m = pending[k % PENDING], effect = k * timing.period_s + timed->effect_s;
            if (compensator) {
                value += rate * (effect - value_at);
                rate = TINY * bst_compensator_step(&c, m / TINY, 0.0);
            } else {
                double nu = m - (estimate + timing.period_s * estimate_rate);
                estimate += timing.period_s * estimate_rate + observer->alpha * nu;
                estimate_rate += observer->beta / timing.period_s * nu;
                value = estimate + estimate_rate * timed->effect_s;
                rate = estimate_rate;
            }
            value_at = effect;
        }
        double t = n * DT;
        bst_axis_step(&axis, value + rate * (t - value_at), rate, 0.0);
        if (observer && fabs(axis.angle_rad) > 1e4 * TINY) { /* far from limits still */
            return (simulated){.growth = INFINITY};
        }
        assert_false(axis.limited);
        double d = omega > 0.0 ? TINY * cos(omega * t) : TINY;
        double e = d - axis.angle_rad;
        /* the frames show more, and later, motion than telemetry, which the observer adds back */
        motion[n % MOTION] = axis.angle_rad;
        double seen = d;
        if (observer) {
            double shown = n >= shown_late ? motion[(n - shown_late) % MOTION] : 0.0;
            seen += axis.angle_rad - observer->motion_gain * shown;
        }
        int phase = n % period, frame = (n + half) / period;
        if (phase == 0 && n / period >= settle) {
            int i = n / period - settle;
            out.error += e / TINY * cexp(-I * omega * i * timing.period_s) / frames;
            if (10 * i < frames) {
                first = fmax(first, fabs(e));
            } else if (10 * i >= 9 * frames) {
                last = fmax(last, fabs(e));
            }
        }
        if (phase >= period - half || phase <= half) {
            double weight = phase == half || phase == period - half ? 0.5 : 1.0; /* trapezoids */
            sum += weight * (observer ? seen : e) / (2 * half);
            if (phase == half) {
                pending[frame % PENDING] = sum;
                sum = 0.0;
            }
        }
    }
    out.error *= omega > 0.0 ? cexp(-I * omega * settle * timing.period_s) * 1.0 : 1.0;
    out.growth = last / first;
    return out;
}

static simulated simulate(const bst_compensator *compensator, const bst_tracking_observer *observer,
                          double omega, int frames) {
    return simulate_at(&timing, compensator, observer, omega, frames);
}

/* cos = half a turn each way: of a frequency between 0 and half the frame rate only one is kept. */
static double simulated_size(const bst_compensator *c, const bst_tracking_observer *observer,
                             int turns, int frames) {
    double omega = 2 * BST_PI * turns / (frames * timing.period_s);
    return 2.0 * cabs(simulate(c, observer, omega, frames).error);
}

static void test_rejection(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    responses r;
    bst_control_servo_response servo = servo_of(&r);
    bst_compensator c = pi_with(0.4, &servo, 1.0, 0.0);
    const bst_tracking_observer gains = {0.5, 0.2, 1.0, 0.0};
    bst_tracking_loop *image, *observer;
    bst_assert_ok(&ctx, bst_tracking_loop_create(&ctx, &timing, &servo, &c, NULL, &image));
    bst_assert_ok(&ctx, bst_tracking_loop_create(&ctx, &timing, &servo, NULL, &gains, &observer));
    for (int turns = 1; turns < 100; turns = turns * 3 + 1) {
        double w = 2 * BST_PI * turns / 20.0;
        /* the exposure's mean by trapezoids of 1 ms, the response between steps by straight lines:
         * 1e-3 of what is made up for */
        bst_assert_close(simulated_size(&c, NULL, turns, 200),
                         cabs(bst_tracking_rejection(image, w, 0.0)), 2e-3);
        bst_assert_close(simulated_size(NULL, &gains, turns, 200),
                         cabs(bst_tracking_rejection(observer, w, 0.0)), 2e-3);
    }
    /* both follow a steady drift without lag; so slowly, that only rounding is left */
    bst_assert_close(bst_tracking_lag(image), 0.0, 1e-3);
    bst_assert_close(bst_tracking_lag(observer), 0.0, 1e-3);
    bst_tracking_loop_free(image);
    bst_tracking_loop_free(observer);
}

static void test_margins(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    responses r;
    bst_control_servo_response servo = servo_of(&r);
    bst_compensator c = pi_with(0.4, &servo, 1.0, 0.0);
    bst_tracking_loop *loop;
    bst_assert_ok(&ctx, bst_tracking_loop_create(&ctx, &timing, &servo, &c, NULL, &loop));
    bst_loop open = bst_tracking_as_loop(loop);
    bst_loop_margins m;
    bst_assert_ok(&ctx, bst_loop_analyse(&ctx, &open, &m));
    assert_true(m.stable);
    bst_assert_close(m.crossover_hz, 0.4, 1e-6); /* as designed */
    bst_assert_close(m.phase_margin_deg, 45.0, 1e-4);
    double factor = pow(10.0, m.gain_margin_db / 20.0);
    /* 0.5 % beyond either margin the free loop grows, 0.5 % before it it shrinks */
    bst_compensator below = pi_with(0.4, &servo, 0.995 * factor, 0.0);
    bst_compensator above = pi_with(0.4, &servo, 1.005 * factor, 0.0);
    assert_true(simulate(&below, NULL, 0.0, 1000).growth < 0.9);
    assert_true(simulate(&above, NULL, 0.0, 1000).growth > 1.1);
    /* the compensator's own delay is between samples an interpolation, which also lowers the gain:
     * the model knows, the margin is for a pure delay, 5 % */
    below = pi_with(0.4, &servo, 1.0, 0.95 * m.delay_margin_s);
    above = pi_with(0.4, &servo, 1.0, 1.05 * m.delay_margin_s);
    assert_true(simulate(&below, NULL, 0.0, 1000).growth < 0.9);
    assert_true(simulate(&above, NULL, 0.0, 1000).growth > 1.1);
    bst_tracking_loop_free(loop);
}

/* Whether the free loop grows. */
static bool diverges(const bst_tracking_timing *timed, const bst_tracking_observer *observer) {
    return simulate_at(timed, NULL, observer, 0.0, 1500).growth > 1.0;
}

/* The observer at latencies from a tenth of a frame period to ten: as long as telemetry is right it
 * has no loop and is stable, and what it bears of a wrong model of the mount is that of the loop
 * stepped in time, 1 % on both sides (the exposure's mean by trapezoids; 2 % of the delay, of which
 * a step is up to 1 %). */
static void test_observer_margins(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    responses r;
    bst_control_servo_response servo = servo_of(&r);
    static const double latency_periods[] = {0.1, 0.4, 0.7, 1.0, 1.3, 2.5, 5.0, 10.0};
    for (size_t i = 0; i < sizeof latency_periods / sizeof *latency_periods; i++) {
        double arrival = 0.03 + 0.1 * latency_periods[i];
        const bst_tracking_timing timed = {0.1, 0.06, arrival, arrival + 0.01, arrival + 0.01};
        bst_tracking_observer observer = {.alpha = 0.71, .beta = 0.42, .motion_gain = 1.0};
        bst_tracking_loop *loop;
        bst_assert_ok(&ctx, bst_tracking_loop_create(&ctx, &timed, &servo, NULL, &observer, &loop));
        bst_loop open = bst_tracking_as_loop(loop);
        bst_loop_margins m;
        bst_assert_ok(&ctx, bst_loop_analyse(&ctx, &open, &m));
        assert_true(m.stable);
        assert_int_equal(m.unstable_closed, 0);
        double factor = pow(10.0, m.gain_margin_db / 20.0);
        bst_tracking_loop_free(loop);
        for (int side = -1; side <= 1; side += 2) {
            bst_tracking_observer wrong = observer;
            wrong.motion_gain = factor * (1.0 + 0.01 * side);
            assert_int_equal(diverges(&timed, &wrong), side > 0);
            /* the linear model says the same of that loop, and never counts below none */
            bst_assert_ok(&ctx,
                          bst_tracking_loop_create(&ctx, &timed, &servo, NULL, &wrong, &loop));
            open = bst_tracking_as_loop(loop);
            bst_loop_margins beyond;
            bst_assert_ok(&ctx, bst_loop_analyse(&ctx, &open, &beyond));
            assert_int_equal(beyond.unstable_closed > 0, side > 0);
            bst_tracking_loop_free(loop);
            wrong = observer;
            wrong.motion_late_s =
                DT * round(m.delay_margin_s * (1.0 + 0.02 * side) / DT) + DT * side;
            assert_int_equal(diverges(&timed, &wrong), side > 0);
        }
    }
}

static void test_variance(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_control_servo_response exact = {.delay_s = 0.0};
    /* alpha = 1, beta = 0 holds the latest fix: the error is d at the middle less the mean of the
     * exposure n frames before, n = 3 for an effect 0.25 to 0.35 s after the middle */
    const bst_tracking_observer hold = {1.0, 0.0, 1.0, 0.0};
    const bst_tracking_timing held = {0.1, 1e-9, 0.2, 0.25, 0.25};
    bst_tracking_loop *loop;
    bst_assert_ok(&ctx, bst_tracking_loop_create(&ctx, &held, &exact, NULL, &hold, &loop));
    /* |1 - exp(-j w 3 T)|^2 = 2 - 2 cos(w 3 T) over a flat band from 0 to f: 2 - 2 sinc */
    bst_tracking_band band = {0.0, 0.7, 5.0};
    double x = 2 * BST_PI * 0.7 * 0.3;
    bst_assert_close(bst_tracking_variance(loop, &band, 1), 5.0 * (2.0 - 2.0 * sin(x) / x), 1e-4);
    bst_tracking_band line = {0.5, 0.5, 2.0};
    bst_assert_close(bst_tracking_variance(loop, &line, 1), 4.0 - 4.0 * cos(0.3 * BST_PI), 1e-9);
    bst_assert_close(bst_tracking_noise_gain(loop), 1.0, 1e-9);
    bst_assert_close(bst_tracking_lag(loop), 0.3, 1e-6);
    bst_tracking_loop_free(loop);
}

static void test_observer_gains(void **state) {
    (void)state;
    /* Kalata: lambda^2 = q T^3 / s^2 = beta^2 / (1 - alpha) holds for piecewise constant
     * acceleration; for white acceleration the table of pointing_error.h */
    double alpha, beta;
    bst_tracking_observer_gains(1e-3, 0.05, 1.0, &alpha, &beta);
    bst_assert_close(alpha, 0.68, 0.005);
    bst_assert_close(beta, 0.36, 0.005);
    bst_tracking_observer_gains(1e-3, 0.1, 1.0, &alpha, &beta);
    bst_assert_close(alpha, 0.55, 0.005);
    bst_assert_close(beta, 0.21, 0.005);
}

/* An alpha-beta filter stepped frame by frame: its state after each measurement. */
typedef struct filter {
    double complex angle, rate;
} filter;

static void step_filter(filter *f, double alpha, double beta, double period, double complex z) {
    double complex ahead = f->angle + f->rate * period, miss = z - ahead;
    f->angle = ahead + alpha * miss;
    f->rate += beta / period * miss;
}

/* A mount that does at once what is asked, from the switch on: the error at any time is the
 * disturbance less what the newest frame in force says of then. A disturbance exp(i w t) through
 * the filter, stepped until it is steady; exposures average it by sin(x) / x, x half their phase.
 */
static void an_ideal_mount_leaves_what_the_filter_misses(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const double period = timing.period_s, alpha = 0.55, beta = 0.2;
    const bst_control_servo_response ideal = {.delay_s = 0.0};
    const bst_tracking_observer observer = {alpha, beta, 1.0, 0.0};
    const double switches[] = {0.03, 0.15}, offsets[] = {0.0, 0.022, 0.071, -0.034};
    for (int k = 0; k < 2; k++) {
        bst_tracking_timing when = timing;
        when.switch_s = switches[k];
        when.effect_s = switches[k] + 0.02;
        bst_tracking_loop *loop;
        bst_assert_ok(&ctx, bst_tracking_loop_create(&ctx, &when, &ideal, NULL, &observer, &loop));
        for (double hz = 0.3; hz < 5.0; hz += 0.9) {
            double w = 2.0 * BST_PI * hz, half = 0.5 * w * when.exposure_s;
            enum { FRAMES = 300 };
            static filter states[FRAMES];
            filter f = {0.0, 0.0};
            for (int j = 0; j < FRAMES; j++) {
                step_filter(&f, alpha, beta, period, sin(half) / half * cexp(I * w * j * period));
                states[j] = f;
            }
            for (int o = 0; o < 4; o++) {
                double t = (FRAMES - 2) * period + offsets[o];
                int j = (int)floor((t - when.switch_s) / period);
                double complex known = states[j].angle + states[j].rate * (t - j * period);
                double complex error =
                    (cexp(I * w * t) - known) / cexp(I * w * (FRAMES - 2) * period);
                double complex got = bst_tracking_rejection(loop, w, offsets[o]);
                bst_assert_close(creal(got), creal(error), 1e-9); /* rounding */
                bst_assert_close(cimag(got), cimag(error), 1e-9);
                double complex noise = bst_tracking_noise(loop, w, offsets[o]);
                double complex apart = (error - cexp(I * w * offsets[o])) * half / sin(half);
                bst_assert_close(creal(noise), creal(apart), 1e-9);
                bst_assert_close(cimag(noise), cimag(apart), 1e-9);
            }
        }
        /* white noise: the squares of the answer to one measurement of 1, at the middles to come */
        double sum = 0.0;
        filter f = {0.0, 0.0}, past[400];
        for (int j = 0; j < 400; j++) {
            step_filter(&f, alpha, beta, period, j == 0 ? 1.0 : 0.0);
            past[j] = f;
        }
        for (int n = 0; n < 390; n++) {
            int j = (int)floor((n * period - when.switch_s) / period);
            double e = j < 0 ? 0.0 : creal(past[j].angle + past[j].rate * (n - j) * period);
            sum += e * e;
        }
        bst_assert_close(bst_tracking_noise_gain(loop) / sum, 1.0, 1e-6); /* Parseval, midpoints */
        bst_tracking_loop_free(loop);
    }
}

/* Gains at rest by Kalman's equations in seconds and radians, for frames at other periods. */
static void gains_at_any_period(void **state) {
    (void)state;
    const double periods[] = {0.1, 0.5, 3.0};
    for (int k = 0; k < 3; k++) {
        const double dt = periods[k], q = 2e-13, r = 1e-12;
        double p[3] = {1e-9, 0.0, 1e-9}, gain[2] = {0.0}; /* angle, both, rate */
        for (int i = 0; i < 20000; i++) {
            double ee = p[0] + 2.0 * dt * p[1] + dt * dt * p[2] + q * dt * dt * dt / 3.0;
            double er = p[1] + dt * p[2] + q * dt * dt / 2.0, rr = p[2] + q * dt;
            gain[0] = ee / (ee + r);
            gain[1] = er / (ee + r);
            p[0] = ee - gain[0] * ee;
            p[1] = er - gain[0] * er;
            p[2] = rr - gain[1] * er;
        }
        double alpha, beta;
        bst_tracking_observer_gains(q, sqrt(r), dt, &alpha, &beta);
        bst_assert_close(alpha, gain[0], 1e-9); /* both have settled to rounding */
        bst_assert_close(beta, gain[1] * dt, 1e-9);
    }
}

/* A response of straight pieces is the same in samples four times as close: of means over any
 * stretch of time, from and to between samples. */
static void samples_as_close_as_wanted_give_the_same(void **state) {
    (void)state;
    enum { COARSE = 76, FINE = 4 * (COARSE - 1) + 1 };
    bst_ctx ctx = {0};
    double step[2][FINE], lag[2][FINE];
    for (int n = 0; n < COARSE; n++) {
        double t = 0.02 * n, left = n < COARSE - 2 ? exp(-5.0 * t) : 0.0;
        step[0][n] = 1.0 - left * cos(20.0 * t);
        lag[0][n] = left * sin(11.0 * t) / 11.0;
    }
    for (int n = 0; n < FINE; n++) {
        int k = n / 4 < COARSE - 1 ? n / 4 : COARSE - 2;
        double part = n / 4.0 - k;
        step[1][n] = step[0][k] + part * (step[0][k + 1] - step[0][k]);
        lag[1][n] = lag[0][k] + part * (lag[0][k + 1] - lag[0][k]);
    }
    const bst_tracking_timing odd = {0.1, 0.0613, 0.1337, 0.1871, 0.1529};
    const bst_tracking_observer observer = {0.5, 0.2, 1.03, 0.0017};
    const bst_compensator c = {
        .dt_s = 0.1, .stages = 1, .stage = {{.b0 = 0.4, .b1 = -0.3, .a1 = -1.0}}};
    for (int observes = 0; observes < 2; observes++) {
        bst_tracking_loop *loop[2];
        for (int fine = 0; fine < 2; fine++) {
            const bst_control_servo_response servo = {.dt_s = fine ? 0.005 : 0.02,
                                                      .count = fine ? FINE : COARSE,
                                                      .step = step[fine],
                                                      .ramp_lag = lag[fine]};
            bst_assert_ok(&ctx, bst_tracking_loop_create(&ctx, &odd, &servo, observes ? NULL : &c,
                                                         observes ? &observer : NULL, &loop[fine]));
        }
        for (int i = 0; i < 12; i++) {
            double w = 0.3 * pow(1.45, i), offset = -0.031 + 0.0061 * i;
            double complex of[2][3];
            for (int fine = 0; fine < 2; fine++) {
                of[fine][0] = bst_tracking_open(loop[fine], w);
                of[fine][1] = bst_tracking_rejection(loop[fine], w, offset);
                of[fine][2] = bst_tracking_noise(loop[fine], w, offset);
            }
            for (int k = 0; k < 3; k++) { /* rounding of sums over 300 samples */
                bst_assert_close(cabs(of[1][k] - of[0][k]), 0.0, 1e-11 * (1.0 + cabs(of[0][k])));
                assert_true(cabs(of[0][k]) > 1e-4);
            }
        }
        bst_tracking_loop_free(loop[0]);
        bst_tracking_loop_free(loop[1]);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(samples_as_close_as_wanted_give_the_same),
        cmocka_unit_test(an_ideal_mount_leaves_what_the_filter_misses),
        cmocka_unit_test(gains_at_any_period),
        cmocka_unit_test(test_rejection),
        cmocka_unit_test(test_margins),
        cmocka_unit_test(test_observer_margins),
        cmocka_unit_test(test_variance),
        cmocka_unit_test(test_observer_gains),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
