/* Rolling shutter against the reference, row by row at that row's own time. */
#include "scenegen/reference.h"
#include "scenegen/renderer.h"
#include "sim/world/scene/skylight.h"
#include "tests/scenegen/device_fixture.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

enum { W = 96, H = 80, STARS = 7, TARGETS = 2, SOURCES = STARS + TARGETS };

/* A scene whose track spans the exposure of all rows. */
typedef struct scene {
    bst_camera camera;
    scene_track track;
    bst_scene_source sources[SOURCES];
    bst_scene_source_path paths[TARGETS];
    bst_vec3 ends[TARGETS][3]; /* start, middle and end of the targets' way */
    double row_time_s, exposure_s;
} scene;

static bst_quat attitude(const bst_los_track *t, double time_s) {
    int k = 0;
    while (k + 2 < t->count && t->time_s[k + 1] < time_s) {
        k++;
    }
    return bst_quat_slerp(t->q_cam_from_gcrf[k], t->q_cam_from_gcrf[k + 1],
                          (time_s - t->time_s[k]) / (t->time_s[k + 1] - t->time_s[k]));
}

/* x, y, bend, roll, jitter: of the whole track. */
static scene make_scene(double row_time_s, double exposure_s, const scene_motion *motion,
                        double brightest) {
    scene s = {.camera = scene_camera(W, H), .row_time_s = row_time_s, .exposure_s = exposure_s};
    s.camera.detector.row_time_s = row_time_s;
    scene_motion m = *motion;
    m.duration_s = exposure_s + fabs(row_time_s) * (H - 1) + 1e-4;
    s.track = scene_track_make(&s.camera, &m);
    static const double place[STARS][2] = {{20, 8},  {48, 40},     {70, 66.3}, {33.4, 79},
                                           {80, 20}, {12.5, 55.5}, {60, -3}};
    for (int i = 0; i < STARS; i++) {
        double e_per_s = brightest * pow(10.0, -0.6 * i) / exposure_s;
        s.sources[i] = scene_star(&s.camera, place[i][0], place[i][1], e_per_s);
    }
    for (int i = 0; i < TARGETS; i++) { /* along the rows, and down across them */
        double x = i ? 25 : 10, y = i ? 10 : 60, dx = i ? 10 : 50, dy = i ? 50 : -6;
        for (int k = 0; k < 3; k++) {
            s.ends[i][k] = bst_camera_unproject(&s.camera, x + 0.5 * k * dx, y + 0.5 * k * dy);
        }
        s.sources[STARS + i] = (bst_scene_source){.kind = BST_SOURCE_OBJECT,
                                                  .apparent_mid = s.ends[i][1],
                                                  .electrons_per_s = 0.2 * brightest / exposure_s};
    }
    return s;
}

/* After it lies where it stays. */
static void link_paths(scene *s) {
    for (int i = 0; i < TARGETS; i++) {
        s->paths[i] = bst_scene_source_path_through(s->ends[i][0], s->ends[i][1], s->ends[i][2]);
        s->sources[STARS + i].path = &s->paths[i];
    }
}

/* Row by row: the track cut here, and the targets' quadratics through three of their own places. */
static void reference(bst_ctx *ctx, const scene *s, bst_window w, double *image) {
    const bst_los_track *track = &s->track.track;
    double total = track->time_s[track->count - 1];
    double *time_s = malloc(((size_t)track->count + 2) * sizeof *time_s);
    bst_quat *q = malloc(((size_t)track->count + 2) * sizeof *q);
    for (int y = 0; y < w.height; y++) {
        double from = 0.5 * (total - s->exposure_s) + (y - 0.5 * (w.height - 1)) * s->row_time_s;
        double to = from + s->exposure_s;
        int n = 0;
        time_s[n] = 0.0;
        q[n++] = attitude(track, from);
        for (int k = 0; k < track->count; k++) {
            if (track->time_s[k] > from && track->time_s[k] < to) {
                time_s[n] = track->time_s[k] - from;
                q[n++] = track->q_cam_from_gcrf[k];
            }
        }
        time_s[n] = s->exposure_s;
        q[n++] = attitude(track, to);
        bst_los_track own = {n, time_s, q};
        bst_scene_source sources[SOURCES];
        bst_scene_source_path paths[TARGETS];
        for (int i = 0; i < SOURCES; i++) {
            sources[i] = s->sources[i];
            if (i >= STARS) {
                bst_vec3 d[3];
                for (int k = 0; k < 3; k++) {
                    d[k] = bst_scene_source_direction(&s->sources[i],
                                                      (from + 0.5 * k * s->exposure_s) / total);
                }
                paths[i - STARS] = bst_scene_source_path_through(d[0], d[1], d[2]);
                sources[i].path = &paths[i - STARS];
                sources[i].apparent_mid = bst_vec3_unit(d[1]);
            }
        }
        bst_window row = {w.x0, w.y0 + y, w.width, 1};
        bst_assert_ok(ctx, bst_reference_render(ctx, &s->camera, row, &own, sources, SOURCES, 1e-9,
                                                image + (size_t)y * (size_t)w.width));
    }
    free(time_s);
    free(q);
}

