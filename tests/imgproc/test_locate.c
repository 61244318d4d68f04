/* Flags and figures of single sources: edges in x and in y, streaks along either axis, binned
 * windows, frames that are not square. */
#include <stdlib.h>

#include "imgproc/measure/locate.h"
#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

typedef struct fixture {
    bst_ctx ctx;
    synthetic s;
    bst_imgproc *ip;
    bst_detections *d;
} fixture;

static fixture begin(int width, int height) {
    fixture f = {.ip = NULL};
    synthetic_init(&f.s, width, height);
    f.d = synthetic_detections(2048);
    return f;
}

static void expose(fixture *f, const bst_camera_motion *motion) {
    synthetic_expose(&f->s, bst_rng_make_key(12, 0, "test", "locate"), 1);
    if (!f->ip) {
        f->ip = synthetic_processor(&f->ctx, &f->s);
    }
    bst_imgproc_frame frame = synthetic_frame(&f->s);
    bst_assert_ok(&f->ctx, bst_imgproc_detect(&f->ctx, f->ip, &frame, motion, f->d, 2048));
    assert_true(synthetic_sound(f->d));
}

static void end(fixture *f) {
    bst_imgproc_free(f->ip);
    free(f->d);
    synthetic_free(&f->s);
}

static const bst_detection *near_to(const fixture *f, double x, double y, double radius) {
    int n = synthetic_nearest(f->d, x, y, radius);
    if (n < 0) {
        fail_msg("nothing found within %g px of (%g, %g)", radius, x, y);
    }
    return &f->d->items[n];
}

/* A source is cut when two standard deviations of the PSF about it, and half of its path, leave the
 * frame. Sources of 4e4 electrons are placed to 0.005 px, streaks of them to 0.02 px along. */
static void edges_in_x_and_y(void **state) {
    (void)state;
    const double two = 2.0 * 2.0 / 2.3548200450309493, W = 100.0, H = 80.0;
    const double paths[3][2] = {{0.0, 0.0}, {8.0, 0.0}, {0.0, 8.0}};
    for (int p = 0; p < 3; p++) {
        double half_x = two + 0.5 * paths[p][0], half_y = two + 0.5 * paths[p][1];
        for (int side = 0; side < 4; side++) {
            for (int inside = 0; inside < 2; inside++) {
                double off = inside ? 0.12 : -0.12, x = 48.3, y = 41.7;
                if (side == 0) {
                    x = -0.5 + half_x + off;
                } else if (side == 1) {
                    x = W - 0.5 - half_x - off;
                } else if (side == 2) {
                    y = -0.5 + half_y + off;
                } else {
                    y = H - 0.5 - half_y - off;
                }
                fixture f = begin(100, 80);
                synthetic_add(&f.s, x, y, 4e4, paths[p][0], paths[p][1]);
                bst_camera_motion motion = synthetic_motion(&f.s, paths[p][0], paths[p][1]);
                expose(&f, p ? &motion : NULL);
                const bst_detection *d = near_to(&f, x, y, 0.3);
                assert_int_equal((d->flags & BST_DETECTION_EDGE) != 0, !inside);
                assert_int_equal((d->flags & BST_DETECTION_STREAK) != 0, p > 0);
                end(&f);
            }
        }
    }
}

/* SNR: flux times the image's sqrt(sum p^2) over the noise of a pixel, for points and streaks. */
static void snr_of_points_and_streaks(void **state) {
    (void)state;
    const double paths[3][2] = {{0.0, 0.0}, {9.0, 0.0}, {3.0, 8.0}};
    for (int p = 0; p < 3; p++) {
        fixture f = begin(320, 256);
        double dx = paths[p][0], dy = paths[p][1];
        double noise = synthetic_noise(&f.s), norm = synthetic_norm(&f.s, 60.0, 40.0, dx, dy);
        for (int i = 0; i < 12; i++) {
            synthetic_add(&f.s, 32.0 + 64.0 * (i % 4), 32.0 + 64.0 * (i / 4), 40.0 * noise / norm,
                          dx, dy);
        }
        bst_camera_motion motion = synthetic_motion(&f.s, dx, dy);
        expose(&f, p ? &motion : NULL);
        double ratio = 0.0;
        for (int i = 0; i < 12; i++) {
            const bst_detection *d = near_to(&f, 32.0 + 64.0 * (i % 4), 32.0 + 64.0 * (i / 4), 1.0);
            ratio += d->snr / (d->flux_e * norm / noise) / 12.0;
            /* its own photons: variance of the flux at least noise^2 / norm^2 */
            double least = noise / norm;
            assert_true(d->flux_sigma_e > 0.95 * least);
            assert_true(d->flux_sigma_e < 1.3 * sqrt(least * least + d->flux_e));
        }
        /* noise is measured by meshes of 64 px, to 1 %; the norm is of one place in the pixel */
        bst_assert_close(ratio, 1.0, 0.05);
        end(&f);
    }
}

