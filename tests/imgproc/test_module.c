/* The adapter between channels and image processing, in the real engine. */
#include "imgproc/calibrate/pixel_learning.h"
#include "sim/onboard/nav_motion.h"
#include "tests/imgproc/module_support.h"

static const double PIXEL_RAD = 12.0 * BST_ARCSEC_RAD; /* of the sensor in onboard.h */

/* An engine with telemetry from the given ticks on, one exposure of the catalogue's stars, frames
 * every `period` ticks. */
static void begin(bench *b, int64_t first_frame, int64_t period, bool predictions,
                  int64_t first_pointing, int64_t first_nav) {
    bench_draw_stars(b);
    synthetic_expose(&b->s, bst_rng_make_key(5, 0, "test", "module"), 1);
    bst_assert_ok(&b->o.ctx, bench_configure(b, "{}"));
    onboard_add_telemetry(&b->o, first_pointing, first_nav);
    bst_assert_ok(&b->o.ctx, bench_load(b, first_frame, period, predictions));
}

static double angle(bst_quat a, bst_quat b) {
    return bst_vec3_norm(bst_quat_to_rotvec(bst_quat_mul(a, bst_quat_conj(b))));
}

/* Every detection that names a star lies where that star was drawn. */
static int stars_right(const bench *b, const bst_detections *d) {
    int named = 0;
    for (int i = 0; i < d->count; i++) {
        for (int k = 0; d->items[i].star_id != 0 && k < b->o.star_count; k++) {
            if (b->o.stars[k].id == d->items[i].star_id) {
                /* the faintest that is found has SNR 5: 1.2 px / 5, four sigma */
                bst_assert_close(d->items[i].x_px, b->o.stars[k].x_px, 1.0);
                bst_assert_close(d->items[i].y_px, b->o.stars[k].y_px, 1.0);
                named++;
            }
        }
    }
    return named;
}

/* What the module hands on about a frame's time and place; the linker puts these in the functions'
 * places. */
static struct {
    int lights, frames, steps, stacked;
    double after_s[BENCH_KEPT], exposure_s[BENCH_KEPT], learned_s[BENCH_KEPT],
        stacked_s[BENCH_KEPT];
    int binning[BENCH_KEPT], labelled;
    bst_frame_knowledge known[BENCH_KEPT];
} handed;
static double streak_px; /* > 0: of all frames, whatever the camera does */

bst_light __real_bst_nav_light_after(const bst_nav_telemetry *nav, double dt_s);
bst_light __wrap_bst_nav_light_after(const bst_nav_telemetry *nav, double dt_s);
bst_light __wrap_bst_nav_light_after(const bst_nav_telemetry *nav, double dt_s) {
    handed.after_s[handed.lights++ % BENCH_KEPT] = (double)nav->tick / ONBOARD_RATE + dt_s;
    return __real_bst_nav_light_after(nav, dt_s);
}

bst_status __real_bst_imgproc_detect(bst_ctx *ctx, bst_imgproc *ip, const bst_imgproc_frame *frame,
                                     const bst_camera_motion *motion, bst_detections *out,
                                     int capacity);
bst_status __wrap_bst_imgproc_detect(bst_ctx *ctx, bst_imgproc *ip, const bst_imgproc_frame *frame,
                                     const bst_camera_motion *motion, bst_detections *out,
                                     int capacity);
bst_status __wrap_bst_imgproc_detect(bst_ctx *ctx, bst_imgproc *ip, const bst_imgproc_frame *frame,
                                     const bst_camera_motion *motion, bst_detections *out,
                                     int capacity) {
    handed.binning[handed.frames % BENCH_KEPT] = frame->binning;
    handed.exposure_s[handed.frames++ % BENCH_KEPT] = frame->exposure_s;
    return __real_bst_imgproc_detect(ctx, ip, frame, motion, out, capacity);
}

void __real_bst_pixel_step(bst_pixel_learner *learner, const bst_camera *camera,
                           const bst_pixel_step_input *input);
void __wrap_bst_pixel_step(bst_pixel_learner *learner, const bst_camera *camera,
                           const bst_pixel_step_input *input);
void __wrap_bst_pixel_step(bst_pixel_learner *learner, const bst_camera *camera,
                           const bst_pixel_step_input *input) {
    handed.learned_s[handed.steps++ % BENCH_KEPT] = input->time_s;
    __real_bst_pixel_step(learner, camera, input);
}

