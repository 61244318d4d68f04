/* The tracker in a sky that is turned as a whole, with a camera that is rolled by a right angle:
 * its tracks and attitudes are turned with it and else the same. Detections have covariances of all
 * directions. An axis, or a term off the diagonal, that is treated unlike the others makes a
 * difference. */
#include "tests/tracker/moving_sky.h"

typedef struct twin {
    world w; /* turned: only its stars and outputs are used */
    bst_nav_telemetry nav;
    bst_quat turn, roll; /* of the sky, and of the camera's axes */
} twin;

static bst_vec3 turned(const twin *t, bst_vec3 v) {
    return bst_quat_rotate(t->turn, v);
}

static void open_twin(twin *t, const world *w) {
    bst_ctx ctx = {0};
    memset(t, 0, sizeof *t);
    t->turn = bst_quat_from_rotvec((bst_vec3){1.1, -0.7, 2.0});
    t->roll = bst_quat_from_rotvec((bst_vec3){0, 0, 0.5 * BST_PI});
    t->nav = nav;
    t->nav.velocity_bary_mps = turned(t, nav.velocity_bary_mps);
    t->nav.sun_m = turned(t, nav.sun_m);
    for (int i = 0; i < STARS; i++) {
        t->w.stars[i] = turned(t, w->stars[i]);
    }
    t->w.detections = calloc(1, sizeof *w->detections + ROOM * sizeof(bst_detection));
    t->w.tracks = calloc(1, sizeof *w->tracks + 256 * sizeof(bst_track));
    t->w.predictions = calloc(1, sizeof *w->predictions + 256 * sizeof(bst_prediction));
    bst_tracker_config config;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_tracker_config_table, &config));
    bst_assert_ok(
        &ctx, bst_tracker_create(&ctx, &config, &camera, RATE_HZ, find_star, &t->w, &t->w.tracker));
}

/* Covariances of 0.05 to 0.2 px in all directions. */
static void skew(world *w, int frame) {
    for (int i = 0; i < w->detections->count; i++) {
        bst_detection *d = &w->detections->items[i];
        double a = 0.7 * i + 1.3 * frame, along = 0.01 + 0.03 * (i % 3), across = 0.0025;
        d->cov_xx = along * cos(a) * cos(a) + across * sin(a) * sin(a);
        d->cov_yy = along * sin(a) * sin(a) + across * cos(a) * cos(a);
        d->cov_xy = (along - across) * sin(a) * cos(a);
    }
    /* a displacement of all streaks, 0.1 px at an angle */
    w->detections->shared_xx = 0.009;
    w->detections->shared_xy = -0.003;
    w->detections->shared_yy = 0.002;
}

/* The same detections on the rolled camera: (x, y) about the middle are (-y, x). */
static void roll_detections(const twin *t, const world *w) {
    bst_detections *to = t->w.detections;
    *to = *w->detections;
    memcpy(to->items, w->detections->items, (size_t)to->count * sizeof to->items[0]);
    for (int i = 0; i < to->count; i++) {
        const bst_detection *d = &w->detections->items[i];
        to->items[i].x_px = 511.5 - (d->y_px - 511.5);
        to->items[i].y_px = 511.5 + (d->x_px - 511.5);
        to->items[i].cov_xx = d->cov_yy;
        to->items[i].cov_yy = d->cov_xx;
        to->items[i].cov_xy = -d->cov_xy;
    }
    to->shared_xx = w->detections->shared_yy;
    to->shared_yy = w->detections->shared_xx;
    to->shared_xy = -w->detections->shared_xy;
    bst_quat back = bst_quat_conj(t->turn);
    to->q_telemetry_from_gcrf =
        bst_quat_mul(t->roll, bst_quat_mul(w->detections->q_telemetry_from_gcrf, back));
    to->q_cam_from_gcrf = to->q_telemetry_from_gcrf;
}

static void expect_vec(bst_vec3 found, bst_vec3 expected, double tolerance) {
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(found, expected)), 0.0, tolerance);
}

/* Column of a basis of the tangent plane: east, north. */
static bst_vec3 axis_of(bst_vec3 d, int k) {
    bst_vec3 east = bst_vec3_unit((bst_vec3){-d.y, d.x, 0.0});
    return k == 0 ? east : bst_vec3_cross(d, east);
}

/* Covariance of two components of direction (block 0) or rate (block 1) along given vectors. */
static double along(const bst_track *t, int row, int column, bst_vec3 a, bst_vec3 b) {
    double sum = 0.0;
    for (int i = 0; i < 2; i++) {
        for (int k = 0; k < 2; k++) {
            sum += bst_vec3_dot(a, axis_of(t->direction_gcrf, i)) *
                   t->covariance[2 * row + i][2 * column + k] *
                   bst_vec3_dot(b, axis_of(t->direction_gcrf, k));
        }
    }
    return sum;
}

