/* Axis angles of mounts, and the choice among turns and ways. */
#include "boresight/rng.h"
#include "control/guidance/mount_inverse_kinematics.h"
#include "tests/test_support.h"

#define DEG BST_DEG_RAD

/* Cross-elevation: outer axis body y, inner x, as the cheap mount is. */
static bst_mount_status cross_elevation(void) {
    return (bst_mount_status){.axes = 2,
                              .q_body_from_cam_at_zero = BST_QUAT_IDENTITY,
                              .axis = {{.axis_body = {0, 1, 0}, .rate_limit_radps = 2 * DEG},
                                       {.axis_body = {1, 0, 0},
                                        .rate_limit_radps = 2 * DEG,
                                        .min_rad = -90 * DEG,
                                        .max_rad = 90 * DEG}}};
}

/* Azimuth about body z, elevation about the turned -y, boresight along x at zero; 1.5 turns of
 * cable each way, and over the top to 180 degrees. */
static bst_mount_status azimuth_elevation(void) {
    bst_quat q = bst_quat_look((bst_vec3){1, 0, 0}, (bst_vec3){0, -1, 0});
    return (bst_mount_status){.axes = 2,
                              .q_body_from_cam_at_zero = bst_quat_conj(q),
                              .axis = {{.axis_body = {0, 0, 1},
                                        .rate_limit_radps = 2 * DEG,
                                        .min_rad = -540 * DEG,
                                        .max_rad = 540 * DEG},
                                       {.axis_body = {0, -1, 0},
                                        .rate_limit_radps = 2 * DEG,
                                        .min_rad = -20 * DEG,
                                        .max_rad = 200 * DEG}}};
}

static bst_vec3 azel(double az_deg, double el_deg) {
    return bst_vec3_from_radec(az_deg * DEG, el_deg * DEG);
}

static void known_angles(void **state) {
    (void)state;
    bst_mount_status m = cross_elevation();
    const double zero[BST_MOUNT_AXES] = {0};
    double a[2][BST_MOUNT_AXES];
    /* (cos i sin o, -sin i, cos i cos o) */
    double o = 30 * DEG, i = 20 * DEG;
    bst_vec3 b = {cos(i) * sin(o), -sin(i), cos(i) * cos(o)};
    assert_int_equal(bst_mount_angles(&m, b, zero, a), 2);
    bst_assert_close(a[0][0], o, 1e-14);
    bst_assert_close(a[0][1], i, 1e-14);
    bst_assert_close(fabs(a[1][0]), BST_PI - o, 1e-13); /* over the pole */
    m = azimuth_elevation();
    assert_int_equal(bst_mount_angles(&m, azel(-100, 35), zero, a), 2);
    bst_assert_close(a[0][0], -100 * DEG, 1e-14);
    bst_assert_close(a[0][1], 35 * DEG, 1e-14);
    bst_assert_close(a[1][0], 80 * DEG, 1e-13);
    bst_assert_close(a[1][1], 145 * DEG, 1e-13);
    const double wound[BST_MOUNT_AXES] = {250 * DEG, 0, 0};
    bst_mount_angles(&m, azel(-100, 35), wound, a);
    bst_assert_close(a[0][0], 260 * DEG, 1e-13); /* by the nearest turn */
    /* on the pole the outer axis stays */
    assert_true(bst_mount_angles(&m, (bst_vec3){0, 0, 1}, wound, a) >= 1);
    bst_assert_close(a[0][0], 250 * DEG, 1e-13);
    bst_assert_close(a[0][1], 90 * DEG, 1e-7); /* square root of rounding */
    m.axes = 1;
    assert_int_equal(bst_mount_angles(&m, (bst_vec3){0, 0, 1}, zero, a), 0);
}

/* Solving gives angles that point there, for any mount, with a redundant axis at each of its
 * places. */
