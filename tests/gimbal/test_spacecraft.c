/* The whole spacecraft, closed loop, in surroundings of closed form. */
#include "sim/core/symmetric.h"
#include "tests/gimbal/craft_flight.h"

/* Each law is followed within what sensors and their noise leave, 20 arcsec, and its axis points
 * where its name says. */
static void test_laws(void **state) {
    (void)state;
    for (int law = BST_LAW_INERTIAL; law <= BST_LAW_TARGET; law++) {
        bst_spacecraft_config c = config_make((bst_spacecraft_law)law);
        c.initial_attitude_error_deg[0] = 3.0;
        flight f = start(&c, (uint64_t)law);
        fly(&f, 200.0 + f.dt_s); /* the last step is one of the controller's */
        double worst = 0.0;
        for (int i = 0; i < 300; i++) {
            worst = fmax(worst, off(fly(&f, 1.0)));
        }
        const bst_spacecraft_now *now = bst_spacecraft_at(f.craft);
        print_message("%s: within %.1f arcsec\n", bst_law_names[law], worst / BST_ARCSEC_RAD);
        assert_true(worst < 20.0 * BST_ARCSEC_RAD);
        bst_spacecraft_sky sky;
        bst_assert_ok(&ctx, sky_at(NULL, &ctx, f.dt_s * (double)(f.n - 1), &sky));
        bst_vec3 to =
            law == BST_LAW_NADIR ? bst_vec3_scale(sky.position_m, -1.0)
            : law == BST_LAW_SUN ? sky.sun_m
            : law == BST_LAW_TARGET
                ? sky.known.target
                : bst_quat_rotate(bst_quat_conj(bst_quat_unit((bst_quat){0.1, 0.3, -0.2, 0.9})),
                                  (bst_vec3){0, 0, 1});
        bst_vec3 axis =
            bst_quat_rotate(bst_quat_conj(now->body.q_body_from_gcrf), (bst_vec3){0, 0, 1});
        assert_true(bst_vec3_angle(axis, to) < 20.0 * BST_ARCSEC_RAD);
        assert_int_equal(now->wheel_flags, 0);
        bst_spacecraft_free(f.craft);
    }
}

/* A half turn about an axis that is none of the body's, and one of 179.999 deg, end where they
 * shall, in the time of the profile (accelerate, coast, brake), without turning back. */
static void test_half_turn(void **state) {
    (void)state;
    static const double turns[3][3] = {{180, 0, 0}, {0, -179.999, 0}, {103.923, 103.923, 103.923}};
    for (int i = 0; i < 3; i++) {
        bst_spacecraft_config c = config_make(BST_LAW_INERTIAL);
        memcpy(c.initial_attitude_error_deg, turns[i], sizeof c.initial_attitude_error_deg);
        flight f = start(&c, 0);
        double last = off(fly(&f, 20.0)), coast_s = 180.0 / c.attitude.rate_limit_degps;
        for (int s = 20; s < (int)coast_s; s++) {
            double now = off(fly(&f, 1.0));
            assert_true(now < last); /* ever nearer while it slews */
            last = now;
            double rate = bst_vec3_norm(bst_spacecraft_at(f.craft)->body.rate_radps);
            assert_true(rate < 1.02 * c.attitude.rate_limit_degps * BST_DEG_RAD);
        }
        assert_true(off(fly(&f, 60.0)) < 30.0 * BST_ARCSEC_RAD);
        bst_spacecraft_free(f.craft);
    }
}