/* Light of a source that lies outside: at the maximum, known to a pixel, with the flux that the
 * filter says and the noise of that. */
static void what_lies_outside_is_known_to_a_pixel(void **state) {
    (void)state;
    const double places[4][2] = {{-1.2, 45.0}, {100.2, 45.0}, {45.0, -1.2}, {45.0, 80.2}};
    for (int k = 0; k < 4; k++) {
        fixture f = begin(100, 80);
        double x = places[k][0], y = places[k][1];
        synthetic_add(&f.s, x, y, 4000, 0, 0);
        expose(&f, NULL);
        const bst_detection *d =
            near_to(&f, fmin(fmax(x, 0.0), 99.0), fmin(fmax(y, 0.0), 79.0), 1.0);
        assert_int_equal(d->label, BST_LABEL_ARTEFACT);
        bst_assert_close(d->label_probability, 0.9, 1e-6);
        assert_true(d->flags & BST_DETECTION_EDGE);
        assert_true(d->cov_xx == 1.0 && d->cov_yy == 1.0 && d->cov_xy == 0.0);
        double sigma = synthetic_noise(&f.s) / synthetic_norm(&f.s, 50.0, 40.0, 0, 0);
        /* measured noise, and the norm of a point on the middle of a pixel: 5 % */
        double want = sqrt(sigma * sigma + d->flux_e);
        bst_assert_close(d->flux_sigma_e, want, 0.05 * want);
        end(&f);
    }
}

/* A streaking star on a window of a sensor that is read in pixels of two by two: place, length and
 * angle in sensor pixels, and the right shape, which a straight path of other length would miss. */
static void binned_window_of_streaks(void **state) {
    (void)state;
    const double paths[2][2] = {{14.0, 6.0}, {-5.0, 16.0}};
    for (int p = 0; p < 2; p++) {
        fixture f = begin(192, 160);
        f.s.camera.psf_fwhm_px = 4.0;
        double dx = paths[p][0], dy = paths[p][1];
        const double stars[3][2] = {{70.3, 60.8}, {120.6, 44.1}, {90.2, 101.7}};
        for (int i = 0; i < 3; i++) {
            synthetic_add(&f.s, stars[i][0], stars[i][1], 2e4, dx, dy);
        }
        synthetic_expose(&f.s, bst_rng_make_key(13, 0, "test", "locate"), 1);
        enum { X0 = 32, Y0 = 12, NX = 64, NY = 56 };
        static uint16_t binned[NY * NX];
        for (int i = 0; i < NX * NY; i++) {
            const uint16_t *q = f.s.pixels + (Y0 + i / NX * 2) * 192 + X0 + i % NX * 2;
            binned[i] = (uint16_t)(q[0] + q[1] + q[192] + q[193] - 300);
        }
        f.ip = synthetic_processor(&f.ctx, &f.s);
        bst_imgproc_frame frame = synthetic_frame(&f.s);
        frame.pixels = binned;
        frame.window = (bst_window){X0, Y0, 2 * NX, 2 * NY};
        frame.binning = 2;
        bst_camera_motion motion = synthetic_motion(&f.s, dx, dy);
        bst_assert_ok(&f.ctx, bst_imgproc_detect(&f.ctx, f.ip, &frame, &motion, f.d, 64));
        for (int i = 0; i < 3; i++) {
            const bst_detection *d = near_to(&f, stars[i][0], stars[i][1], 1.0);
            /* five sigma */
            bst_assert_close(d->x_px, stars[i][0], 5 * sqrt(d->cov_xx));
            bst_assert_close(d->y_px, stars[i][1], 5 * sqrt(d->cov_yy));
            assert_true(d->cov_xx < 0.05 && d->cov_yy < 0.05);
            assert_true(d->flags & BST_DETECTION_STREAK);
            assert_false(d->flags & (BST_DETECTION_EDGE | BST_DETECTION_BLEND));
            bst_assert_close(d->flux_e, 2e4, 0.03 * 2e4); /* four sigma of 150 e- */
            /* windowed moments of what is no Gaussian: 15 %, and a tenth of a radian */
            double sigma = bst_camera_psf_sigma_px(&f.s.camera);
            double length = 2.3548200450309493 * sqrt(sigma * sigma + (dx * dx + dy * dy) / 12.0);
            bst_assert_close(d->length_px, length, 0.15 * length);
            double turn = atan2(dy, dx) - d->angle_rad;
            bst_assert_close(sin(turn), 0.0, 0.1);
        }
        end(&f);
    }
}

