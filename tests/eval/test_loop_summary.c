/* The loop's figures on made-up streams of truth, tracks and modes. */
#include "sim/eval/loop_summary.h"

#include <stdlib.h>

#include "tests/world/world_support.h"

enum { RATE = 6000 };

typedef struct scene {
    bst_ctx ctx;
    bst_world *world;
    bst_world_view *view;
    bst_loop_summary *summary;
    bst_tracks *tracks;
    bst_loop_frame judged[3000];
    int judged_count;
    int hidden; /* of the track of interest, and its second axis' standard deviations */
    double sigma2_rad, rate_sigma2_radps;
    double correlation; /* of the first axis with the second, of both standard deviations sigma2 */
    double rate_correlation; /* of the first axis with the second axis' rate */
    double off_east_px;
    int other_from; /* frame from which the track that is not of interest is confirmed */
} scene;

static void on_frame(void *user, const bst_loop_frame *frame) {
    scene *s = user;
    assert_int_equal(frame->exposure_id, s->judged_count); /* each once, in order */
    s->judged[s->judged_count++] = *frame;
}

static scene *open_scene(const char *object, int target) {
    scene *s = calloc(1, sizeof *s);
    assert_non_null(s);
    s->world = test_world_with(object, "");
    bst_assert_ok(&s->ctx, bst_world_view_create(&s->ctx, s->world, &s->view));
    bst_assert_ok(&s->ctx,
                  bst_loop_summary_create(&s->ctx, s->world, 0, 0, RATE, target, &s->summary));
    bst_loop_summary_on_frame(s->summary, on_frame, s);
    s->tracks = calloc(1, sizeof *s->tracks + 4 * sizeof *s->tracks->items);
    assert_non_null(s->tracks);
    return s;
}

static void close_scene(scene *s) {
    bst_loop_summary_free(s->summary);
    bst_world_view_free(s->view);
    bst_world_free(s->world);
    free(s->tracks);
    free(s);
}

#define GX5 "{\"name\": \"GX5\", " TEST_GX5 "}"

static bst_world_sight sight_at(scene *s, double t) {
    bst_world_sight sight;
    bst_assert_ok(&s->ctx, bst_world_view_sight(&s->ctx, s->view, 0, 0, t, &sight));
    return sight;
}

/* Exposures of half a second, one a second. */
static double mid_of(int64_t id) {
    return (double)id + 0.25;
}

/* One frame whose target lies (x, y) px of 3 arcsec from the boresight, and so many of these items.
 */
static void truth_with(scene *s, int64_t id, double x, double y, double scale_arcsec,
                       const bst_truth_item *items, int count) {
    bst_world_sight sight = sight_at(s, mid_of(id));
    const double scale = 3.0 * BST_ARCSEC_RAD;
    bst_quat q = bst_quat_look(sight.apparent, (bst_vec3){0, 0, 1});
    /* the attitude in which that apparent direction has these tangent-plane coordinates */
    bst_vec3 want = bst_vec3_unit((bst_vec3){x * scale, y * scale, 1});
    bst_vec3 axis = bst_vec3_cross((bst_vec3){0, 0, 1}, want);
    double angle = bst_vec3_angle((bst_vec3){0, 0, 1}, want);
    q = bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(bst_vec3_unit(axis), angle)), q);
    bst_truth *truth = calloc(1, sizeof *truth + 8 * sizeof *truth->items);
    assert_true(truth && count <= 8);
    *truth = (bst_truth){.exposure_id = id,
                         .start_tick = id * RATE,
                         .end_tick = id * RATE + RATE / 2,
                         .q_cam_from_gcrf_mid = q,
                         .boresight_x_px = 511.5,
                         .boresight_y_px = 511.5,
                         .pixel_scale_arcsec = scale_arcsec,
                         .count = count};
    for (int i = 0; i < count; i++) {
        truth->items[i] = items[i];
    }
    bst_assert_ok(&s->ctx, bst_loop_summary_truth(&s->ctx, s->summary, truth));
    free(truth);
}

