/* Directions of detections with covariances that have all terms off the diagonal, against
 * differences over pixels and small turns of the camera; predictions over steps that are no second.
 */
#include "boresight/vec.h"
#include "tests/test_support.h"
#include "tracker/attitude/sky_of_detection.h"
#include "tracker/mtt/filter.h"

static const bst_camera camera = {
    .width_px = 800, .height_px = 600, .pixel_scale_arcsec = 20, .rotation_deg = 25};
static const bst_light light = {.velocity_mps = {2e4, -1.5e4, 1e4}, .sun_m = {1.5e11, 0, 0}};
static const bst_quat attitude = {0.1, -0.2, 0.4, 0.8888194417315589};

static bst_vec3 direction(double x, double y, bst_vec3 turn) {
    bst_vec3 v = bst_camera_unproject(&camera, x, y);
    v = bst_vec3_unit(bst_vec3_add(v, bst_vec3_cross(turn, v)));
    return bst_light_unaberrate(&light, bst_quat_rotate(bst_quat_conj(attitude), v));
}

static void all_terms_of_the_covariance(void **state) {
    (void)state;
    const bst_detection d = {
        .x_px = 120.5, .y_px = 511, .cov_xx = 0.04, .cov_xy = -0.03, .cov_yy = 0.09};
    const double extra_px2 = 0.01, a = 1e-10; /* (2 arcsec)^2; a pixel is 20 */
    const double cam[3][3] = {
        {4 * a, 2.5 * a, -3 * a}, {2.5 * a, 9 * a, 5 * a}, {-3 * a, 5 * a, 900 * a}};
    double c[5][5] = {{0.05, -0.03}, {-0.03, 0.10}}, east[5], north[5], found[3] = {0};
    const double h = 1e-4;
    const bst_vec3 none = {0, 0, 0}, axes[3] = {{h, 0, 0}, {0, h, 0}, {0, 0, h}};
    bst_vec3 at = direction(d.x_px, d.y_px, none), by[5];
    by[0] =
        bst_vec3_sub(direction(d.x_px + 0.5, d.y_px, none), direction(d.x_px - 0.5, d.y_px, none));
    by[1] =
        bst_vec3_sub(direction(d.x_px, d.y_px + 0.5, none), direction(d.x_px, d.y_px - 0.5, none));
    for (int i = 0; i < 3; i++) {
        bst_vec3 back = bst_vec3_scale(axes[i], -1);
        by[2 + i] = bst_vec3_scale(
            bst_vec3_sub(direction(d.x_px, d.y_px, axes[i]), direction(d.x_px, d.y_px, back)),
            0.5 / h);
        for (int k = 0; k < 3; k++) {
            c[2 + i][2 + k] = cam[i][k];
        }
    }
    bst_vec3 e1 = bst_vec3_unit((bst_vec3){-at.y, at.x, 0}), e2 = bst_vec3_cross(at, e1);
    for (int i = 0; i < 5; i++) {
        east[i] = bst_vec3_dot(by[i], e1);
        north[i] = bst_vec3_dot(by[i], e2);
    }
    for (int i = 0; i < 5; i++) {
        for (int k = 0; k < 5; k++) {
            found[0] += east[i] * c[i][k] * east[k];
            found[1] += east[i] * c[i][k] * north[k];
            found[2] += north[i] * c[i][k] * north[k];
        }
    }
    bst_sky_measurement m = bst_sky_of_detection(&camera, &d, extra_px2, attitude, cam, &light);
    bst_assert_close(bst_vec3_angle(m.direction, at), 0, 1e-9);
    /* aberration stretches the sky by 1e-4 */
    double margin = 5e-4 * sqrt(found[0] * found[2]);
    assert_true(fabs(found[1]) > 20 * margin);
    bst_assert_close(m.cov_11, found[0], margin);
    bst_assert_close(m.cov_12, found[1], margin);
    bst_assert_close(m.cov_22, found[2], margin);
}

/* F P F' + Q of a point at rest, Q of white acceleration: t^3/3, t^2/2, t. */
static void predictions_over_any_step(void **state) {
    (void)state;
    static const double steps_s[] = {0.25, 4, -2};
    const double noise = 2e-13, u = 1e-10;
    const double p[4][4] = {{4 * u, 1 * u, 0.5 * u, -0.3 * u},
                            {1 * u, 6 * u, 0.2 * u, 0.7 * u},
                            {0.5 * u, 0.2 * u, 0.9 * u, 0.1 * u},
                            {-0.3 * u, 0.7 * u, 0.1 * u, 1.1 * u}};
    for (int s = 0; s < 3; s++) {
        double t = steps_s[s], size = fabs(t), wanted[4][4];
        for (int i = 0; i < 4; i++) {
            for (int k = 0; k < 4; k++) {
                double more_i = i < 2 ? t : 0, more_k = k < 2 ? t : 0;
                int ri = i % 2 + 2, rk = k % 2 + 2;
                wanted[i][k] =
                    p[i][k] + more_i * p[ri][k] + more_k * p[i][rk] + more_i * more_k * p[ri][rk];
                if (i % 2 == k % 2) {
                    wanted[i][k] += noise * (i < 2 && k < 2     ? size * size * size / 3
                                             : i >= 2 && k >= 2 ? size
                                                                : size * t / 2);
                }
            }
        }
        for (int unscented = 0; unscented < 2; unscented++) {
            bst_sky_state x = {.direction = bst_vec3_unit((bst_vec3){0.5, -0.6, 0.3})};
            memcpy(x.covariance, p, sizeof p);
            (unscented ? bst_sky_predict_unscented : bst_sky_predict)(&x, t, noise);
            for (int i = 0; i < 4; i++) {
                for (int k = 0; k < 4; k++) {
                    /* curvature of the sphere: 1e-4 rad of motion */
                    bst_assert_close(x.covariance[i][k], wanted[i][k], 2e-4 * u);
                }
            }
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_terms_of_the_covariance),
        cmocka_unit_test(predictions_over_any_step),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
