/* Joint association with existence probabilities, by hand: competition for a detection, a miss, and
 * merged measurements. */
#include "boresight/rng.h"
#include "tests/tracker/sky_bench.h"
#include "tracker/mtt/multitarget_internal.h"
#include "tracker/mtt/resolution.h"

/* A bench with associations by joint probabilities; tracks are set by hand. */
static bench *start_jointly(double merge_rad) {
    bst_mtt_params params = defaults();
    params.association = BST_MTT_PMB;
    params.merge_rad = merge_rad;
    bench *b = start(1, &params);
    b->mtt->alarm_density = b->mtt->clutter_density = 1.0 / params.field_sr;
    return b;
}

static bst_mtt_track *add_track(bst_mtt *m, bst_vec3 at, double sigma, double existence) {
    int t = m->track_count++;
    m->observable[t] = true;
    bst_mtt_track *track = &m->tracks[t];
    *track = (bst_mtt_track){.id = t + 1,
                             .status = BST_TRACK_CONFIRMED,
                             .v_mag = 12.0,
                             .existence = existence,
                             .may_miss = true};
    track->state.direction = at;
    for (int i = 0; i < 4; i++) {
        track->state.covariance[i][i] = i < 2 ? sigma * sigma : 1e-14;
    }
    return track;
}

static void put(bst_mtt *m, bst_vec3 at) {
    m->now.used[m->now.count] = false;
    m->now.items[m->now.count++] = (bst_mtt_detection){
        .sky = {.direction = at, .cov_11 = SIGMA * SIGMA, .cov_22 = SIGMA * SIGMA},
        .v_mag = 12.0,
        .v_mag_sigma = INFINITY,
        .snr = 10};
    bst_mtt_pool_index(&m->now);
}

/* Two tracks of existence r_i and one detection: P(i) = o_i/(1 + o_1 + o_2), with o_i the odds
 * r_i P_D N_i/(beta (1 - r_i P_D)). Both groups and the detection form a tree: exact. */
static void two_tracks_compete(void **state) {
    (void)state;
    bench *b = start_jointly(0.0);
    bst_mtt *m = b->mtt;
    bst_vec3 centre = bst_vec3_from_radec(1.0, 0.4);
    const double r[2] = {0.9, 0.3}, off[2] = {0.0, 0.5 * AS}, pd = m->params.detection_probability;
    double odds[2], sum = 1.0;
    for (int i = 0; i < 2; i++) {
        add_track(m, along(centre, 0.3, off[i]), SIGMA, r[i]);
        double s = 2.0 * SIGMA * SIGMA; /* per axis */
        double n = exp(-0.5 * off[i] * off[i] / s) / (2.0 * BST_PI * s);
        odds[i] = r[i] * pd * n * m->params.field_sr / (1.0 - r[i] * pd);
        sum += odds[i];
    }
    put(m, centre);
    bst_mtt_associate(m, false);
    for (int i = 0; i < 2; i++) {
        double p = odds[i] / sum, missed = (1.0 - p) * r[i] * (1.0 - pd) / (1.0 - r[i] * pd);
        /* 1e-6: the direction is rounded to 1e-16 rad of 5e-7 */
        bst_assert_close(m->joint.hypothesis[m->joint.head[i]].probability / p, 1.0, 1e-6);
        bst_assert_close(m->tracks[i].existence / (p + missed), 1.0, 1e-6);
    }
    assert_int_equal(m->detection_of_track[0], 0);
    bst_mtt_free(m);
}

/* Existence after a miss in an empty frame, and of a track that cannot be missed. */
static void misses_lower_existence(void **state) {
    (void)state;
    bench *b = start_jointly(18 * AS);
    bst_mtt *m = b->mtt;
    double pd = m->params.detection_probability;
    add_track(m, bst_vec3_from_radec(1.0, 0.4), SIGMA, 0.8);
    add_track(m, bst_vec3_from_radec(1.1, 0.4), SIGMA, 0.8)->may_miss = false;
    bst_mtt_associate(m, false);
    bst_assert_close(m->tracks[0].existence, 0.8 * (1.0 - pd) / (1.0 - 0.8 * pd), 1e-12);
    bst_assert_close(m->tracks[1].existence, 0.8, 1e-12);
    bst_mtt_free(m);
}

