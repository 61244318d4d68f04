/* The full mounts: geometry, following with all that is in the plant, keyhole with and without a
 * third axis, wrap, stops, faults, what is refused. */
#include "gimbal/mount/mount.h"
#include "tests/test_support.h"

#define DT 1e-3

static bst_mount_config default_config(void) {
    bst_ctx ctx = {0};
    bst_mount_config c;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_mount_config_table, &c));
    return c;
}

static void make(bst_mount *mount, int type, const bst_mount_config *config) {
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_mount_init(&ctx, mount, type, config, DT, (bst_rng_key){{1, 2}}));
}

static const bst_quat some_attitude = {0.18257418583505536, -0.3651483716701107, 0.5477225575051661,
                                       0.7302967433402214};

static bst_vec3 boresight(bst_quat q_cam_from_body) {
    return bst_quat_rotate(bst_quat_conj(q_cam_from_body), (bst_vec3){0, 0, 1});
}

static bst_los_command command_from(bst_quat q_body, bst_vec3 body, bst_vec3 rate_body) {
    bst_quat back = bst_quat_conj(q_body);
    return (bst_los_command){.direction_gcrf = bst_quat_rotate(back, bst_vec3_unit(body)),
                             .rate_gcrf_radps = bst_quat_rotate(back, rate_body)};
}

static void attitudes_are_rotations_about_the_stated_axes(void **state) {
    (void)state;
    const double angle[3] = {0.7, -1.2, 0.3};
    for (int type = 0; type < 2; type++) {
        /* q_body_from_cam = R(axis 0) R(axis 1) R(axis 2), as mount_status says */
        bst_quat q = BST_QUAT_IDENTITY;
        for (int k = 0; k < 3; k++) {
            bst_vec3 r = bst_vec3_scale(bst_mount_axis_body(type, k), angle[k]);
            q = bst_quat_mul(q, bst_quat_from_rotvec(r));
        }
        bst_quat cam = bst_mount_attitude(type, angle);
        bst_quat none = bst_quat_mul(cam, q);
        bst_assert_close(fabs(none.w), 1.0, 1e-15);
        bst_assert_close(none.x * none.x + none.y * none.y + none.z * none.z, 0.0, 1e-30);
        /* the closed forms of the header, two axes */
        const double two[3] = {0.7, -1.2, 0.0};
        bst_vec3 b = boresight(bst_mount_attitude(type, two));
        double co = cos(0.7), so = sin(0.7), ci = cos(-1.2), si = sin(-1.2);
        bst_vec3 expected = type == BST_MOUNT_AZIMUTH_ELEVATION ? (bst_vec3){si, -ci * so, ci * co}
                                                                : (bst_vec3){ci * so, -si, ci * co};
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(b, expected)), 0.0, 1e-15);
    }
}

static void solutions_point_there_and_move_along(void **state) {
    (void)state;
    for (int type = 0; type < 2; type++) {
        for (int i = 0; i < 200; i++) {
            double angle[3] = {-3.1 + 0.031 * i, -1.5 + 0.015 * i, 0.0};
            bst_vec3 d = boresight(bst_mount_attitude(type, angle));
            bst_vec3 r = bst_vec3_cross((bst_vec3){0.02, -0.03, 0.01}, d);
            bst_mount_pose pose = bst_mount_solve(type, d, r, 0.0);
            bst_mount_pose rest = bst_mount_solve_rest(type, d, r, angle[0] + 0.1, 0.05);
            const bst_mount_pose *both[2] = {&pose, &rest};
            double pole = 1.0 / cos(angle[1]);
            bst_assert_close(pose.angle_rad[0], angle[0], 1e-14 * pole);
            bst_assert_close(pose.angle_rad[1], angle[1], 1e-14 * pole);
            for (int p = 0; p < 2; p++) {
                double ahead[3], behind[3], h = 1e-5;
                for (int k = 0; k < 3; k++) {
                    ahead[k] = both[p]->angle_rad[k] + h * both[p]->rate_radps[k];
                    behind[k] = both[p]->angle_rad[k] - h * both[p]->rate_radps[k];
                }
                bst_vec3 at = boresight(bst_mount_attitude(type, both[p]->angle_rad));
                assert_true(bst_vec3_angle(at, d) < 1e-13);
                bst_vec3 moved = bst_vec3_sub(boresight(bst_mount_attitude(type, ahead)),
                                              boresight(bst_mount_attitude(type, behind)));
                bst_vec3 miss = bst_vec3_axpy(bst_vec3_scale(moved, 0.5 / h), -1.0, r);
                /* third derivatives h^2 / 6 of up to (rate pole)^3, rounding 1e-16 / h */
                bst_assert_close(bst_vec3_norm(miss), 0.0, 1e-10 + 1e-10 * pole * pole * pole);
            }
        }
    }
}