/* A saturated pixel counts within half the path, two standard deviations and a pixel of a source,
 * in x as in y. */
static void saturated_pixels_within_the_light(void **state) {
    (void)state;
    const double two = 2.0 * 2.0 / 2.3548200450309493;
    for (int p = 0; p < 2; p++) {
        double dx = p ? 0.0 : 16.0, dy = p ? 16.0 : 0.0;
        const double reach[2] = {0.5 * dx + two + 1.0, 0.5 * dy + two + 1.0};
        for (int k = 0; k < 8; k++) { /* in x or y, to either side, within or beyond by a pixel */
            int axis = k % 2, side = k / 2 % 2 ? 1 : -1, within = k / 4;
            fixture f = begin(120, 96);
            synthetic_add(&f.s, 60.0, 48.0, 2e4, dx, dy);
            bst_camera_motion motion = synthetic_motion(&f.s, dx, dy);
            synthetic_expose(&f.s, bst_rng_make_key(14, 0, "test", "locate"), 1);
            int away = (int)floor(reach[axis]) + (within ? 0 : 2);
            int x = 60 + (axis ? 0 : side * away), y = 48 + (axis ? side * away : 0);
            /* a well not much above the streak's pixels of 600 e- */
            f.s.camera.full_well_e = 1000.0;
            f.s.pixels[y * 120 + x] =
                (uint16_t)(f.s.camera.offset_dn + 1000.0 / f.s.camera.gain_e_per_dn);
            f.ip = synthetic_processor(&f.ctx, &f.s);
            bst_imgproc_frame frame = synthetic_frame(&f.s);
            bst_assert_ok(&f.ctx, bst_imgproc_detect(&f.ctx, f.ip, &frame, &motion, f.d, 64));
            const bst_detection *d = near_to(&f, 60.0, 48.0, 3.0);
            assert_int_equal((d->flags & BST_DETECTION_SATURATED) != 0, within);
            end(&f);
        }
    }
}

/* Streaks on one line are one if they share more than half of the shorter one: a streak of 40 px
 * about the origin and one of 10 px share half of it with the middles 20 px apart, two of 40 px
 * with those 20 px apart too; one of 10 and one of 20 px with those 10 px apart. */
static void streaks_of_the_same_light(void **state) {
    (void)state;
    static const struct {
        double first_px, second_px, along_px, across_px;
        bool same;
    } of[] = {{40, 10, 19.9, 0, true},  {40, 10, 20.1, 0, false}, {10, 40, 19.9, 0, true},
              {10, 40, 20.1, 0, false}, {40, 40, 19.9, 0, true},  {40, 40, 20.1, 0, false},
              {20, 10, 9.9, 0, true},   {20, 10, 10.1, 0, false}, {40, 10, 10, 3, false}};
    for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
        bst_imgproc_found found[2] = {{.streak = true, .own_streak = true},
                                      {.streak = true, .own_streak = true}};
        /* along (3, 4) / 5 */
        found[0].source.shape = (bst_imgproc_shape){
            .x_px = 50, .y_px = 50, .dx_px = 0.6 * of[i].first_px, .dy_px = 0.8 * of[i].first_px};
        found[1].source.shape =
            (bst_imgproc_shape){.x_px = 50 + 0.6 * of[i].along_px - 0.8 * of[i].across_px,
                                .y_px = 50 + 0.8 * of[i].along_px + 0.6 * of[i].across_px,
                                .dx_px = -0.6 * of[i].second_px,
                                .dy_px = -0.8 * of[i].second_px};
        bst_imgproc_locator locator = {.found = found, .count = 2};
        bst_locate_frame frame = {.sigma_px = 1.0};
        bst_locate_join_streaks(&locator, &frame);
        assert_false(found[0].dropped);
        if (found[1].dropped != of[i].same) {
            fail_msg("streaks %zu: %s", i, of[i].same ? "two" : "one");
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(edges_in_x_and_y),
        cmocka_unit_test(snr_of_points_and_streaks),
        cmocka_unit_test(what_lies_outside_is_known_to_a_pixel),
        cmocka_unit_test(binned_window_of_streaks),
        cmocka_unit_test(saturated_pixels_within_the_light),
        cmocka_unit_test(streaks_of_the_same_light),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