/* The centre of light of two objects, given one's place, is a measurement of the other. */
static void merged_measurement_is_inverted(void **state) {
    (void)state;
    bench *b = start_jointly(18 * AS);
    bst_mtt *m = b->mtt;
    bst_vec3 at = bst_vec3_from_radec(1.0, 0.4);
    bst_mtt_track *a = add_track(m, at, 0.1 * AS, 1.0);
    bst_mtt_track *other = add_track(m, along(at, 0.3, 4 * AS), 0.2 * AS, 1.0);
    other->v_mag = 12.0 + 2.5 * log10(3.0); /* a has 3/4 of the light */
    bst_assert_close(bst_mtt_light_share(a, other), 0.75, 1e-12);
    bst_sky_measurement z = {
        .direction = along(at, 0.3, 1 * AS), .cov_11 = SIGMA * SIGMA, .cov_22 = SIGMA * SIGMA};
    bst_mtt_merged fit;
    assert_true(bst_mtt_merge(a, other, &z, 0.0, &fit));
    /* 1e-5 AS: curvature of the sphere over 4 arcsec, and rounding */
    assert_true(bst_vec3_angle(fit.of_a.direction, a->state.direction) < 1e-5 * AS);
    assert_true(bst_vec3_angle(fit.of_b.direction, other->state.direction) < 1e-5 * AS);
    double of_a = (0.3 * 0.3 + 0.0625 * 0.2 * 0.2) / 0.5625 * AS * AS;
    double of_b = (0.3 * 0.3 + 0.5625 * 0.1 * 0.1) / 0.0625 * AS * AS;
    bst_assert_close(fit.of_a.cov_11 / of_a, 1.0, 1e-9);
    bst_assert_close(fit.of_b.cov_22 / of_b, 1.0, 1e-9);
    /* exactly at merge_rad, with known places, 5 % of pairs are unresolved */
    bst_mtt_track *far = add_track(m, along(at, 0.3, 18 * AS), 1e-6 * AS, 1.0);
    a->state.covariance[0][0] = a->state.covariance[1][1] = 1e-12 * AS * AS;
    bst_assert_close(bst_mtt_unresolved(18 * AS, a, far), 0.05, 1e-4);
    bst_mtt_free(m);
}

/* The gate of a merged detection is gate_chi2 about the centre of light, across the pair's line
 * too: its variance there is half of a track's, the detection's, and the floor's. */
static void gate_of_a_merged_detection(void **state) {
    (void)state;
    static const double shares[] = {0.1, 0.9, 1.1};
    for (int k = 0; k < 3; k++) {
        bench *b = start_jointly(18 * AS);
        bst_mtt *m = b->mtt;
        bst_vec3 at = bst_vec3_from_radec(1.0, 0.4), middle = along(at, 0.3, 3 * AS);
        double floor2 = m->params.merge_floor_rad * m->params.merge_floor_rad;
        double sigma = sqrt(1.5 * SIGMA * SIGMA + floor2);
        add_track(m, at, SIGMA, 0.99);
        add_track(m, along(at, 0.3, 6 * AS), SIGMA, 0.99);
        put(m, along(middle, 0.3 + 0.5 * BST_PI, sigma * sqrt(shares[k] * m->params.gate_chi2)));
        bst_mtt_associate(m, false);
        for (int t = 0; t < 2; t++) {
            assert_int_equal(m->detection_of_track[t], shares[k] < 1.0 ? 0 : -1);
            assert_int_equal(m->shared[t], shares[k] < 1.0 ? BST_MTT_WIDENED : BST_MTT_ALONE);
        }
        bst_mtt_free(m);
    }
}

/* One detection midway between two tracks that are closer than the resolution is of both; were they
 * resolved, one of them would have been missed and the detection far from either. */
static void one_detection_of_two_tracks(void **state) {
    (void)state;
    bench *b = start_jointly(18 * AS);
    bst_mtt *m = b->mtt;
    bst_vec3 at = bst_vec3_from_radec(1.0, 0.4);
    add_track(m, at, SIGMA, 0.99);
    add_track(m, along(at, 0.3, 6 * AS), SIGMA, 0.99);
    put(m, along(at, 0.3, 3 * AS));
    bst_mtt_associate(m, false);
    for (int t = 0; t < 2; t++) {
        assert_int_equal(m->detection_of_track[t], 0);
        assert_int_equal(m->shared[t], BST_MTT_WIDENED);
        assert_true(m->tracks[t].existence > 0.99);
    }
    bst_mtt_free(m);
}

