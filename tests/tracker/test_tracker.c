/* The whole tracker on simulated detections of the main scenario. */
#include "tests/tracker/moving_sky.h"
#include "tracker/identity.h"
#include "tracker/tracker_internal.h"

typedef struct result {
    int used, in_track, wrong, first_target_frame;
    double rms_px;          /* of the target's track over the frames in track */
    double attitude_rms_px; /* about camera x and y */

    int target_changes;
} result;

static void run(uint64_t seed, const options *o, result *r) {
    static world w;
    world_open(&w, seed, o);
    memset(r, 0, sizeof *r);
    r->first_target_frame = -1;
    int64_t last = 0;
    int fixes = 0;
    for (int k = 0; k < o->frames; k++) {
        bst_quat q_true = expose(&w, k);
        if (uniform(&w) < o->dropped) {
            continue;
        }
        bst_tracker_input input = make_input(&w, k);
        (void)bst_tracker_step(w.tracker, &input, w.tracks, 256, w.predictions, 256);
        r->used++;
        if (w.tracks->attitude.valid) {
            bst_vec3 e = bst_quat_to_rotvec(
                bst_quat_mul(w.tracks->attitude.q_cam_from_gcrf, bst_quat_conj(q_true)));
            r->attitude_rms_px += (e.x * e.x + e.y * e.y) / 2.0 / pow(3 * AS, 2);
            fixes++;
        }
        r->target_changes += w.tracks->target_id != last;
        last = w.tracks->target_id;
        if (w.tracks->target_id == 0) {
            continue;
        }
        const bst_track *target = &w.tracks->items[0];
        assert_true(target->target_of_interest);
        assert_int_equal(target->id, w.tracks->target_id);
        if (r->first_target_frame < 0) {
            r->first_target_frame = k;
        }
        double off =
            bst_vec3_angle(target->direction_gcrf, target_direction(&w, k, true)) / (3 * AS);
        if (off > 3.0) {
            r->wrong++;
        } else {
            r->in_track++;
            r->rms_px += off * off / 2.0;
        }
    }
    r->rms_px = sqrt(r->rms_px / fmax(1, r->in_track));
    r->attitude_rms_px = sqrt(r->attitude_rms_px / fmax(1, fixes));
    world_close(&w);
}

static const options plain = {.sigma_px = 0.1, .pd = 0.99, .false_alarms = 1, .frames = 300};

static void main_scenario(void **state) {
    (void)state;
    result r;
    run(1, &plain, &r);
    print_message(
        "main: target after %d frames, in track %d of %d, %.3f px RMS per axis, "
        "attitude %.3f px\n",
        r.first_target_frame, r.in_track, r.used, r.rms_px, r.attitude_rms_px);
    assert_in_range(r.first_target_frame, 3, 10);
    assert_int_equal(r.wrong, 0);
    assert_true(r.in_track >= 290);
    assert_int_equal(r.target_changes, 1);
    /* a filtered track is better than one centroid (0.1 px) and its attitude (0.02 px) */
    assert_true(r.rms_px < 0.1);
    /* about 40 stars of 0.1 px: 0.1 / sqrt(40) = 0.016, and 5 % wrong names */
    assert_true(r.attitude_rms_px < 0.025);
}

/* Runs `seeds` seeds; how many keep the right target in at least 95 % of frames after selection and
 * never take a wrong one. */
static int right(const options *o, int seeds, const char *name, double *worst_px) {
    int good = 0, shown = 0;
    *worst_px = 0.0;
    for (int s = 0; s < seeds; s++) {
        result r;
        run((uint64_t)s, o, &r);
        bool ok = r.wrong == 0 && r.first_target_frame >= 0 && r.in_track >= 0.9 * r.used;
        good += ok;
        *worst_px = fmax(*worst_px, r.rms_px);
        if (!ok && shown++ < 3) {
            print_message("  %s seed %d: wrong %d, in track %d of %d, first %d\n", name, s, r.wrong,
                          r.in_track, r.used, r.first_target_frame);
        }
    }
    print_message("%s: right in %d of %d seeds, worst RMS %.3f px\n", name, good, seeds, *worst_px);
    return good;
}

