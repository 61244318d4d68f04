#include "gimbal/spacecraft/disturbance.h"
#include "gimbal/spacecraft/pointing_law.h"
#include "sim/astro/bodies.h"
#include "sim/astro/forces.h"
#include "tests/test_support.h"

/* A dumbbell, two masses of 1 kg at +-d along one body axis: the torque is that of Newton's forces
 * on both, taken apart; the series that the formula ends leaves (d / r)^2. */
static void test_gravity_gradient(void **state) {
    (void)state;
    double d = 100.0;
    bst_vec3 arm = {0.6 * d, 0.0, 0.8 * d}, place = {5e6, -3e6, 4e6};
    bst_mat3 inertia = {{{0}}};
    double a[3] = {arm.x, arm.y, arm.z};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            inertia.m[i][j] = 2.0 * ((i == j ? d * d : 0.0) - a[i] * a[j]);
        }
    }
    bst_quat q = bst_quat_unit((bst_quat){0.3, -0.2, 0.5, 0.8});
    bst_vec3 expected = {0, 0, 0};
    for (int s = -1; s <= 1; s += 2) {
        bst_vec3 lever = bst_vec3_scale(arm, s);
        bst_vec3 there = bst_vec3_add(bst_quat_rotate(q, place), lever);
        double r = bst_vec3_norm(there);
        expected = bst_vec3_add(
            expected,
            bst_vec3_cross(lever, bst_vec3_scale(there, -BST_EARTH_MU_M3PS2 / (r * r * r))));
    }
    bst_vec3 torque = bst_gravity_gradient_torque(&inertia, q, place);
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(torque, expected)) / bst_vec3_norm(expected), 0.0,
                     1e-8); /* cancellation in Newton's forces: 1e-16 r / d */
    /* none about the way to the Earth */
    bst_assert_close(bst_vec3_dot(torque, bst_vec3_unit(bst_quat_rotate(q, place))), 0.0,
                     1e-15 * bst_vec3_norm(torque));
}

static void test_sunlight(void **state) {
    (void)state;
    bst_disturbance_config c = {
        .srp_area_m2 = 3.0, .cr = 1.5, .centre_of_pressure_m = {0.0, 0.0, 0.2}};
    bst_vec3 sun = {2.0 * BST_AU_M, 0, 0};
    bst_vec3 t = bst_spacecraft_solar_torque(&c, BST_QUAT_IDENTITY, sun, 1.0);
    /* force along -x at +z: about -y; a quarter of it at 2 au */
    double expected = BST_SUNLIGHT_PRESSURE_PA * 3.0 * 1.5 * 0.2 / 4.0;
    bst_assert_close(t.y, -expected, 1e-20);
    bst_assert_close(hypot(t.x, t.z), 0.0, 1e-20);
    bst_mat3 inertia = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    bst_vec3 place = {-7e6, 0, 0}, none = {0, 0, 0};
    t = bst_disturbance_torque(&c, &inertia, BST_QUAT_IDENTITY, place, sun, 0.0, none);
    bst_assert_close(bst_vec3_norm(t), 0.0, 0.0); /* dark */
    t = bst_disturbance_torque(&c, &inertia, BST_QUAT_IDENTITY, place, sun, 0.5, none);
    bst_assert_close(t.y, -0.5 * expected, 1e-20);
}

static void test_magnetic(void **state) {
    (void)state;
    double r = 6371.2e3;
    bst_vec3 equator = bst_spacecraft_dipole_field_t((bst_vec3){r, 0, 0});
    bst_assert_close(equator.z, 29404.8e-9, 1e-18); /* northwards */
    bst_vec3 pole = bst_spacecraft_dipole_field_t((bst_vec3){0, 0, 2.0 * r});
    bst_assert_close(pole.z, -2.0 * 29404.8e-9 / 8.0, 1e-18); /* downwards, r^-3 */
    /* unloading never adds momentum: torque . h <= 0, and takes 1 / 600 s of what is across */
    bst_vec3 h = {0.1, -0.2, 0.05}, b = {1e-5, 2e-5, -2e-5};
    bst_vec3 m = bst_spacecraft_unload_dipole(h, b, 1e9), t = bst_vec3_cross(m, b);
    bst_vec3 along = bst_vec3_unit(b);
    bst_vec3 across = bst_vec3_axpy(h, -bst_vec3_dot(h, along), along);
    bst_assert_close(bst_vec3_norm(bst_vec3_add(t, bst_vec3_scale(across, 1.0 / BST_UNLOAD_S))),
                     0.0, 1e-18);
    m = bst_spacecraft_unload_dipole(h, b, 1.0);
    assert_true(fmax(fabs(m.x), fmax(fabs(m.y), fabs(m.z))) <= 1.0);
}

