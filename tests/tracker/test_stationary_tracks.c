/* What counts as at rest, and as a star: rates with a covariance of two unlike, correlated axes. */
#include "tests/tracker/sky_bench.h"
#include "tracker/mtt/multitarget_internal.h"

#define RATE (0.2 * AS) /* the slowest object's, rad/s */

static bst_mtt_track track_with(bst_vec3 direction, double r1, double r2, const double c[3]) {
    bst_tangent axes = bst_tangent_at(direction);
    bst_mtt_track track = {.moved = true, .hits = 10};
    track.state.direction = direction;
    track.state.rate_radps = bst_tangent_vector(&axes, r1, r2);
    track.state.covariance[0][0] = track.state.covariance[1][1] = 1.0; /* of no account here */
    track.state.covariance[2][2] = c[0];
    track.state.covariance[2][3] = track.state.covariance[3][2] = c[1];
    track.state.covariance[3][3] = c[2];
    return track;
}

static bool as_expected(const void *user, const bst_mtt_track *track) {
    (void)user;
    (void)track;
    return true;
}

/* r^T (C + s)^-1 r against the limit, s = (a tenth of the slowest rate)^2 + (common rate)^2. */
static void rest_is_a_rate_compatible_with_none(void **state) {
    (void)state;
    bst_mtt_params params = defaults();
    params.star_rate_radps = RATE;
    bench *b = start(1, &params);
    bst_mtt_frame frame = {.common_rate_sigma_radps = 0.03 * AS};
    const double covariance[3] = {pow(0.05 * AS, 2), 0.6 * 0.05 * 0.11 * AS * AS,
                                  pow(0.11 * AS, 2)};
    const double rates[5][2] = {{0.2, 0.0}, {0.0, 0.2}, {0.15, 0.1}, {0.15, -0.1}, {-0.02, -0.3}};
    const double seeming = pow(0.02 * AS, 2) + pow(0.03 * AS, 2);
    bst_vec3 direction = bst_vec3_from_radec(2.2, -0.6);
    for (int k = 0; k < 5; k++) {
        double r1 = rates[k][0] * AS, r2 = rates[k][1] * AS;
        double p = covariance[0] + seeming, q = covariance[1], r = covariance[2] + seeming;
        double det = p * r - q * q;
        double chi2 = (r * r1 * r1 - 2.0 * q * r1 * r2 + p * r2 * r2) / det;
        bst_mtt_track track = track_with(direction, r1, r2, covariance);
        for (int above = 0; above < 2; above++) {
            b->mtt->params.motion_chi2 = (above ? 1.0001 : 0.9999) * chi2;
            track.moved = true;
            assert_int_equal(bst_mtt_is_at_rest(b->mtt, &frame, &track), above);
            track.moved = false; /* by less than its image's length: whatever its rate */
            assert_true(bst_mtt_is_at_rest(b->mtt, &frame, &track));
            frame.expected = as_expected;
            assert_false(bst_mtt_is_at_rest(b->mtt, &frame, &track));
            frame.expected = NULL;
        }
    }
    b->mtt->params.star_rate_radps = 0.0; /* nothing is asked */
    bst_mtt_track track = track_with(direction, 0.0, 0.0, covariance);
    assert_false(bst_mtt_is_at_rest(b->mtt, &frame, &track));
    bst_mtt_free(b->mtt);
}

