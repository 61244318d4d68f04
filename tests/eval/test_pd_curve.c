/* The SNR that a probability needs, from exact curves, drawn counts and counts that do not tell. */
#include "sim/eval/pd_curve.h"

#include "sim/eval/detection_theory.h"
#include "tests/test_support.h"

enum { MOST = 60 };

static double draw(uint64_t *state) {
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return ((double)(*state >> 11) + 0.5) * 0x1p-53;
}

/* Ideal detector with its SNR scaled by `gain`; counts are the expectation, or drawn. */
static int ideal_counts(double pfa, double gain, double chance, int64_t trials, double step,
                        uint64_t *state, bst_pd_point out[MOST]) {
    int count = 0;
    for (double snr = 2.0; snr <= 12.0 + 1e-9; snr += step) {
        double pd = bst_eval_ideal_pd(pfa, gain * snr), raw = pd + (1.0 - pd) * chance;
        int64_t hits = (int64_t)llround(raw * (double)trials);
        if (state) {
            hits = 0;
            for (int64_t i = 0; i < trials; i++) {
                hits += draw(state) < raw;
            }
        }
        out[count++] = (bst_pd_point){snr, trials, hits};
    }
    return count;
}

static void a_known_loss_is_found(void **state) {
    (void)state;
    bst_pd_point points[MOST];
    const double pfa = 1.0 / (2048.0 * 2048.0), losses[] = {0.0, 0.3, 1.5, 4.0, -0.1};
    for (int k = 0; k < 5; k++) {
        double gain = pow(10.0, -losses[k] / 20.0);
        for (double step = 0.25; step <= 1.0; step *= 2.0) {
            int n = ideal_counts(pfa, gain, 0.0, 1000000000, step, NULL, points);
            for (double pd = 0.5; pd < 1.0; pd += 0.4) {
                bst_pd_needed needed = bst_pd_snr_at(points, n, 0.0, pd);
                /* counts are rounded to 1e-9 of the trials */
                bst_assert_close(bst_pd_loss_db(needed.snr, pfa, pd), losses[k], 1e-6);
            }
            /* a thousand times as many trials above, then also below: the fit's equations are
             * uneven, its curve is the same */
            for (int part = 0; part < 2; part++) {
                for (int i = part ? 0 : n / 2; i < (part ? n / 4 : n); i++) {
                    points[i].trials *= 1000;
                    points[i].detected *= 1000;
                }
                bst_pd_needed needed = bst_pd_snr_at(points, n, 0.0, 0.9);
                bst_assert_close(bst_pd_loss_db(needed.snr, pfa, 0.9), losses[k], 1e-6);
            }
        }
    }
}

/* Matches by chance, as with many false alarms or long streaks, change nothing once they are known.
 */
static void chance_is_taken_off(void **state) {
    (void)state;
    bst_pd_point points[MOST];
    const double pfa = 1e-4, chance = 0.07;
    int n = ideal_counts(pfa, 1.0, chance, 1000000000, 0.5, NULL, points);
    bst_assert_close(bst_pd_snr_at(points, n, chance, 0.5).snr, bst_eval_ideal_snr(pfa, 0.5), 1e-6);
    /* not taken off: found too soon by 2 % of the trials over the slope of 0.4 */
    assert_true(bst_pd_snr_at(points, n, 0.0, 0.5).snr < bst_eval_ideal_snr(pfa, 0.5) - 0.05);
    bst_assert_close(bst_pd_without_chance(0.07, chance), 0.0, 1e-15);
    bst_assert_close(bst_pd_without_chance(0.5 + 0.5 * 0.07, chance), 0.5, 1e-15);
    assert_true(bst_pd_without_chance(0.01, chance) == 0.0);
}

/* Many draws of 500 trials a point: no bias, and the deviation is as stated. */
static void the_deviation_is_as_stated(void **state) {
    (void)state;
    enum { RUNS = 400 };
    bst_pd_point points[MOST];
    const double pfa = 2e-7, truth = bst_eval_ideal_snr(pfa, 0.9);
    uint64_t seed = 7;
    double sum = 0.0, square = 0.0, reported = 0.0;
    for (int r = 0; r < RUNS; r++) {
        int n = ideal_counts(pfa, 1.0, 0.0, 500, 0.5, &seed, points);
        bst_pd_needed needed = bst_pd_snr_at(points, n, 0.0, 0.9);
        sum += needed.snr - truth;
        square += (needed.snr - truth) * (needed.snr - truth);
        reported += needed.sigma / RUNS;
    }
    /* 4 sigma of a mean of 400; a deviation from 400 is right to 3.5 %: 5 sigma, and points chosen
     * by what was counted in them */
    bst_assert_close(sum / RUNS, 0.0, 4 * reported / sqrt(RUNS) + 0.1 * reported);
    bst_assert_close(sqrt(square / RUNS) / reported, 1.0, 0.2);
}

