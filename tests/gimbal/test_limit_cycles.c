/* Limit cycles of a mount's servo, which its linear margins do not tell: saturation beyond the gain
 * margin against the describing function, hunting by stiction against its closed form, and what
 * does not hunt. */
#include "control/loop/stability.h"
#include "gimbal/mount/mount.h"
#include "tests/test_support.h"

#define DT 1e-3

static const bst_quat body_attitude = {0.18257418583505536, -0.3651483716701107, 0.5477225575051661,
                                       0.7302967433402214};

/* The outer axis alone: the inner one does not turn. */
static bst_mount_config outer_only(void) {
    bst_ctx ctx = {0};
    bst_mount_config c;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_mount_config_table, &c));
    c.encoder.resolution_arcsec = c.encoder.noise_arcsec = 0.0;
    c.friction.coulomb_nm[0] = c.friction.breakaway_nm[0] = c.friction.viscous_nms_per_rad[0] = 0.0;
    c.friction.coulomb_nm[1] = c.friction.breakaway_nm[1] = 1e6;
    c.cable.stiffness_nm_per_rad[0] = 0.0;
    c.rate_limit_degps[0] = 100.0;
    return c;
}

typedef struct cycle {
    double amplitude_rad, least_rad, most_rad, period_s; /* period 0: none */
} cycle;

/* Holds a direction `away` from where the axis starts, and looks at the last `watched_s`. */
static cycle hold(const bst_mount_config *config, double away_rad, double seconds,
                  double watched_s) {
    bst_ctx ctx = {0};
    static bst_mount m;
    bst_assert_ok(&ctx, bst_mount_init(&ctx, &m, BST_MOUNT_CROSS_ELEVATION, config, DT,
                                       (bst_rng_key){{1, 2}}));
    bst_vec3 aim = {sin(away_rad), 0.0, cos(away_rad)};
    bst_los_command command = {.direction_gcrf =
                                   bst_quat_rotate(bst_quat_conj(body_attitude), aim)};
    bst_mount_body body = {.q_believed_from_gcrf = body_attitude};
    double least = INFINITY, most = -INFINITY, first = 0.0, last = 0.0, before = 0.0;
    int crossings = 0;
    for (int n = 0; n < (int)(seconds / DT); n++) {
        bst_mount_step(&m, &body, &command, 0.0, false);
        double t = n * DT, off = m.joints.state.angle_rad[0] - away_rad;
        if (t < seconds - watched_s) {
            before = off;
            continue;
        }
        least = fmin(least, off);
        most = fmax(most, off);
        if (before < 0.0 && off >= 0.0) {
            double at = t - DT * off / (off - before);
            first = crossings == 0 ? at : first;
            last = at;
            crossings++;
        }
        before = off;
    }
    return (cycle){0.5 * (most - least), least, most,
                   crossings > 1 ? (last - first) / (crossings - 1) : 0.0};
}

static double complex servo_open(const void *user, double omega) {
    const bst_mount_axis_model *model = user;
    return bst_compensator_response(&model->compensator, omega) *
           bst_mount_linear_encoder(&model->linear, omega);
}

/* Gain (fundamental over amplitude) of a limit at `ratio` of the amplitude. */
static double saturation(double ratio) {
    return 2.0 / BST_PI * (asin(ratio) + ratio * sqrt(1.0 - ratio * ratio));
}

/* Gain raised beyond the margin: the loop swings at its phase crossover, so far that the motor's
 * limit leaves it just the gain of the margin. */
static void saturated_beyond_the_gain_margin(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const double beyond[] = {1.2, 1.5, 2.0};
    for (int i = 0; i < 3; i++) {
        bst_mount_config c = outer_only();
        c.motor_torque_nm[0] = 0.5;
        bst_mount_axis_model model;
        const double zero[BST_CHAIN_MOST] = {0.0};
        bst_assert_ok(&ctx, bst_mount_axis_model_init(&ctx, BST_MOUNT_CROSS_ELEVATION, &c, zero, DT,
                                                      0, &model));
        bst_loop loop = {.open = servo_open, .user = &model, .dt_s = DT};
        bst_loop_margins margins;
        bst_assert_ok(&ctx, bst_loop_analyse(&ctx, &loop, &margins));
        double margin = pow(10.0, margins.gain_margin_db / 20.0);
        c.servo.compensator.gain_scale = beyond[i] * margin;
        double low = 1e-6, high = 1.0;
        for (int k = 0; k < 60; k++) {
            double middle = 0.5 * (low + high);
            *(saturation(middle) < 1.0 / beyond[i] ? &low : &high) = middle;
        }
        double omega = 2.0 * BST_PI * margins.phase_crossover_hz;
        double drive = c.motor_torque_nm[0] / low * saturation(low) / model.linear.inertia_kgm2;
        double amplitude = drive * cabs(bst_mount_linear_encoder(&model.linear, omega));
        cycle found = hold(&c, 1e-5, 20.0, 5.0);
        print_message(
            "gain %.1f times the margin: %.4f arcsec at %.2f Hz, predicted %.4f at %.2f\n",
            beyond[i], found.amplitude_rad / BST_ARCSEC_RAD, 1.0 / found.period_s,
            amplitude / BST_ARCSEC_RAD, margins.phase_crossover_hz);
        /* the relay-like wave has harmonics, and the period is a small number of steps: measured
         * 2 % */
        bst_assert_close(found.amplitude_rad / amplitude, 1.0, 0.05);
        bst_assert_close(found.period_s * margins.phase_crossover_hz, 1.0, 0.03);
    }
}

