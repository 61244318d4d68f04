/* Objects that are seen as one, for a moment and for good. */
#include "tests/tracker/sky_bench.h"

/* Two confirmed tracks, of which one object is never seen apart from the other again: they live on
 * one detection for max_merged frames, then the one that was seen longer goes on with it and the
 * other one misses, and not both. */
static void melted_for_good(void **state) {
    (void)state;
    for (int association = 0; association < 4; association++) {
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

/* Two objects pass each other within a pixel of 3 arcsec, seen apart all the way: no blends. */
static void crossing_within_a_pixel(void **state) {
    (void)state;
    const bst_mtt_association kinds[] = {BST_MTT_GNN, BST_MTT_NEAREST, BST_MTT_PDA,
                                         BST_MTT_MIXTURE};
    for (int a = 0; a < 4; a++) {
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
    const struct CMUnitTest tests[] = {cmocka_unit_test(melted_for_good),
                                       cmocka_unit_test(crossing_within_a_pixel)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
