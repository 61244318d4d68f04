#include "scenegen/reference.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

enum { W = 64, H = 48 };
static const bst_window window = {0, 0, W, H};

static double cumulative(double z) {
    return 0.5 * erfc(-z / sqrt(2.0));
}

/* Integral of the normal distribution function: z Phi(z) + phi(z). */
static double ramp(double z) {
    return z * cumulative(z) + exp(-0.5 * z * z) / sqrt(2.0 * BST_PI);
}

static void render(const bst_camera *camera, const scene_motion *m, const bst_source *s,
                   double *image) {
    bst_ctx ctx = {0};
    scene_track track = scene_track_make(camera, m);
    memset(image, 0, W * H * sizeof *image);
    bst_assert_ok(&ctx,
                  bst_reference_render(&ctx, camera, window, &track.track, s, 1, 1e-9, image));
    scene_track_free(&track);
}

static void a_static_star_is_a_product_of_erf_differences(void **state) {
    (void)state;
    static double image[W * H];
    bst_camera camera = scene_camera(W, H);
    double sigma = bst_camera_psf_sigma_px(&camera), x = 30.3, y = 21.8;
    bst_source star = scene_star(&camera, x, y, 2000.0);
    render(&camera, &(scene_motion){.duration_s = 0.5, .samples = 2}, &star, image);
    double sum = 0.0;
    for (int j = 0; j < H; j++) {
        for (int i = 0; i < W; i++) {
            double sx = cumulative((i + 0.5 - x) / sigma) - cumulative((i - 0.5 - x) / sigma);
            double sy = cumulative((j + 0.5 - y) / sigma) - cumulative((j - 0.5 - y) / sigma);
            /* place from the unit vector: 1e-16 / 1.5e-5 rad per px, times 1000 e- times slope */
            bst_assert_close(image[j * W + i], 1000.0 * sx * sy, 1e-7);
            sum += image[j * W + i];
        }
    }
    bst_assert_close(sum, 1000.0, 1e-9); /* all light is on the window */
}

static void a_uniform_streak_has_a_closed_form(void **state) {
    (void)state;
    static double image[W * H];
    bst_camera camera = scene_camera(W, H);
    /* a tiny scale makes turn and image motion proportional: 30 px are 1.5 microradians */
    camera.pixel_scale_arcsec = 0.01;
    double sigma = bst_camera_psf_sigma_px(&camera), length = 30.0, y = 23.7;
    bst_source star = scene_star(&camera, bst_camera_centre_x(&camera), y, 1000.0);
    render(&camera, &(scene_motion){.x_px = length, .duration_s = 1.0, .samples = 2}, &star, image);
    double x0 = bst_camera_centre_x(&camera) - 0.5 * length, x1 = x0 + length, sum = 0.0;
    for (int j = 0; j < H; j++) {
        double sy = cumulative((j + 0.5 - y) / sigma) - cumulative((j - 0.5 - y) / sigma);
        for (int i = 0; i < W; i++) {
            double a = i - 0.5, b = i + 0.5;
            double sx = sigma / length *
                        (ramp((b - x0) / sigma) - ramp((b - x1) / sigma) - ramp((a - x0) / sigma) +
                         ramp((a - x1) / sigma));
            /* peak 18 e-; quadrature 1e-9 of it, unit vectors 1e-16 / 5e-8 rad per px */
            bst_assert_close(image[j * W + i], 1000.0 * sx * sy, 2e-7);
            sum += image[j * W + i];
        }
    }
    bst_assert_close(sum, 1000.0, 1e-6);
}

/* The camera turns so that a moving source stays put: a static image. */
static void own_motion_and_camera_motion_cancel(void **state) {
    (void)state;
    static double moving[W * H], still[W * H];
    bst_camera camera = scene_camera(W, H);
    camera.pixel_scale_arcsec = 0.01;
    double cx = bst_camera_centre_x(&camera), cy = bst_camera_centre_y(&camera);
    bst_source object = scene_star(&camera, cx, cy, 500.0);
    object.kind = BST_SOURCE_OBJECT;
    bst_source_path path =
        bst_source_path_through(bst_camera_unproject(&camera, cx + 10.0, cy), object.apparent_mid,
                                bst_camera_unproject(&camera, cx - 10.0, cy));
    object.path = &path;
    render(&camera, &(scene_motion){.x_px = 20.0, .duration_s = 1.0, .samples = 2}, &object,
           moving);
    bst_source star = scene_star(&camera, cx, cy, 500.0);
    render(&camera, &(scene_motion){.duration_s = 1.0, .samples = 2}, &star, still);
    for (int p = 0; p < W * H; p++) {
        /* quadratic against circular arc: 20 px at 5e-8 rad, far below; unit vectors as above */
        bst_assert_close(moving[p], still[p], 1e-6);
    }
}

static void occulted_and_dark_sources_give_nothing(void **state) {
    (void)state;
    static double image[W * H];
    bst_camera camera = scene_camera(W, H);
    bst_source star = scene_star(&camera, 20.0, 20.0, 500.0);
    star.occulted = true;
    render(&camera, &(scene_motion){.duration_s = 1.0, .samples = 2}, &star, image);
    for (int p = 0; p < W * H; p++) {
        assert_true(image[p] == 0.0);
    }
}

/* Tabulated: upper tail of the normal distribution at 8 and 9 standard deviations. */
static void wings_keep_relative_precision(void **state) {
    (void)state;
    /* Q(8) = 6.220960574271785e-16, Q(9) = 1.1285884059538405e-19 */
    bst_assert_close(bst_reference_pixel_share(0.5, 1.0, 9),
                     6.220960574271785e-16 - 1.1285884059538405e-19, 1e-28);
    bst_assert_close(bst_reference_pixel_share(-0.5, 1.0, -9),
                     6.220960574271785e-16 - 1.1285884059538405e-19, 1e-28);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_static_star_is_a_product_of_erf_differences),
        cmocka_unit_test(a_uniform_streak_has_a_closed_form),
        cmocka_unit_test(own_motion_and_camera_motion_cancel),
        cmocka_unit_test(occulted_and_dark_sources_give_nothing),
        cmocka_unit_test(wings_keep_relative_precision),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
