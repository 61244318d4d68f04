/* What earlier frames say about a detection: fields of known sources, seen by a turning camera. */
#include <stdlib.h>

#include "imgproc/calibrate/pixel_learner.h"
#include "sim/onboard/discriminate.h"
#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

enum { SIDE = 512, ROOM = 2048 };

typedef struct scene {
    bst_ctx ctx;
    synthetic s;
    bst_discriminator *d;
    bst_detections *out;
    bst_frame_knowledge frame;
    bst_rng_key key;
    int number;
} scene;

static scene make(void) {
    scene s = {.out = synthetic_detections(ROOM), .key = bst_rng_make_key(2, 0, "test", "labels")};
    synthetic_init(&s.s, SIDE, SIDE);
    s.s.camera.psf_fwhm_px = 2;
    bst_assert_ok(&s.ctx, bst_discriminator_create(&s.ctx, &s.s.camera, ROOM, &s.d));
    s.frame = (bst_frame_knowledge){.oriented = true,
                                    .light = {.sun_m = {1.5e11, 0, 0}},
                                    .q_cam_from_gcrf = BST_QUAT_IDENTITY,
                                    .window = {0, 0, SIDE, SIDE}};
    return s;
}

static void end(scene *s) {
    bst_discriminator_free(s->d);
    synthetic_free(&s->s);
    free(s->out);
}

/* The next frame: the camera turned by so many pixels, no detections yet. */
static void next(scene *s, double shift_px) {
    double scale = bst_camera_scale_rad(&s->s.camera);
    s->out->count = 0;
    s->number++;
    s->frame.q_cam_from_gcrf = bst_quat_from_rotvec((bst_vec3){0, s->number * shift_px * scale, 0});
}

static bst_detection *add(scene *s, double x, double y, double v_mag, int label) {
    bst_detection *d = &s->out->items[s->out->count++];
    *d = (bst_detection){.x_px = x,
                         .y_px = y,
                         .cov_xx = 0.01,
                         .cov_yy = 0.01,
                         .flux_e = 1000,
                         .flux_sigma_e = 50,
                         .snr = 20,
                         .v_mag = v_mag,
                         .label = label};
    d->label_probability = label == BST_LABEL_UNKNOWN ? 0 : 1;
    return d;
}

/* A source at a place of the sky given by where the first attitude shows it. */
static bst_detection *add_sky(scene *s, double x, double y, double v_mag) {
    bst_vec3 v = bst_camera_unproject(&s->s.camera, x, y);
    double u, w;
    bst_camera_project(&s->s.camera, bst_quat_rotate(s->frame.q_cam_from_gcrf, v), &u, &w);
    double noise[2];
    bst_rng_normal2(s->key, (uint64_t)s->number, (uint64_t)s->out->count, noise);
    return add(s, u + 0.1 * noise[0], w + 0.1 * noise[1], v_mag, BST_LABEL_UNKNOWN);
}

static void label(scene *s) {
    bst_discriminator_label(s->d, &s->frame, s->out);
    for (int i = 0; i < s->out->count; i++) {
        double p = s->out->items[i].label_probability;
        assert_true(p >= 0 && p <= 1);
    }
}

/* Charge at the same pixel in every frame is a hot pixel; elsewhere each time, hits. */
static void hot_pixels_and_hits(void **state) {
    (void)state;
    scene s = make();
    for (int frame = 0; frame < 4; frame++) {
        next(&s, 30);
        add(&s, 100, 200, 12, BST_LABEL_HOT_PIXEL);
        add(&s, 150 + 7 * frame, 300, 12, BST_LABEL_HOT_PIXEL);
        add(&s, 250.4 + 9 * frame, 310.7, 12, BST_LABEL_HIT);
        /* too faint for its shape to tell, in the last frame */
        add(&s, 400, 400, 14, frame < 3 ? BST_LABEL_HOT_PIXEL : BST_LABEL_UNKNOWN)->snr = 5.5;
        label(&s);
        assert_int_equal(s.out->items[3].label, BST_LABEL_HOT_PIXEL);
        assert_int_equal(s.out->items[0].label, BST_LABEL_HOT_PIXEL);
        assert_int_equal(s.out->items[1].label, frame == 0 ? BST_LABEL_HOT_PIXEL : BST_LABEL_HIT);
        assert_int_equal(s.out->items[2].label, BST_LABEL_HIT);
    }
    assert_true(s.out->items[0].label_probability > 0.95);
    end(&s);
}

/* 300 stars that no catalogue has, of which the faint half shows in two frames of three, and 10
 * objects at 5 px per frame among them; from the fifth frame on the labels are nearly all right. */
