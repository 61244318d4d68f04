/* Joints of the full mounts against closed forms: springs, modes, friction, stops, momentum. */
#include "gimbal/mount/mount_geometry.h"
#include "gimbal/mount/mount_joints.h"
#include "tests/test_support.h"

#define DT 1e-3

static const bst_vec3 still = {0, 0, 0};

/* Three stages with products of inertia, nothing else. */
static bst_mount_joints bare(int stages) {
    bst_mount_joints j = {.chain = {.stages = stages,
                                    .inertia = {{0.6, 0.5, 0.45, 0.02, -0.03, 0.01},
                                                {0.3, 0.28, 0.2, -0.01, 0.02, 0.015},
                                                {0.1, 0.09, 0.06, 0.004, 0.003, -0.005}}}};
    for (int k = 0; k < 3; k++) {
        j.joint[k] =
            (bst_mount_joint){.stribeck_radps = 1e-3, .min_rad = -INFINITY, .max_rad = INFINITY};
    }
    bst_mount_joints_init(&j, (double[3]){0.0, 0.0, 0.0});
    return j;
}

static void put(bst_mount_joints *j, const double angle[3], const double rate[3]) {
    bst_mount_joints_init(j, angle);
    for (int k = 0; k < j->chain.stages; k++) {
        j->state.rate_radps[k] = rate[k];
    }
}

static void mass_matrix_is_that_of_the_kinetic_energy(void **state) {
    (void)state;
    bst_mount_joints j = bare(3);
    const double angle[3] = {0.7, -1.1, 0.4};
    double s[3], c[3];
    for (int k = 0; k < 3; k++) {
        s[k] = sin(angle[k]);
        c[k] = cos(angle[k]);
    }
    bst_mount_chain_equations eq;
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            double one[3] = {0.0}, two[3] = {0.0}, both[3] = {0.0};
            one[i] = 1.0;
            two[k] = 1.0;
            both[i] += 1.0;
            both[k] += 1.0;
            put(&j, angle, both);
            double energy = bst_mount_chain_energy(&j.chain, &j.state, still);
            put(&j, angle, one);
            energy -= bst_mount_chain_energy(&j.chain, &j.state, still);
            put(&j, angle, two);
            energy -= bst_mount_chain_energy(&j.chain, &j.state, still);
            bst_mount_chain_base base = {still, still};
            bst_mount_chain_equations_at(&j.chain, &j.state, s, c, &base, &eq);
            bst_assert_close(eq.mass[i][k], energy, 1e-15); /* a dozen roundings of values near 1 */
        }
    }
}

/* Momentum of a joint, the derivative of the kinetic energy by its rate: exact by differences, for
 * the energy is a square of rates. */
static double joint_momentum(const bst_mount_joints *j, const double angle[3], const double rate[3],
                             int joint, bst_vec3 base_radps) {
    double energy[2];
    for (int side = 0; side < 2; side++) {
        bst_mount_joints moved = *j;
        put(&moved, angle, rate);
        moved.state.rate_radps[joint] += side ? 1.0 : -1.0;
        energy[side] = bst_mount_chain_energy(&moved.chain, &moved.state, base_radps);
    }
    return 0.5 * (energy[1] - energy[0]);
}

/* Lagrange's equations of the kinetic energy on a base that turns and accelerates: what gyroscopic
 * torques do not show in the energy, for they do no work. */