static void dropped_frames(void **state) {
    (void)state;
    options o = plain;
    o.dropped = 0.2;
    double worst;
    assert_true(right(&o, 10, "20 % dropped", &worst) == 10);
    assert_true(worst < 0.15);
}

static void faint_target(void **state) {
    (void)state;
    options o = plain;
    o.sigma_px = 0.25;
    o.pd = 0.85;
    double worst;
    assert_true(right(&o, 10, "SNR 6", &worst) == 10);
    assert_true(worst < 0.25);
}

static void burn(void **state) {
    (void)state;
    options o = plain;
    o.burn_s = 100;
    double worst;
    assert_true(right(&o, 5, "burn", &worst) == 5);
    assert_true(worst < 0.15);
}

static void neighbour_crosses(void **state) {
    (void)state;
    options o = plain;
    o.neighbours = 1;
    o.neighbour_rate[0][0] = 2.0;
    o.neighbour_rate[0][1] = 1.0;
    double worst;
    assert_true(right(&o, 10, "neighbour", &worst) == 10);
    o.sigma_px = 0.25;
    o.pd = 0.85;
    assert_true(right(&o, 10, "neighbour at SNR 6", &worst) >= 9);
}

/* Without light from the target nothing may become the target: not neighbours of other rates, not
 * uncatalogued stars (50 arcsec/s away), not false alarms. */
static void dark_target(void **state) {
    (void)state;
    options o = plain;
    o.dark = true;
    o.neighbours = 3;
    const double rates[3][2] = {{3, 1}, {-2.5, 2.5}, {-48, -14}};
    memcpy(o.neighbour_rate, rates, sizeof rates);
    for (uint64_t seed = 0; seed < 10; seed++) {
        result r;
        run(seed, &o, &r);
        assert_int_equal(r.first_target_frame, -1);
    }
    /* dark after 100 s of tracking: the track coasts for max_coast_s, 120 s, and ends, and no
     * neighbour takes its place */
    o.dark_from_s = 100;
    for (uint64_t seed = 0; seed < 10; seed++) {
        result r;
        run(seed, &o, &r);
        assert_true(r.first_target_frame >= 0);
        assert_int_equal(r.wrong, 0);
        assert_in_range(r.in_track, 205, 221);
        assert_int_equal(r.target_changes, 2);
    }
}

static void frames_without_stars(void **state) {
    (void)state;
    options o = plain;
    o.starless_from_s = 100;
    o.starless_to_s = 103;
    result r;
    run(3, &o, &r);
    print_message("3 frames without stars: in track %d of %d, wrong %d, changes %d\n", r.in_track,
                  r.used, r.wrong, r.target_changes);
    assert_int_equal(r.wrong, 0);
    assert_int_equal(r.target_changes, 1);
    /* from the start, and for long */
    o.starless_from_s = 0;
    o.starless_to_s = 100;
    run(4, &o, &r);
    assert_in_range(r.first_target_frame, 102, 110);
    /* 40 s, longer than the drift can be extrapolated: the target survives by coasting */
    o.starless_from_s = 150;
    o.starless_to_s = 190;
    run(5, &o, &r);
    print_message("40 frames without stars: in track %d of %d, wrong %d, changes %d\n", r.in_track,
                  r.used, r.wrong, r.target_changes);
    assert_int_equal(r.wrong, 0);
    assert_true(r.in_track > 280);
}

