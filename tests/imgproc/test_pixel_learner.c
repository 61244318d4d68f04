/* Bad pixels learned from frames: a sky that moves, pixels that do not, and a target at rest. */
#include <stdlib.h>

#include "boresight/rng.h"
#include "imgproc/calibrate/pixel_learner.h"
#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

enum { SIDE = 256, STARS = 40, HOT = 40, MOST = 4096 };

static const double TARGET_X = 120.3, TARGET_Y = 133.8;

typedef struct scene {
    bst_ctx ctx;
    synthetic s;
    bst_imgproc *ip;
    bst_pixel_learner *learner;
    bst_detections *d;
    bst_rng_key key;
    int hot[HOT];        /* pixels */
    double hot_e[HOT];   /* their charge */
    double moved_px;     /* of the sky since the first frame */
    double step_px;      /* of the sky from frame to frame */
    double aside_px;     /* of the boresight from its steady motion: moves stars and target */
    double target_e;     /* 0: none */
    double hit_x, hit_y; /* of one radiation hit in the frame */
    int frames;
} scene;

static void begin_with(scene *s, uint64_t seed, double fwhm_px) {
    memset(s, 0, sizeof *s);
    s->key = bst_rng_make_key(seed, 0, "test", "pixels");
    s->d = synthetic_detections(2048);
    synthetic_init(&s->s, SIDE, SIDE);
    s->s.camera.psf_fwhm_px = fwhm_px;
    s->s.config.bad_pixel_learning = (bst_pixel_learner_config){
        .enabled = true, .capacity = MOST, .false_alarm_probability = 1e-5};
    s->s.config.threads = 1;
    s->ip = synthetic_processor(&s->ctx, &s->s);
    bst_assert_ok(&s->ctx, bst_imgproc_collect_shows(&s->ctx, s->ip, MOST));
    bst_assert_ok(&s->ctx, bst_pixel_learner_create(&s->ctx, &s->s.camera,
                                                    &s->s.config.bad_pixel_learning, &s->learner));
    for (int i = 0; i < HOT; i++) {
        /* apart from one another and from the target: one in each square of 36 px */
        double u = bst_rng_uniform(s->key, 1, (uint64_t)(2 * i)),
               v = bst_rng_uniform(s->key, 1, (uint64_t)(2 * i + 1));
        int x = 8 + i % 7 * 36 + (int)(20 * u), y = 8 + i / 7 * 36 + (int)(20 * v);
        s->hot[i] = y * SIDE + x;
        /* from 14 sigma of the noise on, which the filter shows in nearly every frame */
        s->hot_e[i] = synthetic_noise(&s->s) * 14.0 * exp(3.0 * u);
    }
    s->step_px = 5.0;
}

static void begin(scene *s, uint64_t seed) {
    begin_with(s, seed, 2.0);
}

static void end(scene *s) {
    free(s->d);
    bst_pixel_learner_free(s->learner);
    bst_imgproc_free(s->ip);
    synthetic_free(&s->s);
}

/* The next frame of the sensor: `shift` of the telescope's jitter. */
static void draw(scene *s, bst_quat *q) {
    double jitter[2], scale = bst_camera_scale_rad(&s->s.camera);
    bst_rng_normal2(s->key, 2, (uint64_t)s->frames, jitter);
    synthetic_clear(&s->s);
    for (int i = 0; i < STARS; i++) {
        double x = 2.0 * SIDE * bst_rng_uniform(s->key, 3, (uint64_t)(2 * i)),
               y = SIDE * bst_rng_uniform(s->key, 3, (uint64_t)(2 * i + 1));
        synthetic_add(&s->s, fmod(x + s->moved_px + s->aside_px, 2.0 * SIDE) + 0.3 * jitter[0],
                      y + 0.3 * jitter[1], 3000.0 * (1 + i), 0, 0);
    }
    if (s->target_e > 0.0) {
        synthetic_add(&s->s, TARGET_X + s->aside_px + 0.3 * jitter[0], TARGET_Y + 0.3 * jitter[1],
                      s->target_e, 0, 0);
    }
    for (int i = 0; i < HOT; i++) {
        s->s.mean_e[s->hot[i]] += s->hot_e[i];
    }
    s->hit_x = 10 + floor(236 * bst_rng_uniform(s->key, 4, (uint64_t)s->frames));
    s->hit_y = 10 + floor(236 * bst_rng_uniform(s->key, 5, (uint64_t)s->frames));
    s->s.mean_e[(int)s->hit_y * SIDE + (int)s->hit_x] += 800.0;
    synthetic_expose(&s->s, s->key, (uint64_t)(100 + s->frames));
    *q = bst_quat_from_rotvec((bst_vec3){0, (s->moved_px + s->aside_px) * scale, 0});
    s->moved_px += s->step_px;
}

