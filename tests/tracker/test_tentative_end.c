/* How long tracks wait for their next detection: one that is not yet confirmed, and one whose place
 * becomes uncertain along one axis. */
#include <math.h>

#include "tests/tracker/pixel_tracker.h"

static bool outside(const void *user, bst_vec3 direction) {
    (void)user;
    (void)direction;
    return false;
}

static bst_vec3 place(double x_px) {
    return bst_vec3_from_radec(1.0 + x_px * PX, 0.0);
}

/* One detection, or none with the object beside the field; its errors along both axes. */
static void frame_of(bst_mtt *mtt, double seconds, bool seen, double sigma1, double sigma2) {
    const bst_mtt_detection one = {.sky = {.direction = place(2 * seconds),
                                           .cov_11 = pow(sigma1 * PX, 2),
                                           .cov_22 = pow(sigma2 * PX, 2)},
                                   .v_mag = 13.0,
                                   .v_mag_sigma = 0.05,
                                   .snr = 20};
    const bst_mtt_frame f = {.tick = llround(1000 * seconds),
                             .seconds = seconds,
                             .detections = &one,
                             .count = seen,
                             .in_field = seen ? NULL : outside};
    bst_mtt_step(mtt, &f);
}

static void frame(bst_mtt *mtt, double seconds, bool seen) {
    frame_of(mtt, seconds, seen, 0.1, 0.1);
}

/* Tracks after a gap that follows detections at 0 and 1 s. */
static int tracks_after(double gap_s, int hits, int frames, double coast_s) {
    bst_ctx ctx = {0};
    bst_mtt *mtt;
    bst_mtt_params p = pixel_tracker(16, 16);
    int count;
    p.confirm_hits = hits;
    p.confirm_frames = frames;
    p.max_coast_s = coast_s;
    p.max_sigma_rad = 1;
    bst_assert_ok(&ctx, bst_mtt_create(&ctx, &p, &mtt));
    frame(mtt, 0, true);
    frame(mtt, 1, true);
    bst_mtt_tracks(mtt, &count);
    assert_int_equal(count, 1);
    frame(mtt, 1 + gap_s, false);
    bst_mtt_tracks(mtt, &count);
    bst_mtt_free(mtt);
    return count;
}

/* The time in which two detections start a track (5 s), once for each frame that may miss and once
 * more; never longer than a confirmed track coasts. */
static void patience(void **state) {
    (void)state;
    static const struct {
        int hits, frames;
        double coast_s, wanted_s;
    } cases[] = {{3, 5, 120, 15}, {3, 3, 120, 5}, {4, 6, 120, 15}, {3, 7, 120, 25}, {3, 5, 8, 8}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        for (int late = 0; late < 2; late++) {
            double gap_s = cases[i].wanted_s + (late ? 0.01 : -0.01);
            assert_int_equal(tracks_after(gap_s, cases[i].hits, cases[i].frames, cases[i].coast_s),
                             !late);
        }
    }
}

/* A confirmed track is given up once either standard deviation of its direction is 5 px. */
static void uncertain_along_an_axis(void **state) {
    (void)state;
    for (int axis = 0; axis < 2; axis++) {
        bst_ctx ctx = {0};
        bst_mtt *mtt;
        bst_mtt_params p = pixel_tracker(16, 16);
        p.max_coast_s = 1e4;
        p.max_sigma_rad = 5 * PX;
        bst_assert_ok(&ctx, bst_mtt_create(&ctx, &p, &mtt));
        int count, n = 0;
        for (; n < 8; n++) {
            frame_of(mtt, n, true, axis ? 0.1 : 0.8, axis ? 0.8 : 0.1);
        }
        double wide = 0.0, before = 0.0, narrow = 0.0, limit = 25 * PX * PX;
        for (; n < 400; n++) {
            frame(mtt, n, false);
            const bst_mtt_track *track = bst_mtt_tracks(mtt, &count);
            if (count == 0) {
                break;
            }
            assert_int_not_equal(track->status, BST_TRACK_TENTATIVE);
            before = wide;
            wide = track->state.covariance[axis][axis];
            narrow = track->state.covariance[1 - axis][1 - axis];
            assert_true(wide < limit);
        }
        assert_true(n > 10 && n < 399);
        assert_true(narrow < 0.5 * wide);
        assert_true(wide + 3.0 * (wide - before) > limit); /* it was about to exceed it */
        bst_mtt_free(mtt);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(patience),
                                       cmocka_unit_test(uncertain_along_an_axis)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
