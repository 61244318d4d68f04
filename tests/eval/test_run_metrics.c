/* Figures of detections and tracks on made-up messages, errors on both axes and between them. */
#include "sim/eval/run_metrics.h"

#include "tests/world/world_support.h"

#define PX_RAD (3.0 * BST_ARCSEC_RAD)
#define OBJECT(name) "{\"name\": \"" name "\", " TEST_GX5 "}"

enum { RATE = 6000, OBJECTS = 3 };

typedef struct fixture {
    bst_ctx ctx;
    bst_world *world;
    bst_run_metrics *metrics;
    bst_truth *truth;
    bst_tracks *tracks;
    bst_detections *detections;
} fixture;

static int set_up(void **state) {
    fixture *f = calloc(1, sizeof *f);
    assert_non_null(f);
    f->world = test_world_with(OBJECT("A") ", " OBJECT("B") ", " OBJECT("C"), "");
    bst_assert_ok(&f->ctx, bst_run_metrics_create(&f->ctx, f->world, 0, 0, 1, &f->metrics));
    f->truth = calloc(1, sizeof *f->truth + 8 * sizeof *f->truth->items);
    f->tracks = calloc(1, sizeof *f->tracks + 8 * sizeof *f->tracks->items);
    f->detections = calloc(1, sizeof *f->detections + 8 * sizeof *f->detections->items);
    assert_true(f->truth && f->tracks && f->detections);
    *state = f;
    return 0;
}

static int tear_down(void **state) {
    fixture *f = *state;
    bst_run_metrics_free(f->metrics);
    bst_world_free(f->world);
    free(f->truth);
    free(f->tracks);
    free(f->detections);
    free(f);
    return 0;
}

/* Objects are 100 px apart in declination and lie at (100, 200 + 100 i) px. */
static double dec_of(int object) {
    return 0.6 + object * 100 * PX_RAD;
}

static void show_truth(fixture *f, int64_t id, int objects, uint32_t flags, double snr) {
    f->truth->exposure_id = id;
    f->truth->count = objects;
    for (int i = 0; i < objects; i++) {
        f->truth->items[i] = (bst_truth_item){.kind = BST_SOURCE_OBJECT,
                                              .id = (uint32_t)i,
                                              .flags = flags,
                                              .ra_rad = 2.0,
                                              .dec_rad = dec_of(i),
                                              .x_centroid_px = 100,
                                              .y_centroid_px = 200 + 100 * i,
                                              .snr = snr};
    }
    /* past the end, and a star of an object's number: where each track of these tests is */
    f->truth->items[objects] = f->truth->items[0];
    bst_assert_ok(&f->ctx, bst_run_metrics_truth(&f->ctx, f->metrics, f->truth));
}

/* The direction (east, north) px from an object, along the great circle. */
static bst_vec3 beside(int object, double east_px, double north_px) {
    double dec = dec_of(object), angle = hypot(east_px, north_px) * PX_RAD;
    bst_vec3 d = bst_vec3_from_radec(2.0, dec), east = {-sin(2.0), cos(2.0), 0},
             north = {-sin(dec) * cos(2.0), -sin(dec) * sin(2.0), cos(dec)};
    bst_vec3 way = bst_vec3_scale(east, angle > 0 ? east_px * PX_RAD / angle : 0);
    way = bst_vec3_axpy(way, angle > 0 ? north_px * PX_RAD / angle : 0, north);
    return bst_vec3_axpy(bst_vec3_scale(d, cos(angle)), sin(angle), way);
}

static void show_track(fixture *f, int64_t exposure, int64_t id, int status, bool of_interest,
                       bst_vec3 direction) {
    f->tracks->exposure_id = exposure;
    f->tracks->count = 1;
    f->tracks->items[0] = (bst_track){
        .id = id, .status = status, .target_of_interest = of_interest, .direction_gcrf = direction};
    f->tracks->items[1] = (bst_track){.id = 99, /* past the end */
                                      .status = BST_TRACK_CONFIRMED,
                                      .target_of_interest = true,
                                      .direction_gcrf = beside(1, 0.01, 0)};
    bst_assert_ok(&f->ctx, bst_run_metrics_tracks(&f->ctx, f->metrics, f->tracks));
}

