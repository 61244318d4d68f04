/* Tails of the normal distribution and intervals against 40-digit values and published tables. */
#include "sim/eval/detection_theory.h"

#include <float.h>

#include "sim/eval/consistency.h"
#include "tests/test_support.h"

typedef struct pair {
    double in, out;
} pair;

/* mpmath 1.3 with 40 digits; five digits of the first ones also in Abramowitz and Stegun,
 * table 26.1. Tolerance: erfc and exp of the C library are right to a few units of the last place,
 * and so is what they make. */
static void tail_is_right_to_the_last_places(void **state) {
    (void)state;
    const pair truth[] = {
        {-8, 0.999999999999999378},
        {-1, 0.841344746068542949},
        {0, 0.5},
        {0.5, 0.308537538725986896},
        {1, 0.158655253931457051},
        {2, 0.0227501319481792072},
        {3, 0.00134989803163009453},
        {5, 2.86651571879193912e-7},
        {5.125, 1.48768873187766285e-7},
        {8, 6.22096057427178412e-16},
        {12, 1.776482112077679e-33},
        {20, 2.7536241186062337e-89},
        {30, 4.90671392714818706e-198},
        {37, 5.72557122252457682e-300},
    };
    for (size_t i = 0; i < sizeof truth / sizeof *truth; i++) {
        bst_assert_close(bst_eval_normal_tail(truth[i].in) / truth[i].out, 1.0,
                         (fabs(truth[i].in) > 30 ? 1e-13 : 12 * DBL_EPSILON));
    }
    assert_true(bst_eval_normal_tail(INFINITY) == 0.0 && bst_eval_normal_tail(-INFINITY) == 1.0);
}

static void inverse_is_right_to_the_last_places(void **state) {
    (void)state;
    const pair truth[] = {
        {0.4, 0.253347103135799741},    {0.499999, 2.50662827456655938e-6},
        {0.3, 0.524400512708040816},    {0.25, 0.674489750196081743},
        {0.1, 1.28155156554460044},     {1e-3, 3.09023230616781354},
        {0x1p-22, 5.03540596946392715}, {1e-10, 6.3613409024040562},
        {1e-50, 14.933337534788489},    {1e-89, 20.0504568851150318},
        {1e-100, 21.2734535609653243},  {1e-300, 37.0470962993611992},
    };
    for (size_t i = 0; i < sizeof truth / sizeof *truth; i++) {
        /* beside the method's own rounding, that of 0.499999 as a double */
        bst_assert_close(bst_eval_normal_tail_inverse(truth[i].in) / truth[i].out, 1.0,
                         truth[i].in > 0.49 ? 1e-11 : 6 * DBL_EPSILON);
        if (truth[i].in > 1e-3) {
            /* 1 - p rounds, by at most half a unit of 1 */
            bst_assert_close(bst_eval_normal_tail_inverse(1.0 - truth[i].in), -truth[i].out, 1e-13);
        }
    }
    assert_true(bst_eval_normal_tail_inverse(0.5) == 0.0);
    assert_true(isinf(bst_eval_normal_tail_inverse(0.0)) && bst_eval_normal_tail_inverse(0.0) > 0);
    assert_true(isinf(bst_eval_normal_tail_inverse(1.0)) && bst_eval_normal_tail_inverse(1.0) < 0);
    assert_true(isnan(bst_eval_normal_tail_inverse(-0.1)) &&
                isnan(bst_eval_normal_tail_inverse(1.1)) &&
                isnan(bst_eval_normal_tail_inverse(NAN)));
    assert_true(bst_eval_normal_tail_inverse(DBL_TRUE_MIN) > 38.4 &&
                bst_eval_normal_tail_inverse(DBL_TRUE_MIN) < 38.5);
    for (double tail = 0.9; tail > 1e-200; tail *= 0.93) {
        double x = bst_eval_normal_tail_inverse(tail);
        /* Q has the condition number x^2 */
        bst_assert_close(bst_eval_normal_tail(x) / tail, 1.0, 4 * DBL_EPSILON * (4 + x * x));
    }
}

static void ideal_detector_is_neyman_pearsons(void **state) {
    (void)state;
    /* without a signal it is the false-alarm probability, at Q^-1(pfa) it is a half */
    bst_assert_close(bst_eval_ideal_pd(1e-6, 0.0) / 1e-6, 1.0, 1e-13); /* condition number 23 */
    bst_assert_close(bst_eval_ideal_pd(1e-3, 3.0902323061678135), 0.5, 1e-15);
    bst_assert_close(bst_eval_ideal_snr(0x1p-22, 0.5), 5.03540596946392715, 1e-14);
    bst_assert_close(bst_eval_ideal_snr(0x1p-22, 0.9), 5.03540596946392715 + 1.28155156554460044,
                     1e-14);
    bst_assert_close(bst_eval_ideal_pd(1e-5, bst_eval_ideal_snr(1e-5, 0.73)), 0.73, 1e-14);
}

/* Without own light it is the ideal detector; with it the two functions are inverses, and at a half
 * nothing changes. */
static void own_light_flattens_the_curve(void **state) {
    (void)state;
    bst_assert_close(bst_eval_matched_filter_pd(1e-6, 6.0, 0.0), bst_eval_ideal_pd(1e-6, 6.0),
                     1e-15);
    bst_assert_close(bst_eval_matched_filter_snr(1e-6, 0.5, 0.05), bst_eval_ideal_snr(1e-6, 0.5),
                     1e-14);
    /* (6.5 - 5) / sqrt(1 + 0.2 * 6.5) = 0.98907 */
    bst_assert_close(bst_eval_matched_filter_pd(bst_eval_normal_tail(5.0), 6.5, 0.2),
                     bst_eval_normal_tail(-1.5 / sqrt(2.3)), 1e-14);
    for (double pd = 0.05; pd < 1.0; pd += 0.1) {
        for (double own = 0.0; own < 2.0; own += 0.3) {
            double snr = bst_eval_matched_filter_snr(1e-7, pd, own);
            bst_assert_close(bst_eval_matched_filter_pd(1e-7, snr, own), pd, 1e-13);
        }
    }
}