static void expect_track(const twin *t, const bst_track *a, const bst_track *b) {
    assert_int_equal(b->id, a->id);
    assert_int_equal(b->status, a->status);
    assert_int_equal(b->hits, a->hits);
    assert_int_equal(b->misses_in_row, a->misses_in_row);
    assert_int_equal(b->target_of_interest, a->target_of_interest);
    assert_int_equal(b->uncorrelated, a->uncorrelated);
    bst_assert_close(b->score, a->score, 1e-4);
    bst_assert_close(b->v_mag, a->v_mag, 1e-6);
    expect_vec(b->direction_gcrf, turned(t, a->direction_gcrf), 1e-10);
    expect_vec(b->rate_gcrf_radps, turned(t, a->rate_gcrf_radps), 1e-10);
    bst_vec3 e[2] = {axis_of(a->direction_gcrf, 0), axis_of(a->direction_gcrf, 1)};
    for (int i = 0; i < 4; i++) {
        for (int k = 0; k < 4; k++) {
            double scale = sqrt(a->covariance[i][i] * a->covariance[k][k]);
            bst_assert_close(a->covariance[i][k] / scale, a->covariance[k][i] / scale, 1e-6);
            double same = along(b, i / 2, k / 2, turned(t, e[i % 2]), turned(t, e[k % 2]));
            bst_assert_close(same / scale, a->covariance[i][k] / scale, 1e-4);
        }
    }
}

static void expect_fix(const twin *t, const bst_attitude_fix *a, const bst_attitude_fix *b) {
    assert_int_equal(b->valid, a->valid);
    assert_int_equal(b->stars, a->stars);
    bst_quat q = bst_quat_mul(t->roll, bst_quat_mul(a->q_cam_from_gcrf, bst_quat_conj(t->turn)));
    expect_vec(bst_quat_to_rotvec(bst_quat_mul(b->q_cam_from_gcrf, bst_quat_conj(q))),
               (bst_vec3){0, 0, 0}, 1e-10);
    expect_vec(b->error_cam_rad, bst_quat_rotate(t->roll, a->error_cam_rad), 1e-10);
    bst_assert_close(b->sigma_rad[0], a->sigma_rad[1], 1e-6 * a->sigma_rad[1]);
    bst_assert_close(b->sigma_rad[1], a->sigma_rad[0], 1e-6 * a->sigma_rad[0]);
    bst_assert_close(b->sigma_rad[2], a->sigma_rad[2], 1e-6 * a->sigma_rad[2]);
    bst_assert_close(b->correlation[0], -a->correlation[0], 1e-6);
    bst_assert_close(b->correlation[1], -a->correlation[2], 1e-6);
    bst_assert_close(b->correlation[2], a->correlation[1], 1e-6);
    bst_assert_close(b->rms_px, a->rms_px, 1e-6);
}

/* A displacement that all streaks share is a rotation about the axis across it: a covariance in
 * pixels becomes one of the attitude, and less of the whole is shared by frames. */
static void a_displacement_of_all_streaks_turns_the_camera(void **state) {
    (void)state;
    static const options o = {.sigma_px = 0.1, .pd = 1.0, .frames = 1};
    static const double shift[3] = {0.25, -0.1, 0.06}; /* xx, xy, yy, px^2 */
    const double scale = bst_camera_scale_rad(&camera);
    double xx[2], xy[2], yy[2], shared[2];
    for (int with = 0; with < 2; with++) {
        static world w;
        world_open(&w, 6, &o);
        (void)expose(&w, 0);
        w.detections->shared_xx = with ? shift[0] : 0.0;
        w.detections->shared_xy = with ? shift[1] : 0.0;
        w.detections->shared_yy = with ? shift[2] : 0.0;
        bst_tracker_input input = make_input(&w, 0);
        (void)bst_tracker_step(w.tracker, &input, w.tracks, 256, w.predictions, 256);
        const bst_attitude_fix *fix = &w.tracks->attitude;
        assert_true(fix->valid);
        xx[with] = fix->sigma_rad[0] * fix->sigma_rad[0];
        yy[with] = fix->sigma_rad[1] * fix->sigma_rad[1];
        xy[with] = fix->correlation[0] * fix->sigma_rad[0] * fix->sigma_rad[1];
        shared[with] = fix->shared;
        world_close(&w);
    }
    const double unit = scale * scale; /* rounding: 1e-9 of it */
    bst_assert_close((xx[1] - xx[0]) / unit, shift[2], 1e-9);
    bst_assert_close((yy[1] - yy[0]) / unit, shift[0], 1e-9);
    bst_assert_close((xy[1] - xy[0]) / unit, -shift[1], 1e-9);
    bst_assert_close(shared[1] / shared[0], (xx[0] + yy[0]) / (xx[1] + yy[1]), 1e-9);
}