/* Closed forms of errors along rows, along columns and across. */
static void track_errors(void **state) {
    fixture *f = *state;
    const double errors[][2] = {{0, 0.3}, {0.4, 0}, {-1.2, 0.9}, {3.0, -3.9}, {0, -0.02}};
    enum { N = sizeof errors / sizeof *errors };
    double sum2 = 0;
    for (int i = 0; i < N; i++) {
        show_truth(f, i, OBJECTS, BST_TRUTH_IN_FIELD, 10);
        show_track(f, i, 7, i == 2 ? BST_TRACK_COASTING : BST_TRACK_CONFIRMED, true,
                   beside(1, errors[i][0], errors[i][1]));
        sum2 += errors[i][0] * errors[i][0] + errors[i][1] * errors[i][1];
    }
    /* none of these counts: not of interest, tentative, beyond 5 px, of another object */
    show_truth(f, N, OBJECTS, BST_TRUTH_IN_FIELD, 10);
    show_track(f, N, 8, BST_TRACK_CONFIRMED, false, beside(1, 0, 2));
    show_track(f, N, 7, BST_TRACK_TENTATIVE, true, beside(1, 0, 2));
    show_track(f, N, 7, BST_TRACK_CONFIRMED, true, beside(1, 3.6, 3.6));
    show_track(f, N, 7, BST_TRACK_CONFIRMED, true, beside(2, 0, 0.1));
    bst_run_metric_figures m;
    bst_run_metrics_figures(f->metrics, &m);
    assert_int_equal(m.track_frames, N);
    /* 5 px are 7e-5 rad: chord and arc differ by 2e-10 of it */
    bst_assert_close(m.track_rms_px, sqrt(sum2 / N), 1e-8);
    bst_assert_close(m.track_max_px, hypot(3.0, 3.9), 1e-8);
    /* nearest rank of 5 values: the third and the fifth, to half a bin of 0.1 % */
    bst_assert_close(m.track_median_px / 0.4, 1, 0.00051);
    bst_assert_close(m.track_p95_px / hypot(3.0, 3.9), 1, 0.00051);
}

/* A track is false when most of its frames are near no object; what coasts near none is no frame.
 */
static void false_tracks(void **state) {
    fixture *f = *state;
    for (int i = 0; i < 4; i++) {
        show_truth(f, i, OBJECTS, BST_TRUTH_IN_FIELD, 10);
        show_track(f, i, 1, BST_TRACK_CONFIRMED, false, beside(0, 0, i < 2 ? 4.9 : 5.1)); /* half */
        show_track(f, i, 2, BST_TRACK_CONFIRMED, false, beside(2, i < 1 ? 4.9 : 0, i < 1 ? 0 : 8));
        show_track(f, i, 3, i < 1 ? BST_TRACK_CONFIRMED : BST_TRACK_COASTING, false,
                   beside(2, -3.5, i < 1 ? 3.5 : 80));
    }
    bst_run_metric_figures m;
    bst_run_metrics_figures(f->metrics, &m);
    assert_int_equal(m.tracks, 3);
    assert_int_equal(m.false_tracks, 1);
    assert_int_equal(m.objects_seen, 3);
    assert_int_equal(m.objects_tracked, 2); /* 0 and 2 */
    assert_true(isnan(m.track_rms_px) && m.track_frames == 0);
}

static void show_detections(fixture *f, int64_t id, double x_px, double y_px) {
    f->detections->exposure_id = id;
    f->detections->count = 2;
    f->detections->items[0] = (bst_detection){.x_px = 100, .y_px = 200}; /* object 0's */
    f->detections->items[1] = (bst_detection){.x_px = x_px, .y_px = y_px};
    /* past the end: on each of the objects */
    for (int i = 2; i < 5; i++) {
        f->detections->items[i] = (bst_detection){.x_px = 100, .y_px = 200 + 100 * (i - 2)};
    }
    bst_run_metrics_detections(f->metrics, f->detections);
}

