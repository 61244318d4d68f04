/* The two-axis plant: geometry, tracking, drift, keyhole, wrap, stops, knowledge errors. */
#include "gimbal/mount/second_order.h"
#include "tests/test_support.h"

#define DT 1e-3

static bst_mount_two_axis_config default_config(void) {
    bst_ctx ctx = {0};
    bst_mount_two_axis_config c;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_two_axis_config_table, &c));
    c.encoder_noise_arcsec = 0.0;
    return c;
}

static const bst_mount_two_axis_keys keys = {{{1, 2}}, {{3, 4}}, {{5, 6}}};

static void make(bst_mount_two_axis *plant, const bst_mount_two_axis_config *config,
                 bst_quat nominal) {
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_mount_two_axis_init(&ctx, plant, config, nominal, 3.0 * BST_ARCSEC_RAD,
                                                DT, &keys));
}

static bst_vec3 boresight(bst_quat q_cam_from_gcrf) {
    return bst_quat_rotate(bst_quat_conj(q_cam_from_gcrf), (bst_vec3){0, 0, 1});
}

static const bst_quat some_attitude = {0.18257418583505536, -0.3651483716701107, 0.5477225575051661,
                                       0.7302967433402214};

static void solve_and_attitude_agree(void **state) {
    (void)state;
    for (int i = 0; i < 200; i++) {
        double o = -3.1 + 0.031 * i, in = -1.55 + 0.0155 * i;
        double angle[2] = {o, in}, solved[2], rate[2];
        bst_vec3 b = boresight(bst_mount_two_axis_attitude(angle));
        /* the header's closed form */
        bst_assert_close(b.x, cos(in) * sin(o), 1e-15);
        bst_assert_close(b.y, -sin(in), 1e-15);
        bst_assert_close(b.z, cos(in) * cos(o), 1e-15);
        bst_vec3 db = {cos(in) * cos(o) * 0.3 - sin(in) * sin(o) * -0.2, -cos(in) * -0.2,
                       -cos(in) * sin(o) * 0.3 - sin(in) * cos(o) * -0.2};
        bst_mount_two_axis_solve(b, db, 0.0, solved, rate);
        double pole = 1.0 / cos(in); /* how the outer angle amplifies rounding */
        bst_assert_close(solved[0], o, 4e-16 * 4 * pole);
        bst_assert_close(solved[1], in, 1e-14 * pole);
        bst_assert_close(rate[0], 0.3, 1e-14 * pole * pole);
        bst_assert_close(rate[1], -0.2, 1e-14 * pole);
    }
}

/* Steps to t_end with a command; checks the axis limits at each step. */
static void run(bst_mount_two_axis *plant, const bst_los_command *command, double *t,
                double t_end) {
    double before[2] = {plant->axis[0].rate_radps, plant->axis[1].rate_radps};
    for (; *t < t_end - 0.5 * DT; *t += DT) {
        bst_mount_two_axis_step(plant, command, *t, true);
        for (int a = 0; a < 2; a++) {
            const bst_axis *axis = &plant->axis[a];
            assert_true(isfinite(axis->angle_rad) && isfinite(axis->rate_radps));
            assert_true(fabs(axis->rate_radps) <= axis->spec.rate_limit_radps * (1 + 1e-9));
            assert_true(fabs(axis->rate_radps - before[a]) <=
                        axis->spec.accel_limit_radps2 * DT * (1 + 1e-9));
            before[a] = axis->rate_radps;
        }
    }
}

static bst_los_command command_from(bst_quat q_body, bst_vec3 body, bst_vec3 rate_body) {
    bst_quat back = bst_quat_conj(q_body);
    return (bst_los_command){.tick = 0,
                             .direction_gcrf = bst_quat_rotate(back, bst_vec3_unit(body)),
                             .rate_gcrf_radps = bst_quat_rotate(back, rate_body)};
}

