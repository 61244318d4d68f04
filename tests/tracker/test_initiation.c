/* New tracks beside a cue whose motion bends. */
#include <stdlib.h>

#include "boresight/rng.h"
#include "tests/tracker/pixel_tracker.h"
#include "tracker/mtt/multitarget_internal.h"

enum { FRAMES = 12 };

/* Place and rate after t seconds at `acceleration` along a great circle. */
static bst_vec3 place(double acceleration, double rate, double t, bst_vec3 *rate_radps) {
    double angle = rate * t + 0.5 * acceleration * t * t, now = rate + acceleration * t;
    *rate_radps = (bst_vec3){-now * sin(angle), now * cos(angle), 0.0};
    return (bst_vec3){cos(angle), sin(angle), 0.0};
}

/* Frames every 2 s; sharp detections with errors of 0.02 px, which are believed to be that; what
 * accelerates by 1 arcsec/s2 is 0.33 px further after 2 s than the rate between two frames has it
 * at the later one, and its rate 0.33 px/s greater. The first pair gives the rate at its end, so
 * that the third detection is the track's, and all that follow; also when the second frame shows
 * nothing, so that the pair is 4 s apart. */
static void pairs_have_the_cues_acceleration(void **state) {
    (void)state;
    const double acceleration = 1.0 * AS, rate = 200.0 * AS, sigma = 0.02 * PX;
    for (int gap = 0; gap < 2; gap++) {
        bst_ctx ctx = {0};
        bst_mtt *mtt;
        bst_mtt_params params = pixel_tracker(16, 16);
        bst_assert_ok(&ctx, bst_mtt_create(&ctx, &params, &mtt));
        bst_vec3 before = {0}, before_rate = {0}, cue_rate;
        for (int k = 0; k < FRAMES; k++) {
            double t = 2.0 * k;
            bst_vec3 cue = place(acceleration, rate, t, &cue_rate);
            double off = k % 2 ? sigma : -sigma; /* along the path */
            bst_mtt_detection seen = {
                .sky = {.direction = bst_vec3_unit(
                            bst_vec3_add(cue, bst_vec3_scale(bst_vec3_unit(cue_rate), off))),
                        .cov_11 = sigma * sigma,
                        .cov_22 = sigma * sigma},
                .v_mag = 10,
                .v_mag_sigma = 0.05,
                .snr = 500,
                .length_rad = 2 * PX};
            bst_mtt_frame f = {.tick = 2000 * k,
                               .seconds = t,
                               .detections = &seen,
                               .count = gap && k == 1 ? 0 : 1,
                               .cue_valid = true,
                               .cue_before_valid = k > 0,
                               .cue_direction = cue,
                               .cue_rate_radps = cue_rate,
                               .cue_before_direction = before,
                               .cue_before_rate_radps = before_rate,
                               .cue_rate_sigma_radps = 0.5 * AS};
            bst_mtt_step(mtt, &f);
            before = cue;
            before_rate = cue_rate;
            int n;
            const bst_mtt_track *tracks = bst_mtt_tracks(mtt, &n);
            int seen_so_far = k + 1 - (gap && k > 0);
            assert_int_equal(n, seen_so_far > 1);
            if (n > 0) {
                assert_int_equal(tracks->hits, seen_so_far);
                assert_int_equal(tracks->status,
                                 seen_so_far > 2 ? BST_TRACK_CONFIRMED : BST_TRACK_TENTATIVE);
            }
        }
        bst_mtt_free(mtt);
    }
}

/* An object over four frames, `charged` detections of each taken for charge; its score after them,
 * and whether it was confirmed. */
