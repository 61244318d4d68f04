/* The predicates that assertions use tell a valid value from each kind of invalid one. */
#include <stdlib.h>

#include "sim/core/invariant.h"
#include "sim/messages/message_invariants.h"
#include "tests/test_support.h"

#ifdef NDEBUG
#error "assertions are on in every build: take -DNDEBUG from the compiler's flags"
#endif

static void unit_vectors_and_quaternions(void **state) {
    (void)state;
    bst_vec3 v = {0.6, 0.0, 0.8};
    assert_true(bst_is_unit_vec3(v, BST_UNIT_TOLERANCE));
    /* 1e-9 of the norm is 2e-9 of its square */
    assert_true(bst_is_unit_vec3(bst_vec3_scale(v, 1.0 + 0.9e-9), BST_UNIT_TOLERANCE));
    assert_false(bst_is_unit_vec3(bst_vec3_scale(v, 1.0 + 1.1e-9), BST_UNIT_TOLERANCE));
    assert_false(bst_is_unit_vec3(bst_vec3_scale(v, 1.0 - 1.1e-9), BST_UNIT_TOLERANCE));
    assert_false(bst_is_unit_vec3((bst_vec3){NAN, 0.0, 0.0}, BST_UNIT_TOLERANCE));
    assert_true(bst_is_unit_quat((bst_quat){0.5, -0.5, 0.5, -0.5}, BST_UNIT_TOLERANCE));
    assert_false(bst_is_unit_quat((bst_quat){0.5, 0.5, 0.5, 0.6}, BST_UNIT_TOLERANCE));
    assert_false(bst_is_unit_quat((bst_quat){0.0, 0.0, 0.0, INFINITY}, BST_UNIT_TOLERANCE));
    assert_true(bst_is_finite_vec3(v));
    assert_false(bst_is_finite_vec3((bst_vec3){0.0, -INFINITY, 0.0}));
}

static void numbers(void **state) {
    (void)state;
    assert_true(bst_is_variance(0.0) && !bst_is_variance(-1e-300) && !bst_is_variance(INFINITY));
    assert_true(bst_is_positive(1e-300) && !bst_is_positive(0.0) && !bst_is_positive(NAN));
    assert_true(bst_is_share(0.0) && bst_is_share(1.0));
    assert_true(!bst_is_share(-0.1) && !bst_is_share(1.1) && !bst_is_share(NAN));
    const double rising[] = {1.0, 1.0, 2.0}, falling[] = {1.0, 2.0, 1.5}, broken[] = {1.0, NAN};
    assert_true(bst_is_ascending(rising, 3) && bst_is_ascending(falling, 2));
    assert_false(bst_is_ascending(falling, 3));
    assert_false(bst_is_ascending(broken, 2));
    double p[4] = {1.0, -2.0, -2.0, 0.0};
    assert_true(bst_is_covariance(p, 2));
    p[3] = -1e-12;
    assert_false(bst_is_covariance(p, 2));
    p[3] = 1.0;
    p[1] = NAN;
    assert_false(bst_is_covariance(p, 2));
}

/* Each of the listed values of type `type` makes a message invalid if it is `bad` alone. */
#define EACH_REFUSED(type, valid, bad, ...)                           \
    do {                                                              \
        type *const fields[] = {__VA_ARGS__};                         \
        for (size_t i = 0; i < sizeof fields / sizeof *fields; i++) { \
            const type kept = *fields[i];                             \
            assert_true(valid);                                       \
            *fields[i] = (bad);                                       \
            assert_false(valid);                                      \
            *fields[i] = kept;                                        \
        }                                                             \
        assert_true(valid);                                           \
    } while (0)

/* The components of a vector or a quaternion. */
#define XYZ(v) &(v).x, &(v).y, &(v).z
#define XYZW(q) XYZ(q), &(q).w

