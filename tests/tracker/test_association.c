/* Gates, the search among a frame's detections, and the count of false alarms: one track set by
 * hand, whose covariance has two very different axes. */
#include "tests/tracker/sky_bench.h"
#include "tracker/mtt/multitarget_internal.h"

static void put(bst_mtt *mtt, bst_vec3 direction, double sigma) {
    mtt->now.used[mtt->now.count] = false;
    mtt->now.items[mtt->now.count++] = (bst_mtt_detection){
        .sky = {.direction = direction, .cov_11 = sigma * sigma, .cov_22 = sigma * sigma},
        .v_mag = 12.0,
        .v_mag_sigma = INFINITY,
        .snr = 10};
}

/* A confirmed track at `centre`, known to sigma_1 and sigma_2 along the tangent's axes. */
static bst_mtt_track *set_track(bst_mtt *mtt, bst_vec3 centre, double sigma_1, double sigma_2) {
    mtt->track_count = 1;
    mtt->observable[0] = true;
    mtt->now.count = 0;
    bst_mtt_track *track = &mtt->tracks[0];
    *track = (bst_mtt_track){.id = 1, .status = BST_TRACK_CONFIRMED, .v_mag = 12.0};
    track->state.direction = centre;
    track->state.covariance[0][0] = sigma_1 * sigma_1;
    track->state.covariance[1][1] = sigma_2 * sigma_2;
    track->state.covariance[2][2] = track->state.covariance[3][3] = 1e-14;
    mtt->clutter_density = 1.0 / mtt->params.field_sr;
    return track;
}

static bst_vec3 aside(bst_vec3 centre, double a, double b) {
    bst_tangent axes = bst_tangent_at(centre);
    return bst_tangent_exp(centre, bst_tangent_vector(&axes, a, b));
}

static int chosen(bst_mtt *mtt) {
    bst_mtt_pool_index(&mtt->now);
    bst_mtt_associate(mtt, false);
    return mtt->detection_of_track[0];
}

/* Four standard deviations along each axis by itself, wherever on the sky. */
static void gates_have_two_axes(void **state) {
    (void)state;
    const bst_mtt_params params = defaults();
    bench *b = start(1, &params);
    for (int place = 0; place < 4; place++) {
        bst_vec3 centre = bst_vec3_from_radec(0.3 + 1.7 * place, -0.9 + 0.55 * place);
        for (int wide = 0; wide < 2; wide++) {
            double sigma_1 = (wide ? 40 : 2) * AS, sigma_2 = (wide ? 2 : 40) * AS;
            const struct {
                double a, b;
                bool inside;
            } cases[] = {{3.8, 0.0, true},   {-3.8, 0.0, true},  {4.2, 0.0, false},
                         {-4.2, 0.0, false}, {0.0, 3.8, true},   {0.0, -3.8, true},
                         {0.0, 4.2, false},  {0.0, -4.2, false}, {2.6, -2.6, true},
                         {3.0, 3.0, false}};
            for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
                set_track(b->mtt, centre, sigma_1, sigma_2);
                put(b->mtt, aside(centre, cases[k].a * sigma_1, cases[k].b * sigma_2), 0.01 * AS);
                assert_int_equal(chosen(b->mtt), cases[k].inside ? 0 : -1);
            }
            /* and no farther off than both errors together reach: the detection's counts */
            set_track(b->mtt, centre, 2 * AS, 2 * AS);
            put(b->mtt, aside(centre, 0.0, 150 * AS), 40 * AS);
            assert_int_equal(chosen(b->mtt), 0);
            /* with its own axes, also between those of the tangent */
            for (int turn = 0; turn < 4; turn++) {
                double angle = 0.25 * BST_PI * turn, c = cos(angle), s = sin(angle);
                double wide2 = pow(40 * AS, 2), narrow2 = pow(2 * AS, 2);
                for (int across = 0; across < 2; across++) {
                    double along = (across ? 30 : 150) * AS;
                    set_track(b->mtt, centre, 2 * AS, 2 * AS);
                    put(b->mtt, aside(centre, along * (across ? -s : c), along * (across ? c : s)),
                        0.0);
                    bst_sky_measurement *sky = &b->mtt->now.items[0].sky;
                    sky->cov_11 = c * c * wide2 + s * s * narrow2;
                    sky->cov_12 = c * s * (wide2 - narrow2);
                    sky->cov_22 = s * s * wide2 + c * c * narrow2;
                    assert_int_equal(chosen(b->mtt), across ? -1 : 0);
                }
            }
        }
    }
    bst_mtt_free(b->mtt);
}

