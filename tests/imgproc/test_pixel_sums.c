/* The sums by which bad pixels are learned, from evidence that is written here: a steady motion of
 * the sky about a slanted axis, at unequal intervals, with jumps of the boresight along x and along
 * y, predictions, windows and frames without a maximum; against the formulas of the header. */
#include "boresight/vec.h"
#include "imgproc/calibrate/pixel_learner.h"
#include "tests/archive_support.h"
#include "tests/test_support.h"

enum { FRAMES = 14, PIXELS = 4 };

static const double SCALE_RAD = 20.0 * BST_ARCSEC_RAD, RATE_PX = 15.0;

static bst_camera camera_of(int width, int height) {
    return (bst_camera){.width_px = width,
                        .height_px = height,
                        .pixel_scale_arcsec = 20.0,
                        .psf_fwhm_px = 1.8,
                        .full_well_e = 1e5,
                        .gain_e_per_dn = 1.0,
                        .bits = 16};
}

static bst_pixel_learner *learner_of(int width, int height) {
    bst_ctx ctx = {0};
    const bst_camera camera = camera_of(width, height);
    const bst_pixel_learner_config config = {
        .enabled = true, .capacity = 64, .false_alarm_probability = 1e-12};
    bst_pixel_learner *out;
    bst_assert_ok(&ctx, bst_pixel_learner_create(&ctx, &camera, &config, &out));
    return out;
}

/* A frame: time, jump of the boresight from its steady motion along x and y, px, and the window. */
typedef struct look {
    double time_s, jump[2];
    bst_window window;
    bool predicted, missed;
} look;

static const bst_window whole = {0, 0, 90, 90};

static const look looks[FRAMES] = {
    {2.6, {0, 0}, {0, 0, 90, 90}, false, false},   {4.0, {0, 0}, {0, 0, 90, 90}, false, false},
    {4.5, {0, 0}, {0, 0, 90, 90}, false, false},   {6.2, {0, 26}, {0, 0, 90, 90}, false, false},
    {6.6, {0, 26}, {0, 0, 90, 90}, false, false},  {6.7, {0, 26}, {0, 0, 90, 90}, false, false},
    {8.0, {24, 26}, {0, 0, 90, 90}, true, false},  {8.9, {24, 26}, {0, 0, 90, 90}, false, true},
    {9.5, {24, 26}, {0, 0, 90, 90}, false, false}, {10.0, {0, 26}, {0, 0, 90, 30}, false, true},
    {10.6, {0, 26}, {0, 0, 90, 90}, false, false}, {12.9, {0, 2}, {0, 0, 90, 90}, false, false},
    {13.5, {0, 2}, {0, 20, 30, 70}, false, true},  {14.1, {31, 2}, {0, 0, 90, 90}, false, false}};

static bst_quat attitude(const look *l) {
    const bst_quat first = bst_quat_from_rotvec((bst_vec3){0.7, -1.1, 0.4});
    const bst_vec3 axis = bst_vec3_unit((bst_vec3){-0.3, 0.5, 0.6});
    /* a rotation about the line of sight moves nothing there: what is across it moves the sky */
    bst_vec3 sight = bst_quat_rotate(bst_quat_conj(first), (bst_vec3){0, 0, 1});
    double across = bst_vec3_norm(bst_vec3_cross(axis, sight));
    bst_quat steady = bst_quat_mul(first, bst_quat_from_rotvec(bst_vec3_scale(
                                              axis, RATE_PX * SCALE_RAD * l->time_s / across)));
    return bst_quat_mul(
        bst_quat_from_rotvec((bst_vec3){l->jump[0] * SCALE_RAD, l->jump[1] * SCALE_RAD, 0.0}),
        steady);
}

/* Log-likelihood ratio of a shape, with 30 stars of which 2 looked sharp; the kinds of evidence
 * weigh the same, and the largest of five deviations is five times as likely by chance. */
static double shape_of(const bst_sharpness_test *t) {
    const double any = (2.0 + 1.0) / (30.0 + 1000.0);
    const double d[2] = {(double)t->all, (double)t->worst};
    const double alone[2] = {(double)t->all_alone, (double)t->worst_alone}, tries[2] = {1.0, 5.0};
    double ratio = 0.0;
    for (int k = 0; k < 2; k++) {
        double charge = (1.0 - any) * exp(-0.5 * pow(d[k] - alone[k], 2)) + any;
        double light = (1.0 - any) * fmin(1.0, tries[k] * exp(-0.5 * d[k] * d[k])) + any;
        ratio += 0.5 * charge / light;
    }
    return fmax(-5.0, fmin(log(ratio), 5.0));
}

/* A pixel under suspicion by the formulas. */
typedef struct sums {
    int shown, looks;
    double hit, sky, at_rest, jump[2];
    bst_vec3 direction;
} sums;

static bst_vec3 direction_of(const bst_camera *camera, const look *l, int x, int y) {
    return bst_quat_rotate(bst_quat_conj(attitude(l)), bst_camera_unproject(camera, x, y));
}

