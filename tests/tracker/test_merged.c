/* Objects that are seen as one, for a moment and for good. */
#include "tests/tracker/sky_bench.h"

/* Two confirmed tracks, of which one object is never seen apart from the other again: they live on
 * one detection for max_merged_frames frames, then the one that was seen longer goes on with it and
 * the other one misses, and not both. */
static void melted_for_good(void **state) {
    (void)state;
    for (int association = 0; association < 5; association++) {
        for (uint64_t seed = 0; seed < 10; seed++) {
            bst_mtt_params params = defaults();
            params.association = (bst_mtt_association)association;
            bench *b = start(seed, &params);
            bst_vec3 from = bst_vec3_from_radec(0.3, 0.2);
            int64_t id = 0;
            for (int k = 0; k < 150; k++) {
                bst_vec3 a = along(from, 0.4, 40 * AS * k), other = along(a, 2.0, 3 * AS);
                see(b, a, 13.0);
                if (k >= 10 && k < 30) {
                    see(b, other, 13.0);
                }
                frame(b, k);
                const bst_mtt_track *track = track_at(b, a, 2 * AS);
                if (k == 9) {
                    assert_non_null(track);
                    id = track->id;
                } else if (k == 29) {
                    assert_non_null(track_at(b, other, 1.5 * AS));
                } else if (k == 149) {
                    assert_non_null(track);
                    assert_int_equal(track->id, id);
                    assert_true(track->hits > 100);
                    int n;
                    bst_mtt_tracks(b->mtt, &n);
                    assert_int_equal(n, 1);
                }
                assert_true(k < 10 || track);
            }
            bst_mtt_free(b->mtt);
        }
    }
}

/* The same with the other one much dimmer: it is taken to be hidden, and followed for max_coast_s;
 * the bright one goes on as if there were nothing else. */
static void dim_one_gone(void **state) {
    (void)state;
    for (uint64_t seed = 0; seed < 40; seed++) {
        bst_mtt_params params = defaults();
        params.association = (bst_mtt_association)(seed % 5);
        bench *b = start(seed, &params);
        bst_vec3 from = bst_vec3_from_radec(0.3, 0.2);
        int n = 0;
        for (int k = 0; k < 200; k++) {
            bst_vec3 a = along(from, 0.4, 40 * AS * k), other = along(a, 2.0, 3 * AS);
            see(b, a, 13.0);
            if (k >= 10 && k < 30) {
                see(b, other, 15.0);
            }
            frame(b, k);
            const bst_mtt_track *track = track_at(b, a, 1.5 * AS);
            assert_true(k < 10 || (track && track->hits > 0.95 * k));
            bst_mtt_tracks(b->mtt, &n);
            /* with existence probabilities only while the place of the dim one, which is less and
             * less certain, is likely to be next to the bright one */
            int until = params.association == BST_MTT_PMB ? 70 : 148;
            assert_true(k < 30 || k > until || n == 2);
        }
        assert_int_equal(n, 1);
        bst_mtt_free(b->mtt);
    }
}

#define CROSSING_PX (3 * AS)
/* Images melt when they are this near, and their centroid is then that of their light but for a
 * share that falls with the distance over the second one: as in images of two stars 1.2 mag apart
 * with an FWHM of 2 px. */
#define MELT_PX 5.0
#define CENTROID_PX 3.0

/* Two objects pass each other slowly at 1.5 px, the second one brighter by so much. True when both
 * keep their identity. */
