#include "gimbal/spacecraft/wheels.h"
#include "tests/test_support.h"

static bst_ctx ctx;

static bst_wheels make(bst_wheel_config *config, int count) {
    bst_wheels wheels;
    bst_assert_ok(
        &ctx, bst_wheels_init(&ctx, &wheels, config, count, bst_rng_make_key(1, 0, "a", "wheels")));
    return wheels;
}

static bst_wheel_config wheel(double x, double y, double z) {
    return (bst_wheel_config){.axis = {x, y, z},
                              .inertia_kgm2 = 1e-3,
                              .torque_limit_nm = 0.05,
                              .speed_limit_rpm = 6000.0};
}

static bst_vec3 given(const bst_wheels *wheels, const double *motor) {
    bst_vec3 sum = {0, 0, 0};
    for (int i = 0; i < wheels->count; i++) {
        sum = bst_vec3_axpy(sum, -motor[i], wheels->wheel[i].axis);
    }
    return sum;
}

/* Three to eight wheels give what is asked, with the least sum of squares: nothing along the null
 * space. */
static void test_shares(void **state) {
    (void)state;
    for (int count = 3; count <= 8; count++) {
        bst_wheel_config config[8];
        for (int i = 0; i < count; i++) {
            double a = 2.4 * i;
            config[i] = wheel(cos(a), sin(a), 0.7 + 0.1 * (i % 3));
        }
        bst_wheels wheels = make(config, count);
        double speed[8] = {0}, motor[8];
        bst_vec3 want = {1e-3, -2e-3, 3e-3};
        assert_int_equal(bst_wheels_share(&wheels, speed, want, motor), 0);
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(given(&wheels, motor), want)), 0.0, 1e-16);
        /* the pseudo-inverse's solution is -a . x for one vector x: rank three of four and more */
        if (count > 3) {
            bst_vec3 a = wheels.wheel[0].axis, b = wheels.wheel[1].axis, c = wheels.wheel[2].axis,
                     d = wheels.wheel[3].axis;
            double det = bst_vec3_dot(a, bst_vec3_cross(b, c));
            double ka = bst_vec3_dot(d, bst_vec3_cross(b, c)) / det,
                   kb = bst_vec3_dot(a, bst_vec3_cross(d, c)) / det,
                   kc = bst_vec3_dot(a, bst_vec3_cross(b, d)) / det;
            bst_assert_close(motor[3], ka * motor[0] + kb * motor[1] + kc * motor[2], 1e-16);
        }
    }
}

static void test_limits(void **state) {
    (void)state;
    bst_wheel_config config[4] = {wheel(1, 1, 1), wheel(-1, 1, 1), wheel(-1, -1, 1),
                                  wheel(1, -1, 1)};
    bst_wheels wheels = make(config, 4);
    double speed[4] = {0}, motor[4];
    /* too much torque: the direction stays, the largest is at its limit */
    bst_vec3 want = {1.0, 0.5, 0.0};
    assert_int_equal(bst_wheels_share(&wheels, speed, want, motor), BST_WHEELS_TORQUE_LIMIT);
    bst_vec3 got = given(&wheels, motor);
    bst_assert_close(bst_vec3_angle(got, want), 0.0, 1e-15);
    double most = 0.0;
    for (int i = 0; i < 4; i++) {
        most = fmax(most, fabs(motor[i]));
    }
    bst_assert_close(most, 0.05, 1e-16);
    /* a wheel at its greatest speed that would go faster: the three others give it all */
    want = (bst_vec3){1e-3, 1e-3, 1e-3};
    speed[0] = -6000.0 * BST_PI / 30.0;
    assert_int_equal(bst_wheels_share(&wheels, speed, want, motor), BST_WHEELS_MOMENTUM_LIMIT);
    bst_assert_close(motor[0], 0.0, 0.0);
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(given(&wheels, motor), want)), 0.0, 1e-16);
    /* and slower it may */
    want = bst_vec3_scale(want, -1.0);
    assert_int_equal(bst_wheels_share(&wheels, speed, want, motor), 0);
    assert_true(motor[0] > 0.0);
    /* two left: what they span, the best they can */
    wheels.wheel[0].torque_limit_nm = wheels.wheel[1].torque_limit_nm = 0.0;
    want = (bst_vec3){0, 0, 1e-3};
    assert_int_equal(bst_wheels_share(&wheels, speed, want, motor), BST_WHEELS_SHORT);
    got = given(&wheels, motor);
    bst_vec3 rest = bst_vec3_sub(got, want);
    bst_assert_close(bst_vec3_dot(rest, wheels.wheel[2].axis), 0.0, 1e-18);
    bst_assert_close(bst_vec3_dot(rest, wheels.wheel[3].axis), 0.0, 1e-18);
    /* none left */
    wheels.wheel[2].torque_limit_nm = wheels.wheel[3].torque_limit_nm = 0.0;
    assert_int_equal(bst_wheels_share(&wheels, speed, want, motor), BST_WHEELS_SHORT);
    bst_assert_close(bst_vec3_norm(given(&wheels, motor)), 0.0, 0.0);
}