bst_stack_frame __real_bst_imgproc_stack_frame(const bst_imgproc *ip, double time_s,
                                               bst_quat q_cam_from_gcrf);
bst_stack_frame __wrap_bst_imgproc_stack_frame(const bst_imgproc *ip, double time_s,
                                               bst_quat q_cam_from_gcrf);
bst_stack_frame __wrap_bst_imgproc_stack_frame(const bst_imgproc *ip, double time_s,
                                               bst_quat q_cam_from_gcrf) {
    handed.stacked_s[handed.stacked++ % BENCH_KEPT] = time_s;
    return __real_bst_imgproc_stack_frame(ip, time_s, q_cam_from_gcrf);
}

double __real_bst_imgproc_streak_px(const bst_imgproc *ip);
double __wrap_bst_imgproc_streak_px(const bst_imgproc *ip);
double __wrap_bst_imgproc_streak_px(const bst_imgproc *ip) {
    return streak_px > 0.0 ? streak_px : __real_bst_imgproc_streak_px(ip);
}

void __real_bst_discriminator_label(bst_discriminator *d, const bst_frame_knowledge *frame,
                                    bst_detections *out);
void __wrap_bst_discriminator_label(bst_discriminator *d, const bst_frame_knowledge *frame,
                                    bst_detections *out);
void __wrap_bst_discriminator_label(bst_discriminator *d, const bst_frame_knowledge *frame,
                                    bst_detections *out) {
    handed.known[handed.labelled++ % BENCH_KEPT] = *frame;
    __real_bst_discriminator_label(d, frame, out);
}

/* Light, bad pixels and stacks are of the middle of an exposure; thermal signal is of its length.
 */
static void times_of_a_frame(void **state) {
    (void)state;
    bench b;
    bench_init(&b);
    bench_draw_stars(&b);
    synthetic_expose(&b.s, bst_rng_make_key(5, 0, "test", "module"), 1);
    bst_assert_ok(
        &b.o.ctx,
        bench_configure(
            &b, "{\"stack\": {\"frames\": 8}, \"bad_pixel_learning\": {\"capacity\": 100}}"));
    onboard_add_telemetry(&b.o, 0, 0);
    bst_assert_ok(&b.o.ctx, bench_load(&b, 1000, 1000, true)); /* predictions of tick 0 */
    memset(&handed, 0, sizeof handed);
    streak_px = 7.25;
    bst_assert_ok(&b.o.ctx, bst_engine_run(&b.o.ctx, b.o.engine, 4000));
    streak_px = 0.0;
    assert_int_equal(b.count, 3);
    assert_int_equal(handed.labelled, 3);
    assert_int_equal(handed.lights, 3);
    assert_int_equal(handed.frames, 3);
    assert_int_equal(handed.steps, 3);
    assert_int_equal(handed.stacked, 3);
    for (int i = 0; i < 3; i++) {
        double middle_s = (1000 * (i + 1) - 0.5 * BENCH_EXPOSURE) / ONBOARD_RATE;
        bst_assert_close(handed.after_s[i], middle_s, 1e-12);
        bst_assert_close(handed.learned_s[i], middle_s, 1e-12);
        bst_assert_close(handed.stacked_s[i], middle_s, 1e-12);
        bst_assert_close(handed.exposure_s[i], (double)BENCH_EXPOSURE / ONBOARD_RATE, 1e-12);
        assert_int_equal(handed.binning[i], 1);
        const bst_frame_knowledge *k = &handed.known[i];
        assert_true(k->streak_px == 7.25 && k->oriented && k->predictions);
        bst_assert_close(k->predictions_age_s, middle_s, 1e-12);
        /* by the stars: 0.05 px of twenty of them are 0.7e-6 rad, and 7e-5 rad of roll */
        bst_vec3 off =
            bst_quat_to_rotvec(bst_quat_mul(k->q_cam_from_gcrf, bst_quat_conj(b.o.q_true)));
        bst_assert_close(hypot(off.x, off.y), 0.0, 4e-6);
        bst_assert_close(off.z, 0.0, 3e-4);
        assert_true(k->window.width == ONBOARD_SIDE && k->window.height == ONBOARD_SIDE);
    }
    bench_free(&b);
}

