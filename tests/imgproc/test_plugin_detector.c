/* What the detector of a plug-in is given, which of its results are refused, and what follows from
 * them, in binned pixels of a window off the corner. */
#include "imgproc/detect/plugin_detector.h"

#include "tests/test_support.h"

enum { CAPACITY = 6 };

static const bst_camera camera = {.width_px = 700,
                                  .height_px = 400,
                                  .pixel_scale_arcsec = 6.0,
                                  .aperture_m = 0.15,
                                  .throughput = 0.7,
                                  .quantum_efficiency = 0.6,
                                  .photon_flux_v0_per_s_m2 = 3.6e10,
                                  .psf_fwhm_px = 2.5,
                                  .full_well_e = 1e5,
                                  .gain_e_per_dn = 1.6,
                                  .bits = 14};
static const float dark[1] = {1.0f}, flat[1] = {2.0f};
static const uint8_t bad[1] = {3};
static const uint16_t pixels[1] = {4};

static bst_detections *answer; /* what the plug-in finds */
static int destroyed, self_of_stage;

static bst_status stage_create(bst_ctx *ctx, const void *config, const bst_detector_env *env,
                               void **self) {
    (void)ctx;
    assert_int_equal(*(const int *)config, 5);
    assert_ptr_equal(env->camera, &camera);
    assert_int_equal(env->capacity, CAPACITY);
    /* aperture times efficiencies times photons */
    bst_assert_close(env->electrons_per_s_v0, 0.25 * BST_PI * 0.15 * 0.15 * 0.7 * 0.6 * 3.6e10,
                     1e-3);
    assert_ptr_equal(env->dark_e_per_s, dark);
    assert_ptr_equal(env->flat, flat);
    assert_ptr_equal(env->bad, bad);
    *self = &self_of_stage;
    return BST_OK;
}

static const bst_imgproc_frame frame = {
    .pixels = pixels, .window = {40, 20, 300, 200}, .binning = 2, .bits = 13, .exposure_s = 0.4};
static const bst_camera_motion motion = {
    .q_cam_from_gcrf = {0, 0, 0, 1},
    /* 8 px of the image along x, 15 px along y */
    .turn_cam_rad = {15.0 * 6.0 * BST_ARCSEC_RAD, 8.0 * 6.0 * BST_ARCSEC_RAD, 0.0}};

static bst_status stage_detect(void *self, bst_ctx *ctx, const bst_detector_frame *given,
                               bst_detections *out) {
    (void)ctx;
    assert_ptr_equal(self, &self_of_stage);
    assert_int_equal(given->exposure_id, 17);
    assert_ptr_equal(given->pixels, pixels);
    assert_memory_equal(&given->window, &frame.window, sizeof frame.window);
    assert_true(given->binning == 2 && given->bits == 13 && given->exposure_s == 0.4);
    assert_true(out->count == 0 && out->lost == 0 && out->background_e == 0.0);
    memcpy(out, answer, sizeof *out + CAPACITY * sizeof *out->items);
    return BST_OK;
}

static void stage_destroy(void *self) {
    (void)self;
    destroyed++;
}

static bst_detection found_at(double x_px, double y_px, double flux_e) {
    return (bst_detection){.x_px = x_px,
                           .y_px = y_px,
                           .cov_xx = 0.04,
                           .cov_xy = 0.01,
                           .cov_yy = 0.02,
                           .flux_e = flux_e,
                           .flux_sigma_e = 0.02 * flux_e,
                           .snr = 50.0,
                           .star_id = 9, /* not the plug-in's to say */
                           .label_probability = 0.5,
                           .rate_x_pxps = 1.0,
                           .rate_y_pxps = 2.0,
                           .rate_sigma_pxps = 3.0};
}

static void good_answer(void) {
    answer->count = 3;
    answer->lost = 2;
    answer->background_e = 70.0;
    answer->noise_e = 11.0;
    answer->threshold_snr = 5.0;
    answer->shared_xx = answer->shared_xy = answer->shared_yy = 4.0; /* not the plug-in's to say */
    answer->stars_identified = 6;
    answer->items[0] = found_at(300.0, 150.0, 1000.0);
    answer->items[1] = found_at(100.0, 150.0, 2000.0);
    answer->items[2] = found_at(339.5, 30.0, 4000.0); /* on the edge of the window */
}

