/* The module against a real world and the embedded stars, stepped by hand. */
#include "tests/scenegen/module_support.h"

/* the default detector */
static const char sensor_block[] =
    "{\"name\": \"cam\", \"camera\": {\"width_px\": 512, \"height_px\": 512, "
    "\"pixel_scale_arcsec\": 12, \"aperture_m\": 0.15, \"full_well_e\": 1e6}}";

/* Integral of the squared image of a straight streak, see docs/explanation/equations/image.md. */
static double peak_term(double sigma, double length) {
    double a = 0.5 * length / sigma;
    return (erf(a) / length -
            2.0 * sigma * (1.0 - exp(-a * a)) / (sqrt(BST_PI) * length * length)) /
           (2.0 * sqrt(BST_PI) * sigma);
}

/* Centroid of the light about (x, y), background taken off. */
static void centroid(const uint16_t *p, double x, double y, double background, double *cx,
                     double *cy, double *sum) {
    double sx = 0, sy = 0, s = 0;
    for (int j = (int)y - 8; j <= (int)y + 8; j++) {
        for (int i = (int)x - 14; i <= (int)x + 14; i++) {
            double v = p[j * SIDE + i] - background;
            s += v;
            sx += v * i;
            sy += v * j;
        }
    }
    *cx = sx / s;
    *cy = sy / s;
    *sum = s;
}