static void bias_is_that_of_the_kinetic_energy(void **state) {
    (void)state;
    const double h = 1e-4;
    for (int which = 0; which < 8; which++) {
        double angle[3], rate[3], s[3], c[3];
        for (int k = 0; k < 3; k++) {
            angle[k] = 1.3 * sin(1.0 + 3.0 * which + 2.0 * k);
            rate[k] = 2.0 * cos(2.0 + 5.0 * which + 3.0 * k);
            s[k] = sin(angle[k]);
            c[k] = cos(angle[k]);
        }
        bst_mount_chain_base base = {{0.4, -0.9, 0.7}, {-1.1, 0.5, 0.8}};
        if (which == 0) {
            base = (bst_mount_chain_base){still, still};
        }
        bst_mount_joints j = bare(2 + which % 2);
        put(&j, angle, rate);
        bst_mount_chain_equations eq;
        bst_mount_chain_equations_at(&j.chain, &j.state, s, c, &base, &eq);
        for (int k = 0; k < j.chain.stages; k++) {
            double momentum[2], energy[2];
            for (int side = 0; side < 2; side++) {
                double dt = side ? h : -h, then[3], moved[3] = {angle[0], angle[1], angle[2]};
                for (int i = 0; i < 3; i++) {
                    then[i] = angle[i] + dt * rate[i];
                }
                moved[k] += dt;
                momentum[side] = joint_momentum(
                    &j, then, rate, k, bst_vec3_axpy(base.rate_radps, dt, base.accel_radps2));
                put(&j, moved, rate);
                energy[side] = bst_mount_chain_energy(&j.chain, &j.state, base.rate_radps);
            }
            double expected = (momentum[1] - momentum[0] - energy[1] + energy[0]) / (2.0 * h);
            bst_assert_close(eq.bias_nm[k], expected, 1e-6); /* h^2 of torques near 1 N m */
        }
    }
}

/* Free joints on a base at rest: nothing but the coupling acts, and energy is kept only when it is
 * right. */
static void energy_is_kept_without_torque(void **state) {
    (void)state;
    const double angle[3] = {0.3, 0.8, -0.5}, rate[3] = {1.0, -0.7, 1.3}, none[3] = {0.0};
    for (int stages = 2; stages <= 3; stages++) {
        bst_mount_joints j = bare(stages);
        put(&j, angle, rate);
        double before = bst_mount_joints_energy(&j, still);
        for (int n = 0; n < 20000; n++) {
            bst_mount_joints_step(&j, DT, none, still, still);
        }
        /* order 4: per second (w dt)^5 / 120 of a motion of w = 2 rad/s is some 1e-13 */
        bst_assert_close(bst_mount_joints_energy(&j, still) / before, 1.0, 1e-10);
    }
}

/* A free body carries the mount: what the mount gains in momentum the body loses. The mount's
 * reaction reaches the body a step later, as in the simulation. */
static void momentum_of_body_and_mount_is_kept(void **state) {
    (void)state;
    bst_mount_joints j = bare(3);
    j.chain.flex_inertia[1] = 0.05;
    j.chain.flex_stiffness[1] = 0.05 * 200.0 * 200.0;
    j.chain.flex_damping[1] = 0.05 * 2.0;
    j.joint[0].coulomb_nm = j.joint[0].breakaway_nm = 0.05;
    bst_mount_joints_init(&j, (double[3]){0.1, 0.2, -0.3});
    const double body[3] = {12.0, 15.0, 10.0};
    bst_vec3 rate = {0.01, -0.02, 0.015}, torque = {0, 0, 0};
    bst_quat q = BST_QUAT_IDENTITY; /* base from inertial */
    bst_vec3 first = {0, 0, 0};
    double worst = 0.0, mount_most = 0.0;
    for (int n = 0; n < 20000; n++) {
        bst_vec3 mount = bst_mount_chain_momentum(&j.chain, &j.state, rate);
        bst_vec3 before = rate;
        /* body: J dw/dt = torque - w x J w, midpoint rule */
        bst_vec3 mid = rate;
        for (int i = 0; i < 4; i++) {
            bst_vec3 h = {body[0] * mid.x, body[1] * mid.y, body[2] * mid.z};
            bst_vec3 t = bst_vec3_sub(torque, bst_vec3_cross(mid, h));
            rate = (bst_vec3){before.x + DT * t.x / body[0], before.y + DT * t.y / body[1],
                              before.z + DT * t.z / body[2]};
            mid = bst_vec3_scale(bst_vec3_add(before, rate), 0.5);
        }
        q = bst_quat_unit(bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(mid, -DT)), q));
        double t = n * DT;
        double motor[3] = {0.5 * sin(2.0 * t), 0.3 * cos(3.0 * t), -0.2 * sin(5.0 * t)};
        bst_mount_joints_step(&j, DT, motor, before, rate);
        bst_vec3 after = bst_mount_chain_momentum(&j.chain, &j.state, rate);
        bst_vec3 gain = bst_vec3_scale(bst_vec3_sub(after, mount), 1.0 / DT);
        gain = bst_vec3_axpy(gain, 0.5, bst_vec3_cross(before, mount));
        gain = bst_vec3_axpy(gain, 0.5, bst_vec3_cross(rate, after));
        /* the body's momentum now, and what the mount's was when its reaction was taken */
        bst_vec3 h = {body[0] * rate.x, body[1] * rate.y, body[2] * rate.z};
        bst_vec3 total = bst_vec3_add(h, after);
        total = bst_vec3_axpy(total, -DT, gain);
        total = bst_quat_rotate(bst_quat_conj(q), total);
        /* as the body's axes will have turned when it acts */
        torque = bst_vec3_axpy(bst_vec3_scale(gain, -1.0), DT, bst_vec3_cross(rate, gain));
        if (n == 0) {
            first = total;
        } else {
            worst = fmax(worst, bst_vec3_norm(bst_vec3_sub(total, first)));
        }
        mount_most = fmax(mount_most, bst_vec3_norm(after));
    }
    assert_true(mount_most > 0.1); /* it did move */
    /* second order in the step: 1e-8 N m s of 0.44 */
    assert_true(worst < 3e-8);
}