static bst_render_request request_of(const scene *s, bst_window w) {
    return (bst_render_request){.window = w,
                                .track = &s->track.track,
                                .row_time_s = s->row_time_s,
                                .exposure_s = s->exposure_s,
                                .sources = s->sources,
                                .count = SOURCES,
                                .background_e = 30.0,
                                .key = {{17, 23}},
                                .exposure_id = 5};
}

/* Largest error in sigma; *predicted, *still: the error of an image with all rows at once. */
static double worst_error(fixture *f, const scene *s, bst_window w, double *predicted,
                          double *still) {
    size_t pixels = (size_t)w.width * (size_t)w.height;
    float *image = malloc(pixels * sizeof *image), *flat = malloc(pixels * sizeof *flat);
    double *truth = calloc(pixels, sizeof *truth), worst = 0.0;
    bst_render_request q = request_of(s, w);
    bst_renderer *r;
    bst_render_stats stats;
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &s->camera, NULL, &r));
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, image));
    bst_renderer_get_stats(r, &stats);
    *predicted = stats.predicted_sigma;
    reference(&f->ctx, s, w, truth);
    *still = 0.0;
    q.row_time_s = 1e-12; /* the middle row's exposure for all of them */
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, flat));
    double read2 = s->camera.read_noise_e * s->camera.read_noise_e;
    for (size_t i = 0; i < pixels; i++) {
        double sigma = sqrt(truth[i] + 30.0 + read2);
        worst = fmax(worst, fabs((double)image[i] - 30.0 - truth[i]) / sigma);
        *still = fmax(*still, fabs((double)flat[i] - 30.0 - truth[i]) / sigma);
    }
    bst_renderer_free(r);
    free(image);
    free(flat);
    free(truth);
    return worst;
}

static const scene_motion slow = {.x_px = 6, .y_px = 4, .jitter_px = 0.2, .samples = 61, .seed = 3},
                          fast = {.x_px = 30,
                                  .y_px = -25,
                                  .bend_px = 3,
                                  .roll_rad = 0.1,
                                  .samples = 61,
                                  .seed = 3};

static void rows_have_their_own_time(void **state) {
    fixture *f = *state;
    static const struct {
        double row_time_s, exposure_s, brightest;
        const scene_motion *motion;
        bst_window window;
    } cases[] = {
        {1e-4, 0.2, 2e5, &slow, {0, 0, W, H}},    /* little skew, bright */
        {-1e-4, 0.2, 2e5, &slow, {0, 0, W, H}},   /* from the last row on */
        {2e-4, 0.001, 5e4, &fast, {0, 0, W, H}},  /* read-out much longer than the exposure */
        {1e-3, 0.05, 3e4, &fast, {0, 0, W, H}},   /* both alike */
        {1e-3, 0.05, 3e4, &fast, {9, 21, 70, 31}} /* in a window: about its own middle row */
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        scene s = make_scene(cases[i].row_time_s, cases[i].exposure_s, cases[i].motion,
                             cases[i].brightest);
        link_paths(&s);
        double predicted, still, worst = worst_error(f, &s, cases[i].window, &predicted, &still);
        /* the tolerance, of each source; those here do not overlap */
        if (worst > 0.05 || worst > predicted || getenv("BST_TEST_VERBOSE")) {
            print_message("case %zu: worst %.4f predicted %.4f all at once %.1f\n", i, worst,
                          predicted, still);
        }
        assert_true(worst <= 0.05);
        assert_true(predicted >= worst);
        assert_true(still > 1.0); /* the scene shows the difference */
        scene_track_free(&s.track);
    }
}

/* The same by way of the Fourier transform; fewer rows, for the reference is slow. */
static void any_psf(void **state) {
    fixture *f = *state;
    scene s = make_scene(1e-3, 0.02, &slow, 3e4);
    link_paths(&s);
    s.camera.optics.psf = BST_PSF_MOFFAT;
    s.camera.optics.moffat_beta = 2.5;
    double predicted, still,
        worst = worst_error(f, &s, (bst_window){0, 34, W, 8}, &predicted, &still);
    assert_true(worst <= 0.05 && predicted >= worst);
    scene_track_free(&s.track);
}