static void one_message_per_frame(void **state) {
    (void)state;
    bench b;
    bench_init(&b);
    begin(&b, 1000, 1000, false, 0, 0);
    bst_assert_ok(&b.o.ctx, bst_engine_run(&b.o.ctx, b.o.engine, 4000));
    assert_int_equal(b.count, 3);
    for (int i = 0; i < 3; i++) {
        const bst_detections *d = b.kept[i];
        assert_int_equal(b.kept_at[i], 1000 * (i + 1)); /* the frame's own tick */
        assert_int_equal(d->exposure_id, i);
        assert_int_equal(d->start_tick, 1000 * (i + 1) - BENCH_EXPOSURE);
        assert_int_equal(d->end_tick, 1000 * (i + 1));
        assert_true(d->stars_identified >= 15);
        assert_int_equal(stars_right(&b, d), d->stars_identified);
        /* without a prediction the attitude is telemetry's, which is constant (rounding) */
        assert_true(angle(d->q_cam_from_gcrf, b.o.q_telemetry) < 1e-14);
        assert_true(angle(d->q_telemetry_from_gcrf, b.o.q_telemetry) < 1e-14);
    }
    assert_int_equal(b.recycled, 0); /* the test's own reference */
    assert_int_equal(b.frame.references, 1);
    assert_int_equal(b.frame.maps, 0);
    assert_int_equal(fake_counter(b.o.engine, "frame_without_stars"), 0);
    bench_free(&b);
}

static void all_waiting_frames_are_taken_in_order(void **state) {
    (void)state;
    bench b;
    bench_init(&b);
    b.camera.value = 3;
    begin(&b, 2000, 2000, false, 0, 0);
    bst_assert_ok(&b.o.ctx, bst_engine_run(&b.o.ctx, b.o.engine, 4001));
    assert_int_equal(b.count, 6);
    for (int i = 0; i < 6; i++) {
        assert_int_equal(b.kept_at[i], i < 3 ? 2000 : 4000);
        assert_int_equal(b.kept[i]->exposure_id, i);
        assert_int_equal(b.kept[i]->end_tick, (i < 3 ? 2000 : 4000) - (2 - i % 3) * BENCH_EXPOSURE);
    }
    assert_int_equal(b.frame.references, 1);
    assert_int_equal(fake_counter(b.o.engine, "queue_overflow"), 0);
    bench_free(&b);
}

/* Sources are found and reported, but nothing is identified or called an object. */
static void expect_unidentified(const bst_detections *d) {
    assert_int_equal(d->stars_identified, 0);
    assert_true(d->count >= 15);
    for (int i = 0; i < d->count; i++) {
        assert_int_equal(d->items[i].star_id, 0);
        assert_true(d->items[i].label == BST_LABEL_UNKNOWN ||
                    d->items[i].label == BST_LABEL_ARTEFACT);
    }
}

static void missing_telemetry(void **state) {
    (void)state;
    /* frames at 1, 2 and 3 s; pointing from 1.5 s, navigation from 2.5 s on */
    bench b;
    bench_init(&b);
    begin(&b, 1000, 1000, false, 1500, 2500);
    bst_assert_ok(&b.o.ctx, bst_engine_run(&b.o.ctx, b.o.engine, 3001));
    assert_int_equal(b.count, 3);
    expect_unidentified(b.kept[0]);
    assert_true(angle(b.kept[0]->q_telemetry_from_gcrf, BST_QUAT_IDENTITY) < 1e-14);
    expect_unidentified(b.kept[1]);
    assert_true(angle(b.kept[1]->q_telemetry_from_gcrf, b.o.q_telemetry) < 1e-14);
    assert_true(b.kept[2]->stars_identified >= 15);
    assert_int_equal(fake_counter(b.o.engine, "frame_without_stars"), 2);
    bench_free(&b);
}

/* Telemetry that ended is used up to its greatest age: 10 s of pointing, 60 s of navigation. */
static void stale_telemetry(void **state) {
    (void)state;
    for (int which = 0; which < 2; which++) {
        bench b;
        bench_init(&b);
        int64_t limit = which == 0 ? 10000 : 60000, last = 1000;
        (which == 0 ? &b.o.pointing : &b.o.navigation)->value = last;
        begin(&b, last + limit, 1, false, 0, 0);
        bst_assert_ok(&b.o.ctx, bst_engine_run(&b.o.ctx, b.o.engine, last + limit + 2));
        assert_int_equal(b.count, 2);
        assert_true(b.kept[0]->stars_identified >= 15);
        expect_unidentified(b.kept[1]);
        assert_int_equal(fake_counter(b.o.engine, "stale_input"), 1);
        bench_free(&b);
    }
}

