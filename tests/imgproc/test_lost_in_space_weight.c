/* Likelihood ratio of a match of stars and detections, factor by factor. */
#include "imgproc/identify/lost_in_space_internal.h"
#include "tests/test_support.h"

enum { SOURCES = 7, STARS = 6 };

/* A match; places by chance are 2e4 px^2 of 1e6. */
typedef struct match {
    bst_lost_in_space s;
    bst_lost_in_space_source sources[SOURCES];
    double nearest2[SOURCES], area_px2[SOURCES], found_share[STARS], v_mag[STARS];
    int star_of[SOURCES];
    bst_lost_in_space_attempt attempt;
} match;

static void setup_match(match *m) {
    const double mag[SOURCES] = {-9.0, -8.6, -8.1, -7.7, -7.2, -6.9, -6.5};
    const double v_mag[STARS] = {6.2, 6.3, 7.1, 7.2, 7.9, 9.0};
    const double share[STARS] = {0.99, 0.95, 0.9, 0.7, 0.5, 0.01}; /* the last is below chance */
    *m = (match){.attempt = {.area_px2 = 1e6}};
    for (int i = 0; i < SOURCES; i++) {
        m->sources[i].mag = mag[i];
        m->nearest2[i] = 0.1 * i;
        m->area_px2[i] = 2e3 + 500.0 * i;
        m->star_of[i] = -1;
    }
    memcpy(m->found_share, share, sizeof share);
    memcpy(m->v_mag, v_mag, sizeof v_mag);
    m->s = (bst_lost_in_space){.sources = m->sources,
                               .nearest2 = m->nearest2,
                               .area_px2 = m->area_px2,
                               .star_of = m->star_of,
                               .found_share = m->found_share,
                               .v_mag = m->v_mag};
    m->attempt.s = &m->s;
}

/* A place in its ellipse, over even spread: a normal one up to 3 sigma, and a fifth by chance. */
static double density(double distance2) {
    return 0.8 * 4.5 * exp(-4.5 * distance2) / (1.0 - exp(-4.5)) + 0.2;
}

static double normal(double d) {
    return exp(-0.5 * d * d / 0.16); /* 0.4 mag */
}

/* Likelihood ratio with what source i has: stars that are not found, and a match. */
static void matches_without_a_quad(void **state) {
    (void)state;
    const int none[4] = {-1, -1, -1, -1};
    match m;
    bst_lost_in_space_result out;
    setup_match(&m);
    double area = 7 * 2e3 + 500.0 * 21, chance = 1.0 - exp(-area / 1e6);
    double unseen = 1.0;
    for (int k = 0; k < 5; k++) {
        unseen *= (1.0 - m.found_share[k]) / (1.0 - chance);
    }
    bst_assert_close(bst_lost_in_space_log_ratio(&m.attempt, none, STARS, SOURCES, &out),
                     log(unseen), 1e-9);
    assert_int_equal(out.predicted, 3); /* 0.9 or more */
    assert_int_equal(out.matched, 0);
    /* two matches: no zero point of magnitudes, each of seven detections is as probable */
    m.star_of[1] = 0;
    m.star_of[4] = 3;
    m.star_of[6] = 5; /* as probable by chance: does not count */
    double both = unseen, shares[2] = {0.99, 0.7}, at[2] = {1, 4};
    m.star_of[6] = -1;
    for (int k = 0; k < 2; k++) {
        double own = (2e3 + 500.0 * at[k]) / 1e6;
        both *= shares[k] * density(0.1 * at[k]) / own / 7.0 / ((1.0 - shares[k]) / (1.0 - chance));
    }
    bst_assert_close(bst_lost_in_space_log_ratio(&m.attempt, none, STARS, SOURCES, &out), log(both),
                     1e-9);
    assert_int_equal(out.matched, 1);
    /* three: the zero point is their mean */
    m.star_of[6] = 5;
    double zero = ((6.2 + 8.6) + (7.2 + 7.2) + (9.0 + 6.5)) / 3.0, with = unseen;
    for (int k = 0; k < 2; k++) {
        double own = (2e3 + 500.0 * at[k]) / 1e6, sum = 0.0, v = k ? 7.2 : 6.2;
        for (int i = 0; i < SOURCES; i++) {
            sum += normal(v - m.sources[i].mag - zero);
        }
        double fits = normal(v - m.sources[(int)at[k]].mag - zero);
        with *= shares[k] * density(0.1 * at[k]) / own * (0.8 * fits / sum + 0.2 / 7.0) /
                ((1.0 - shares[k]) / (1.0 - chance));
    }
    bst_assert_close(bst_lost_in_space_log_ratio(&m.attempt, none, STARS, SOURCES, &out), log(with),
                     1e-9);
    assert_int_equal(out.predicted, 3);
    assert_int_equal(out.matched, 1);
    /* fewer sources take part, and fewer stars */
    double two = 1.0;
    area = 4 * 2e3 + 500.0 * 6;
    chance = 1.0 - exp(-area / 1e6);
    two *= 0.99 * density(0.1) / 2.5e-3 / 4.0;
    two *= 0.05 / (1.0 - chance);
    bst_assert_close(bst_lost_in_space_log_ratio(&m.attempt, none, 2, 4, &out), log(two), 1e-9);
    assert_int_equal(out.predicted, 2);
}