static void refuses_duplicates_and_late_frames(void **state) {
    (void)state;
    static world w;
    world_open(&w, 1, &plain);
    for (int k = 0; k < 6; k++) {
        (void)expose(&w, k);
        bst_tracker_input input = make_input(&w, k);
        assert_int_equal(bst_tracker_step(w.tracker, &input, w.tracks, 256, w.predictions, 256),
                         BST_TRACKER_USED);
        bst_tracks before = *w.tracks;
        assert_int_equal(bst_tracker_check(w.tracker, w.detections), BST_TRACKER_DUPLICATE);
        assert_int_equal(bst_tracker_step(w.tracker, &input, w.tracks, 256, w.predictions, 256),
                         BST_TRACKER_DUPLICATE);
        assert_memory_equal(&before, w.tracks, sizeof before);
    }
    (void)expose(&w, 3); /* an old frame once more */
    bst_tracker_input input = make_input(&w, 3);
    assert_int_equal(bst_tracker_step(w.tracker, &input, w.tracks, 256, w.predictions, 256),
                     BST_TRACKER_BACKWARDS);
    w.detections->exposure_id = 99; /* a new one that is not later */
    assert_int_equal(bst_tracker_step(w.tracker, &input, w.tracks, 256, w.predictions, 256),
                     BST_TRACKER_BACKWARDS);
    /* no room for outputs */
    (void)expose(&w, 6);
    input = make_input(&w, 6);
    assert_int_equal(bst_tracker_step(w.tracker, &input, w.tracks, 0, w.predictions, 0),
                     BST_TRACKER_USED);
    assert_int_equal(w.tracks->count, 0);
    assert_true(w.tracks->lost >= 1 && w.predictions->lost >= 1);
    world_close(&w);
}

/* A camera that turned in the exposure: its stars agree with each other but not with the attitude
 * of the middle. The frame moves nothing, and the target survives it. */
static void a_frame_of_an_uneven_turn(void **state) {
    (void)state;
    static world w;
    world_open(&w, 6, &plain);
    int64_t target = 0;
    for (int k = 0; k < 30; k++) {
        (void)expose(&w, k);
        for (int i = 0; k == 20 && i < w.detections->count; i++) {
            w.detections->items[i].x_px += 27.0;
        }
        bst_tracker_input input = make_input(&w, k);
        bst_vec3 before = w.predictions->attitude_error_cam_rad;
        assert_int_equal(bst_tracker_step(w.tracker, &input, w.tracks, 256, w.predictions, 256),
                         k == 20 ? BST_TRACKER_NO_ATTITUDE : BST_TRACKER_USED);
        /* what the tracker does not trust, control must not steer by */
        assert_int_equal(w.tracks->attitude.valid, k != 20);
        if (k == 19) {
            target = w.tracks->target_id;
            assert_int_not_equal(target, 0);
        } else if (k == 20) {
            int n;
            const bst_tracker_event *events = bst_tracker_events(w.tracker, &n);
            assert_int_equal(n, 1);
            assert_int_equal(events[0].kind, BST_TRACKER_ATTITUDE_LOST);
            /* 27 px are 81 arcsec; a second's drift is 5 */
            bst_vec3 moved = bst_vec3_sub(w.predictions->attitude_error_cam_rad, before);
            assert_true(hypot(moved.x, moved.y) < 8 * AS);
        }
        if (k >= 19) {
            assert_int_equal(w.tracks->target_id, target);
        }
    }
    world_close(&w);
}

/* The camera starts from rest: the first frame's stars are off, the second is right. */
static void a_bad_first_frame(void **state) {
    (void)state;
    static world w;
    world_open(&w, 6, &plain);
    for (int k = 0; k < 12; k++) {
        (void)expose(&w, k);
        for (int i = 0; k == 0 && i < w.detections->count; i++) {
            w.detections->items[i].x_px += 6.0;
        }
        bst_tracker_input input = make_input(&w, k);
        assert_int_equal(bst_tracker_step(w.tracker, &input, w.tracks, 256, w.predictions, 256),
                         BST_TRACKER_USED);
    }
    assert_int_not_equal(w.tracks->target_id, 0);
    world_close(&w);
}