/* Every number of a detection and its frame, by itself. */
static void each_number_of_detections(void **state) {
    (void)state;
    bst_detections *d = calloc(1, sizeof *d + 2 * sizeof d->items[0]);
    d->q_cam_from_gcrf = d->q_telemetry_from_gcrf = BST_QUAT_IDENTITY;
    d->count = 2;
    d->shared_xx = 4.0;
    d->shared_yy = 9.0;
    d->calibration = (bst_camera_calibration){.frames = 1, .scale = 1.0};
    bst_detection *item = &d->items[1];
    bst_camera_calibration *c = &d->calibration;
    EACH_REFUSED(double, bst_detections_are_valid(d, 2), NAN, XYZW(d->q_cam_from_gcrf),
                 XYZW(d->q_telemetry_from_gcrf), &d->shared_xx, &d->shared_xy, &d->shared_yy,
                 &item->x_px, &item->y_px, &item->cov_xx, &item->cov_xy, &item->cov_yy,
                 &item->flux_e, &item->flux_sigma_e, &item->snr, &item->length_px, &item->width_px,
                 &item->label_probability, &c->scale, &c->rotation_rad, &c->k1, &c->p1, &c->p2,
                 &c->covariance[0][4], &c->covariance[4][3]);
    EACH_REFUSED(double, bst_detections_are_valid(d, 2), -1e-9, &d->shared_xx, &d->shared_yy,
                 &item->cov_xx, &item->cov_yy, &item->flux_sigma_e, &item->length_px,
                 &item->width_px, &item->label_probability, &c->scale, &c->covariance[3][3]);
    EACH_REFUSED(int32_t, bst_detections_are_valid(d, 2), -1, &d->stars_identified, &d->windows,
                 &d->bad_pixels, &d->lost, &d->count, &item->label, &c->frames);
    /* |xy| <= 2 * 3 */
    d->shared_xy = -6.0;
    assert_true(bst_detections_are_valid(d, 2));
    EACH_REFUSED(double, bst_detections_are_valid(d, 2), 6.1, &d->shared_xy);
    EACH_REFUSED(double, bst_detections_are_valid(d, 2), -6.1, &d->shared_xy);
    c->frames = 0; /* then nothing else of it counts */
    c->k1 = NAN;
    assert_true(bst_detections_are_valid(d, 2));
    free(d);
}

