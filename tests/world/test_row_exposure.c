/* A rolling shutter's times: closed forms, and the truth that follows from them. */
#include "sim/world/scene/row_exposure.h"

#include <stdlib.h>

#include "boresight/rng.h"
#include "sim/world/scene/field.h"
#include "sim/world/scene/los_track.h"
#include "sim/world/world_config.h"
#include "tests/world/world_support.h"

/* A part of a source's time is the same motion and the same light. */
static void parts_are_the_same_polynomials(void **state) {
    (void)state;
    bst_rng_key key = bst_rng_make_key(1, 0, "test", "part");
    bst_scene_source_path path;
    bst_scene_source_rate rate = {.count = 7};
    uint64_t n = 0;
    for (int k = 0; k < BST_PATH_NODES; k++) {
        double along = bst_rng_uniform(key, 0, n++), across = bst_rng_uniform(key, 0, n++);
        path.place[k] = (bst_vec3){4e7 + 1e5 * k + 3e3 * along, 1e6 * across, 2e5 * k * k};
    }
    for (int k = 0; k < 3; k++) {
        path.shift[k] = (bst_vec3){1e-5 * k, 1e-5 * bst_rng_uniform(key, 0, n++), 1e-6 * k * k};
    }
    /* knots with their integral, mean 1 */
    double sum = 0.0;
    for (int k = 0; k < rate.count; k++) {
        rate.u[k] = k == 6 ? 1.0 : (k + 0.4 * (k % 2)) / 6.0;
        rate.rate[k] = bst_rng_uniform(key, 1, (uint64_t)k);
        sum += k > 0 ? 0.5 * (rate.u[k] - rate.u[k - 1]) * (rate.rate[k] + rate.rate[k - 1]) : 0.0;
    }
    for (int k = 0; k < rate.count; k++) {
        rate.rate[k] /= sum;
        rate.light[k] = k > 0 ? rate.light[k - 1] + 0.5 * (rate.u[k] - rate.u[k - 1]) *
                                                        (rate.rate[k] + rate.rate[k - 1])
                              : 0.0;
    }
    bst_scene_source whole = {.path = &path, .rate = &rate, .electrons_per_s = 1000.0};
    whole.apparent_mid = bst_vec3_unit(bst_scene_source_direction(&whole, 0.5));
    static const double spans[][2] = {{0, 1}, {0, 0.3}, {0.21, 0.22}, {0.4, 1}, {0.1, 0.95}};
    for (size_t i = 0; i < sizeof spans / sizeof *spans; i++) {
        bst_scene_source_part part;
        bst_scene_source own;
        double a = spans[i][0], b = spans[i][1];
        bst_scene_source_during(&whole, a, b, &part, &own);
        for (int k = 0; k <= 20; k++) {
            double v = k / 20.0, u = a + (b - a) * v;
            bst_vec3 d = bst_scene_source_direction(&whole, u),
                     e = bst_scene_source_direction(&own, v);
            /* rounding of polynomials of 4e7 m */
            bst_assert_close(test_distance(d, e), 0.0, 1e-6);
            /* the light until then, per second of the whole */
            double light = whole.electrons_per_s *
                           (bst_scene_source_light(&whole, u) - bst_scene_source_light(&whole, a));
            bst_assert_close(own.electrons_per_s * (b - a) * bst_scene_source_light(&own, v), light,
                             1e-9);
            bst_assert_close(own.electrons_per_s * bst_scene_source_rate_at(&own, v),
                             whole.electrons_per_s * bst_scene_source_rate_at(&whole, u), 1e-9);
        }
        assert_true(bst_vec3_angle(own.apparent_mid, bst_scene_source_direction(&own, 0.5)) < 1e-9);
    }
    /* no light in the part: none is left, and nothing divides by it */
    rate = (bst_scene_source_rate){
        .count = 3, .u = {0, 0.5, 1}, .rate = {4, 0, 0}, .light = {0, 1, 1}};
    bst_scene_source_part part;
    bst_scene_source dark;
    bst_scene_source_during(&whole, 0.6, 0.8, &part, &dark);
    assert_true(dark.electrons_per_s == 0.0 && !dark.rate);
}

/* An image that runs down with v px/s under rows that start t seconds apart: its row is exposed for
 * T / (1 - v t), from (y0 - middle) t / (1 - v t) on. */
