/* Moves that the limits of a mount do not allow, against the closed forms of slews of least time.
 */
#include <math.h>
#include <string.h>

#include "sim/analysis/check/check_moves.h"
#include "tests/test_support.h"

typedef struct said_log {
    int count;
    char last[1024];
} said_log;

static void take(void *user, bst_log_level level, const char *message) {
    said_log *l = user;
    (void)level;
    l->count++;
    snprintf(l->last, sizeof l->last, "%s", message);
}

static bst_mount_status mount_of(double rate_degps, double accel_degps2) {
    bst_mount_status m = {.axes = 3};
    for (int a = 0; a < 3; a++) {
        m.axis[a].rate_limit_radps = rate_degps * BST_DEG_RAD;
        m.axis[a].accel_limit_radps2 = accel_degps2 * BST_DEG_RAD;
    }
    m.axis[1].rate_limit_radps *= 2.0; /* the other one counts */
    m.axis[2].accel_limit_radps2 *= 1e-3;
    m.axis[2].redundant = true; /* and not the one that nothing needs */
    return m;
}

static void test_slew(void **state) {
    (void)state;
    /* 2 sqrt(angle / a) below the rate limit, angle / v + v / a beyond: rounding */
    bst_mount_status m = mount_of(1.0, 0.5);
    bst_assert_close(bst_check_mount_slew_s(&m, 0.5 * BST_DEG_RAD), 2.0, 1e-9);
    bst_assert_close(bst_check_mount_slew_s(&m, 90 * BST_DEG_RAD), 92.0, 1e-9);
    m = mount_of(0.0, 0.5);
    bst_assert_close(bst_check_mount_slew_s(&m, 50 * BST_DEG_RAD), 20.0, 1e-9);
    m = mount_of(2.0, 0.0);
    bst_assert_close(bst_check_mount_slew_s(&m, 50 * BST_DEG_RAD), 25.0, 1e-9);
    m = mount_of(0.0, 0.0);
    m.axis[2].accel_limit_radps2 = 0.0;
    assert_true(bst_check_mount_slew_s(&m, 1.0) == 0.0);
    m = (bst_mount_status){.axes = 0};
    assert_true(bst_check_mount_slew_s(&m, 1.0) == 0.0);
}

static bst_control_config config(void) {
    bst_ctx ctx = {0};
    bst_control_config c = {0};
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_control_config_table, &c));
    return c;
}

static void test_search(void **state) {
    (void)state;
    said_log said = {0};
    bst_ctx ctx;
    bst_ctx_init(&ctx, take, &said, BST_LOG_WARNING);
    bst_control_config c = config();
    c.dwell_frames = 4;
    c.dwell_timeout_s = 15;
    c.search_step = 0.8;
    /* a step of 0.8 deg, 4 frames and an exposure of half a second: 10.5 s are left for it, which
     * takes 0.8 / 2.625^2 * 4 = 0.0290 deg/s^2 */
    bst_mount_status m;
    bst_check_mount_moves moves = {.control = &c,
                                   .mount = &m,
                                   .period_s = 1.0,
                                   .exposure_s = 0.5,
                                   .width_rad = BST_DEG_RAD,
                                   .height_rad = 0.5 * BST_DEG_RAD,
                                   .cue_sigma_rad = 0.4 * BST_DEG_RAD,
                                   .duration_s = 100.0};
    double needed = 4.0 * 0.8 / (10.5 * 10.5);
    m = mount_of(2.0, 1.001 * needed);
    assert_int_equal(bst_check_moves(&ctx, "a/b", &moves), 0);
    bst_assert_close(bst_check_search_place_s(&moves), 15.0, 0.01); /* half of 0.1 % of 10.5 s */
    m = mount_of(2.0, 0.999 * needed);
    assert_int_equal(bst_check_moves(&ctx, "a/b", &moves), 1);
    assert_int_equal(said.count, 1);
    /* 15.005 s and another period, in whole seconds */
    char text[400];
    snprintf(text, sizeof text,
             "a/b: the mount takes 10.5 s for a step of the search (0.8 deg at %.3g deg/s^2 and at "
             "most 2 deg/s): with dwell_frames of 4, dwell_timeout_s of 15 s is over first; raise "
             "its limits, or give control a dwell_timeout_s of 17 s",
             0.999 * needed);
    assert_string_equal(said.last, text);
    moves.cue_sigma_rad = 0.05 * BST_DEG_RAD; /* one place covers 3 sigma */
    assert_int_equal(bst_check_moves(&ctx, "a/b", &moves), 0);
    moves.region.kind = BST_REGION_ARC;
    assert_int_equal(bst_check_moves(&ctx, "a/b", &moves), 1);
    c.strategy = BST_CONTROL_STARE;
    assert_int_equal(bst_check_moves(&ctx, "a/b", &moves), 0);
}

static void test_scan(void **state) {
    (void)state;
    said_log said = {0};
    bst_ctx ctx;
    bst_ctx_init(&ctx, take, &said, BST_LOG_WARNING);
    bst_control_config c = config();
    c.strategy = BST_CONTROL_SCAN;
    c.scan_rate_arcsec_per_s = -3600;
    bst_mount_status m;
    bst_check_mount_moves moves = {.control = &c, .mount = &m, .period_s = 1.0};
    moves.region.kind = BST_REGION_ARC;
    moves.region.half_length_rad = 5.0 * BST_DEG_RAD;
    m = mount_of(0.9, 1.0);
    assert_int_equal(bst_check_moves(&ctx, "a/b", &moves), 1);
    assert_non_null(strstr(said.last, "faster than the mount turns (3240 arcsec/s)"));
    m = mount_of(1.1, 1.0);
    assert_int_equal(bst_check_moves(&ctx, "a/b", &moves), 0);
    m = mount_of(1.1, 0.19); /* 10.5 s to turn round, 10 s from end to end */
    assert_int_equal(bst_check_moves(&ctx, "a/b", &moves), 1);
    assert_non_null(strstr(said.last, "10.5 s"));
    assert_non_null(strstr(said.last, "0.19 deg/s^2"));
    assert_non_null(strstr(said.last, "10 s"));
    m = mount_of(1.1, 0.21);
    assert_int_equal(bst_check_moves(&ctx, "a/b", &moves), 0);
}

static void test_first_slew(void **state) {
    (void)state;
    said_log said = {0};
    bst_ctx ctx;
    bst_ctx_init(&ctx, take, &said, BST_LOG_WARNING);
    bst_control_config c = config();
    bst_mount_status m = mount_of(2.0, 0.01);
    bst_check_mount_moves moves = {.control = &c, .mount = &m, .duration_s = 100.0};
    /* 2 sqrt(25 / 0.01) = 100 s */
    assert_int_equal(bst_check_first_slew(&ctx, "a/b", &moves, 24.9 * BST_DEG_RAD), 0);
    assert_int_equal(bst_check_first_slew(&ctx, "a/b", &moves, 25.1 * BST_DEG_RAD), 1);
    assert_string_equal(
        said.last,
        "a/b: the slew to the cue, 25.1 deg, takes 100 s at the mount's 0.01 "
        "deg/s^2 and at most 2 deg/s, and the run 100 s; raise its limits, or start "
        "nearer to the cue");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_slew),
        cmocka_unit_test(test_search),
        cmocka_unit_test(test_scan),
        cmocka_unit_test(test_first_slew),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
