/* Detections that two tracks share: which, with which covariance, and from both sides of each
 * limit. Two confirmed tracks on a slanting line, of which one or both are missed. */
#include "tests/tracker/sky_bench.h"
#include "tracker/mtt/multitarget_internal.h"

static bst_vec3 beside(bst_vec3 at, double x, double y) {
    bst_tangent axes = bst_tangent_at(at);
    return bst_tangent_exp(at, bst_tangent_vector(&axes, x, y));
}

static bst_vec3 middle_of_field(void) {
    return bst_vec3_from_radec(1.1, -0.6);
}

static void put_track(bst_mtt *m, double x_as, double y_as, double v_mag) {
    bst_mtt_track *t = &m->tracks[m->track_count];
    *t = (bst_mtt_track){.id = 10 + m->track_count,
                         .status = BST_TRACK_CONFIRMED,
                         .v_mag = v_mag,
                         .v_mag_variance = 0.01,
                         .hits = 20 - m->track_count};
    t->state.direction = beside(middle_of_field(), x_as * AS, y_as * AS);
    for (int i = 0; i < 4; i++) {
        t->state.covariance[i][i] = (i < 2 ? 0.25 : 1e-4) * AS * AS;
    }
    m->detection_of_track[m->track_count] = -1;
    m->observable[m->track_count] = true;
    m->shared[m->track_count++] = BST_MTT_ALONE;
}

/* owner: a track, or negative. */
static void put_detection(bst_mtt *m, double x_as, double y_as, double v_mag, int owner) {
    int k = m->now.count++;
    m->now.items[k] =
        (bst_mtt_detection){.sky = {.direction = beside(middle_of_field(), x_as * AS, y_as * AS),
                                    .cov_11 = 0.09 * AS * AS,
                                    .cov_22 = 0.09 * AS * AS},
                            .v_mag = v_mag,
                            .v_mag_sigma = 0.1};
    m->now.used[k] = owner >= 0;
    m->owner[k] = owner;
    if (owner >= 0) {
        m->detection_of_track[owner] = k;
    }
}

static bst_mtt *make(void) {
    bst_ctx ctx = {0};
    bst_mtt *m;
    bst_mtt_params params = defaults(); /* 18 arcsec, floor 0.9 arcsec */
    params.max_tracks = params.max_detections = 10;
    bst_assert_ok(&ctx, bst_mtt_create(&ctx, &params, &m));
    m->now.count = 0;
    return m;
}

static void share(bst_mtt *m) {
    bst_mtt_pool_index(&m->now);
    bst_mtt_share(m);
}

static void expect_extra(const double extra[3], double x_as, double y_as, double factor) {
    /* tangent axes of both turn by 1e-4 */
    bst_assert_close(extra[0] / (AS * AS), factor * x_as * x_as + 0.81, 0.1);
    bst_assert_close(extra[1] / (AS * AS), factor * x_as * y_as, 0.1);
    bst_assert_close(extra[2] / (AS * AS), factor * y_as * y_as + 0.81, 0.1);
}

/* A missed track uses its neighbour's detection, each with the separation as an error; not beyond
 * merge_rad, not if it is not observable, a star, or tentative. */
static void a_missed_track_shares(void **state) {
    (void)state;
    for (int n = 0; n < 7; n++) {
        bst_mtt *m = make();
        double far = n == 1 ? 18.05 / 10.0 : n == 2 ? 17.95 / 10.0 : 1.0;
        put_track(m, 0, 0, 12.0);
        put_track(m, 8.0 * far, -6.0 * far, 12.2);
        put_detection(m, 4.0 * far, -3.0 * far, 11.4, 0);
        m->observable[1] = n != 3;
        m->tracks[1].star = n == 4;
        m->tracks[1].status = n == 5 ? BST_TRACK_TENTATIVE : BST_TRACK_CONFIRMED;
        m->tracks[0].asleep = n == 6;
        share(m);
        bool shared = n == 0 || n == 2;
        assert_int_equal(m->detection_of_track[1], shared ? 0 : -1);
        assert_int_equal(m->detection_of_track[0], 0);
        assert_int_equal(m->owner[0], shared ? BST_MTT_SEVERAL : 0);
        for (int k = 0; k < 2; k++) {
            assert_int_equal(m->shared[k], shared ? BST_MTT_WIDENED : BST_MTT_ALONE);
            if (shared) {
                expect_extra(m->extra[k], 8.0 * far, -6.0 * far, 1.0);
            }
        }
        bst_mtt_free(m);
    }
}

/* Both missed: the free detection nearest to the middle between them, within merge_rad of it and in
 * the gates of both. */
static void two_missed_tracks_share(void **state) {
    (void)state;
    for (int n = 0; n < 3; n++) {
        bst_mtt *m = make();
        put_track(m, 0, 0, 12.0);
        put_track(m, 8, -6, 12.2);
        put_detection(m, 5.5, -4.5, 11.4, -1);
        if (n < 2) {
            put_detection(m, 4.1, -2.9, 11.4, -1);
        }
        put_detection(m, 4, -3, 11.4, -1);
        m->now.used[n < 2 ? 2 : 1] = true; /* another one's */
        if (n == 1) { /* aside of the line, beyond the gate: 4 sigma are 4.3 arcsec */
            m->now.items[1].sky.direction =
                beside(middle_of_field(), 4.0 * AS + 3.6 * AS, -3.0 * AS + 4.8 * AS);
            m->now.used[0] = true;
        }
        share(m);
        int want = n == 0 ? 1 : n == 1 ? -1 : 0;
        assert_int_equal(m->detection_of_track[0], want);
        assert_int_equal(m->detection_of_track[1], want);
        if (want >= 0) {
            assert_true(m->now.used[want]);
            assert_int_equal(m->owner[want], BST_MTT_SEVERAL);
            expect_extra(m->extra[0], 8, -6, 1.0);
        }
        bst_mtt_free(m);
    }
}