static void a_running_image_is_exposed_longer(void **state) {
    (void)state;
    bst_camera camera = {.width_px = 400, .height_px = 300, .pixel_scale_arcsec = 3};
    double scale = bst_camera_scale_rad(&camera), duration = 1.2, exposure = 0.2;
    static const double speeds[] = {0, 40, -40, 150}, steps[] = {1e-3, -1e-3, 3e-3};
    for (int i = 0; i < 4; i++) {
        for (int k = 0; k < 3; k++) {
            double v = speeds[i], t = steps[k];
            double time_s[2] = {0, duration};
            /* the star is at y = 149.5 + 20 in the middle of the track */
            bst_quat q[2];
            for (int n = 0; n < 2; n++) {
                double y = v * (time_s[n] - 0.5 * duration);
                q[n] = bst_quat_from_rotvec((bst_vec3){-y * scale, 0, 0});
            }
            bst_los_track track = {2, time_s, q};
            bst_scene_source star = {.apparent_mid = bst_camera_unproject(&camera, 100, 169.5),
                                     .electrons_per_s = 1};
            bst_row_times rows = {t, exposure, {0, 0, 400, 300}};
            double u[2], stretch = 1.0 / (1.0 - v * t);
            bst_row_source_times(&camera, &rows, &track, &star, u);
            /* measured from the middle of the track; its place then is 20 px below the middle row;
             * the row there starts at -exposure / 2 + (20 + v t') t */
            double start = (-0.5 * exposure + 20 * t) * stretch;
            double end = start + exposure * stretch;
            /* tangent plane: 1e-7 of the motion */
            bst_assert_close(u[0] * duration - 0.5 * duration, start, 1e-5);
            bst_assert_close(u[1] * duration - 0.5 * duration, end, 1e-5);
        }
    }
    /* outside of the window its nearest row counts */
    bst_quat still[2] = {{0, 0, 0, 1}, {0, 0, 0, 1}};
    double time_s[2] = {0, duration}, u[2];
    bst_los_track track = {2, time_s, still};
    bst_row_times rows = {1e-3, exposure, {0, 100, 400, 101}};
    bst_scene_source star = {.apparent_mid = bst_camera_unproject(&camera, 100, 20)};
    bst_row_source_times(&camera, &rows, &track, &star, u);
    bst_assert_close(u[0] * duration, 0.5 * (duration - exposure) - 50e-3, 1e-12);
    bst_assert_close((u[1] - u[0]) * duration, exposure, 1e-12);
}

/* Through the field query. */
static void truth_is_that_of_each_row(void **state) {
    (void)state;
    enum { RATE = 6000, SAMPLES = 1001 };
    const double row_s = 5e-5, vx = 30, vy = -60;
    char text[2000];
    snprintf(text, sizeof text,
             "{\"world\": {\"star_catalogue\": \"embedded\", \"faint_stars\": \"statistical\", "
             "\"faint_limit_v_mag\": 13}, \"observers\": [{\"name\": \"a\", " TEST_NEOSSAT
             ", \"sensors\": [{\"cue\": {\"direction_radec_deg\": [266.0, -10.0]}, "
             "\"camera\": {\"pixel_scale_arcsec\": 3, \"aperture_m\": 0.15, \"detector\": "
             "{\"row_time_s\": %g}}}]}]}",
             row_s);
    bst_ctx ctx = {0};
    bst_world *world = test_world(text);
    const bst_camera *camera = bst_world_camera(world, 0, 0);
    bst_field *field;
    bst_assert_ok(&ctx, bst_field_create(&ctx, world, 0, 0, &field));
    bst_los_history *h = calloc(1, sizeof *h + SAMPLES * sizeof *h->items);
    h->capacity = SAMPLES;
    h->written = SAMPLES;
    double scale = bst_camera_scale_rad(camera);
    for (int32_t k = 0; k < SAMPLES; k++) {
        double t = (6.0 * k - 3000) / RATE;
        bst_vec3 turn = {-vy * t * scale, vx * t * scale, 0};
        h->items[k] = (bst_los_sample){
            6 * k, bst_quat_mul(bst_quat_from_rotvec(turn), bst_world_body_attitude(world, 0, 0))};
    }
    const bst_window full = {0, 0, 1024, 1024};
    int64_t start = 2400, end = 3600;
    int64_t lead = bst_detector_lead_ticks(&camera->detector, 1024, RATE);
    assert_int_equal(lead, 154); /* 511.5 rows of 50 us: 153.45 ticks */
    bst_los_track track;
    bst_truth truth = {0};
    const bst_scene_source *sources;
    int count, seen = 0;
    bst_field_options options = {.v_limit = 16, .lead_s = (double)lead / RATE};
    bst_assert_ok(&ctx, bst_field_track(&ctx, field, h, start - lead, end + lead, RATE, &track));
    bst_assert_ok(&ctx, bst_field_query(&ctx, field, &track, start, end, RATE, full, &options,
                                        &truth, &sources, &count));
    /* the header is the middle row's */
    assert_int_equal(truth.start_tick, start);
    bst_quat middle = bst_quat_mul(truth.q_cam_from_gcrf_mid,
                                   bst_quat_conj(bst_world_body_attitude(world, 0, 0)));
    assert_true(bst_vec3_norm(bst_quat_to_rotvec(middle)) < 1e-9);
    double exposure = 0.2, stretch = 1.0 / (1.0 - vy * row_s);
    for (int i = 0; i < count; i++) {
        bst_truth_item item;
        bst_field_truth_item(field, &track, &sources[i], full, 1, &truth, &item);
        if (!(item.flags & BST_TRUTH_IN_FIELD) || fabs(item.y_mid_px - 511.5) > 490 ||
            item.flags & BST_TRUTH_OCCULTED) {
            continue;
        }
        seen++;
        double x, y;
        bst_vec3 v = bst_quat_rotate(truth.q_cam_from_gcrf_mid, sources[i].apparent_mid);
        assert_true(bst_camera_project(camera, v, &x, &y));
        /* the row's own middle, while the image moved on; 1e-4 of the motion off the axis */
        double delay = (y - 511.5) * row_s * stretch;
        bst_assert_close(item.delay_s, delay, 1e-6);
        bst_assert_close(item.x_mid_px, x + vx * delay, 2e-3);
        bst_assert_close(item.y_mid_px, y + vy * delay, 2e-3);
        bst_assert_close(item.x_end_px - item.x_start_px, vx * exposure * stretch, 2e-3);
        bst_assert_close(item.y_end_px - item.y_start_px, vy * exposure * stretch, 2e-3);
        bst_assert_close(item.x_chief_px, item.x_mid_px, 2e-3);
        bst_assert_close(item.y_chief_px, item.y_mid_px, 2e-3);
        double e = sources[i].electrons_per_s * exposure * stretch;
        bst_assert_close(item.electrons, e, 1e-4 * e);
    }
    assert_true(seen > 50);
    /* the history ends before the last row does */
    assert_int_equal(bst_field_track(&ctx, field, h, start - lead, 6000 + lead, RATE, &track),
                     BST_ERR_STATE);
    assert_non_null(strstr(ctx.message, "history_s"));
    free(h);
    bst_field_free(field);
    bst_world_free(world);
}