/* q and -q are one attitude: the torque is the same. */
static void test_antipodal(void **state) {
    (void)state;
    bst_spacecraft_attitude_control_spec spec = {
        .natural_radps = 0.3,
        .damping = 0.9,
        .rate_limit_radps = 0.01,
        .accel_limit_radps2 = 0.001,
        .dt_s = 0.02,
        .inertia_kgm2 = {{{12, 0, 0}, {0, 14, 0}, {0, 0, 10}}}};
    bst_quat q = bst_quat_unit((bst_quat){0.2, -0.1, 0.3, 0.9});
    bst_quat wanted = bst_quat_unit((bst_quat){0.21, -0.1, 0.3, 0.9});
    bst_quat minus = {-q.x, -q.y, -q.z, -q.w};
    bst_spacecraft_attitude_reference r = {.q_body_from_gcrf = wanted};
    bst_spacecraft_attitude_control a, b;
    bst_spacecraft_attitude_control_init(&a, &spec);
    bst_spacecraft_attitude_control_init(&b, &spec);
    bst_vec3 t = bst_spacecraft_attitude_control_step(&a, &r, q, none, none, false);
    bst_vec3 u = bst_spacecraft_attitude_control_step(&b, &r, minus, none, none, false);
    assert_true(bst_vec3_norm(t) > 0.0);
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(t, u)), 0.0, 1e-15); /* rounding of a sign */
    /* at exactly half a turn there is a way, of full size, and noise does not turn it back */
    bst_spacecraft_attitude_control_init(&a, &spec);
    bst_quat half = bst_quat_mul((bst_quat){1, 0, 0, 0}, wanted);
    t = bst_spacecraft_attitude_control_step(&a, &r, half, none, none, false);
    bst_assert_close(fabs(t.x), 12.0 * 0.001, 1e-12); /* the acceleration limit */
    for (int i = 0; i < 20; i++) {
        double past = (i % 2 ? 1.0 : -1.0) * 1e-4;
        bst_quat near = bst_quat_mul(bst_quat_from_rotvec((bst_vec3){past, 0, 0}), half);
        u = bst_spacecraft_attitude_control_step(&a, &r, near, none, none, false);
        assert_true(u.x * t.x > 0.0);
    }
}

/* A torque that no wheel can hold for long: the wheels run up to their limit, say so, the body is
 * lost but nothing diverges; when the torque goes it comes back. */
static void test_saturated_wheels(void **state) {
    (void)state;
    bst_spacecraft_config c = config_make(BST_LAW_INERTIAL);
    bst_wheel_config *wheels = c.wheels.items;
    for (int i = 0; i < 4; i++) {
        wheels[i].speed_limit_rpm = 600.0; /* 0.063 N m s each, 0.145 about z */
    }
    flight f = {.dt_s = 1e-2};
    bst_assert_ok(&ctx, create(&c, f.dt_s, 0, &f.craft));
    bool flagged = false;
    for (int64_t n = 0; n < 120000; n++) {
        double t = f.dt_s * (double)n;
        bst_vec3 push = {0, 0, t < 200.0 ? 2e-3 : t < 400.0 ? -2e-3 : 0.0};
        bst_assert_ok(&ctx, bst_spacecraft_step(&ctx, f.craft, n, t, push));
        const bst_spacecraft_now *now = bst_spacecraft_at(f.craft);
        if (t == 60.0) { /* 0.12 N m s: held still */
            assert_true(off(now) < 1.0 * BST_DEG_RAD);
            assert_false(now->wheel_flags & BST_WHEELS_MOMENTUM_LIMIT);
        }
        flagged = flagged || (now->wheel_flags & BST_WHEELS_MOMENTUM_LIMIT) != 0;
        for (int i = 0; i < 4; i++) { /* a step's torque past the limit at most */
            assert_true(fabs(now->wheel_radps[i]) < 600.0 * BST_PI / 30.0 + 1.0);
        }
        bst_vec3 w = now->body.rate_radps;
        assert_true(isfinite(w.x + w.y + w.z) && bst_vec3_norm(w) < 0.05);
    }
    assert_true(flagged);
    assert_true(off(bst_spacecraft_at(f.craft)) < 60.0 * BST_ARCSEC_RAD);
    assert_int_equal(bst_spacecraft_at(f.craft)->wheel_flags, 0);
    bst_spacecraft_free(f.craft);
}