/* One place off all axes, everything on: parts by numpy from the laws (gravity gradient 3 mu / r^5
 * r x J r, lever x force, dipole x field, h x B / |B|^2), field and force apart. */
static void test_sum_of_all(void **state) {
    (void)state;
    const bst_mat3 inertia = {{{120, -3, 5}, {-3, 90, 2}, {5, 2, 150}}};
    const bst_quat q = bst_quat_unit((bst_quat){0.1, -0.2, 0.3, 0.9});
    const bst_vec3 place = {4200e3, -3100e3, 4700e3}, sun = {0.9e11, -1.1e11, 0.4e11};
    const bst_vec3 momentum = {0.4, -0.3, 0.6}, none = {0, 0, 0};
    const double gradient[3] = {-4.458495018841054e-05, -3.176880470864664e-05,
                                1.696826675407855e-05};
    const double per_newton[3] = {-8.348434477804589e-02, -2.665652989966814e-01,
                                  -5.653551273184501e-02};
    const double magnetic[3] = {5.564022722561540e-06, -5.155126176455868e-05,
                                -2.089310240322725e-05};
    const double unloading[3] = {2.506803319974646e+03, -9.139166401527926e+03,
                                 -6.240785414080395e+03}; /* dipole times 600 s */
    const double field[3] = {-2.633616200412180e-05, 1.943859576494705e-05,
                             -7.529064889054064e-06}; /* GCRF */
    bst_vec3 b = bst_spacecraft_dipole_field_t(place);
    bst_assert_close(b.x, field[0], 1e-17);
    bst_assert_close(b.y, field[1], 1e-17);
    bst_assert_close(b.z, field[2], 1e-17);
    double force =
        1361.0 / 299792458.0 * 3.0 * 1.5 * 0.6 / (0.9869674609100836 * 0.9869674609100836);
    bst_disturbance_config c = {.gravity_gradient = true,
                                .srp_area_m2 = 3.0,
                                .cr = 1.5,
                                .centre_of_pressure_m = {0.3, -0.2, 0.5},
                                .residual_dipole_am2 = {2, -1, 3},
                                .constant_torque_nm = {1e-5, -2e-5, 3e-5}};
    bst_vec3 t = bst_disturbance_torque(&c, &inertia, q, place, sun, 0.6, none);
    bst_assert_close(t.x, 1e-5 + gradient[0] + force * per_newton[0] + magnetic[0], 1e-15);
    bst_assert_close(t.y, -2e-5 + gradient[1] + force * per_newton[1] + magnetic[1], 1e-15);
    bst_assert_close(t.z, 3e-5 + gradient[2] + force * per_newton[2] + magnetic[2], 1e-15);
    /* torquers alone, each clipped by itself */
    bst_vec3 body = bst_quat_rotate(q, b), m = bst_spacecraft_unload_dipole(momentum, body, 12.0);
    bst_assert_close(m.x, unloading[0] / 600.0, 1e-12);
    bst_assert_close(m.y, -12.0, 0.0);
    bst_assert_close(m.z, unloading[2] / 600.0, 1e-12);
    c = (bst_disturbance_config){.unload_dipole_am2 = 12.0};
    t = bst_disturbance_torque(&c, &inertia, q, place, sun, 0.6, momentum);
    bst_assert_close(t.x, m.y * body.z - m.z * body.y, 1e-18);
    bst_assert_close(t.y, m.z * body.x - m.x * body.z, 1e-18);
    bst_assert_close(t.z, m.x * body.y - m.y * body.x, 1e-18);
}

