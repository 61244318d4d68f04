/* What detection gives to its parts: variances, digital levels, widths, streaks and areas in the
 * pixels of the frame that was read. */
#include "boresight/vec.h"
#include "imgproc/detect/background.h"
#include "imgproc/detect/filter.h"
#include "imgproc/extended/silhouette.h"
#include "imgproc/measure/source_profile.h"
#include "sim/core/threshold_statistics.h"
#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

enum { WIDE = 240, HIGH = 180, MOST = 256 };

static bst_background_input ground;
static double sigma_px, streak_px[2], pixels, alarms;
static int filter_binning, quantiles;
static bool in_coarse_steps;
static bst_camera camera;

void __real_bst_background_read(bst_background *b, bst_parallel *pool,
                                const bst_background_input *input, int width, int height);
void __wrap_bst_background_read(bst_background *b, bst_parallel *pool,
                                const bst_background_input *input, int width, int height);
void __wrap_bst_background_read(bst_background *b, bst_parallel *pool,
                                const bst_background_input *input, int width, int height) {
    ground = *input;
    __real_bst_background_read(b, pool, input, width, height);
}

void __real_bst_filter_set(bst_filter *filter, double sigma, int binning, double dx, double dy);
void __wrap_bst_filter_set(bst_filter *filter, double sigma, int binning, double dx, double dy);
void __wrap_bst_filter_set(bst_filter *filter, double sigma, int binning, double dx, double dy) {
    sigma_px = sigma;
    filter_binning = binning;
    streak_px[0] = dx;
    streak_px[1] = dy;
    __real_bst_filter_set(filter, sigma, binning, dx, dy);
}

double __real_bst_filter_threshold(bst_filter *filter, double false_alarms, double area);
double __wrap_bst_filter_threshold(bst_filter *filter, double false_alarms, double area);
double __wrap_bst_filter_threshold(bst_filter *filter, double false_alarms, double area) {
    if (pixels == 0.0) { /* of the whole frame; in a crowded one, the open sky follows */
        alarms = false_alarms;
        pixels = area;
    }
    return __real_bst_filter_threshold(filter, false_alarms, area);
}

static bst_silhouette_frame outlines; /* what the search for silhouettes was given */

void __real_bst_silhouettes_find(bst_silhouette_finder *finder, const bst_extended_config *config,
                                 const bst_silhouette_frame *frame, uint8_t *mask,
                                 bst_silhouettes *out);
void __wrap_bst_silhouettes_find(bst_silhouette_finder *finder, const bst_extended_config *config,
                                 const bst_silhouette_frame *frame, uint8_t *mask,
                                 bst_silhouettes *out);
void __wrap_bst_silhouettes_find(bst_silhouette_finder *finder, const bst_extended_config *config,
                                 const bst_silhouette_frame *frame, uint8_t *mask,
                                 bst_silhouettes *out) {
    outlines = *frame;
    __real_bst_silhouettes_find(finder, config, frame, mask, out);
}

static bst_imgproc_shape first_path; /* with which the fit of the motion begins */
static int paths;

void __real_bst_source_profile_render_motion(const bst_source_profiles *profiles,
                                             const bst_imgproc_gauss *psf,
                                             const bst_imgproc_shape *shape,
                                             const bst_imgproc_stamp *stamp, const double along[2],
                                             float *scratch, float *planes);
void __wrap_bst_source_profile_render_motion(const bst_source_profiles *profiles,
                                             const bst_imgproc_gauss *psf,
                                             const bst_imgproc_shape *shape,
                                             const bst_imgproc_stamp *stamp, const double along[2],
                                             float *scratch, float *planes);
void __wrap_bst_source_profile_render_motion(const bst_source_profiles *profiles,
                                             const bst_imgproc_gauss *psf,
                                             const bst_imgproc_shape *shape,
                                             const bst_imgproc_stamp *stamp, const double along[2],
                                             float *scratch, float *planes) {
    if (paths++ == 0) {
        first_path = *shape;
    }
    __real_bst_source_profile_render_motion(profiles, psf, shape, stamp, along, scratch, planes);
}

/* Of the noise of a pixel, read noise and the quantisation are no counted electrons. */
double __real_bst_threshold_quantile(double u, const bst_threshold_weights *weights,
                                     const bst_threshold_noise *noise);
double __wrap_bst_threshold_quantile(double u, const bst_threshold_weights *weights,
                                     const bst_threshold_noise *noise);
double __wrap_bst_threshold_quantile(double u, const bst_threshold_weights *weights,
                                     const bst_threshold_noise *noise) {
    double steps2 = camera.gain_e_per_dn * camera.gain_e_per_dn / 12.0;
    double other2 = camera.read_noise_e * camera.read_noise_e + steps2;
    double left2 = fmax(noise->noise_e * noise->noise_e - other2, 0.0);
    if (in_coarse_steps) { /* those of the level, if more */
        assert_true(other2 < 1.0 && noise->counted_e2 >= left2);
        assert_true(noise->counted_e2 <= noise->noise_e * noise->noise_e);
    } else {
        bst_assert_close(noise->counted_e2, left2, 1e-9 * noise->noise_e * noise->noise_e);
    }
    bst_assert_close(noise->step_e, camera.gain_e_per_dn, 0.0);
    quantiles++;
    return __real_bst_threshold_quantile(u, weights, noise);
}