static void frames_show_what_truth_says(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_device *device;
    bst_assert_ok(&ctx, bst_device_open(&ctx, "", 0, &device));
    bst_world *world = make_world(&ctx, sensor_block);
    struct bst_step step = {.ctx = &ctx, .history = make_history()};
    bst_module_env env = {.ctx = &ctx,
                          .instance = "obs/cam/scenegen",
                          .tick_rate_hz = RATE,
                          .seed = 1,
                          .world = world,
                          .device = device,
                          .engine_private = &step};
    const bst_module_desc *d = &bst_scenegen_module;
    void *config = calloc(1, d->config_bytes), *self;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, d->config, config));
    bst_assert_ok(&ctx, d->create(&env, config, &self));
    assert_int_equal(step.capacity, CAPACITY);
    bst_exposure exposure = {
        .id = 7, .start_tick = 50, .end_tick = 550, .window = {0, 0, SIDE, SIDE}, .binning = 1};
    step.exposure = &exposure;
    bst_assert_ok(&ctx, d->step(self, &step));
    assert_true(step.truth_written && step.frame_written);
    assert_true(step.truth->count > 20); /* V < 9 alone has some thirty in 1.7 degrees there */
    assert_int_equal(step.truth->exposure_id, 7);
    assert_int_equal(step.frame.exposure_id, 7);
    const uint16_t *pixels;
    bst_assert_ok(&ctx, bst_frame_map(step.frame.frame, &ctx, &pixels));
    const bst_camera *camera = bst_world_camera(world, 0, 0);
    double background =
        camera->offset_dn + (step.truth->background_e + step.truth->dark_e) / camera->gain_e_per_dn;
    int checked = 0;
    for (int i = 0; i < step.truth->count; i++) {
        const bst_truth_item *a = &step.truth->items[i];
        bool alone = (a->flags & BST_TRUTH_SATURATED) == 0 && a->snr > 300.0 &&
                     a->x_chief_px > 40 && a->x_chief_px < SIDE - 40 && a->y_chief_px > 40 &&
                     a->y_chief_px < SIDE - 40;
        for (int j = 0; j < step.truth->count && alone; j++) {
            const bst_truth_item *b = &step.truth->items[j];
            alone =
                i == j || hypot(a->x_chief_px - b->x_chief_px, a->y_chief_px - b->y_chief_px) > 35;
        }
        if (!alone) {
            continue;
        }
        double x, y, sum;
        centroid(pixels, a->x_chief_px, a->y_chief_px, background, &x, &y, &sum);
        /* noise of 493 pixels over the flux, times the box's spread of 8 px: < 0.03 at SNR 300 */
        bst_assert_close(x, a->x_chief_px, 0.15);
        bst_assert_close(y, a->y_chief_px, 0.15);
        double noise = sqrt(493.0 * (64.0 + step.truth->background_e) + a->electrons);
        bst_assert_close(sum * camera->gain_e_per_dn, a->electrons, 5.0 * noise); /* 5 sigma */
        bst_assert_close(fabs(a->x_end_px - a->x_start_px), 10.0, 0.1); /* the slew, 1 % of tan */
        checked++;
    }
    assert_true(checked >= 5);
    bst_frame_unmap(step.frame.frame);
    bst_frame_release(step.frame.frame);

    /* a dropped exposure: the same truth, no frame */
    int count = step.truth->count;
    bst_truth_item *items = malloc((size_t)count * sizeof *items);
    memcpy(items, step.truth->items, (size_t)count * sizeof *items);
    step.frame_written = step.truth_written = false;
    exposure.dropped = true;
    step.exposure = &exposure;
    bst_assert_ok(&ctx, d->step(self, &step));
    assert_true(step.truth_written && !step.frame_written && step.truth->dropped);
    assert_int_equal(step.truth->count, count);
    assert_memory_equal(step.truth->items, items, (size_t)count * sizeof *items);

    /* jitter too fast for the samples: the same places and light, less SNR, as of a wider streak */
    step.history->jitter_rad2 = pow(1.5 * 12.0 * BST_ARCSEC_RAD, 2);
    step.exposure = &exposure;
    bst_assert_ok(&ctx, d->step(self, &step));
    assert_int_equal(step.truth->count, count);
    double psf = bst_camera_psf_sigma_px(camera);
    double sharp = peak_term(sqrt(psf * psf + 1.0 / 12.0), 10.0);
    double blurred = peak_term(sqrt(psf * psf + 1.5 * 1.5 + 1.0 / 12.0), 10.0);
    for (int i = 0; i < count; i++) {
        assert_true(step.truth->items[i].electrons == items[i].electrons);
        assert_true(step.truth->items[i].x_chief_px == items[i].x_chief_px);
        if (items[i].snr > 0.0) { /* the streak is 10 px within 1 %, its bend some 1e-3 px */
            bst_assert_close(step.truth->items[i].snr / items[i].snr, sqrt(blurred / sharp), 2e-3);
        }
    }
    step.history->jitter_rad2 = 0.0;

    /* with less room, the brightest are kept, in the same order, and the rest is counted */
    enum { ROOM = 25 };
    assert_true(count > 2 * ROOM);
    step.capacity = ROOM;
    step.overflow = 0;
    step.exposure = &exposure;
    bst_assert_ok(&ctx, d->step(self, &step));
    assert_int_equal(step.truth->count, ROOM);
    assert_int_equal(step.truth->lost, count - ROOM);
    assert_int_equal(step.overflow, 1);
    int kept = 0;
    double faintest_kept = 0.0, brightest_lost = INFINITY;
    for (int i = 0; i < count; i++) {
        if (kept < ROOM && memcmp(&step.truth->items[kept], &items[i], sizeof *items) == 0) {
            faintest_kept = fmax(faintest_kept, items[i].v_mag);
            kept++;
        } else {
            brightest_lost = fmin(brightest_lost, items[i].v_mag);
        }
    }
    assert_int_equal(kept, ROOM);
    assert_true(faintest_kept <= brightest_lost);
    step.capacity = CAPACITY;
    free(items);

    /* binned frames are smaller; an exposure that the ring does not hold is refused */
    exposure.binning = 2;
    exposure.dropped = false;
    step.exposure = &exposure;
    bst_assert_ok(&ctx, d->step(self, &step));
    assert_int_equal(step.frame.binning, 2);
    assert_int_equal(step.frame.frame->width, exposure.window.width / 2);
    assert_int_equal(step.frame.frame->height, exposure.window.height / 2);
    bst_frame_release(step.frame.frame);
    exposure.binning = 1;
    exposure.end_tick = 5000;
    step.exposure = &exposure;
    assert_int_equal(d->step(self, &step), BST_ERR_STATE);
    d->destroy(self);
    bst_world_free(world);
    bst_device_close(device);
    free(config);
    free(step.history);
    free(step.truth);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_show_what_truth_says),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
