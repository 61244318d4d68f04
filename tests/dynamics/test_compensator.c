/* Compensators against the closed forms of their continuous and discrete responses. */
#include "boresight/compensator.h"
#include "boresight/vec.h"
#include "tests/archive_support.h"

/* Rounding of a few dozen operations on numbers near one. */
#define ROUNDING 1e-12

static bst_compensator_config plain(int type) {
    return (bst_compensator_config){.type = type, .feed_forward = 1.0, .gain_scale = 1.0};
}

static bst_compensator made(const bst_compensator_config *config, double dt_s) {
    bst_ctx ctx = {0};
    bst_compensator c;
    bst_assert_ok(&ctx, bst_compensator_init(&ctx, &c, config, dt_s, NULL, NULL));
    return c;
}

static void assert_close(double complex a, double complex b, double relative) {
    assert_true(cabs(a - b) <= relative * cabs(b));
}

static void test_tustin(void **state) {
    (void)state;
    /* 1 / (1 + s T): b0 = b1 = h / (2 T + h), a1 = (h - 2 T) / (h + 2 T) */
    double t = 0.3, h = 0.01;
    bst_dynamics_biquad q =
        bst_dynamics_biquad_tustin((double[]){1.0, 0.0, 0.0}, (double[]){1.0, t, 0.0}, h, 0.0);
    bst_assert_close(q.b0, h / (2 * t + h), ROUNDING);
    bst_assert_close(q.b1, h / (2 * t + h), ROUNDING);
    bst_assert_close(q.a1, (h - 2 * t) / (h + 2 * t), ROUNDING);
    assert_true(q.b2 == 0.0 && q.a2 == 0.0); /* no pole and zero at -1 that cancel */
    q = bst_dynamics_biquad_tustin((double[]){3.0, 0.0, 0.0}, (double[]){2.0, 0.0, 0.0}, h, 1.0);
    bst_assert_close(q.b0, 1.5, ROUNDING);
    assert_true(q.b1 == 0.0 && q.a1 == 0.0);
    /* at every frequency the discrete response is the continuous one at k tan(w h / 2) */
    const double num[3] = {2.0, 0.3, 0.01}, den[3] = {5.0, 0.2, 0.04};
    q = bst_dynamics_biquad_tustin(num, den, h, 12.0);
    double k = 2 * BST_PI * 12.0 / tan(BST_PI * 12.0 * h);
    for (double hz = 0.1; hz < 50.0; hz *= 1.7) {
        double complex s = I * k * tan(BST_PI * hz * h);
        double complex continuous =
            (num[0] + s * (num[1] + s * num[2])) / (den[0] + s * (den[1] + s * den[2]));
        assert_close(bst_dynamics_biquad_response(&q, 2 * BST_PI * hz * h), continuous, ROUNDING);
    }
    double complex s = I * 2 * BST_PI * 12.0; /* and exact where it was prewarped */
    assert_close(bst_dynamics_biquad_response(&q, 2 * BST_PI * 12.0 * h),
                 (num[0] + s * (num[1] + s * num[2])) / (den[0] + s * (den[1] + s * den[2])),
                 ROUNDING);
}

static void test_step_of_pi(void **state) {
    (void)state;
    /* trapezoidal integration: kp + ki h (n + 1/2) */
    bst_compensator_config config = plain(BST_COMPENSATOR_PI);
    config.proportional = 2.0;
    config.integral_per_s = 3.0;
    bst_compensator c = made(&config, 0.01);
    for (int n = 0; n < 1000; n++) {
        bst_assert_close(bst_compensator_step(&c, 1.0, 0.0), 2.0 + 0.03 * (n + 0.5), 1e-10);
    }
    assert_false(c.limited);
}

static void test_step_of_pid(void **state) {
    (void)state;
    /* kd s / (1 + s T) of a step, Tustin: 2 kd / (2 T + h) ((2 T - h) / (2 T + h))^n */
    bst_compensator_config config = plain(BST_COMPENSATOR_PID);
    config.proportional = 0.7;
    config.integral_per_s = 0.4;
    config.derivative_s = 0.2;
    config.derivative_filter_hz = 5.0;
    double h = 0.004, t = 1.0 / (2 * BST_PI * 5.0), d = 2 * 0.2 / (2 * t + h);
    bst_compensator c = made(&config, h);
    for (int n = 0; n < 500; n++) {
        double expected = 0.7 + 0.4 * h * (n + 0.5) + d * pow((2 * t - h) / (2 * t + h), n);
        bst_assert_close(bst_compensator_step(&c, 1.0, 0.0), expected, 1e-10);
    }
    config.integral_per_s = 0.0; /* without the integrator */
    c = made(&config, h);
    for (int n = 0; n < 500; n++) {
        double expected = 0.7 + d * pow((2 * t - h) / (2 * t + h), n);
        bst_assert_close(bst_compensator_step(&c, 1.0, 0.0), expected, 1e-10);
    }
}

