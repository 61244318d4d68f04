#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "boresight/vec.h"
#include "scenegen/fourier/batch_fft.h"
#include "tests/test_support.h"

/* Numbers without symmetry, of order one. */
static double number(int j, int lane, int part) {
    return sin(0.7 * j * j + 1.3 * lane + 2.1 * part) + 0.1 * lane;
}

/* X[k] of one lane, by the definition. */
static void exact(int n, int lane, int k, double out[2]) {
    out[0] = out[1] = 0.0;
    for (int j = 0; j < n; j++) {
        double a = -2.0 * BST_PI * (double)((long long)j * k % n) / n;
        double re = number(j, lane, 0), im = number(j, lane, 1);
        out[0] += re * cos(a) - im * sin(a);
        out[1] += re * sin(a) + im * cos(a);
    }
}

/* All radices, each as the first, the last and the only kind, and the lengths of large frames. */
static void transforms_are_those_of_the_definition(void **state) {
    static const int lengths[] = {16,  18,  20,  25,  27,  30,  32,  36,  40,   48,   64,  80,
                                  125, 128, 162, 240, 288, 480, 625, 960, 2304, 2560, 4608};
    bst_ctx ctx = {0};
    (void)state;
    for (size_t i = 0; i < sizeof lengths / sizeof *lengths; i++) {
        int n = lengths[i], step = n > 200 ? n / 40 : 1;
        bst_batch_fft *fft;
        bst_assert_ok(&ctx, bst_batch_fft_create(&ctx, n, &fft));
        bst_batch *data = aligned_alloc(64, (size_t)n * sizeof *data);
        for (int j = 0; j < n; j++) {
            for (int lane = 0; lane < BST_LANES; lane++) {
                data[j].re[lane] = (float)number(j, lane, 0);
                data[j].im[lane] = (float)number(j, lane, 1);
            }
        }
        bst_batch_fft_run(fft, data);
        const int *order = bst_batch_fft_order(fft);
        for (int lane = 0; lane < BST_LANES; lane += 5) {
            for (int k = 0; k < n; k += step) {
                double x[2];
                exact(n, lane, k, x);
                /* rounding grows with log n; a sum of n such numbers is up to 2.5 n */
                double limit = 1e-6 * (2.5 + sqrt((double)n)) * sqrt((double)n);
                bst_assert_close(data[order[k]].re[lane], x[0], limit);
                bst_assert_close(data[order[k]].im[lane], x[1], limit);
            }
        }
        free(data);
        bst_batch_fft_free(fft);
    }
}

/* Every place of the result is taken once. */
static void order_is_a_permutation(void **state) {
    bst_ctx ctx = {0};
    (void)state;
    enum { N = 720 };
    bst_batch_fft *fft;
    bool taken[N] = {false};
    bst_assert_ok(&ctx, bst_batch_fft_create(&ctx, N, &fft));
    for (int k = 0; k < N; k++) {
        int place = bst_batch_fft_order(fft)[k];
        assert_in_range(place, 0, N - 1);
        assert_false(taken[place]);
        taken[place] = true;
    }
    bst_batch_fft_free(fft);
}

static void cost_knows_the_lengths(void **state) {
    (void)state;
    assert_true(isinf(bst_batch_fft_cost(0)));
    assert_true(isinf(bst_batch_fft_cost(8)));
    assert_true(isinf(bst_batch_fft_cost(7 * 64)));
    assert_true(isinf(bst_batch_fft_cost(2 * 2311)));
    assert_true(bst_batch_fft_cost(2304) < bst_batch_fft_cost(2560));
    assert_true(bst_batch_fft_cost(2048) < bst_batch_fft_cost(2025));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(transforms_are_those_of_the_definition),
        cmocka_unit_test(order_is_a_permutation),
        cmocka_unit_test(cost_knows_the_lengths),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
