/* A day of a full mount at 1 kHz: three axes with friction, cables and modes follow a direction
 * that goes round every 90 minutes and past the pole each time. Argument: seconds (default 86400).
 */
#include "gimbal/mount/mount.h"
#include "tests/test_support.h"

#define DT 1e-3

static int64_t seconds = 86400;

static void a_day_without_drift(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_mount_config c;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_mount_config_table, &c));
    c.third_axis = true;
    c.travel_min_deg[1] = -100.0;
    c.travel_max_deg[1] = 100.0;
    c.flexible.frequency_hz[0] = c.flexible.frequency_hz[1] = 60.0;
    static bst_mount m;
    bst_assert_ok(
        &ctx, bst_mount_init(&ctx, &m, BST_MOUNT_AZIMUTH_ELEVATION, &c, DT, (bst_rng_key){{1, 2}}));
    /* 2 degrees from the pole at +x, starting near +z */
    bst_vec3 about = bst_vec3_unit((bst_vec3){sin(2.0 * BST_DEG_RAD), cos(2.0 * BST_DEG_RAD), 0});
    bst_vec3 from = {0, 0, 1};
    double rate = 2.0 * BST_PI / 5400.0, square = 0.0, worst = 0.0, turns = 0.0;
    bst_mount_body body = {.q_believed_from_gcrf = BST_QUAT_IDENTITY};
    bst_los_command k = {.tick = 0};
    int64_t judged = 0;
    for (int64_t n = 0; n < seconds * 1000; n++) {
        if (n % 50 == 0) {
            double t = (double)n * DT;
            k.direction_gcrf =
                bst_quat_rotate(bst_quat_from_rotvec(bst_vec3_scale(about, rate * t)), from);
            k.rate_gcrf_radps = bst_vec3_scale(bst_vec3_cross(about, k.direction_gcrf), rate);
        }
        double age = (double)(n % 50) * DT;
        bst_mount_step(&m, &body, &k, age, n % 10 == 0);
        if (n % 997 == 0 && n > 30000) {
            bst_vec3 want = bst_vec3_unit(bst_vec3_axpy(k.direction_gcrf, age, k.rate_gcrf_radps));
            bst_vec3 sight = bst_quat_rotate(bst_quat_conj(m.q_cam_from_body), (bst_vec3){0, 0, 1});
            double error = bst_vec3_angle(sight, want);
            assert_true(isfinite(error));
            square += error * error;
            worst = fmax(worst, error);
            turns = fmax(turns, fabs(m.joints.state.angle_rad[0]));
            judged++;
        }
    }
    print_message("%lld s: rms %.3g, worst %.3g arcsec, outer axis up to %.1f deg, %lld events\n",
                  (long long)seconds, sqrt(square / (double)judged) / BST_ARCSEC_RAD,
                  worst / BST_ARCSEC_RAD, turns / BST_DEG_RAD, (long long)m.joints.events);
    assert_true(sqrt(square / (double)judged) < 0.5 * BST_ARCSEC_RAD);
    assert_true(worst < 15.0 * BST_ARCSEC_RAD); /* at the pole, as in test_mount.c */
    assert_true(turns <= m.travel_max_rad[0]);
}

int main(int argc, char **argv) {
    seconds = argc > 1 ? atoll(argv[1]) : seconds;
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_day_without_drift)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