static void a_turned_sky(void **state) {
    (void)state;
    static const options o = {.sigma_px = 0.1,
                              .pd = 0.9,
                              .false_alarms = 2,
                              .neighbours = 3,
                              .neighbour_rate = {{0.4, 0.1}, {-0.5, 0.3}, {0.1, -0.6}},
                              .starless_from_s = 130,
                              .starless_to_s = 134,
                              .frames = 70};
    static world w;
    static twin t;
    int compared = 0, confirmed = 0, invalid = 0;
    world_open(&w, 4, &o);
    open_twin(&t, &w);
    for (int k = 110; k < 110 + o.frames; k++) { /* the others pass the target at 150 s */
        (void)expose(&w, k);
        skew(&w, k);
        roll_detections(&t, &w);
        bst_tracker_input input = make_input(&w, k), other = make_input(&w, k);
        other.detections = t.w.detections;
        other.nav = &t.nav;
        other.cue.direction_gcrf = turned(&t, input.cue.direction_gcrf);
        other.cue.rate_gcrf_radps = turned(&t, input.cue.rate_gcrf_radps);
        (void)bst_tracker_step(w.tracker, &input, w.tracks, 256, w.predictions, 256);
        (void)bst_tracker_step(t.w.tracker, &other, t.w.tracks, 256, t.w.predictions, 256);
        expect_fix(&t, &w.tracks->attitude, &t.w.tracks->attitude);
        invalid += !w.tracks->attitude.valid;
        assert_int_equal(t.w.tracks->count, w.tracks->count);
        assert_int_equal(t.w.tracks->target_id, w.tracks->target_id);
        for (int i = 0; i < w.tracks->count; i++) {
            expect_track(&t, &w.tracks->items[i], &t.w.tracks->items[i]);
            compared++;
            confirmed += w.tracks->items[i].status != BST_TRACK_TENTATIVE;
        }
        const bst_predictions *p = w.predictions, *q = t.w.predictions;
        assert_int_equal(q->count, p->count);
        expect_vec(q->attitude_error_cam_rad, bst_quat_rotate(t.roll, p->attitude_error_cam_rad),
                   1e-10);
        expect_vec(q->attitude_error_rate_cam_radps,
                   bst_quat_rotate(t.roll, p->attitude_error_rate_cam_radps), 1e-10);
        for (int i = 0; i < p->count; i++) {
            expect_vec(q->items[i].direction_gcrf, turned(&t, p->items[i].direction_gcrf), 1e-10);
            expect_vec(q->items[i].rate_gcrf_radps, turned(&t, p->items[i].rate_gcrf_radps), 1e-10);
        }
    }
    print_message("%d tracks compared, %d confirmed, %d frames without attitude\n", compared,
                  confirmed, invalid);
    assert_true(compared > 250 && confirmed > 100 && invalid >= 4);
    world_close(&w);
    bst_tracker_free(t.w.tracker);
    free(t.w.detections);
    free(t.w.tracks);
    free(t.w.predictions);
}

/* Stars that are vague along columns or along rows leave the attitude about one axis open: either
 * is too little. */
static void both_axes_of_the_attitude_are_needed(void **state) {
    (void)state;
    static const options o = {.sigma_px = 0.1, .pd = 1.0, .frames = 1};
    for (int vague = 0; vague < 3; vague++) {
        static world w;
        world_open(&w, 6, &o);
        (void)expose(&w, 0);
        for (int i = 0; i < w.detections->count; i++) {
            w.detections->items[i].cov_xx = vague == 1 ? 900.0 : 0.01;
            w.detections->items[i].cov_yy = vague == 2 ? 900.0 : 0.01;
        }
        bst_tracker_input input = make_input(&w, 0);
        bst_tracker_outcome outcome =
            bst_tracker_step(w.tracker, &input, w.tracks, 256, w.predictions, 256);
        assert_int_equal(outcome, vague == 0 ? BST_TRACKER_USED : BST_TRACKER_NO_ATTITUDE);
        world_close(&w);
    }
}

/* An object that is a little more vague than max_attitude_sigma_px of 2 px, along columns or along
 * rows, begins no track. */
static void both_axes_of_an_object_are_needed(void **state) {
    (void)state;
    static const options o = {.sigma_px = 0.1, .pd = 1.0, .frames = 1};
    for (int vague = 0; vague < 3; vague++) {
        static world w;
        world_open(&w, 7, &o);
        for (int k = 0; k < 4; k++) {
            (void)expose(&w, k);
            for (int i = 0; i < w.detections->count; i++) {
                bst_detection *d = &w.detections->items[i];
                if (d->label != BST_LABEL_STAR) {
                    d->cov_xx = vague == 1 ? 4.5 : 0.01;
                    d->cov_yy = vague == 2 ? 4.5 : 0.01;
                }
            }
            bst_tracker_input input = make_input(&w, k);
            (void)bst_tracker_step(w.tracker, &input, w.tracks, 256, w.predictions, 256);
        }
        assert_int_equal(w.tracks->count, vague == 0);
        world_close(&w);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_turned_sky),
        cmocka_unit_test(a_displacement_of_all_streaks_turns_the_camera),
        cmocka_unit_test(both_axes_of_the_attitude_are_needed),
        cmocka_unit_test(both_axes_of_an_object_are_needed)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
