/* Rotation under torques, against closed forms and conserved quantities. */
#include "sim/astro/bodies.h"
#include "sim/astro/gravity.h"
#include "sim/satellite/attitude_propagation.h"
#include "sim/satellite/tumbling.h"
#include "tests/test_support.h"

#define DAY 86400.0

static const double moments[3] = {100, 250, 300};

static bst_attitude_propagation *make(const double inertia[3], bst_quat q, bst_vec3 rate,
                                      double tolerance, bst_attitude_torque_fn torque, void *user) {
    bst_ctx ctx = {0};
    bst_attitude_motion start = {.q_body_from_gcrf = q, .rate_radps = rate};
    memcpy(start.inertia_kg_m2, inertia, sizeof start.inertia_kg_m2);
    bst_attitude_propagation *p;
    bst_assert_ok(&ctx, bst_attitude_propagation_create(&ctx, &start, tolerance, torque, user, &p));
    return p;
}

static double turn_between(bst_quat a, bst_quat b) {
    return bst_vec3_norm(bst_quat_to_rotvec(bst_quat_mul(a, bst_quat_conj(b))));
}

static bst_vec3 momentum(const double i[3], bst_quat q, bst_vec3 w) {
    return bst_quat_rotate(bst_quat_conj(q), (bst_vec3){i[0] * w.x, i[1] * w.y, i[2] * w.z});
}

static bool no_torque(void *user, double seconds, bst_quat q, bst_vec3 *n) {
    (void)user;
    (void)seconds;
    (void)q;
    *n = (bst_vec3){0, 0, 0};
    return true;
}

/* A torque of zero: the free rotation, its energy and its momentum over a day. */
static void no_torque_keeps_energy_and_momentum(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_vec3 rate = {0.02, 0.005, -0.01};
    bst_attitude_propagation *p = make(moments, BST_QUAT_IDENTITY, rate, 1e-3, no_torque, NULL);
    bst_tumbling *free_body;
    bst_assert_ok(&ctx, bst_tumbling_create(&ctx, moments, rate, &free_body));
    bst_vec3 before = momentum(moments, BST_QUAT_IDENTITY, rate);
    double energy = bst_vec3_dot(before, rate);
    for (int i = 0; i <= 24; i++) {
        bst_vec3 w;
        bst_quat q = bst_attitude_propagation_at(p, DAY / 24 * i, &w);
        bst_vec3 l = momentum(moments, q, w);
        double now = bst_vec3_dot(l, bst_quat_rotate(bst_quat_conj(q), w));
        bst_assert_close(now, energy, 1e-9 * energy);
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(l, before)), 0, 1e-9 * bst_vec3_norm(before));
        /* 2000 rad at 5e-12, and the 1e-9 a period of the closed form's table */
        bst_assert_close(turn_between(q, bst_tumbling_at(free_body, DAY / 24 * i, NULL)), 0, 1e-6);
    }
    bst_tumbling_free(free_body);
    bst_attitude_propagation_free(p);
}

static bool about_z(void *user, double seconds, bst_quat q, bst_vec3 *n) {
    (void)seconds;
    (void)q;
    *n = (bst_vec3){0, 0, *(const double *)user};
    return true;
}

/* A constant torque about the axis of rotation: angle w t + a t^2 / 2, also between steps. */
static void constant_torque_spins_up(void **state) {
    (void)state;
    double torque = 3e-3, spin = 0.01;
    bst_attitude_propagation *p =
        make(moments, BST_QUAT_IDENTITY, (bst_vec3){0, 0, spin}, 1e-3, about_z, &torque);
    for (int i = 0; i < 50; i++) {
        double t = 71.3 * i, a = torque / moments[2];
        bst_vec3 w;
        bst_quat q = bst_attitude_propagation_at(p, t, &w);
        bst_quat want = bst_quat_from_rotvec((bst_vec3){0, 0, -(spin * t + 0.5 * a * t * t)});
        bst_assert_close(turn_between(q, want), 0, 1e-10); /* 60 rad at 5e-12 of rounding each */
        bst_assert_close(w.z, spin + a * t, 1e-13);
        bst_assert_close(hypot(w.x, w.y), 0, 1e-15);
    }
    bst_attitude_propagation_free(p);
}

/* Circular orbit in the plane of x and y, with its rate. */
typedef struct circle {
    double radius_m, rate_radps;
    const double *inertia;
} circle;

static bst_vec3 place_on(const circle *c, double seconds) {
    double a = c->rate_radps * seconds;
    return (bst_vec3){c->radius_m * cos(a), c->radius_m * sin(a), 0};
}