/* Response measured by driving the step function with a sinusoid for whole periods once it has
 * settled. */
static double complex measured(bst_compensator *c, int period, int settle) {
    double complex sum = 0.0;
    for (int n = 0; n < settle + 4 * period; n++) {
        double angle = 2 * BST_PI * n / period;
        double y = bst_compensator_step(c, cos(angle), 0.0);
        sum += n >= settle ? 0.5 / period * y * cexp(-I * angle) : 0.0;
    }
    return sum;
}

static void test_response(void **state) {
    (void)state;
    bst_dynamics_notch_config notches[2] = {{40.0, 0.0, 30.0}, {100.0, 20.0, 60.0}};
    bst_compensator_config config = plain(BST_COMPENSATOR_LEAD_LAG);
    config.gain = 3.0;
    config.lead_zero_hz = 4.0;
    config.lead_pole_hz = 40.0;
    config.lag_zero_hz = 1.0;
    config.lag_pole_hz = 0.2;
    config.notches = (bst_config_list){notches, 2};
    config.low_pass_hz = 120.0;
    config.prewarp_hz = 10.0;
    config.delay_s = 0.0025; /* two samples and a half */
    config.gain_scale = 2.0;
    double h = 1e-3;
    bst_compensator c = made(&config, h);
    assert_int_equal(c.stages, 4);
    for (int period = 2000; period >= 5; period /= 5) {
        bst_compensator fresh = c;
        double w = 2 * BST_PI / period;
        /* 4 s: the slowest pole, 0.2 Hz, has decayed to 0.7 % of a transient of 1e-3 */
        double complex m = measured(&fresh, period, 20000);
        assert_close(m, bst_compensator_response(&c, w / h), 1e-9);
        /* and the response is the product of the analytic ones */
        double complex z1 = cexp(-I * w), expected = 0.5 * (cpow(z1, 2) + cpow(z1, 3));
        double at[4] = {40.0, 100.0, 120.0, 10.0}, complex_s[4];
        for (int i = 0; i < 4; i++) {
            complex_s[i] = 2 * BST_PI * at[i] / tan(BST_PI * at[i] * h) * tan(0.5 * w);
        }
        double tau = 2 * BST_PI;
        double complex s = I * complex_s[0];
        expected *= (s * s + pow(10, -1.5) * tau * 40 * s + pow(tau * 40, 2)) /
                    (s * s + tau * 40 * s + pow(tau * 40, 2));
        s = I * complex_s[1];
        expected *= (s * s + 1e-3 * tau * 20 * s + pow(tau * 100, 2)) /
                    (s * s + tau * 20 * s + pow(tau * 100, 2));
        s = I * complex_s[2];
        expected *= pow(tau * 120, 2) / (s * s + sqrt(2) * tau * 120 * s + pow(tau * 120, 2));
        s = I * complex_s[3];
        expected *= 6.0 * (1 + s / (tau * 4)) / (1 + s / (tau * 40)) * (s + tau) / (s + tau * 0.2);
        assert_close(bst_compensator_response(&c, w / h), expected, 1e-9);
    }
    /* at the notch, its depth; PSD of double rounding aside */
    bst_compensator_config only = plain(BST_COMPENSATOR_PI);
    only.proportional = 1.0;
    only.notches = (bst_config_list){notches, 1};
    c = made(&only, h);
    bst_assert_close(cabs(bst_compensator_response(&c, 2 * BST_PI * 40.0)), pow(10, -1.5), 1e-9);
    bst_assert_close(cabs(bst_compensator_response(&c, 0.0)), 1.0, 1e-9);
}