static bool streaks; /* the sources are streaks along the motion */
static double bend_px[2];

/* A frame of the sensor's middle, binned by two, under a motion; its sources are points. */
static void detect(synthetic *s, double gain_e, double read_e, double dx, double dy) {
    bst_ctx ctx = {0};
    s->camera.width_px = 700;
    s->camera.height_px = 600;
    s->camera.gain_e_per_dn = gain_e;
    s->camera.read_noise_e = s->read_e = read_e;
    s->config.false_alarms_per_frame = 0.7;
    synthetic_clear(s);
    bst_rng_key key = bst_rng_make_key(5, 0, "test", "parts");
    for (int i = 0; i < 12; i++) {
        double unit = synthetic_noise(s) / synthetic_norm(s, 30, 30, 0, 0);
        synthetic_add(s, 15.0 + 19.0 * i, 12.0 + 13.5 * i, (streaks ? 60.0 : 6.0 + 0.3 * i) * unit,
                      streaks ? 0.5 * dx : 0.0, streaks ? 0.5 * dy : 0.0);
    }
    synthetic_expose(s, key, 1);
    camera = s->camera;
    bst_camera_motion moving = synthetic_motion(s, dx, dy);
    double scale = bst_camera_scale_rad(&camera);
    moving.bend_cam_rad = (bst_vec3){-bend_px[1] * scale, bend_px[0] * scale, 0.0};
    bst_imgproc_frame frame = synthetic_frame(s);
    frame.window = (bst_window){120, 50, 2 * WIDE, 2 * HIGH};
    frame.binning = 2;
    bst_imgproc *ip = synthetic_processor(&ctx, s);
    bst_detections *found = synthetic_detections(MOST);
    quantiles = 0;
    pixels = 0.0;
    bst_assert_ok(&ctx,
                  bst_imgproc_detect(&ctx, ip, &frame, dx != 0.0 ? &moving : NULL, found, MOST));
    assert_true(found->count >= 3 && quantiles >= 3);
    bst_assert_close(ground.step_e, gain_e, 0.0);
    bst_assert_close(ground.origin_e, -100.0 * gain_e, 1e-12);
    bst_assert_close(ground.read_variance_e2, read_e * read_e, 1e-12);
    /* 2 px FWHM are 2 / sqrt(8 ln 2) px of the sensor, half of it read out */
    bst_assert_close(sigma_px, 1.0 / sqrt(8.0 * log(2.0)), 1e-9);
    assert_int_equal(filter_binning, 2);
    bst_assert_close(pixels, WIDE * HIGH, 0.0);
    bst_assert_close(alarms, 0.7, 0.0);
    free(found);
    bst_imgproc_free(ip);
}

static void at_rest_and_in_motion(void **state) {
    (void)state;
    synthetic s;
    synthetic_init(&s, WIDE, HIGH);
    detect(&s, 5.0, 3.0, 0, 0);
    bst_assert_close(fabs(streak_px[0]) + fabs(streak_px[1]), 0.0, 0.0);
    detect(&s, 2.0, 9.0, 0, 0);
    /* halves of a read pixel: (-9.7, 6.6) / 2 */
    s.sky_e = 30.0;
    detect(&s, 1.0, 2.0, -9.7, 6.6);
    bst_assert_close(streak_px[0], -5.0, 0.0);
    bst_assert_close(streak_px[1], 3.5, 0.0);
    in_coarse_steps = true;
    detect(&s, 3.0, 0.4, 0, 0);
    synthetic_free(&s);
}

/* Paths, their bends and what is taken for outlines, in pixels of the frame that was read. */
static void paths_and_outlines(void **state) {
    (void)state;
    synthetic s;
    synthetic_init(&s, WIDE, HIGH);
    s.config.extended.enabled = true;
    s.sky_e = 30.0;
    streaks = true;
    in_coarse_steps = false;
    bend_px[0] = 0.3;
    bend_px[1] = -0.5;
    paths = 0;
    detect(&s, 1.5, 2.0, -9.7, 6.6);
    assert_true(paths > 0);
    /* the camera's plane across half a frame of 700 px of 4 arcsec: 1e-4 */
    bst_assert_close(first_path.dx_px, -4.85, 1e-3);
    bst_assert_close(first_path.dy_px, 3.3, 1e-3);
    bst_assert_close(first_path.bend_x_px, 0.15, 1e-4);
    bst_assert_close(first_path.bend_y_px, -0.25, 1e-4);
    bst_assert_close(outlines.streak_x_px, -4.85, 1e-3);
    bst_assert_close(outlines.streak_y_px, 3.3, 1e-3);
    assert_int_equal(outlines.width, WIDE);
    assert_int_equal(outlines.height, HIGH);
    bst_assert_close(outlines.sigma_px, 1.0 / sqrt(8.0 * log(2.0)), 1e-9);
    bst_assert_close(outlines.read_variance_e2, 2.0 * 2.0 + 1.5 * 1.5 / 12.0, 1e-12);
    bst_assert_close(outlines.full_e, (outlines.saturated_dn - 100.0) * 1.5, 1e-9);
    synthetic_free(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(at_rest_and_in_motion),
                                       cmocka_unit_test(paths_and_outlines)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