/* The same of tracks, live and smoothed, of predictions and of identities. */
static void each_number_of_tracks(void **state) {
    (void)state;
    bst_tracks *t = calloc(1, sizeof *t + 2 * sizeof t->items[0]);
    t->count = 2;
    t->items[0] = t->items[1] = (bst_track){.id = 1, .direction_gcrf = {0.0, 0.6, 0.8}};
    t->attitude = (bst_attitude_fix){.valid = true, .q_cam_from_gcrf = BST_QUAT_IDENTITY};
    bst_track *k = &t->items[1];
    bst_attitude_fix *a = &t->attitude;
    EACH_REFUSED(double, bst_tracks_are_valid(t, 2), NAN, &t->clock_offset_s, &t->clock_sigma_s,
                 XYZW(a->q_cam_from_gcrf), &a->sigma_rad[0], &a->sigma_rad[1], &a->sigma_rad[2],
                 &a->correlation[0], &a->correlation[1], &a->correlation[2], &a->shared,
                 XYZ(k->direction_gcrf), XYZ(k->rate_gcrf_radps), &k->covariance[0][3],
                 &k->covariance[3][2]);
    EACH_REFUSED(double, bst_tracks_are_valid(t, 2), -1.1, &t->clock_sigma_s, &a->sigma_rad[0],
                 &a->sigma_rad[1], &a->sigma_rad[2], &a->correlation[0], &a->correlation[1],
                 &a->correlation[2], &a->shared, &k->covariance[1][1]);
    EACH_REFUSED(double, bst_tracks_are_valid(t, 2), INFINITY, &t->clock_offset_s,
                 &t->clock_sigma_s);
    EACH_REFUSED(int32_t, bst_tracks_are_valid(t, 2), -1, &t->at_rest, &t->count, &t->lost,
                 &a->stars, &k->status, &k->hits, &k->misses_in_row, &k->hidden);
    EACH_REFUSED(int32_t, bst_tracks_are_valid(t, 2), 99, &t->count, &k->status, &k->hidden);
    EACH_REFUSED(int64_t, bst_tracks_are_valid(t, 2), -1, &t->target_id, &k->id,
                 &k->last_update_tick);
    free(t);
    bst_tracks_smoothed *s = calloc(1, sizeof *s + 2 * sizeof s->items[0]);
    s->count = 2;
    s->items[0] = s->items[1] = (bst_track_smoothed){.id = 1, .direction_gcrf = {0.6, 0.8, 0.0}};
    bst_track_smoothed *m = &s->items[1];
    EACH_REFUSED(double, bst_tracks_smoothed_are_valid(s, 2), NAN, XYZ(m->direction_gcrf),
                 XYZ(m->rate_gcrf_radps), &m->covariance[0][3], &m->covariance[3][3]);
    EACH_REFUSED(int32_t, bst_tracks_smoothed_are_valid(s, 2), -1, &m->status, &m->later_frames,
                 &s->count, &s->lost);
    EACH_REFUSED(int64_t, bst_tracks_smoothed_are_valid(s, 2), 0, &m->id);
    free(s);
    bst_predictions *p = calloc(1, sizeof *p + 2 * sizeof p->items[0]);
    p->count = 2;
    p->attitude_valid = true;
    p->items[0] = p->items[1] = (bst_prediction){.track_id = 1, .direction_gcrf = {0.6, 0.0, 0.8}};
    bst_prediction *n = &p->items[1];
    EACH_REFUSED(double, bst_predictions_are_valid(p, 2), NAN, XYZ(p->attitude_error_cam_rad),
                 XYZ(p->attitude_error_rate_cam_radps), XYZ(n->direction_gcrf),
                 XYZ(n->rate_gcrf_radps), &n->sigma_rad);
    EACH_REFUSED(int64_t, bst_predictions_are_valid(p, 2), 0, &n->track_id);
    p->attitude_valid = false;
    p->attitude_error_cam_rad.y = NAN;
    assert_true(bst_predictions_are_valid(p, 2));
    free(p);
    bst_track_identities *q = calloc(1, sizeof *q + 2 * sizeof q->items[0]);
    q->count = 2;
    q->items[0] = q->items[1] = (bst_track_identity){.track_id = 1, .object = -1};
    EACH_REFUSED(double, bst_track_identities_are_valid(q, 2), 1.1, &q->items[1].probability);
    EACH_REFUSED(int32_t, bst_track_identities_are_valid(q, 2), -2, &q->items[1].object, &q->lost);
    EACH_REFUSED(int64_t, bst_track_identities_are_valid(q, 2), 0, &q->items[1].track_id);
    free(q);
}

/* The same of the true states of a frame. */
static void each_number_of_truth(void **state) {
    (void)state;
    bst_truth *t = calloc(1, sizeof *t + 2 * sizeof t->items[0]);
    t->q_cam_from_gcrf_mid = t->q_cam_from_gcrf_mean = BST_QUAT_IDENTITY;
    t->count = 2;
    t->items[0].kind = BST_SOURCE_STAR;
    t->items[0].sunlit_fraction = NAN; /* a star has none */
    t->items[1].kind = BST_SOURCE_OBJECT;
    bst_truth_item *k = &t->items[1];
    EACH_REFUSED(double, bst_truth_is_valid(t, 2), NAN, XYZW(t->q_cam_from_gcrf_mid),
                 XYZW(t->q_cam_from_gcrf_mean), XYZ(t->observer_gcrf_m), &t->background_e,
                 &t->dark_e, &t->earth_fraction, &t->moon_fraction, &t->sun_fraction, &k->electrons,
                 &k->snr, &k->sunlit_fraction);
    EACH_REFUSED(double, bst_truth_is_valid(t, 2), -0.1, &t->background_e, &t->dark_e,
                 &t->earth_fraction, &t->moon_fraction, &t->sun_fraction, &k->electrons, &k->snr,
                 &k->sunlit_fraction);
    EACH_REFUSED(double, bst_truth_is_valid(t, 2), 1.1, &t->earth_fraction, &t->moon_fraction,
                 &t->sun_fraction, &k->sunlit_fraction);
    EACH_REFUSED(int32_t, bst_truth_is_valid(t, 2), -1, &t->hits, &t->count, &t->lost, &k->kind);
    EACH_REFUSED(int64_t, bst_truth_is_valid(t, 2), -1, &t->nodes, &t->end_tick);
    free(t);
}

