/* Winding numbers of functions with known zeros and poles, and the delay margin of an integrator
 * by closed form. */
#include "boresight/vec.h"
#include "control/loop/stability.h"
#include "tests/test_support.h"

static const double dt = 0.02;

/* Zeros and poles, their number, and whole delays. */
typedef struct rational {
    double complex zero[4], pole[4];
    int zeros, poles, delays;
} rational;

static double complex value(const void *user, double omega) {
    const rational *r = user;
    double complex z = cexp(I * omega * dt), h = cpow(z, -r->delays);
    for (int i = 0; i < r->zeros; i++) {
        h *= z - r->zero[i];
    }
    for (int i = 0; i < r->poles; i++) {
        h /= z - r->pole[i];
    }
    return h;
}

/* Zeros less poles inside the unit circle; those at z = 1 are inside. */
static void turns_are_zeros_less_poles_inside(void **state) {
    (void)state;
    const struct {
        rational of;
        int turns;
    } cases[] = {
        {{{0.5}, {0.2}, 1, 1, 0}, 0},
        {{{1.2}, {0.2}, 1, 1, 0}, -1},
        {{{-1.2}, {0.2}, 1, 1, 0}, -1},
        {{{-0.8}, {3.0}, 1, 1, 0}, 1},
        {{{0.5}, {0}, 1, 0, 0}, 1},
        {{{0}, {-0.5}, 0, 1, 0}, -1},
        {{{1.001 * (0.8 + 0.6 * I), 1.001 * (0.8 - 0.6 * I)}, {0.1, 0.3}, 2, 2, 0}, -2},
        {{{0.999 * (0.8 + 0.6 * I), 0.999 * (0.8 - 0.6 * I)}, {0.1, 0.3}, 2, 2, 0}, 0},
        {{{0.6 + 0.8 * I, 0.6 - 0.8 * I, 2.0}, {0.1, 0.3, -0.2}, 0, 3, 0}, -3},
        {{{0.9, 0.5}, {1.0, 1.0}, 2, 2, 0}, 0},
        {{{1.1, 0.5}, {1.0, 1.0}, 2, 2, 0}, -1},
        {{{1.0, 0.5}, {1.4, 0.2}, 2, 2, 0}, 1},
        {{{0.5}, {1.0}, 1, 1, 0}, 0},
        {{{1.0}, {0.5}, 1, 1, 0}, 0},
        {{{0.5}, {0.2}, 1, 1, 3}, -3},
        {{{1.5}, {1.0}, 1, 1, 2}, -3},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        bst_ctx ctx = {0};
        int turns = 99, outside = 99;
        double delay = cases[i].of.delays * dt;
        bst_assert_ok(&ctx, bst_loop_turns(&ctx, value, &cases[i].of, dt, delay, &turns));
        assert_int_equal(turns, cases[i].turns);
        /* poles outside are refused */
        bst_status s = bst_loop_zeros_outside(&ctx, value, &cases[i].of, dt, delay, &outside);
        assert_int_equal(s, turns > 0 ? BST_ERR_NUMERIC : BST_OK);
        assert_int_equal(outside, -turns);
    }
}

/* A zero on the circle, at half the sampling rate. */
static void a_zero_on_the_circle_is_refused(void **state) {
    (void)state;
    const rational r = {{0}, {-1.0}, 0, 1, 0};
    bst_ctx ctx = {0};
    int turns;
    bst_status s = bst_loop_turns(&ctx, value, &r, dt, 0.0, &turns);
    assert_true(s == BST_ERR_NUMERIC || turns == -1); /* exp(j pi) is not exactly -1 */
}

/* L = K / (z - 1) exp(-j omega later). */
static double complex integrator(const void *user, double omega, double later_s) {
    double complex z = cexp(I * omega * dt);
    return *(const double *)user / (z - 1.0) * cexp(-I * omega * later_s);
}

/* |L| is 1 where 2 sin(omega dt / 2) = K; the phase of 1 / (z - 1) is -pi / 2 - omega dt / 2. */
static void delay_margin_of_an_integrator(void **state) {
    (void)state;
    const double gains[] = {0.05, 0.3, 1.2};
    for (int i = 0; i < 3; i++) {
        bst_ctx ctx = {0};
        const bst_loop loop = {.user = &gains[i], .dt_s = dt, .open_later = integrator};
        double omega = 2.0 / dt * asin(0.5 * gains[i]), found = 0.0;
        double margin = 0.5 * BST_PI / omega - 0.5 * dt;
        const double estimates[] = {0.7 * margin, 1.3 * margin};
        for (int k = 0; k < 2; k++) {
            bst_assert_ok(&ctx, bst_loop_delay_margin(&ctx, &loop, 0, estimates[k], &found));
            bst_assert_close(found, margin, 1e-4 * dt); /* 14 halvings of 0.15 dt */
        }
    }
    /* further than 400 steps of 0.15 dt: the estimate, if it is beyond them */
    const double slow = 1e-3;
    const bst_loop loop = {.user = &slow, .dt_s = dt, .open_later = integrator};
    double margin = 0.5 * BST_PI / (2.0 / dt * asin(0.5 * slow)) - 0.5 * dt, found = 0.0;
    bst_ctx ctx = {0};
    assert_true(margin > 60.0 * dt);
    bst_assert_ok(&ctx, bst_loop_delay_margin(&ctx, &loop, 0, margin, &found));
    bst_assert_close(found, margin, 0.0);
    bst_assert_ok(&ctx, bst_loop_delay_margin(&ctx, &loop, 0, 10.0 * dt, &found));
    assert_true(isinf(found));
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(turns_are_zeros_less_poles_inside),
                                       cmocka_unit_test(a_zero_on_the_circle_is_refused),
                                       cmocka_unit_test(delay_margin_of_an_integrator)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