/* Rate and three standard deviations of the worse axis below the slowest object's. */
static void a_star_is_slower_than_any_object(void **state) {
    (void)state;
    bst_mtt_params params = defaults();
    params.star_rate_radps = RATE;
    bench *b = start(2, &params);
    bst_mtt_frame frame = {.common_rate_sigma_radps = 0.01 * AS};
    bst_vec3 direction = bst_vec3_from_radec(5.0, 0.8);
    for (int axis = 0; axis < 2; axis++) {
        double worse = pow(0.03 * AS, 2), better = pow(0.002 * AS, 2);
        const double c[3] = {axis ? better : worse, 0.0, axis ? worse : better};
        double sigma = sqrt(worse + pow(0.02 * AS, 2) + pow(0.01 * AS, 2));
        double most = RATE - 3.0 * sigma;
        assert_true(most > 0.0);
        for (int slower = 0; slower < 2; slower++) {
            double rate = (slower ? 0.999 : 1.001) * most;
            bst_mtt_track track = track_with(direction, 0.6 * rate, -0.8 * rate, c);
            assert_int_equal(bst_mtt_is_star(b->mtt, &frame, &track), slower);
            track.hits = params.confirm_hits - 1;
            assert_false(bst_mtt_is_star(b->mtt, &frame, &track));
            track.hits = params.confirm_hits;
            assert_int_equal(bst_mtt_is_star(b->mtt, &frame, &track), slower);
        }
    }
    /* as one it has no rate, and its place becomes vaguer by a tenth of the slowest rate */
    const double c[3] = {1e-12, 1e-13, 2e-12};
    bst_mtt_track track = track_with(direction, 1e-7, 2e-7, c);
    track.models.count = 2;
    track.state.covariance[0][1] = track.state.covariance[1][0] = 0.25;
    track.state.covariance[0][3] = track.state.covariance[3][0] = 0.1;
    bst_mtt_make_star(&track);
    assert_true(track.star && track.status == BST_TRACK_CONFIRMED && track.models.count == 0);
    assert_true(bst_vec3_norm(track.state.rate_radps) == 0.0);
    bst_mtt_predict_star(b->mtt, 5.0, &track);
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            double walk = 0.1 * RATE * 5.0;
            double want = i > 1 || j > 1 ? 0.0 : i != j ? 0.25 : 1.0 + walk * walk;
            bst_assert_close(track.state.covariance[i][j], want, 1e-15);
        }
    }
    bst_mtt_free(b->mtt);
}

static void moved_by_more_than_its_image(void **state) {
    (void)state;
    const struct {
        double off, first, now;
        bool moved;
    } cases[] = {{5.0, 4.0, 3.0, true}, {5.0, 6.0, 3.0, false}, {5.0, 3.0, 6.0, false}};
    for (int k = 0; k < 3; k++) {
        for (int axis = 0; axis < 2; axis++) {
            bst_mtt_track track = {.first_direction = bst_vec3_from_radec(1.0, 0.3),
                                   .first_length_rad = cases[k].first * AS};
            bst_tangent axes = bst_tangent_at(track.first_direction);
            double off = cases[k].off * AS;
            bst_mtt_detection d = {.length_rad = cases[k].now * AS};
            d.sky.direction =
                bst_tangent_exp(track.first_direction,
                                bst_tangent_vector(&axes, axis ? 0.0 : off, axis ? off : 0.0));
            bst_mtt_note_place(&track, &d);
            assert_int_equal(track.moved, cases[k].moved);
        }
    }
}

static void what_rests_has_room_of_its_own(void **state) {
    (void)state;
    bst_mtt_params params = defaults();
    params.max_stationary_tracks = 3;
    params.max_tracks = 10;
    params.star_rate_radps = RATE;
    bench *b = start(3, &params);
    b->mtt->track_count = 9;
    b->mtt->rest_count = 2;
    assert_true(bst_mtt_has_room(b->mtt, true, 5));
    assert_true(bst_mtt_has_room(b->mtt, false, 2)); /* 7 move, and 2 places are kept */
    assert_false(bst_mtt_has_room(b->mtt, false, 3));
    bst_mtt_track track = {.at_rest = false}, other = track;
    bst_mtt_set_rest(b->mtt, &track, true);
    assert_true(track.at_rest && b->mtt->rest_count == 3);
    bst_mtt_set_rest(b->mtt, &track, true); /* nothing new */
    assert_int_equal(b->mtt->rest_count, 3);
    bst_mtt_set_rest(b->mtt, &other, true); /* full */
    assert_true(!other.at_rest && b->mtt->rest_count == 3);
    bst_mtt_set_rest(b->mtt, &track, false);
    assert_true(!track.at_rest && b->mtt->rest_count == 2);
    b->mtt->rest_count = 0;
    b->mtt->track_count = 0;
    bst_mtt_free(b->mtt);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rest_is_a_rate_compatible_with_none),
        cmocka_unit_test(a_star_is_slower_than_any_object),
        cmocka_unit_test(moved_by_more_than_its_image),
        cmocka_unit_test(what_rests_has_room_of_its_own),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