/* The share of the frames with the visible target in the field that have a detection within 5 px
 * of it, on either axis. */
static void detected_fraction(void **state) {
    fixture *f = *state;
    const struct {
        double dx, dy;
        bool on;
    } places[] = {{0, 4.9, true},    {4.9, 0, true},    {0, -5.1, false}, {-5.1, 0, false},
                  {3.5, -3.5, true}, {3.6, 3.6, false}, {0, 300, false}};
    enum { N = sizeof places / sizeof *places };
    int on = 0;
    for (int i = 0; i < N; i++) {
        show_truth(f, i, OBJECTS, BST_TRUTH_IN_FIELD, 10);
        show_detections(f, i, 100 + places[i].dx, 300 + places[i].dy);
        bst_run_metrics_frame(f->metrics, &(bst_loop_frame){.visible = true, .target_snr = 10});
        on += places[i].on;
    }
    /* behind the Earth or dark, a detection there is not the target's */
    show_truth(f, N, OBJECTS, BST_TRUTH_IN_FIELD | BST_TRUTH_OCCULTED, 10);
    show_detections(f, N, 100, 300);
    show_truth(f, N + 1, OBJECTS, BST_TRUTH_IN_FIELD, 0);
    show_detections(f, N + 1, 100, 300);
    /* out of the field */
    bst_run_metrics_frame(f->metrics, &(bst_loop_frame){.visible = true, .target_snr = 0});
    bst_run_metric_figures m;
    bst_run_metrics_figures(f->metrics, &m);
    assert_int_equal(m.in_field_frames, N);
    assert_int_equal(m.detected_frames, on);
    bst_assert_close(m.detected_fraction, (double)on / N, 1e-15);
    assert_int_equal(m.detections, 2 * (N + 2));
}

/* Amounts and frames are counted apart. */
static void losses(void **state) {
    fixture *f = *state;
    for (int i = 0; i < 10; i++) {
        f->truth->lost = i == 3 ? 40 : i == 4 ? 2 : 0;
        f->truth->dropped = i >= 8;
        show_truth(f, i, OBJECTS, BST_TRUTH_IN_FIELD, 10);
        f->detections->lost = i < 3 ? 100 : 0;
        f->detections->stars_identified = i == 5 ? 0 : 20;
        show_detections(f, i, 0, 0);
        f->tracks->lost = i == 7 ? 5 : 0;
        f->tracks->attitude.valid = i % 2 == 0;
        show_track(f, i, 1, BST_TRACK_TENTATIVE, false, beside(0, 0, 0));
    }
    bst_run_metric_figures m;
    bst_run_metrics_figures(f->metrics, &m);
    assert_int_equal(m.losses.frames, 10);
    assert_int_equal(m.losses.detections, 300);
    assert_int_equal(m.losses.detection_frames, 3);
    assert_int_equal(m.losses.truth, 42);
    assert_int_equal(m.losses.truth_frames, 2);
    assert_int_equal(m.losses.tracks, 5);
    assert_int_equal(m.losses.track_frames, 1);
    assert_int_equal(m.losses.dropped_frames, 2);
    assert_int_equal(m.losses.no_stars_frames, 1);
    assert_int_equal(m.losses.no_attitude_frames, 5);
}

/* Objects that were not in the field are neither seen nor tracked; frames with a body's disc in
 * them are counted; a message about a frame that is long gone changes nothing; so many objects that
 * the list of a frame grows. */