/* Processes the next frame in a window, with binning, and learns from it. */
static void expose(scene *s, bst_window window, int binning) {
    static uint16_t pixels[SIDE * SIDE];
    bst_quat q;
    draw(s, &q);
    int width = window.width / binning, height = window.height / binning;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            int sum = 0;
            for (int k = 0; k < binning * binning; k++) {
                sum += s->s.pixels[(window.y0 + y * binning + k / binning) * SIDE + window.x0 +
                                   x * binning + k % binning] -
                       100;
            }
            pixels[y * width + x] = (uint16_t)(sum + 100);
        }
    }
    bst_imgproc_frame frame = {
        .pixels = pixels, .window = window, .binning = binning, .bits = 16, .exposure_s = 0.5};
    bst_imgproc_use_map(s->ip, bst_pixel_learner_map(s->learner, 0));
    bst_assert_ok(&s->ctx, bst_imgproc_detect(&s->ctx, s->ip, &frame, NULL, s->d, 2048));
    bst_pixel_frame known = {
        .q_cam_from_gcrf = q, .time_s = s->frames, .window = window, .binning = binning};
    bst_pixel_learner_update(s->learner, &known, bst_imgproc_shows(s->ip));
    bst_pixel_learner_publish(s->learner, 0, s->frames);
    s->frames++;
}

static bool is_bad(const scene *s, int pixel) {
    return bst_bad_rows_hold(&bst_pixel_learner_map(s->learner, 0)->rows, pixel);
}

static int learned(const scene *s, int from, int end) {
    int count = 0;
    for (int i = from; i < end; i++) {
        count += is_bad(s, s->hot[i]);
    }
    return count;
}

static const bst_window whole = {0, 0, SIDE, SIDE};

/* All hot pixels are learned in a dozen frames and nothing else: no pixel of the stars that pass,
 * none of the hits, none of the target that the camera follows, which stays a detection. Pixels
 * that recover are forgotten, the others are not. */
static void moving_sky(void **state) {
    (void)state;
    scene s;
    begin(&s, 1);
    s.target_e = 3000.0;
    for (int i = 0; i < 15; i++) {
        expose(&s, whole, 1);
    }
    assert_int_equal(learned(&s, 0, HOT), HOT);
    assert_int_equal(bst_pixel_learner_bad_count(s.learner), HOT);
    for (int i = 0; i < HOT; i++) {
        s.hot_e[i] = i < HOT / 2 ? 0.0 : s.hot_e[i];
    }
    int seen = 0;
    for (int i = 0; i < 100; i++) {
        expose(&s, whole, 1);
        seen += synthetic_nearest(s.d, TARGET_X, TARGET_Y, 2.0) >= 0;
        for (int k = HOT / 2; k < HOT; k++) {
            /* a star may pass there */
            int n = synthetic_nearest(s.d, s.hot[k] % SIDE, s.hot[k] / SIDE, 0.01);
            assert_true(n < 0 || s.d->items[n].label == BST_LABEL_UNKNOWN);
        }
    }
    /* stars that pass hide it for a few frames */
    assert_true(seen > 85);
    for (int i = 0; i < 25; i++) {
        assert_false(is_bad(&s, ((int)TARGET_Y + i / 5 - 2) * SIDE + (int)TARGET_X + i % 5 - 2));
    }
    assert_int_equal(learned(&s, 0, HOT / 2), 0);
    assert_int_equal(learned(&s, HOT / 2, HOT), HOT / 2);
    assert_int_equal(bst_pixel_learner_bad_count(s.learner), HOT / 2);
    end(&s);
}

/* Under a sky at rest nothing is learned, and the learner says that it waits. */
static void sky_at_rest(void **state) {
    (void)state;
    scene s;
    begin(&s, 2);
    s.step_px = 0.0;
    for (int i = 0; i < 20; i++) {
        expose(&s, whole, 1);
        assert_int_equal(bst_pixel_learner_bad_count(s.learner), 0);
        assert_true(i == 0 || bst_pixel_learner_waits(s.learner));
    }
    s.step_px = 5.0;
    for (int i = 0; i < 12; i++) {
        expose(&s, whole, 1);
    }
    assert_int_equal(learned(&s, 0, HOT), HOT);
    end(&s);
}

/* Under a PSF so narrow that shape gives no information, while the boresight goes aside and back
 * again and again, as a search does: bright defects are learned, for they are seen aside as well;
 * the target, at the same pixel whenever the boresight is back, is not. */
static void aside_and_back(void **state) {
    (void)state;
    scene s;
    begin_with(&s, 7, 0.7);
    s.target_e = 500.0;
    for (int i = 0; i < 60; i++) {
        s.aside_px = i % 3 == 2 ? 60.0 : 0.0;
        expose(&s, whole, 1);
    }
    assert_int_equal(learned(&s, 0, HOT), HOT);
    for (int i = 0; i < 25; i++) {
        int pixel = ((int)TARGET_Y + i / 5 - 2) * SIDE + (int)TARGET_X + i % 5 - 2;
        assert_false(is_bad(&s, pixel));
        assert_false(is_bad(&s, pixel + 60));
    }
    assert_int_equal(bst_pixel_learner_bad_count(s.learner), HOT);
    end(&s);
}