static void truth_at(scene *s, int64_t id, double x, double y) {
    truth_with(s, id, x, y, 0.0, NULL, 0);
}

/* Tracks of frame `id`, published 0.4 s after its end; the track of interest lies `off` px beside
 * the target (out along the pole's direction) and moves as the target does. status < 0: no track.
 */
static void tracks_at(scene *s, int64_t id, int status, double off_px) {
    bst_world_sight a = sight_at(s, mid_of(id) - 0.5), b = sight_at(s, mid_of(id) + 0.5),
                    m = sight_at(s, mid_of(id));
    bst_vec3 rate = bst_vec3_sub(b.geometric, a.geometric);
    bst_vec3 aside = bst_vec3_unit(
        bst_vec3_cross(bst_vec3_cross(m.geometric, (bst_vec3){0, 0, 1}), m.geometric));
    bst_vec3 east = bst_vec3_unit(bst_vec3_cross((bst_vec3){0, 0, 1}, m.geometric));
    memset(s->tracks, 0, sizeof *s->tracks);
    s->tracks->exposure_id = id;
    s->tracks->tick = id * RATE + RATE / 4;
    s->tracks->count = 2;
    /* another one, not of interest, right on the target: counts for the confirmation alone */
    s->tracks->items[0] =
        (bst_track){.id = 1,
                    .status = id < s->other_from ? BST_TRACK_TENTATIVE : BST_TRACK_CONFIRMED,
                    .direction_gcrf = m.geometric,
                    .rate_gcrf_radps = rate};
    s->tracks->items[1] =
        (bst_track){.id = 2,
                    .status = status,
                    .target_of_interest = status >= 0,
                    .direction_gcrf = bst_vec3_unit(bst_vec3_axpy(
                        bst_vec3_axpy(m.geometric, off_px * 3 * BST_ARCSEC_RAD, aside),
                        s->off_east_px * 3 * BST_ARCSEC_RAD, east)),
                    .rate_gcrf_radps = rate,
                    .hidden = s->hidden};
    double(*c)[4] = s->tracks->items[1].covariance;
    c[0][0] = BST_ARCSEC_RAD * BST_ARCSEC_RAD;
    c[1][1] = s->sigma2_rad * s->sigma2_rad;
    c[3][3] = s->rate_sigma2_radps * s->rate_sigma2_radps;
    if (s->correlation != 0.0 || s->rate_correlation != 0.0) {
        c[0][0] = c[1][1];
        c[0][1] = c[1][0] = s->correlation * c[1][1];
        c[0][3] = c[3][0] = s->rate_correlation * s->sigma2_rad * s->rate_sigma2_radps;
    }
    bst_loop_summary_tracks(s->summary, s->tracks, id * RATE + 5400);
}

static void mode(scene *s, int64_t id, int m) {
    bst_control_status status = {.tick = id * RATE, .mode = m};
    bst_loop_summary_status(s->summary, &status);
}

