/* Numerically hard scenes: the renderer against the reference, and its own prediction of the error.
 *
 * Everywhere the allowed error is the tolerance that was asked for, of each source's image, and of
 * as many as lie on one another; and the prediction holds: it is no smaller than what is measured.
 */
#include <string.h>
#include <time.h>

#include "scenegen/reference.h"
#include "scenegen/renderer.h"
#include "tests/scenegen/device_fixture.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

typedef struct hard_case {
    bst_camera camera;
    bst_window window;
    const bst_los_track *track;
    const bst_scene_source *sources;
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

static hard_case make_case(const bst_los_track *track, const bst_scene_source *sources, int count) {
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
    bst_scene_source *stars = scene_stars(&camera, 20, 1e6, 5.0, 2);
    scene_track t = turning((bst_vec3){1, 0, 0}, still_angle, 501, 0.5);
    hard_case c = make_case(&t.track, stars, 20);
    assert_true(check(*state, &c) > 1e5);
    free(stars);
    scene_track_free(&t);
}

static void a_full_turn_about_the_boresight(void **state) {
    bst_camera camera = scene_camera(160, 128);
    bst_scene_source *stars = scene_stars(&camera, 12, 1e6, 5.0, 3);
    scene_track t = turning((bst_vec3){0, 0, 1}, full_turn, 721, 0.5);
    hard_case c = make_case(&t.track, stars, 12);
    assert_true(check(*state, &c) > 1e4);
    free(stars);
    scene_track_free(&t);
}

/* The field sweeps a great circle: each star crosses in a millionth of the exposure. */
static void a_full_turn_across_the_sky(void **state) {
    bst_scene_source stars[2];
    bst_camera camera = scene_camera(160, 128);
    for (int i = 0; i < 2; i++) {
        /* around the circle that the boresight follows, beside each other */
        double a = 0.5 + 3.0 * i, off = (i - 0.5) * 40.0 * bst_camera_scale_rad(&camera);
        stars[i] =
            (bst_scene_source){.kind = BST_SOURCE_STAR,
                               .apparent_mid = bst_vec3_unit((bst_vec3){off, sin(a), cos(a)}),
                               .electrons_per_s = 1e8};
    }
    scene_track t = turning((bst_vec3){1, 0, 0}, full_turn, 721, 0.5);
    hard_case c = make_case(&t.track, stars, 2);
    check(*state, &c);
    scene_track_free(&t);
}

static void motion_that_reverses(void **state) {
    bst_camera camera = scene_camera(160, 128);
    bst_scene_source *stars = scene_stars(&camera, 20, 1e6, 5.0, 5);
    scene_track t = turning((bst_vec3){0.6, 0.8, 0}, there_and_back, 501, 0.5);
    hard_case c = make_case(&t.track, stars, 20);
    assert_true(check(*state, &c) > 1e4);
    free(stars);
    scene_track_free(&t);
}

/* Two stares with a drift, and a jump without light: two points are no streak, with less light
 * beside them. */
static void two_stares_of_a_bright_star(void **state) {
    const double fwhm_px[] = {0.84, 1.2}, drift_sigmas[] = {0.6, 1.06, 2.4};
    double time_s[] = {0.0, 0.25 - 1e-7, 0.25 + 1e-7, 0.5};
    bst_quat q[4];
    const bst_los_track track = {4, time_s, q};
    for (int n = 0; n < 6; n++) {
        double drift = drift_sigmas[n % 3] * fwhm_px[n / 3] / 2.3548;
        const double tilt_px[] = {0.0, drift, 20.5 + drift, 20.5 + 2.0 * drift};
        for (int k = 0; k < 4; k++) {
            q[k] = bst_quat_from_rotvec((bst_vec3){tilt_px[k] * 3.0 * BST_ARCSEC_RAD, 0.0, 0.0});
        }
        hard_case c = make_case(&track, NULL, 1);
        c.camera.psf_fwhm_px = fwhm_px[n / 3];
        bst_scene_source star = scene_star(&c.camera, 80.0 + 0.25 * n, 64.0, 3e5);
        c.sources = &star;
        assert_true(check(*state, &c) > 1e5);
    }
}

static void a_star_that_enters_through_a_corner(void **state) {
    bst_camera camera = scene_camera(160, 128);
    /* 100 px along the diagonal through pixel (0, 0) */
    scene_track t = turning((bst_vec3){-sqrt(0.5), sqrt(0.5), 0}, across, 501, 0.5);
    bst_scene_source star = scene_star(&camera, -0.5, -0.5, 1e6);
    hard_case c = make_case(&t.track, &star, 1);
    double on = check(*state, &c);
    assert_true(on > 0.2 * 5e5 && on < 0.8 * 5e5); /* about half of it comes in */
    scene_track_free(&t);
}

static void narrow_and_wide_psf(void **state) {
    const double fwhm_px[] = {0.3, 40.0};
    for (int i = 0; i < 2; i++) {
        bst_camera camera = scene_camera(160, 128);
        bst_scene_source *stars = scene_stars(&camera, 8, 1e6, 5.0, 7);
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
    bst_scene_source star = scene_star(&camera, 80.3, 64.4, 1e6);
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
    bst_scene_source stars[16];
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
        bst_scene_source_path path =
            bst_scene_source_path_through(bst_vec3_sub(mid, step), mid, bst_vec3_add(mid, step));
        bst_scene_source target = {.kind = BST_SOURCE_OBJECT,
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
    bst_scene_source star = scene_star(&camera, 31.5, 31.5, 1e8);
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
    bst_scene_source *stars = scene_stars(&camera, 10, 1e6, 5.0, 11);
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

/* Light that falls to nothing in the middle of the way: from u = 0.5 - half to 0.5 + half of the
 * exposure, as the share 1/2 - 3/4 z + 1/4 z^3 of the Sun's disc with z = (u - 0.5) / half; knots
 * are hundredths apart, where the track has its samples. */
static bst_scene_source_rate into_the_umbra(double half) {
    bst_scene_source_rate r = {.count = (int)lround(200.0 * half) + 3};
    double sum = 0.0;
    for (int k = 0; k < r.count; k++) {
        double t = (double)(k - 1) / (r.count - 3);
        r.u[k] = k == 0 ? 0.0 : k == r.count - 1 ? 1.0 : 0.5 + half * (2.0 * t - 1.0);
        double z = fmin(fmax((r.u[k] - 0.5) / half, -1.0), 1.0);
        r.rate[k] = 0.5 - 0.75 * z + 0.25 * z * z * z;
        sum += k > 0 ? 0.5 * (r.u[k] - r.u[k - 1]) * (r.rate[k] + r.rate[k - 1]) : 0.0;
    }
    for (int k = 0; k < r.count; k++) {
        r.rate[k] /= sum; /* over the exposure's mean */
        r.light[k] =
            k > 0 ? r.light[k - 1] + 0.5 * (r.u[k] - r.u[k - 1]) * (r.rate[k] + r.rate[k - 1])
                  : 0.0;
    }
    return r;
}

/* 110 px of way: bright before, dark after, with a soft end or one within two pixels. */
static void a_target_that_crosses_the_edge_of_the_umbra(void **state) {
    bst_camera camera = scene_camera(160, 128);
    scene_track t = turning((bst_vec3){1, 0, 0}, still_angle, 101, 0.5);
    bst_scene_source_path path = bst_scene_source_path_through(
        bst_camera_unproject(&camera, 30.3, 40.2), bst_camera_unproject(&camera, 80.3, 64.2),
        bst_camera_unproject(&camera, 130.3, 88.2));
    const double halves[] = {0.2, 0.01};
    for (int i = 0; i < 2; i++) {
        bst_scene_source_rate rate = into_the_umbra(halves[i]);
        bst_scene_source target = {.kind = BST_SOURCE_OBJECT,
                                   .apparent_mid = bst_camera_unproject(&camera, 80.3, 64.2),
                                   .electrons_per_s = 1e6,
                                   .path = &path,
                                   .rate = &rate};
        hard_case c = make_case(&t.track, &target, 1);
        bst_assert_close(check(*state, &c), 5e5, 5.0); /* all of its light is on the field */
        c.window = (bst_window){115, 0, 45, 128};      /* the last of the way: dark */
        bst_assert_close(check(*state, &c), 0.0, 1e-3);
    }
    scene_track_free(&t);
}

/* 100,000 stars, 8 magnitudes of them: in a second or two, and in three crops as the reference has
 * it, which is given only the stars near by. */
static void a_hundred_thousand_stars(void **state) {
    fixture *f = *state;
    enum { STARS = 100000, CROP = 48, REACH = 24 };
    bst_camera camera = scene_camera(2048, 2048);
    bst_scene_source *stars = scene_stars(&camera, STARS, 1e6, 8.0, 12),
                     *near = malloc(STARS * sizeof *near);
    const scene_motion motion = {.x_px = 3, .y_px = 4, .duration_s = 0.5, .samples = 26};
    scene_track t = scene_track_make(&camera, &motion);
    bst_renderer_options options = bst_renderer_default_options();
    bst_renderer *r;
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &camera, &options, &r));
    bst_render_request q = {.window = {0, 0, 2048, 2048},
                            .track = &t.track,
                            .sources = stars,
                            .count = STARS,
                            .background_e = 3.0};
    float *fast = malloc((size_t)2048 * 2048 * sizeof *fast);
    clock_t start = clock();
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, fast));
    double seconds = (double)(clock() - start) / CLOCKS_PER_SEC;
    bst_render_stats stats;
    bst_renderer_get_stats(r, &stats);
    const int corners[3][2] = {{0, 0}, {1000, 990}, {2000, 1500}};
    double worst = 0.0, all = 0.0;
    for (int i = 0; i < 3; i++) {
        static double reference[CROP * CROP];
        bst_window w = {corners[i][0], corners[i][1], CROP, CROP};
        int count = 0;
        for (int n = 0; n < STARS; n++) {
            double x, y;
            assert_true(bst_camera_project(&camera, stars[n].apparent_mid, &x, &y));
            if (x > w.x0 - REACH && x < w.x0 + CROP + REACH && y > w.y0 - REACH &&
                y < w.y0 + CROP + REACH) {
                near[count++] = stars[n];
            }
        }
        memset(reference, 0, sizeof reference);
        bst_assert_ok(&f->ctx, bst_reference_render(&f->ctx, &camera, w, &t.track, near, count,
                                                    1e-8, reference));
        for (int k = 0; k < CROP * CROP; k++) {
            size_t at = (size_t)(w.y0 + k / CROP) * 2048 + (size_t)(w.x0 + k % CROP);
            double error = fabs((double)fast[at] - 3.0 - reference[k]);
            worst = fmax(worst, error / sqrt(reference[k] + 3.0 + 64.0));
            all += reference[k];
        }
    }
    print_message("  measured %.2e, predicted %.2e sigma, %d sources, %.2f s of processor time\n",
                  worst, stats.predicted_sigma, stats.sources, seconds);
    assert_true(all > 1e5);
    bst_assert_close(worst, 0.0, options.tolerance_sigma);
    assert_true(stats.predicted_sigma >= worst);
    assert_true(stats.predicted_sigma <= 5.0 * options.tolerance_sigma);
    /* 0.15 s measured in a release build; ten times as much under sanitizers */
    assert_true(seconds < 5.0);
    free(near);
    free(fast);
    free(stars);
    bst_renderer_free(r);
    scene_track_free(&t);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_motion),
        cmocka_unit_test(a_full_turn_about_the_boresight),
        cmocka_unit_test(a_full_turn_across_the_sky),
        cmocka_unit_test(motion_that_reverses),
        cmocka_unit_test(two_stares_of_a_bright_star),
        cmocka_unit_test(a_star_that_enters_through_a_corner),
        cmocka_unit_test(narrow_and_wide_psf),
        cmocka_unit_test(one_pixel_and_no_star),
        cmocka_unit_test(the_celestial_pole),
        cmocka_unit_test(near_and_far_targets),
        cmocka_unit_test(means_of_zero_and_above_full_well),
        cmocka_unit_test(exposures_of_nothing_and_a_thousand_seconds),
        cmocka_unit_test(a_target_that_crosses_the_edge_of_the_umbra),
        cmocka_unit_test(a_hundred_thousand_stars),
    };
    return cmocka_run_group_tests(tests, open_device, close_device);
}