/* Either model's place counts, however far it is from their mean. */
static void gates_reach_every_model(void **state) {
    (void)state;
    bst_mtt_params params = defaults();
    params.association = BST_MTT_MIXTURE;
    bench *b = start(2, &params);
    bst_vec3 centre = bst_vec3_from_radec(2.1, 0.7);
    for (int k = 0; k < 4; k++) {
        double a = (k == 0 ? 90 : k == 1 ? -90 : 0) * AS, c = (k == 2 ? 90 : k == 3 ? -90 : 0) * AS;
        bst_mtt_track *track = set_track(b->mtt, centre, 2 * AS, 2 * AS);
        track->models.count = 2;
        for (int m = 0; m < 2; m++) {
            track->models.state[m] = track->state;
            track->models.probability[m] = 0.5;
            track->models.state[m].direction = aside(centre, m ? -a : a, m ? -c : c);
        }
        put(b->mtt, aside(centre, a, c), 0.01 * AS);
        assert_int_equal(chosen(b->mtt), 0);
        set_track(b->mtt, centre, 2 * AS, 2 * AS);
        put(b->mtt, aside(centre, a, c), 0.01 * AS);
        assert_int_equal(chosen(b->mtt), -1);
    }
    bst_mtt_free(b->mtt);
}

/* And a model's own covariance, on each axis, where the track's is small. */
static void gates_are_as_wide_as_a_model(void **state) {
    (void)state;
    bst_mtt_params params = defaults();
    params.association = BST_MTT_MIXTURE;
    bench *b = start(6, &params);
    bst_vec3 centre = bst_vec3_from_radec(5.1, -0.7);
    for (int k = 0; k < 8; k++) {
        int model = k & 1, axis = k >> 1 & 1, side = k & 4 ? 1 : -1;
        bst_mtt_track *track = set_track(b->mtt, centre, 2 * AS, 2 * AS);
        track->models.count = 2;
        for (int m = 0; m < 2; m++) {
            track->models.state[m] = track->state;
            track->models.probability[m] = 0.5;
        }
        double sigma = 60 * AS, off = side * 150 * AS;
        track->models.state[model].covariance[axis][axis] = sigma * sigma;
        put(b->mtt, aside(centre, axis ? 0.0 : off, axis ? off : 0.0), 0.01 * AS);
        assert_int_equal(chosen(b->mtt), 0);
        track->models.state[model].covariance[axis][axis] = 4 * AS * AS;
        assert_int_equal(chosen(b->mtt), -1);
    }
    bst_mtt_free(b->mtt);
}

/* A detection that a confirmed track has taken is no tentative track's. */
static void confirmed_tracks_choose_first(void **state) {
    (void)state;
    bst_mtt_params params = defaults();
    for (int nearest = 0; nearest < 2; nearest++) {
        params.association = nearest ? BST_MTT_NEAREST : BST_MTT_GNN;
        bench *b = start(7, &params);
        bst_vec3 centre = bst_vec3_from_radec(0.4, 0.9);
        /* number 1 is confirmed and is the farther off */
        set_track(b->mtt, centre, 3 * AS, 3 * AS);
        b->mtt->tracks[1] = b->mtt->tracks[0];
        b->mtt->tracks[0].status = BST_TRACK_TENTATIVE;
        b->mtt->tracks[1].id = 2;
        b->mtt->tracks[1].state.direction = aside(centre, 6 * AS, 0.0);
        b->mtt->track_count = 2;
        b->mtt->observable[1] = true;
        put(b->mtt, centre, 0.1 * AS);
        bst_mtt_pool_index(&b->mtt->now);
        bst_mtt_associate(b->mtt, false);
        assert_int_equal(b->mtt->detection_of_track[0], -1);
        assert_int_equal(b->mtt->detection_of_track[1], 0);
        assert_int_equal(b->mtt->owner[0], 1);
        assert_true(b->mtt->now.used[0]);
        /* two confirmed ones: the likelier pair of one detection, both with two */
        b->mtt->tracks[0].status = BST_TRACK_CONFIRMED;
        b->mtt->now.used[0] = false;
        bst_mtt_associate(b->mtt, false);
        assert_int_equal(b->mtt->detection_of_track[0], 0);
        put(b->mtt, aside(centre, -1 * AS, 0.0), 0.1 * AS);
        b->mtt->now.used[0] = false;
        bst_mtt_pool_index(&b->mtt->now);
        bst_mtt_associate(b->mtt, false);
        assert_int_equal(b->mtt->detection_of_track[0] + b->mtt->detection_of_track[1], 1);
        bst_mtt_free(b->mtt);
    }
}