static void contradictions_are_refused(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_detector_config d = {.row_time_s = 1e-5};
    bst_assert_ok(&ctx, bst_detector_config_check(&ctx, &d));
    d.frame_transfer_s = 1e-3;
    assert_int_equal(bst_detector_config_check(&ctx, &d), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "row_time_s"));
    d.frame_transfer_s = 0;
    d.saturation = BST_WELL_BLOOM;
    assert_int_equal(bst_detector_config_check(&ctx, &d), BST_ERR_CONFIG);
}

/* Attitude of a camera that turns evenly about an axis, at a tick. */
static bst_quat evenly_turned(double tick) {
    bst_vec3 rate = {3e-3, -1e-3, 2e-3};
    return bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(rate, tick)),
                        bst_quat_unit((bst_quat){0.1, 0.7, -0.3, 0.2}));
}

static void expect_track(const bst_los_track *t, double start_tick, double end_tick, int count) {
    assert_int_equal(t->count, count);
    bst_assert_close(t->time_s[0], 0.0, 0.0);
    bst_assert_close(t->time_s[count - 1], (end_tick - start_tick) / 50.0, 1e-12);
    for (int k = 0; k < count; k++) {
        bst_quat q = t->q_cam_from_gcrf[k];
        bst_quat off =
            bst_quat_mul(evenly_turned(start_tick + 50.0 * t->time_s[k]), bst_quat_conj(q));
        bst_assert_close(bst_vec3_norm(bst_quat_to_rotvec(bst_quat_unit(off))), 0.0, 1e-9);
        if (k > 0) {
            bst_quat p = t->q_cam_from_gcrf[k - 1];
            assert_true(t->time_s[k] > t->time_s[k - 1]);
            assert_true(q.x * p.x + q.y * p.y + q.z * p.z + q.w * p.w > 0.0);
        }
    }
}

/* An exposure between the samples of a ring that has gone round, of either sign: begin and end by
 * interpolation, and all samples between them; and a part of it. */