static double score_among(int charged, double confirm_score, bool *confirmed) {
    bst_ctx ctx = {0};
    bst_mtt *mtt;
    bst_mtt_params params = pixel_tracker(16, 16);
    params.confirm_score = confirm_score;
    bst_assert_ok(&ctx, bst_mtt_create(&ctx, &params, &mtt));
    for (int k = 0; k < 4; k++) {
        bst_vec3 rate;
        bst_mtt_detection seen = {.sky = {.direction = place(0.0, 20.0 * AS, k, &rate),
                                          .cov_11 = 0.01 * PX * PX,
                                          .cov_22 = 0.01 * PX * PX},
                                  .v_mag = 10,
                                  .v_mag_sigma = 0.05,
                                  .snr = 50,
                                  .length_rad = 2 * PX};
        bst_mtt_frame f = {
            .tick = 1000 * k, .seconds = k, .detections = &seen, .count = 1, .charged = charged};
        bst_mtt_step(mtt, &f);
    }
    int n;
    const bst_mtt_track *tracks = bst_mtt_tracks(mtt, &n);
    assert_int_equal(n, 1);
    double score = tracks->score;
    *confirmed = tracks->status == BST_TRACK_CONFIRMED;
    bst_mtt_free(mtt);
    return score;
}

/* Among N detections that may start false tracks the odds of a track are N/100 times worse. */
static void many_alarms_ask_for_more(void **state) {
    (void)state;
    bool confirmed;
    double alone = score_among(0, 5.0, &confirmed);
    assert_true(confirmed);
    /* 100 are few; the detection itself is another one */
    assert_true(fabs(score_among(99, 5.0, &confirmed) - alone) < 1e-12);
    assert_true(fabs(score_among(2000, 5.0, &confirmed) - (alone - log(2001.0 / 100.0))) < 1e-9);
    assert_true(confirmed);
    score_among(0, alone - 1.0, &confirmed);
    assert_true(confirmed);
    score_among(2000, alone - 1.0, &confirmed);
    assert_false(confirmed);
}

/* Two objects of equal brightness at rest among each other, 4 px apart along the first tangent
 * axis, in two frames, of which one resolves them. Returns the tracks; the objects move at no rate.
 */
static int pair_in_two_frames(bool blended_first, double blend_mag, bst_mtt **mtt,
                              const bst_mtt_track **tracks) {
    bst_ctx ctx = {0};
    bst_mtt_params params = pixel_tracker(16, 16);
    params.association = BST_MTT_PMB;
    params.merge_rad = 6 * PX;
    params.star_rate_radps = 0.0;
    params.max_rate_radps = 5 * PX;
    bst_assert_ok(&ctx, bst_mtt_create(&ctx, &params, mtt));
    bst_vec3 centre = {1, 0, 0};
    bst_tangent axes = bst_tangent_at(centre);
    for (int k = 0; k < 2; k++) {
        bst_mtt_detection seen[2];
        int count = blended_first == (k == 0) ? 1 : 2;
        for (int i = 0; i < count; i++) {
            double x = count == 1 ? 0.0 : i == 0 ? -2.02 * PX : 1.98 * PX;
            seen[i] = (bst_mtt_detection){
                .sky = {.direction = bst_tangent_exp(centre, bst_tangent_vector(&axes, x, 0.0)),
                        .cov_11 = 0.01 * PX * PX,
                        .cov_22 = 0.01 * PX * PX},
                .x_px = x / PX,
                .v_mag = count == 1 ? blend_mag : 12.0,
                .v_mag_sigma = 0.05,
                .snr = 20,
                .length_rad = 2 * PX};
        }
        bst_mtt_frame f = {.tick = 1000 * k, .seconds = k, .detections = seen, .count = count};
        bst_mtt_step(*mtt, &f);
    }
    int n;
    *tracks = bst_mtt_tracks(*mtt, &n);
    return n;
}

/* A track that begins with a detection of two objects, or whose second one is that, has the rate of
 * the objects, not the 2 px/s from the centre of light to one of them. If the single detection is
 * as bright as one object, it is most likely one object: 2 px/s. */
static void births_from_blended_detections(void **state) {
    (void)state;
    for (int k = 0; k < 4; k++) {
        bool blended_first = k % 2, both = k < 2;
        bst_mtt *mtt;
        const bst_mtt_track *tracks;
        /* 0.7526 mag: twice the light */
        int n = pair_in_two_frames(blended_first, both ? 12.0 - 0.7526 : 12.0, &mtt, &tracks);
        assert_int_equal(n, 2);
        for (int t = 0; t < n; t++) {
            double rate = bst_vec3_norm(tracks[t].state.rate_radps) / PX;
            double sigma = sqrt(tracks[t].state.covariance[2][2]) / PX;
            if (both) {
                /* 1 px of relative motion, half the offset, and the rest of the other hypothesis */
                assert_true(rate < 0.2 && sigma > 0.9 && sigma < 1.3);
                bst_assert_close(tracks[t].v_mag, 12.0, 1e-12);
                /* of the one detection that is not merged; no floor */
                bst_assert_close(tracks[t].v_mag_variance, 0.05 * 0.05, 1e-12);
            } else {
                /* a magnitude known to 0.3 leaves 15 % of the weight to the other hypothesis */
                assert_true(fabs(rate - 2.0) < 0.4 && sigma > 0.7 && sigma < 0.9);
            }
        }
        bst_mtt_free(mtt);
    }
}