static void a_target_that_is_never_confirmed(void **state) {
    (void)state;
    scene *s = open_scene(GX5, 0);
    for (int id = 0; id < 40; id++) {
        mode(s, id, BST_MODE_SEARCH);
        truth_at(s, id, 100, 50);
        tracks_at(s, id, id % 2 ? BST_TRACK_TENTATIVE : -1, 0);
    }
    bst_loop_summary_finish(s->summary);
    bst_loop_figures f;
    bst_loop_summary_figures(s->summary, &f);
    assert_int_equal(f.frames, 40);
    assert_int_equal(f.final_mode, BST_MODE_SEARCH);
    assert_true(isnan(f.time_to_acquire_s) && isnan(f.time_to_settle_s));
    bst_assert_close(f.time_to_confirm_s, 0.9, 1e-12); /* the track that is not of interest */
    assert_true(f.track_fraction == 0 && f.custody == 0);
    assert_int_equal(f.visible_frames, 40);
    assert_int_equal(f.wrong_target_frames, 0);
    assert_int_equal(f.pointing_frames, 0);
    assert_true(isnan(f.pointing_rms_px) && isnan(f.pointing_p99_px) && isnan(f.pointing_bias_px));
    assert_int_equal(s->judged_count, 40);
    for (int id = 0; id < 40; id++) {
        assert_true(s->judged[id].visible);
        assert_false(s->judged[id].in_track || s->judged[id].settled);
        /* the angle of that tangent; rounding: 1e-16 / 1.5e-5 rad per px */
        double tangent = hypot(100, 50) * 3 * BST_ARCSEC_RAD, shrink = atan(tangent) / tangent;
        bst_assert_close(s->judged[id].error_x_px, 100 * shrink, 1e-7);
        bst_assert_close(s->judged[id].error_y_px, 50 * shrink, 1e-7);
        bst_assert_close(s->judged[id].error_px, hypot(100, 50) * shrink, 1e-7);
        bst_assert_close(s->judged[id].target_x_px, 611.5, 1e-7);
        bst_assert_close(s->judged[id].time_s, id + 0.25, 0);
    }
    close_scene(s);
}

/* Confirmed with the tracks of frame 8, acquired with those of frame 10; in track mode from frame
 * 12, within 3 px from frame 15. */
static void times_to_confirm_and_to_settle(void **state) {
    (void)state;
    scene *s = open_scene(GX5, 0);
    s->other_from = 8;
    for (int id = 0; id < 40; id++) {
        mode(s, id, id < 12 ? BST_MODE_ACQUIRE : BST_MODE_TRACK);
        truth_at(s, id, id < 15 ? 4 : 0.3, id < 15 ? 0 : -0.4);
        tracks_at(s, id, id < 10 ? BST_TRACK_TENTATIVE : BST_TRACK_CONFIRMED, 0.2);
    }
    bst_loop_summary_finish(s->summary);
    bst_loop_figures f;
    bst_loop_summary_figures(s->summary, &f);
    bst_assert_close(f.time_to_confirm_s, 8.9, 1e-12);  /* 0.4 s after the end of frame 8 */
    bst_assert_close(f.time_to_acquire_s, 10.9, 1e-12); /* of frame 10 */
    bst_assert_close(f.time_to_settle_s, 15, 1e-12);
    assert_int_equal(f.final_mode, BST_MODE_TRACK);
    /* of the frames after 10.9 s, all; of all, 10 to 39 */
    assert_true(f.track_fraction == 1);
    bst_assert_close(f.custody, 30.0 / 40.0, 1e-15);
    assert_int_equal(f.pointing_frames, 25);
    bst_assert_close(f.pointing_rms_px, 0.5, 1e-7);
    bst_assert_close(f.pointing_bias_px, 0.5, 1e-7);
    assert_true(s->judged[10].in_track && !s->judged[9].in_track);
    assert_true(s->judged[15].settled && !s->judged[14].settled);
    assert_int_equal(s->judged[12].mode, BST_MODE_TRACK);
    close_scene(s);
}

/* A track on something else is no track of the target, and is counted; 5 px is the limit. */
static void the_wrong_target_counts_as_wrong(void **state) {
    (void)state;
    scene *s = open_scene(GX5, 0);
    for (int id = 0; id < 30; id++) {
        mode(s, id, BST_MODE_TRACK);
        truth_at(s, id, 0, 1);
        tracks_at(s, id, id < 10 ? BST_TRACK_CONFIRMED : BST_TRACK_COASTING, id < 20 ? 4.9 : 5.1);
    }
    bst_loop_summary_finish(s->summary);
    bst_loop_figures f;
    bst_loop_summary_figures(s->summary, &f);
    bst_assert_close(f.time_to_confirm_s, 0.9, 1e-12);
    bst_assert_close(f.time_to_acquire_s, 0.9, 1e-12);
    assert_int_equal(f.wrong_target_frames, 10);
    /* frames 1 to 29 begin after the acquisition at 0.9 s; 1 to 19 are right */
    bst_assert_close(f.track_fraction, 19.0 / 29.0, 1e-15);
    close_scene(s);
}