static bool pass_slowly(uint64_t seed, bst_mtt_association association, double brighter_mag,
                        double rate_pxps) {
    bst_mtt_params params = defaults();
    params.association = association;
    params.brightness_systematic_mag = 0.2;
    params.max_merged_frames = 60;
    bench *b = start(seed, &params);
    bst_vec3 centre = bst_vec3_from_radec(0.0, 0.5);
    double heading = 6.28 * uniform(b), relative = 6.28 * uniform(b), meet = 30 + 7 / rate_pxps;
    double v[2] = {13.0, 13.0 - brighter_mag};
    double light = 1.0 / (1.0 + pow(10.0, -0.4 * brighter_mag)); /* share of the second one's */
    int64_t before[2] = {0}, after[2] = {0};
    for (int k = 0; k <= 2 * meet; k++) {
        bst_vec3 o[2] = {along(centre, heading, 20 * AS * k)};
        bst_vec3 beside = along(o[0], relative + BST_PI / 2, 1.5 * CROSSING_PX);
        o[1] = along(beside, relative, rate_pxps * (k - meet) * CROSSING_PX);
        double min_separation_px = bst_vec3_angle(o[0], o[1]) / CROSSING_PX;
        if (min_separation_px < MELT_PX) {
            double drawn = exp(-pow(min_separation_px / CENTROID_PX, 2));
            double place = light > 0.5 ? 1.0 - drawn * (1.0 - light) : drawn * light;
            bst_vec3 to = bst_tangent_log(o[0], o[1]);
            see(b, bst_tangent_exp(o[0], bst_vec3_scale(to, place)),
                v[1] + 2.5 * log10(light)); /* v of the sum */
        }
        for (int i = 0; i < 2 && min_separation_px >= MELT_PX; i++) {
            if (uniform(b) < 0.98) {
                see(b, o[i], v[i]);
            }
        }
        frame(b, k);
        for (int i = 0; i < 2 && min_separation_px > MELT_PX; i++) {
            const bst_mtt_track *track = track_at(b, o[i], 1.5 * CROSSING_PX);
            if (k < meet) {
                before[i] = track ? track->id : before[i];
            } else {
                after[i] = track ? track->id : -1;
            }
        }
    }
    bst_mtt_free(b->mtt);
    return before[0] != 0 && before[0] == after[0] && before[1] != 0 && before[1] == after[1];
}

static void slow_crossings(void **state) {
    (void)state;
    const double rates_pxps[] = {0.1, 0.2, 0.5}, brighter_mag[] = {-2, -1.5, -1, 1, 1.5, 2};
    for (int a = 0; a < 5; a++) {
        for (int r = 0; r < 3; r++) {
            int kept = 0;
            for (uint64_t seed = 0; seed < 60; seed++) {
                kept += pass_slowly(seed, (bst_mtt_association)a, brighter_mag[seed % 6],
                                    rates_pxps[r]);
            }
            print_message("slow crossing at %.1f px/s, association %d: %d of 60 keep both\n",
                          rates_pxps[r], a, kept);
            assert_true(kept >= 57); /* 95 % */
        }
    }
}

/* Two objects pass each other within a pixel of 3 arcsec, seen apart all the way: no blends. */
static void crossing_within_a_pixel(void **state) {
    (void)state;
    const bst_mtt_association kinds[] = {BST_MTT_GNN, BST_MTT_NEAREST, BST_MTT_PDA, BST_MTT_MIXTURE,
                                         BST_MTT_PMB};
    for (int a = 0; a < 5; a++) {
        int kept = 0;
        for (uint64_t seed = 0; seed < 50; seed++) {
            bst_mtt_params params = defaults();
            params.association = kinds[a];
            bench *b = start(seed, &params);
            bst_vec3 centre = bst_vec3_from_radec(0.0, 0.5);
            double heading = 6.28 * uniform(b), apart = 3 * AS * uniform(b);
            int64_t before[2] = {0}, after[2] = {0};
            for (int k = -20; k <= 20; k++) {
                bst_vec3 o[2] = {
                    along(centre, heading, 5 * AS * k),
                    along(along(centre, heading + BST_PI / 2, apart), heading + 1.0, 6 * AS * k)};
                for (int i = 0; i < 2; i++) {
                    if (uniform(b) < 0.95) {
                        see(b, o[i], 13.0);
                    }
                }
                frame(b, 100 + k);
                for (int i = 0; i < 2; i++) {
                    const bst_mtt_track *track = track_at(b, o[i], 3 * AS);
                    if (k == -6) {
                        before[i] = track ? track->id : -1;
                    }
                    if (k == 20) {
                        after[i] = track ? track->id : -2;
                    }
                }
            }
            kept += before[0] == after[0] && before[1] == after[1];
            bst_mtt_free(b->mtt);
        }
        print_message("crossing within 1 px, association %d: %d of 50 keep both identities\n",
                      kinds[a], kept);
        assert_true(kept >= 48);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(melted_for_good), cmocka_unit_test(dim_one_gone),
        cmocka_unit_test(slow_crossings), cmocka_unit_test(crossing_within_a_pixel)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