/* A cable makes a torsion pendulum: sqrt(k / J). */
static void cable_swings_at_its_frequency(void **state) {
    (void)state;
    for (int method = 0; method < 2; method++) {
        bst_mount_joints j = bare(2);
        j.method = method;
        j.joint[1].spring_nm = 40.0;
        j.joint[1].spring_zero_rad = 0.2;
        j.joint[0].stuck = true;
        bst_mount_joints_init(&j, (double[3]){0.0, 0.3, 0.0});
        double inertia = 0.28, expected = sqrt(40.0 / inertia);
        int turns = 0;
        double last = 0.1, first_time = 0.0, last_time = 0.0;
        for (int n = 1; n <= 20000; n++) {
            bst_mount_joints_step(&j, DT, (double[3]){0.0}, still, still);
            double x = j.state.angle_rad[1] - 0.2;
            if (last > 0.0 && x <= 0.0) {
                last_time = (n - 1 + last / (last - x)) * DT;
                first_time = turns++ == 0 ? last_time : first_time;
            }
            last = x;
        }
        double measured = 2.0 * BST_PI * (turns - 1) / (last_time - first_time);
        /* rk4: (w dt)^4 / 120; leapfrog: (w dt)^2 / 24 with w dt = 0.012; crossings to 1e-9 s */
        bst_assert_close(measured / expected, 1.0, method == 0 ? 1e-8 : 1e-5);
        /* and it neither dies nor grows */
        bst_assert_close(bst_mount_joints_energy(&j, still) / (0.5 * 40.0 * 0.01), 1.0,
                         method == 0 ? 1e-5 : 1e-4);
    }
}

/* With the joint free the mode swings faster by 1 / sqrt(1 - share). */
static void flexible_mode_swings_at_its_frequencies(void **state) {
    (void)state;
    for (int held = 0; held < 2; held++) {
        bst_mount_joints j = bare(2);
        double all = 0.28, share = 0.3, w = 2.0 * BST_PI * 30.0;
        j.chain.flex_inertia[1] = share * all;
        j.chain.flex_stiffness[1] = share * all * w * w;
        j.joint[0].stuck = true;
        j.joint[1].stuck = held == 1;
        bst_mount_joints_init(&j, (double[3]){0.0});
        j.state.flex_rad[1] = 1e-3;
        int turns = 0;
        double last = 1e-3, first_time = 0.0, last_time = 0.0;
        for (int n = 1; n <= 40000; n++) {
            bst_mount_joints_step(&j, 0.5 * DT, (double[3]){0.0}, still, still);
            double x = j.state.flex_rad[1];
            if (last > 0.0 && x <= 0.0) {
                last_time = (n - 1 + last / (last - x)) * 0.5 * DT;
                first_time = turns++ == 0 ? last_time : first_time;
            }
            last = x;
        }
        double expected = held ? 30.0 : 30.0 / sqrt(1.0 - share);
        /* phase error (w dt)^4 / 120 = 1e-6 at w dt = 0.11, crossings by a straight line 1e-6 */
        bst_assert_close((turns - 1) / (last_time - first_time) / expected, 1.0, 5e-6);
    }
}