/* One of four failed: the others turn the body about all axes. Two failed: refused. */
static void test_failed_wheel(void **state) {
    (void)state;
    bst_spacecraft_config c = config_make(BST_LAW_NADIR);
    bst_wheel_config *wheels = c.wheels.items;
    wheels[2].failed = true;
    wheels[2].speed_rpm = 2000.0;
    wheels[2].coulomb_nm = 1e-3;
    wheels[2].viscous_nms = 1e-6;
    c.initial_attitude_error_deg[1] = 20.0;
    flight f = start(&c, 0);
    fly(&f, 600.0);
    assert_true(off(bst_spacecraft_at(f.craft)) < 30.0 * BST_ARCSEC_RAD);
    bst_assert_close(bst_spacecraft_at(f.craft)->wheel_radps[2], 0.0, 1e-6); /* run down, held */
    bst_spacecraft_free(f.craft);
    wheels[0].failed = true;
    bst_spacecraft *refused = NULL;
    assert_int_equal(create(&c, 1e-2, 0, &refused), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "three axes"));
}

/* Without stars for an hour the attitude is known as the gyro keeps it, and the filter knows how
 * badly; the first measurement afterwards mends it. */
static void test_blind_for_an_hour(void **state) {
    (void)state;
    enum { RUNS = 12 };
    radius_m = 1e9; /* the Earth hides nothing */
    double sum = 0.0;
    for (int run = 0; run < RUNS; run++) {
        bst_spacecraft_config c = config_make(BST_LAW_INERTIAL);
        bst_spacecraft_star_tracker_config *tracker = c.star_trackers.items;
        tracker->outage_s[0] = 600.0;
        tracker->outage_s[1] = 4200.0;
        c.star_trackers.count = 1;
        tracker->earth_exclusion_deg = 0.0;
        tracker->sun_exclusion_deg = 0.0;
        c.disturbances.gravity_gradient = false;
        c.gyro.rate_hz = 10.0;
        c.attitude.rate_hz = 10.0;
        tracker->rate_hz = 1.0;
        flight f = {.dt_s = 0.05};
        bst_assert_ok(&ctx, create(&c, f.dt_s, (uint64_t)run, &f.craft));
        fly(&f, 4199.0);
        const bst_spacecraft_now *now = bst_spacecraft_at(f.craft);
        assert_false(now->tracked);
        const bst_attitude_filter *filter = bst_spacecraft_filter(f.craft);
        bst_vec3 e =
            bst_attitude_filter_error(now->body.q_body_from_gcrf, filter->q_body_from_gcrf);
        double x[3] = {e.x, e.y, e.z}, p[9], inverse[9];
        for (int i = 0; i < 9; i++) {
            p[i] = filter->covariance[i / 3][i % 3];
        }
        assert_true(bst_symmetric_invert(3, p, inverse));
        for (int i = 0; i < 9; i++) {
            sum += x[i / 3] * inverse[i] * x[i % 3] / RUNS;
        }
        /* an hour of random walks: rrw t^1.5 / sqrt(3), 0.0058 deg at 0.01 deg/h^1.5; arw 0.005
         * deg; the bias known to 0.01 deg/h and better */
        assert_true(bst_vec3_norm(e) > 1.0 * BST_ARCSEC_RAD);
        assert_true(bst_vec3_norm(e) < 0.1 * BST_DEG_RAD);
        bst_spacecraft_free(f.craft);
    }
    radius_m = 7e6;
    print_message("attitude NEES after an hour without stars %.2f of 3\n", sum);
    /* the mean of 12 chi-square numbers of 3 degrees, 3.3 sigma */
    bst_assert_close(sum, 3.0, 3.3 * sqrt(6.0 / RUNS));
}

/* Nothing controls it: turned about the intermediate axis it tumbles, momentum and norm kept, and
 * the filter follows. */