/* A track that predicts its hidden target has no wrong one while its covariance allows
 * the true place; it has when it does not, and when nothing hides it. */
static void a_prediction_within_its_covariance_is_not_wrong(void **state) {
    (void)state;
    const double px = 3 * BST_ARCSEC_RAD;
    const int wrong[] = {0, 25, 25, 25, 8, 16};
    for (int k = 0; k < 6; k++) {
        scene *s = open_scene(GX5, 0);
        for (int id = 0; id < 30; id++) {
            mode(s, id, BST_MODE_COAST);
            truth_at(s, id, 0, 1);
            /* off along the second axis by 4.25 sigma, by 4.33, by far more, by 4.25 but with
             * nothing that hides it, in two frames of three by a second or two of a vague rate, and
             * by 8 sigma of one second and 4 of two */
            s->hidden = k == 3 || id < 5 ? BST_HIDDEN_NOT : BST_HIDDEN_DIM;
            s->sigma2_rad = k == 2 || k >= 4 ? 1e-9 : 4 * px;
            s->rate_sigma2_radps = k == 4 ? 16 * px : k == 5 ? 17.0 / 8.0 * px : 0;
            if (k < 4 || id % 3 == 0) {
                tracks_at(s, id, id < 5 ? BST_TRACK_CONFIRMED : BST_TRACK_COASTING,
                          id < 5   ? 0.1
                          : k == 1 ? 17.3
                                   : 17.0);
            }
        }
        bst_loop_summary_finish(s->summary);
        bst_loop_figures f;
        bst_loop_summary_figures(s->summary, &f);
        assert_int_equal(f.wrong_target_frames, wrong[k]);
        assert_true(f.track_fraction < 0.2); /* within 5 px is what counts as in track */
        close_scene(s);
    }
}

/* Errors along and across the long axis of a correlated covariance: sigma sqrt(1 + rho) along
 * (1, 1), sigma sqrt(1 - rho) across. */
static void a_prediction_has_correlated_axes(void **state) {
    (void)state;
    const double sigma_px = 4, bound = sqrt(18.42);
    const struct {
        double rho, east, north; /* the error over the standard deviation of its own axis */
        int wrong;
    } cases[] = {{0.9, 1, 1, 0},         {0.9, 1, -1, 25}, {0.9, -1, 1, 25},
                 {-0.9, 1, -1, 0},       {-0.9, 1, 1, 25}, {-0.9, -1, -1, 25},
                 {0.9, 1.05, 1.05, 25}, /* 1.03 of the bound */
                 {-0.9, -1.05, 1.05, 25}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        scene *s = open_scene(GX5, 0);
        /* 0.98 of the bound along the long axis, where it is 4 times the bound across */
        double off_px = 0.98 * bound * sigma_px * sqrt(1 + 0.9) / sqrt(2);
        for (int id = 0; id < 30; id++) {
            bool own = id >= 5;
            mode(s, id, BST_MODE_COAST);
            truth_at(s, id, 0, 1);
            s->hidden = own ? BST_HIDDEN_DIM : BST_HIDDEN_NOT;
            s->sigma2_rad = sigma_px * 3 * BST_ARCSEC_RAD;
            s->correlation = cases[k].rho;
            s->off_east_px = own ? cases[k].east * off_px : 0;
            tracks_at(s, id, own ? BST_TRACK_COASTING : BST_TRACK_CONFIRMED,
                      own ? cases[k].north * off_px : 0.1);
        }
        bst_loop_summary_finish(s->summary);
        bst_loop_figures f;
        bst_loop_summary_figures(s->summary, &f);
        assert_int_equal(f.wrong_target_frames, cases[k].wrong);
        close_scene(s);
    }
}