/* Places known to no better than 5 px start no tracks. */
static void vague_detections(void **state) {
    (void)state;
    static world w;
    world_open(&w, 6, &plain);
    for (int k = 0; k < 12; k++) {
        (void)expose(&w, k);
        for (int i = 0; i < w.detections->count; i++) {
            bst_detection *d = &w.detections->items[i];
            d->cov_xx += d->label == BST_LABEL_OBJECT ? 25.0 : 0.0;
        }
        bst_tracker_input input = make_input(&w, k);
        assert_int_equal(bst_tracker_step(w.tracker, &input, w.tracks, 256, w.predictions, 256),
                         BST_TRACKER_USED);
        assert_int_equal(w.tracks->count, 0);
    }
    world_close(&w);
}

/* The error of a place that is a blend, or at an edge, is added to that of all objects' places
 * (0.5 px beside 0.02 px); that of an extended one includes its edge. */
static void blends_are_vague(void **state) {
    (void)state;
    static const uint32_t flags[6] = {0,
                                      BST_DETECTION_BLEND,
                                      BST_DETECTION_EDGE,
                                      BST_DETECTION_EXTENDED,
                                      BST_DETECTION_EXTENDED | BST_DETECTION_EDGE,
                                      BST_DETECTION_BLEND | BST_DETECTION_EDGE};
    static const double more_px2[6] = {0.0, 0.25, 0.25, 0.0, 0.0, 0.25};
    double variance[6];
    for (int n = 0; n < 6; n++) {
        static world w;
        world_open(&w, 6, &plain);
        (void)expose(&w, 0);
        int object = 0;
        while (w.detections->items[object].label != BST_LABEL_OBJECT) {
            assert_true(++object < w.detections->count);
        }
        w.detections->items[object].flags = flags[n];
        bst_tracker_input input = make_input(&w, 0);
        (void)bst_tracker_step(w.tracker, &input, w.tracks, 256, w.predictions, 256);
        const bst_mtt_detection *found = w.tracker->detections;
        while (found->x_px != w.detections->items[object].x_px) {
            assert_true(++found < w.tracker->detections + w.tracker->max_detections);
        }
        variance[n] = found->sky.cov_11 + found->sky.cov_22;
        world_close(&w);
        /* pixels of 3 arcsec, half a degree from the middle at most: smaller by 1e-4 */
        bst_assert_close((variance[n] - variance[0]) / pow(3 * AS, 2), 2.0 * more_px2[n], 3e-4);
        if (n == 0) { /* not less than the place's own error and that of all objects */
            assert_true(variance[0] > 2.0 * (0.01 + 0.0004) * 0.999 * pow(3 * AS, 2));
        }
    }
}

/* Predictions foresee the telemetry's error and the target's place of the next frame. */
static void predictions_hold(void **state) {
    (void)state;
    static world w;
    world_open(&w, 2, &plain);
    double worst_px = 0.0, worst_attitude_px = 0.0;
    for (int k = 0; k < 100; k++) {
        bst_quat q_true = expose(&w, k);
        if (k > 20) {
            const bst_predictions *p = w.predictions;
            assert_true(p->attitude_valid);
            bst_vec3 e = bst_vec3_add(p->attitude_error_cam_rad, p->attitude_error_rate_cam_radps);
            bst_quat q = bst_quat_mul(bst_quat_from_rotvec(e), w.detections->q_telemetry_from_gcrf);
            bst_vec3 off = bst_quat_to_rotvec(bst_quat_mul(q, bst_quat_conj(q_true)));
            worst_attitude_px = fmax(worst_attitude_px, hypot(off.x, off.y) / (3 * AS));
            assert_true(p->count >= 1 && p->items[0].target_of_interest);
            bst_vec3 d = bst_vec3_unit(
                bst_vec3_add(p->items[0].direction_gcrf, p->items[0].rate_gcrf_radps));
            worst_px = fmax(worst_px, bst_vec3_angle(d, target_direction(&w, k, true)) / (3 * AS));
        }
        bst_tracker_input input = make_input(&w, k);
        (void)bst_tracker_step(w.tracker, &input, w.tracks, 256, w.predictions, 256);
    }
    print_message("prediction one frame ahead: target %.2f px, attitude %.2f px at worst\n",
                  worst_px, worst_attitude_px);
    assert_true(worst_px < 0.3);
    /* frame jitter of 0.2 px per axis cannot be predicted: 4 sigma, and the drift's curvature */
    assert_true(worst_attitude_px < 1.2);
    world_close(&w);
}