static void test_anti_windup(void **state) {
    (void)state;
    bst_compensator_config config = plain(BST_COMPENSATOR_PI);
    config.proportional = 2.0;
    config.integral_per_s = 5.0;
    config.output_limit = 4.0;
    double h = 0.01;
    bst_compensator c = made(&config, h);
    for (int n = 0; n < 5000; n++) { /* 50 s at the limit: without anti-windup I would be 250 */
        assert_true(bst_compensator_step(&c, 1.0, 0.0) <= 4.0);
    }
    assert_true(c.limited);
    /* at rest against the limit the unlimited output is kp e above it (time constant kp / ki), so
     * that after a reversal it is limit - kp e - ki h e */
    bst_assert_close(bst_compensator_step(&c, -1.0, 0.0), 4.0 - 2.0 - 0.05, 1e-9);
    assert_false(c.limited);

    /* a pure integrator follows at once: it leaves the limit with the first step back */
    config.proportional = 0.0;
    c = made(&config, h);
    for (int n = 0; n < 5000; n++) {
        bst_compensator_step(&c, 1.0, 0.0);
    }
    double first = bst_compensator_step(&c, -1.0, 0.0);
    assert_true(first <= 4.0 && bst_compensator_step(&c, -1.0, 0.0) < 4.0);

    /* pid: bounded overshoot of the unlimited output however long the limit holds */
    config = plain(BST_COMPENSATOR_PID);
    config.proportional = 2.0;
    config.integral_per_s = 5.0;
    config.derivative_s = 0.1;
    config.derivative_filter_hz = 10.0;
    config.output_limit = 4.0;
    c = made(&config, h);
    for (int n = 0; n < 5000; n++) {
        bst_compensator_step(&c, 1.0, 0.0);
    }
    int steps = 0;
    while (bst_compensator_step(&c, -1.0, 0.0) >= 4.0) {
        steps++;
    }
    assert_true(steps < 2);
    /* the feed-forward counts towards the limit */
    config = plain(BST_COMPENSATOR_PI);
    config.integral_per_s = 5.0;
    config.proportional = 1.0;
    config.output_limit = 4.0;
    config.feed_forward = 0.5;
    c = made(&config, h);
    bst_assert_close(bst_compensator_step(&c, 0.0, 3.0), 1.5, ROUNDING);
    bst_assert_close(bst_compensator_step(&c, 0.0, 30.0), 4.0, ROUNDING);
}

/* By default the excess over the limit moves the state with the time constant of the zero: 1 / (2
 * pi f) of a lag, kp / ki of pi, sqrt(kd / ki) of pid; anti_windup_s replaces it. Under a small
 * error the state then rests at 1 / back of an error's step above the limit (Astrom and Hagglund
 * 2006, PID control, section 3.5). */
static void test_tracking_time(void **state) {
    (void)state;
    const double h = 1e-3;
    for (int k = 0; k < 8; k++) {
        bst_compensator_config config = plain(k % 4 == 0   ? BST_COMPENSATOR_LEAD_LAG
                                              : k % 4 == 1 ? BST_COMPENSATOR_PI
                                                           : BST_COMPENSATOR_PID);
        config.gain = config.proportional = 3.0;
        config.lag_zero_hz = 0.8;
        config.integral_per_s = 5.0;
        config.derivative_s = 0.4;
        config.derivative_filter_hz =
            1e3 / BST_PI; /* its pole is at 0: all of the excess is fed back to one pole */
        config.output_limit = 2.0;
        config.anti_windup_s = k < 4 ? 0.0 : 0.13;
        const double times[4] = {1.0 / (2 * BST_PI * 0.8), 3.0 / 5.0, sqrt(0.4 / 5.0),
                                 sqrt(0.4 / 5.0)};
        bst_compensator c = made(&config, h);
        bst_assert_close(c.back, (k < 4 ? h / times[k] : h / 0.13) * (1.0 - c.stage[0].a2), 1e-12);
        bst_assert_close(c.stage[0].a2, 0.0, 1e-12);
    }
}

static void test_rate_limit(void **state) {
    (void)state;
    bst_compensator_config config = plain(BST_COMPENSATOR_PI);
    config.proportional = 1.0;
    config.output_rate_limit_per_s = 2.0;
    double h = 0.01;
    bst_compensator c = made(&config, h);
    double before = 0.0;
    for (int n = 0; n < 100; n++) {
        double u = bst_compensator_step(&c, n < 50 ? 10.0 : -10.0, 0.0);
        bst_assert_close(fabs(u - before), 0.02, ROUNDING);
        assert_true(c.limited);
        before = u;
    }
}