static void stars_without_catalogue_and_objects(void **state) {
    (void)state;
    scene s = make();
    int stars = 0, right = 0, objects = 0, right_objects = 0;
    for (int frame = 0; frame < 12; frame++) {
        next(&s, 8);
        for (int k = 0; k < 300; k++) {
            bool faint = k % 2;
            double shows = bst_rng_uniform(s.key, 500 + (uint64_t)frame, (uint64_t)k);
            double x = 150 + 340 * bst_rng_uniform(s.key, 1, (uint64_t)k);
            double y = 10 + 490 * bst_rng_uniform(s.key, 2, (uint64_t)k);
            if (!faint || shows < 0.67) {
                add_sky(&s, x, y, faint ? 15.2 : 12.2);
            }
        }
        int first_object = s.out->count;
        for (int k = 0; k < 10; k++) {
            double x = 180 + 28 * k, angle = k;
            add_sky(&s, x + 5 * frame * cos(angle), 250 + 5 * frame * sin(angle), 12.7);
        }
        label(&s);
        for (int i = 0; frame >= 5 && i < s.out->count; i++) {
            int given = s.out->items[i].label;
            if (i < first_object) {
                stars++;
                right += given == BST_LABEL_STAR;
            } else {
                objects++;
                right_objects += given == BST_LABEL_OBJECT;
            }
        }
    }
    assert_true(right >= 0.98 * stars);
    assert_true(right_objects >= 0.95 * objects);
    end(&s);
}

/* Slower than the errors from frame to frame, but away from where it began: an object in the end.
 */
static void slow_object_leaves_its_place(void **state) {
    (void)state;
    scene s = make();
    int last = 0;
    for (int frame = 0; frame < 12; frame++) {
        next(&s, 3);
        add_sky(&s, 200 + 0.3 * frame, 200, 12);
        add_sky(&s, 300, 300, 12);
        label(&s);
        last = s.out->items[0].label;
    }
    assert_int_equal(last, BST_LABEL_OBJECT);
    assert_int_equal(s.out->items[1].label, BST_LABEL_STAR);
    end(&s);
}

/* A track's prediction names the object even where a star has been; identified stars stay; the edge
 * makes artefacts; without orientation nothing is said. */
static void other_rules(void **state) {
    (void)state;
    scene s = make();
    for (int frame = 0; frame < 3; frame++) {
        next(&s, 0);
        add_sky(&s, 200, 200, 12);
        label(&s);
    }
    assert_int_equal(s.out->items[0].label, BST_LABEL_STAR);
    bst_predictions *p = calloc(1, sizeof *p + sizeof(bst_prediction));
    assert_non_null(p);
    p->count = 1;
    p->items[0] = (bst_prediction){.track_id = 1,
                                   .direction_gcrf = bst_camera_unproject(&s.s.camera, 200, 200)};
    s.frame.predictions = p;
    next(&s, 0);
    add_sky(&s, 200, 200, 12);
    bst_detection *star = add(&s, 400, 400, 9, BST_LABEL_STAR);
    star->star_id = 17;
    add(&s, 1, 300, 9, BST_LABEL_UNKNOWN)->flags = BST_DETECTION_EDGE;
    label(&s);
    assert_int_equal(s.out->items[0].label, BST_LABEL_OBJECT);
    assert_int_equal(s.out->items[1].label, BST_LABEL_STAR);
    assert_int_equal(s.out->items[1].star_id, 17);
    assert_int_equal(s.out->items[2].label, BST_LABEL_ARTEFACT);
    s.frame.predictions = NULL;
    s.frame.oriented = false;
    next(&s, 0);
    add_sky(&s, 200, 200, 12);
    label(&s);
    assert_int_equal(s.out->items[0].label, BST_LABEL_UNKNOWN);
    free(p);
    end(&s);
}

/* Stars draw streaks while the camera follows something else: points are no stars. */
static void following_something(void **state) {
    (void)state;
    scene s = make();
    s.frame.streak_px = 12;
    for (int frame = 0; frame < 3; frame++) {
        next(&s, 20);
        add_sky(&s, 300, 200, 12)->flags = BST_DETECTION_STREAK;
        add(&s, 256, 256, 12, BST_LABEL_UNKNOWN);
        label(&s);
        assert_int_equal(s.out->items[0].label, BST_LABEL_STAR);
        assert_int_equal(s.out->items[1].label, BST_LABEL_OBJECT);
    }
    end(&s);
}

/* Stars are points: a new source drawn across the frame is none, whatever else new ones were; what
 * is little longer than wide (two stars that touch) may be. */
static void drawn_among_points(void **state) {
    (void)state;
    scene s = make();
    for (int frame = 0; frame < 3; frame++) {
        next(&s, 2);
        for (int k = 0; k < 400; k++) {
            add_sky(&s, 30 + k % 20 * 22, 30 + k / 20 * 22, 12);
        }
        bst_detection *streak = add(&s, 100 + 90 * frame, 41, 12, BST_LABEL_UNKNOWN);
        streak->flags = BST_DETECTION_STREAK;
        streak->width_px = 2;
        streak->length_px = 10;
        bst_detection *pair = add_sky(&s, 173, 173, 12);
        pair->flags = BST_DETECTION_STREAK;
        pair->width_px = 2;
        pair->length_px = 3.5;
        label(&s);
        assert_int_equal(s.out->items[400].label, BST_LABEL_OBJECT);
        assert_true(s.out->items[400].label_probability > 0.9);
        assert_int_equal(s.out->items[401].label, BST_LABEL_STAR);
    }
    end(&s);
}

