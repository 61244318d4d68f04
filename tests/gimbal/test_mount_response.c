/* The linear model of a mount's axis against the plant itself: responses, and where the servo's
 * loop becomes unstable. */
#include "gimbal/mount/mount.h"
#include "tests/test_support.h"

#define DT 1e-3

/* No dry friction and no encoder steps; a flexible mode at 35 Hz; motors that never saturate. */
static bst_mount_config linear_config(void) {
    bst_ctx ctx = {0};
    bst_mount_config c;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_mount_config_table, &c));
    for (int k = 0; k < 3; k++) {
        c.friction.coulomb_nm[k] = c.friction.breakaway_nm[k] = 0.0;
        c.motor_torque_nm[k] = 1e9;
        c.accel_limit_degps2[k] = 1e5;
        c.rate_limit_degps[k] = 1000.0;
    }
    c.cable.stiffness_nm_per_rad[1] = 5.0;
    c.friction.viscous_nms_per_rad[1] = 0.4;
    c.flexible.frequency_hz[1] = 35.0;
    c.flexible.damping[1] = 0.02;
    c.flexible.line_of_sight_fraction[1] = 0.7;
    c.encoder.noise_arcsec = c.encoder.resolution_arcsec = 0.0;
    c.servo.delay_steps = 2;
    return c;
}

static const double level[3] = {0.0, 0.0, 0.0};

static bst_mount_axis_model model_of(const bst_mount_config *c, int axis) {
    bst_ctx ctx = {0};
    bst_mount_axis_model model;
    bst_assert_ok(&ctx, bst_mount_axis_model_init(&ctx, BST_MOUNT_CROSS_ELEVATION, c, level, DT,
                                                  axis, &model));
    return model;
}

/* The part of x[n] that goes as exp(i w n dt), over whole periods; x = Re(out exp(i w n dt)). */
typedef struct probe {
    double complex sum;
    int count;
} probe;

static void add(probe *p, double x, double omega, int n) {
    p->sum += 2.0 * x * cexp(-I * omega * n * DT);
    p->count++;
}

static void torque_to_encoder(void **state) {
    (void)state;
    bst_mount_config c = linear_config();
    bst_mount_axis_model model = model_of(&c, 1);
    model.linear.delay_steps = 0; /* the torque acts at once here */
    const double frequencies[] = {0.5, 5.0, 20.0, 34.0, 40.0, 100.0, 300.0};
    for (size_t i = 0; i < sizeof frequencies / sizeof *frequencies; i++) {
        double f = frequencies[i], omega = 2.0 * BST_PI * f;
        bst_mount_axis_gains gains;
        bst_mount_axis_response(&model, f, &gains);
        bst_ctx ctx = {0};
        static bst_mount m;
        bst_assert_ok(&ctx, bst_mount_init(&ctx, &m, BST_MOUNT_CROSS_ELEVATION, &c, DT,
                                           (bst_rng_key){{1, 2}}));
        m.joints.joint[0].stuck = true;
        probe p = {0.0, 0};
        double torque = 1e-3;
        for (int n = 0; n < 40000; n++) {
            if (n >= 30000) { /* transients of 1.5 s and 0.2 s are over; whole periods in 10 s */
                add(&p, m.joints.state.angle_rad[1], omega, n);
            }
            double push[3] = {0.0, torque * cos(omega * n * DT), 0.0};
            if (n == 0) {
                bst_mount_drive(&m, push, (bst_vec3){0, 0, 0}); /* step 0 only measures */
            }
            bst_mount_drive(&m, push, (bst_vec3){0, 0, 0});
        }
        double complex measured = p.sum / p.count / torque;
        /* rk4's (w dt)^5 / 120 a step of the mode, (0.25)^5 / 120, over its damping 0.004 a step:
         * 0.2 % near the mode */
        assert_true(cabs(measured / gains.plant - 1.0) < 0.003);
    }
}

/* The inner axis is commanded to swing; the line of sight answers. */
static void command_to_sight(void **state) {
    (void)state;
    bst_mount_config c = linear_config();
    bst_mount_axis_model model = model_of(&c, 1);
    const double frequencies[] = {0.5, 2.0, 5.0};
    for (size_t i = 0; i < 3; i++) {
        double f = frequencies[i], omega = 2.0 * BST_PI * f, swing = 1e-5;
        bst_mount_axis_gains gains;
        bst_mount_axis_response(&model, f, &gains);
        bst_ctx ctx = {0};
        static bst_mount m;
        bst_assert_ok(&ctx, bst_mount_init(&ctx, &m, BST_MOUNT_CROSS_ELEVATION, &c, DT,
                                           (bst_rng_key){{1, 2}}));
        bst_mount_body body = {.q_believed_from_gcrf = BST_QUAT_IDENTITY};
        probe p = {0.0, 0};
        for (int n = 0; n < 30000; n++) {
            /* boresight (0, -sin i, cos i), i = swing cos wt */
            double t = n * DT, x = swing * cos(omega * t), v = -swing * omega * sin(omega * t);
            bst_los_command k = {.direction_gcrf = {0, -sin(x), cos(x)},
                                 .rate_gcrf_radps = {0, -cos(x) * v, -sin(x) * v},
                                 .accel_gcrf_radps2 = {0, omega * omega * x, 0}};
            bst_mount_step(&m, &body, &k, 0.0, false);
            if (n >= 20000) {
                double y = 2.0 * asin(-m.q_cam_from_body.x);
                add(&p, y, omega, n);
            }
        }
        double complex measured = p.sum / p.count / swing;
        /* the shaper adds (w dt)^2 / 2 and what the acceleration changes in 3 ms, (3 w dt)^3 / 6 */
        assert_true(cabs(measured / gains.command - 1.0) < 0.005);
    }
}