/* Runs against a direction that turns about `about` (body axes) at a rate from `from` on; returns
 * the largest error of the true line of sight between two times. */
typedef struct chase {
    bst_vec3 from, about;
    double rate_radps;
} chase;

static bst_vec3 chased(const chase *c, double t) {
    return bst_quat_rotate(bst_quat_from_rotvec(bst_vec3_scale(c->about, c->rate_radps * t)),
                           c->from);
}

static double run(bst_mount *m, const chase *c, double until_s, double judge_from_s,
                  double judge_to_s) {
    double worst = 0.0;
    bst_mount_body body = {.q_believed_from_gcrf = some_attitude};
    while ((double)m->steps * DT < until_s - 0.5 * DT) {
        double t = (double)m->steps * DT;
        bst_vec3 d = chased(c, t);
        bst_vec3 r = bst_vec3_scale(bst_vec3_cross(c->about, d), c->rate_radps);
        bst_los_command k = command_from(some_attitude, d, r);
        bst_mount_step(m, &body, &k, 0.0, m->steps % 10 == 0);
        assert_true(isfinite(m->q_cam_from_body.w));
        for (int a = 0; a < m->axes; a++) {
            assert_true(fabs(m->joints.state.rate_radps[a]) <=
                        1.1 * m->servo[a].rate_limit_radps * (1 + 1e-6));
            assert_true(fabs(m->servo[a].torque_nm) <= m->servo[a].torque_limit_nm);
        }
        if (t >= judge_from_s && t <= judge_to_s) {
            worst = fmax(worst, bst_vec3_angle(boresight(m->q_cam_from_body), d));
        }
    }
    return worst;
}

static void a_slow_and_a_fast_target_are_followed(void **state) {
    (void)state;
    for (int type = 0; type < 2; type++) {
        for (int third = 0; third < 2; third++) {
            bst_mount_config config = default_config();
            config.third_axis = third == 1;
            config.flexible.frequency_hz[0] = config.flexible.frequency_hz[1] = 50.0;
            bst_mount m;
            make(&m, type, &config);
            /* a geostationary target from a low orbit: 15 arcsec/s */
            chase slow = {bst_vec3_unit((bst_vec3){0.05, 0.03, 1.0}), {0, 1, 0}, 7e-5};
            double worst = run(&m, &slow, 8.0, 4.0, 8.0);
            /* friction at these rates, encoder of 0.05 arcsec: 0.1 px of 10 arcsec at the most */
            assert_true(worst < 1.0 * BST_ARCSEC_RAD);
            assert_true(m.settled);
            assert_true(m.joints.events < 100000);
            make(&m, type, &config);
            chase fast = {bst_vec3_unit((bst_vec3){-0.3, -0.4, 1.0}),
                          bst_vec3_unit((bst_vec3){-1, 1, 0.2}), 2.0 * BST_DEG_RAD};
            worst = run(&m, &fast, 20.0, 8.0, 20.0);
            assert_true(worst < 2.0 * BST_ARCSEC_RAD);
        }
    }
}