static void coulomb_friction_stops_in_time_and_place(void **state) {
    (void)state;
    for (int direction = -1; direction <= 1; direction += 2) {
        bst_mount_joints j = bare(2);
        double friction = 0.035, inertia = 0.28, v = 0.2 * direction;
        j.joint[1].coulomb_nm = j.joint[1].breakaway_nm = friction;
        j.joint[0].stuck = true;
        put(&j, (double[3]){0.0}, (double[3]){0.0, v, 0.0});
        double decel = friction / inertia, time = fabs(v) / decel;
        int n = 0;
        while (j.state.rate_radps[1] != 0.0 && n < 100000) {
            bst_mount_joints_step(&j, DT, (double[3]){0.0}, still, still);
            n++;
        }
        /* it stops inside of the step, which is found exactly for a constant torque */
        bst_assert_close(n, ceil(time / DT), 1.0);
        bst_assert_close(j.state.angle_rad[1], direction * 0.5 * v * v / decel, 1e-12);
        double rest = j.state.angle_rad[1];
        for (int i = 0; i < 1000; i++) {
            bst_mount_joints_step(&j, DT, (double[3]){0.0}, still, still);
            assert_true(j.state.rate_radps[1] == 0.0 && j.state.angle_rad[1] == rest);
        }
    }
}

static void stiction_holds_and_lets_go(void **state) {
    (void)state;
    bst_mount_joints j = bare(2);
    j.joint[0].stuck = true;
    j.joint[1].coulomb_nm = 0.02;
    j.joint[1].breakaway_nm = 0.05;
    bst_mount_joints_init(&j, (double[3]){0.0});
    for (int n = 0; n < 5000; n++) { /* to and fro below the breakaway: not one bit moves */
        double push[3] = {0.0, 0.0499 * sin(0.01 * n), 0.0};
        bst_mount_joints_step(&j, DT, push, still, still);
        assert_true(j.state.rate_radps[1] == 0.0 && j.state.angle_rad[1] == 0.0);
    }
    assert_int_equal(j.events, 0);
    double push[3] = {0.0, 0.06, 0.0};
    for (int n = 0; n < 1000; n++) {
        bst_mount_joints_step(&j, DT, push, still, still);
    }
    /* J dv/dt = a - b / (1 + (v / s)^2), a = 0.06 - 0.02, b = 0.05 - 0.02, has the integral
     * a t / J = v + s r / sqrt(1 - r) atan(v / s / sqrt(1 - r)), r = b / a; the step is a hundredth
     * of the time to the Stribeck rate */
    double v = j.state.rate_radps[1], stribeck = 1e-3;
    bst_assert_close(v + stribeck * 1.5 * atan(v / stribeck / 0.5), 0.04 / 0.28, 1e-7);
}

static void no_and_huge_friction(void **state) {
    (void)state;
    bst_mount_joints j = bare(2);
    j.joint[0].stuck = true;
    put(&j, (double[3]){0.0}, (double[3]){0.0, 1e-9, 0.0});
    for (int n = 0; n < 1000; n++) { /* free: the slowest motion goes on, and through zero */
        bst_mount_joints_step(&j, DT, (double[3]){0.0, -1e-9, 0.0}, still, still);
    }
    bst_assert_close(j.state.rate_radps[1], 1e-9 - 1e-9 / 0.28, 1e-20);

    j = bare(2);
    j.joint[1].coulomb_nm = j.joint[1].breakaway_nm = 1e9;
    put(&j, (double[3]){0.0}, (double[3]){0.0, 1.0, 0.0});
    bst_mount_joints_step(&j, DT, (double[3]){0.0, 1e6, 0.0}, still, still);
    assert_true(j.state.rate_radps[1] == 0.0);
    bst_assert_close(j.state.angle_rad[1], 0.5 * 0.28 / 1e9, 1e-12); /* 0.1 % of torque */
    /* it holds against the other axis' motion and against the body's */
    double push[3] = {5.0, 1e6, 0.0};
    for (int n = 0; n < 1000; n++) {
        bst_vec3 a = {0.0, 0.3 * sin(0.1 * n), 0.1}, b = {0.0, 0.3 * sin(0.1 * (n + 1)), 0.1};
        bst_mount_joints_step(&j, DT, push, a, b);
        assert_true(j.state.rate_radps[1] == 0.0);
    }
    assert_true(j.state.rate_radps[0] > 1.0);
}