/* A frame without tracks of its own, one second after one that has: the place's covariance grows
 * by its correlation with the rate, so that the long axis turns. */
static void correlation_of_place_and_rate_grows(void **state) {
    (void)state;
    for (int k = 0; k < 2; k++) {
        scene *s = open_scene(GX5, 0);
        /* at 1 s: variances 1 and 2, correlation 0.99 of 1 between them, in units of sigma: along
         * (1, 1) a chi-square of 18.42 lies at 4.29 sigma on each axis, across at 1.94 */
        const double sigma_px = 4, off_px = 3.5 * sigma_px;
        for (int id = 0; id < 2; id++) {
            mode(s, id, BST_MODE_COAST);
            truth_at(s, id, 0, 1);
            s->hidden = BST_HIDDEN_DIM;
            s->sigma2_rad = s->rate_sigma2_radps = sigma_px * 3 * BST_ARCSEC_RAD;
            s->rate_correlation = 0.99;
            s->off_east_px = k == 0 ? off_px : -off_px;
            if (id == 0) {
                tracks_at(s, id, BST_TRACK_COASTING, off_px);
            }
        }
        bst_loop_summary_finish(s->summary);
        bst_loop_figures f;
        bst_loop_summary_figures(s->summary, &f);
        /* frame 0: no correlation yet, sqrt(2) 3.5 sigma off: wrong either way */
        assert_int_equal(f.wrong_target_frames, k == 0 ? 1 : 2);
        close_scene(s);
    }
}

/* Every third frame has no tracks of its own: judged by what was known before. After frame 21 the
 * track of interest is deleted; frames without tracks are then lost too. */
static void dropped_frames_are_judged_by_the_track_known_before(void **state) {
    (void)state;
    scene *s = open_scene(GX5, 0);
    for (int id = 0; id < 30; id++) {
        mode(s, id, BST_MODE_TRACK);
        truth_at(s, id, 0, 1);
        if (id % 3 != 2) {
            tracks_at(s, id, id <= 21 ? BST_TRACK_CONFIRMED : -1, 0.5);
        }
    }
    bst_loop_summary_finish(s->summary);
    bst_loop_figures f;
    bst_loop_summary_figures(s->summary, &f);
    assert_int_equal(s->judged_count, 30);
    for (int id = 0; id < 30; id++) {
        assert_int_equal(s->judged[id].in_track, id <= 21);
    }
    bst_assert_close(f.track_fraction, 21.0 / 29.0, 1e-15);
    close_scene(s);

    /* the other way round: a frame before the first track is not in track, although the next
     * frame's is */
    s = open_scene(GX5, 0);
    truth_at(s, 0, 0, 1);
    truth_at(s, 1, 0, 1);
    tracks_at(s, 1, BST_TRACK_CONFIRMED, 0);
    assert_int_equal(s->judged_count, 2);
    assert_false(s->judged[0].in_track);
    assert_true(s->judged[1].in_track);
    bst_loop_frame newest;
    bst_loop_summary_newest(s->summary, &newest);
    assert_int_equal(newest.exposure_id, 1);
    assert_true(newest.in_track);
    close_scene(s);
}

/* Tracks that never come do not hold up more than a bounded number of frames. */
static void frames_do_not_wait_for_ever(void **state) {
    (void)state;
    scene *s = open_scene(GX5, 0);
    for (int id = 0; id < 200; id++) {
        truth_at(s, id, 0, 1);
    }
    assert_true(s->judged_count >= 200 - 64 && s->judged_count < 200);
    bst_loop_summary_finish(s->summary);
    assert_int_equal(s->judged_count, 200);
    bst_loop_figures f;
    bst_loop_summary_figures(s->summary, &f);
    assert_int_equal(f.frames, 200);
    close_scene(s);
}