/* Of two objects that were seen apart in five frames one hides the other from two thirds of the
 * light on, 0.753 mag: the detection is its own, shifted by the other's share of the light. */
static void the_brighter_one_hides_the_other(void **state) {
    (void)state;
    for (int n = 0; n < 8; n++) {
        bst_mtt *m = make();
        double mag = (const double[]){0.74, 0.77, 2.0, 2.0, 2.0, 2.0, 0.77, 2.0}[n];
        int bright = n < 6 ? 0 : 1;
        put_track(m, 0, 0, bright ? 12.0 + mag : 12.0);
        put_track(m, 8, -6, bright ? 12.0 : 12.0 + mag);
        double light = 1.0 / (1.0 + pow(10.0, -0.4 * mag)), dim = 1.0 - light;
        double at = bright ? light : dim; /* centre of light on the way from track 0 */
        /* 5: the detection has the magnitude of the dimmer one */
        put_detection(m, 8 * at, -6 * at, n == 5 ? 13.9 : 11.9, 0);
        m->tracks[0].apart = n == 3 ? 4 : 5;
        m->tracks[1].apart = n == 4 ? 4 : 5;
        share(m);
        bool hides = n == 1 || n == 2 || n > 4;
        assert_int_equal(m->detection_of_track[1], 0);
        if (n == 5) { /* track 0 keeps what it has, the other one is hidden */
            assert_int_equal(m->shared[0], BST_MTT_ALONE);
            assert_int_equal(m->shared[1], BST_MTT_HIDDEN);
        } else if (hides) {
            assert_int_equal(m->detection_of_track[0], 0);
            assert_int_equal(m->shared[bright], BST_MTT_OUTSHINING);
            assert_int_equal(m->shared[1 - bright], BST_MTT_HIDDEN);
            assert_int_equal(m->owner[0], bright);
            expect_extra(m->extra[bright], 8, -6, dim * dim);
        } else {
            assert_int_equal(m->shared[0], BST_MTT_WIDENED);
            assert_int_equal(m->shared[1], BST_MTT_WIDENED);
        }
        bst_mtt_free(m);
    }
}

/* Two tracks of one object: closer than resolved pairs are, at one rate to three standard
 * deviations, five frames on shared detections. The one with fewer hits ends. */
static void duplicates_end(void **state) {
    (void)state;
    for (int n = 0; n < 7; n++) {
        bst_mtt *m = make();
        double off = n == 1 ? 0.95 : 0.85; /* floor 0.9 */
        put_track(m, 0, 0, 12.0);
        put_track(m, 0.6 * off, 0.8 * off, 12.0);
        put_detection(m, 0, 0, 12.0, 0);
        m->tracks[0].merged_in_row = n == 2 ? 4 : 5;
        m->tracks[1].merged_in_row = n == 3 ? 4 : 5;
        /* four variances of 1e-4: three standard deviations are 0.06 arcsec/s */
        m->tracks[1].state.rate_radps = (bst_vec3){0, 0, (n == 4 ? 0.061 : 0.059) * AS};
        m->tracks[1].hits = n == 5 ? 30 : 19;
        m->shared[0] = n == 6 ? BST_MTT_WIDENED : BST_MTT_ALONE;
        share(m);
        bool ends = n == 0 || n == 5;
        int over = n == 5 ? 0 : 1;
        assert_int_equal(m->tracks[over].misses_in_row, ends ? m->params.max_misses + 1 : 0);
        assert_int_equal(m->tracks[1 - over].misses_in_row, 0);
        assert_int_equal(m->detection_of_track[over], ends ? -1 : 0);
        assert_int_equal(m->detection_of_track[1 - over], 0);
        assert_int_equal(m->owner[0], ends ? 1 - over : BST_MTT_SEVERAL);
        bst_mtt_free(m);
    }
}

/* Frames in which a neighbour was resolved: another track's detection within three merge_rad. */
static void resolved_neighbours_are_counted(void **state) {
    (void)state;
    for (int n = 0; n < 5; n++) {
        bst_mtt *m = make();
        double far = n == 1 ? 54.1 : 53.9;
        put_track(m, 0, 0, 12.0);
        put_track(m, 0.6 * far, 0.8 * far, 12.2);
        put_detection(m, 0, 0, 12.0, 0);
        put_detection(m, 0.6 * far, 0.8 * far, 12.2, n == 2 ? -1 : 1);
        m->tracks[1].star = n == 3;
        m->tracks[1].status = n == 4 ? BST_TRACK_TENTATIVE : BST_TRACK_CONFIRMED;
        m->tracks[0].apart = m->tracks[1].apart = 3;
        share(m);
        assert_int_equal(m->tracks[0].apart, n == 0 || n == 4 ? 4 : 3);
        assert_int_equal(m->tracks[1].apart, n == 0 ? 4 : 3);
        bst_mtt_free(m);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_missed_track_shares), cmocka_unit_test(two_missed_tracks_share),
        cmocka_unit_test(the_brighter_one_hides_the_other), cmocka_unit_test(duplicates_end),
        cmocka_unit_test(resolved_neighbours_are_counted)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