/* Whether a push of the inner axis has grown after 20 s. */
static bool diverges(const bst_mount_config *c) {
    bst_ctx ctx = {0};
    static bst_mount m;
    bst_assert_ok(
        &ctx, bst_mount_init(&ctx, &m, BST_MOUNT_CROSS_ELEVATION, c, DT, (bst_rng_key){{1, 2}}));
    bst_mount_body body = {.q_believed_from_gcrf = BST_QUAT_IDENTITY};
    bst_los_command k = {.direction_gcrf = {0, 0, 1}};
    m.joints.state.rate_radps[1] = 1e-7;
    double early = 0.0, late = 0.0;
    for (int n = 0; n < 20000; n++) {
        bst_mount_step(&m, &body, &k, 0.0, false);
        double x = fabs(m.joints.state.angle_rad[1]);
        early = n < 2000 ? fmax(early, x) : early;
        late = n >= 18000 ? fmax(late, x) : late;
        if (x > 1e-3) {
            return true;
        }
    }
    return late > early;
}

/* Smallest gain factor above 1 and smallest delay that bring the open loop to -1. */
static void margins(const bst_mount_axis_model *model, double *gain, double *delay_s) {
    *gain = INFINITY;
    *delay_s = INFINITY;
    double complex before = 0.0;
    for (double f = 0.5; f < 499.0; f *= 1.0005) {
        bst_mount_axis_gains g;
        bst_mount_axis_response(model, f, &g);
        double complex l = g.compensator * g.plant;
        if (before != 0.0) {
            if (cimag(l) * cimag(before) < 0.0 && creal(l) < 0.0) {
                double factor = 1.0 / cabs(l);
                *gain = factor > 1.0 ? fmin(*gain, factor) : *gain;
            }
            if ((cabs(l) - 1.0) * (cabs(before) - 1.0) < 0.0) {
                double phase = carg(-l);
                phase = phase < 0.0 ? phase + 2.0 * BST_PI : phase;
                *delay_s = fmin(*delay_s, phase / (2.0 * BST_PI * f));
            }
        }
        before = l;
    }
}

static void the_servo_diverges_where_its_margins_end(void **state) {
    (void)state;
    for (int flexible = 0; flexible < 2; flexible++) {
        bst_mount_config c = linear_config();
        c.servo.compensator.crossover_hz = flexible ? 4.0 : 10.0;
        if (!flexible) {
            c.flexible.frequency_hz[1] = 0.0;
        }
        bst_mount_axis_model model = model_of(&c, 1);
        double gain, delay_s;
        margins(&model, &gain, &delay_s);
        assert_true(gain > 1.3 && gain < 20.0 && delay_s > 1e-3 && delay_s < 0.1);
        for (int side = -1; side <= 1; side += 2) {
            bst_mount_config beyond = c;
            beyond.servo.compensator.gain_scale = gain * (1.0 + 0.02 * side);
            assert_int_equal(diverges(&beyond), side > 0);
            beyond = c;
            beyond.servo.compensator.delay_s = delay_s * (1.0 + 0.02 * side);
            assert_int_equal(diverges(&beyond), side > 0);
        }
    }
}

/* Without a flexible mode in the line of sight: a torque on the axis passes the plant at once, and
 * the loop with its delay works against it. The share of the mode is that of the axis. */
static void torque_against_the_loop(void **state) {
    (void)state;
    bst_mount_config c = linear_config();
    c.flexible.line_of_sight_fraction[0] = 0.2;
    assert_true(model_of(&c, 1).linear.line_of_sight_fraction == 0.7);
    assert_true(model_of(&c, 0).linear.line_of_sight_fraction == 0.2);
    c.flexible.line_of_sight_fraction[1] = 0.0;
    c.servo.delay_steps = 5;
    bst_mount_axis_model late = model_of(&c, 1), prompt = late;
    prompt.linear.delay_steps = 0;
    for (double f = 0.5; f < 200.0; f *= 2.1) {
        bst_mount_axis_gains with, without;
        bst_mount_axis_response(&late, f, &with);
        bst_mount_axis_response(&prompt, f, &without);
        double complex delay = cexp(-I * 2.0 * BST_PI * f * 5.0 * DT);
        double complex expected = without.plant / (1.0 + with.compensator * without.plant * delay);
        assert_true(cabs(with.disturbance / expected - 1.0) < 1e-9);
        assert_true(cabs(with.plant / (without.plant * delay) - 1.0) < 1e-9);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(torque_to_encoder),
        cmocka_unit_test(command_to_sight),
        cmocka_unit_test(torque_against_the_loop),
        cmocka_unit_test(the_servo_diverges_where_its_margins_end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
