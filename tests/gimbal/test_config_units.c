/* Mounts, attitude controller and sensors in the units of their keys: degrees, arcseconds, hertz
 * and hours of the configuration against SI within, each number another one; mounts at their pole.
 */
#include "boresight/vec.h"
#include "gimbal/mount/mount.h"
#include "gimbal/mount/second_order.h"
#include "gimbal/spacecraft/spacecraft_config.h"
#include "gimbal/spacecraft/spacecraft_control.h"
#include "tests/test_support.h"

/* pi / 180 and pi / 648000; tolerances are rounding */
static const double deg = 3.14159265358979324 / 180, arcsec = 3.14159265358979324 / 648000;

#define EXPECT(found, wanted) bst_assert_close(found, wanted, 1e-12 * fabs(wanted))

static void a_chain_of_three_axes(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_mount_config c;
    bst_mount m;
    bst_mount_status s;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_mount_config_table, &c));
    c.third_axis = true;
    c.encoder.resolution_arcsec = 0.6;
    c.encoder.noise_arcsec = 0.35;
    c.servo.settle_tolerance_arcsec = 2.5;
    for (int k = 0; k < 3; k++) {
        c.rate_limit_degps[k] = 2 + k;
        c.accel_limit_degps2[k] = 5.5 + k;
        c.travel_min_deg[k] = -100 - 20 * k;
        c.travel_max_deg[k] = 110 + 15 * k;
        c.start_deg[k] = 12 - 9 * k;
        c.cable.zero_deg[k] = 3 + 4 * k;
        c.cable.stiffness_nm_per_rad[k] = 0.01 + 0.01 * k;
        c.friction.stribeck_degps[k] = 0.1 + 0.05 * k;
    }
    bst_assert_ok(
        &ctx, bst_mount_init(&ctx, &m, BST_MOUNT_CROSS_ELEVATION, &c, 1e-3, (bst_rng_key){{1, 2}}));
    bst_mount_status_of(&m, 0, &s);
    EXPECT(m.encoder_step_rad, 0.6 * arcsec);
    EXPECT(m.encoder_noise_rad, 0.35 * arcsec);
    EXPECT(m.settle_tolerance_rad, 2.5 * arcsec);
    assert_int_equal(s.axes, 3);
    for (int k = 0; k < 3; k++) {
        const bst_mount_axis *a = &s.axis[k];
        const bst_mount_joint *j = &m.joints.joint[k];
        EXPECT(a->rate_limit_radps, (2 + k) * deg);
        EXPECT(a->accel_limit_radps2, (5.5 + k) * deg);
        EXPECT(a->min_rad, (-100 - 20 * k) * deg);
        EXPECT(a->max_rad, (110 + 15 * k) * deg);
        EXPECT(a->angle_rad, (12 - 9 * k) * deg);
        EXPECT(j->spring_zero_rad, (3 + 4 * k) * deg);
        EXPECT(j->spring_nm, 0.01 + 0.01 * k);
        EXPECT(j->stribeck_radps, (0.1 + 0.05 * k) * deg);
        EXPECT(j->min_rad, a->min_rad);
        EXPECT(j->max_rad, a->max_rad);
    }
}

/* The energy of a stage that turns does not depend on the axes in which its tensor is written: body
 * axes of the configuration, or those of the mount. */
static void stages_have_the_inertia_that_is_stated(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    /* xx, yy, zz, xy, xz, yz */
    const double stage[3][6] = {{0.6, 0.5, 0.45, 0.02, -0.03, 0.011},
                                {0.5, 0.4, 0.33, -0.015, 0.04, 0.025},
                                {0.2, 0.16, 0.15, 0.004, 0.007, -0.013}};
    const bst_vec3 rates[] = {{1, 0, 0},     {0, 1, 0},      {0, 0, 1},       {1, 1, 0},
                              {0.3, 0, 0.8}, {0, -0.7, 0.4}, {0.5, -0.3, 0.9}};
    for (int type = BST_MOUNT_AZIMUTH_ELEVATION; type <= BST_MOUNT_CROSS_ELEVATION; type++) {
        bst_mount_config c;
        bst_mount m;
        bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_mount_config_table, &c));
        c.third_axis = true;
        memcpy(c.inertia_outer_kgm2, stage[0], sizeof stage[0]);
        memcpy(c.inertia_inner_kgm2, stage[1], sizeof stage[1]);
        memcpy(c.inertia_third_kgm2, stage[2], sizeof stage[2]);
        bst_assert_ok(&ctx, bst_mount_init(&ctx, &m, type, &c, 1e-3, (bst_rng_key){{1, 2}}));
        for (int k = 0; k < 3; k++) {
            for (int i = 0; i < 7; i++) {
                double energy[2];
                for (int own = 0; own < 2; own++) {
                    const double *j = own ? m.joints.chain.inertia[k] : stage[k];
                    bst_vec3 w = own ? bst_mount_swap(type, rates[i]) : rates[i];
                    energy[own] = 0.5 * (j[0] * w.x * w.x + j[1] * w.y * w.y + j[2] * w.z * w.z) +
                                  j[3] * w.x * w.y + j[4] * w.x * w.z + j[5] * w.y * w.z;
                }
                bst_assert_close(energy[1], energy[0], 1e-15);
            }
        }
    }
}

