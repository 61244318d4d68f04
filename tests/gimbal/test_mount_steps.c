/* Step size against error of the joints' integrators: the table in
 * docs/explanation/equations/gimbal.md. */
#include <time.h>

#include "gimbal/mount/mount_joints.h"
#include "tests/test_support.h"

/* Three stages with cables, a flexible mode of 30 Hz on the inner one, on a body that sways;
 * torques are constant over 8 ms and rates of the body straight, so that every step size sees the
 * same. */
static void run(int method, bool friction, double dt, double angle[3], double *seconds) {
    bst_mount_joints j = {.chain = {.stages = 3,
                                    .inertia = {{0.6, 0.5, 0.45, 0.02, -0.03, 0.01},
                                                {0.3, 0.28, 0.2, -0.01, 0.02, 0.015},
                                                {0.1, 0.09, 0.06, 0.004, 0.003, -0.005}}},
                          .method = method};
    double w = 2.0 * BST_PI * 30.0, swings = 0.05;
    j.chain.flex_inertia[1] = swings;
    j.chain.flex_stiffness[1] = swings * w * w;
    j.chain.flex_damping[1] = 2.0 * 0.01 * w * swings;
    for (int k = 0; k < 3; k++) {
        j.joint[k] = (bst_mount_joint){.coulomb_nm = friction ? 0.05 : 0.0,
                                       .breakaway_nm = friction ? 0.06 : 0.0,
                                       .stribeck_radps = 0.02,
                                       .viscous_nms = 0.05,
                                       .spring_nm = 2.0,
                                       .min_rad = -INFINITY,
                                       .max_rad = INFINITY};
    }
    bst_mount_joints_init(&j, (double[3]){0.1, 0.2, -0.1});
    clock_t start = clock();
    int64_t steps = (int64_t)llround(4.096 / dt);
    bst_vec3 before = {0, 0, 0};
    for (int64_t n = 0; n < steps; n++) {
        double t = floor((double)n * dt / 0.008 + 1e-9) * 0.008, u = t + 0.008;
        double part = ((double)(n + 1) * dt - t) / 0.008;
        double torque[3] = {0.8 * sin(3.0 * t), 0.4 * sin(5.0 * t + 1.0), 0.2 * cos(4.0 * t)};
        bst_vec3 after = {0.02 * ((1.0 - part) * sin(t) + part * sin(u)),
                          0.01 * ((1.0 - part) * sin(2.0 * t) + part * sin(2.0 * u)),
                          0.01 * (t + part * 0.008)};
        bst_mount_joints_step(&j, dt, torque, before, after);
        before = after;
    }
    *seconds = (double)(clock() - start) / CLOCKS_PER_SEC / (double)steps;
    for (int k = 0; k < 3; k++) {
        angle[k] = j.state.angle_rad[k];
    }
}

static void errors_fall_with_the_step(void **state) {
    (void)state;
    const double step_ms[] = {4.0, 2.0, 1.0, 0.5, 0.25};
    for (int friction = 0; friction < 2; friction++) {
        double truth[3], seconds;
        run(BST_JOINT_RK4, friction == 1, 1e-3 / 64.0, truth, &seconds);
        for (int method = 0; method < 2; method++) {
            double error[5];
            for (int i = 0; i < 5; i++) {
                double angle[3];
                run(method, friction == 1, 1e-3 * step_ms[i], angle, &seconds);
                error[i] = 0.0;
                for (int k = 0; k < 3; k++) {
                    error[i] = fmax(error[i], fabs(angle[k] - truth[k]));
                }
                print_message("| `%s` | %s | %g | %.1e | %.2f |\n", method ? "leapfrog" : "rk4",
                              friction ? "yes" : "no", step_ms[i], error[i] / BST_ARCSEC_RAD,
                              1e6 * seconds);
            }
            if (!friction) { /* order 4 and 2 */
                bst_assert_close(log2(error[0] / error[2]) / 2.0, method ? 2.0 : 4.0, 0.4);
            }
            /* at the plant's step of 1 ms: events of friction are found to the order 2 */
            double allowed_arcsec = method ? 1.0 : friction ? 0.1 : 1e-5;
            assert_true(error[2] < allowed_arcsec * BST_ARCSEC_RAD);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(errors_fall_with_the_step)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