/* Coulomb friction runs a wheel down in J W / T and holds it; it never turns it round, whatever its
 * size; the motor breaks it loose above T only. */
static void test_friction(void **state) {
    (void)state;
    for (int huge = 0; huge < 2; huge++) {
        bst_wheel_config config = wheel(0, 0, 1);
        config.coulomb_nm = huge ? 1e3 : 1e-3;
        bst_wheels wheels = make(&config, 1);
        double dt = 1e-3, speed = 100.0;
        int steps = 0;
        while (speed != 0.0 && steps < 1000000) {
            double before = speed;
            speed += dt / 1e-3 * bst_wheel_torque(&wheels.wheel[0], speed, 0.0, 1e-3, dt);
            assert_true(speed >= -1e-12 && speed < before);
            speed = fabs(speed) < 1e-12 ? 0.0 : speed; /* rounding of the last step */
            steps++;
        }
        bst_assert_close(steps * dt, huge ? dt : 100.0, 1.5 * dt);
        double hold = bst_wheel_torque(&wheels.wheel[0], 0.0, 0.9 * config.coulomb_nm, 1e-3, dt);
        bst_assert_close(hold, 0.0, 0.0);
        /* viscous friction slows either way of turning */
        bst_wheel viscous = {.viscous_nms = 2e-5, .speed_limit_radps = 500.0};
        for (int way = -1; way <= 1; way += 2) {
            double torque = bst_wheel_torque(&viscous, way * 300.0, 1e-3, 1e-3, dt);
            bst_assert_close(torque, 1e-3 - way * 6e-3, 1e-15);
        }
        double loose = bst_wheel_torque(&wheels.wheel[0], 0.0, 1.5 * config.coulomb_nm, 1e-3, dt);
        bst_assert_close(loose / config.coulomb_nm, 0.5, 1e-12);
    }
}

static void test_imbalance(void **state) {
    (void)state;
    bst_wheel_config config = wheel(0, 0, 2);
    config.static_imbalance_kgm = 1e-5;
    config.dynamic_imbalance_kgm2 = 2e-6;
    config.position_m[0] = 0.3;
    bst_wheels wheels = make(&config, 1);
    /* force m r W^2 in the plane of the wheel; at 0.3 m along x it turns about z only; dynamic, in
     * the plane */
    double w = 200.0, phase = 0.7;
    bst_vec3 t = {0, 0, 0};
    bst_wheel_imbalance(&wheels.wheel[0], phase, w, &t);
    bst_assert_close(hypot(t.x, t.y), 2e-6 * w * w, 1e-15);
    bst_vec3 amplitude = bst_wheel_imbalance_amplitude(&wheels.wheel[0], w);
    bst_assert_close(amplitude.z, 0.3 * 1e-5 * w * w, 1e-15);
    bst_assert_close(amplitude.x, 2e-6 * w * w, 1e-15);
}

static void test_refused(void **state) {
    (void)state;
    bst_wheel_config config[2] = {wheel(0, 0, 1), wheel(0, 0, 0)};
    bst_wheels wheels;
    bst_rng_key key = {{0, 0}};
    assert_int_equal(bst_wheels_init(&ctx, &wheels, config, 2, key), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "wheels/1/axis"));
    config[1] = wheel(1, 0, 0);
    config[1].speed_rpm = -6001.0;
    assert_int_equal(bst_wheels_init(&ctx, &wheels, config, 2, key), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "wheels/1/speed_rpm"));
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_shares), cmocka_unit_test(test_limits),
                                       cmocka_unit_test(test_friction),
                                       cmocka_unit_test(test_imbalance),
                                       cmocka_unit_test(test_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