static circle circle_at(double radius_m, const double inertia[3]) {
    return (circle){radius_m, sqrt(BST_EARTH_MU_M3PS2 / radius_m) / radius_m, inertia};
}

static bool gradient(void *user, double seconds, bst_quat q, bst_vec3 *n) {
    const circle *c = user;
    const double *i = c->inertia;
    const bst_mat3 inertia = {{{i[0], 0, 0}, {0, i[1], 0}, {0, 0, i[2]}}};
    *n = bst_gravity_gradient_torque(&inertia, q, place_on(c, seconds));
    return true;
}

/* Complete elliptic integral K of the modulus k (Abramowitz and Stegun 17.6.3). */
static double elliptic_k(double k) {
    double a = 1, g = sqrt(1 - k * k);
    for (int i = 0; i < 30; i++) {
        double mean = 0.5 * (a + g);
        g = sqrt(a * g);
        a = mean;
    }
    return 0.5 * BST_PI / a;
}

/* Libration about the orbit's normal: theta'' = -3 n^2 (Iy - Ix) / Iz sin theta cos theta, for
 * small and large angles (a pendulum of 2 theta), over a day. */
static void gravity_gradient_librates(void **state) {
    (void)state;
    circle c = circle_at(6.978137e6, moments);
    double small = c.rate_radps * sqrt(3 * (moments[1] - moments[0]) / moments[2]);
    static const double amplitudes[] = {1e-3, 0.7};
    for (int k = 0; k < 2; k++) {
        double amplitude = amplitudes[k];
        double period = 4 * elliptic_k(sin(amplitude)) / small; /* of a pendulum from 2 theta */
        bst_quat q = bst_quat_from_rotvec((bst_vec3){0, 0, -amplitude});
        bst_attitude_propagation *p =
            make(moments, q, (bst_vec3){0, 0, c.rate_radps}, 1e-3, gradient, &c);
        int turns = (int)(DAY / period);
        assert_true(turns > 15);
        for (int i = 0; i <= turns; i++) {
            bst_vec3 w;
            q = bst_attitude_propagation_at(p, period * i, &w);
            double angle = bst_wrap_angle(-bst_quat_to_rotvec(q).z - c.rate_radps * period * i);
            bst_assert_close(angle, amplitude, 1e-5 * amplitude);
            bst_assert_close((w.z - c.rate_radps) / small, 0, 1e-4 * amplitude);
        }
        if (k == 0) {
            q = bst_attitude_propagation_at(p, 0.25 * period, NULL);
            bst_assert_close(-bst_quat_to_rotvec(q).z - c.rate_radps * 0.25 * period, 0, 1e-8);
        }
        bst_attitude_propagation_free(p);
    }
}

/* Gravity gradient on a circular orbit keeps T + V - n L_z, V = 3/2 n^2 u . I u: a day of tumbling
 * about all axes. */
static void tumbling_in_a_gradient_keeps_its_integral(void **state) {
    (void)state;
    circle c = circle_at(6.978137e6, moments);
    double n = c.rate_radps, first = 0;
    bst_attitude_propagation *p = make(moments, bst_quat_unit((bst_quat){0.1, 0.3, -0.2, 0.9}),
                                       (bst_vec3){2 * n, -n, 1.5 * n}, 1e-3, gradient, &c);
    for (int i = 0; i <= 100; i++) {
        bst_vec3 w;
        double t = DAY / 100 * i;
        bst_quat q = bst_attitude_propagation_at(p, t, &w);
        bst_vec3 u = bst_quat_rotate(q, bst_vec3_unit(place_on(&c, t)));
        double kinetic =
            0.5 * (moments[0] * w.x * w.x + moments[1] * w.y * w.y + moments[2] * w.z * w.z);
        double potential =
            1.5 * n * n *
            (moments[0] * u.x * u.x + moments[1] * u.y * u.y + moments[2] * u.z * u.z);
        double integral = kinetic + potential - n * momentum(moments, q, w).z;
        first = i ? first : integral;
        /* an attitude wrong by the tolerance may change it by 1e-3 of this */
        bst_assert_close(integral, first, 1e-4 * moments[2] * n * n);
    }
    bst_attitude_propagation_free(p);
}

/* A torque that follows a direction of GCRF with a kink, as of a plate in sunlight, and is off a
 * third of the time. */
