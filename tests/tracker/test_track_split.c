/* The split of a track into two objects: which pair of detections it takes, the odds of it, and how
 * far both tracks are widened, against Gaussian densities and centres of light by hand. Unequal
 * lights, slanting covariances, other detections close by. */
#include "tests/tracker/sky_bench.h"
#include "tracker/mtt/multitarget_internal.h"

static bst_vec3 beside(bst_vec3 at, double x, double y) {
    bst_tangent axes = bst_tangent_at(at);
    return bst_tangent_exp(at, bst_tangent_vector(&axes, x, y));
}

static void add(bst_mtt_pool *pool, bst_vec3 direction, double v_mag, bool used) {
    pool->used[pool->count] = used;
    pool->items[pool->count++] = (bst_mtt_detection){.sky = {.direction = direction,
                                                             .cov_11 = pow(0.5 * AS, 2),
                                                             .cov_12 = 0.3 * 0.5 * 0.8 * AS * AS,
                                                             .cov_22 = pow(0.8 * AS, 2)},
                                                     .v_mag = v_mag,
                                                     .v_mag_sigma = 0.2};
}

static void a_pair_splits_its_track(void **state) {
    (void)state;
    for (int turn = 0; turn < 6; turn++) {
        bst_ctx ctx = {0};
        bst_mtt *m;
        bst_mtt_params params = defaults();
        params.association = BST_MTT_PMB;
        params.max_tracks = params.max_detections = 10;
        params.brightness_systematic_mag = 0.05;
        bst_assert_ok(&ctx, bst_mtt_create(&ctx, &params, &m));
        bst_vec3 at = bst_vec3_from_radec(1.1 + turn, -0.7);
        double c = cos(1.1 * turn), s = sin(1.1 * turn);
        /* the centre of light is (1.2, -0.7) arcsec beside the track, the objects on a slanting
         * line through it */
        const double centre[2] = {1.2 * AS, -0.7 * AS}, span[2] = {9 * c * AS, 9 * s * AS};
        const double light = pow(10, -0.4 * 0.9), share = 1 / (1 + light); /* 0.9 mag apart */
        const double bright[2] = {centre[0] - (1 - share) * span[0],
                                  centre[1] - (1 - share) * span[1]};
        const double dim[2] = {centre[0] + share * span[0], centre[1] + share * span[1]};
        m->now.seconds = m->seconds = 40.0;
        m->history_count = 1;
        m->history[0].seconds = 37.5;
        m->alarm_density = 3.0 / params.field_sr;
        add(&m->now, beside(at, dim[0], dim[1]), 12.3, false);
        add(&m->now, beside(at, -3 * s * AS, 3 * c * AS), 11.4, true); /* another track's */
        add(&m->now, beside(at, bright[0], bright[1]), 11.4, false);
        add(&m->now, beside(at, 30 * s * AS, -30 * c * AS), 11.4, false); /* too far away */
        bst_mtt_pool_index(&m->now);
        bst_mtt_track *t = &m->tracks[0];
        *t = (bst_mtt_track){.id = 5,
                             .status = BST_TRACK_CONFIRMED,
                             .state = {.direction = at},
                             .v_mag = 10.9,
                             .v_mag_variance = 0.04,
                             .existence = 0.8,
                             .may_miss = true,
                             .hits = 9,
                             .misses_in_row = 2,
                             .apart = 3,
                             .chi2 = 20.0,
                             .innovation_count = 4,
                             .brightness_count = 4,
                             .last_update_s = 30.0};
        double p[3] = {pow(2.0 * AS, 2), -0.5 * 2.0 * 1.5 * AS * AS, pow(1.5 * AS, 2)};
        t->state.covariance[0][0] = p[0];
        t->state.covariance[0][1] = t->state.covariance[1][0] = p[1];
        t->state.covariance[1][1] = p[2];
        t->state.covariance[2][2] = 1e-14;
        t->state.covariance[3][3] = 2e-14;
        t->state.covariance[2][3] = t->state.covariance[3][2] = 0.5e-14;
        m->track_count = 1;
        m->next_id = 6;
        m->observable[0] = true;
        m->detection_of_track[0] = -1;
        bst_mtt_split_tracks(m);
        assert_int_equal(m->track_count, 2);
        assert_int_equal(m->detection_of_track[0], 2); /* the brighter one */
        assert_int_equal(m->detection_of_track[1], 0);
        assert_true(m->now.used[0] && m->now.used[2] && !m->now.used[3]);
        assert_int_equal(m->tracks[0].id, 5);
        assert_int_equal(m->tracks[1].id, 6);
        assert_int_equal(m->tracks[1].status, BST_TRACK_TENTATIVE);
        assert_true(m->tracks[1].hits == 1 && m->tracks[1].frames == 1 && m->tracks[0].hits == 9);
        assert_true(m->tracks[1].misses_in_row == 0 && m->tracks[1].apart == 0);
        bst_assert_close(m->tracks[1].chi2, 0.0, 0.0); /* no detection after its first */
        /* a density for the centre, two detections, and one more object within reach, against a
         * miss and two alarms */
        double r[3] = {p[0] + pow(0.5 * AS, 2) + pow(0.9 * AS, 2), p[1] + 0.3 * 0.5 * 0.8 * AS * AS,
                       p[2] + pow(0.8 * AS, 2) + pow(0.9 * AS, 2)};
        double det = r[0] * r[2] - r[1] * r[1];
        double chi2 = (r[2] * centre[0] * centre[0] - 2 * r[1] * centre[0] * centre[1] +
                       r[0] * centre[1] * centre[1]) /
                      det;
        double both = -2.5 * log10(pow(10, -0.4 * 11.4) + pow(10, -0.4 * 12.3));
        double density = exp(-0.5 * chi2) / (2 * BST_PI * sqrt(det));
        double alarms = 3.0 / params.field_sr;
        double odds = density * pow(0.9 / alarms, 2) / 0.1 / params.field_sr *
                      exp(-0.5 * pow(both - 10.9, 2) / (0.04 + 0.09 + 0.04));
        /* 1e-6: the sphere is flat over 30 arcseconds */
        bst_assert_close(m->tracks[1].score, log(odds), 1e-6);
        for (int k = 0; k < 2; k++) {
            const bst_mtt_track *track = &m->tracks[k];
            const double *place = k == 0 ? bright : dim;
            const double x[2] = {place[0] - centre[0], place[1] - centre[1]};
            bst_assert_close(track->existence, 0.8 * odds / (1 + odds), 1e-9);
            assert_int_equal(track->innovation_count + track->brightness_count, 0);
            bst_assert_close(track->v_mag, k == 0 ? 11.4 : 12.3, 0.0);
            bst_assert_close(track->v_mag_variance, 0.05 * 0.05 + 0.2 * 0.2, 1e-15);
            for (int i = 0; i < 2; i++) {
                for (int j = 0; j < 2; j++) {
                    bst_assert_close(track->state.covariance[i][j], p[i + j] + x[i] * x[j],
                                     1e-6 * p[0]);
                    /* 2.5 s since the frame before */
                    bst_assert_close(track->state.covariance[i + 2][j + 2],
                                     (i != j ? 0.5e-14 : (1 + i) * 1e-14) + x[i] * x[j] / 6.25,
                                     1e-6 * p[0]);
                }
            }
        }
        bst_mtt_free(m);
    }
}

