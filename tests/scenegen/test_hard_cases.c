/* Numerically hard scenes: the renderer against the reference, and its own prediction of the error.
 *
 * Everywhere the allowed error is the tolerance that was asked for, of each source's image, and of
 * as many as lie on one another; and the prediction holds: it is no smaller than what is measured.
 */
#include "scenegen/reference.h"
#include "scenegen/renderer.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

typedef struct fixture {
    bst_ctx ctx;
    bst_device *device;
} fixture;

static int open_device(void **state) {
    static fixture f;
    *state = &f;
    return bst_device_open(&f.ctx, "", 0, &f.device) == BST_OK ? 0 : -1;
}

static int close_device(void **state) {
    bst_device_close(((fixture *)*state)->device);
    return 0;
}

typedef struct hard_case {
    bst_camera camera;
    bst_window window;
    const bst_los_track *track;
    const bst_source *sources;
    int count;
    double background_e;
    int deep; /* so many sources lie on one another; 0: none do */
} hard_case;

/* Asserts both bounds; returns the electrons of the reference on the window. */
static double check(fixture *f, const hard_case *c) {
    bst_renderer_options options = bst_renderer_default_options();
    bst_renderer *r;
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &c->camera, &options, &r));
    bst_render_request q = {.window = c->window,
                            .track = c->track,
                            .sources = c->sources,
                            .count = c->count,
                            .background_e = c->background_e};
    size_t pixels = (size_t)c->window.width * (size_t)c->window.height;
    float *fast = malloc(pixels * sizeof *fast);
    double *reference = calloc(pixels, sizeof *reference), worst = 0.0, sum = 0.0;
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, fast));
    bst_assert_ok(&f->ctx, bst_reference_render(&f->ctx, &c->camera, c->window, c->track,
                                                c->sources, c->count, 1e-9, reference));
    double variance = c->background_e + c->camera.read_noise_e * c->camera.read_noise_e;
    for (size_t i = 0; i < pixels; i++) {
        double error = fabs((double)fast[i] - c->background_e - reference[i]);
        assert_true(isfinite(fast[i]));
        worst = fmax(worst, error / sqrt(reference[i] + variance));
        sum += reference[i];
    }
    bst_render_stats stats;
    bst_renderer_get_stats(r, &stats);
    print_message("  measured %.2e, predicted %.2e sigma, %d sources, %lld nodes, %.3g e-\n", worst,
                  stats.predicted_sigma, stats.sources, stats.nodes, sum);
    bst_assert_close(worst, 0.0, options.tolerance_sigma * (c->deep > 0 ? c->deep : 1));
    assert_true(stats.predicted_sigma >= worst);
    free(fast);
    free(reference);
    bst_renderer_free(r);
    return sum;
}

static hard_case make_case(const bst_los_track *track, const bst_source *sources, int count) {
    return (hard_case){.camera = scene_camera(160, 128),
                       .window = {0, 0, 160, 128},
                       .track = track,
                       .sources = sources,
                       .count = count,
                       .background_e = 3.0};
}

/* A track that turns about `axis` by `angle(u)` rad at the share u of the exposure. */
static scene_track turning(bst_vec3 axis, double (*angle)(double u), int samples,
                           double duration_s) {
    scene_track t = {{samples, NULL, NULL},
                     malloc((size_t)samples * sizeof(double)),
                     malloc((size_t)samples * sizeof(bst_quat))};
    for (int k = 0; k < samples; k++) {
        double u = (double)k / (samples - 1);
        t.time_s[k] = u * duration_s;
        t.q[k] = bst_quat_from_rotvec(bst_vec3_scale(axis, angle(u)));
        if (k > 0) {
            const bst_quat *a = &t.q[k - 1], *b = &t.q[k];
            if (a->x * b->x + a->y * b->y + a->z * b->z + a->w * b->w < 0.0) {
                t.q[k] = (bst_quat){-b->x, -b->y, -b->z, -b->w};
            }
        }
    }
    t.track.time_s = t.time_s;
    t.track.q_cam_from_gcrf = t.q;
    return t;
}

static double still_angle(double u) {
    return 0.0 * u;
}
static double full_turn(double u) {
    return 2.0 * BST_PI * u;
}
/* 20 px of the 3 arcsec camera there and back, coming to rest in between */
static double there_and_back(double u) {
    return 20.0 * 3.0 * BST_ARCSEC_RAD * sin(BST_PI * u) * sin(BST_PI * u);
}
static double across(double u) {
    return 100.0 * 3.0 * BST_ARCSEC_RAD * (u - 0.5);
}

static void no_motion(void **state) {
    bst_camera camera = scene_camera(160, 128);
    bst_source *stars = scene_stars(&camera, 20, 1e6, 5.0, 2);
    scene_track t = turning((bst_vec3){1, 0, 0}, still_angle, 501, 0.5);
    hard_case c = make_case(&t.track, stars, 20);
    assert_true(check(*state, &c) > 1e5);
    free(stars);
    scene_track_free(&t);
}