static void a_track_is_cut_out_of_the_history(void **state) {
    (void)state;
    enum { ROOM = 16, WRITTEN = 21, STEP = 7 };
    bst_ctx ctx = {0};
    bst_los_history *h = calloc(1, sizeof *h + ROOM * sizeof h->items[0]);
    assert_non_null(h);
    h->capacity = ROOM;
    h->written = WRITTEN;
    for (int n = 0; n < WRITTEN; n++) {
        bst_quat q = evenly_turned(STEP * n);
        double sign = n % 3 ? 1.0 : -1.0;
        h->items[n % ROOM] = (bst_los_sample){
            .tick = STEP * n, .q_cam_from_gcrf = {sign * q.x, sign * q.y, sign * q.z, sign * q.w}};
    }
    /* ticks 35 to 140 are there: start, end, and samples */
    const int spans[][3] = {{37, 96, 10}, {35, 140, 16}, {42, 63, 4},  {43, 47, 2},
                            {50, 50, 2},  {48, 50, 3},   {139, 140, 2}};
    bst_los_track_store store = {.capacity = 0}, part_store = {.capacity = 0};
    for (size_t i = 0; i < sizeof spans / sizeof *spans; i++) {
        bst_los_track track;
        int from = spans[i][0], to = spans[i][1];
        bst_assert_ok(&ctx, bst_los_track_cut(&ctx, &store, h, from, to, 50, &track));
        if (from < to) {
            expect_track(&track, from, to, spans[i][2]);
        }
        if (i == 0) {
            bst_los_track part;
            bst_assert_ok(&ctx, bst_los_track_part(&ctx, &part_store, &track, 0.2, 0.7, &part));
            expect_track(&part, 47.0, 72.0, 6); /* samples at 49, 56, 63, 70; ends at 47, 72 */
        }
    }
    const int outside[][2] = {{34, 50}, {100, 141}, {0, 200}};
    for (int i = 0; i < 3; i++) {
        bst_los_track track;
        assert_int_equal(
            bst_los_track_cut(&ctx, &store, h, outside[i][0], outside[i][1], 50, &track),
            BST_ERR_STATE);
        assert_non_null(strstr(ctx.message, "ticks 35 to 140"));
    }
    bst_los_track_store_free(&store);
    bst_los_track_store_free(&part_store);
    free(h);
}

/* The largest way of an image point, against points of the whole frame: never less, and not a
 * tenth more for turns about the image's axes and the boresight. */
static void the_largest_way_of_an_image_point(void **state) {
    (void)state;
    const bst_camera c = {.width_px = 1200, .height_px = 400, .pixel_scale_arcsec = 60.0};
    const bst_vec3 turns[] = {{2e-3, 0, 0}, {0, -2e-3, 0}, {0, 0, 3e-3}, {1.2e-3, 1.6e-3, 0}};
    for (int n = 0; n < 4; n++) {
        bst_quat q = bst_quat_from_rotvec(turns[n]);
        double most = 0.0;
        for (int i = 0; i <= 24 * 8; i++) {
            double x = 50.0 * (i % 25), y = 50.0 * (double)(i / 25), u, v;
            assert_true(
                bst_camera_project(&c, bst_quat_rotate(q, bst_camera_unproject(&c, x, y)), &u, &v));
            most = fmax(most, hypot(u - x, v - y));
        }
        double most_px =
            bst_los_track_moved_px(&c, evenly_turned(5.0), bst_quat_mul(q, evenly_turned(5.0)));
        assert_true(most_px > 0.999 * most && most_px < 1.1 * most);
    }
}

/* Windows up to the sensor's edges, of at least a binned pixel. */
static void windows_of_the_sensor(void **state) {
    (void)state;
    static const struct {
        double window[4];
        bool fits;
    } cases[] = {
        {{600, 400, 40, 80}, true}, {{601, 400, 40, 80}, false}, {{600, 401, 40, 80}, false},
        {{0, 0, 640, 480}, true},   {{0, 0, 480, 640}, false},   {{20, 30, 3, 3}, true},
        {{20, 30, 2, 9}, false},    {{20, 30, 9, 2}, false},     {{20, 30.5, 9, 9}, false},
        {{20, 30, 9, 9.5}, false},  {{20, 30, 9, 0}, false}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        bst_ctx ctx = {0};
        bst_exposure_config c = {.binning = 3};
        memcpy(c.window_px, cases[k].window, sizeof c.window_px);
        bst_window w;
        bst_status status = bst_exposure_window(&ctx, &c, 640, 480, &w);
        assert_int_equal(status, cases[k].fits ? BST_OK : BST_ERR_CONFIG);
        if (cases[k].fits) {
            const double got[4] = {w.x0, w.y0, w.width, w.height};
            assert_memory_equal(got, cases[k].window, sizeof got);
        } else {
            assert_non_null(strstr(ctx.message, "640 x 480 pixels, at least the binning of 3"));
        }
    }
    bst_ctx ctx = {0};
    const bst_exposure_config whole = {.binning = 1};
    bst_window w;
    bst_assert_ok(&ctx, bst_exposure_window(&ctx, &whole, 640, 480, &w));
    assert_true(w.x0 == 0 && w.y0 == 0 && w.width == 640 && w.height == 480);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(parts_are_the_same_polynomials),
        cmocka_unit_test(a_running_image_is_exposed_longer),
        cmocka_unit_test(truth_is_that_of_each_row),
        cmocka_unit_test(contradictions_are_refused),
        cmocka_unit_test(a_track_is_cut_out_of_the_history),
        cmocka_unit_test(the_largest_way_of_an_image_point),
        cmocka_unit_test(windows_of_the_sensor),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