/* Axis and second axis go where each law says; the roll turns about the axis alone. */
static void test_laws(void **state) {
    (void)state;
    bst_spacecraft_law_inputs in = {.position_m = {7e6, 1e6, -2e6},
                                    .velocity_mps = {-1e3, 7e3, 1e3},
                                    .sun_m = {1e11, -5e10, 3e10},
                                    .target = {0.1, 0.2, 0.97}};
    bst_pointing_law law = {.q_nominal = bst_quat_unit((bst_quat){0.2, 0.4, -0.1, 0.8}),
                            .axis = bst_vec3_unit((bst_vec3){1, 2, 3}),
                            .second_axis = bst_vec3_unit((bst_vec3){0, 1, -1})};
    bst_vec3 nominal_second = bst_quat_rotate(bst_quat_conj(law.q_nominal), law.second_axis);
    for (int k = 0; k < 2; k++) {
        law.roll_rad = k * 0.4;
        static const bst_spacecraft_law laws[3] = {BST_LAW_NADIR, BST_LAW_SUN, BST_LAW_TARGET};
        for (int i = 0; i < 3; i++) {
            law.law = laws[i];
            bst_quat back = bst_quat_conj(bst_pointing_law_attitude(&law, &in));
            bst_vec3 to = i == 0   ? bst_vec3_scale(in.position_m, -1.0)
                          : i == 1 ? in.sun_m
                                   : in.target;
            bst_vec3 hint = i == 0 ? in.velocity_mps : nominal_second;
            bst_vec3 axis = bst_quat_rotate(back, law.axis);
            bst_assert_close(bst_vec3_angle(axis, to), 0.0, 1e-15);
            /* the planes of axis and second axis agree up to the roll */
            bst_vec3 plane =
                bst_vec3_unit(bst_vec3_cross(axis, bst_quat_rotate(back, law.second_axis)));
            bst_vec3 wanted = bst_vec3_unit(bst_vec3_cross(to, hint));
            bst_assert_close(bst_vec3_angle(plane, wanted), law.roll_rad, 1e-15);
            bst_assert_close(bst_vec3_dot(bst_vec3_cross(wanted, plane), axis), sin(law.roll_rad),
                             1e-15); /* a right-handed turn of the body */
        }
    }
    law.law = BST_LAW_TARGET;
    law.roll_rad = 0.0;
    in.target = (bst_vec3){0, 0, 0};
    bst_quat q = bst_pointing_law_attitude(&law, &in);
    bst_assert_close(q.w, law.q_nominal.w, 1e-15); /* not known: the nominal */
    in.target = nominal_second;                    /* both directions together: still an attitude */
    q = bst_pointing_law_attitude(&law, &in);
    bst_assert_close(bst_vec3_angle(bst_quat_rotate(bst_quat_conj(q), law.axis), in.target), 0.0,
                     1e-14);
}

/* The motion between nodes of a body that cones: rates against the derivative of the attitude. */
static void test_reference(void **state) {
    (void)state;
    bst_quat node[4];
    double step = 0.25;
    for (int k = 0; k < 4; k++) {
        double t = step * k;
        node[k] = bst_quat_mul(bst_quat_from_rotvec((bst_vec3){0, 0, -0.03 * t}),
                               bst_quat_from_rotvec((bst_vec3){0.2 * sin(0.1 * t), -0.02 * t, 0}));
    }
    for (int i = 0; i < 3; i++) {
        double place = 1.2 + 0.3 * i, h = 1e-3;
        bst_spacecraft_attitude_reference a = bst_spacecraft_attitude_reference_at(
                                              node, step, place - h / step),
                                          b = bst_spacecraft_attitude_reference_at(node, step,
                                                                                   place),
                                          c = bst_spacecraft_attitude_reference_at(
                                              node, step, place + h / step);
        bst_vec3 turn =
            bst_quat_to_rotvec(bst_quat_mul(c.q_body_from_gcrf, bst_quat_conj(a.q_body_from_gcrf)));
        bst_vec3 rate = bst_vec3_scale(turn, -0.5 / h);
        /* second term of the series left out: the square of 0.01 rad a step */
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(rate, b.rate_radps)), 0.0, 1e-5 * 0.05);
        bst_vec3 accel = bst_vec3_scale(bst_vec3_sub(c.rate_radps, a.rate_radps), 0.5 / h);
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(accel, b.accel_radps2)), 0.0, 1e-6);
        /* rolled about z at a rate: the same test of the rolled motion */
        bst_vec3 z = {0, 0, 1};
        double roll = 0.3, spin = 0.02;
        bst_spacecraft_attitude_reference ra = bst_spacecraft_attitude_reference_rolled(
                                              &a, z, roll - spin * h, spin),
                                          rb = bst_spacecraft_attitude_reference_rolled(&b, z, roll,
                                                                                        spin),
                                          rc = bst_spacecraft_attitude_reference_rolled(
                                              &c, z, roll + spin * h, spin);
        turn = bst_quat_to_rotvec(
            bst_quat_mul(rc.q_body_from_gcrf, bst_quat_conj(ra.q_body_from_gcrf)));
        rate = bst_vec3_scale(turn, -0.5 / h);
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(rate, rb.rate_radps)), 0.0, 1e-6);
        accel = bst_vec3_scale(bst_vec3_sub(rc.rate_radps, ra.rate_radps), 0.5 / h);
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(accel, rb.accel_radps2)), 0.0, 1e-6);
    }
    /* a jump is no motion */
    node[2] = bst_quat_mul(bst_quat_from_rotvec((bst_vec3){1.0, 0, 0}), node[2]);
    bst_spacecraft_attitude_reference r = bst_spacecraft_attitude_reference_at(node, step, 1.9);
    bst_assert_close(bst_vec3_norm(r.rate_radps), 0.0, 0.0);
    bst_assert_close(r.q_body_from_gcrf.w, node[2].w, 0.0);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_gravity_gradient),
                                       cmocka_unit_test(test_sunlight),
                                       cmocka_unit_test(test_magnetic),
                                       cmocka_unit_test(test_sum_of_all),
                                       cmocka_unit_test(test_laws),
                                       cmocka_unit_test(test_reference)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