static void a_full_turn_about_the_boresight(void **state) {
    bst_camera camera = scene_camera(160, 128);
    bst_source *stars = scene_stars(&camera, 12, 1e6, 5.0, 3);
    scene_track t = turning((bst_vec3){0, 0, 1}, full_turn, 721, 0.5);
    hard_case c = make_case(&t.track, stars, 12);
    assert_true(check(*state, &c) > 1e4);
    free(stars);
    scene_track_free(&t);
}

/* The field sweeps a great circle: each star crosses in a millionth of the exposure. */
static void a_full_turn_across_the_sky(void **state) {
    bst_source stars[4];
    bst_camera camera = scene_camera(160, 128);
    for (int i = 0; i < 4; i++) {
        /* around the circle that the boresight follows, beside each other */
        double a = 0.5 + 1.5 * i, off = (i - 1.5) * 20.0 * bst_camera_scale_rad(&camera);
        stars[i] = (bst_source){.kind = BST_SOURCE_STAR,
                                .apparent_mid = bst_vec3_unit((bst_vec3){off, sin(a), cos(a)}),
                                .electrons_per_s = 1e8};
    }
    scene_track t = turning((bst_vec3){1, 0, 0}, full_turn, 721, 0.5);
    hard_case c = make_case(&t.track, stars, 4);
    check(*state, &c);
    scene_track_free(&t);
}

static void motion_that_reverses(void **state) {
    bst_camera camera = scene_camera(160, 128);
    bst_source *stars = scene_stars(&camera, 20, 1e6, 5.0, 5);
    scene_track t = turning((bst_vec3){0.6, 0.8, 0}, there_and_back, 501, 0.5);
    hard_case c = make_case(&t.track, stars, 20);
    assert_true(check(*state, &c) > 1e4);
    free(stars);
    scene_track_free(&t);
}

static void a_star_that_enters_through_a_corner(void **state) {
    bst_camera camera = scene_camera(160, 128);
    /* 100 px along the diagonal through pixel (0, 0) */
    scene_track t = turning((bst_vec3){-sqrt(0.5), sqrt(0.5), 0}, across, 501, 0.5);
    bst_source star = scene_star(&camera, -0.5, -0.5, 1e6);
    hard_case c = make_case(&t.track, &star, 1);
    double on = check(*state, &c);
    assert_true(on > 0.2 * 5e5 && on < 0.8 * 5e5); /* about half of it comes in */
    scene_track_free(&t);
}

static void narrow_and_wide_psf(void **state) {
    const double fwhm_px[] = {0.3, 40.0};
    for (int i = 0; i < 2; i++) {
        bst_camera camera = scene_camera(160, 128);
        bst_source *stars = scene_stars(&camera, 8, 1e6, 5.0, 7);
        const scene_motion motion = {
            .x_px = 6.0, .y_px = -3.0, .jitter_px = 0.1, .duration_s = 0.5, .samples = 501};
        scene_track t = scene_track_make(&camera, &motion);
        hard_case c = make_case(&t.track, stars, 8);
        c.deep = i == 0 ? 1 : 8;
        c.camera.psf_fwhm_px = fwhm_px[i];
        assert_true(check(*state, &c) > 1e4);
        scene_track_free(&t);
        scene_track still = turning((bst_vec3){1, 0, 0}, still_angle, 2, 0.5);
        c.track = &still.track;
        assert_true(check(*state, &c) > 1e4);
        scene_track_free(&still);
        free(stars);
    }
}

static void one_pixel_and_no_star(void **state) {
    bst_camera camera = scene_camera(160, 128);
    bst_source star = scene_star(&camera, 80.3, 64.4, 1e6);
    scene_track t = turning((bst_vec3){0.6, 0.8, 0}, there_and_back, 501, 0.5);
    hard_case c = make_case(&t.track, &star, 1);
    c.window = (bst_window){80, 64, 1, 1};
    assert_true(check(*state, &c) > 1e3);
    c.count = 0;
    assert_true(check(*state, &c) == 0.0); /* nothing was added */
    scene_track_free(&t);
}

/* The same field and motion at the celestial pole and on the equator. */
static void the_celestial_pole(void **state) {
    bst_camera camera = scene_camera(160, 128);
    bst_source stars[16];
    const scene_motion motion = {
        .x_px = 12.0, .y_px = 5.0, .roll_rad = 0.01, .duration_s = 0.5, .samples = 501};
    for (int i = 0; i < 16; i++) {
        stars[i] = scene_star(&camera, 9.7 * i + 3.0, 7.9 * i + 2.0, 1e5 * (i + 1));
    }
    /* camera +z is GCRF +z: star 8 is on it to within some pixels */
    scene_track t = scene_track_make(&camera, &motion);
    hard_case c = make_case(&t.track, stars, 16);
    double pole = check(*state, &c);
    /* the same seen on the equator: both sides turned by a right angle */
    bst_quat q = bst_quat_from_rotvec((bst_vec3){0, 0.5 * BST_PI, 0});
    for (int i = 0; i < 16; i++) {
        stars[i].apparent_mid = bst_quat_rotate(q, stars[i].apparent_mid);
    }
    for (int k = 0; k < t.track.count; k++) {
        t.q[k] = bst_quat_mul(t.q[k], bst_quat_conj(q));
    }
    /* rounding of directions, 1e-15 rad of a 1.5e-5 rad pixel, moves little light */
    bst_assert_close(check(*state, &c), pole, 1e-6 * pole);
    scene_track_free(&t);
}

