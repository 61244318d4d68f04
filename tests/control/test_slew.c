/* Slews against closed forms and the bounds of what limits allow. */
#include "boresight/rng.h"
#include "boresight/vec.h"
#include "control/guidance/slew.h"
#include "tests/test_support.h"

#include <string.h>

#define DEG BST_DEG_RAD

/* That the motion keeps the limits, is continuous, and its derivatives are those that it states. */
static void check_axis(const bst_slew_axis *s, double rate_limit, double accel_limit) {
    enum { STEPS = 2000 };
    double span = s->duration_s * 1.1 + 1e-3, h = span / STEPS;
    double x, v, a, bx, bv, ba;
    bst_slew_axis_at(s, 0.0, &bx, &bv, &ba);
    bst_assert_close(bx, s->from_rad, 1e-15);
    bst_assert_close(bv, s->from_radps, 1e-15);
    double fastest = fmax(rate_limit, fabs(s->from_radps));
    for (int k = 1; k <= STEPS; k++) {
        bst_slew_axis_at(s, k * h, &x, &v, &a);
        assert_true(fabs(v) <= fastest * (1.0 + 1e-12) + 1e-12);
        assert_true(fabs(a) <= accel_limit * (1.0 + 1e-12));
        /* what the limits allow within a step */
        assert_true(fabs(v - bv) <= accel_limit * h * (1.0 + 1e-9) + 1e-12);
        assert_true(fabs(x - bx - 0.5 * (v + bv) * h) <= 0.51 * accel_limit * h * h + 1e-12);
        bx = x;
        bv = v;
    }
}

static void rest_to_rest(void **state) {
    (void)state;
    const double v = 2 * DEG, a = 1 * DEG;
    bst_slew_axis s;
    /* long: L / V + V / A; short: 2 sqrt(L / A) */
    const double spans[] = {180 * DEG, -180 * DEG, 4 * DEG, -3.999 * DEG, 1e-6};
    for (int i = 0; i < 5; i++) {
        double l = fabs(spans[i]);
        assert_true(bst_slew_axis_plan(0.3, 0.0, 0.3 + spans[i], 0.0, v, a, &s));
        double bound = l >= v * v / a ? l / v + v / a : 2 * sqrt(l / a);
        bst_assert_close(s.duration_s, bound, 1e-9 * bound + 1e-9); /* rounding of 0.3 + span */
        double x, w, u;
        bst_slew_axis_at(&s, 0.5 * s.duration_s, &x, &w, &u);
        bst_assert_close(x, 0.3 + 0.5 * spans[i], 1e-12);
        bst_slew_axis_at(&s, s.duration_s * (1 - 1e-12), &x, &w, &u);
        bst_assert_close(x, 0.3 + spans[i], 1e-11);
        check_axis(&s, v, a);
    }
    assert_true(bst_slew_axis_plan(0.3, 0.0, 0.3, 0.0, v, a, &s)); /* zero length */
    bst_assert_close(s.duration_s, 0.0, 0.0);
    assert_true(bst_slew_axis_plan(0.0, 0.0, 1.0, 0.0, 0.0, a, &s)); /* no rate limit */
    bst_assert_close(s.duration_s, 2 * sqrt(1.0 / a), 1e-12);
    assert_false(bst_slew_axis_plan(0.0, 0.0, 1.0, 0.0, v, 0.0, &s));
    assert_false(bst_slew_axis_plan(0.0, 0.0, 1.0, v, v, a, &s)); /* as fast as the limit */
    assert_false(bst_slew_axis_plan(0.0, NAN, 1.0, 0.0, v, a, &s));
}

/* Random states: the end is met exactly, within the limits, and no motion is faster: bang-bang in
 * the opposite order, or a bang less long, ends short of it. As the bound, the least time by
 * bisection over what positions the extreme motions of a given duration can reach. */