static void frames_and_objects(void **state) {
    fixture *f = *state;
    bst_run_metric_figures m;
    for (int i = 0; i < 9; i++) {
        f->truth->earth_fraction = i < 4 ? 0.1 : 0;
        f->truth->moon_fraction = i < 3 ? 0.1 : 0;
        f->truth->sun_fraction = i < 2 ? 0.1 : 0;
        show_truth(f, i, 1, BST_TRUTH_IN_FIELD, 10);
        show_truth(f, 100 + i, 2, 0, 10); /* not in the field */
    }
    f->detections->bad_pixels = 17;
    show_detections(f, 8, 0, 0);
    bst_run_metrics_figures(f->metrics, &m);
    assert_int_equal(m.losses.frames, 18);
    assert_int_equal(m.losses.earth_frames, 8); /* two frames a turn */
    assert_int_equal(m.losses.moon_frames, 6);
    assert_int_equal(m.losses.sun_frames, 4);
    assert_int_equal(m.objects_seen, 1);
    assert_int_equal(m.objects_tracked, 0);
    assert_int_equal(m.bad_pixels, 17);
    for (int i = 0; i < 134; i++) { /* frame 8 and those before are forgotten */
        show_truth(f, 200 + i, OBJECTS, BST_TRUTH_IN_FIELD, 10);
    }
    show_detections(f, 205, 100, 300); /* 128 frames are kept: 206 to 333 */
    show_track(f, 205, 1, BST_TRACK_CONFIRMED, true, beside(1, 0, 0.5));
    bst_run_metrics_figures(f->metrics, &m);
    assert_int_equal(m.detected_frames, 0);
    assert_int_equal(m.track_frames, 0);
    assert_int_equal(m.tracks, 0);
    show_detections(f, 206, 100, 300);
    show_track(f, 206, 1, BST_TRACK_CONFIRMED, true, beside(1, 0, 0.5));
    bst_run_metrics_figures(f->metrics, &m);
    assert_int_equal(m.detected_frames, 1);
    assert_int_equal(m.track_frames, 1);
    /* 40 objects in a frame; the last is the target */
    bst_truth *many = calloc(1, sizeof *many + 40 * sizeof *many->items);
    assert_non_null(many);
    many->exposure_id = 500;
    many->count = 40;
    for (int i = 0; i < 40; i++) {
        many->items[i] = (bst_truth_item){.kind = BST_SOURCE_OBJECT,
                                          .id = i == 39 ? 1 : (uint32_t)(100 + i),
                                          .flags = BST_TRUTH_IN_FIELD,
                                          .ra_rad = 2.0,
                                          .dec_rad = -0.5 + 0.01 * i,
                                          .x_centroid_px = 10 * i,
                                          .y_centroid_px = 500,
                                          .snr = 9};
    }
    bst_assert_ok(&f->ctx, bst_run_metrics_truth(&f->ctx, f->metrics, many));
    free(many);
    show_detections(f, 500, 390, 500);
    show_track(f, 500, 1, BST_TRACK_CONFIRMED, true, bst_vec3_from_radec(2.0, -0.11));
    bst_run_metrics_figures(f->metrics, &m);
    assert_int_equal(m.detected_frames, 2);
    assert_int_equal(m.track_frames, 2);
}

/* Next to the celestial pole east and north are still at right angles. */
static void errors_at_the_pole(void **state) {
    fixture *f = *state;
    f->truth->exposure_id = 1;
    f->truth->count = 1;
    f->truth->items[0] = (bst_truth_item){.kind = BST_SOURCE_OBJECT,
                                          .id = 1,
                                          .flags = BST_TRUTH_IN_FIELD,
                                          .dec_rad = 0.5 * BST_PI,
                                          .snr = 5};
    bst_assert_ok(&f->ctx, bst_run_metrics_truth(&f->ctx, f->metrics, f->truth));
    show_track(f, 1, 3, BST_TRACK_CONFIRMED, true,
               (bst_vec3){2 * PX_RAD, -1.5 * PX_RAD, 1}); /* 2.5 px */
    bst_run_metric_figures m;
    bst_run_metrics_figures(f->metrics, &m);
    assert_int_equal(m.track_frames, 1);
    bst_assert_close(m.track_rms_px, 2.5, 1e-8);
}