static void detector_of_a_plug_in(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_detector_stage functions = {stage_create, stage_detect, stage_destroy, NULL};
    const bst_stage_desc stage = {
        .abi = BST_STAGE_ABI, .kind = BST_STAGE_DETECTOR, .functions = &functions};
    int config = 5;
    const bst_stage_use use = {.plugin = "/lib/finder.so", .desc = &stage, .config = &config};
    const bst_imgproc_maps maps = {.dark_e_per_s = dark, .flat = flat, .bad = bad};
    const size_t bytes = sizeof *answer + CAPACITY * sizeof *answer->items;
    bst_plugin_detector *p;
    bst_detections *out = calloc(1, bytes);
    answer = calloc(1, bytes);
    assert_true(out && answer);
    bst_assert_ok(&ctx, bst_plugin_detector_create(&ctx, &use, &camera, &maps, CAPACITY, &p));
    good_answer();
    bst_assert_ok(&ctx, bst_plugin_detector_detect(&ctx, p, &frame, 17, &motion, out, CAPACITY));
    static const double order[3][3] = {
        {339.5, 30.0, 4000.0}, {100.0, 150.0, 2000.0}, {300.0, 150.0, 1000.0}};
    const double v0 = 0.25 * BST_PI * 0.15 * 0.15 * 0.7 * 0.6 * 3.6e10;
    assert_int_equal(out->count, 3);
    assert_int_equal(out->lost, 2);
    assert_true(out->shared_xx == 0.0 && out->shared_xy == 0.0 && out->shared_yy == 0.0);
    assert_int_equal(out->stars_identified, 0);
    for (int i = 0; i < 3; i++) {
        const bst_detection *d = &out->items[i];
        assert_true(d->x_px == order[i][0] && d->y_px == order[i][1]);
        bst_assert_close(d->v_mag, -2.5 * log10(order[i][2] / 0.4 / v0), 1e-9);
        bst_assert_close(d->v_mag_sigma, 2.5 / log(10.0) * 0.02, 1e-9);
        assert_true(d->cov_xx == 0.04 && d->cov_xy == 0.01 && d->cov_yy == 0.02);
        assert_true(d->star_id == 0 && d->label_probability == 0.0 && d->rate_x_pxps == 0.0 &&
                    d->rate_y_pxps == 0.0 && d->rate_sigma_pxps == 0.0);
    }

    /* a source of SNR s has s times the noise of its pixels, 4 pi sigma^2 of the sensor's where it
     * is a point, and a rectangle of the streak's length where it is drawn out; four of them are
     * one pixel that is read */
    bst_psf_wings_ground ground = {0};
    bst_plugin_detector_ground(p, 100.0, 50.0, &ground);
    assert_true(ground.level_e == 70.0 && ground.noise_e == 11.0);
    bst_assert_close(bst_plugin_detector_streak_px(p), 17.0, 1e-4); /* 15 and 8; gnomonic */
    const double wide = 2.0 * sqrt(BST_PI) * 2.5 / 2.3548;
    const double read = wide * (wide + 17.0) / 4.0;
    bst_assert_close(bst_plugin_detector_v_limit(p, 6.0),
                     -2.5 * log10(6.0 * 11.0 * sqrt(read) / 0.4 / v0), 1e-5);
    bst_assert_ok(&ctx, bst_plugin_detector_detect(&ctx, p, &frame, 17, NULL, out, CAPACITY));
    assert_true(bst_plugin_detector_streak_px(p) == 0.0); /* nothing of the last frame stays */
    bst_assert_close(bst_plugin_detector_v_limit(p, 6.0),
                     -2.5 * log10(6.0 * 11.0 * sqrt(wide * wide / 4.0) / 0.4 / v0), 1e-9);

    /* one step beyond each limit */
    for (int k = 0; k < 15; k++) {
        good_answer();
        bst_detection *d = &answer->items[1];
        switch (k) {
            case 0:
                d->x_px = 39.49;
                break;
            case 1:
                d->x_px = 339.51;
                break;
            case 2:
                d->y_px = 19.49;
                break;
            case 3:
                d->y_px = 219.51;
                break;
            case 4:
                d->cov_xx = 0.0;
                break;
            case 5:
                d->cov_yy = 0.0;
                break;
            case 6:
                d->cov_xy = -0.0283;
                break; /* 0.04 * 0.02 = 0.02828^2 */
            case 7:
                d->flux_e = NAN;
                break;
            case 8:
                d->angle_rad = INFINITY;
                break;
            case 9:
                d->label = BST_LABEL_STAR;
                break;
            case 10:
                answer->count = CAPACITY + 1;
                break;
            case 11:
                answer->lost = -1;
                break;
            case 12:
                answer->noise_e = 0.0;
                break;
            case 13:
                answer->background_e = NAN;
                break;
            default:
                answer->threshold_snr = 0.0;
                break;
        }
        assert_int_equal(bst_plugin_detector_detect(&ctx, p, &frame, 17, NULL, out, CAPACITY),
                         BST_ERR_STATE);
        assert_non_null(strstr(ctx.message, "/lib/finder.so"));
    }
    /* and just within them */
    good_answer();
    answer->items[0] = found_at(39.5, 19.5, 10.0);
    answer->items[1].y_px = 219.5;
    answer->items[1].cov_xy = -0.0282;
    answer->items[1].label = BST_LABEL_ARTEFACT;
    bst_assert_ok(&ctx, bst_plugin_detector_detect(&ctx, p, &frame, 17, NULL, out, CAPACITY));
    bst_plugin_detector_free(p);
    assert_int_equal(destroyed, 1);
    free(out);
    free(answer);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(detector_of_a_plug_in)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
