#define _XOPEN_SOURCE 700 /* j1 */
#include "scenegen/reference.h"

#include "scenegen/reference_internal.h"
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

static void render(const bst_camera *camera, const scene_motion *m, const bst_scene_source *s,
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
    bst_scene_source star = scene_star(&camera, x, y, 2000.0);
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
    bst_scene_source star = scene_star(&camera, bst_camera_centre_x(&camera), y, 1000.0);
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
    bst_scene_source object = scene_star(&camera, cx, cy, 500.0);
    object.kind = BST_SOURCE_OBJECT;
    bst_scene_source_path path = bst_scene_source_path_through(
        bst_camera_unproject(&camera, cx + 10.0, cy), object.apparent_mid,
        bst_camera_unproject(&camera, cx - 10.0, cy));
    object.path = &path;
    render(&camera, &(scene_motion){.x_px = 20.0, .duration_s = 1.0, .samples = 2}, &object,
           moving);
    bst_scene_source star = scene_star(&camera, cx, cy, 500.0);
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
    bst_scene_source star = scene_star(&camera, 20.0, 20.0, 500.0);
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

/* ------------------------------------------------------------------ any PSF */

/* Largest difference of the spectral method from the erf method, over the peak. */
static double difference(const bst_camera *camera, const scene_motion *m,
                         const bst_scene_source *s) {
    static double want[W * H], got[W * H];
    bst_ctx ctx = {0};
    bst_psf *psf;
    scene_track track = scene_track_make(camera, m);
    memset(want, 0, sizeof want);
    memset(got, 0, sizeof got);
    bst_assert_ok(&ctx, bst_psf_create(&ctx, camera, &psf));
    bst_assert_ok(
        &ctx, bst_reference_render_psf(&ctx, camera, psf, window, &track.track, s, 1, 1e-10, want));
    bst_assert_ok(
        &ctx, bst_reference_spectrum(&ctx, camera, psf, window, &track.track, s, 1, 1e-10, got));
    double worst = 0.0, peak = 0.0;
    for (int p = 0; p < W * H; p++) {
        worst = fmax(worst, fabs(got[p] - want[p]));
        peak = fmax(peak, want[p]);
    }
    bst_psf_free(psf);
    scene_track_free(&track);
    return worst / peak;
}

static void both_methods_agree_on_gaussians(void **state) {
    (void)state;
    const struct {
        double fwhm_px;
        scene_motion motion;
    } cases[] = {
        {0.3, {.duration_s = 1.0, .samples = 2}},
        {1.1, {.x_px = 30.0, .y_px = 11.0, .duration_s = 1.0, .samples = 3}},
        {2.0, {.roll_rad = 2.0, .duration_s = 1.0, .samples = 5}}, /* arcs of up to 60 px */
        {2.0, {.roll_rad = 2.0 * BST_PI, .duration_s = 1.0, .samples = 9}}, /* a full turn */
        {2.0, {.x_px = 9.0, .bend_px = 9.0, .jitter_px = 1.5, .duration_s = 0.5, .samples = 90}},
        {2.0, {.x_px = 900.0, .duration_s = 1.0, .samples = 2}}, /* comes and goes */
        {20.0, {.x_px = 20.0, .duration_s = 1.0, .samples = 2}},
    };
    for (size_t n = 0; n < sizeof cases / sizeof *cases; n++) {
        bst_camera camera = scene_camera(W, H);
        camera.psf_fwhm_px = cases[n].fwhm_px;
        bst_scene_source star = scene_star(&camera, 37.2, 17.9, 1000.0);
        /* 1e-9 each: the OTF is cut where it is 1e-9, the wrap-around is less */
        assert_true(difference(&camera, &cases[n].motion, &star) < 4e-9);
    }
}

/* Airy's pattern of an annulus in px, whose integral over the plane is 1. */
static double airy(double q, double e, double r) {
    double v = BST_PI * r / q, a = v < 1e-6 ? 1.0 : 2.0 * j1(v) / v;
    double b = e * v < 1e-6 ? 1.0 : 2.0 * j1(e * v) / (e * v);
    double amplitude = (a - e * e * b) / (1.0 - e * e);
    return amplitude * amplitude * 0.25 * BST_PI * (1.0 - e * e) / (q * q);
}

/* Its integral over a pixel: ten points of Gauss-Legendre's rule of five on both halves. */
static double airy_pixel(double q, double e, double dx, double dy) {
    static const double place[5] = {-0.9061798459386640, -0.5384693101056831, 0.0,
                                    0.5384693101056831, 0.9061798459386640};
    static const double weight[5] = {0.2369268850561891, 0.4786286704993665, 0.5688888888888889,
                                     0.4786286704993665, 0.2369268850561891};
    double sum = 0.0;
    for (int j = 0; j < 10; j++) {
        for (int i = 0; i < 10; i++) {
            double x = dx + 0.25 * (place[i % 5] + (i < 5 ? -1.0 : 1.0));
            double y = dy + 0.25 * (place[j % 5] + (j < 5 ? -1.0 : 1.0));
            sum += weight[i % 5] * weight[j % 5] / 16.0 * airy(q, e, hypot(x, y));
        }
    }
    return sum;
}

static bst_camera diffraction_camera(double q, double e) {
    bst_camera camera = scene_camera(W, H);
    camera.obscuration = e * e;
    camera.optics.psf = BST_PSF_DIFFRACTION;
    camera.optics.q = q;
    camera.optics.wavelengths = 1;
    return camera;
}

static void a_static_star_is_airys_pattern(void **state) {
    (void)state;
    static double image[W * H];
    const double cases[][2] = {{2.0, 0.0}, {1.0, 0.3}, {0.6, 0.0}};
    for (int n = 0; n < 3; n++) {
        double q = cases[n][0], e = cases[n][1], x = 30.3, y = 21.8, peak = 0.0, worst = 0.0;
        bst_camera camera = diffraction_camera(q, e);
        bst_scene_source star = scene_star(&camera, x, y, 1.0);
        render(&camera, &(scene_motion){.duration_s = 1.0, .samples = 2}, &star, image);
        for (int j = 0; j < H; j++) {
            for (int i = 0; i < W; i++) {
                double want = airy_pixel(q, e, i - x, j - y);
                worst = fmax(worst, fabs(image[j * W + i] - want));
                peak = fmax(peak, want);
            }
        }
        /* the pixel's quadrature is good to 4e-8 at Q = 0.6, the image to 2e-9 at the others */
        assert_true(worst < (q < 1.0 ? 8e-8 : 4e-9) * peak);
    }
}

/* Trails of Airy's pattern, integrated in time point by point, at some of the pixels. */
static void trails_are_sums_of_airys_patterns(void **state) {
    (void)state;
    static double image[W * H];
    static const double place[3] = {-0.7745966692414834, 0.0, 0.7745966692414834};
    static const double weight[3] = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};
    enum { PARTS = 60 };
    const scene_motion motions[] = {{.x_px = 11.0, .y_px = 6.0, .duration_s = 1.0, .samples = 2},
                                    {.roll_rad = 0.8, .duration_s = 1.0, .samples = 2}};
    for (int n = 0; n < 2; n++) {
        bst_camera camera = diffraction_camera(1.5, 0.3);
        bst_scene_source star = scene_star(&camera, 43.2, 17.9, 1.0);
        render(&camera, &motions[n], &star, image);
        scene_track track = scene_track_make(&camera, &motions[n]);
        double peak = 0.0;
        for (int p = 0; p < W * H; p++) {
            peak = fmax(peak, image[p]);
        }
        for (int p = 7; p < W * H; p += 73) {
            double want = 0.0;
            for (int k = 0; k < 3 * PARTS; k++) {
                double u = (k / 3 + 0.5 + 0.5 * place[k % 3]) / PARTS, x, y;
                bst_quat q = bst_quat_slerp(track.track.q_cam_from_gcrf[0],
                                            track.track.q_cam_from_gcrf[track.track.count - 1], u);
                assert_true(
                    bst_camera_project(&camera, bst_quat_rotate(q, star.apparent_mid), &x, &y));
                want += weight[k % 3] / PARTS * airy_pixel(1.5, 0.3, p % W - x, p / W - y);
            }
            /* the pixels by quadrature, the OTF by its table: 8e-9 */
            bst_assert_close(image[p], want, 2e-8 * peak);
        }
        scene_track_free(&track);
    }
}

