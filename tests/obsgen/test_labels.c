/* Labels of generated detections: unlisted stars that rest on the sky, objects that move, charge,
 * and the attitude by which frames are compared. */
#include "obsgen/labels.h"
#include "tests/test_support.h"

enum { SIDE = 600, STARS = 12, UNLISTED = 30, MOVING = 3, MOST = STARS + UNLISTED + MOVING + 1 };

typedef struct sky {
    bst_ctx ctx;
    bst_camera camera;
    bst_discriminator *d;
    bst_truth *truth;
    bst_detections *out;
    bst_obsgen_generated generated[MOST];
    bst_obsgen_labels_frame frame;
} sky;

static sky *make(void) {
    sky *s = test_calloc(1, sizeof *s);
    s->camera = (bst_camera){
        .width_px = SIDE, .height_px = SIDE, .pixel_scale_arcsec = 6, .psf_fwhm_px = 2};
    s->truth = test_calloc(1, sizeof *s->truth + STARS * sizeof s->truth->items[0]);
    s->out = test_calloc(1, sizeof *s->out + MOST * sizeof s->out->items[0]);
    s->frame = (bst_obsgen_labels_frame){.camera = &s->camera,
                                         .truth = s->truth,
                                         .generated = s->generated,
                                         .window = {0, 0, SIDE, SIDE},
                                         .tick_rate_hz = 100};
    bst_assert_ok(&s->ctx, bst_discriminator_create(&s->ctx, &s->camera, MOST, &s->d));
    return s;
}

static void finish(sky *s) {
    bst_discriminator_free(s->d);
    test_free(s->truth);
    test_free(s->out);
    test_free(s);
}

static bst_detection *add(sky *s, double x, double y, int label, int item) {
    s->generated[s->out->count] = (bst_obsgen_generated){.item = item};
    bst_detection *d = &s->out->items[s->out->count++];
    *d = (bst_detection){.x_px = x,
                         .y_px = y,
                         .cov_xx = 0.0016,
                         .cov_yy = 0.0016,
                         .flux_e = 2000,
                         .flux_sigma_e = 50,
                         .snr = 40,
                         .v_mag = 11,
                         .label = label};
    return d;
}

/* Frame number k: the camera turns by 9 px a frame about y, and all light is (3, -2) px from its
 * true mean in the second frame, as in a slew that ends. Labels it. */
static void see(sky *s, int k, bool identified) {
    double scale = bst_camera_scale_rad(&s->camera), off = k == 1;
    s->out->count = 0;
    s->out->stars_identified = identified ? STARS : 0;
    s->truth->count = STARS;
    s->truth->q_cam_from_gcrf_mean = bst_quat_from_rotvec((bst_vec3){0, 9 * k * scale, 0});
    for (int i = 0; i < STARS + UNLISTED + MOVING; i++) {
        double x = 40 + 73.0 * (i % 7) + (i >= STARS + UNLISTED ? 14.0 * k : 0.0);
        double y = 40 + 73.0 * (i / 7), u, v;
        bst_vec3 there = bst_camera_unproject(&s->camera, x, y);
        assert_true(bst_camera_project(
            &s->camera, bst_quat_rotate(s->truth->q_cam_from_gcrf_mean, there), &u, &v));
        int item = i < STARS ? i : -1;
        if (item >= 0) {
            s->truth->items[i] =
                (bst_truth_item){.kind = BST_SOURCE_STAR, .x_centroid_px = u, .y_centroid_px = v};
        }
        int label = item >= 0 && identified ? BST_LABEL_STAR : BST_LABEL_UNKNOWN;
        bst_detection *d = add(s, u + 3 * off, v - 2 * off, label, item);
        d->star_id = label == BST_LABEL_STAR ? (uint32_t)(100 + i) : 0;
    }
    add(s, 300.4 + 11 * k, 570.2 - 7 * k, BST_LABEL_HIT, -1);
    bst_obsgen_label(s->d, &s->frame, s->out);
}