/* Over the pole at 2 deg/s, at distances down to none. */
static void the_third_axis_carries_a_target_through_the_pole(void **state) {
    (void)state;
    const double offset_deg[] = {0.0, 1e-6, 0.3, 2.0, 5.0};
    for (int type = 0; type < 2; type++) {
        for (int i = 0; i < 5; i++) {
            bst_mount_config config = default_config();
            config.third_axis = true;
            config.travel_min_deg[1] = -100.0;
            config.travel_max_deg[1] = 100.0;
            bst_mount m;
            make(&m, type, &config);
            bst_vec3 pole = bst_mount_axis_body(type, 0);
            if (type == BST_MOUNT_CROSS_ELEVATION) {
                pole = bst_vec3_scale(pole, -1.0); /* the way from +z at positive angles */
            }
            bst_vec3 zenith = {0, 0, 1}, side = bst_vec3_cross(zenith, pole);
            double off = offset_deg[i] * BST_DEG_RAD;
            /* a great circle that passes the pole at `off`, starting 60 degrees before it */
            bst_vec3 about =
                bst_vec3_unit(bst_vec3_axpy(bst_vec3_scale(pole, sin(off)), cos(off), side));
            bst_vec3 near = bst_vec3_unit(bst_vec3_axpy(pole, -bst_vec3_dot(pole, about), about));
            double back = 60.0 * BST_DEG_RAD;
            bst_quat turn = bst_quat_from_rotvec(bst_vec3_scale(about, back));
            chase c = {bst_quat_rotate(bst_quat_conj(turn), near), about, 2.0 * BST_DEG_RAD};
            if (bst_vec3_dot(c.from, zenith) < 0.0) {
                c.from = bst_quat_rotate(turn, near);
                c.rate_radps = -c.rate_radps;
            }
            double worst = run(&m, &c, 50.0, 12.0, 50.0);
            /* the outer axis' start and end near the pole, with friction: 13 arcsec for some ms;
             * 20 are 2 px of 10 arcsec */
            assert_true(worst < 15.0 * BST_ARCSEC_RAD);
        }
    }
}

static void two_axes_lose_it_at_the_pole_and_find_it_again(void **state) {
    (void)state;
    bst_mount_config config = default_config();
    bst_mount m;
    make(&m, BST_MOUNT_AZIMUTH_ELEVATION, &config);
    chase c = {bst_vec3_unit((bst_vec3){0.5, 1e-3, 0.866}), {0, 1, 0}, 2.0 * BST_DEG_RAD};
    /* 30 s to the pole; half a turn at 9.5 deg/s takes 19 s, on which the target goes 38 degrees */
    double lost = run(&m, &c, 70.0, 30.0, 40.0);
    assert_true(lost > 5.0 * BST_DEG_RAD);
    double found = run(&m, &c, 75.0, 70.0, 75.0);
    assert_true(found < 2.0 * BST_ARCSEC_RAD);
}

static void half_a_turn_is_made_within_the_limits(void **state) {
    (void)state;
    bst_mount_config config = default_config();
    config.motor_torque_nm[0] = 0.3; /* saturates */
    config.accel_limit_degps2[0] = 60.0;
    bst_mount m;
    make(&m, BST_MOUNT_CROSS_ELEVATION, &config);
    chase c = {bst_vec3_unit((bst_vec3){1e-3, 0.1, -1.0}), {0, 1, 0}, 0.0};
    double worst = run(&m, &c, 45.0, 40.0, 45.0);
    assert_true(worst < 1.0 * BST_ARCSEC_RAD);
    assert_true(m.settled && !m.limited);
    bst_assert_close(fabs(m.joints.state.angle_rad[0]), BST_PI, 0.01);
}

/* An azimuth that goes on and on: the encoder wraps, the cable's travel ends, and the axis goes
 * back by a turn and finds the target again. */
static void a_wound_cable_is_unwound(void **state) {
    (void)state;
    bst_mount_config config = default_config();
    bst_mount m;
    make(&m, BST_MOUNT_AZIMUTH_ELEVATION, &config);
    chase c = {bst_vec3_unit((bst_vec3){0.5, 0.0, 1.0}), {1, 0, 0}, 4.0 * BST_DEG_RAD};
    double worst = run(&m, &c, 60.0, 10.0, 60.0); /* 240 of 270 degrees */
    assert_true(worst < 2.0 * BST_ARCSEC_RAD);
    bst_assert_close(m.servo[0].unwrapped_rad, 240.0 * BST_DEG_RAD, 1e-3);
    assert_true(m.servo[0].reading_rad < 0.0);
    worst = run(&m, &c, 120.0, 115.0, 120.0);
    assert_true(worst < 2.0 * BST_ARCSEC_RAD);
    bst_assert_close(m.servo[0].unwrapped_rad, 120.0 * BST_DEG_RAD, 1e-3);
    bst_mount_status status;
    bst_mount_status_of(&m, 7, &status);
    bst_assert_close(status.axis[0].angle_rad, 120.0 * BST_DEG_RAD, 1e-3);
    assert_int_equal(status.axes, 2);
}