/* The same of the mount, navigation, wheels, and what was measured of the pointing. */
static void each_number_of_the_platform(void **state) {
    (void)state;
    bst_mount_status m = {.axes = 2,
                          .q_body_from_cam_at_zero = BST_QUAT_IDENTITY,
                          .q_body_from_gcrf = BST_QUAT_IDENTITY,
                          .axis = {{.axis_body = {0.0, 0.0, 1.0}}, {.axis_body = {0.6, 0.8, 0.0}}}};
    bst_mount_axis *a = &m.axis[1];
    EACH_REFUSED(double, bst_mount_status_is_valid(&m), NAN, XYZW(m.q_body_from_cam_at_zero),
                 XYZW(m.q_body_from_gcrf), XYZ(m.rate_body_radps), XYZ(a->axis_body), &a->angle_rad,
                 &a->rate_radps, &a->rate_limit_radps, &a->accel_limit_radps2, &a->min_rad,
                 &a->max_rad);
    EACH_REFUSED(double, bst_mount_status_is_valid(&m), -0.1, &a->rate_limit_radps,
                 &a->accel_limit_radps2, &a->max_rad);
    EACH_REFUSED(int32_t, bst_mount_status_is_valid(&m), -1, &m.axes);
    EACH_REFUSED(int32_t, bst_mount_status_is_valid(&m), BST_MOUNT_AXES + 1, &m.axes);
    bst_nav_telemetry n = {0};
    EACH_REFUSED(double, bst_nav_telemetry_is_valid(&n), NAN, XYZ(n.position_gcrf_m),
                 XYZ(n.velocity_gcrf_mps), XYZ(n.velocity_bary_mps), XYZ(n.sun_m), XYZ(n.moon_m));
    bst_wheel_status *w = calloc(1, sizeof *w + 2 * sizeof w->items[0]);
    w->count = 2;
    bst_wheel_state *s = &w->items[1];
    EACH_REFUSED(double, bst_wheel_status_is_valid(w, 2), NAN, &s->speed_radps,
                 &s->speed_limit_radps, &s->motor_nm, &s->motor_limit_nm);
    EACH_REFUSED(double, bst_wheel_status_is_valid(w, 2), -0.1, &s->speed_limit_radps,
                 &s->motor_limit_nm);
    s->speed_radps = s->motor_nm = -1.0;
    assert_true(bst_wheel_status_is_valid(w, 2));
    assert_false(bst_wheel_status_is_valid(w, 1));
    free(w);
    bst_pointing_telemetry *p = calloc(1, sizeof *p + 2 * sizeof p->items[0]);
    p->capacity = 2;
    p->written = 3; /* the newest sample is the first of the ring */
    p->q_body_from_gcrf = BST_QUAT_IDENTITY;
    p->items[0] = p->items[1] = (bst_pointing_sample){.q_cam_from_gcrf = BST_QUAT_IDENTITY};
    p->items[0].tick = 1;
    EACH_REFUSED(double, bst_pointing_telemetry_is_valid(p), NAN, XYZW(p->q_body_from_gcrf),
                 XYZW(p->items[0].q_cam_from_gcrf), &p->items[0].axis_rad[0],
                 &p->items[0].axis_rad[1]);
    EACH_REFUSED(int64_t, bst_pointing_telemetry_is_valid(p), 0, &p->items[0].tick, &p->written);
    p->items[1].axis_rad[0] = NAN; /* of the sample before only the time counts */
    assert_true(bst_pointing_telemetry_is_valid(p));
    free(p);
}