/* Where no light falls a band changes nothing: the noise belongs to the pixel. */
static void noise_is_that_of_the_pixel(void **state) {
    fixture *f = *state;
    static float light[W * H];
    scene s = make_scene(1e-4, 0.2, &slow, 2e5);
    link_paths(&s);
    bst_renderer *r;
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &s.camera, NULL, &r));
    bst_render_request q = request_of(&s, (bst_window){0, 0, W, H});
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, light));
    bst_frame *frames[2];
    const uint16_t *pixels[2];
    long long saturated, counted = 0;
    int dark = 0, lit = 0;
    for (int k = 0; k < 2; k++) {
        bst_assert_ok(&f->ctx, bst_renderer_render(&f->ctx, r, &q, &frames[k]));
        if (k == 0) {
            bst_assert_ok(&f->ctx, bst_renderer_saturated(&f->ctx, r, &saturated));
        }
        bst_assert_ok(&f->ctx, bst_frame_map(frames[k], &f->ctx, &pixels[k]));
        q.count = 0; /* then without sources: one band */
    }
    for (int i = 0; i < W * H; i++) {
        counted += pixels[0][i] == 65535 || light[i] > 1.01f * 65000.0f;
        if (light[i] == 30.0f) {
            dark++;
            assert_int_equal(pixels[0][i], pixels[1][i]);
        } else {
            lit += pixels[0][i] != pixels[1][i];
        }
    }
    assert_true(dark > 1000 && lit > 500);
    assert_int_equal(saturated, counted);
    for (int k = 0; k < 2; k++) {
        bst_frame_unmap(frames[k]);
        bst_frame_release(frames[k]);
    }
    bst_renderer_free(r);
    scene_track_free(&s.track);
}

/* Binned, or over a background that differs from place to place, the frame scatters about the
 * expected light of the same rows as it should. */
static void all_detectors_take_it(void **state) {
    fixture *f = *state;
    static float light[W * H], nodes[W * H];
    for (int way = 0; way < 2; way++) {
        int b = way ? 1 : 2;
        scene s = make_scene(1e-3, 0.05, &fast, 3e4);
        link_paths(&s);
        s.camera.background.stray_e_per_s = 1.0; /* the renderer takes a map */
        for (int i = 0; i < W * H; i++) {
            nodes[i] = (float)(i % 50);
        }
        bst_skylight_map map = {.step_px = 1, .columns = W, .rows = H, .e = nodes};
        bst_renderer *r;
        bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &s.camera, NULL, &r));
        bst_render_request q = request_of(&s, (bst_window){0, 0, W, H});
        q.background = way ? &map : NULL;
        q.binning = b;
        bst_frame *frame;
        const uint16_t *pixels;
        bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, light));
        bst_assert_ok(&f->ctx, bst_renderer_render(&f->ctx, r, &q, &frame));
        bst_assert_ok(&f->ctx, bst_frame_map(frame, &f->ctx, &pixels));
        double chi2 = 0.0, worst = 0.0;
        for (int y = 0; y < H / b; y++) {
            for (int x = 0; x < W / b; x++) {
                double e = 0.0;
                for (int k = 0; k < b * b; k++) {
                    e += (double)light[(y * b + k / b) * W + x * b + k % b];
                }
                double variance = e + s.camera.read_noise_e * s.camera.read_noise_e + 1.0 / 12.0;
                double z = (pixels[y * (W / b) + x] - s.camera.offset_dn - e) / sqrt(variance);
                chi2 += z * z;
                worst = fmax(worst, fabs(z));
            }
        }
        int n = W * H / (b * b);
        bst_assert_close(chi2 / n, 1.0, 4.5 * sqrt(2.0 / n)); /* 4.5 sigma of a chi-square */
        assert_true(worst < 5.5); /* of 1e4 normal deviates: 1 in 3000 runs has one beyond */
        bst_frame_unmap(frame);
        bst_frame_release(frame);
        bst_renderer_free(r);
        scene_track_free(&s.track);
    }
}

static void short_tracks_are_refused(void **state) {
    fixture *f = *state;
    static float image[W * H];
    scene s = make_scene(1e-3, 0.05, &slow, 1e4);
    bst_renderer *r;
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &s.camera, NULL, &r));
    bst_render_request q = request_of(&s, (bst_window){0, 0, W, H});
    q.exposure_s = 0.051;
    assert_int_equal(bst_renderer_render_noise_free(&f->ctx, r, &q, image), BST_ERR_ARGUMENT);
    assert_non_null(strstr(f->ctx.message, "row_time_s"));
    bst_renderer_free(r);
    s.camera.detector.row_time_s = 0.0; /* nor a camera whose rows are exposed at once */
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &s.camera, NULL, &r));
    assert_int_equal(bst_renderer_render_noise_free(&f->ctx, r, &q, image), BST_ERR_ARGUMENT);
    bst_renderer_free(r);
    scene_track_free(&s.track);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows_have_their_own_time),   cmocka_unit_test(any_psf),
        cmocka_unit_test(noise_is_that_of_the_pixel), cmocka_unit_test(all_detectors_take_it),
        cmocka_unit_test(short_tracks_are_refused),
    };
    return cmocka_run_group_tests(tests, open_device, close_device);
}