/* Two lights as far apart as the resolution reaches are one object until then, farther ones are
 * not. */
static void distant_lights_are_no_pair(void **state) {
    (void)state;
    for (int k = 0; k < 2; k++) {
        bst_ctx ctx = {0};
        bst_mtt *m;
        bst_mtt_params params = defaults();
        params.association = BST_MTT_PMB;
        params.max_tracks = params.max_detections = 10;
        bst_assert_ok(&ctx, bst_mtt_create(&ctx, &params, &m));
        bst_vec3 at = bst_vec3_from_radec(2.0, 0.9);
        double apart = params.merge_rad + (k == 0 ? -0.1 : 0.1) * AS;
        m->alarm_density = 3.0 / params.field_sr;
        add(&m->now, beside(at, 0.3 * apart, 0.4 * apart), 11.4, false);
        add(&m->now, beside(at, -0.3 * apart, -0.4 * apart), 11.4, false);
        bst_mtt_pool_index(&m->now);
        m->tracks[0] = (bst_mtt_track){.id = 5,
                                       .status = BST_TRACK_CONFIRMED,
                                       .state = {.direction = at},
                                       .v_mag = 11.4 - 2.5 * log10(2.0),
                                       .v_mag_variance = 0.04,
                                       .existence = 0.8,
                                       .may_miss = true};
        for (int i = 0; i < 4; i++) {
            m->tracks[0].state.covariance[i][i] = i < 2 ? AS * AS : 1e-14;
        }
        m->track_count = 1;
        m->observable[0] = true;
        m->detection_of_track[0] = -1;
        bst_mtt_split_tracks(m);
        assert_int_equal(m->track_count, k == 0 ? 2 : 1);
        bst_mtt_free(m);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_pair_splits_its_track),
                                       cmocka_unit_test(distant_lights_are_no_pair)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