/* After a change of the target the other object counts. */
static void another_target(void **state) {
    fixture *f = *state;
    for (int i = 0; i < 2; i++) {
        show_truth(f, i, OBJECTS, BST_TRUTH_IN_FIELD, 10);
        show_track(f, i, 1, BST_TRACK_CONFIRMED, true, beside(i == 0 ? 1 : 2, 0, 0.5));
        show_detections(f, i, 100, i == 0 ? 300 : 400);
        bst_run_metrics_retarget(f->metrics, 2);
    }
    bst_run_metric_figures m;
    bst_run_metrics_figures(f->metrics, &m);
    assert_int_equal(m.track_frames, 2);
    assert_int_equal(m.detected_frames, 2);
}

/* Adds a frame with objects 0 and 1 at the threshold and object 2 below it, and its tracks, by
 * hand: the camera looks at object 1. */
static void score(fixture *f, int64_t id, const bst_track *tracks, int count) {
    f->truth->q_cam_from_gcrf_mid =
        bst_quat_look(bst_vec3_from_radec(2.0, dec_of(1)), (bst_vec3){0, 0, 1});
    f->truth->sun_m = (bst_vec3){0, 1.5e11, 0};
    f->truth->exposure_id = id;
    f->truth->count = OBJECTS;
    for (int i = 0; i < OBJECTS; i++) {
        f->truth->items[i] = (bst_truth_item){.kind = BST_SOURCE_OBJECT,
                                              .id = (uint32_t)i,
                                              .flags = BST_TRUTH_IN_FIELD,
                                              .ra_rad = 2.0,
                                              .dec_rad = dec_of(i),
                                              .snr = i < 2 ? 6.0 : 5.9};
    }
    bst_assert_ok(&f->ctx, bst_run_metrics_truth(&f->ctx, f->metrics, f->truth));
    f->detections->exposure_id = id;
    f->detections->count = 0;
    f->detections->threshold_snr = 6.0;
    bst_run_metrics_detections(f->metrics, f->detections);
    f->tracks->exposure_id = id;
    f->tracks->count = count;
    memcpy(f->tracks->items, tracks, (size_t)count * sizeof *tracks);
    bst_assert_ok(&f->ctx, bst_run_metrics_tracks(&f->ctx, f->metrics, f->tracks));
}

static void show_smoothed(fixture *f, int64_t exposure, bool of_interest, bst_vec3 direction) {
    bst_tracks_smoothed *t = calloc(1, sizeof *t + 2 * sizeof(bst_track_smoothed));
    assert_non_null(t);
    t->exposure_id = exposure;
    t->count = 2;
    t->lost = exposure == 999 ? 5 : 0;
    t->items[0] = (bst_track_smoothed){.id = 3, .direction_gcrf = beside(1, 4, 0)};
    t->items[1] = (bst_track_smoothed){
        .id = 7, .target_of_interest = of_interest, .direction_gcrf = direction};
    bst_run_metrics_smoothed(f->metrics, t);
    free(t);
}

/* Smoothed states come many frames later. Those of frames without the target's own track, of
 * frames that nobody remembers, and of other tracks do not count. */
static void smoothed_errors(void **state) {
    fixture *f = *state;
    enum { LAG = 60 };
    for (int i = 0; i < 3 + LAG; i++) {
        show_truth(f, i, OBJECTS, BST_TRUTH_IN_FIELD, 10);
        show_track(f, i, 7, BST_TRACK_CONFIRMED, true,
                   i == 2 ? beside(2, 0, 0.1) : beside(1, 0, i == 0 ? 0.9 : 1.2));
    }
    show_smoothed(f, 0, true, beside(1, 0.3, 0));
    show_smoothed(f, 1, true, beside(1, 0, -0.4));
    show_smoothed(f, 2, true, beside(2, 0, 0.1));
    show_smoothed(f, 3, false, beside(1, 0, 3));
    show_smoothed(f, 999, true, beside(1, 0, 3));
    const bst_track_identities whole = {.exposure_id = 1}, cut = {.exposure_id = 2, .lost = 3};
    bst_run_metrics_identities(f->metrics, &whole);
    bst_run_metrics_identities(f->metrics, &cut);
    bst_run_metric_figures m;
    bst_run_metrics_figures(f->metrics, &m);
    assert_int_equal(m.smoothed_frames, 2);
    /* as in track_errors */
    bst_assert_close(m.smoothed_rms_px, sqrt((0.09 + 0.16) / 2), 1e-8);
    bst_assert_close(m.smoothed_filtered_rms_px, sqrt((0.81 + 1.44) / 2), 1e-8);
    assert_int_equal(m.losses.smoothed_tracks, 5);
    assert_int_equal(m.losses.smoothed_track_frames, 1);
    assert_int_equal(m.losses.identities, 3);
    assert_int_equal(m.losses.identity_frames, 1);
}