/* Of the quad's detections the brightnesses count, by all their orders; they give the zero point,
 * and take no part in the chance of others. */
static void matches_with_a_quad(void **state) {
    (void)state;
    const int quad[4] = {0, 2, 3, 5};
    const int star[4] = {0, 1, 2, 4};
    match m;
    bst_lost_in_space_result out;
    setup_match(&m);
    double ratio = 1.0, zero = 0.0, sum = 0.0;
    for (int i = 0; i < 4; i++) {
        m.star_of[quad[i]] = star[i];
        zero += 0.25 * (m.v_mag[star[i]] - m.sources[quad[i]].mag);
    }
    m.star_of[4] = 3;
    for (int i = 0; i < SOURCES; i++) { /* beside the quad's: 1, 4 and 6 */
        bool own = i == 0 || i == 2 || i == 3 || i == 5;
        sum += own ? 0.0 : normal(7.2 - m.sources[i].mag - zero);
    }
    /* the quad's own stars are neither seen nor missed */
    ratio *=
        0.7 * density(0.4) / 4e-3 * (0.8 * normal(7.2 - m.sources[4].mag - zero) / sum + 0.2 / 3.0);
    double orders = 0.0, right = 0.0; /* of 24, of the likelihood with one free zero point */
    for (int k = 0; k < 256; k++) {
        int of[4] = {k % 4, k / 4 % 4, k / 16 % 4, k / 64}, used = 0;
        double mean = 0.0, square = 0.0;
        for (int i = 0; i < 4; i++) {
            used |= 1 << of[i];
            double d = m.v_mag[star[of[i]]] - m.sources[quad[i]].mag;
            mean += 0.25 * d;
            square += d * d;
        }
        if (used == 15) {
            double likelihood = exp(-0.5 * (square - 4.0 * mean * mean) / 0.16);
            orders += likelihood / 24.0;
            right = k == 228 /* 0, 1, 2, 3 */ ? likelihood : right;
        }
    }
    ratio *= 0.8 * right / orders + 0.2;
    assert_true(right / orders > 1.5);
    bst_assert_close(bst_lost_in_space_log_ratio(&m.attempt, quad, STARS, SOURCES, &out),
                     log(ratio), 1e-9);
    assert_int_equal(out.matched, 3);
}

/* Of four degrees of freedom, over chance, by which the square is even up to the limit of 28.5. */
static void chi_square_of_a_quad(void **state) {
    (void)state;
    double mean = 0.0;
    enum { STEPS = 20000 };
    for (int i = 0; i < STEPS; i++) { /* even in the square */
        double chi2 = 28.5 * sqrt((i + 0.5) / STEPS);
        mean += exp(bst_lost_in_space_log_quad(chi2)) / STEPS;
    }
    bst_assert_close(mean, 1.0, 2e-4); /* beyond the limit: 1e-5; steps */
    double far = exp(bst_lost_in_space_log_quad(28.5)), near = exp(bst_lost_in_space_log_quad(2.0));
    double other = exp(bst_lost_in_space_log_quad(4.0));
    bst_assert_close(far, 0.2, 1e-3);
    bst_assert_close((near - 0.2) / (other - 0.2), exp(1.0), 1e-9); /* density / chi2 */
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(matches_without_a_quad),
                                       cmocka_unit_test(matches_with_a_quad),
                                       cmocka_unit_test(chi_square_of_a_quad)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