static void boresight_lands_on_the_commanded_direction(void **state) {
    (void)state;
    bst_mount_two_axis_config config = default_config();
    bst_vec3 rate = {200.0 * BST_ARCSEC_RAD, 100.0 * BST_ARCSEC_RAD, 0.0};
    bst_los_command c = command_from(some_attitude, (bst_vec3){0.02, -0.01, 1.0}, rate);
    bst_quat minus = {-some_attitude.x, -some_attitude.y, -some_attitude.z, -some_attitude.w};
    bst_mount_two_axis plant, antipodal;
    make(&plant, &config, some_attitude);
    make(&antipodal, &config, minus);
    double t = 0.0, t2 = 0.0;
    run(&plant, &c, &t, 5.0);
    run(&antipodal, &c, &t2, 5.0);
    bst_vec3 aim = bst_vec3_axpy(c.direction_gcrf, t - DT, c.rate_gcrf_radps);
    /* what is left is the angular acceleration of the axes over the shaper's gain */
    assert_true(bst_vec3_angle(boresight(plant.q_cam_from_gcrf), aim) < 1e-9);
    assert_true(bst_vec3_angle(boresight(plant.q_measured_from_gcrf), aim) < 1e-9);
    assert_true(plant.settled && !plant.limited);
    /* one attitude, two quaternions: the same to rounding */
    assert_true(bst_vec3_angle(boresight(plant.q_cam_from_gcrf),
                               boresight(antipodal.q_cam_from_gcrf)) < 1e-14);
}

static void no_command_holds_still(void **state) {
    (void)state;
    bst_mount_two_axis_config config = default_config();
    bst_mount_two_axis plant;
    make(&plant, &config, some_attitude);
    double t = 0.0;
    run(&plant, NULL, &t, 1.0);
    bst_vec3 z = boresight(some_attitude);
    assert_true(bst_vec3_angle(boresight(plant.q_cam_from_gcrf), z) < 1e-15);
    /* nothing was asked for: a controller must not take that for an arrival */
    assert_false(plant.settled);
}

/* Two encoders with noise of their own, which goes into the measured attitude. */
static void encoders_err_by_themselves(void **state) {
    (void)state;
    enum { STEPS = 20000 };
    bst_mount_two_axis_config config = default_config();
    config.encoder_noise_arcsec = 5.0;
    bst_mount_two_axis plant;
    make(&plant, &config, BST_QUAT_IDENTITY);
    const double angle[2] = {0.4, -0.7};
    const bst_los_command c = command_from(
        BST_QUAT_IDENTITY, boresight(bst_mount_two_axis_attitude(angle)), (bst_vec3){0, 0, 0});
    double mean[2] = {0.0}, second[3] = {0.0};
    for (int n = 0; n < STEPS; n++) {
        bst_mount_two_axis_step(&plant, &c, 0.0, true);
        double off[2];
        for (int i = 0; i < 2; i++) {
            off[i] =
                bst_wrap_angle(plant.encoder_rad[i] - plant.axis[i].angle_rad) / BST_ARCSEC_RAD;
            mean[i] += off[i] / STEPS;
        }
        second[0] += off[0] * off[0] / STEPS;
        second[1] += off[0] * off[1] / STEPS;
        second[2] += off[1] * off[1] / STEPS;
        const bst_vec3 seen = boresight(bst_mount_two_axis_attitude(plant.encoder_rad));
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(boresight(plant.q_measured_from_gcrf), seen)),
                         0.0, 1e-9); /* small angles: (5 arcsec)^2 */
    }
    for (int i = 0; i < 2; i++) { /* five sigma of 20,000 values */
        bst_assert_close(mean[i], 0.0, 5.0 * 5.0 / sqrt(STEPS));
        bst_assert_close(second[2 * i], 25.0, 25.0 * 5.0 * sqrt(2.0 / STEPS));
    }
    bst_assert_close(second[1], 0.0, 25.0 * 5.0 / sqrt(STEPS));
    bst_platform_free(&plant.platform);
}