/* Without a cue, with existence probabilities: of an object that the second frame does not show,
 * the third starts a track, beside false detections in the frames between, and the next confirm
 * it. `gnn` waits for two frames in a row. */
static void pairs_across_a_missed_detection(void **state) {
    (void)state;
    for (int gnn = 0; gnn < 2; gnn++) {
        bst_ctx ctx = {0};
        bst_mtt *mtt;
        bst_mtt_params params = pixel_tracker(64, 16);
        params.association = gnn ? BST_MTT_GNN : BST_MTT_PMB;
        bst_assert_ok(&ctx, bst_mtt_create(&ctx, &params, &mtt));
        for (int k = 0; k < 5; k++) {
            bst_vec3 rate, other;
            bst_mtt_detection seen[2] = {{.sky = {.direction = place(0.0, 20.0 * AS, k, &rate),
                                                  .cov_11 = 0.01 * PX * PX,
                                                  .cov_22 = 0.01 * PX * PX},
                                          .v_mag = 10,
                                          .v_mag_sigma = 0.05,
                                          .snr = 50,
                                          .length_rad = 2 * PX}};
            seen[1] = seen[0];
            seen[1].sky.direction = place(0.0, -40.0 * AS, 1.0, &other);
            bst_mtt_frame f = {.tick = 1000 * k,
                               .seconds = k,
                               .detections = k == 1 ? &seen[1] : seen,
                               .count = k == 3 ? 0 : 1};
            bst_mtt_step(mtt, &f);
            int n, mine = 0, confirmed = 0;
            bst_vec3 first = place(0.0, 20.0 * AS, 0.0, &rate);
            const bst_mtt_track *tracks = bst_mtt_tracks(mtt, &n);
            for (int t = 0; t < n; t++) {
                bool at = bst_vec3_angle(tracks[t].first_direction, first) < 0.1 * PX;
                mine += at && tracks[t].first_tick == 0 &&
                        fabs(bst_vec3_norm(tracks[t].state.rate_radps) - 20.0 * AS) < 1.0 * AS;
                confirmed += tracks[t].status == BST_TRACK_CONFIRMED;
            }
            assert_int_equal(mine, k >= 2 && !gnn);
            assert_int_equal(confirmed, k == 4 && !gnn);
        }
        bst_mtt_free(mtt);
    }
}

/* Twenty false detections a frame for 60 frames, of an SNR from 5 to 6; then an object of `snr`, of
 * which the second frame has no detection. Frame in which it is confirmed, counted from its first;
 * `most`: not in these. */