/* The same with objects that may not exist, in clutter: the detection is the clutter's and both are
 * missed, or the light of both, or that light is missed too. */
static void one_detection_of_doubtful_tracks(void **state) {
    (void)state;
    const double r[2] = {0.7, 0.5};
    for (int k = 0; k < 3; k++) {
        bench *b = start_jointly(18 * AS);
        bst_mtt *m = b->mtt;
        const double pd = m->params.detection_probability, floor_rad = m->params.merge_floor_rad;
        const double clutter = 0.05 * pow(4.0, k) / (AS * AS);
        bst_vec3 at = bst_vec3_from_radec(1.0, 0.4);
        m->alarm_density = m->clutter_density = clutter;
        add_track(m, at, SIGMA, r[0]);
        add_track(m, along(at, 0.3, 6 * AS), SIGMA, r[1]);
        put(m, along(at, 0.3, 3 * AS));
        double unresolved = bst_mtt_unresolved(18 * AS, &m->tracks[0], &m->tracks[1]);
        assert_true(unresolved > 0.5 && unresolved < 0.95);
        bst_mtt_associate(m, false);
        double variance = 1.5 * SIGMA * SIGMA + floor_rad * floor_rad;
        double density = 1.0 / (2.0 * BST_PI * variance);
        double both = r[0] * r[1] * unresolved / (1.0 - unresolved);
        double none = (1.0 - r[0] * pd) * (1.0 - r[1] * pd), lost = both * (1.0 - pd);
        double merged = both * pd * density / clutter, sum = none + lost + merged;
        for (int t = 0; t < 2; t++) {
            double missed = r[t] * (1.0 - pd) / (1.0 - r[t] * pd);
            /* 1e-6: the sphere, and the place between the tracks */
            bst_assert_close(m->tracks[t].existence, (lost + merged + none * missed) / sum, 1e-6);
        }
        bst_mtt_free(m);
    }
}

/* A detection between two tentative tracks, nearer to the first: it may be merged with the second's
 * only if that one exists. Both are 6 sigma apart: two objects, not one. */
static void false_track_shares_no_light(void **state) {
    (void)state;
    const double existence[2] = {1e-3, 0.9};
    for (int k = 0; k < 2; k++) {
        bench *b = start_jointly(18 * AS);
        bst_mtt *m = b->mtt;
        bst_vec3 at = bst_vec3_from_radec(1.0, 0.4);
        add_track(m, at, 2 * AS, 0.9)->status = BST_TRACK_TENTATIVE;
        add_track(m, along(at, 0.3, 12 * AS), 2 * AS, existence[k])->status = BST_TRACK_TENTATIVE;
        put(m, along(at, 0.3, 3 * AS));
        bst_mtt_associate(m, false);
        double merged = m->joint.hypothesis[m->joint.head[0]].merged;
        assert_true(k == 0 ? merged < 0.01 : merged > 0.5 && merged < 0.9);
        bst_mtt_free(m);
    }
}

/* Two lights of unlike brightness in any direction from each other: each track's place is widened
 * along the line between them, by its own distance from the centre of light. */