/* Settled is what is near enough on the sky, in place and in motion, also far from the equator of
 * the outer axis and onto a direction that moves; by differences of the boresight's directions. */
static void settled_by_the_sky(void **state) {
    (void)state;
    static const double inner_deg[] = {0.0, 40.0, 75.0, -68.0};
    int counts[2] = {0}, fast = 0;
    for (int k = 0; k < 8; k++) {
        bst_mount_two_axis_config config = default_config();
        config.settle_tolerance_arcsec = 20.0;
        bst_mount_two_axis plant;
        make(&plant, &config, BST_QUAT_IDENTITY);
        const double tolerance = 20.0 * BST_ARCSEC_RAD,
                     slow = tolerance * plant.axis[0].spec.natural_frequency_radps;
        const double inner = inner_deg[k % 4] * BST_DEG_RAD, moves = k < 4 ? 0.0 : 3e-3;
        const double from[2] = {0.2, inner};
        double t = 0.0;
        bst_vec3 before = {0, 0, 0};
        for (int n = 0; n < 62000; n++, t += DT) {
            /* there by 40 s; then jumps of some tolerances every 4 s, and rates that turn back */
            const int late = n < 40000 ? 0 : n - 40000, turns = late / 2000;
            const double jump = late == 0 ? 0.0 : (turns / 2 % 2 ? 1 : -1) * 9 * tolerance;
            const double swing = late == 0 ? 0.0
                                           : (turns % 2 ? 2000 - late % 2000 : late % 2000) * 4e-6,
                         swings = late == 0   ? 0.0
                                  : turns % 2 ? -4e-3
                                              : 4e-3;
            const double angle[2] = {from[0] + moves * t + jump,
                                     from[1] - 0.3 * moves * t + 0.4 * jump + swing};
            const bst_vec3 to = boresight(bst_mount_two_axis_attitude(angle));
            const double next[2] = {angle[0] + moves * DT, angle[1] + (swings - 0.3 * moves) * DT};
            const bst_vec3 rate = bst_vec3_scale(
                bst_vec3_sub(boresight(bst_mount_two_axis_attitude(next)), to), 1.0 / DT);
            const bst_los_command c = command_from(BST_QUAT_IDENTITY, to, rate);
            bst_mount_two_axis_step(&plant, &c, 0.0, true);
            const bst_vec3 off = bst_vec3_sub(boresight(plant.q_cam_from_gcrf), to);
            const double far = bst_vec3_norm(off),
                         speed = bst_vec3_norm(bst_vec3_sub(off, before)) / DT;
            before = off;
            /* not at the edge, nor just after a jump: a step's difference is of its middle */
            const bool sure = fabs(far / tolerance - 1) > 0.05 && fabs(speed / slow - 1) > 0.1;
            if (n >= 40000 && n % 2000 > 2 && sure) {
                assert_int_equal(plant.settled, far < tolerance && speed < slow);
                counts[plant.settled]++;
                fast += far < tolerance && speed > slow;
            }
        }
    }
    assert_true(counts[0] > 500 && counts[1] > 500 && fast > 10);
}

static void drift_is_real_and_unknown(void **state) {
    (void)state;
    bst_mount_two_axis_config config = default_config();
    config.platform.drift_arcsec_per_s[0] = 3.0;
    config.platform.drift_arcsec_per_s[1] = -4.0;
    bst_mount_two_axis plant;
    make(&plant, &config, some_attitude);
    bst_los_command c = command_from(some_attitude, (bst_vec3){0, 0, 1}, (bst_vec3){0, 0, 0});
    double t = 0.0;
    run(&plant, &c, &t, 10.001);
    bst_vec3 z = boresight(some_attitude);
    /* the servo holds the believed place exactly, the true one has moved by 5 arcsec/s * 10 s */
    assert_true(bst_vec3_angle(boresight(plant.q_measured_from_gcrf), z) < 1e-14);
    bst_assert_close(bst_vec3_angle(boresight(plant.q_cam_from_gcrf), z) / BST_ARCSEC_RAD, 50.0,
                     1e-6);
    /* A body that turns by +x (right hand) carries its z axis towards -y; one that turns by -y
     * carries it towards -x. */
    bst_vec3 seen = bst_quat_rotate(some_attitude, boresight(plant.q_cam_from_gcrf));
    bst_assert_close(seen.y / BST_ARCSEC_RAD, -30.0, 1e-3);
    bst_assert_close(seen.x / BST_ARCSEC_RAD, -40.0, 1e-3);
}