/* Telemetry wrong by 170 degrees: the stars of the first frame give the attitude; drift is followed
 * about it, and a frame without stars is predicted. */
static void telemetry_wrong_by_any_angle(void **state) {
    (void)state;
    static world w;
    world_open(&w, 2, &plain);
    const bst_quat wrong = bst_quat_from_rotvec((bst_vec3){1.0, -2.0, 1.96});
    for (int k = 0; k < 60; k++) {
        bst_quat q_true = expose(&w, k);
        bst_detections *d = w.detections;
        /* as image processing has found it */
        d->q_telemetry_from_gcrf = bst_quat_unit(bst_quat_mul(d->q_telemetry_from_gcrf, wrong));
        if (k == 50) {
            d->count = 0;
        }
        bst_tracker_input input = make_input(&w, k);
        (void)bst_tracker_step(w.tracker, &input, w.tracks, 256, w.predictions, 256);
        const bst_attitude_fix *fix = &w.tracks->attitude;
        assert_int_equal(fix->valid, k != 50);
        bst_vec3 off =
            bst_quat_to_rotvec(bst_quat_mul(fix->q_cam_from_gcrf, bst_quat_conj(q_true)));
        /* 40 stars of 0.1 px; a predicted frame has the jitter of 0.2 px per axis: 5 sigma */
        assert_true(hypot(off.x, off.y) / (3 * AS) < (k == 50 ? 1.2 : 0.15));
        bst_quat q =
            bst_quat_mul(bst_quat_from_rotvec(fix->error_cam_rad), d->q_telemetry_from_gcrf);
        off = bst_quat_to_rotvec(bst_quat_mul(q, bst_quat_conj(fix->q_cam_from_gcrf)));
        assert_true(bst_vec3_norm(off) < 1e-12);
        assert_false(w.predictions->attitude_valid); /* it is one of small angles */
    }
    world_close(&w);
}

/* Navigation of 4 s after the middle of the exposure, as a read-out leaves it: stars are aberrated
 * by the velocity of the middle, from which a low circular orbit's has turned by 34 m/s, 24 mas. */
static void late_navigation(void **state) {
    (void)state;
    static world w;
    world_open(&w, 3, &plain);
    const double r = 7.0e6, late_s = 4.0, v = sqrt(3.986004418e14 / r), turned = v / r * late_s;
    const bst_vec3 earth = {-21000, 19000, 11000}, ahead = {-v, 0, 0};
    w.light.velocity_mps = bst_vec3_add(earth, ahead);
    bst_nav_telemetry late = {.tick = (int64_t)(late_s * RATE_HZ),
                              .position_gcrf_m = {-r * sin(turned), r * cos(turned), 0},
                              .velocity_gcrf_mps = {-v * cos(turned), -v * sin(turned), 0},
                              .sun_m = nav.sun_m};
    late.velocity_bary_mps = bst_vec3_add(earth, late.velocity_gcrf_mps);
    bst_quat q = bst_quat_look(w.centre, w.e1);
    bst_detections *d = w.detections;
    *d = (bst_detections){.start_tick = -RATE_HZ / 4, .end_tick = RATE_HZ / 4};
    d->q_telemetry_from_gcrf = d->q_cam_from_gcrf = q;
    for (uint32_t i = 0; i < STARS; i++) {
        bst_vec3 apparent = bst_light_apparent_star(&w.light, w.stars[i]);
        double x, y;
        if (bst_vec3_dot(w.stars[i], w.centre) > 0.9998 && project(q, apparent, &x, &y)) {
            d->items[d->count++] = (bst_detection){.label = BST_LABEL_STAR,
                                                   .star_id = i + 1,
                                                   .x_px = x,
                                                   .y_px = y,
                                                   .cov_xx = 1e-4,
                                                   .cov_yy = 1e-4};
        }
    }
    bst_tracker_input input = {.detections = d, .nav = &late};
    assert_int_equal(bst_tracker_step(w.tracker, &input, w.tracks, 256, w.predictions, 256),
                     BST_TRACKER_USED);
    assert_true(w.tracks->attitude.valid);
    bst_vec3 off =
        bst_quat_to_rotvec(bst_quat_mul(w.tracks->attitude.q_cam_from_gcrf, bst_quat_conj(q)));
    bst_assert_close(hypot(off.x, off.y) / AS, 0.0, 1e-6); /* arcsec: rounding */
    world_close(&w);
}