/* First frame: track 1 is 1 px from object 0, object 1 is missed, track 2 is false; track 3 on an
 * object that is too faint, 4 outside the sensor, 5 hidden and 6 tentative do not count. Second
 * frame: both objects have exact tracks, object 0 one of another number. */
static void all_tracks_and_all_objects(void **state) {
    fixture *f = *state;
    const bst_track first[] = {
        {.id = 1, .status = BST_TRACK_CONFIRMED, .direction_gcrf = beside(0, 1, 0)},
        {.id = 2, .status = BST_TRACK_CONFIRMED, .direction_gcrf = beside(1, 40, 0)},
        {.id = 3, .status = BST_TRACK_CONFIRMED, .direction_gcrf = beside(2, 2, 0)},
        {.id = 4, .status = BST_TRACK_COASTING, .direction_gcrf = beside(1, 3000, 0)},
        {.id = 5,
         .status = BST_TRACK_COASTING,
         .hidden = BST_HIDDEN_SHADOW,
         .direction_gcrf = beside(1, 60, 0)},
        {.id = 6, .status = BST_TRACK_TENTATIVE, .direction_gcrf = beside(1, 0, 0)}};
    const bst_track second[] = {
        {.id = 7, .status = BST_TRACK_CONFIRMED, .direction_gcrf = beside(0, 0, 0)},
        {.id = 8, .status = BST_TRACK_CONFIRMED, .direction_gcrf = beside(1, 0, 0)}};
    score(f, 0, first, 6);
    score(f, 1, second, 2);
    bst_run_metric_figures m;
    bst_run_metrics_figures(f->metrics, &m);
    assert_int_equal(m.scored_frames, 2);
    /* 1 px, and half of 5^2 px for each of a missed object and a false track; 1e-7 px: angles of
     * 1e-5 rad have errors of 1e-12 */
    bst_assert_close(m.gospa_px, 0.5 * sqrt(1.0 + 25.0), 1e-7);
    /* frame 1: 1 px and a pair at the cutoff, over 2. Frame 2, histories of two frames: object 0
     * is 3 px from tracks 1 (1 and 5) and 2.5 px from 7, object 1 2.5 px from 8; tracks 1 and 2
     * are left over: 2.5^2 twice and 5^2 twice, over 4 */
    bst_assert_close(m.ospa2_px, 0.5 * (sqrt(26.0 / 2.0) + sqrt((2 * 6.25 + 50.0) / 4.0)), 1e-7);
    assert_int_equal(m.id_switches, 1);
    assert_int_equal(m.ghosts, 0);
    bst_assert_close(m.purity, 1.0, 0.0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(smoothed_errors, set_up, tear_down),
        cmocka_unit_test_setup_teardown(track_errors, set_up, tear_down),
        cmocka_unit_test_setup_teardown(false_tracks, set_up, tear_down),
        cmocka_unit_test_setup_teardown(detected_fraction, set_up, tear_down),
        cmocka_unit_test_setup_teardown(losses, set_up, tear_down),
        cmocka_unit_test_setup_teardown(frames_and_objects, set_up, tear_down),
        cmocka_unit_test_setup_teardown(errors_at_the_pole, set_up, tear_down),
        cmocka_unit_test_setup_teardown(another_target, set_up, tear_down),
        cmocka_unit_test_setup_teardown(all_tracks_and_all_objects, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