static void bias_and_noise_are_errors_of_knowledge(void **state) {
    (void)state;
    bst_mount_two_axis_config config = default_config();
    config.platform.attitude_bias_arcsec[0] = 30.0;
    config.platform.attitude_noise_arcsec = 2.0;
    bst_mount_two_axis plant;
    make(&plant, &config, some_attitude);
    bst_los_command c = command_from(some_attitude, (bst_vec3){0.01, 0, 1}, (bst_vec3){0, 0, 0});
    double t = 0.0;
    run(&plant, &c, &t, 3.0);
    double off =
        bst_vec3_angle(boresight(plant.q_cam_from_gcrf), c.direction_gcrf) / BST_ARCSEC_RAD;
    bst_assert_close(off, 30.0, 0.01); /* the geometry at 0.6 deg from body z */
    double sum = 0.0;
    int count = 4000;
    for (int i = 0; i < count; i++) {
        bst_mount_two_axis_step(&plant, &c, 3.0, true);
        double e = bst_vec3_angle(boresight(plant.q_measured_from_gcrf), c.direction_gcrf);
        sum += e * e;
    }
    /* two axes of 2 arcsec; 8000 normal values give 0.8 %: four times that */
    bst_assert_close(sqrt(sum / count) / BST_ARCSEC_RAD, 2.0 * sqrt(2.0), 0.09);
}

static void keyhole_stays_finite_and_recovers(void **state) {
    (void)state;
    const double offset[] = {0.0, 1e-12, 1e-6, 1e-3};
    for (int i = 0; i < 4; i++) {
        bst_mount_two_axis_config config = default_config();
        bst_mount_two_axis plant;
        make(&plant, &config, some_attitude);
        /* along the meridian over the pole at body -y: 0.5 deg/s, passing it at t = 60 s */
        double rate = 0.5 * BST_DEG_RAD;
        double t = 0.0, worst_late = 0.0;
        for (; t < 200.0 - 0.5 * DT; t += 0.01) {
            double a = 30.0 * BST_DEG_RAD - rate * t;
            bst_vec3 b = {offset[i], -cos(a), sin(a)};
            bst_vec3 r = {0.0, -sin(a) * rate, -cos(a) * rate};
            bst_los_command c = command_from(some_attitude, b, r);
            for (int k = 0; k < 10; k++) {
                bst_mount_two_axis_step(&plant, &c, k * DT, false);
                assert_true(isfinite(plant.q_cam_from_gcrf.w));
                assert_true(fabs(plant.axis[0].rate_radps) <=
                            plant.axis[0].spec.rate_limit_radps * (1 + 1e-9));
            }
            if (t > 170.0) {
                worst_late = fmax(worst_late, bst_vec3_angle(boresight(plant.q_cam_from_gcrf),
                                                             bst_vec3_axpy(c.direction_gcrf, 9 * DT,
                                                                           c.rate_gcrf_radps)));
            }
        }
        /* 180 deg of outer axis at 2 deg/s take 95 s, during which the target goes on */
        assert_true(worst_late < 1e-8);
    }
}