static void a_wanted_turn_of_the_outer_axis_is_taken(void **state) {
    (void)state;
    bst_mount_config config = default_config();
    bst_mount m;
    make(&m, BST_MOUNT_AZIMUTH_ELEVATION, &config);
    bst_mount_body body = {.q_believed_from_gcrf = some_attitude};
    /* azimuth 120 degrees, or -240 */
    bst_vec3 d = {0.1, -sin(120.0 * BST_DEG_RAD), cos(120.0 * BST_DEG_RAD)};
    bst_los_command k = command_from(some_attitude, d, (bst_vec3){0, 0, 0});
    k.near_given = true;
    k.near_rad[0] = -230.0 * BST_DEG_RAD;
    for (int n = 0; n < 40000; n++) {
        bst_mount_step(&m, &body, &k, 0.0, true);
    }
    bst_assert_close(m.servo[0].unwrapped_rad, -240.0 * BST_DEG_RAD, 1e-4);
    assert_true(m.settled);
}

/* Angles asked for are of the command's tick: they move on at their rates until the torque acts. */
static void wanted_turns_move_on(void **state) {
    (void)state;
    for (int sign = -1; sign <= 1; sign += 2) {
        bst_mount_config config = default_config();
        config.travel_min_deg[0] = -1000.0;
        config.travel_max_deg[0] = 1000.0;
        bst_mount m;
        make(&m, BST_MOUNT_AZIMUTH_ELEVATION, &config);
        bst_mount_body body = {.q_believed_from_gcrf = some_attitude};
        bst_vec3 d = {0.1, -sin(120.0 * BST_DEG_RAD), cos(120.0 * BST_DEG_RAD)};
        bst_los_command k = command_from(some_attitude, d, (bst_vec3){0, 0, 0});
        /* 350 degrees on to either side after 10 s: next to 480 or to -240 degrees */
        k.near_given = true;
        k.near_rad[0] = 120.0 * BST_DEG_RAD;
        k.near_radps[0] = sign * 35.0 * BST_DEG_RAD;
        bst_mount_step(&m, &body, &k, 10.0, true);
        for (int n = 0; n < 60000; n++) {
            bst_mount_step(&m, &body, &k, 10.0, true);
        }
        bst_assert_close(m.servo[0].unwrapped_rad, (120.0 + sign * 360.0) * BST_DEG_RAD, 1e-4);
        assert_true(m.settled);
    }
}

/* What the status says of limits, stops and the third axis. */
static void the_status_tells_limits_and_stops(void **state) {
    (void)state;
    bst_mount_config config = default_config();
    config.third_axis = true;
    const double limits[3] = {9.0, 7.0, 3.0}, accels[3] = {20.0, 15.0, 11.0};
    for (int k = 0; k < 3; k++) {
        config.rate_limit_degps[k] = limits[k];
        config.accel_limit_degps2[k] = accels[k];
    }
    config.travel_min_deg[0] = config.travel_max_deg[0] = 0.0; /* without end */
    config.travel_min_deg[1] = -80.0;
    config.travel_max_deg[1] = 60.0;
    for (int stop = -1; stop <= 1; stop++) {
        config.start_deg[0] = 200.0;
        config.start_deg[1] = stop < 0 ? -80.0 : stop > 0 ? 60.0 : 10.0;
        bst_mount m;
        make(&m, BST_MOUNT_AZIMUTH_ELEVATION, &config);
        bst_mount_body body = {.q_believed_from_gcrf = some_attitude};
        for (int n = 0; n < 20; n++) {
            bst_mount_step(&m, &body, NULL, 0.0, true);
        }
        bst_mount_status s;
        bst_mount_status_of(&m, 77, &s);
        assert_int_equal(s.tick, 77);
        assert_int_equal(s.axes, 3);
        assert_false(s.axis[0].redundant || s.axis[1].redundant);
        assert_true(s.axis[2].redundant);
        for (int k = 0; k < 3; k++) {
            bst_assert_close(s.axis[k].rate_limit_radps, limits[k] * BST_DEG_RAD, 1e-12);
            bst_assert_close(s.axis[k].accel_limit_radps2, accels[k] * BST_DEG_RAD, 1e-12);
            assert_int_equal((s.axis[k].flags & BST_AXIS_AT_STOP) != 0, k == 1 && stop != 0);
        }
        bst_assert_close(s.axis[0].angle_rad, -160.0 * BST_DEG_RAD, 1e-5); /* in (-pi, pi] */
        assert_true(s.axis[0].min_rad == 0.0 && s.axis[0].max_rad == 0.0);
        bst_assert_close(s.axis[1].angle_rad, config.start_deg[1] * BST_DEG_RAD, 1e-5);
        bst_assert_close(s.axis[1].min_rad, -80.0 * BST_DEG_RAD, 1e-12);
        bst_assert_close(s.axis[1].max_rad, 60.0 * BST_DEG_RAD, 1e-12);
        assert_true(s.axis[0].axis_body.x == 1.0 && s.axis[2].axis_body.x == 1.0);
    }
}