/* Second moments of mass along three turned axes, p, q and r: the inertia is (p + q + r) minus
 * their tensor. A body has it if all three are positive, and none if one is negative. */
static void tensors_of_bodies_are_distinguished(void **state) {
    (void)state;
    const double least[] = {0.004, -0.004};
    for (int i = 0; i < 60; i++) {
        const bst_quat turn =
            bst_quat_unit((bst_quat){sin(3.1 * i), cos(1.7 * i), sin(0.9 * i + 1), cos(2.3 * i)});
        for (int negative = 0; negative < 2; negative++) {
            double moment[3] = {0.15, 0.21, 0.27}, tensor[3][3] = {{0.0}};
            moment[i % 3] = least[negative];
            for (int k = 0; k < 3; k++) {
                const bst_vec3 e = bst_quat_rotate(turn, (bst_vec3){k == 0, k == 1, k == 2});
                const double axis[3] = {e.x, e.y, e.z};
                for (int a = 0; a < 9; a++) {
                    tensor[a / 3][a % 3] += moment[k] * axis[a / 3] * axis[a % 3];
                }
            }
            const double sum = moment[0] + moment[1] + moment[2];
            const double j[6] = {sum - tensor[0][0], sum - tensor[1][1], sum - tensor[2][2],
                                 -tensor[0][1],      -tensor[0][2],      -tensor[1][2]};
            bst_ctx ctx = {0};
            bst_mount_config c;
            bst_mount m;
            bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_mount_config_table, &c));
            memcpy(c.inertia_outer_kgm2, j, sizeof j);
            const bst_status status = bst_mount_init(
                &ctx, &m, i % 2 ? BST_MOUNT_AZIMUTH_ELEVATION : BST_MOUNT_CROSS_ELEVATION, &c, 1e-3,
                (bst_rng_key){{1, 2}});
            assert_int_equal(status, negative ? BST_ERR_CONFIG : BST_OK);
            assert_true(!negative || strstr(ctx.message, "inertia_outer_kgm2: no body"));
        }
    }
}

static void a_second_order_mount(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_mount_two_axis_config c;
    bst_mount_two_axis m;
    bst_mount_status s;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_two_axis_config_table, &c));
    c.encoder_noise_arcsec = 0.45;
    c.settle_tolerance_arcsec = 3.5;
    c.inner_travel_deg = 65;
    c.rate_limit_degps = 2.25;
    c.accel_limit_degps2 = 7.5;
    const bst_mount_two_axis_keys keys = {{{0, 0}}, {{0, 0}}, {{0, 0}}};
    bst_assert_ok(&ctx,
                  bst_mount_two_axis_init(&ctx, &m, &c, BST_QUAT_IDENTITY, 1e-5, 1e-3, &keys));
    bst_mount_two_axis_status(&m, 0, &s);
    EXPECT(m.encoder_noise_rad, 0.45 * arcsec);
    EXPECT(m.settle_tolerance_rad, 3.5 * arcsec);
    EXPECT(m.inner_travel_rad, 65 * deg);
    assert_int_equal(s.axes, 2);
    for (int k = 0; k < 2; k++) {
        EXPECT(s.axis[k].rate_limit_radps, 2.25 * deg);
        EXPECT(s.axis[k].accel_limit_radps2, 7.5 * deg);
    }
    EXPECT(s.axis[1].min_rad, -65 * deg);
    EXPECT(s.axis[1].max_rad, 65 * deg);
    bst_platform_free(&m.platform);
}

static void an_attitude_controller(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_spacecraft_config c;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_spacecraft_config_table, &c));
    c.attitude.bandwidth_hz = 0.08;
    c.attitude.damping = 0.75;
    c.attitude.integral_hz = 0.003;
    c.attitude.rate_limit_degps = 0.6;
    c.attitude.accel_limit_degps2 = 0.15;
    c.attitude.rate_hz = 40;
    const double inertia[6] = {12, 14, 10, 0.2, 0.3, -0.1}; /* xx, yy, zz, xy, xz, yz */
    memcpy(c.inertia_kgm2, inertia, sizeof inertia);
    bst_spacecraft_attitude_control_spec s = bst_spacecraft_attitude_control_of(&c);
    EXPECT(s.natural_radps, 0.08 * 360 * deg);
    EXPECT(s.damping, 0.75);
    EXPECT(s.integral_radps, 0.003 * 360 * deg);
    EXPECT(s.rate_limit_radps, 0.6 * deg);
    EXPECT(s.accel_limit_radps2, 0.15 * deg);
    EXPECT(s.dt_s, 0.025);
    const double matrix[3][3] = {{12, 0.2, 0.3}, {0.2, 14, -0.1}, {0.3, -0.1, 10}};
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            EXPECT(s.inertia_kgm2.m[i][k], matrix[i][k]);
        }
    }
}