static double farthest(double v0, double v1, double limit, double a, double t, double way) {
    /* greatest distance along `way` in time t from rate v0 to v1 under the limits; -INFINITY when
     * the rates cannot change so fast */
    v0 *= way;
    v1 *= way;
    if (fabs(v1 - v0) > a * t) {
        return -INFINITY;
    }
    double peak = 0.5 * (v0 + v1 + a * t), coast = 0.0;
    if (peak > limit) {
        coast = (peak - limit) / a * 2.0;
        peak = limit;
    }
    double up = (peak - v0) / a, down = (peak - v1) / a;
    return 0.5 * (v0 + peak) * up + peak * coast + 0.5 * (peak + v1) * down;
}

static void any_state_to_a_moving_target(void **state) {
    (void)state;
    bst_rng_key key = bst_rng_make_key(3, 0, "test", "slew");
    for (uint64_t n = 0; n < 2000; n++) {
        double u[6];
        for (uint64_t i = 0; i < 6; i++) {
            u[i] = 2.0 * bst_rng_uniform(key, n, i) - 1.0;
        }
        double limit = 0.02 + 0.04 * fabs(u[0]), a = 0.005 + 0.05 * fabs(u[1]);
        double x0 = 2 * u[2], v0 = limit * u[3], x1 = 2 * u[4], v1 = 0.95 * limit * u[5];
        bst_slew_axis s;
        assert_true(bst_slew_axis_plan(x0, v0, x1, v1, limit, a, &s));
        double x, v, acc, t = s.duration_s;
        bst_slew_axis_at(&s, t * (1.0 - 1e-13), &x, &v, &acc);
        bst_assert_close(x, x1 + v1 * t, 1e-9 * (1 + t)); /* rounding of t, times a rate */
        bst_assert_close(v, v1, 1e-9);
        if (n < 100) {
            check_axis(&s, limit, a);
        }
        /* shorter by 0.1 % (and 1 ms): out of reach both ways. Motions that end earlier and then
         * follow the target end there too, so that all shorter times are out of reach with it. */
        double shorter = 0.999 * t - 1e-3;
        if (shorter > 0.0) {
            double to_go = x1 + v1 * shorter - x0;
            bool reach = farthest(v0, v1, limit, a, shorter, 1.0) >= to_go &&
                         farthest(v0, v1, limit, a, shorter, -1.0) >= -to_go;
            assert_false(reach);
        }
    }
    /* too fast at the start: braked to the limit first */
    bst_slew_axis s;
    assert_true(bst_slew_axis_plan(0.0, 0.2, 10.0, 0.0, 0.1, 0.05, &s));
    double x, v, acc;
    bst_slew_axis_at(&s, 3.0, &x, &v, &acc);
    bst_assert_close(v, 0.1, 1e-12);
    bst_slew_axis_at(&s, s.duration_s, &x, &v, &acc);
    bst_assert_close(x, 10.0, 1e-12);
}

static bst_slew_nodes nodes;
static bst_slew_path path;

static void straight_nodes(int count, double length, double slope1) {
    memset(&nodes, 0, sizeof nodes);
    nodes.count = count;
    nodes.step = length / (count - 1);
    for (int j = 0; j < count; j++) {
        nodes.angle_rad[j][0] = nodes.step * j;
        nodes.angle_rad[j][1] = slope1 * nodes.step * j;
    }
}