/* A break-away torque that falls off at once: the integral pushes until the axis breaks away, which
 * jumps to the other side of its aim. With the drop D, the stiffness k of the servo and its damping
 * ratio z it jumps by D / k (1 + exp(-pi z / sqrt(1 - z^2))) and then sticks until the integral has
 * turned the torque round, the longer the nearer to the aim: how far that is on either side is the
 * start's doing. */
static void stiction_hunts(void **state) {
    (void)state;
    const double drops[] = {0.015, 0.02};
    for (int i = 0; i < 2; i++) {
        bst_mount_config c = outer_only();
        const double omega = 2.0 * BST_PI * 5.0, damping = 0.5, integral = 0.1;
        c.servo.compensator.proportional = omega * omega;
        c.servo.compensator.derivative_s = 2.0 * damping * omega;
        c.servo.compensator.integral_per_s = integral * omega * omega;
        c.servo.delay_steps = 0;
        c.friction.breakaway_nm[0] = 0.03;
        c.friction.coulomb_nm[0] = 0.03 - drops[i];
        c.friction.stribeck_degps[0] = 1e-5;
        bst_mount_axis_model model;
        bst_ctx ctx = {0};
        const double zero[BST_CHAIN_MOST] = {0.0};
        bst_assert_ok(&ctx, bst_mount_axis_model_init(&ctx, BST_MOUNT_CROSS_ELEVATION, &c, zero, DT,
                                                      0, &model));
        double stiff = model.linear.inertia_kgm2 * omega * omega;
        double root = sqrt(1.0 - damping * damping);
        double jump = drops[i] / stiff * (1.0 + exp(-BST_PI * damping / root));
        cycle found = hold(&c, 1e-4, 2000.0, 1000.0);
        double push = (2.0 * 0.03 - stiff * jump) / (integral * stiff); /* rad s */
        double period =
            push * (1.0 / found.most_rad - 1.0 / found.least_rad) + 2.0 * BST_PI / (omega * root);
        print_message("drop %g N m: jumps by %.3f arcsec in %.2f s, predicted %.3f in %.2f\n",
                      drops[i], 2.0 * found.amplitude_rad / BST_ARCSEC_RAD, found.period_s,
                      jump / BST_ARCSEC_RAD, period);
        /* what the integral adds during the jump is left out; measured 3 % and 6 % */
        bst_assert_close(2.0 * found.amplitude_rad / jump, 1.0, 0.1);
        bst_assert_close(found.period_s / period, 1.0, 0.1);
    }
}

/* The friction that mounts have by default falls off over 0.05 deg/s, far more than an axis that
 * breaks away reaches: it comes to rest, with encoders within a few of their steps. */
static void smooth_friction_comes_to_rest(void **state) {
    (void)state;
    for (int encoder = 0; encoder < 2; encoder++) {
        bst_ctx ctx = {0};
        bst_mount_config c;
        bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_mount_config_table, &c));
        if (!encoder) {
            c.encoder.resolution_arcsec = c.encoder.noise_arcsec = 0.0;
        }
        cycle found = hold(&c, 1e-4, 200.0, 60.0);
        print_message("default friction, encoders %s: within %.4f arcsec\n",
                      encoder ? "of 0.05 arcsec" : "exact", found.amplitude_rad / BST_ARCSEC_RAD);
        assert_true(found.amplitude_rad < (encoder ? 0.15 : 1e-3) * BST_ARCSEC_RAD);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(saturated_beyond_the_gain_margin),
                                       cmocka_unit_test(stiction_hunts),
                                       cmocka_unit_test(smooth_friction_comes_to_rest)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