static void test_free_tumble(void **state) {
    (void)state;
    bst_spacecraft_config c = config_make(BST_LAW_FREE);
    static const double inertia[6] = {6, 12, 14, 0, 0, 0};
    memcpy(c.inertia_kgm2, inertia, sizeof inertia);
    c.disturbances.gravity_gradient = false;
    c.initial_rate_degps[1] = 1.5;
    c.initial_rate_degps[2] = 0.05;
    flight f = {.dt_s = 1e-2};
    bst_assert_ok(&ctx, create(&c, f.dt_s, 0, &f.craft));
    fly(&f, 1.0);
    bst_vec3 l = bst_spacecraft_body_momentum(bst_spacecraft_dynamics(f.craft));
    double lowest = 1.0;
    for (int i = 0; i < 2000; i++) {
        const bst_spacecraft_now *now = fly(&f, 1.0);
        lowest = fmin(lowest, now->body.rate_radps.y);
        assert_true(bst_vec3_norm(bst_attitude_filter_error(now->body.q_body_from_gcrf,
                                                            now->q_believed_from_gcrf)) <
                    60.0 * BST_ARCSEC_RAD);
    }
    assert_true(lowest < -1.4 * BST_DEG_RAD); /* it turned over */
    bst_vec3 end = bst_spacecraft_body_momentum(bst_spacecraft_dynamics(f.craft));
    /* the motors stand still, so all that moves momentum is rounding */
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(end, l)) / bst_vec3_norm(l), 0.0, 1e-12);
    bst_spacecraft_free(f.craft);
}

static void test_refused(void **state) {
    (void)state;
    bst_spacecraft *craft = NULL;
    bst_spacecraft_config c = config_make(BST_LAW_NADIR);
    c.attitude.second_axis[0] = 0.0;
    c.attitude.second_axis[2] = -2.0;
    assert_int_equal(create(&c, 1e-2, 0, &craft), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "platform/spacecraft: attitude/second_axis"));
    c = config_make(BST_LAW_NADIR);
    c.gyro.rate_hz = 30.0;
    assert_int_equal(create(&c, 1e-2, 0, &craft), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "platform/spacecraft: gyro/rate_hz"));
    /* 100 Hz over 3 and 4; nothing is faster than the plant */
    assert_non_null(strstr(ctx.message, "rates that do are 33.3333 and 25 Hz"));
    c.gyro.rate_hz = 250.0;
    assert_int_equal(create(&c, 1e-2, 0, &craft), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "rates that do are 100 and 50 Hz"));
    c.gyro.rate_hz = 30.0;
}

/* The same for who errs in its orbit: it believes to be 100 km further north. */
static bst_status sky_at_wrongly(void *user, bst_ctx *c, double seconds, bst_spacecraft_sky *out) {
    BST_TRY(sky_at(user, c, seconds, out));
    out->known.position_m.z += 1e5;
    return BST_OK;
}

/* The law goes by what is known: with a wrong orbit the axis points where the Earth is believed to
 * be. */
static void test_wrong_orbit(void **state) {
    (void)state;
    bst_spacecraft_config c = config_make(BST_LAW_NADIR);
    bst_spacecraft_setup setup = {.dt_s = 1e-2,
                                  .q_nominal = BST_QUAT_IDENTITY,
                                  .sky_at = sky_at_wrongly,
                                  .seed = 7,
                                  .instance = "craft"};
    flight f = {.dt_s = 1e-2};
    bst_assert_ok(&ctx, bst_spacecraft_create(&ctx, &c, &setup, &f.craft));
    const bst_spacecraft_now *now = fly(&f, 60.0 + f.dt_s);
    bst_spacecraft_sky sky;
    bst_assert_ok(&ctx, sky_at_wrongly(NULL, &ctx, 60.0, &sky));
    bst_vec3 axis = bst_quat_rotate(bst_quat_conj(now->body.q_body_from_gcrf), (bst_vec3){0, 0, 1});
    double believed = bst_vec3_angle(axis, bst_vec3_scale(sky.known.position_m, -1.0));
    double really = bst_vec3_angle(axis, bst_vec3_scale(sky.position_m, -1.0));
    assert_true(believed < 30.0 * BST_ARCSEC_RAD); /* sensors and control */
    assert_true(really > 0.4 * BST_DEG_RAD);       /* 100 km across 7000, partly along the way */
    bst_spacecraft_free(f.craft);
}

/* A filter that has been running begins as well as it goes on: as its covariance says, and no worse
 * than minutes later; alignment errors and scale factors are as it has come to terms with them. */