/* The other way to point, over the pole, is the shorter one where the outer axis would have to make
 * nearly half a turn, or a slow inner axis a long way. */
static void over_the_pole_is_the_shorter_way(void **state) {
    (void)state;
    const struct {
        double start, azimuth, elevation, outer, inner;
    } cases[] = {{70, 175, 75, -5, 105},    {70, -175, 75, 5, 105},  {-70, 175, -75, -5, -105},
                 {-70, -175, -75, 5, -105}, {170, 0, -50, 180, 230}, /* 60 degrees for the inner one
                                                                        instead of 150 */
                 {-170, 0, 50, 180, -230}};
    for (int k = 0; k < 6; k++) {
        bst_mount_config config = default_config();
        config.rate_limit_degps[1] = 5.0;
        config.travel_min_deg[1] = -240.0;
        config.travel_max_deg[1] = 240.0;
        config.start_deg[1] = cases[k].start;
        bst_mount m;
        make(&m, BST_MOUNT_AZIMUTH_ELEVATION, &config);
        bst_mount_body body = {.q_believed_from_gcrf = some_attitude};
        double azimuth = cases[k].azimuth * BST_DEG_RAD,
               elevation = cases[k].elevation * BST_DEG_RAD;
        bst_vec3 d = {sin(elevation), -cos(elevation) * sin(azimuth),
                      cos(elevation) * cos(azimuth)};
        bst_los_command c = command_from(some_attitude, d, (bst_vec3){0, 0, 0});
        bool limited = false;
        for (int n = 0; n < 24000; n++) {
            bst_mount_step(&m, &body, &c, 0.0, true);
            limited = limited || m.limited;
        }
        bst_assert_close(fabs(m.servo[0].unwrapped_rad), fabs(cases[k].outer) * BST_DEG_RAD, 1e-4);
        assert_true(cases[k].outer == 180 || m.servo[0].unwrapped_rad * cases[k].outer > 0.0);
        bst_assert_close(m.servo[1].unwrapped_rad, cases[k].inner * BST_DEG_RAD, 1e-4);
        assert_true(m.settled && bst_vec3_angle(boresight(m.q_cam_from_body), d) < 1e-5);
        /* on its way at the rate limits, and not at the end */
        assert_true(limited && !m.limited);
    }
}

static void a_stuck_axis_is_told_and_the_rest_goes_on(void **state) {
    (void)state;
    bst_mount_config config = default_config();
    config.fault.stuck_axis = 2;
    config.fault.stuck_from_s = 2.0;
    bst_mount m;
    make(&m, BST_MOUNT_CROSS_ELEVATION, &config);
    chase c = {{0, 0, 1}, bst_vec3_unit((bst_vec3){-1, 1, 0}), 0.5 * BST_DEG_RAD};
    (void)run(&m, &c, 10.0, 0.0, 0.0);
    bst_mount_status status;
    bst_mount_status_of(&m, 0, &status);
    assert_true((status.axis[1].flags & BST_AXIS_STUCK) != 0);
    assert_true((status.axis[0].flags & BST_AXIS_STUCK) == 0);
    assert_true(m.joints.state.rate_radps[1] == 0.0 && !m.settled);
    bst_vec3 d = chased(&c, 10.0 - DT);
    bst_assert_close(m.joints.state.angle_rad[0], atan2(d.x, d.z), 1e-5);
}