typedef struct catalogued {
    const world *w;
    double t;
} catalogued;

/* The catalogue: the target alone, where it is. */
static int find_target(void *user, const bst_tracker_search *search, bst_identity_object *out,
                       int room, int *left_out) {
    const catalogued *c = user;
    bst_vec3 direction = target_direction(c->w, c->t, false);
    assert_true(room >= 1 && bst_vec3_angle(search->axis, direction) < search->half_angle_rad);
    *left_out = 0;
    out[0] = (bst_identity_object){.object = 4,
                                   .direction = direction,
                                   .rate_radps = target_rate(c->w, c->t, false),
                                   .sigma_rad = 20 * AS,
                                   .rate_sigma_radps = 0.1 * AS,
                                   .v_mag = 13,
                                   .v_mag_sigma = 1};
    return 1;
}

/* What a cue means that names no object may be in the catalogue: that is no rival of the cue, and
 * the track has its identity. */
static void a_cue_without_an_object(void **state) {
    (void)state;
    static world w;
    world_open(&w, 3, &plain);
    double probability = 0.0;
    for (int k = 0; k < 40; k++) {
        (void)expose(&w, k);
        bst_tracker_input input = make_input(&w, k);
        catalogued c = {&w, k};
        input.near = find_target;
        input.near_user = &c;
        input.cue_object = -1;
        (void)bst_tracker_step(w.tracker, &input, w.tracks, 256, w.predictions, 256);
        const bst_identity *identity = bst_tracker_identity(w.tracker);
        for (int t = 0; identity && t < identity->tracks; t++) {
            if (identity->track_id[t] == w.tracks->target_id) {
                assert_int_equal(identity->objects, 1);
                assert_int_equal(identity->object[0], 4);
                probability = identity->probability[t][0];
            }
        }
    }
    assert_true(w.tracks->target_id != 0);
    assert_true(probability > 0.9);
    world_close(&w);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(main_scenario),
                                       cmocka_unit_test(dropped_frames),
                                       cmocka_unit_test(faint_target),
                                       cmocka_unit_test(burn),
                                       cmocka_unit_test(neighbour_crosses),
                                       cmocka_unit_test(dark_target),
                                       cmocka_unit_test(frames_without_stars),
                                       cmocka_unit_test(refuses_duplicates_and_late_frames),
                                       cmocka_unit_test(a_frame_of_an_uneven_turn),
                                       cmocka_unit_test(a_bad_first_frame),
                                       cmocka_unit_test(vague_detections),
                                       cmocka_unit_test(blends_are_vague),
                                       cmocka_unit_test(telemetry_wrong_by_any_angle),
                                       cmocka_unit_test(predictions_hold),
                                       cmocka_unit_test(late_navigation),
                                       cmocka_unit_test(a_cue_without_an_object)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