static bool plate_in_eclipses(void *user, double seconds, bst_quat q, bst_vec3 *n) {
    (void)user;
    bst_vec3 sun = bst_quat_rotate(q, (bst_vec3){0.6, 0, 0.8});
    double lit = fmod(seconds, 6000.0) < 4000.0 ? 1.0 : 0.0;
    bst_vec3 force = bst_vec3_scale(sun, -1e-4 * fabs(sun.z) * lit);
    *n = bst_vec3_cross((bst_vec3){1.5, 0.2, 0}, force);
    return true;
}

/* The attitude after a day is that of a tolerance 1e4 times as tight; without a torque it would be
 * another one. It does not depend on the order of queries. */
static void the_error_is_controlled(void **state) {
    (void)state;
    const bst_vec3 rate = {0.02, 0.005, -0.01};
    bst_attitude_propagation *fine =
        make(moments, BST_QUAT_IDENTITY, rate, 1e-5, plate_in_eclipses, NULL);
    bst_attitude_propagation *usual =
        make(moments, BST_QUAT_IDENTITY, rate, 1e-3, plate_in_eclipses, NULL);
    bst_attitude_propagation *later =
        make(moments, BST_QUAT_IDENTITY, rate, 1e-3, plate_in_eclipses, NULL);
    bst_attitude_propagation *none = make(moments, BST_QUAT_IDENTITY, rate, 1e-3, no_torque, NULL);
    bst_attitude_propagation_at(later, DAY, NULL);
    double worst = 0;
    for (int i = 0; i <= 240; i++) {
        double t = DAY / 240 * i;
        bst_vec3 w, v;
        bst_quat q = bst_attitude_propagation_at(usual, t, &w);
        bst_quat same = bst_attitude_propagation_at(later, t, &v);
        assert_memory_equal(&q, &same, sizeof q);
        assert_memory_equal(&w, &v, sizeof w);
        double off = turn_between(q, bst_attitude_propagation_at(fine, t, NULL));
        worst = fmax(worst, off);
    }
    printf("a day: %.2g rad, %lld calls (tight: %lld)\n", worst,
           (long long)bst_attitude_propagation_calls(usual),
           (long long)bst_attitude_propagation_calls(fine));
    bst_assert_close(worst, 0, 1e-3); /* the tolerance */
    assert_true(turn_between(bst_attitude_propagation_at(usual, DAY, NULL),
                             bst_attitude_propagation_at(none, DAY, NULL)) > 0.1);
    bst_attitude_propagation_free(fine);
    bst_attitude_propagation_free(usual);
    bst_attitude_propagation_free(later);
    bst_attitude_propagation_free(none);
}

static bool until_1000(void *user, double seconds, bst_quat q, bst_vec3 *n) {
    return about_z(user, seconds, q, n) && seconds <= 1000.0;
}

/* Before the start and where the torque is unknown, the rotation is free; a torque that is no
 * number counts as unknown. */
static void the_rotation_is_free_outside(void **state) {
    (void)state;
    double torque = 3e-3, spin = 0.01, a = torque / moments[2];
    bst_attitude_propagation *p =
        make(moments, BST_QUAT_IDENTITY, (bst_vec3){0, 0, spin}, 1e-3, until_1000, &torque);
    bst_vec3 w;
    bst_quat q = bst_attitude_propagation_at(p, -200, &w);
    bst_assert_close(bst_quat_to_rotvec(q).z, 2.0, 1e-9); /* 100 steps of 3e-11 */
    bst_assert_close(w.z, spin, 1e-15);
    q = bst_attitude_propagation_at(p, 3000, &w);
    /* a step may end 1e-4 of the longest one before */
    bst_assert_close(w.z, spin + a * 1000, 2e-2 * a);
    bst_assert_close(turn_between(q, bst_quat_from_rotvec((bst_vec3){0, 0, -w.z * 2000})),
                     fabs(bst_wrap_angle(spin * 1000 + 0.5 * a * 1e6)), 1e-3);
    bst_attitude_propagation_free(p);
    torque = NAN;
    p = make(moments, BST_QUAT_IDENTITY, (bst_vec3){0, 0, spin}, 1e-3, about_z, &torque);
    bst_attitude_propagation_at(p, 1e4, &w);
    bst_assert_close(w.z, spin, 1e-15);
    bst_attitude_propagation_free(p);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_torque_keeps_energy_and_momentum),
        cmocka_unit_test(constant_torque_spins_up),
        cmocka_unit_test(gravity_gradient_librates),
        cmocka_unit_test(tumbling_in_a_gradient_keeps_its_integral),
        cmocka_unit_test(the_error_is_controlled),
        cmocka_unit_test(the_rotation_is_free_outside),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