static int count(const sky *s, int first, int number, int label) {
    int sum = 0;
    for (int i = first; i < first + number; i++) {
        sum += s->out->items[i].label == label;
    }
    return sum;
}

/* Stars that no catalogue has are stars from the second frame on, as in images, and what moves
 * among them is an object. A shift that all stars of a frame share is no motion. */
static void unlisted_stars_and_objects(void **state) {
    (void)state;
    sky *s = make();
    for (int k = 0; k < 4; k++) {
        see(s, k, true);
        assert_int_equal(count(s, 0, STARS, BST_LABEL_STAR), STARS);
        assert_int_equal(s->out->items[STARS + UNLISTED + MOVING].label, BST_LABEL_HIT);
        for (int i = 0; i < s->out->count; i++) {
            assert_true(s->out->items[i].label_probability > 0.5);
        }
        if (k > 0) {
            assert_int_equal(count(s, STARS, UNLISTED, BST_LABEL_STAR), UNLISTED);
            assert_int_equal(count(s, STARS + UNLISTED, MOVING, BST_LABEL_OBJECT), MOVING);
        }
    }
    finish(s);
}

/* Without an identified star nothing is known of the sky: only charge has a label. */
static void without_stars(void **state) {
    (void)state;
    sky *s = make();
    s->frame.streak_px = 5;
    for (int k = 0; k < 2; k++) {
        see(s, k, false);
        assert_int_equal(count(s, 0, STARS + UNLISTED + MOVING, BST_LABEL_UNKNOWN),
                         STARS + UNLISTED + MOVING);
        assert_int_equal(s->out->items[STARS + UNLISTED + MOVING].label, BST_LABEL_HIT);
        assert_true(s->out->items[0].label_probability == 0.0);
    }
    finish(s);
}

/* A source at the predicted place of a track, with the aberration of the observer's velocity and
 * the motion since the prediction, is an object where it would be a star. */
static void predicted_tracks(void **state) {
    (void)state;
    sky *s = make();
    double scale = bst_camera_scale_rad(&s->camera);
    bst_predictions *p = test_calloc(1, sizeof *p + sizeof p->items[0]);
    bst_nav_telemetry nav = {.tick = 500, .sun_m = {1.5e11, 0, 0}};
    nav.velocity_bary_mps = (bst_vec3){30000, 0, 0}; /* 20.6 arcsec, 3.4 px */
    see(s, 0, true);
    see(s, 1, true);
    see(s, 2, true);
    const bst_detection target = s->out->items[STARS + 8];
    s->frame.nav = &nav;
    s->frame.predicted = p;
    s->frame.middle_tick = 500;
    p->count = 1;
    p->tick = 300;
    bst_vec3 seen = bst_camera_unproject(&s->camera, target.x_px, target.y_px);
    bst_quat q = s->truth->q_cam_from_gcrf_mean;
    /* against the aberration, and 6 px of motion in two seconds along it */
    bst_vec3 there = bst_quat_rotate(bst_quat_conj(q), seen);
    there = bst_vec3_unit(bst_vec3_axpy(there, -30000 / 299792458.0, (bst_vec3){1, 0, 0}));
    p->items[0].rate_gcrf_radps = (bst_vec3){0, 3 * scale, 0};
    p->items[0].direction_gcrf = bst_vec3_axpy(there, -2, p->items[0].rate_gcrf_radps);
    p->items[0].sigma_rad = 0.1 * scale;
    see(s, 2, true);
    assert_int_equal(s->out->items[STARS + 8].label, BST_LABEL_OBJECT);
    assert_int_equal(count(s, STARS, UNLISTED, BST_LABEL_STAR), UNLISTED - 1);
    test_free(p);
    finish(s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(unlisted_stars_and_objects),
        cmocka_unit_test(without_stars),
        cmocka_unit_test(predicted_tracks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