/* The same of commands, tasks and windows. */
static void each_number_of_commands(void **state) {
    (void)state;
    bst_los_command c = {.direction_gcrf = {0.0, 0.6, 0.8}, .near_given = true, .roll_given = true};
    EACH_REFUSED(double, bst_los_command_is_valid(&c), NAN, XYZ(c.direction_gcrf),
                 XYZ(c.rate_gcrf_radps), XYZ(c.accel_gcrf_radps2), &c.roll_rad, &c.near_rad[0],
                 &c.near_rad[1], &c.near_rad[2], &c.near_radps[0], &c.near_radps[1],
                 &c.near_radps[2]);
    c.near_given = c.roll_given = false;
    c.near_rad[1] = c.roll_rad = NAN;
    assert_true(bst_los_command_is_valid(&c));
    bst_sensor_command s = {0};
    EACH_REFUSED(double, bst_sensor_command_is_valid(&s), NAN, &s.exposure_s, &s.period_s,
                 &s.pixel_scale_arcsec);
    EACH_REFUSED(int, bst_sensor_command_is_valid(&s), -1, &s.binning, &s.window.width);
    bst_control_status o = {0};
    EACH_REFUSED(int32_t, bst_control_status_is_valid(&o), -1, &o.mode, &o.search_step);
    EACH_REFUSED(int32_t, bst_control_status_is_valid(&o), BST_MODE_COUNT, &o.mode);
    EACH_REFUSED(int64_t, bst_control_status_is_valid(&o), -1, &o.target_id);
    bst_task t = {.object = -1};
    EACH_REFUSED(double, bst_task_is_valid(&t), -0.1, &t.sigma_rad, &t.rate_sigma_radps,
                 &t.v_mag_sigma, &t.snr);
    EACH_REFUSED(double, bst_task_is_valid(&t), NAN, &t.sigma_rad, &t.rate_sigma_radps,
                 &t.v_mag_sigma, &t.snr);
    EACH_REFUSED(int32_t, bst_task_is_valid(&t), -2, &t.object, &t.before);
    EACH_REFUSED(int64_t, bst_task_is_valid(&t), -1, &t.id);
    bst_frame_message f = {.window = {0, 0, 1, 1}, .binning = 1, .bits = 8};
    EACH_REFUSED(int, bst_frame_message_is_valid(&f), 0, &f.window.width, &f.window.height,
                 &f.binning);
    EACH_REFUSED(int, bst_frame_message_is_valid(&f), 7, &f.bits);
    EACH_REFUSED(int, bst_frame_message_is_valid(&f), 17, &f.bits);
    EACH_REFUSED(int64_t, bst_frame_message_is_valid(&f), -1, &f.exposure_id, &f.end_tick);
    EACH_REFUSED(int, bst_window_is_valid(&f.window), -1, &f.window.x0, &f.window.y0);
    bst_regions_of_interest *r = calloc(1, sizeof *r + 2 * sizeof r->items[0]);
    r->count = 2;
    r->items[0].window = r->items[1].window = (bst_window){0, 0, 1, 1};
    r->items[1].reason = BST_REGION_STAR;
    bst_searched_window *w = &r->items[1];
    EACH_REFUSED(double, bst_regions_of_interest_are_valid(r, 2), NAN, &w->x_px, &w->y_px);
    EACH_REFUSED(int32_t, bst_regions_of_interest_are_valid(r, 2), 99, &r->count, &w->number,
                 &w->reason);
    EACH_REFUSED(int32_t, bst_regions_of_interest_are_valid(r, 2), -1, &r->count, &w->number,
                 &w->reason);
    EACH_REFUSED(int32_t, bst_regions_of_interest_are_valid(r, 2), 2, &w->number);
    EACH_REFUSED(int64_t, bst_regions_of_interest_are_valid(r, 2), -1, &w->track_id,
                 &r->exposure_id, &r->end_tick);
    free(r);
}

