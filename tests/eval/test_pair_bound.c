/* The bound of pairs against closed forms of the finely sampled Gaussian. */
#include "sim/eval/pair_bound.h"

#include <stdlib.h>

#include "boresight/vec.h"
#include "tests/test_support.h"

enum { SIDE = 81 };
static const double SIGMA_PX = 4.0;

typedef struct drawing {
    bst_eval_region region;
    double work[4 * SIDE];
    double length_px; /* of a streak along x */
} drawing;

static void draw(void *user, double x_px, double y_px, double *share) {
    const drawing *d = user;
    bst_eval_bound_source s = {
        .x_px = x_px, .y_px = y_px, .dx_px = d->length_px, .sigma_px = SIGMA_PX, .flux_e = 1.0};
    bst_eval_gaussian_shares(&s, &d->region, share);
}

static bst_pair_image image_of(drawing *d, double length_px) {
    *d = (drawing){.region = {-40, -40, SIDE, SIDE}, .length_px = length_px};
    d->region.work = d->work;
    return (bst_pair_image){SIDE * SIDE, 0.0, 0.0, 20.0, draw, d};
}

/* Two Gaussians of the shares a and b overlap by r(d) = exp(-d^2 / (4 S^2)), S^2 = sigma^2 + 1/12.
 * The best single source at the place u on the line between takes max_u (a r(u) + b r(d - u))^2 of
 * the pair's a^2 + b^2 + 2 a b r(d): D / SNR in uniform noise, by a search over u. */
static double closed_form(double ratio, double apart) {
    double a = ratio / (1.0 + ratio), b = 1.0 - a, s2 = 4.0 * (SIGMA_PX * SIGMA_PX + 1.0 / 12.0);
    double best = 0.0;
    for (int i = 0; i <= 20000; i++) {
        double u = apart * i / 20000.0;
        best = fmax(best, a * exp(-u * u / s2) + b * exp(-(apart - u) * (apart - u) / s2));
    }
    return sqrt(a * a + b * b + 2.0 * a * b * exp(-apart * apart / s2) - best * best);
}

/* Tolerance: the pixel is a Gaussian of variance 1/12 up to fourth order, which D, a difference of
 * images, has four times as much as the bound of a place (1 / (960 sigma^4) = 4e-6); the step of
 * 0.01 px in slopes does not matter, as D is a minimum. */
static void distance_in_uniform_noise(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    static drawing d;
    const bst_eval_bound_noise noise = {5.0, false};
    const double root = sqrt(4.0 * BST_PI * (SIGMA_PX * SIGMA_PX + 1.0 / 12.0));
    bst_pair_image image = image_of(&d, 0.0);
    for (double ratio = 0.25; ratio <= 4.0; ratio *= 4.0) {
        for (double apart = 2.0; apart <= 16.0; apart *= 2.0) {
            const bst_close_pair pair = {1e4, ratio, 0.3, -0.2, 0.6 * apart, 0.8 * apart};
            double distance, snr = 1e4 / 5.0 / root;
            bst_assert_ok(&ctx, bst_pair_distance(&ctx, &image, &pair, &noise, &distance));
            double expected = snr * closed_form(ratio, apart);
            bst_assert_close(distance, expected, 2e-4 * expected);
        }
    }
    /* small distances of equal sources: SNR d^2 / (8 sqrt(2) S^2), the next order d^2 / 10 S^2 */
    const bst_close_pair near = {1e4, 1.0, 0.0, 0.0, 0.5, 0.0};
    double distance, s2 = SIGMA_PX * SIGMA_PX + 1.0 / 12.0;
    bst_assert_ok(&ctx, bst_pair_distance(&ctx, &image, &near, &noise, &distance));
    bst_assert_close(distance / (1e4 / 5.0 / root * 0.25 / (8.0 * sqrt(2.0) * s2)), 1.0, 2e-3);
}

/* Across a streak the image is a product, so that its pairs differ as those of points do; own light
 * as noise makes any pair harder to tell. */
static void across_a_streak(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    static drawing d;
    bst_pair_image image = image_of(&d, 20.0);
    double share[SIDE * SIDE], norm = 0.0, with, without;
    draw(&d, 0.3, -0.2, share);
    for (int i = 0; i < SIDE * SIDE; i++) {
        norm += share[i] * share[i];
    }
    const bst_close_pair pair = {1e4, 4.0, 0.3, -0.2, 0.0, 6.0};
    bst_assert_ok(&ctx, bst_pair_distance(&ctx, &image, &pair, &(bst_eval_bound_noise){5.0, false},
                                          &without));
    double expected = 1e4 / 5.0 * sqrt(norm) * closed_form(4.0, 6.0);
    bst_assert_close(without, expected, 2e-4 * expected);
    bst_assert_ok(
        &ctx, bst_pair_distance(&ctx, &image, &pair, &(bst_eval_bound_noise){5.0, true}, &with));
    assert_true(with > 0.5 * without && with < 0.97 * without);
}

/* Non-central chi-square of three degrees of freedom as a Poisson mixture of central ones, summed
 * in double precision: 1e-13. */
static void probabilities(void **state) {
    (void)state;
    static const double table[][3] = {{0.01, 1.0, 0.03307224829911422},
                                      {0.01, 4.387, 0.8999679444648686},
                                      {0.01, 6.0, 0.9978363384762323},
                                      {0.001, 4.387, 0.7236958286254653},
                                      {0.05, 1.0, 0.11565883736603601}};
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        bst_assert_close(bst_pair_pd_at(table[i][1], table[i][0]).unknown, table[i][2], 1e-10);
    }
    bst_assert_close(bst_pair_pd_at(0.0, 0.01).known, 0.01, 1e-12);
    bst_assert_close(bst_pair_pd_at(0.0, 0.01).unknown, 0.01, 1e-9);
    /* Q^-1(0.01) - Q^-1(0.9) */
    bst_assert_close(bst_pair_pd_at(3.6078994396, 0.01).known, 0.9, 1e-9);
}

/* The separations are those of D = 3.608 and 4.387, found here from the closed form; bisection to
 * 20 / 2^13 px. */
static void separations(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    static drawing d;
    const bst_eval_bound_noise noise = {5.0, false};
    const double root = sqrt(4.0 * BST_PI * (SIGMA_PX * SIGMA_PX + 1.0 / 12.0));
    bst_pair_image image = image_of(&d, 0.0);
    const double snr = 40.0, flux = snr * 5.0 * root;
    const bst_close_pair equal = {.flux_e = flux, .ratio = 1.0},
                         faint = {.flux_e = 0.5 * flux, .ratio = 4.0};
    bst_pair_separations out;
    bst_assert_ok(&ctx, bst_pair_separations_at(&ctx, &image, &equal, &noise, 0.01, 0.9, &out));
    bst_assert_close(snr * closed_form(1.0, out.known_px), 3.6079, 5e-3);
    bst_assert_close(snr * closed_form(1.0, out.unknown_px), 4.3873, 5e-3);
    /* too faint: D is at most 20 sqrt(0.2^2 + 0.8^2 - 0.8^2) = 4 at any distance */
    bst_assert_ok(&ctx, bst_pair_separations_at(&ctx, &image, &faint, &noise, 0.01, 0.9, &out));
    assert_true(isfinite(out.known_px) && isnan(out.unknown_px));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(distance_in_uniform_noise), cmocka_unit_test(across_a_streak),
        cmocka_unit_test(probabilities), cmocka_unit_test(separations)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