/* On a straight path the axis with the tighter limit rules, and the time is the closed form's. */
static void straight_path(void **state) {
    (void)state;
    const bst_slew_limits limits = {2, {2 * DEG, 3 * DEG}, {1 * DEG, 0.5 * DEG}};
    straight_nodes(385, 180 * DEG, 0.5);
    assert_true(bst_slew_path_plan(&nodes, &limits, 0.0, 0.0, &path));
    /* axis 0 limits both: 180 / 2 + 2 / 1 */
    bst_assert_close(path.duration_s, 92.0, 0.92);
    assert_true(path.duration_s >= 92.0 * (1 - 1e-9));
    straight_nodes(385, 60 * DEG, 2.0);
    assert_true(bst_slew_path_plan(&nodes, &limits, 0.0, 0.0, &path));
    /* axis 1: 120 / 3 + 3 / 0.5 */
    bst_assert_close(path.duration_s, 46.0, 0.46);
    assert_true(path.duration_s >= 46.0 * (1 - 1e-9));
    double s, v, a;
    bst_slew_path_at(&path, 23.0, &s, &v, &a);
    bst_assert_close(s, 30 * DEG, 0.2 * DEG);
    bst_slew_path_at(&path, 1e9, &s, &v, &a);
    bst_assert_close(s, 60 * DEG, 1e-12);
    /* both ends moving, as long as the path allows: V (t1 + t2 of changes) */
    assert_true(bst_slew_path_plan(&nodes, &limits, 1 * DEG, 1 * DEG, &path));
    /* 1 to 1.5 deg/s of s at 0.25 deg/s^2, twice: 2 s each over 2.5 degrees; 55 at 1.5 */
    bst_assert_close(path.duration_s, 2 * 2.0 + 55.0 / 1.5, 0.4);
    bst_slew_path_at(&path, 0.0, &s, &v, &a);
    bst_assert_close(v, 1 * DEG, 1e-12);
    bst_slew_path_at(&path, path.duration_s, &s, &v, &a);
    bst_assert_close(v, 1 * DEG, 1e-12);
    straight_nodes(385, 60 * DEG, 2.0);
    nodes.corner[192] = true; /* half way: rest there */
    assert_true(bst_slew_path_plan(&nodes, &limits, 0.0, 0.0, &path));
    bst_assert_close(path.duration_s, 2 * (60.0 / 3 + 3 / 0.5), 0.52);
    nodes.count = 1;
    assert_false(bst_slew_path_plan(&nodes, &limits, 0.0, 0.0, &path));
    straight_nodes(10, NAN, 1.0);
    assert_false(bst_slew_path_plan(&nodes, &limits, 0.0, 0.0, &path));
}

/* A circle in the two axes: at constant speed v each acceleration peaks at v^2 / r, so the steady
 * speed is at most sqrt(A r) where sines meet, and between that and 2^(1/4) times it elsewhere; and
 * no axis passes its limit anywhere. */
static void curved_path(void **state) {
    (void)state;
    const double r = 20 * DEG, a = 0.5 * DEG;
    const bst_slew_limits limits = {2, {50 * DEG, 50 * DEG}, {a, a}};
    enum { COUNT = 513 };
    nodes = (bst_slew_nodes){.count = COUNT, .step = 4 * BST_PI * r / (COUNT - 1)};
    for (int j = 0; j < COUNT; j++) {
        double phase = nodes.step * j / r;
        nodes.angle_rad[j][0] = r * cos(phase);
        nodes.angle_rad[j][1] = r * sin(phase);
    }
    assert_true(bst_slew_path_plan(&nodes, &limits, 0.0, 0.0, &path));
    double s, v, u, worst = 0.0, slow = INFINITY, fast = 0.0;
    for (int k = 1; k < 4000; k++) {
        double t = path.duration_s * k / 4000;
        bst_slew_path_at(&path, t, &s, &v, &u);
        double phase = s / r;
        double ax = -sin(phase) * u - cos(phase) * v * v / r;
        double ay = cos(phase) * u - sin(phase) * v * v / r;
        worst = fmax(worst, fmax(fabs(ax), fabs(ay)) / a);
        if (t > 0.3 * path.duration_s && t < 0.7 * path.duration_s) {
            slow = fmin(slow, v);
            fast = fmax(fast, v);
        }
    }
    print_message("speed %.3f to %.3f of sqrt(A r), acceleration at most %.4f of the limit\n",
                  slow / sqrt(a * r), fast / sqrt(a * r), worst);
    /* the grid holds the limits at its nodes, 41 to a radian; between them u is constant */
    assert_true(worst < 1.08);
    assert_true(slow > 0.97 * sqrt(a * r) && fast < 1.03 * pow(2.0, 0.25) * sqrt(a * r));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rest_to_rest),
        cmocka_unit_test(any_state_to_a_moving_target),
        cmocka_unit_test(straight_path),
        cmocka_unit_test(curved_path),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