static int confirmed_after(double snr, int most) {
    bst_ctx ctx = {0};
    bst_mtt *mtt;
    bst_mtt_params params = pixel_tracker(256, 32);
    params.association = BST_MTT_PMB;
    bst_assert_ok(&ctx, bst_mtt_create(&ctx, &params, &mtt));
    bst_rng_key key = bst_rng_make_key(1, 0, "initiation", "alarms");
    const bst_vec3 centre = {1, 0, 0};
    bst_tangent axes = bst_tangent_at(centre);
    uint64_t draw = 0;
    int frames = 0, n = 0;
    for (int k = 0; k < 60 + most && n == 0; k++) {
        bst_mtt_detection seen[21];
        int count = 0;
        for (int i = 0; i < 20; i++) {
            double x = FIELD_PX * (bst_rng_uniform(key, 0, draw) - 0.5);
            double y = FIELD_PX * (bst_rng_uniform(key, 0, draw + 1) - 0.5);
            bst_vec3 off = bst_tangent_vector(&axes, x * PX, y * PX);
            seen[count++] = (bst_mtt_detection){.sky.direction = bst_tangent_exp(centre, off),
                                                .snr = 5.0 + bst_rng_uniform(key, 0, draw + 2)};
            draw += 3;
        }
        if (k >= 60 && k != 61) {
            bst_vec3 rate;
            seen[count++] = (bst_mtt_detection){
                .sky.direction = place(0.0, 20.0 * AS, k - 60, &rate), .snr = snr};
        }
        for (int i = 0; i < count; i++) {
            seen[i].sky.cov_11 = seen[i].sky.cov_22 = pow(0.1 * PX, 2);
            seen[i].v_mag = 15.0 - 2.5 * log10(seen[i].snr / 10.0);
            seen[i].v_mag_sigma = 1.0857 / seen[i].snr;
            seen[i].length_rad = 2 * PX;
        }
        bst_mtt_frame f = {.tick = 1000 * k,
                           .seconds = k,
                           .detections = seen,
                           .count = count,
                           .threshold_snr = 5.0};
        bst_mtt_step(mtt, &f);
        int tracks;
        const bst_mtt_track *track = bst_mtt_tracks(mtt, &tracks);
        for (int i = 0; i < tracks; i++) {
            n += track[i].status == BST_TRACK_CONFIRMED;
        }
        frames = k - 60;
    }
    bst_mtt_free(mtt);
    return n > 0 ? frames : most;
}

/* Where false detections are faint, three of SNR 20 are enough, and four of SNR 5.5 are needed. */
static void bright_objects_are_confirmed_sooner(void **state) {
    (void)state;
    assert_int_equal(confirmed_after(20.0, 10), 3);
    assert_int_equal(confirmed_after(5.5, 10), 4);
}

/* The likelihood ratio of a pair of detections by its SNR: figures from the formulas of the
 * documentation (equations of tracking), computed apart from the program. */
static void brightness_of_pairs(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_mtt *m;
    bst_mtt_params params = pixel_tracker(16, 16);
    bst_assert_ok(&ctx, bst_mtt_create(&ctx, &params, &m));
    assert_true(bst_mtt_pair_brightness(m, 20.0, 20.0) == 0.0); /* threshold unknown */
    m->threshold_snr = 5.0;
    assert_true(bst_mtt_pair_brightness(m, NAN, 20.0) == 0.0);
    bst_assert_close(bst_mtt_pair_brightness(m, 20.0, 20.0), log(0.9 / 0.5), 1e-9);
    for (int i = 0; i < 190; i++) {
        bst_mtt_note_alarm(m, 5.5, 1.0);
    }
    /* shares of false alarms: (190 + 10/6)/200 of SNR 5 to 6, 0.025 above 10 */
    bst_assert_close(bst_mtt_pair_brightness(m, 20.0, 10.5), log(0.5 / 0.025 * 0.9 / 0.025), 1e-9);
    /* 1/10/200 of SNR 10 and 5/42 of 6 to 7: the second one after 1 + e^-0.25 + ... */
    double sum = 1.0 + 2.0 * exp(-0.25) + exp(-1.0) + exp(-2.25) + exp(-4.0);
    double p6 = 5.0 / 42.0, p7 = 5.0 / 56.0;
    double second = exp(-0.25) / sum / (p7 / 20.0);
    bst_assert_close(bst_mtt_pair_brightness(m, 6.5, 7.5), log(p6 / (p6 / 20.0) * second), 1e-9);
    assert_true(bst_mtt_pair_brightness(m, 5.5, 5.5) == 0.0); /* never against an object */
    bst_mtt_fade_alarms(m);
    bst_assert_close(m->alarm_snr[0], 190.0 * 199.0 / 200.0, 1e-9);
    bst_mtt_note_alarm(m, 5.5, -500.0);
    assert_true(m->alarm_snr[0] == 0.0);
    bst_mtt_free(m);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(births_from_blended_detections),
                                       cmocka_unit_test(pairs_have_the_cues_acceleration),
                                       cmocka_unit_test(many_alarms_ask_for_more),
                                       cmocka_unit_test(pairs_across_a_missed_detection),
                                       cmocka_unit_test(bright_objects_are_confirmed_sooner),
                                       cmocka_unit_test(brightness_of_pairs)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