static void any_direction(void **state) {
    (void)state;
    bst_rng_key key = bst_rng_make_key(1, 0, "test", "wrap");
    for (uint64_t n = 0; n < 3000; n++) {
        double g[2], h[2], near[BST_MOUNT_AXES], a[2][BST_MOUNT_AXES];
        bst_rng_normal2(key, n, 0, g);
        bst_rng_normal2(key, n, 1, h);
        bst_vec3 d = bst_vec3_unit((bst_vec3){g[0], g[1], h[0]});
        bst_mount_status m = n % 2 ? azimuth_elevation() : cross_elevation();
        int third = (int)(n % 5) - 1;
        if (third >= 0 && third < 3) {
            m.axes = 3;
            for (int i = 2; i > third; i--) {
                m.axis[i] = m.axis[i - 1];
            }
            m.axis[third] = (bst_mount_axis){.axis_body = bst_vec3_unit((bst_vec3){0.3, 0.5, 1}),
                                             .redundant = true};
        }
        near[0] = 2 * h[1];
        near[1] = g[0];
        near[2] = 0.2 * g[1];
        int count = bst_mount_angles(&m, d, near, a);
        if (m.axes == 2) {
            assert_int_equal(count, 2);
        }
        for (int k = 0; k < count; k++) {
            /* acos near its ends: square root of rounding */
            assert_true(bst_vec3_angle(bst_mount_boresight(&m, a[k]), d) < 1e-7);
            for (int i = 0; i < m.axes; i++) {
                assert_true(fabs(a[k][i] - near[i]) <= BST_PI * (1 + 1e-12));
            }
            if (third >= 0 && third < 3) {
                bst_assert_close(a[k][third], near[third], 0.0);
            }
        }
    }
}

static void wrap_that_serves(void **state) {
    (void)state;
    enum { N = 300 };
    bst_vec3 pass[N];
    bst_mount_status m = azimuth_elevation();
    m.axis[1].max_rad = 90 * DEG; /* not over the top */
    bst_mount_turn_choice c;
    /* a pass from azimuth 170 through 180 to 400, with the mount at 175: on, without unwinding */
    for (int k = 0; k < N; k++) {
        pass[k] = azel(170 + 230.0 * k / (N - 1), 30);
    }
    m.axis[0].angle_rad = 175 * DEG;
    assert_true(bst_mount_choose_turn(&m, pass, N, &c));
    assert_int_equal(c.serves, N);
    bst_assert_close(c.angle_rad[0], 170 * DEG, 1e-12);
    /* at 500 the nearest turn, 530, would end at 760: beyond the cable's 540. 170 serves all */
    m.axis[0].angle_rad = 500 * DEG;
    assert_true(bst_mount_choose_turn(&m, pass, N, &c));
    assert_int_equal(c.serves, N);
    bst_assert_close(c.angle_rad[0], 170 * DEG, 1e-12);
    bst_assert_close(c.slew_s, 330.0 / 2.0, 1e-9);
    bst_mount_status unlimited = m; /* axes without a rate limit take no time */
    unlimited.axis[0].rate_limit_radps = unlimited.axis[1].rate_limit_radps = 0.0;
    assert_true(bst_mount_choose_turn(&unlimited, pass, N, &c));
    bst_assert_close(c.slew_s, 0.0, 0);
    /* nothing to come: the nearest turn */
    assert_true(bst_mount_choose_turn(&m, pass, 1, &c));
    bst_assert_close(c.angle_rad[0], 530 * DEG, 1e-12);
    /* travel of less than the pass: the turn that holds out longest, and for how long is said */
    m.axis[0].min_rad = -100 * DEG;
    m.axis[0].max_rad = 200 * DEG;
    m.axis[0].angle_rad = 0.0;
    assert_true(bst_mount_choose_turn(&m, pass, N, &c));
    assert_true(c.serves < N && c.serves > 30);
    bst_assert_close(c.angle_rad[0], 170 * DEG, 1e-12);
    /* outside of travel for good */
    for (int k = 0; k < N; k++) {
        pass[k] = azel(k, -60);
    }
    assert_false(bst_mount_choose_turn(&m, pass, N, &c));
    /* endless outer axis: one turn, and its encoder's wrap changes nothing */
    m = cross_elevation();
    for (int k = 0; k < N; k++) {
        double o = (170 + 0.1 * k) * DEG;
        pass[k] = (bst_vec3){sin(o), 0, cos(o)};
    }
    m.axis[0].angle_rad = -179 * DEG;
    assert_true(bst_mount_choose_turn(&m, pass, N, &c));
    assert_int_equal(c.serves, N);
    bst_assert_close(c.angle_rad[0], -190 * DEG, 1e-12);
    bst_assert_close(c.slew_s, 5.5, 1e-9);
}