static void a_star_tracker(void **state) {
    (void)state;
    const bst_spacecraft_star_tracker_config c = {.axis = {2, -1, 2},
                                                  .noise_arcsec = 3.25,
                                                  .noise_about_axis_arcsec = 21,
                                                  .misalignment_arcsec = {30, -50, 70},
                                                  .sun_exclusion_deg = 33,
                                                  .earth_exclusion_deg = 22,
                                                  .rate_limit_degps = 1.75,
                                                  .outage_s = {11, 13}};
    bst_spacecraft_star_tracker t;
    bst_spacecraft_star_tracker_init(&t, &c, (bst_rng_key){{1, 2}});
    const double axis[3] = {2.0 / 3, -1.0 / 3, 2.0 / 3};
    EXPECT(t.axis.x, axis[0]);
    EXPECT(t.axis.y, axis[1]);
    EXPECT(t.axis.z, axis[2]);
    bst_assert_close(bst_vec3_dot(t.axis, t.across), 0, 1e-15);
    EXPECT(t.sigma_rad[0], 3.25 * arcsec);
    EXPECT(t.sigma_rad[1], 21 * arcsec);
    EXPECT(t.sun_exclusion_rad, 33 * deg);
    EXPECT(t.earth_exclusion_rad, 22 * deg);
    EXPECT(t.rate_limit_radps, 1.75 * deg);
    bst_vec3 turn = bst_quat_to_rotvec(t.alignment); /* coordinates turn the other way */
    EXPECT(turn.x, -30 * arcsec);
    EXPECT(turn.y, 50 * arcsec);
    EXPECT(turn.z, -70 * arcsec);
    /* sigma^2 about the axis, the other one across it */
    bst_mat3 covariance = bst_spacecraft_star_tracker_covariance(&t);
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            double along = axis[i] * axis[k], across = (i == k) - along;
            bst_assert_close(covariance.m[i][k],
                             (441 * along + 3.25 * 3.25 * across) * arcsec * arcsec,
                             1e-12 * 441 * arcsec * arcsec);
        }
    }
}

static void a_gyro(void **state) {
    (void)state;
    const bst_spacecraft_gyro_config c = {.angle_random_walk_deg_rth = 0.0125,
                                          .rate_random_walk_deg_rth3 = 0.35,
                                          .bias_degph = {1.5, -2.5, 3.5},
                                          .scale_factor_ppm = {100, -200, 300},
                                          .misalignment_arcsec = {0, 0, 60}};
    bst_spacecraft_gyro g;
    bst_spacecraft_gyro_init(&g, &c, 0.02, (bst_rng_key){{1, 2}});
    EXPECT(g.angle_walk, 0.0125 * deg / 60);         /* sqrt(3600 s) */
    EXPECT(g.rate_walk, 0.35 * deg / (3600.0 * 60)); /* 3600^1.5 */
    EXPECT(g.bias_radps.x, 1.5 * deg / 3600);
    EXPECT(g.bias_radps.y, -2.5 * deg / 3600);
    EXPECT(g.bias_radps.z, 3.5 * deg / 3600);
    EXPECT(g.dt_s, 0.02);
    const double scale[3] = {1.0001, 0.9998, 1.0003}, a = 60 * arcsec;
    const double rows[3][3] = {{cos(a), sin(a), 0}, {-sin(a), cos(a), 0}, {0, 0, 1}};
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            bst_assert_close(g.response.m[i][k], scale[i] * rows[i][k], 1e-14);
        }
    }
}

static void at_the_pole_the_outer_axis_stays(void **state) {
    (void)state;
    for (int type = 0; type < 2; type++) {
        for (int side = -1; side <= 1; side += 2) {
            const double there[3] = {0.0, side * 0.5 * BST_PI, 0.0};
            bst_quat q = bst_mount_attitude(type, there);
            bst_vec3 pole = bst_quat_rotate(bst_quat_conj(q), (bst_vec3){0, 0, 1});
            bst_mount_pose pose =
                bst_mount_solve(type, bst_vec3_unit(pole), (bst_vec3){0.01, 0.02, 0.03}, 0.7);
            bst_assert_close(pose.angle_rad[0], 0.7, 0);
            bst_assert_close(pose.angle_rad[1], side * 0.5 * BST_PI, 1e-9);
            for (int k = 0; k < 3; k++) {
                assert_true(k < 2 || pose.angle_rad[k] == 0.0);
                assert_true(pose.rate_radps[k] == 0.0);
            }
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_chain_of_three_axes),
        cmocka_unit_test(stages_have_the_inertia_that_is_stated),
        cmocka_unit_test(tensors_of_bodies_are_distinguished),
        cmocka_unit_test(a_second_order_mount),
        cmocka_unit_test(an_attitude_controller),
        cmocka_unit_test(a_star_tracker),
        cmocka_unit_test(a_gyro),
        cmocka_unit_test(at_the_pole_the_outer_axis_stays),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