static void add(sums *s, const bst_camera *camera, const look *l, int x, int y, double q,
                double shape) {
    const bst_window w = l->window;
    if (s->looks == 0) {
        *s = (sums){
            1, 1, 0.0, shape, shape, {l->jump[0], l->jump[1]}, direction_of(camera, l, x, y)};
        return;
    }
    if (x < w.x0 || y < w.y0 || x >= w.x0 + w.width || y >= w.y0 + w.height) {
        return;
    }
    double p = (s->shown + 1.0) / (s->looks + 2.0);
    if (l->missed) {
        s->hit += log((1.0 - p) / (1.0 - q));
        s->sky += log((1.0 - p) / (1.0 - q));
        s->looks++;
        return;
    }
    bst_vec3 now = direction_of(camera, l, x, y);
    if (bst_vec3_angle(now, s->direction) < 3.0 * SCALE_RAD) {
        return;
    }
    bool elsewhere = hypot(l->jump[0] - s->jump[0], l->jump[1] - s->jump[1]) > 10.0;
    s->hit += log(p / q);
    s->sky += log(p / q) + shape;
    s->at_rest += shape + (elsewhere && !l->predicted ? log(p / q) : 0.0);
    s->direction = now;
    s->shown++;
    s->looks++;
    if (elsewhere) {
        s->jump[0] = l->jump[0];
        s->jump[1] = l->jump[1];
    }
}

/* Pixels of several shapes, so that each of the three sums is the least of one of them. */
static void sums_of_the_header(void **state) {
    (void)state;
    static const int size[2][2] = {{60, 90}, {90, 60}};
    /* in order of the pixels */
    static const int place[2][PIXELS][2] = {{{7, 25}, {50, 28}, {11, 84}, {57, 88}},
                                            {{7, 20}, {85, 21}, {28, 41}, {84, 57}}};
    int returns = 0, at_rest = 0; /* how often that sum is the least */
    for (int k = 0; k < 2; k++) {
        const int width = size[k][0], height = size[k][1];
        const bst_camera camera = camera_of(width, height);
        bst_pixel_learner *learner = learner_of(width, height), *other = learner_of(width, height);
        bst_pixel_learner *smaller = learner_of(width, k == 0 ? 85 : 56);
        sums own[PIXELS] = {{0}};
        bst_pixel_show shows[PIXELS];
        for (int i = 0; i < 30; i++) {
            bst_pixel_learner_note_star(learner, i < 2);
        }
        bst_pixel_learner_publish(learner, 0, 0);
        for (int i = 0; i < FRAMES; i++) {
            const look *l = &looks[i];
            const double predicted[2][3] = {{200, 200, 9},
                                            {place[k][0][0] + 3, place[k][0][1] + 2, 4.5}};
            bst_pixel_frame frame = {.q_cam_from_gcrf = attitude(l),
                                     .time_s = l->time_s,
                                     .window = i % 2 ? l->window : whole,
                                     .binning = 1,
                                     .windows = &l->window,
                                     .window_count = i % 2 ? 0 : 1,
                                     .predicted = predicted,
                                     .predicted_count = l->predicted ? 2 : 0};
            bst_pixel_shows evidence = {
                .items = shows, .maxima = 20 + i, .pixels = 400.0, .usable = true};
            const double q = (20.0 + i) / 400.0;
            for (int n = 0; n < PIXELS; n++) {
                const int x = place[k][n][0], y = place[k][n][1];
                bst_pixel_show show = {.pixel = y * width + x,
                                       .sharp = {.all = 1.0f + 0.3f * (float)n,
                                                 .all_alone = 1.2f + 0.4f * (float)n,
                                                 .worst = 1.1f + 0.9f * (float)n,
                                                 .worst_alone = 1.3f + 0.8f * (float)n}};
                look mine = *l;
                mine.predicted = l->predicted && n == 0; /* it covers the first alone */
                add(&own[n], &camera, &mine, x, y, q, shape_of(&show.sharp));
                if (!l->missed) {
                    shows[evidence.count++] = show;
                }
            }
            bst_pixel_learner_update(learner, &frame, &evidence);
            for (int n = 0; n < PIXELS; n++) {
                const sums *s = &own[n];
                double least = fmin(s->hit, fmin(s->sky, s->at_rest));
                assert_true(least < 27.0 && least > -5.0); /* neither bad nor dismissed */
                returns += least < s->sky && least < s->at_rest;
                at_rest += least < s->hit && least < s->sky;
                bst_assert_close(
                    bst_pixel_learner_suspicion(learner, bst_pixel_learner_map(learner, 0),
                                                place[k][n][1] * width + place[k][n][0]),
                    fmax(least, 0.0), 1e-5); /* sums of single precision */
            }
            test_saved saved = test_save((test_archive_fn)bst_pixel_learner_archive, learner);
            bst_ctx ctx = {0};
            bst_assert_ok(
                &ctx, test_restore(&ctx, (test_archive_fn)bst_pixel_learner_archive, other, saved));
            bst_pixel_learner *swap = learner;
            learner = other;
            other = swap;
            if (i == FRAMES - 1) { /* a sensor without the row of the last pixel */
                assert_int_equal(
                    test_restore(&ctx, (test_archive_fn)bst_pixel_learner_archive, smaller, saved),
                    BST_ERR_FORMAT);
                assert_int_equal(bst_pixel_learner_suspects(smaller), 0);
            }
            free(saved.bytes);
        }
        bst_pixel_learner_free(learner);
        bst_pixel_learner_free(other);
        bst_pixel_learner_free(smaller);
    }
    assert_true(returns > 30 && at_rest > 30);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(sums_of_the_header)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