/* Newcombe 1998, Statistics in Medicine 17, 857, table I, method 3: four decimals. */
static void wilson_interval_is_the_published_one(void **state) {
    (void)state;
    const struct {
        int hits, trials;
        double low, high;
    } truth[] = {{81, 263, 0.2553, 0.3662},
                 {15, 148, 0.0624, 0.1605},
                 {0, 20, 0.0, 0.1611},
                 {1, 29, 0.0061, 0.1718}};
    for (int i = 0; i < 4; i++) {
        bst_eval_interval w =
            bst_eval_wilson_interval(truth[i].hits, truth[i].trials, BST_NORMAL_95);
        bst_assert_close(w.low, truth[i].low, 0.5e-4);
        bst_assert_close(w.high, truth[i].high, 0.5e-4);
    }
    bst_eval_interval all = bst_eval_wilson_interval(20, 20, BST_NORMAL_95);
    assert_true(all.high == 1.0);
    bst_assert_close(all.low, 1 - 0.1611, 0.5e-4);
    bst_eval_interval none = bst_eval_wilson_interval(0, 0, BST_NORMAL_95);
    assert_true(none.low == 0.0 && none.high == 1.0);
}

/* mpmath, 40 digits; Garwood's own table has their first digits. Tolerance: lgamma of a large
 * count is right to its own last place, which exp turns into a relative error of the tail. */
static void poisson_interval_is_exact(void **state) {
    (void)state;
    const struct {
        int64_t count;
        double alpha, low, high;
    } truth[] = {{0, 0.05, 0, 3.6888794541139363},
                 {1, 0.05, 0.025317807984289875, 5.5716433909388986},
                 {2, 0.05, 0.2422092785439649, 7.2246876677239608},
                 {5, 0.05, 1.6234863901184205, 11.66833207932267},
                 {10, 0.05, 4.7953886961324336, 18.390356042017779},
                 {100, 0.05, 81.36399125092314, 121.62679379242639},
                 {1000, 0.05, 938.97301840769522, 1063.952136016302},
                 {12345, 0.05, 12128.180907899079, 12564.722206913333},
                 {0, 0.01, 0, 5.2983173665480367},
                 {3, 0.01, 0.3378633887277333, 10.977477495329766},
                 {40, 0.01, 25.585965945222584, 59.363067206817074}};
    for (size_t i = 0; i < sizeof truth / sizeof *truth; i++) {
        bst_eval_interval p = bst_eval_poisson_interval(truth[i].count, truth[i].alpha);
        bst_assert_close(p.low, truth[i].low, 1e-12 * (1 + truth[i].low));
        bst_assert_close(p.high, truth[i].high, 1e-12 * (1 + truth[i].high));
    }
    /* many events: the normal limit with its first corrections, (z^2 + 2) / 3 resp. (z^2 - 1) / 3
     * and the step of one; what follows is of the order 1 / sqrt(count) */
    bst_eval_interval many = bst_eval_poisson_interval(1000000, 0.05);
    double z = BST_NORMAL_95;
    bst_assert_close(many.low, 1e6 - z * 1e3 + (z * z - 1) / 3, 2e-3);
    bst_assert_close(many.high, 1e6 + z * sqrt(1e6 + 1) + (z * z - 1) / 3 + 1, 2e-3);
}

/* Two-sided bounds of 95 % from tables of chi-square (Abramowitz and Stegun, table 26.8): 0.484419
 * and 11.1433 of 4 degrees of freedom, 2.17973 and 17.5345 of 8; a step without values is not
 * judged. */
static void consistency_has_two_sided_bounds(void **state) {
    (void)state;
    const double one[] = {0.484, 0.485, 11.143, 11.144, NAN};
    bst_consistency c;
    bst_consistency_check(one, 1, 5, 4, 0.95, &c);
    assert_int_equal(c.steps_judged, 4);
    bst_assert_close(c.inside, 0.5, 1e-12);
    bst_assert_close(c.below, 0.25, 1e-12);
    bst_assert_close(c.above, 0.25, 1e-12);
    bst_assert_close(c.mean_over_dof, (0.484 + 0.485 + 11.143 + 11.144) / 16, 1e-12);
    /* sums of two runs; in the third step one of them has no value */
    const double two[] = {1.0, 9.0, 0.485, 17.5, 1.179, 8.5, NAN, 0.035};
    bst_consistency_check(two, 2, 4, 4, 0.95, &c);
    assert_int_equal(c.steps_judged, 4);
    bst_assert_close(c.inside, 0.5, 1e-12); /* 17.5 of two and 0.485 of one */
    bst_assert_close(c.below, 0.25, 1e-12); /* 2.179 */
    bst_assert_close(c.above, 0.25, 1e-12); /* 17.535 */
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tail_is_right_to_the_last_places),
        cmocka_unit_test(consistency_has_two_sided_bounds),
        cmocka_unit_test(inverse_is_right_to_the_last_places),
        cmocka_unit_test(ideal_detector_is_neyman_pearsons),
        cmocka_unit_test(own_light_flattens_the_curve),
        cmocka_unit_test(wilson_interval_is_the_published_one),
        cmocka_unit_test(poisson_interval_is_exact),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