/* Telemetry that is wrong by 100 px, beyond the search radius: no star is found without the
 * tracker's estimate of the error, all with it, and the attitude is telemetry's turned by it,
 * carried to mid-exposure by its rate. */
static void predicted_error_is_applied(void **state) {
    (void)state;
    const bst_vec3 error = {-60.0 * PIXEL_RAD, 80.0 * PIXEL_RAD, 1e-4};
    const bst_vec3 rate = {3.0 * PIXEL_RAD, -2.0 * PIXEL_RAD, 1e-5};
    enum { WITHOUT, VALID, INVALID, CASES };
    for (int which = 0; which < CASES; which++) {
        bench b;
        bench_init(&b);
        onboard_set_error(&b.o, error);
        /* predicted for tick 0: at mid-exposure, 1.75 s, it is the error */
        b.predictions.attitude_valid = which == VALID;
        b.predictions.attitude_error_cam_rad = bst_vec3_axpy(error, -1.75, rate);
        b.predictions.attitude_error_rate_cam_radps = rate;
        begin(&b, 2000, 29000, which != WITHOUT, 0, 0);
        bst_assert_ok(&b.o.ctx, bst_engine_run(&b.o.ctx, b.o.engine, 31001));
        assert_int_equal(b.count, 2);
        assert_true(angle(b.kept[0]->q_telemetry_from_gcrf, b.o.q_telemetry) < 1e-14);
        if (which == VALID) {
            /* rounding; the error is 6e-3 rad */
            assert_true(angle(b.kept[0]->q_cam_from_gcrf, b.o.q_true) < 1e-14);
            assert_true(b.kept[0]->stars_identified >= 15);
            assert_int_equal(stars_right(&b, b.kept[0]), b.kept[0]->stars_identified);
        } else {
            assert_true(angle(b.kept[0]->q_cam_from_gcrf, b.o.q_telemetry) < 1e-14);
            assert_int_equal(b.kept[0]->stars_identified, 0);
        }
        /* predictions of 31 s ago are too old */
        assert_true(angle(b.kept[1]->q_cam_from_gcrf, b.o.q_telemetry) < 1e-14);
        assert_int_equal(b.kept[1]->stars_identified, 0);
        bench_free(&b);
    }
}

/* Telemetry wrong by any angle: nothing is found, unless the attitude is unknown and the stars give
 * it. The second frame uses the first one's error. */
static void an_unknown_attitude_is_found(void **state) {
    (void)state;
    for (int unknown = 0; unknown < 2; unknown++) {
        bench b;
        bench_init(&b);
        b.o.q_telemetry = bst_quat_unit(bst_quat_mul(
            b.o.q_true, bst_quat_from_rotvec((bst_vec3){1.1, -0.4, 2.6}))); /* 163 deg */
        bench_draw_stars(&b);
        synthetic_expose(&b.s, bst_rng_make_key(5, 0, "test", "module"), 1);
        bst_assert_ok(&b.o.ctx,
                      bench_configure(&b, unknown ? "{\"attitude\": \"unknown\"}" : "{}"));
        onboard_add_telemetry(&b.o, 0, 0);
        bst_assert_ok(&b.o.ctx, bench_load(&b, 1000, 1000, false));
        bst_assert_ok(&b.o.ctx, bst_engine_run(&b.o.ctx, b.o.engine, 2001));
        assert_int_equal(b.count, 2);
        for (int i = 0; i < b.count; i++) {
            const bst_detections *d = b.kept[i];
            assert_true(angle(d->q_telemetry_from_gcrf, b.o.q_telemetry) < 1e-14);
            if (!unknown) {
                assert_int_equal(d->stars_identified, 0);
                continue;
            }
            assert_true(d->stars_identified >= 15);
            assert_int_equal(stars_right(&b, d), d->stars_identified);
            /* roll is known to some 0.1 px over 200 px */
            assert_true(angle(d->q_cam_from_gcrf, b.o.q_true) < 2e-3);
        }
        bench_free(&b);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_message_per_frame),
        cmocka_unit_test(times_of_a_frame),
        cmocka_unit_test(all_waiting_frames_are_taken_in_order),
        cmocka_unit_test(missing_telemetry),
        cmocka_unit_test(stale_telemetry),
        cmocka_unit_test(predicted_error_is_applied),
        cmocka_unit_test(an_unknown_attitude_is_found),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