/* Of two in the gate the likelier one; and of those equally far the one of the track's brightness.
 */
static void the_likelier_one_is_taken(void **state) {
    (void)state;
    const bst_mtt_params params = defaults();
    bench *b = start(3, &params);
    bst_vec3 centre = bst_vec3_from_radec(4.0, -0.4);
    for (int swap = 0; swap < 2; swap++) {
        set_track(b->mtt, centre, 2 * AS, 20 * AS);
        /* 1.5 standard deviations, though the farther in angle, against 2.5 */
        bst_vec3 good = aside(centre, 0.0, 30 * AS), bad = aside(centre, 5 * AS, 0.0);
        put(b->mtt, swap ? bad : good, 0.1 * AS);
        put(b->mtt, swap ? good : bad, 0.1 * AS);
        assert_int_equal(chosen(b->mtt), swap);
        /* brightness: 1 mag off is 1 / (0.01 + 0.09 + 0.0025), half of 9 at the most */
        bst_mtt_track *track = set_track(b->mtt, centre, 2 * AS, 20 * AS);
        track->v_mag_variance = 0.01;
        put(b->mtt, aside(centre, 0.0, swap ? 34 * AS : 20 * AS), 0.1 * AS);
        put(b->mtt, aside(centre, 0.0, swap ? -20 * AS : -34 * AS), 0.1 * AS);
        for (int i = 0; i < 2; i++) {
            b->mtt->now.items[i].v_mag_sigma = 0.05;
        }
        b->mtt->now.items[1 - swap].v_mag = 12.0;
        b->mtt->now.items[swap].v_mag = swap ? 13.0 : 11.0;
        /* (1.7^2 - 1) / 2 = 0.945 of place against min(9, 9.76) / 2 of brightness: the farther */
        assert_int_equal(chosen(b->mtt), 1 - swap);
        /* but a place that is worse by 5.1 outweighs any difference of brightness */
        set_track(b->mtt, centre, 2 * AS, 20 * AS)->v_mag_variance = 0.01;
        put(b->mtt, aside(centre, 0.0, 4 * AS), 0.1 * AS);
        put(b->mtt, aside(centre, 0.0, 66 * AS), 0.1 * AS);
        b->mtt->now.items[0].v_mag_sigma = b->mtt->now.items[1].v_mag_sigma = 0.05;
        b->mtt->now.items[0].v_mag = swap ? 17.0 : 7.0;
        assert_int_equal(chosen(b->mtt), 0);
    }
    bst_mtt_free(b->mtt);
}