/* Slow to and fro through zero rate at 1 kHz: each reversal is one stop and one break-away. */
static void reversals_do_not_chatter(void **state) {
    (void)state;
    bst_mount_joints j = bare(2);
    j.joint[0].stuck = true;
    j.joint[1].coulomb_nm = 0.02;
    j.joint[1].breakaway_nm = 0.03;
    bst_mount_joints_init(&j, (double[3]){0.0});
    double last = 0.0;
    int changes = 0;
    for (int n = 0; n < 20000; n++) {
        double push[3] = {0.0, 0.1 * sin(2.0 * BST_PI * 0.5 * n * DT), 0.0};
        bst_mount_joints_step(&j, DT, push, still, still);
        double v = j.state.rate_radps[1];
        changes += (v == 0.0) != (last == 0.0) || v * last < 0.0;
        last = v;
    }
    /* 20 half periods: a reversal passes rest, at the most one stop and one start each */
    assert_true(changes >= 20 && changes <= 41);
    assert_true(j.events <= 41);
}

static void stops_take_energy_and_never_give(void **state) {
    (void)state;
    const double restitution[] = {0.0, 0.5, 1.0};
    for (int r = 0; r < 3; r++) {
        bst_mount_joints j = bare(3);
        j.joint[1].min_rad = -0.5;
        j.joint[1].max_rad = 0.4;
        j.joint[1].restitution = restitution[r];
        put(&j, (double[3]){0.0}, (double[3]){0.3, 3.0, -0.5});
        double energy = bst_mount_joints_energy(&j, still);
        for (int n = 0; n < 5000; n++) {
            bst_mount_joints_step(&j, DT, (double[3]){0.0}, still, still);
            double now = bst_mount_joints_energy(&j, still);
            assert_true(now <= energy * (1.0 + 1e-9)); /* the coupling's error of a step */
            energy = now;
            assert_true(j.state.angle_rad[1] <= 0.4 && j.state.angle_rad[1] >= -0.5);
        }
        assert_true(isfinite(energy));
        assert_true(j.events > 0 && j.events < 100000);
    }
    /* the closed form of one bounce: in a step of 1 ms there and back */
    bst_mount_joints j = bare(2);
    j.joint[0].stuck = true;
    j.joint[1].max_rad = 0.1;
    j.joint[1].restitution = 0.5;
    put(&j, (double[3]){0.0}, (double[3]){0.0, 2.0, 0.0});
    for (int n = 0; n < 60; n++) {
        bst_mount_joints_step(&j, DT, (double[3]){0.0}, still, still);
    }
    bst_assert_close(j.state.rate_radps[1], -1.0, 1e-12);
    bst_assert_close(j.state.angle_rad[1], 0.1 - (0.06 - 0.05), 1e-12);
}