static double suspicion_of(const void *user, int32_t pixel) {
    return bst_pixel_learner_suspicion(user, bst_pixel_learner_map(user, 0), pixel);
}

/* A source on a pixel that learning suspects is a hot pixel before the pixel is bad, and no more
 * once the map leaves it out: what shows there then is light about it. */
static void suspected_pixels(void **state) {
    (void)state;
    scene s = make();
    const bst_pixel_learner_config config = {
        .enabled = true, .capacity = 64, .false_alarm_probability = 1e-5};
    bst_pixel_learner *learner;
    bst_assert_ok(&s.ctx, bst_pixel_learner_create(&s.ctx, &s.s.camera, &config, &learner));
    bst_pixel_show show = {.pixel = 200 * SIDE + 300, .sharp = {6, 6, 6, 6}};
    const bst_pixel_shows shows = {
        .items = &show, .count = 1, .maxima = 20, .usable = true, .pixels = SIDE * SIDE};
    s.frame.suspicion = suspicion_of;
    s.frame.suspicion_user = learner;
    for (int frame = 0; frame < 5; frame++) {
        next(&s, 7);
        bst_detection *d = add(&s, 300.2, 199.8, 12, BST_LABEL_UNKNOWN);
        bst_detection *other = add(&s, 302.2, 199.8, 12, BST_LABEL_UNKNOWN);
        const bst_pixel_frame f = {.q_cam_from_gcrf = s.frame.q_cam_from_gcrf,
                                   .time_s = frame,
                                   .window = s.frame.window,
                                   .binning = 1};
        bst_pixel_learner_update(learner, &f, &shows);
        label(&s);
        /* shapes bring 5 each, a return ln((2/3) / (20 / 512^2)) = 9.1 against hits: 10 > 5.3 of
         * two maxima, 15 > 11.5 of three */
        bool bad = frame >= 2;
        assert_int_equal(bst_pixel_learner_bad_count(learner), bad);
        assert_int_equal(d->label == BST_LABEL_HOT_PIXEL, frame >= 1 && frame < 4);
        assert_int_not_equal(other->label, BST_LABEL_HOT_PIXEL);
        if (frame == 3) {
            bst_pixel_learner_publish(learner, 0, frame);
        }
    }
    bst_pixel_learner_free(learner);
    end(&s);
}

/* Charge of one frame is remembered for eight frames that cover its pixel without charge, and for
 * any number of frames whose windows leave its column or its row out; on sensors that are wider
 * than high and the other way round. A pixel beside it holds no charge of it. */
static void charge_outside_of_windows(void **state) {
    (void)state;
    static const struct {
        int width, height, x, y; /* of the sensor and of the charge */
        bst_window other;        /* leaves it out */
    } all[] = {{90, 60, 80, 12, {0, 0, 70, 60}},   {90, 60, 80, 12, {0, 15, 90, 45}},
               {60, 90, 11, 77, {0, 0, 60, 70}},   {60, 90, 11, 77, {14, 0, 46, 90}},
               {60, 90, 50, 83, {20, 10, 31, 73}}, {90, 60, 33, 55, {34, 10, 50, 50}}};
    for (size_t k = 0; k < sizeof all / sizeof all[0]; k++) {
        for (int covered = 0; covered <= 1; covered++) {
            for (int frames = 7; frames <= 8; frames++) {
                scene s = make();
                bst_camera camera = s.s.camera;
                camera.width_px = all[k].width;
                camera.height_px = all[k].height;
                bst_discriminator_free(s.d);
                bst_assert_ok(&s.ctx, bst_discriminator_create(&s.ctx, &camera, ROOM, &s.d));
                const bst_window whole = {0, 0, all[k].width, all[k].height};
                s.frame.oriented = false;
                s.frame.window = whole;
                next(&s, 0.0);
                add(&s, all[k].x + 0.2, all[k].y - 0.3, 12, BST_LABEL_HIT);
                label(&s);
                for (int i = 0; i < frames; i++) {
                    s.frame.window = covered ? whole : all[k].other;
                    next(&s, 0.0);
                    label(&s);
                }
                s.frame.window = whole;
                next(&s, 0.0);
                const bst_detection *d = add(&s, all[k].x - 0.4, all[k].y + 0.1, 12, BST_LABEL_HIT);
                const bst_detection *beside =
                    add(&s, all[k].x - 5.0, all[k].y - 4.0, 12, BST_LABEL_HIT);
                label(&s);
                bool forgotten = covered && frames == 8;
                assert_int_equal(d->label, forgotten ? BST_LABEL_HIT : BST_LABEL_HOT_PIXEL);
                assert_int_equal(beside->label, BST_LABEL_HIT);
                end(&s);
            }
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(hot_pixels_and_hits),
        cmocka_unit_test(charge_outside_of_windows),
        cmocka_unit_test(suspected_pixels),
        cmocka_unit_test(stars_without_catalogue_and_objects),
        cmocka_unit_test(slow_object_leaves_its_place),
        cmocka_unit_test(other_rules),
        cmocka_unit_test(following_something),
        cmocka_unit_test(drawn_among_points),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