static void it_runs_into_its_stop_at_full_speed_and_stays_whole(void **state) {
    (void)state;
    bst_mount_config config = default_config();
    bst_mount m;
    make(&m, BST_MOUNT_CROSS_ELEVATION, &config);
    double push[3] = {2.0, 1.0, 0.0};
    double fastest = 0.0;
    for (int n = 0; n < 120000; n++) {
        bst_mount_drive(&m, push, (bst_vec3){0, 0, 0});
        fastest = fmax(fastest, fabs(m.joints.state.rate_radps[1]));
        assert_true(m.joints.state.angle_rad[0] <= m.travel_max_rad[0]);
        assert_true(m.joints.state.angle_rad[1] <= m.travel_max_rad[1]);
        assert_true(isfinite(m.q_cam_from_body.w));
    }
    assert_true(fastest > 1.0);
    assert_true(m.joints.at_stop[0] && m.joints.at_stop[1]);
    assert_true(m.joints.state.rate_radps[0] == 0.0 && m.joints.state.rate_radps[1] == 0.0);
}

/* The body drifts and turns below the mount: known rates are taken off, unknown ones move the line
 * of sight by what the loop leaves. */
static void a_turning_body_is_undone(void **state) {
    (void)state;
    bst_mount_config config = default_config();
    bst_mount m;
    make(&m, BST_MOUNT_AZIMUTH_ELEVATION, &config);
    bst_vec3 rate = {0.002, -0.003, 0.001};
    bst_vec3 target = bst_quat_rotate(bst_quat_conj(some_attitude), (bst_vec3){0.1, 0.2, 1.0});
    bst_los_command k = {.direction_gcrf = bst_vec3_unit(target)};
    double worst = 0.0;
    for (int n = 0; n < 15000; n++) {
        bst_quat q =
            bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(rate, -n * DT)), some_attitude);
        bst_mount_body body = {
            .rate_radps = rate, .q_believed_from_gcrf = q, .believed_rate_radps = rate};
        bst_mount_step(&m, &body, &k, 0.0, false);
        if (n > 6000) {
            bst_vec3 want = bst_quat_rotate(q, k.direction_gcrf);
            worst = fmax(worst, bst_vec3_angle(boresight(m.q_cam_from_body), want));
        }
    }
    assert_true(worst < 1.0 * BST_ARCSEC_RAD);
}

/* A free body carries a mount that slews: body and mount together keep their angular momentum, in
 * both geometries, and the body recoils. */