/* Targets that fill several pixels, another one after each slew, all at the same place in the
 * frame, because the boresight follows them: their pixels are never suspected. Full pixels in one
 * column, as charge of a defect that blooms, are learned. */
static void full_targets_after_slews(void **state) {
    (void)state;
    scene s;
    begin(&s, 9);
    s.target_e = 4e6;
    const int column = 40 * SIDE + 200;
    double most = 0.0;
    for (int i = 0; i < 40; i++) {
        s.moved_px += i % 8 == 7 ? 50.0 + 3.0 * i : 0.0;
        for (int k = 0; k < 3; k++) {
            s.hot[k] = column + (k - 1) * SIDE;
            s.hot_e[k] = 1e6;
        }
        expose(&s, whole, 1);
        for (int k = 0; k < 81; k++) {
            int pixel = ((int)TARGET_Y + k / 9 - 4) * SIDE + (int)TARGET_X + k % 9 - 4;
            most = fmax(most, bst_pixel_learner_suspicion(
                                  s.learner, bst_pixel_learner_map(s.learner, 0), pixel));
        }
    }
    assert_true(most < 1.0);
    assert_true(is_bad(&s, column - SIDE) || is_bad(&s, column) || is_bad(&s, column + SIDE));
    end(&s);
}

/* Without defects, 120 frames of stars, hits and noise: each pixel under suspicion is taken for bad
 * with a chance of 1e-5 at most, and fewer than 20 of them are new in a frame: 0.03 expected. */
static void no_defects(void **state) {
    (void)state;
    scene s;
    begin(&s, 3);
    memset(s.hot_e, 0, sizeof s.hot_e);
    s.target_e = 180.0; /* SNR 6.5 */
    for (int i = 0; i < 120; i++) {
        expose(&s, whole, 1);
        assert_int_equal(bst_pixel_learner_bad_count(s.learner), 0);
    }
    end(&s);
}

/* What is learned in a window off the sensor's corner, or from binned frames, is left out of whole
 * frames at the sensor's own coordinates, and the other way round. Of a binned pixel all four are
 * left out until frames without binning show which of them are good. */
static void windows_and_binning(void **state) {
    (void)state;
    const bst_window window = {37, 51, 180, 190};
    for (int binning = 1; binning <= 2; binning++) {
        scene s;
        begin(&s, 4 + (uint64_t)binning);
        for (int i = 0; i < 18; i++) {
            expose(&s, window, binning);
        }
        int inside = 0;
        for (int i = 0; i < HOT; i++) {
            int x = s.hot[i] % SIDE, y = s.hot[i] / SIDE;
            bool in = x >= 37 && y >= 51 && x < 37 + 180 && y < 51 + 190;
            assert_int_equal(is_bad(&s, s.hot[i]), in);
            inside += in;
        }
        assert_true(inside > HOT / 3);
        assert_int_equal(bst_pixel_learner_bad_count(s.learner), inside * binning * binning);
        for (int i = 0; i < 60; i++) {
            expose(&s, whole, 1);
        }
        assert_int_equal(bst_pixel_learner_bad_count(s.learner), HOT);
        assert_int_equal(learned(&s, 0, HOT), HOT);
        /* frames with binning leave out what frames without it taught */
        for (int i = 0; i < 5; i++) {
            expose(&s, window, 2);
            for (int k = 0; k < s.d->count; k++) {
                assert_true(s.d->items[k].label != BST_LABEL_HOT_PIXEL ||
                            hypot(s.d->items[k].x_px - s.hit_x, s.d->items[k].y_px - s.hit_y) < 2);
            }
        }
        end(&s);
    }
}

/* More defects than there is room for: the count is bounded, and what is lost is counted. */
static void room_is_bounded(void **state) {
    (void)state;
    scene s;
    begin(&s, 9);
    bst_pixel_learner_free(s.learner);
    s.s.config.bad_pixel_learning.capacity = 16;
    bst_assert_ok(&s.ctx, bst_pixel_learner_create(&s.ctx, &s.s.camera,
                                                   &s.s.config.bad_pixel_learning, &s.learner));
    for (int i = 0; i < 10; i++) {
        expose(&s, whole, 1);
        assert_true(
            bst_pixel_learner_bad_count(s.learner) + bst_pixel_learner_suspects(s.learner) <= 16);
    }
    assert_true(bst_pixel_learner_bad_count(s.learner) > 8);
    assert_true(bst_pixel_learner_lost(s.learner) > 0);
    end(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(moving_sky),
        cmocka_unit_test(sky_at_rest),
        cmocka_unit_test(no_defects),
        cmocka_unit_test(windows_and_binning),
        cmocka_unit_test(room_is_bounded),
        cmocka_unit_test(aside_and_back),
        cmocka_unit_test(full_targets_after_slews),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