static int by_size(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Rayleigh-distributed errors: the RMS is exact, the percentile right to a bin of 0.1 %. */
static void rms_is_exact_and_p99_within_a_bin(void **state) {
    (void)state;
    scene *s = open_scene(GX5, 0);
    enum { N = 1000 };
    double errors[N], sum2 = 0, sx = 0, sy = 0;
    mode(s, 0, BST_MODE_TRACK);
    truth_at(s, 0, 0, 1);
    tracks_at(s, 0, BST_TRACK_CONFIRMED, 0);
    unsigned seed = 1;
    for (int i = 0; i < N; i++) {
        double u[2];
        for (int k = 0; k < 2; k++) {
            seed = seed * 1664525u + 1013904223u;
            u[k] = ((double)(seed >> 8) + 0.5) / 16777216.0;
        }
        double r = 0.4 * sqrt(-2 * log(u[0])), phi = 2 * BST_PI * u[1];
        double x = r * cos(phi) + 0.05, y = r * sin(phi);
        errors[i] = hypot(x, y);
        sum2 += x * x + y * y;
        sx += x;
        sy += y;
        truth_at(s, i + 1, x, y);
    }
    bst_loop_summary_finish(s->summary);
    bst_loop_figures f;
    bst_loop_summary_figures(s->summary, &f);
    assert_int_equal(f.pointing_frames, N);
    bst_assert_close(f.pointing_rms_px, sqrt(sum2 / N), 1e-8);
    bst_assert_close(f.pointing_bias_px, hypot(sx, sy) / N, 1e-8);
    qsort(errors, N, sizeof *errors, by_size);
    double p99 = errors[(int)ceil(0.99 * N) - 1];
    bst_assert_close(f.pointing_p99_px / p99, 1, 0.001);
    close_scene(s);
}

/* In the dark nothing is visible: such frames count neither for nor against. */
static void frames_without_light_do_not_count(void **state) {
    (void)state;
    scene *s = open_scene("{\"name\": \"GX5\", \"albedo\": 0, " TEST_GX5 "}", 0);
    for (int id = 0; id < 20; id++) {
        mode(s, id, BST_MODE_TRACK);
        truth_at(s, id, 0, 1);
        tracks_at(s, id, BST_TRACK_CONFIRMED, 0);
        assert_false(s->judged[id].visible);
    }
    bst_loop_figures f;
    bst_loop_summary_figures(s->summary, &f);
    assert_true(f.track_fraction == 0);
    close_scene(s);
}

/* No target at all, or one that has come down: whatever is tracked is wrong. */
static void without_a_target_every_track_is_wrong(void **state) {
    (void)state;
    for (int k = 0; k < 2; k++) {
        scene *s = open_scene(GX5
                              ", {\"name\": \"gone\", \"orbit\": {\"elements_file\": "
                              "\"tests/world/data/decayed.tle\", \"norad\": 28872}}",
                              k == 0 ? -1 : 1);
        for (int id = 0; id < 5; id++) {
            truth_at(s, id, 0, 1);
            tracks_at(s, id, BST_TRACK_CONFIRMED, 0);
        }
        bst_loop_figures f;
        bst_loop_summary_figures(s->summary, &f);
        assert_int_equal(f.wrong_target_frames, 5);
        assert_true(isnan(f.time_to_confirm_s) && isnan(f.time_to_acquire_s));
        assert_true(isnan(s->judged[0].error_px));
        assert_false(s->judged[0].visible);
        close_scene(s);
    }
}

/* An exposure with a scale of its own has pixels of its own; the target's SNR is that of the item
 * that is the target and in the field. */
static void places_at_another_scale(void **state) {
    (void)state;
    scene *s = open_scene(GX5, 0);
    static const bst_truth_item items[] = {
        {.kind = BST_SOURCE_STAR, .id = 0, .flags = BST_TRUTH_IN_FIELD, .snr = 3},
        {.kind = BST_SOURCE_OBJECT, .id = 0, .flags = BST_TRUTH_IN_FIELD, .snr = 11},
        {.kind = BST_SOURCE_OBJECT, .id = 0, .flags = 0, .snr = 4},
        {.kind = BST_SOURCE_OBJECT, .id = 1, .flags = BST_TRUTH_IN_FIELD, .snr = 5},
    };
    static const double scales[] = {0, 3, 6, 1.5};
    for (int id = 0; id < 4; id++) {
        truth_with(s, id, 40, -25, scales[id], items, id == 3 ? 1 : 4);
        bst_loop_frame newest;
        bst_loop_summary_newest(s->summary, &newest);
        assert_int_equal(newest.exposure_id, id);
        tracks_at(s, id, -1, 0);
        double size = scales[id] > 0 ? 3 / scales[id] : 1;
        const bst_loop_frame *f = &s->judged[id];
        /* rounding of angles of 1e-3 rad; the angle is shorter than its tangent by r^2 / 3 */
        bst_assert_close(f->target_x_px, 511.5 + 40 * size, 1e-6);
        bst_assert_close(f->target_y_px, 511.5 - 25 * size, 1e-6);
        bst_assert_close(f->error_x_px, 40 * size, 1e-4);
        bst_assert_close(f->error_y_px, -25 * size, 1e-4);
        bst_assert_close(f->error_px, hypot(40, 25) * size, 1e-4);
        bst_assert_close(f->target_snr, id == 3 ? 0 : 11, 0);
        bst_assert_close(f->time_s, mid_of(id), 1e-12);
        bst_assert_close(newest.error_px, f->error_px, 0);
    }
    close_scene(s);
}

/* A new target is to be acquired and settled on anew; the first times stay. */
static void another_target_begins_anew(void **state) {
    (void)state;
    scene *s = open_scene(GX5 ", {\"name\": \"twin\", " TEST_GX5 "}", 0);
    for (int id = 0; id < 8; id++) {
        if (id == 4) {
            bst_loop_summary_retarget(s->summary, 1);
        }
        mode(s, id, id == 4 || id == 5 ? BST_MODE_SLEW : BST_MODE_TRACK);
        truth_at(s, id, 0, 1);
        tracks_at(s, id, id == 4 ? BST_TRACK_TENTATIVE : BST_TRACK_CONFIRMED, 0);
    }
    static const bool acquired[] = {false, true, true, true, false, false, true, true};
    static const bool settled[] = {false, true, true, true, false, false, true, true};
    for (int id = 0; id < 8; id++) {
        assert_true(s->judged[id].acquired == acquired[id]);
        assert_true(s->judged[id].settled == settled[id]);
        assert_int_equal(s->judged[id].mode, id == 4 || id == 5 ? BST_MODE_SLEW : BST_MODE_TRACK);
    }
    bst_loop_figures f;
    bst_loop_summary_figures(s->summary, &f);
    bst_assert_close(f.time_to_acquire_s, 0.9, 1e-12); /* its tracks come 0.4 s after its end */
    bst_assert_close(f.time_to_settle_s, 1.0, 1e-12);
    assert_int_equal(f.frames, 8);
    assert_int_equal(f.final_mode, BST_MODE_TRACK);
    close_scene(s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_target_that_is_never_confirmed),
        cmocka_unit_test(times_to_confirm_and_to_settle),
        cmocka_unit_test(the_wrong_target_counts_as_wrong),
        cmocka_unit_test(a_prediction_within_its_covariance_is_not_wrong),
        cmocka_unit_test(a_prediction_has_correlated_axes),
        cmocka_unit_test(correlation_of_place_and_rate_grows),
        cmocka_unit_test(dropped_frames_are_judged_by_the_track_known_before),
        cmocka_unit_test(frames_do_not_wait_for_ever),
        cmocka_unit_test(rms_is_exact_and_p99_within_a_bin),
        cmocka_unit_test(places_at_another_scale),
        cmocka_unit_test(another_target_begins_anew),
        cmocka_unit_test(frames_without_light_do_not_count),
        cmocka_unit_test(without_a_target_every_track_is_wrong),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