static void shared_light_widens_along_the_line(void **state) {
    (void)state;
    bst_vec3 at = bst_vec3_from_radec(1.0, 0.4);
    const double share = 1.0 / (1.0 + pow(10.0, -0.4 * 0.5)), floor2 = pow(0.3 * AS, 2);
    for (int k = 0; k < 4; k++) {
        bench *b = start_jointly(18 * AS);
        bst_mtt *m = b->mtt;
        m->params.merge_floor_rad = 0.3 * AS;
        bst_vec3 place[2] = {at, along(at, 0.4 + 0.8 * k, 6 * AS)};
        for (int t = 0; t < 2; t++) {
            add_track(m, place[t], SIGMA, 0.99)->v_mag = 12.0 + 0.5 * t;
        }
        put(m, along(at, 0.4 + 0.8 * k, (1.0 - share) * 6 * AS));
        bst_mtt_associate(m, false);
        for (int t = 0; t < 2; t++) {
            assert_int_equal(m->shared[t], BST_MTT_WIDENED);
            bst_tangent axes = bst_tangent_at(place[t]);
            bst_vec3 to =
                bst_vec3_scale(bst_vec3_sub(place[1 - t], place[t]), t ? share : 1.0 - share);
            const double s1 = bst_vec3_dot(to, axes.e1), s2 = bst_vec3_dot(to, axes.e2);
            bst_assert_close(m->extra[t][0] / (s1 * s1 + floor2), 1.0, 1e-6);
            bst_assert_close((m->extra[t][1] - s1 * s2) / floor2, 0.0, 1e-6);
            bst_assert_close(m->extra[t][2] / (s2 * s2 + floor2), 1.0, 1e-6);
        }
        bst_mtt_free(m);
    }
}

/* Odds of existence of the track that a pair of detections starts after a number of empty frames,
 * with the boresight moved by `moved` (rad) just before the pair. */
static double odds_after(int empty_frames, double moved) {
    bst_mtt_params params = defaults();
    params.association = BST_MTT_PMB;
    bench *b = start(1, &params);
    bst_vec3 axis = bst_vec3_from_radec(1.0, 0.4), object = along(axis, 0.3, 60 * AS);
    int frames = empty_frames + 2, count;
    for (int k = 0; k < frames; k++) {
        bst_vec3 at = k < empty_frames ? along(axis, 2.0, moved) : axis;
        if (k >= empty_frames) {
            object = along(object, 0.3, 5 * AS);
            see(b, object, 12.0);
        }
        bst_mtt_frame f = {.tick = k * 6000,
                           .seconds = k,
                           .detections = b->list,
                           .count = b->count,
                           .boresight = at};
        bst_mtt_step(b->mtt, &f);
        b->count = 0;
    }
    const bst_mtt_track *tracks = bst_mtt_tracks(b->mtt, &count);
    assert_int_equal(count, 1);
    double odds = tracks[0].existence / (1.0 - tracks[0].existence);
    bst_mtt_free(b->mtt);
    return odds;
}

/* A field that was observed has fewer undetected objects: of those in it, 1 - P_D remain after each
 * frame, and the share f = 120 arcsec/s * 1 s / 3000 arcsec enters, which makes
 * u = 0.3 f / (1 - (1 - P_D) (1 - f)). New sky has as many as at the beginning. */
static void observed_sky_starts_fewer_tracks(void **state) {
    (void)state;
    const double f = 120.0 / 3000.0, pd = 0.9;
    double first = odds_after(0, 0.0), ratio = f / (1.0 - (1.0 - pd) * (1.0 - f));
    /* 1e-9: after 30 frames the beginning has 0.096^30 of its share */
    bst_assert_close(odds_after(30, 0.0) / first / ratio, 1.0, 1e-9);
    bst_assert_close(odds_after(30, 3000 * AS) / first, 1.0, 1e-9);
    /* one alarm a frame in the field; the second detection may lie within 120 arcsec/s * 1 s and
     * three standard deviations of both places, two axes each. Undetected: see above */
    double reach = 120.0 * AS + 3.0 * sqrt(4.0 * SIGMA * SIGMA), field = 3000 * AS * 3000 * AS;
    double objects = first * BST_PI * reach * reach / field / (pd * pd);
    bst_assert_close(objects, 0.3, 1e-9);
}

/* Objects of any SNR about the threshold, of which a share is dark in each of eight frames: the
 * stated probability that the ninth detects them, where they are lit, is the share that it does. */