static void a_slew_turns_a_free_body_back(void **state) {
    (void)state;
    for (int type = 0; type < 2; type++) {
        bst_mount_config config = default_config();
        config.third_axis = true;
        config.flexible.frequency_hz[1] = 40.0;
        bst_mount m;
        make(&m, type, &config);
        m.want_reaction = true;
        const double j[3] = {20.0, 30.0, 25.0};
        bst_vec3 rate = {1e-3, -2e-3, 1.5e-3}, before = rate, first = {0, 0, 0};
        bst_vec3 mount_before = {0, 0, 0};
        bst_quat q = BST_QUAT_IDENTITY, q_before = q;
        double worst = 0.0, recoil = 0.0;
        for (int n = 0; n < 15000; n++) {
            bst_mount_body body = {
                .rate_radps = rate, .q_believed_from_gcrf = q, .believed_rate_radps = rate};
            bst_vec3 aim = n < 5000 ? (bst_vec3){0.3, 0.4, 1.0} : (bst_vec3){-0.4, 0.2, 0.8};
            bst_los_command k = {.direction_gcrf = bst_vec3_unit(aim)};
            bst_mount_step(&m, &body, &k, 0.0, false);
            /* the body's momentum now holds the reactions up to the step before, so that it belongs
             * to the mount's of then */
            bst_vec3 h = {j[0] * rate.x, j[1] * rate.y, j[2] * rate.z};
            bst_vec3 total = bst_vec3_add(bst_quat_rotate(bst_quat_conj(q), h),
                                          bst_quat_rotate(bst_quat_conj(q_before), mount_before));
            if (n == 1) {
                first = total;
            } else if (n > 1) {
                worst = fmax(worst, bst_vec3_norm(bst_vec3_sub(total, first)));
                recoil = fmax(recoil, bst_vec3_norm(bst_vec3_sub(rate, before)));
            }
            mount_before = bst_mount_swap(
                type,
                bst_mount_chain_momentum(&m.joints.chain, &m.joints.state, m.base_rate_radps));
            q_before = q;
            bst_vec3 old = rate, mid = rate;
            for (int i = 0; i < 4; i++) { /* midpoint rule of J dw/dt = torque - w x J w */
                bst_vec3 hm = {j[0] * mid.x, j[1] * mid.y, j[2] * mid.z};
                bst_vec3 t = bst_vec3_sub(m.reaction_nm, bst_vec3_cross(mid, hm));
                rate = (bst_vec3){old.x + DT * t.x / j[0], old.y + DT * t.y / j[1],
                                  old.z + DT * t.z / j[2]};
                mid = bst_vec3_scale(bst_vec3_add(old, rate), 0.5);
            }
            q = bst_quat_unit(bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(mid, -DT)), q));
        }
        assert_true(recoil > 1e-3);
        /* of 0.1 N m s; second order in the step, worst while friction lets go within one */
        assert_true(worst < 1e-6);
        /* on the target all the same */
        bst_vec3 d = bst_quat_rotate(q_before, bst_vec3_unit((bst_vec3){-0.4, 0.2, 0.8}));
        assert_true(bst_vec3_angle(boresight(m.q_cam_from_body), d) < 1.0 * BST_ARCSEC_RAD);
    }
}

/* Directions drawn anew every 0.7 s, the poles and the way straight back among them, with no, usual
 * and huge friction, weak motors, soft and hard stops: all stays within its limits. */
static void nothing_diverges(void **state) {
    (void)state;
    bst_rng_key key = {{9, 9}};
    for (int hard = 0; hard < 8; hard++) {
        bst_mount_config config = default_config();
        config.third_axis = (hard & 1) != 0;
        config.stop_restitution = (hard & 2) != 0 ? 1.0 : 0.0;
        config.flexible.frequency_hz[0] = 50.0;
        double friction = hard < 3 ? 0.0 : hard < 6 ? 0.02 : 1e9;
        for (int k = 0; k < 3; k++) {
            config.friction.coulomb_nm[k] = friction;
            config.friction.breakaway_nm[k] = 1.5 * friction;
            config.motor_torque_nm[k] *= hard == 4 ? 0.02 : 1.0;
        }
        bst_mount m;
        int type = (hard >> 1) & 1;
        make(&m, type, &config);
        bst_quat minus = {-some_attitude.x, -some_attitude.y, -some_attitude.z, -some_attitude.w};
        bst_los_command k = {.direction_gcrf = {0, 0, 1}};
        for (int n = 0; n < 30000; n++) {
            if (n % 700 == 0) {
                uint64_t draw = (uint64_t)n;
                bst_vec3 d = bst_vec3_from_radec(2.0 * BST_PI * bst_rng_uniform(key, draw, 0),
                                                 asin(2.0 * bst_rng_uniform(key, draw, 1) - 1.0));
                d = n % 3500 == 700    ? bst_mount_axis_body(type, 0)
                    : n % 3500 == 1400 ? (bst_vec3){0, 0, -1}
                                       : d;
                k = command_from(some_attitude, d, (bst_vec3){0, 0, 0});
                k.near_given = n % 2100 == 0;
                k.near_rad[0] = 100.0;
            }
            bst_mount_body body = {.q_believed_from_gcrf = n % 2 ? some_attitude : minus};
            bst_mount_step(&m, &body, &k, 0.0, true);
            for (int a = 0; a < m.axes; a++) {
                double angle = m.joints.state.angle_rad[a], rate = m.joints.state.rate_radps[a];
                assert_true(angle >= m.travel_min_rad[a] && angle <= m.travel_max_rad[a]);
                /* the mode throws its joint about by some more */
                assert_true(fabs(rate) <= 1.5 * m.servo[a].rate_limit_radps);
                assert_true(friction < 1e6 || rate == 0.0);
            }
        }
        bst_mount_status status;
        bst_mount_status_of(&m, 0, &status);
        assert_true(friction < 1e6 || (status.axis[0].flags & BST_AXIS_STUCK) != 0);
    }
}

