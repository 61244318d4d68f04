#include "boresight/rng.h"
#include "tests/test_support.h"

/* Known-answer vectors published with Random123 (file kat_vectors, philox4x32-10). */
static void philox_known_answers(void **state) {
    (void)state;
    static const struct {
        uint32_t counter[4], key[2], expected[4];
    } cases[] = {
        {{0, 0, 0, 0}, {0, 0}, {0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}},
        {{0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff},
         {0xffffffff, 0xffffffff},
         {0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}},
        {{0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344},
         {0xa4093822, 0x299f31d0},
         {0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const uint32_t *c = cases[i].counter;
        bst_philox_words r =
            bst_philox4x32(cases[i].key[0], cases[i].key[1], c[0], c[1], c[2], c[3]);
        assert_memory_equal(r.w, cases[i].expected, sizeof r.w);
    }
}

static void keys_depend_on_names_only(void **state) {
    (void)state;
    bst_rng_key a = bst_rng_make_key(1, 0, "obs/cam/gimbal", "jitter");
    bst_rng_key same = bst_rng_make_key(1, 0, "obs/cam/gimbal", "jitter");
    assert_memory_equal(&a, &same, sizeof a);
    bst_rng_key others[] = {
        bst_rng_make_key(2, 0, "obs/cam/gimbal", "jitter"),
        bst_rng_make_key(1, 1, "obs/cam/gimbal", "jitter"),
        bst_rng_make_key(1, 0, "obs/cam/gimba", "ljitter"),
        bst_rng_make_key(1, 0, "obs/cam/gimbal", "jitte"),
    };
    for (size_t i = 0; i < sizeof others / sizeof *others; i++) {
        assert_memory_not_equal(&a, &others[i], sizeof a);
    }
}

/* Kolmogorov-Smirnov and moments of 200 000 draws; limits at p about 1e-4 for this fixed seed. */
static void draws_follow_their_distributions(void **state) {
    (void)state;
    enum { N = 200000 };
    bst_rng_key key = bst_rng_make_key(7, 0, "test", "normal");
    double mean = 0, var = 0, fourth = 0, cross = 0;
    int bins[20] = {0};
    for (uint64_t i = 0; i < N; i++) {
        double z[2];
        bst_rng_normal2(key, 3, i, z);
        mean += z[0];
        var += z[0] * z[0];
        fourth += z[0] * z[0] * z[0] * z[0];
        cross += z[0] * z[1];
        double u = bst_rng_uniform(key, 4, i);
        assert_true(u > 0.0 && u < 1.0);
        bins[(int)(u * 20.0)]++;
    }
    double sigma = 1.0 / sqrt((double)N);
    bst_assert_close(mean / N, 0.0, 4 * sigma);
    bst_assert_close(var / N, 1.0, 4 * sqrt(2.0) * sigma);
    bst_assert_close(fourth / N, 3.0, 4 * sqrt(96.0) * sigma);
    bst_assert_close(cross / N, 0.0, 4 * sigma);
    double chi2 = 0;
    for (int b = 0; b < 20; b++) {
        double d = bins[b] - N / 20.0;
        chi2 += d * d / (N / 20.0);
    }
    assert_true(chi2 < 50.8); /* chi-square, 19 degrees of freedom, p = 1e-4 */
}

/* Blocks give what single draws do: 1e-15 of a logarithm and a square root of up to 8.6, of a sine
 * near its zero. First counters below, across and far beyond 2^32. */
static void normal_blocks_are_single_draws(void **state) {
    (void)state;
    const uint64_t firsts[] = {
        0, 16, 12345, UINT64_C(0xFFFFFFF8), UINT64_C(1) << 40, UINT64_MAX - 4};
    for (uint64_t seed = 1; seed <= 50; seed++) {
        bst_rng_key key = bst_rng_make_key(seed, 0, "block", "normal");
        for (size_t f = 0; f < sizeof firsts / sizeof *firsts; f++) {
            double block[2][BST_RNG_BLOCK];
            bst_rng_normal_block(key, firsts[f], block);
            double normal[BST_RNG_BLOCK], uniform[BST_RNG_BLOCK];
            uint64_t a = seed % 2 ? seed : seed << 33, b = firsts[f];
            bst_rng_normal_draws(key, a, b, normal);
            bst_rng_uniform_draws(key, a, b, uniform);
            for (int i = 0; i < BST_RNG_BLOCK; i++) {
                double one[2], draw = bst_rng_normal(key, a, b + (uint64_t)i);
                bst_assert_close(normal[i], draw, 2e-15 * (1.0 + fabs(draw)));
                assert_true(uniform[i] == bst_rng_uniform(key, a, b + (uint64_t)i));
                bst_rng_normal2(key, firsts[f] + (uint64_t)i, 0, one);
                bst_assert_close(block[0][i], one[0], 2e-15 * (1.0 + fabs(one[0])));
                bst_assert_close(block[1][i], one[1], 2e-15 * (1.0 + fabs(one[1])));
            }
        }
    }
}

/* Mean, variance, correlation and tails of 320,000 deviates, at five standard errors each. */
static void normal_blocks_are_normal(void **state) {
    (void)state;
    enum { BLOCKS = 10000, COUNT = 2 * BLOCKS * BST_RNG_BLOCK };
    bst_rng_key key = bst_rng_make_key(7, 0, "block", "normal");
    double sum = 0.0, square = 0.0, product = 0.0;
    int beyond[2] = {0, 0}; /* of 1 and of 3 */
    for (int b = 0; b < BLOCKS; b++) {
        double block[2][BST_RNG_BLOCK];
        bst_rng_normal_block(key, (uint64_t)b * BST_RNG_BLOCK, block);
        for (int i = 0; i < BST_RNG_BLOCK; i++) {
            product += block[0][i] * block[1][i];
            for (int k = 0; k < 2; k++) {
                double x = block[k][i];
                sum += x;
                square += x * x;
                beyond[0] += fabs(x) > 1.0;
                beyond[1] += fabs(x) > 3.0;
            }
        }
    }
    const double share[2] = {0.31731050786, 0.0026997960633}; /* erfc(n / sqrt 2) */
    bst_assert_close(sum / COUNT, 0.0, 5.0 / sqrt(COUNT));
    bst_assert_close(square / COUNT, 1.0, 5.0 * sqrt(2.0 / COUNT));
    bst_assert_close(product / (COUNT / 2), 0.0, 5.0 / sqrt(COUNT / 2));
    for (int k = 0; k < 2; k++) {
        bst_assert_close((double)beyond[k] / COUNT, share[k], 5.0 * sqrt(share[k] / COUNT));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(philox_known_answers),
        cmocka_unit_test(keys_depend_on_names_only),
        cmocka_unit_test(draws_follow_their_distributions),
        cmocka_unit_test(normal_blocks_are_single_draws),
        cmocka_unit_test(normal_blocks_are_normal),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