/* Pushed against its stop it comes to rest there, and leaves it when pulled. */
static void a_stop_holds_what_pushes_and_lets_go_what_pulls(void **state) {
    (void)state;
    bst_mount_joints j = bare(2);
    j.joint[0].stuck = true;
    j.joint[1].max_rad = 0.05;
    j.joint[1].restitution = 0.5;
    bst_mount_joints_init(&j, (double[3]){0.0});
    for (int n = 0; n < 3000; n++) {
        bst_mount_joints_step(&j, DT, (double[3]){0.0, 1.0, 0.0}, still, still);
    }
    assert_true(j.state.angle_rad[1] == 0.05 && j.state.rate_radps[1] == 0.0 && j.at_stop[1]);
    int64_t events = j.events;
    for (int n = 0; n < 100; n++) {
        bst_mount_joints_step(&j, DT, (double[3]){0.0, 1.0, 0.0}, still, still);
    }
    assert_int_equal(j.events, events);
    bst_mount_joints_step(&j, DT, (double[3]){0.0, -1.0, 0.0}, still, still);
    bst_assert_close(j.state.rate_radps[1], -DT / 0.28, 1e-12);
}

/* Past either pole on a great circle: until the azimuth is slower again, the outer axis turns at
 * its rate by way of the azimuth of the closest approach, at its time. */
static void the_outer_axis_passes_the_pole_in_time(void **state) {
    (void)state;
    const double limit = 0.1, rate = 0.06, offs[3] = {0.05, -0.2, 1.2};
    int limited = 0;
    for (int n = 0; n < 2 * 2 * 3 * 2; n++) {
        int type = n & 1 ? BST_MOUNT_AZIMUTH_ELEVATION : BST_MOUNT_CROSS_ELEVATION;
        double off = offs[n / 4 % 3], way = n / 12 ? 1.0 : -1.0;
        bst_vec3 pole = bst_vec3_scale(bst_mount_axis_body(type, 0), n & 2 ? 1.0 : -1.0);
        bst_vec3 side = bst_vec3_unit(bst_vec3_cross(pole, (bst_vec3){0.3, 0.5, 0.8}));
        /* closest to the pole at t = 0, by `off` towards `side` */
        bst_vec3 near = bst_vec3_axpy(bst_vec3_scale(pole, cos(off)), sin(off), side);
        bst_vec3 along = bst_vec3_scale(bst_vec3_cross(pole, side), way);
        bst_mount_pose middle = bst_mount_solve(type, near, bst_vec3_scale(along, rate), 0.0);
        for (double t = -9.75; t < 10.0; t += 0.5) {
            double a = rate * t;
            bst_vec3 d = bst_vec3_axpy(bst_vec3_scale(near, cos(a)), sin(a), along);
            bst_vec3 v = bst_vec3_axpy(bst_vec3_scale(near, -rate * sin(a)), rate * cos(a), along);
            bst_mount_pose pose = bst_mount_solve(type, d, v, 0.0);
            double angle, speed;
            bst_mount_pass_pole(type, d, v, limit, &pose, &angle, &speed);
            double azimuth = bst_wrap_angle(pose.angle_rad[0] - middle.angle_rad[0]);
            bool late = fabs(azimuth) > limit * fabs(t) && rate > limit * fabs(sin(off));
            double wanted = late ? copysign(limit * t, azimuth) : azimuth;
            bst_assert_close(bst_wrap_angle(angle - middle.angle_rad[0] - wanted), 0.0, 1e-9);
            bst_assert_close(speed, late ? copysign(limit, pose.rate_radps[0]) : pose.rate_radps[0],
                             1e-9);
            limited += late;
        }
    }
    assert_true(limited > 100);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_outer_axis_passes_the_pole_in_time),
        cmocka_unit_test(mass_matrix_is_that_of_the_kinetic_energy),
        cmocka_unit_test(bias_is_that_of_the_kinetic_energy),
        cmocka_unit_test(energy_is_kept_without_torque),
        cmocka_unit_test(momentum_of_body_and_mount_is_kept),
        cmocka_unit_test(cable_swings_at_its_frequency),
        cmocka_unit_test(flexible_mode_swings_at_its_frequencies),
        cmocka_unit_test(coulomb_friction_stops_in_time_and_place),
        cmocka_unit_test(stiction_holds_and_lets_go),
        cmocka_unit_test(no_and_huge_friction),
        cmocka_unit_test(reversals_do_not_chatter),
        cmocka_unit_test(stops_take_energy_and_never_give),
        cmocka_unit_test(a_stop_holds_what_pushes_and_lets_go_what_pulls),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