static void what_cannot_be_is_refused(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    static bst_mount m;
    bst_rng_key key = {{1, 2}};
    bst_mount_config c = default_config();
    c.flexible.frequency_hz[1] = 80.0; /* free: 80 / sqrt(0.8) = 89.44 Hz, 1.118 ms allowed */
    bst_assert_ok(&ctx, bst_mount_init(&ctx, &m, 0, &c, 1e-3, key));
    assert_int_equal(bst_mount_init(&ctx, &m, 0, &c, 1e-2, key), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "the inner axis' mode swings at 89.4427 Hz"));
    assert_non_null(strstr(ctx.message, "largest step allowed is 0.001118 s"));
    c = default_config();
    c.inertia_inner_kgm2[2] = 2.0;
    assert_int_equal(bst_mount_init(&ctx, &m, 0, &c, DT, key), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "inertia_inner_kgm2: no body has this tensor"));
    c = default_config();
    c.friction.breakaway_nm[0] = 0.0;
    assert_int_equal(bst_mount_init(&ctx, &m, 0, &c, DT, key), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "friction/breakaway_nm"));
    c = default_config();
    c.start_deg[1] = 95.0;
    assert_int_equal(bst_mount_init(&ctx, &m, 0, &c, DT, key), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "start_deg: 95 of the inner axis"));
    c = default_config();
    c.fault.stuck_axis = 3;
    assert_int_equal(bst_mount_init(&ctx, &m, 0, &c, DT, key), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "set third_axis"));
    c = default_config();
    c.friction.viscous_nms_per_rad[1] = 1000.0;
    assert_int_equal(bst_mount_init(&ctx, &m, 0, &c, DT, key), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "viscous_nms_per_rad"));
}

static void the_same_seed_gives_the_same_bits(void **state) {
    (void)state;
    bst_mount_config config = default_config();
    static bst_mount a, b;
    make(&a, 0, &config);
    make(&b, 0, &config);
    chase c = {bst_vec3_unit((bst_vec3){0.1, 0.0, 1.0}), {0, 1, 0}, 0.01};
    (void)run(&a, &c, 2.0, 0.0, 0.0);
    (void)run(&b, &c, 2.0, 0.0, 0.0);
    assert_memory_equal(&a.joints.state, &b.joints.state, sizeof a.joints.state);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(attitudes_are_rotations_about_the_stated_axes),
        cmocka_unit_test(solutions_point_there_and_move_along),
        cmocka_unit_test(a_slow_and_a_fast_target_are_followed),
        cmocka_unit_test(the_third_axis_carries_a_target_through_the_pole),
        cmocka_unit_test(two_axes_lose_it_at_the_pole_and_find_it_again),
        cmocka_unit_test(half_a_turn_is_made_within_the_limits),
        cmocka_unit_test(a_wound_cable_is_unwound),
        cmocka_unit_test(a_wanted_turn_of_the_outer_axis_is_taken),
        cmocka_unit_test(wanted_turns_move_on),
        cmocka_unit_test(the_status_tells_limits_and_stops),
        cmocka_unit_test(over_the_pole_is_the_shorter_way),
        cmocka_unit_test(a_stuck_axis_is_told_and_the_rest_goes_on),
        cmocka_unit_test(it_runs_into_its_stop_at_full_speed_and_stays_whole),
        cmocka_unit_test(a_turning_body_is_undone),
        cmocka_unit_test(a_slew_turns_a_free_body_back),
        cmocka_unit_test(nothing_diverges),
        cmocka_unit_test(what_cannot_be_is_refused),
        cmocka_unit_test(the_same_seed_gives_the_same_bits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
