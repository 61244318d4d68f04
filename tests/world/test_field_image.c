/* Moments of a source's image: over a crooked track with changing light, of a disc, under
 * vignetting, and what a matched filter gathers; against sums and integrals made here. */
#include "sim/world/scene/field_image.h"

#include "boresight/camera.h"
#include "tests/world/lit_sphere.h"

#define SCALE (5.0 * BST_ARCSEC_RAD)

static bst_camera test_camera(void) {
    return (bst_camera){
        .width_px = 400, .height_px = 300, .pixel_scale_arcsec = 5, .psf_fwhm_px = 2};
}

/* The camera's way in px of what is seen at rest. */
enum { SAMPLES = 6 };
static const double at_s[SAMPLES] = {0, 0.2, 0.3, 0.8, 1.1, 2.0};
static const double x_px[SAMPLES] = {0, 5, -3, 10, 12, 20}, y_px[SAMPLES] = {0, 2, 8, 1, 1, -4};

static double between(const double *v, double u) {
    int k = 0;
    while (k + 2 < SAMPLES && at_s[k + 1] < 2 * u) {
        k++;
    }
    return v[k] + (2 * u - at_s[k]) / (at_s[k + 1] - at_s[k]) * (v[k + 1] - v[k]);
}

static void light_on_a_crooked_track(void **state) {
    (void)state;
    bst_camera camera = test_camera();
    bst_quat q[SAMPLES];
    for (int k = 0; k < SAMPLES; k++) {
        /* x to the right by a turn about y */
        q[k] = bst_quat_from_rotvec((bst_vec3){-y_px[k] * SCALE, x_px[k] * SCALE, 0});
    }
    const bst_los_track track = {SAMPLES, at_s, q};
    /* from half of the mean rate to one and a half: light u / 2 + u^2 / 2 */
    const bst_scene_source_rate rate = {
        .count = 2, .u = {0, 1}, .rate = {0.5, 1.5}, .light = {0, 1}};
    const bst_scene_source brighter = {.apparent_mid = {0, 0, 1}, .rate = &rate},
                           steady = {.apparent_mid = {0, 0, 1}};
    static const double parts[][2] = {{0, 1}, {0.2, 0.7}, {0, 0.4}, {0.6, 1}};
    for (int p = 0; p < 8; p++) {
        const bst_scene_source *s = p < 4 ? &brighter : &steady;
        double u0 = parts[p % 4][0], u1 = parts[p % 4][1], w = 0, m[9] = {0};
        enum { N = 200000 };
        for (int i = 0; i < N; i++) {
            double u = u0 + (u1 - u0) * (i + 0.5) / N, r = p < 4 ? 0.5 + u : 1;
            double x = 199.5 + between(x_px, u), y = 149.5 + between(y_px, u);
            w += r;
            m[0] += r * x;
            m[1] += r * y;
            m[2] += r * x * x;
            m[3] += r * x * y;
            m[4] += r * y * y;
            double t = (i + 0.5) / N - 0.5;
            m[5] += r * t;
            m[6] += r * t * t;
            m[7] += r * t * x;
            m[8] += r * t * y;
        }
        for (int i = 0; i < 9; i++) {
            m[i] /= w;
        }
        bst_scene_image_moments got = bst_scene_image_by_light(&camera, &track, s, u0, u1);
        /* 128 intervals of at most a third of a pixel, with corners in some of them */
        bst_assert_close(got.x_mean, m[0], 0.01);
        bst_assert_close(got.y_mean, m[1], 0.01);
        bst_assert_close(got.xx, m[2] - m[0] * m[0], 0.08);
        bst_assert_close(got.xy, m[3] - m[0] * m[1], 0.08);
        bst_assert_close(got.yy, m[4] - m[1] * m[1], 0.08);
        /* the straight path nearest to it */
        double spread = m[6] - m[5] * m[5];
        bst_assert_close(got.dx, (m[7] - m[5] * m[0]) / spread, 0.05);
        bst_assert_close(got.dy, (m[8] - m[5] * m[1]) / spread, 0.05);
    }
}

static void a_disc_moves_and_widens_the_image(void **state) {
    (void)state;
    bst_camera camera = test_camera();
    const bst_vec3 sun = {0.36, 0.48, -0.8}, earth = {-0.96, 0.0, 0.28};
    for (int mirror = 0; mirror < 2; mirror++) {
        bst_scene_source_shape shape = {.radius = 20 * SCALE,
                                        .sun = sun,
                                        .earth = earth,
                                        .diffuse = mirror ? 0 : 0.5,
                                        .earthshine = mirror ? 0 : 0.3,
                                        .specular = mirror ? 1 : 0.05,
                                        .thermal = mirror ? 0 : 0.15};
        bst_scene_source s = {.apparent_mid = ahead, .shape = &shape};
        moments parts[3] = {lit_surface(shape.radius, &sun), lit_surface(shape.radius, &earth),
                            lit_surface(shape.radius, NULL)};
        /* the mirror's point, from far away */
        bst_vec3 n = bst_vec3_unit(bst_vec3_sub(sun, ahead));
        moments point = {.total = 0};
        moments_add(&point,
                    bst_vec3_scale(bst_vec3_axpy(n, -bst_vec3_dot(n, ahead), ahead), shape.radius),
                    1);
        const double shares[4] = {shape.diffuse, shape.earthshine, shape.thermal, shape.specular};
        double ex = 0, ey = 0, xx = 0, xy = 0, yy = 0;
        for (int i = 0; i < 4; i++) {
            const moments *m = i < 3 ? &parts[i] : &point;
            ex += shares[i] * bst_vec3_dot(m->mean, cross_x) / SCALE;
            ey += shares[i] * bst_vec3_dot(m->mean, cross_y) / SCALE;
            xx += shares[i] * m->along_xx / (SCALE * SCALE);
            xy += shares[i] * m->along_xy / (SCALE * SCALE);
            yy += shares[i] * m->along_yy / (SCALE * SCALE);
        }
        /* columns along cross_x, rows along cross_y */
        const bst_mat3 rows = {{{cross_x.x, cross_x.y, cross_x.z},
                                {cross_y.x, cross_y.y, cross_y.z},
                                {ahead.x, ahead.y, ahead.z}}};
        bst_scene_image_moments m = {10, -7, 3, -2, 5, 0, 0};
        bst_scene_image_add_disc(&camera, bst_quat_from_mat3(&rows), &s, &m);
        /* 24 rings of 48 places on a radius of 20 px */
        bst_assert_close(m.x_mean, 10 + ex, 0.05);
        bst_assert_close(m.y_mean, -7 + ey, 0.05);
        bst_assert_close(m.xx, 3 + xx - ex * ex, 0.8);
        bst_assert_close(m.xy, -2 + xy - ex * ey, 0.8);
        bst_assert_close(m.yy, 5 + yy - ey * ey, 0.8);
        /* behind the camera nothing changes */
        bst_scene_image_moments same = {10, -7, 3, -2, 5, 0, 0};
        s.apparent_mid = bst_vec3_scale(ahead, -1);
        bst_scene_image_add_disc(&camera, bst_quat_from_mat3(&rows), &s, &same);
        assert_true(same.x_mean == 10 && same.y_mean == -7 && same.xx == 3 && same.yy == 5);
    }
}