/* The angles of a direction that are nearest to given ones within the travel: by trial of all turns
 * of both ways. */
static void nearest_within_travel(void **state) {
    (void)state;
    bst_rng_key key = bst_rng_make_key(2, 0, "test", "nearest");
    int found = 0, none = 0;
    for (uint64_t n = 0; n < 600; n++) {
        bst_mount_status m = n % 2 ? azimuth_elevation() : cross_elevation();
        double u[10], near[BST_MOUNT_AXES] = {0}, a[2][BST_MOUNT_AXES], got[BST_MOUNT_AXES];
        for (uint64_t k = 0; k < 10; k++) {
            u[k] = 2.0 * bst_rng_uniform(key, n, k) - 1.0;
        }
        bst_vec3 d = bst_vec3_unit((bst_vec3){u[0], u[1], u[2]});
        for (int i = 0; i < 2; i++) {
            double middle = 3.0 * u[3 + i], half = 0.3 + 3.0 * fabs(u[5 + i]);
            m.axis[i].min_rad = n % 3 == 0 && i == 0 ? 0.0 : middle - half; /* 0, 0: endless */
            m.axis[i].max_rad = n % 3 == 0 && i == 0 ? 0.0 : middle + half;
            near[i] = 6.0 * u[7 + i];
        }
        int ways = bst_mount_angles(&m, d, near, a);
        double least = INFINITY, best[2] = {0};
        for (int way = 0; way < ways; way++) {
            for (int turns = 0; turns < 81; turns++) {
                double tried[2] = {a[way][0] + 2.0 * BST_PI * (turns / 9 - 4),
                                   a[way][1] + 2.0 * BST_PI * (turns % 9 - 4)};
                double off = fmax(fabs(tried[0] - near[0]), fabs(tried[1] - near[1]));
                bool within = true;
                for (int i = 0; i < 2; i++) {
                    const bst_mount_axis *axis = &m.axis[i];
                    within = within && ((n % 3 == 0 && i == 0) ||
                                        (tried[i] >= axis->min_rad && tried[i] <= axis->max_rad));
                }
                if (within && off < least) {
                    least = off;
                    best[0] = tried[0];
                    best[1] = tried[1];
                }
            }
        }
        bool has = bst_mount_nearest(&m, d, near, got);
        assert_int_equal(has, isfinite(least));
        found += has;
        none += !has;
        for (int i = 0; has && i < 2; i++) {
            /* of two turns that are as far by one axis the other may differ */
            bst_assert_close(fmax(fabs(got[0] - near[0]), fabs(got[1] - near[1])), least, 1e-12);
            bst_assert_close(remainder(got[i] - best[i], 2.0 * BST_PI), 0.0, 1e-12);
        }
    }
    assert_true(found > 100 && none > 50);
}

/* A pass straight over the zenith: with travel over the top it is served as it is, by the way that
 * turns no azimuth at all. */
static void over_the_zenith(void **state) {
    (void)state;
    enum { N = 161 };
    bst_vec3 pass[N];
    for (int k = 0; k < N; k++) {
        double e = (10 + k) * DEG; /* 10 to 170 */
        pass[k] = (bst_vec3){cos(e), 0, sin(e)};
    }
    bst_mount_status m = azimuth_elevation();
    bst_mount_turn_choice c;
    assert_true(bst_mount_choose_turn(&m, pass, N, &c));
    assert_int_equal(c.serves, N);
    double near[BST_MOUNT_AXES], a[2][BST_MOUNT_AXES];
    for (int i = 0; i < BST_MOUNT_AXES; i++) {
        near[i] = c.angle_rad[i];
    }
    for (int k = 0; k < N; k++) {
        bst_mount_angles(&m, pass[k], near, a);
        for (int i = 0; i < BST_MOUNT_AXES; i++) {
            near[i] = a[0][i];
        }
        bst_assert_close(near[0], 0.0, 1e-12);
    }
    bst_assert_close(near[1], 170 * DEG, 1e-6); /* square root of rounding at the zenith */
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(known_angles),          cmocka_unit_test(any_direction),
        cmocka_unit_test(nearest_within_travel), cmocka_unit_test(wrap_that_serves),
        cmocka_unit_test(over_the_zenith),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