static void test_bumpless(void **state) {
    (void)state;
    bst_dynamics_notch_config notch = {20.0, 0.0, 30.0};
    bst_compensator_config config = plain(BST_COMPENSATOR_PID);
    config.proportional = 2.0;
    config.integral_per_s = 5.0;
    config.derivative_s = 0.05;
    config.notches = (bst_config_list){&notch, 1};
    double h = 0.01;
    bst_compensator c = made(&config, h);
    for (int n = 0; n < 37; n++) {
        bst_compensator_step(&c, sin(n), 0.3);
    }
    bst_compensator_set(&c, 0.1, 0.3, -7.0);
    for (int n = 0; n < 10; n++) {
        /* from there on only the integral moves */
        bst_assert_close(bst_compensator_step(&c, 0.1, 0.3), -7.0 + 5.0 * 0.1 * h * n, 1e-10);
    }
    config.output_limit = 3.0;
    config.delay_s = 0.035;
    c = made(&config, h);
    bst_compensator_set(&c, 0.0, 0.0, -7.0);
    for (int n = 0; n < 10; n++) {
        bst_assert_close(bst_compensator_step(&c, 0.0, 0.0), -3.0, 1e-10);
    }
}

static void test_delay(void **state) {
    (void)state;
    bst_compensator_config config = plain(BST_COMPENSATOR_PI);
    config.proportional = 1.0;
    config.delay_s = 0.0325;
    bst_compensator c = made(&config, 0.01);
    for (int n = 0; n < 20; n++) {
        double expected = n < 3 ? 0.0 : n == 3 ? 0.75 : 1.0;
        bst_assert_close(bst_compensator_step(&c, 1.0, 0.0), expected, 1e-9);
    }
}

static void test_limits(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_compensator c;
    bst_compensator_config config = plain(BST_COMPENSATOR_PID);
    c = made(&config, 0.01); /* no gains at all */
    bst_assert_close(bst_compensator_step(&c, 1e6, 0.25), 0.25, 0.0);
    assert_true(bst_compensator_response(&c, 1.0) == 0.0);

    config.proportional = 1e308;
    config.integral_per_s = 1e308;
    config.gain_scale = 1e6;
    assert_int_equal(bst_compensator_init(&ctx, &c, &config, 0.01, NULL, NULL), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "not finite"));

    config = plain(BST_COMPENSATOR_PI);
    bst_dynamics_notch_config notch = {50.0, 0.0, 30.0};
    config.notches = (bst_config_list){&notch, 1};
    assert_int_equal(bst_compensator_init(&ctx, &c, &config, 0.01, NULL, NULL), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "half of the compensator's rate of 100 Hz"));
    notch.frequency_hz = 49.999; /* just below: still a notch */
    c = made(&config, 0.01);
    config.proportional = 1.0;
    c = made(&config, 0.01);
    bst_assert_close(cabs(bst_compensator_response(&c, 2 * BST_PI * 49.999)), pow(10, -1.5), 1e-6);

    config = plain(BST_COMPENSATOR_PI);
    config.delay_s = 20.0;
    assert_int_equal(bst_compensator_init(&ctx, &c, &config, 0.01, NULL, NULL), BST_ERR_CONFIG);
    config.delay_s = 0.0;
    config.bandwidth_hz = 1.0;
    assert_int_equal(bst_compensator_init(&ctx, &c, &config, 0.01, NULL, NULL), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "give gains"));
    config.type = BST_COMPENSATOR_TYPE_COUNT;
    assert_int_equal(bst_compensator_init(&ctx, &c, &config, 0.01, NULL, NULL), BST_ERR_CONFIG);
}

static void test_config(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_compensator_config config;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_compensator_config_table, &config));
    assert_int_equal(config.type, BST_COMPENSATOR_PID);
    const char *text =
        "{\"type\": \"lead_lag\", \"gain\": 2, \"lead_zero_hz\": 1, \"lead_pole_hz\": 9,"
        "\"notches\": [{\"frequency_hz\": 12}, {\"frequency_hz\": 30, \"depth_db\": 20}]}";
    bst_json *json;
    bst_assert_ok(&ctx, bst_json_parse(&ctx, "test", text, strlen(text), &json));
    bst_assert_ok(&ctx, bst_config_read(&ctx, json, bst_json_root(json), "",
                                        bst_compensator_config_table, &config));
    bst_compensator c = made(&config, 1e-3);
    assert_int_equal(c.stages, 3);
    bst_assert_close(creal(bst_compensator_response(&c, 0.0)), 2.0, 1e-9);
    bst_config_free(bst_compensator_config_table, &config);
    bst_json_free(json);
}