static void test_running(void **state) {
    (void)state;
    enum { RUNS = 40, TIMES = 4 };
    const double at_s[TIMES] = {0.01, 10.0, 60.0, 200.0};
    double nees[TIMES] = {0.0}, square[2][TIMES] = {{0.0}};
    for (int wrong = 0; wrong < 2; wrong++) {
        for (uint64_t run = 0; run < RUNS / (1u + 3u * (unsigned)wrong); run++) {
            bst_spacecraft_config c = config_make(BST_LAW_NADIR);
            c.filter_warm_up_s = 600.0;
            if (wrong) {
                c.gyro.scale_factor_ppm[1] = 3000.0;
                c.gyro.misalignment_arcsec[0] = 200.0;
            }
            flight f = start(&c, 100 + run);
            for (int k = 0; k < TIMES; k++) {
                const bst_spacecraft_now *now = fly(&f, at_s[k] - (k ? at_s[k - 1] : 0.0));
                const bst_attitude_filter *filter = bst_spacecraft_filter(f.craft);
                bst_vec3 e =
                    bst_attitude_filter_error(now->body.q_body_from_gcrf, filter->q_body_from_gcrf);
                double x[3] = {e.x, e.y, e.z}, p[9], inverse[9];
                for (int i = 0; i < 9; i++) {
                    p[i] = filter->covariance[i / 3][i % 3];
                }
                assert_true(bst_symmetric_invert(3, p, inverse));
                square[wrong][k] += bst_vec3_dot(e, e);
                for (int i = 0; i < 9 && !wrong; i++) {
                    nees[k] += x[i / 3] * inverse[i] * x[i % 3] / RUNS;
                }
            }
            bst_spacecraft_free(f.craft);
        }
    }
    for (int k = 0; k < TIMES; k++) {
        double rms = sqrt(square[0][k] / RUNS) / BST_ARCSEC_RAD;
        double rms_wrong = sqrt(square[1][k] / (RUNS / 4)) / BST_ARCSEC_RAD;
        print_message("%g s: NEES %.2f of 3, off by %.2f arcsec, with a wrong gyro %.2f\n", at_s[k],
                      nees[k], rms, rms_wrong);
        /* the mean of 40 chi-square numbers of 3 degrees, 3.3 sigma */
        bst_assert_close(nees[k], 3.0, 3.3 * sqrt(6.0 / RUNS));
        assert_true(rms < 3.0 && rms_wrong < 5.0);
    }
}

/* A commanded roll: about the law's axis, within the limits of a slew, to rest, and back. */
static void test_roll_on_command(void **state) {
    (void)state;
    bst_spacecraft_config c = config_make(BST_LAW_NADIR);
    flight f = start(&c, 3), still = start(&c, 3);
    fly(&f, 10.0);
    fly(&still, 10.0);
    const double to[2] = {-0.6, 0.0};
    for (int k = 0; k < 2; k++) {
        bst_spacecraft_command_roll(f.craft, to[k]);
        double fastest = 0.0;
        for (int i = 0; i < 300; i++) {
            const bst_body_roll *roll = &fly(&f, 0.5)->roll;
            fastest = fmax(fastest, fabs(roll->rate_radps));
        }
        const bst_spacecraft_now *now = bst_spacecraft_at(f.craft), *other = fly(&still, 150.0);
        /* 0.95 of 0.5 deg/s; the shaper's approach is exponential at the end */
        bst_assert_close(fastest / BST_DEG_RAD, 0.475, 0.005);
        bst_assert_close(now->roll.angle_rad, to[k], 1e-6);
        bst_quat rolled =
            bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(now->roll.axis_body, -to[k])),
                         other->reference.q_body_from_gcrf);
        bst_assert_close(
            bst_vec3_norm(bst_attitude_filter_error(now->reference.q_body_from_gcrf, rolled)), 0.0,
            1e-6);
        assert_true(off(now) < 30.0 * BST_ARCSEC_RAD); /* sensors and control, as without */
    }
    bst_spacecraft_free(f.craft);
    bst_spacecraft_free(still.craft);
}