/* At 10 m a drift of 2 cm/s is a streak over half the field; at 1e6 km 7 km/s hardly move. */
static void near_and_far_targets(void **state) {
    bst_camera camera = scene_camera(160, 128);
    scene_track t = turning((bst_vec3){1, 0, 0}, still_angle, 2, 0.5);
    const double range_m[] = {10.0, 1e9};
    for (int i = 0; i < 2; i++) {
        bst_vec3 mid = bst_vec3_scale(bst_camera_unproject(&camera, 70.3, 61.8), range_m[i]);
        double speed_mps = i == 0 ? 0.02 : 7000.0;
        bst_vec3 step = {0.25 * speed_mps, 0.05 * speed_mps, 0.1 * speed_mps}; /* in 0.25 s */
        bst_source_path path =
            bst_source_path_through(bst_vec3_sub(mid, step), mid, bst_vec3_add(mid, step));
        bst_source target = {.kind = BST_SOURCE_OBJECT,
                             .apparent_mid = bst_vec3_unit(mid),
                             .electrons_per_s = 1e6,
                             .path = &path};
        hard_case c = make_case(&t.track, &target, 1);
        bst_assert_close(check(*state, &c), 5e5, 5.0); /* all of its light is on the field */
    }
    scene_track_free(&t);
}

/* A dark frame without noise, and pixels filled beyond the full well: digital numbers at the ends
 * of their range. */
static void means_of_zero_and_above_full_well(void **state) {
    fixture *f = *state;
    bst_camera camera = scene_camera(64, 64);
    bst_source star = scene_star(&camera, 31.5, 31.5, 1e8);
    scene_track t = turning((bst_vec3){1, 0, 0}, still_angle, 2, 0.5);
    hard_case c = {.camera = camera,
                   .window = {0, 0, 64, 64},
                   .track = &t.track,
                   .sources = &star,
                   .count = 1};
    check(f, &c);
    camera.read_noise_e = 0.0;
    bst_renderer *r;
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &camera, NULL, &r));
    const double means_e[] = {0.0, 2.0 * camera.full_well_e};
    for (int i = 0; i < 2; i++) {
        bst_render_request q = {.window = {0, 0, 64, 64},
                                .track = &t.track,
                                .background_e = means_e[i],
                                .key = {{5, 6}}};
        bst_frame *frame;
        const uint16_t *dn;
        long long saturated;
        bst_assert_ok(&f->ctx, bst_renderer_render(&f->ctx, r, &q, &frame));
        bst_assert_ok(&f->ctx, bst_frame_map(frame, &f->ctx, &dn));
        int expected = (int)(camera.offset_dn + i * camera.full_well_e);
        for (int k = 0; k < 64 * 64; k++) {
            assert_int_equal(dn[k], expected);
        }
        bst_assert_ok(&f->ctx, bst_renderer_saturated(&f->ctx, r, &saturated));
        assert_int_equal(saturated, i * 64 * 64);
        bst_frame_unmap(frame);
        bst_frame_release(frame);
    }
    bst_renderer_free(r);
    scene_track_free(&t);
}

static void exposures_of_nothing_and_a_thousand_seconds(void **state) {
    bst_camera camera = scene_camera(160, 128);
    bst_source *stars = scene_stars(&camera, 10, 1e6, 5.0, 11);
    scene_track none = turning((bst_vec3){1, 0, 0}, still_angle, 2, 0.0);
    hard_case c = make_case(&none.track, stars, 10);
    assert_true(check(*state, &c) == 0.0); /* no time, no light */
    scene_track_free(&none);
    for (int i = 0; i < 10; i++) {
        stars[i].electrons_per_s *= 1e-3;
    }
    scene_track longest = turning((bst_vec3){0.6, 0.8, 0}, across, 1001, 1000.0);
    c.track = &longest.track;
    assert_true(check(*state, &c) > 1e4);
    scene_track_free(&longest);
    free(stars);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_motion),
        cmocka_unit_test(a_full_turn_about_the_boresight),
        cmocka_unit_test(a_full_turn_across_the_sky),
        cmocka_unit_test(motion_that_reverses),
        cmocka_unit_test(a_star_that_enters_through_a_corner),
        cmocka_unit_test(narrow_and_wide_psf),
        cmocka_unit_test(one_pixel_and_no_star),
        cmocka_unit_test(the_celestial_pole),
        cmocka_unit_test(near_and_far_targets),
        cmocka_unit_test(means_of_zero_and_above_full_well),
        cmocka_unit_test(exposures_of_nothing_and_a_thousand_seconds),
    };
    return cmocka_run_group_tests(tests, open_device, close_device);
}