static void detections(void **state) {
    (void)state;
    bst_detections *d = calloc(1, sizeof *d + 2 * sizeof d->items[0]);
    d->q_cam_from_gcrf = d->q_telemetry_from_gcrf = BST_QUAT_IDENTITY;
    d->count = 2;
    assert_true(bst_detections_are_valid(d, 2));
    assert_false(bst_detections_are_valid(d, 1));
    d->items[1].cov_yy = -1e-9;
    assert_false(bst_detections_are_valid(d, 2));
    d->items[1].cov_yy = 0.0;
    d->items[1].label = BST_LABEL_HIT + 1;
    assert_false(bst_detections_are_valid(d, 2));
    d->items[1].label = BST_LABEL_HIT;
    d->items[1].x_px = NAN;
    assert_false(bst_detections_are_valid(d, 2));
    d->items[1].x_px = 0.0;
    d->start_tick = 1;
    assert_false(bst_detections_are_valid(d, 2));
    d->end_tick = 1;
    assert_true(bst_detections_are_valid(d, 2));
    free(d);
}

static void tracks(void **state) {
    (void)state;
    bst_tracks *t = calloc(1, sizeof *t + sizeof t->items[0]);
    t->count = 1;
    t->items[0] = (bst_track){.id = 1, .direction_gcrf = {0.0, 0.0, 1.0}};
    assert_true(bst_tracks_are_valid(t, 1));
    t->items[0].covariance[2][2] = -1e-20;
    assert_false(bst_tracks_are_valid(t, 1));
    t->items[0].covariance[2][2] = 0.0;
    t->items[0].status = BST_TRACK_COASTING + 1;
    assert_false(bst_tracks_are_valid(t, 1));
    t->items[0].status = BST_TRACK_COASTING;
    t->items[0].direction_gcrf.z = 0.9;
    assert_false(bst_tracks_are_valid(t, 1));
    t->count = 0;
    t->attitude = (bst_attitude_fix){.valid = true, .q_cam_from_gcrf = BST_QUAT_IDENTITY};
    assert_true(bst_tracks_are_valid(t, 1));
    t->attitude.sigma_rad[1] = NAN;
    assert_false(bst_tracks_are_valid(t, 1));
    free(t);
}

static void rings_of_attitudes(void **state) {
    (void)state;
    bst_los_history *h = calloc(1, sizeof *h + 2 * sizeof h->items[0]);
    h->capacity = 2;
    assert_false(bst_los_history_is_valid(h)); /* nothing was written */
    for (int i = 0; i < 2; i++) {
        h->items[i] = (bst_los_sample){.tick = i, .q_cam_from_gcrf = BST_QUAT_IDENTITY};
    }
    h->written = 2;
    assert_true(bst_los_history_is_valid(h));
    h->written = 3; /* tick 0 after tick 1 */
    assert_false(bst_los_history_is_valid(h));
    h->items[0].tick = 2;
    assert_true(bst_los_history_is_valid(h));
    h->items[0].q_cam_from_gcrf.w = 1.001;
    assert_false(bst_los_history_is_valid(h));
    free(h);
}

static void commands_and_windows(void **state) {
    (void)state;
    bst_los_command c = {.direction_gcrf = {1.0, 0.0, 0.0}};
    assert_true(bst_los_command_is_valid(&c));
    c.rate_gcrf_radps.y = NAN;
    assert_false(bst_los_command_is_valid(&c));
    bst_exposure e = {.window = {0, 0, 4, 4}, .binning = 1, .end_tick = 5};
    assert_true(bst_exposure_is_valid(&e));
    e.start_tick = 6;
    assert_false(bst_exposure_is_valid(&e));
    e.start_tick = 0;
    e.window.x0 = -1;
    assert_false(bst_exposure_is_valid(&e));
    bst_task task = {.object = -1};
    assert_true(bst_task_is_valid(&task));
    task.before = BST_TASK_END_COUNT;
    assert_false(bst_task_is_valid(&task));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(unit_vectors_and_quaternions),
        cmocka_unit_test(numbers),
        cmocka_unit_test(detections),
        cmocka_unit_test(tracks),
        cmocka_unit_test(rings_of_attitudes),
        cmocka_unit_test(commands_and_windows),
        cmocka_unit_test(each_number_of_detections),
        cmocka_unit_test(each_number_of_tracks),
        cmocka_unit_test(each_number_of_truth),
        cmocka_unit_test(each_number_of_the_platform),
        cmocka_unit_test(each_number_of_commands),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