/* One seed gives one flight to the bit, another another. */
static void test_repeats(void **state) {
    (void)state;
    bst_quat q[3];
    for (int i = 0; i < 3; i++) {
        bst_spacecraft_config c = config_make(BST_LAW_NADIR);
        flight f = start(&c, i < 2 ? 5 : 6);
        q[i] = fly(&f, 20.0)->body.q_body_from_gcrf;
        bst_spacecraft_free(f.craft);
    }
    assert_memory_equal(&q[0], &q[1], sizeof q[0]);
    assert_true(memcmp(&q[0], &q[2], sizeof q[0]) != 0);
}

/* The sets that are taken where a scenario gives none are those of the tables' defaults. */
static void test_sets(void **state) {
    (void)state;
    static const char text[] =
        "{\"wheels\": [{\"axis\": [1, 1, 1]}], \"star_trackers\": "
        "[{\"axis\": [0, 1, 0]}]}";
    bst_json *json = NULL;
    bst_spacecraft_config c, none_given = {.attitude.law = BST_LAW_NADIR};
    bst_assert_ok(&ctx, bst_json_parse(&ctx, "text", text, strlen(text), &json));
    bst_assert_ok(&ctx, bst_config_read(&ctx, json, bst_json_root(json), "",
                                        bst_spacecraft_config_table, &c));
    int wheels, trackers;
    const bst_wheel_config *wheel = bst_spacecraft_wheels(&none_given, &wheels);
    const bst_spacecraft_star_tracker_config *tracker =
        bst_spacecraft_trackers(&none_given, &trackers);
    assert_int_equal(wheels, 4);
    assert_int_equal(trackers, 2);
    /* names of members, for padding has no member */
    const bst_wheel_config *w = c.wheels.items;
    const bst_spacecraft_star_tracker_config *t = c.star_trackers.items;
    assert_memory_equal(w, wheel, offsetof(bst_wheel_config, failed));
    assert_false(w->failed || wheel->failed);
    assert_memory_equal(t, tracker, sizeof *t);
    none_given.attitude.law = BST_LAW_FREE;
    (void)bst_spacecraft_wheels(&none_given, &wheels);
    assert_int_equal(wheels, 0);
    bst_config_free(bst_spacecraft_config_table, &c);
    bst_json_free(json);
}

/* A wheel of the free craft spins up from a torque of the mount's reaction: without control its
 * rate is the impulse over its inertia, modes or no modes once these are damped out. */
static void test_reaction(void **state) {
    (void)state;
    bst_spacecraft_config c = config_make(BST_LAW_FREE);
    c.disturbances.gravity_gradient = false;
    bst_spacecraft_mode_config mode = {0.8, 0.2, {1.0, 0.0, 0.0}};
    c.modes = (bst_config_list){&mode, 1};
    c.wheels.count = 0;
    flight f = start(&c, 0);
    for (; f.n < 20000; f.n++) {
        bst_vec3 push = {f.n <= 100 && f.n > 0 ? 0.012 : 0.0, 0, 0};
        bst_assert_ok(&ctx, bst_spacecraft_step(&ctx, f.craft, f.n, f.dt_s * (double)f.n, push));
    }
    /* 0.012 N m for 1 s on 12 kg m^2; the mode's swing has gone by exp(-2 z w t) */
    bst_assert_close(bst_spacecraft_at(f.craft)->body.rate_radps.x, 1e-3, 1e-12);
    bst_spacecraft_free(f.craft);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_laws),
                                       cmocka_unit_test(test_half_turn),
                                       cmocka_unit_test(test_antipodal),
                                       cmocka_unit_test(test_saturated_wheels),
                                       cmocka_unit_test(test_failed_wheel),
                                       cmocka_unit_test(test_blind_for_an_hour),
                                       cmocka_unit_test(test_free_tumble),
                                       cmocka_unit_test(test_wrong_orbit),
                                       cmocka_unit_test(test_repeats),
                                       cmocka_unit_test(test_running),
                                       cmocka_unit_test(test_roll_on_command),
                                       cmocka_unit_test(test_sets),
                                       cmocka_unit_test(test_reaction),
                                       cmocka_unit_test(test_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