/* A plug-in's: an integrator of gain 2 that remembers its last error. */
typedef struct summed {
    double sum, last, dt_s;
} summed;

static bst_status summed_init(bst_ctx *ctx, const void *config, double dt_s, void *state) {
    if (*(const double *)config < 0.0) {
        return bst_fail(ctx, BST_ERR_CONFIG, "a gain below zero");
    }
    *(summed *)state = (summed){.dt_s = dt_s};
    return BST_OK;
}
static double summed_step(void *state, double error) {
    summed *s = state;
    s->last = error;
    return s->sum += 2.0 * s->dt_s * error;
}
static void summed_set(void *state, double error, double output) {
    ((summed *)state)->sum = output;
    ((summed *)state)->last = error;
}
static double complex summed_response(const void *state, double omega_per_sample) {
    (void)state;
    return 3.0 + I * omega_per_sample;
}

static void test_plug(void **state) {
    (void)state;
    bst_compensator_stage stage = {.state_bytes = sizeof(summed),
                                   .init = summed_init,
                                   .step = summed_step,
                                   .set = summed_set,
                                   .response = summed_response};
    const bst_stage_desc desc = {.type = "summed", .functions = &stage};
    double gain = 1.0;
    bst_compensator_config config = plain(BST_COMPENSATOR_PI);
    config.plug = (bst_stage_use){.plugin = "lib.so", .desc = &desc, .config = &gain};
    assert_true(bst_compensator_is_linear(&config));
    bst_compensator c = made(&config, 0.25);
    /* 2 * 0.25 * 3, then the same again, and the feed-forward on top */
    bst_assert_close(bst_compensator_step(&c, 3.0, 0.0), 1.5, ROUNDING);
    bst_assert_close(bst_compensator_step(&c, 3.0, 10.0), 13.0, ROUNDING);
    assert_false(c.limited);
    c.limit = 4.0;
    bst_assert_close(bst_compensator_step(&c, -1.0, 10.0), 4.0, ROUNDING); /* 2.5 + 10 */
    assert_true(c.limited);
    bst_assert_close(bst_compensator_step(&c, -1.0, -10.0), -4.0, ROUNDING);
    /* to an output of -9, which is more than it may give: 3 less than the feed-forward of -1 */
    bst_compensator_set(&c, 7.0, -1.0, -9.0);
    bst_assert_close(((const summed *)(const void *)c.plug_state)->sum, -3.0, ROUNDING);
    bst_assert_close(((const summed *)(const void *)c.plug_state)->last, 7.0, ROUNDING);
    bst_assert_close(c.output, -4.0, ROUNDING);
    assert_false(c.limited);
    /* at 8 rad/s and a sample of 0.25 s: 2 rad */
    assert_close(bst_compensator_response(&c, 8.0), 3.0 + 2.0 * I, ROUNDING);
    stage.set = NULL;
    bst_compensator_set(&c, 1.0, 0.0, 2.0);
    bst_assert_close(((const summed *)(const void *)c.plug_state)->sum, -3.0, ROUNDING);
    bst_assert_close(c.output, 2.0, ROUNDING);
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_compensator_plug_status(&ctx, &c));
    ((summed *)(void *)c.plug_state)->sum = (double)INFINITY;
    bst_assert_close(bst_compensator_step(&c, 1.0, -3.0), -3.0, ROUNDING);
    assert_int_equal(bst_compensator_plug_status(&ctx, &c), BST_ERR_STATE);
    assert_string_equal(ctx.message,
                        "plug-in lib.so: its compensator gave an output that is not finite");
    stage.response = NULL;
    assert_false(bst_compensator_is_linear(&config));
    assert_true(isnan(creal(bst_compensator_response(&c, 8.0))));
    gain = -1.0;
    assert_int_equal(bst_compensator_init(&ctx, &c, &config, 0.25, NULL, NULL), BST_ERR_CONFIG);
    assert_string_equal(ctx.message, "plug-in lib.so: a gain below zero");
    gain = 1.0;
    stage.state_bytes = BST_COMPENSATOR_STATE_BYTES;
    bst_assert_ok(&ctx, bst_compensator_init(&ctx, &c, &config, 0.25, NULL, NULL));
    stage.state_bytes++;
    assert_int_equal(bst_compensator_init(&ctx, &c, &config, 0.25, NULL, NULL), BST_ERR_CONFIG);
    stage.state_bytes = 8;
    stage.step = NULL;
    assert_int_equal(bst_compensator_init(&ctx, &c, &config, 0.25, NULL, NULL), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "lacks init or step"));
}