/* Light of covariance C on an illumination V moves by C times the gradient of ln V. */
static void vignetting_moves_the_light(void **state) {
    (void)state;
    bst_camera camera = test_camera();
    camera.optics.vignetting.model = BST_VIGNETTING_POLYNOMIAL;
    camera.optics.vignetting.coefficients[0] = -0.5;
    const bst_scene_source s = {.apparent_mid = {0, 0, 1}};
    const bst_scene_image_moments m = {330, 40, 9, -4, 6, 0, 0};
    double half2 = 0.25 * (400.0 * 400 + 300.0 * 300), dx = 330 - 199.5, dy = 40 - 149.5;
    double v = 1 - 0.5 * (dx * dx + dy * dy) / half2;
    double gx = -dx / half2 / v, gy = -dy / half2 / v, psf = 4 / (8 * log(2.0));
    double x, y;
    bst_scene_image_centroid(&camera, &s, &m, &x, &y);
    /* the gradient of a quadratic by a central difference is exact */
    bst_assert_close(x - 330, (9 + psf) * gx - 4 * gy, 1e-10);
    bst_assert_close(y - 40, -4 * gx + (6 + psf) * gy, 1e-10);
    camera.optics.vignetting.model = BST_VIGNETTING_NONE;
    bst_scene_image_centroid(&camera, &s, &m, &x, &y);
    assert_true(x == 330 && y == 40);
    const bst_scene_image_moments nowhere = {NAN, 40, 0, 0, 0, 0, 0};
    bst_scene_image_centroid(&camera, &s, &nowhere, &x, &y);
    assert_true(isnan(x) && y == 40);
}

static void squares_of_streaks(void **state) {
    (void)state;
    static const double lengths[] = {0, 1e-4, 2e-3, 0.5, 3, 40};
    for (int i = 0; i < 6; i++) {
        for (int w = 0; w < 2; w++) {
            double length = lengths[i], along = w ? 0.7 : 1.3, across = w ? 2.1 : 0.8, sum = 0;
            double reach = 0.5 * length + 8 * along;
            enum { N = 20000 };
            for (int k = 0; k < N; k++) {
                double t = reach * (2 * (k + 0.5) / N - 1), r2 = sqrt(2) * along;
                double p = length > 0
                               ? (erf((t + 0.5 * length) / r2) - erf((t - 0.5 * length) / r2)) /
                                     (2 * length)
                               : exp(-0.5 * t * t / (along * along)) / (sqrt(2 * BST_PI) * along);
                sum += p * p * 2 * reach / N;
            }
            double expected = sum / (2 * sqrt(BST_PI) * across);
            /* differences of error functions of lengths of 1e-4: 1e-11; the series: a^4 */
            bst_assert_close(bst_optics_image_squared(along, across, length), expected,
                             1e-7 * expected);
        }
    }
}

/* What blurs a path of (12, 5) px besides its length: jitter of 0.5 px along it, of 0.3 px across,
 * and 2 px of FWHM with the pixel's width. */
static void blur_along_and_across(void **state) {
    (void)state;
    bst_camera camera = test_camera();
    const bst_scene_source source = {.kind = BST_SOURCE_STAR};
    const double c = 12.0 / 13, s = 5.0 / 13, uu = 13.0 * 13 / 12 + 0.25, vv = 0.09;
    const bst_scene_image_moments m = {.x_mean = 100,
                                       .y_mean = 80,
                                       .xx = uu * c * c + vv * s * s,
                                       .xy = (uu - vv) * c * s,
                                       .yy = uu * s * s + vv * c * c};
    double along, across, psf = 4 / (8 * log(2)) + 1.0 / 12;
    bst_assert_close(bst_image_blur(&camera, &source, &m, 12, 5, &along, &across), psf, 1e-12);
    bst_assert_close(along, sqrt(psf + 0.25), 1e-12);
    bst_assert_close(across, sqrt(psf + 0.09), 1e-12);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(light_on_a_crooked_track),
        cmocka_unit_test(a_disc_moves_and_widens_the_image),
        cmocka_unit_test(vignetting_moves_the_light),
        cmocka_unit_test(squares_of_streaks),
        cmocka_unit_test(blur_along_and_across),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