/* Between field nodes the PSF is their mixture; at a node its own. */
static void a_field_of_two_widths_mixes(void **state) {
    (void)state;
    static double image[W * H], left[W * H], right[W * H];
    bst_camera camera = scene_camera(W, H);
    const scene_motion still = {.duration_s = 1.0, .samples = 2};
    double x = 0.25 * (W - 1);
    bst_scene_source star = scene_star(&camera, x, 20.0, 1000.0);
    bst_psf_field_node nodes[2] = {{.psf_fwhm_px = 1.5}, {.psf_fwhm_px = 4.0}};
    camera.psf_fwhm_px = 1.5;
    render(&camera, &still, &star, left);
    camera.psf_fwhm_px = 4.0;
    render(&camera, &still, &star, right);
    camera.optics.field_columns = 2;
    camera.optics.field = (bst_config_list){nodes, 2};
    render(&camera, &still, &star, image);
    for (int p = 0; p < W * H; p++) {
        bst_assert_close(image[p], 0.75 * left[p] + 0.25 * right[p], 1e-6); /* of a peak of 300 */
    }
}

static void vignetting_takes_its_share_of_each_pixel(void **state) {
    (void)state;
    static double image[W * H], plain[W * H];
    bst_camera camera = scene_camera(W, H);
    const scene_motion still = {.duration_s = 1.0, .samples = 2};
    for (int n = 0; n < 2; n++) {
        camera.optics.psf = n ? BST_PSF_MOFFAT : BST_PSF_GAUSSIAN;
        camera.optics.vignetting = (bst_optics_vignetting){0};
        bst_scene_source star = scene_star(&camera, 10.0, 30.0, 1000.0);
        render(&camera, &still, &star, plain);
        camera.optics.vignetting = (bst_optics_vignetting){.model = BST_VIGNETTING_POLYNOMIAL,
                                                           .coefficients = {-0.3, 0.05, 0.0}};
        render(&camera, &still, &star, image);
        for (int p = 0; p < W * H; p++) {
            double dx = p % W - 31.5, dy = p / W - 23.5, r2 = (dx * dx + dy * dy) / 1600.0;
            double share = 1.0 - 0.3 * r2 + 0.05 * r2 * r2;
            bst_assert_close(image[p], share * plain[p], 1e-12); /* rounding of a peak of 300 */
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_static_star_is_a_product_of_erf_differences),
        cmocka_unit_test(a_uniform_streak_has_a_closed_form),
        cmocka_unit_test(own_motion_and_camera_motion_cancel),
        cmocka_unit_test(occulted_and_dark_sources_give_nothing),
        cmocka_unit_test(both_methods_agree_on_gaussians),
        cmocka_unit_test(a_static_star_is_airys_pattern),
        cmocka_unit_test(trails_are_sums_of_airys_patterns),
        cmocka_unit_test(a_field_of_two_widths_mixes),
        cmocka_unit_test(vignetting_takes_its_share_of_each_pixel),
        cmocka_unit_test(wings_keep_relative_precision),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