static bst_status archive_compensator(void *c, bst_archive *archive) {
    return bst_compensator_archive(c, archive);
}

/* Restores `from` into a new compensator, and compares their outputs from then on. */
static void expect_copy(const bst_compensator_config *config, bst_compensator *from) {
    bst_ctx ctx = {0};
    bst_compensator to = made(config, 0.01);
    for (int n = 0; n < 9; n++) { /* a state of its own, which the restored one replaces */
        (void)bst_compensator_step(&to, 5.0 - n, 0.3);
    }
    test_saved saved = test_save(archive_compensator, from);
    bst_assert_ok(&ctx, test_restore(&ctx, archive_compensator, &to, saved));
    assert_true(to.limited == from->limited && to.output == from->output);
    bst_compensator other = *from;
    for (int n = 0; n < 3000; n++) {
        double error = sin(0.1 * n) + 0.02 * (n % 7), feed = 0.1 * cos(0.3 * n);
        assert_true(bst_compensator_step(&other, error, feed) ==
                    bst_compensator_step(&to, error, feed));
        assert_true(other.limited == to.limited);
    }
    test_restore_damaged(archive_compensator, &to, saved, 1);
    for (int n = 0; n < 50; n++) { /* restored once more by the line above */
        assert_true(bst_compensator_step(from, 1.0, 0.5) == bst_compensator_step(&to, 1.0, 0.5));
    }
    free(saved.bytes);
}

/* All types with filters, limits and a delay between samples, saved in the middle of a limit. */
static void test_archive(void **state) {
    (void)state;
    bst_dynamics_notch_config notches[] = {{3.0, 1.0, 20.0}, {11.0, 2.0, 40.0}};
    for (int type = 0; type < BST_COMPENSATOR_TYPE_COUNT; type++) {
        for (int steps = 0; steps < 200; steps += 37) {
            bst_compensator_config config = plain(type);
            config.proportional = config.gain = 2.0;
            config.integral_per_s = 3.0;
            config.derivative_s = 0.02;
            config.lag_zero_hz = 0.1;
            config.low_pass_hz = 20.0;
            config.notches = (bst_config_list){notches, 2};
            config.output_limit = 1.5;
            config.output_rate_limit_per_s = 30.0;
            config.delay_s = steps % 2 ? 0.0 : 0.127;
            bst_compensator c = made(&config, 0.01);
            for (int n = 0; n < steps; n++) {
                (void)bst_compensator_step(&c, sin(0.2 * n) + 0.1, 0.01 * n);
            }
            c.limit = steps % 3 ? c.limit : 1.1; /* as a mount's servo changes it */
            expect_copy(&config, &c);
        }
    }
}

static bst_status summed_archive(void *state, bst_archive *archive) {
    summed *s = state;
    BST_ARCHIVE(archive, s->sum);
    BST_ARCHIVE(archive, s->last);
    return BST_OK;
}

static void test_archive_of_a_plug(void **state) {
    (void)state;
    bst_compensator_stage stage = {.state_bytes = sizeof(summed),
                                   .init = summed_init,
                                   .step = summed_step,
                                   .archive = summed_archive};
    const bst_stage_desc desc = {.type = "summed", .functions = &stage};
    double gain = 1.0;
    bst_compensator_config config = plain(BST_COMPENSATOR_PI);
    config.plug = (bst_stage_use){.plugin = "lib.so", .desc = &desc, .config = &gain};
    bst_compensator c = made(&config, 0.01);
    (void)bst_compensator_step(&c, 3.0, 0.5);
    expect_copy(&config, &c);
    /* that it has failed is not forgotten */
    bst_ctx ctx = {0};
    c.plug_failed = true;
    test_saved saved = test_save(archive_compensator, &c);
    c = made(&config, 0.01);
    bst_assert_ok(&ctx, test_restore(&ctx, archive_compensator, &c, saved));
    assert_int_equal(bst_compensator_plug_status(&ctx, &c), BST_ERR_STATE);
    free(saved.bytes);
    stage.archive = NULL;
    bst_archive *archive;
    bst_assert_ok(&ctx, bst_archive_create(&ctx, &archive));
    bst_assert_ok(&ctx, bst_archive_begin(&ctx, archive, "it"));
    assert_int_equal(bst_compensator_archive(&c, archive), BST_ERR_STATE);
    assert_string_equal(ctx.message,
                        "plug-in lib.so: the state of its compensator cannot be saved: it has no "
                        "function `archive`");
    bst_archive_free(archive);
}