static void outer_axis_goes_round_and_the_encoder_wraps(void **state) {
    (void)state;
    bst_mount_two_axis_config config = default_config();
    bst_mount_two_axis plant;
    make(&plant, &config, some_attitude);
    double rate = 1.5 * BST_DEG_RAD, worst = 0.0;
    int wraps = 0;
    double last = 0.0;
    for (int n = 0; n < 500000; n++) { /* 750 deg */
        double a = rate * n * DT;
        bst_los_command c =
            command_from(some_attitude, (bst_vec3){0.6 * sin(a), -0.8, 0.6 * cos(a)},
                         (bst_vec3){0.6 * cos(a) * rate, 0, -0.6 * sin(a) * rate});
        bst_mount_two_axis_step(&plant, &c, 0.0, true);
        assert_true(fabs(plant.encoder_rad[0]) <= BST_PI + 1e-9);
        wraps += fabs(plant.encoder_rad[0] - last) > BST_PI;
        last = plant.encoder_rad[0];
        if (n > 40000) { /* the 53 deg of the inner axis take 28 s */
            worst = fmax(worst,
                         bst_vec3_angle(boresight(plant.q_measured_from_gcrf), c.direction_gcrf));
        }
    }
    assert_int_equal(wraps, 2);
    assert_true(worst < 1e-8);
}

static void inner_stop_holds(void **state) {
    (void)state;
    bst_mount_two_axis_config config = default_config();
    config.inner_travel_deg = 5.0;
    bst_mount_two_axis plant;
    make(&plant, &config, some_attitude);
    bst_los_command c =
        command_from(some_attitude, (bst_vec3){0, -sin(0.2), cos(0.2)}, (bst_vec3){0, 0, 0});
    double t = 0.0;
    run(&plant, &c, &t, 8.0);
    bst_assert_close(plant.axis[1].angle_rad, 5.0 * BST_DEG_RAD, 1e-9);
    assert_true(plant.limited);
}

static void wrong_configurations_are_refused_with_what_to_do(void **state) {
    (void)state;
    bst_mount_two_axis_config config = default_config();
    bst_ctx ctx = {0};
    bst_mount_two_axis plant;
    config.platform.jitter_high_px_rms = 0.2;
    config.platform.jitter_high_band_hz[0] = config.platform.jitter_high_band_hz[1];
    assert_int_equal(
        bst_mount_two_axis_init(&ctx, &plant, &config, some_attitude, 1e-5, 0.01, &keys),
        BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "give the lower frequency first"));
    int64_t steps = 0;
    assert_int_equal(bst_platform_divider(&ctx, "nav_rate_hz", 1000.0, 300.0, &steps),
                     BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "333.333 and 250 Hz"));
    assert_int_equal(bst_platform_divider(&ctx, "nav_rate_hz", 1000.0, 0.1, &steps), BST_OK);
    assert_int_equal(steps, 10000);
}

static void rings_keep_the_newest(void **state) {
    (void)state;
    _Alignas(16) unsigned char room[sizeof(bst_los_history) + 3 * sizeof(bst_los_sample)] = {0};
    bst_los_history *h = (bst_los_history *)room;
    for (int i = 0; i < 8; i++) {
        bst_platform_append_los(h, 3, 10 * i, some_attitude);
    }
    assert_int_equal(h->written, 8);
    assert_int_equal(h->capacity, 3);
    assert_int_equal(h->items[(h->written - 1) % 3].tick, 70);
    assert_int_equal(h->items[(h->written - 3) % 3].tick, 50);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(solve_and_attitude_agree),
        cmocka_unit_test(boresight_lands_on_the_commanded_direction),
        cmocka_unit_test(no_command_holds_still),
        cmocka_unit_test(encoders_err_by_themselves),
        cmocka_unit_test(settled_by_the_sky),
        cmocka_unit_test(drift_is_real_and_unknown),
        cmocka_unit_test(bias_and_noise_are_errors_of_knowledge),
        cmocka_unit_test(keyhole_stays_finite_and_recovers),
        cmocka_unit_test(outer_axis_goes_round_and_the_encoder_wraps),
        cmocka_unit_test(inner_stop_holds),
        cmocka_unit_test(wrong_configurations_are_refused_with_what_to_do),
        cmocka_unit_test(rings_keep_the_newest),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