static void what_is_not_reached_is_not_reported(void **state) {
    (void)state;
    bst_pd_point points[MOST];
    int n = ideal_counts(1e-7, 1.0, 0.0, 10000, 0.5, NULL, points);
    /* ends below, begins above, one point only, no trials */
    assert_true(isnan(bst_pd_snr_at(points, 5, 0.0, 0.5).snr));
    assert_true(isnan(bst_pd_snr_at(points + 14, n - 14, 0.0, 0.5).snr));
    assert_true(isnan(bst_pd_snr_at(points + 6, 1, 0.0, 0.5).snr));
    assert_true(isnan(bst_pd_snr_at(points, 0, 0.0, 0.5).snr));
    for (int i = 0; i < n; i++) {
        points[i].trials = points[i].detected = 0;
    }
    assert_true(isnan(bst_pd_snr_at(points, n, 0.0, 0.5).snr));
    assert_true(isnan(bst_pd_loss_db(5.0, 0.0, 0.5)));
    assert_true(isnan(bst_pd_loss_db(5.0, 0.6, 0.5)));
    /* descending SNR, as magnitudes give, is the same curve */
    bst_pd_point turned[MOST];
    n = ideal_counts(1e-7, 1.0, 0.0, 10000, 0.5, NULL, points);
    for (int i = 0; i < n; i++) {
        turned[i] = points[n - 1 - i];
    }
    bst_assert_close(bst_pd_snr_at(turned, n, 0.0, 0.5).snr, bst_pd_snr_at(points, n, 0.0, 0.5).snr,
                     1e-9); /* order of summation */
}

/* Half a step beyond the points that are neither sure nor hopeless, and no further. */
static void half_a_step_beyond(void **state) {
    (void)state;
    const int64_t trials = 1000000;
    bst_pd_point points[8];
    int count = 0;
    for (double u = -1.0; u <= 1.01; u += 0.5) {
        double pd = bst_eval_normal_tail(-1.1 * u);
        points[count++] = (bst_pd_point){6.0 + u, trials, (int64_t)llround(pd * (double)trials)};
    }
    points[count++] = (bst_pd_point){12.0, trials, trials};
    points[count++] = (bst_pd_point){1.0, trials, 0};
    for (int side = -1; side <= 1; side += 2) {
        double near = side * 1.23, far = side * 1.28; /* the end is at 1 + 0.5 / 2 */
        bst_pd_needed needed = bst_pd_snr_at(points, count, 0.0, bst_eval_normal_tail(-1.1 * near));
        bst_assert_close(needed.snr, 6.0 + near, 1e-4);
        assert_true(isnan(bst_pd_snr_at(points, count, 0.0, bst_eval_normal_tail(-1.1 * far)).snr));
    }
}

/* Counts whose probit is 1.1 u - 0.06 u^2, u = snr - 6, which three terms fit exactly. The
 * deviation is what the trials' scatter makes of the place found, by moving each point's count in
 * turn. */
static void the_deviation_of_a_bent_curve(void **state) {
    (void)state;
    const int64_t trials = 1000000;
    bst_pd_point points[16];
    int count = 0;
    for (double u = -2.0; u <= 3.01; u += 0.5) {
        double pd = bst_eval_normal_tail(-(1.1 * u - 0.06 * u * u));
        points[count++] = (bst_pd_point){6.0 + u, trials, (int64_t)llround(pd * (double)trials)};
    }
    bst_pd_needed needed = bst_pd_snr_at(points, count, 0.0, 0.9);
    /* 1.1 u - 0.06 u^2 = 1.2815516 at u = 1.25053: counts are rounded to 1e-6 */
    double at = (1.1 - sqrt(1.21 - 0.24 * 1.2815516)) / 0.12;
    bst_assert_close(needed.snr, 6.0 + at, 1e-4);
    double variance = 0.0;
    for (int i = 0; i < count; i++) {
        double pd = (double)points[i].detected / (double)trials, place[2];
        for (int side = 0; side < 2; side++) {
            bst_pd_point moved[16];
            memcpy(moved, points, sizeof moved);
            moved[i].detected += side ? -1000 : 1000;
            place[side] = bst_pd_snr_at(moved, count, 0.0, 0.9).snr;
        }
        double slope = (place[0] - place[1]) / 2000.0;
        if (pd > 0.02 && pd < 0.98) {
            variance += slope * slope * (double)trials * pd * (1.0 - pd);
        }
    }
    /* differences over a thousandth of the trials: second order, and the fit's own tolerance */
    bst_assert_close(needed.sigma / sqrt(variance), 1.0, 0.01);
}

/* Points end at Pd 0.6 and go on six sigmas farther: where Pd is 0.9, one sigma beyond the last
 * informative point, nothing was counted within half a step. */
static void no_crossing_far_beyond_the_points(void **state) {
    (void)state;
    bst_pd_point points[8];
    int count = 0;
    for (double u = -1.5; u <= 0.26; u += 0.25) {
        double pd = bst_eval_normal_tail(-u);
        points[count++] = (bst_pd_point){6.0 + u, 100000, (int64_t)llround(1e5 * pd)};
    }
    points[count - 1] = (bst_pd_point){12.0, 100000, 100000};
    assert_true(isnan(bst_pd_snr_at(points, count, 0.0, 0.9).snr));
    /* within half a step: u = 0 is the last point, 0.1 is found */
    double pd = bst_eval_normal_tail(-0.1);
    bst_assert_close(bst_pd_snr_at(points, count, 0.0, pd).snr, 6.1, 1e-3); /* rounded counts */
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_deviation_of_a_bent_curve),
        cmocka_unit_test(no_crossing_far_beyond_the_points),
        cmocka_unit_test(a_known_loss_is_found),
        cmocka_unit_test(chance_is_taken_off),
        cmocka_unit_test(the_deviation_is_as_stated),
        cmocka_unit_test(what_is_not_reached_is_not_reported),
        cmocka_unit_test(half_a_step_beyond),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