static void check_faint_objects(const bst_mtt *m, double dark) {
    enum { OBJECTS = 20000, FRAMES = 8, BINS = 9 };
    const double threshold = m->threshold_snr, pd = m->params.detection_probability;
    double stated[BINS] = {0}, found[BINS] = {0};
    int count[BINS] = {0};
    bst_rng_key key = bst_rng_make_key(3, 0, "faint", "objects");
    for (int o = 0; o < OBJECTS; o++) {
        bst_mtt_track track = {.may_miss = true, .dark = dark};
        double snr = threshold - 1.5 + 7.0 * bst_rng_uniform(key, 0, (uint64_t)o);
        bst_mtt_start_snr(&track);
        for (int k = 0; k <= FRAMES; k++) {
            uint64_t draw = (uint64_t)(o * (FRAMES + 1) + k);
            double seen = snr + bst_rng_normal(key, 1, draw);
            bool detected = seen > threshold && bst_rng_uniform(key, 2, draw) < pd;
            bool lit = bst_rng_uniform(key, 3, draw) >= dark;
            if (k == FRAMES) {
                double p = bst_mtt_detection_probability(m, &track);
                int bin = (int)(10.0 * p);
                stated[bin] += p;
                found[bin] += detected;
                count[bin]++;
            } else if (detected && lit) {
                bst_mtt_note_snr(m, seen, &track);
            } else {
                bst_mtt_note_missed(m, &track);
            }
        }
    }
    for (int bin = 0; bin < BINS; bin++) {
        /* 0.02: the levels are 1 apart; and four standard deviations of the sample */
        double n = count[bin], p = stated[bin] / n, limit = 0.02 + 4.0 * sqrt(p * (1.0 - p) / n);
        assert_true(count[bin] == 0 || fabs(found[bin] / n - p) < limit);
    }
    assert_true(count[2] > 500 && count[5] > 500 && count[8] > 500);
}

/* Those far above the threshold are missed as the parameter says, and so are all where it is not
 * known. */
static void faint_objects_are_missed_as_stated(void **state) {
    (void)state;
    bench *b = start_jointly(18 * AS);
    bst_mtt *m = b->mtt;
    m->threshold_snr = 5.0;
    m->params.brightness_random_walk_mag = 0.0;
    check_faint_objects(m, 0.0);
    check_faint_objects(m, 0.5);
    double pd = m->params.detection_probability;
    bst_mtt_track bright = {.may_miss = true};
    bst_mtt_start_snr(&bright);
    bst_mtt_note_snr(m, 30.0, &bright);
    bst_mtt_note_missed(m, &bright);
    bst_assert_close(bst_mtt_detection_probability(m, &bright) / pd, 1.0, 1e-4);
    m->threshold_snr = 0.0;
    bst_assert_close(bst_mtt_detection_probability(m, &(bst_mtt_track){0}), pd, 1e-15);
    bst_mtt_free(m);
}

/* A frame that says nothing spreads the SNR by the random walk of the brightness, and moves no
 * mean: 0.05 mag of an SNR of 5 are 5 (10^0.02 - 1) = 0.235, and 0.230 to first order. */
static void brightness_walks_at_random(void **state) {
    (void)state;
    bench *b = start_jointly(18 * AS);
    bst_mtt *m = b->mtt;
    bst_mtt_track track = {.dark = 1.0, .snr_level = {[3] = 1.0}};
    m->threshold_snr = 5.0;
    m->params.brightness_random_walk_mag = 0.05;
    for (int k = 1; k <= 3; k++) {
        double sum = 0.0, mean = 0.0, variance = 0.0;
        bst_mtt_note_missed(m, &track);
        for (int i = 0; i < BST_MTT_SNR_LEVELS; i++) {
            sum += track.snr_level[i];
            mean += track.snr_level[i] * i;
            variance += track.snr_level[i] * (i - 3) * (i - 3);
        }
        bst_assert_close(sum, 1.0, 1e-12);
        bst_assert_close(mean, 3.0, 1e-12);
        bst_assert_close(sqrt(variance / k), 0.05 * log(10.0) / 2.5 * 5.0, 1e-12);
    }
    bst_mtt_free(m);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(faint_objects_are_missed_as_stated),
        cmocka_unit_test(brightness_walks_at_random),
        cmocka_unit_test(two_tracks_compete),
        cmocka_unit_test(misses_lower_existence),
        cmocka_unit_test(merged_measurement_is_inverted),
        cmocka_unit_test(gate_of_a_merged_detection),
        cmocka_unit_test(one_detection_of_two_tracks),
        cmocka_unit_test(one_detection_of_doubtful_tracks),
        cmocka_unit_test(false_track_shares_no_light),
        cmocka_unit_test(shared_light_widens_along_the_line),
        cmocka_unit_test(observed_sky_starts_fewer_tracks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