/* Each key by itself, at the border of what is allowed and beyond it; 100 samples a second. */
static void test_refusals(void **state) {
    (void)state;
    enum { KEYS = 8 };
    static const char *const words[KEYS] = {"bandwidth_hz: 50 Hz is not below half",
                                            "crossover_hz: 50 Hz is not below half",
                                            "prewarp_hz: 50 Hz is not below half",
                                            "low_pass_hz: 50 Hz is not below half",
                                            "notches/frequency_hz: 50 Hz is not below half",
                                            "lead_pole_hz: a lead with its zero at 4 Hz",
                                            "delay_s: ",
                                            "are not finite"};
    for (int key = 0; key < KEYS; key++) {
        for (int beyond = 0; beyond < 2; beyond++) {
            bst_ctx ctx = {0};
            bst_compensator c;
            double hz = beyond ? 50.0 : 49.9;
            bst_dynamics_notch_config notch = {hz, 1.0, 30.0};
            bst_compensator_config config =
                plain(key == 5 ? BST_COMPENSATOR_LEAD_LAG : BST_COMPENSATOR_PI);
            config.proportional = config.gain = 1.0;
            if (key < 2 && !beyond) {
                continue; /* a design of its own */
            }
            *(key == 0   ? &config.bandwidth_hz
              : key == 1 ? &config.crossover_hz
              : key == 2 ? &config.prewarp_hz
                         : &config.low_pass_hz) = key < 4 ? hz : 0.0;
            config.notches = (bst_config_list){&notch, key == 4};
            config.lead_zero_hz = key == 5 ? 4.0 : 0.0;
            config.lead_pole_hz = key == 5 && !beyond ? 8.0 : 0.0;
            config.delay_s = key == 6 ? 0.01 * (BST_COMPENSATOR_DELAY - 2 + 0.5 * beyond) : 0.0;
            config.gain_scale = key == 7 && beyond ? INFINITY : 1.0;
            assert_int_equal(bst_compensator_init(&ctx, &c, &config, 0.01, NULL, NULL),
                             beyond ? BST_ERR_CONFIG : BST_OK);
            if (beyond && !strstr(ctx.message, words[key])) {
                fail_msg("%s", ctx.message);
            }
        }
    }
    bst_ctx ctx = {0};
    bst_compensator c;
    bst_compensator_config config = plain(BST_COMPENSATOR_TYPE_COUNT);
    assert_int_equal(bst_compensator_init(&ctx, &c, &config, 0.01, NULL, NULL), BST_ERR_CONFIG);
    /* a specification needs a plant, and no gain of any kind beside it */
    config = plain(BST_COMPENSATOR_PI);
    config.bandwidth_hz = 1.0;
    assert_int_equal(bst_compensator_init(&ctx, &c, &config, 0.01, NULL, NULL), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "cannot be used here"));
    for (int gain = 0; gain < 4; gain++) {
        bst_compensator_config both = config;
        *(gain == 0   ? &both.proportional
          : gain == 1 ? &both.integral_per_s
          : gain == 2 ? &both.derivative_s
                      : &both.gain) = 0.1;
        assert_int_equal(bst_compensator_init(&ctx, &c, &both, 0.01, NULL, NULL), BST_ERR_CONFIG);
        assert_non_null(strstr(ctx.message, "both gains and a specification"));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_tustin),
        cmocka_unit_test(test_step_of_pi),
        cmocka_unit_test(test_step_of_pid),
        cmocka_unit_test(test_response),
        cmocka_unit_test(test_anti_windup),
        cmocka_unit_test(test_tracking_time),
        cmocka_unit_test(test_rate_limit),
        cmocka_unit_test(test_bumpless),
        cmocka_unit_test(test_delay),
        cmocka_unit_test(test_limits),
        cmocka_unit_test(test_config),
        cmocka_unit_test(test_plug),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_archive),
        cmocka_unit_test(test_archive_of_a_plug),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