/* Sorted along the axis of the greatest extent, and the range is what lies within. */
static void ranges_hold_what_is_near(void **state) {
    (void)state;
    const bst_mtt_params params = defaults();
    bench *b = start(4, &params);
    const double extent[3][3] = {{0.3, 0.1, 0.2}, {0.1, 0.3, 0.2}, {0.1, 0.2, 0.3}};
    for (int axis = 0; axis < 3; axis++) {
        bst_mtt_pool *pool = &b->mtt->now;
        pool->count = 0;
        for (int i = 0; i < 200; i++) {
            put(b->mtt,
                (bst_vec3){extent[axis][0] * (uniform(b) - 0.5),
                           extent[axis][1] * (uniform(b) - 0.5),
                           extent[axis][2] * (uniform(b) - 0.5)},
                AS);
        }
        bst_mtt_pool_index(pool);
        assert_int_equal(pool->axis, axis);
        for (int trial = 0; trial < 50; trial++) {
            double key[3] = {0.0, 0.0, 0.0}, chord = 0.1 * uniform(b);
            key[axis] = 0.4 * (uniform(b) - 0.5);
            int begin, end, want = 0;
            bst_mtt_pool_range(pool, (bst_vec3){key[0], key[1], key[2]}, chord, &begin, &end);
            for (int i = 0; i < pool->count; i++) {
                bst_vec3 d = pool->items[i].sky.direction;
                double at = axis == 0 ? d.x : axis == 1 ? d.y : d.z;
                want += at >= key[axis] - chord && at <= key[axis] + chord;
            }
            assert_int_equal(end - begin, want);
            for (int k = begin; k < end; k++) {
                bst_vec3 d = pool->items[pool->order[k]].sky.direction;
                double at = axis == 0 ? d.x : axis == 1 ? d.y : d.z;
                assert_true(fabs(at - key[axis]) <= chord && pool->key[k] == at);
                assert_true(k == begin || pool->key[k] >= pool->key[k - 1]);
            }
        }
    }
    bst_mtt_free(b->mtt);
}

/* The mean of the first frames, then a tenth of each: 3, 1, ... what no confirmed track has. */
static void false_alarms_are_counted(void **state) {
    (void)state;
    const bst_mtt_params params = defaults();
    bench *b = start(5, &params);
    double mean = 0.0;
    bst_vec3 centre = bst_vec3_from_radec(1.0, 0.2);
    for (int n = 1; n <= 15; n++) {
        set_track(b->mtt, centre, 2 * AS, 2 * AS);
        put(b->mtt, centre, 0.1 * AS); /* the track's own */
        int alarms = n == 1 ? 3 : n == 2 ? 1 : n % 4;
        for (int i = 0; i < alarms; i++) {
            put(b->mtt, aside(centre, (500 + 200 * i) * AS, -300 * AS), 0.1 * AS);
        }
        b->mtt->clutter = 0.5 * n;
        assert_int_equal(chosen(b->mtt), 0);
        mean += fmax(0.1, 1.0 / n) * (alarms - mean);
        bst_assert_close(b->mtt->alarms, mean, 1e-12);
        double dense = fmax(fmax(0.5 * n, alarms), params.false_alarms_per_frame);
        bst_assert_close(b->mtt->clutter_density * params.field_sr, dense, 1e-9);
        /* where only a part of the field was read nothing is learnt */
        bst_mtt_associate(b->mtt, true);
        bst_assert_close(b->mtt->alarms, mean, 1e-12);
    }
    bst_mtt_free(b->mtt);
}

/* A track that is confirmed takes its hits out of the mean: three of the first five frames. */
static void confirmed_tracks_were_no_alarms(void **state) {
    (void)state;
    const bst_mtt_params params = defaults();
    bench *b = start(6, &params);
    const bst_mtt_track track = {.hits = 3, .snr = 20.0};
    b->mtt->alarms = 4.0;
    b->mtt->alarm_frames = 5;
    bst_mtt_recount_alarms(b->mtt, &track);
    bst_assert_close(b->mtt->alarms, 4.0 - 3.0 / 5.0, 1e-12);
    b->mtt->alarm_frames = 50;
    bst_mtt_recount_alarms(b->mtt, &track);
    bst_assert_close(b->mtt->alarms, 3.4 - 0.3, 1e-12);
    b->mtt->alarms = 0.1;
    bst_mtt_recount_alarms(b->mtt, &track);
    assert_true(b->mtt->alarms == 0.0);
    bst_mtt_free(b->mtt);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gates_have_two_axes),
        cmocka_unit_test(gates_reach_every_model),
        cmocka_unit_test(the_likelier_one_is_taken),
        cmocka_unit_test(gates_are_as_wide_as_a_model),
        cmocka_unit_test(confirmed_tracks_choose_first),
        cmocka_unit_test(ranges_hold_what_is_near),
        cmocka_unit_test(false_alarms_are_counted),
        cmocka_unit_test(confirmed_tracks_were_no_alarms),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
