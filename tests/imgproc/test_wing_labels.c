/* Which stars are given to the model of PSF wings, with how much light: those of the catalogue by
 * the exposure, and saturated detections that are none of them. */
#include "boresight/vec.h"
#include "imgproc/wing_labels.h"
#include "tests/test_support.h"

enum { STARS = 3, MOST = 8 };

static bst_imgproc_expected_star stars[STARS] = {
    {100.0, 200.0, 4.0, 11}, {-150.0, 300.0, 5.5, 12}, {700.0, 20.0, 6.0, 13}};

static struct {
    double noise_e, threshold_snr, streak[2], x[MOST], y[MOST], flux_e[MOST];
    bst_predicted_stars_query query;
    int count, asked, binning;
} seen;

double __wrap_bst_psf_wings_bright_e(const bst_psf_wings *wings, double noise_e,
                                     double threshold_snr);
double __wrap_bst_psf_wings_bright_e(const bst_psf_wings *wings, double noise_e,
                                     double threshold_snr) {
    (void)wings;
    seen.noise_e = noise_e;
    seen.threshold_snr = threshold_snr;
    return 3e6;
}
void __wrap_bst_psf_wings_begin(bst_psf_wings *wings, double dx_px, double dy_px);
void __wrap_bst_psf_wings_begin(bst_psf_wings *wings, double dx_px, double dy_px) {
    (void)wings;
    seen.streak[0] = dx_px;
    seen.streak[1] = dy_px;
}
void __wrap_bst_psf_wings_add(bst_psf_wings *wings, double x_px, double y_px, double flux_e);
void __wrap_bst_psf_wings_add(bst_psf_wings *wings, double x_px, double y_px, double flux_e) {
    (void)wings;
    assert_true(seen.count < MOST);
    seen.x[seen.count] = x_px;
    seen.y[seen.count] = y_px;
    seen.flux_e[seen.count++] = flux_e;
}
bool __wrap_bst_psf_wings_holds(const bst_psf_wings *wings, double x_px, double y_px,
                                double radius_px);
bool __wrap_bst_psf_wings_holds(const bst_psf_wings *wings, double x_px, double y_px,
                                double radius_px) {
    (void)wings;
    bool there = false;
    for (int i = 0; i < seen.count; i++) {
        there = there || hypot(seen.x[i] - x_px, seen.y[i] - y_px) <= radius_px;
    }
    return there;
}
void __wrap_bst_psf_wings_label(const bst_psf_wings *wings, bst_psf_wings_ground_fn ground,
                                const void *user, int binning, bst_detections *detections);
void __wrap_bst_psf_wings_label(const bst_psf_wings *wings, bst_psf_wings_ground_fn ground,
                                const void *user, int binning, bst_detections *detections) {
    (void)wings;
    (void)ground;
    (void)user;
    (void)detections;
    seen.binning = binning;
}
bst_status __wrap_bst_predicted_stars_expect(bst_ctx *ctx, bst_predicted_stars *sky,
                                             const bst_predicted_stars_query *query, int *count);
bst_status __wrap_bst_predicted_stars_expect(bst_ctx *ctx, bst_predicted_stars *sky,
                                             const bst_predicted_stars_query *query, int *count) {
    (void)ctx;
    seen.query = *query;
    seen.asked++;
    sky->expected = stars;
    *count = STARS;
    return BST_OK;
}

static void given_stars(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const double rate_v0 = 0.25 * BST_PI * 0.04 * 0.6 * 0.5 * 2e10; /* 20 cm */
    const bst_camera camera = {.width_px = 600,
                               .height_px = 400,
                               .pixel_scale_arcsec = 5.0,
                               .aperture_m = 0.2,
                               .throughput = 0.6,
                               .quantum_efficiency = 0.5,
                               .photon_flux_v0_per_s_m2 = 2e10};
    bst_frame_knowledge known = {
        .q_cam_from_gcrf = {.w = 0.6, .y = 0.8}, .window = {40, 20, 500, 300}, .oriented = true};
    /* a turn r moves the boresight's direction by r x z: here 6 px to the left, 2.5 px down */
    double px = 5.0 * BST_ARCSEC_RAD;
    const bst_camera_motion motion = {.q_cam_from_gcrf = BST_QUAT_IDENTITY,
                                      .turn_cam_rad = {-2.5 * px, -6.0 * px, 0.0}};
    const bst_wing_labels_input input = {
        .camera = &camera, .known = &known, .motion = &motion, .binning = 2, .exposure_s = 0.4};
    bst_detections *out = calloc(1, sizeof *out + 4 * sizeof out->items[0]);
    assert_non_null(out);
    out->noise_e = 24.0;
    out->threshold_snr = 4.7;
    out->count = 4;
    const bst_detection found[4] = {
        {.x_px = 103, .y_px = 196.1, .flux_e = 9e6, .flags = BST_DETECTION_SATURATED}, /* star 1 */
        {.x_px = 400, .y_px = 150, .flux_e = 5e6, .flags = BST_DETECTION_SATURATED},
        {.x_px = 300, .y_px = 50, .flux_e = 2.9e6, .flags = BST_DETECTION_SATURATED},
        {.x_px = 200, .y_px = 90, .flux_e = 8e6}};
    memcpy(out->items, found, sizeof found);
    bst_predicted_stars sky = {0};
    for (int oriented = 0; oriented < 2; oriented++) {
        memset(&seen, 0, sizeof seen);
        known.oriented = oriented;
        bst_assert_ok(&ctx, bst_wing_labels_make(&ctx, &input, &sky, NULL, out));
        bst_assert_close(seen.noise_e, 12.0, 0.0); /* of a pixel of the sensor */
        bst_assert_close(seen.threshold_snr, 4.7, 0.0);
        bst_assert_close(seen.streak[0], -6.0, 1e-3);
        bst_assert_close(seen.streak[1], 2.5, 1e-3);
        assert_int_equal(seen.binning, 2);
        assert_int_equal(seen.asked, oriented);
        assert_int_equal(seen.count, oriented ? STARS + 1 : 2);
        int last = seen.count - 1;
        bst_assert_close(seen.x[last], 400.0, 0.0);
        bst_assert_close(seen.y[last], 150.0, 0.0);
        bst_assert_close(seen.flux_e[last], 5e6, 0.0);
    }
    for (int i = 0; i < STARS; i++) {
        bst_assert_close(seen.x[i], stars[i].x_px, 0.0);
        bst_assert_close(seen.y[i], stars[i].y_px, 0.0);
        bst_assert_close(seen.flux_e[i] / (0.4 * rate_v0 * pow(10.0, -0.4 * stars[i].v_mag)), 1.0,
                         1e-9);
    }
    /* as faint as has 3e6 electrons in the exposure, and as far beside the window as wings reach */
    bst_assert_close(seen.query.v_limit, -2.5 * log10(3e6 / 0.4 / rate_v0), 1e-9);
    bst_assert_close(seen.query.margin_px, 256.0, 0.0);
    assert_int_equal(seen.query.window.x0, 40);
    assert_int_equal(seen.query.window.height, 300);
    bst_assert_close(seen.query.q_cam_from_gcrf.y, 0.8, 0.0);
    free(out);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(given_stars)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
