/* The share of an attitude's errors that stays with its stars, against its closed form. */
#include "tracker/attitude/attitude_shared.h"

#include <string.h>

#include "boresight/rng.h"
#include "tests/test_support.h"

#define AS BST_ARCSEC_RAD
#define STARS 400

static const bst_camera camera = {.width_px = 1024, .height_px = 1024, .pixel_scale_arcsec = 3.0};
static const bst_attitude_params params = {
    .floor_px = 0.0, .reject_chi2 = 30.0, .max_cross_rad = 6.0 * AS, .max_roll_rad = 6000.0 * AS};

typedef struct sky {
    bst_vec3 place[STARS];     /* of the catalogue */
    double stays_px[STARS][2]; /* what is wrong with it */
    double sigma_px[STARS];    /* of a frame's own errors */
} sky;

/* A field of `count` stars, each with errors that stay of share `share` of their variance; every
 * `turnover` frames a star gives way to another one, 0: never. The true covariance of successive
 * attitudes, over their variance, comes from the attitudes themselves. */
static void measure(int count, double share, int turnover, int frames, double *estimate,
                    double *truth) {
    static bst_attitude_shared shared;
    static sky s;
    bst_rng_key key = bst_rng_make_key(7, (uint32_t)(1000.0 * share), "test", "shared");
    memset(&shared, 0, sizeof shared);
    uint64_t draw = 0;
    for (int i = 0; i < STARS; i++) {
        double x = 1000.0 * bst_rng_uniform(key, 0, draw++) + 12.0;
        double y = 1000.0 * bst_rng_uniform(key, 0, draw++) + 12.0;
        s.place[i] = bst_camera_unproject(&camera, x, y);
        s.sigma_px[i] = i % 3 == 0 ? 0.05 : 0.15;
        for (int k = 0; k < 2; k++) {
            s.stays_px[i][k] = sqrt(share) * s.sigma_px[i] * bst_rng_normal(key, 1, draw++);
        }
    }
    double before[2] = {0.0}, products = 0.0, squares = 0.0;
    for (int f = 0; f < frames; f++) {
        /* the camera turns about its boresight and moves on by some arcsec */
        bst_vec3 turn = {5 * AS * sin(0.3 * f), 4 * AS * cos(0.2 * f), 0.01 * f};
        bst_quat q = bst_quat_from_rotvec(turn);
        bst_attitude_star stars[STARS];
        int first = turnover > 0 ? (f / turnover) % (STARS - count) : 0;
        for (int i = 0; i < count; i++) {
            int n = first + i;
            double x = 0.0, y = 0.0, sigma = s.sigma_px[n], own = sqrt(1.0 - share) * sigma;
            assert_true(bst_camera_project(&camera, bst_quat_rotate(q, s.place[n]), &x, &y));
            /* what stays turns with the sky */
            double c = cos(turn.z), d = sin(turn.z), *b = s.stays_px[n];
            double dx = own * bst_rng_normal(key, 2, draw++);
            double dy = own * bst_rng_normal(key, 2, draw++);
            stars[i] = (bst_attitude_star){.id = (uint32_t)(n + 1),
                                           .apparent_gcrf = s.place[n],
                                           .x_px = x + c * b[0] - d * b[1] + dx,
                                           .y_px = y + d * b[0] + c * b[1] + dy,
                                           .cov_xx = sigma * sigma,
                                           .cov_yy = sigma * sigma};
        }
        bst_attitude_solution out;
        bst_attitude_solve(&camera, &params, q, stars, count, &out);
        assert_true(out.valid);
        bst_vec3 pull = {0.0, 0.0, 0.0};
        double leverage = 0.0;
        for (int i = 0; i < count; i++) {
            pull = bst_vec3_add(pull, stars[i].weight > 0.0 ? stars[i].pull_rad : (bst_vec3){0});
            leverage += stars[i].weight > 0.0 ? stars[i].leverage : 0.0;
        }
        /* the normal equations, of attitudes known to 0.1 arcsec */
        bst_assert_close(bst_vec3_norm(pull) / AS, 0.0, 5e-3);
        bst_assert_close(leverage, 1.0, 1e-3); /* their trace over two angles */
        bst_attitude_shared_update(&shared, &out, stars, count);
        bst_vec3 e = bst_quat_rotate(bst_quat_conj(q), bst_quat_to_rotvec(bst_quat_mul(
                                                           out.q_cam_from_gcrf, bst_quat_conj(q))));
        products += f > 0 ? e.x * before[0] + e.y * before[1] : 0.0;
        squares += e.x * e.x + e.y * e.y;
        before[0] = e.x;
        before[1] = e.y;
    }
    *estimate = bst_attitude_shared_get(&shared);
    *truth = products / squares;
}

/* Errors of which nothing stays, a part, nearly all; stars that come and go, so that the mean over
 * their errors is sharp: 900 frames of 12 stars pass by 300 stars. */
static void follows_the_share(void **state) {
    (void)state;
    const double shares[] = {0.0, 0.25, 0.8};
    for (int i = 0; i < 3; i++) {
        double got, truth;
        measure(12, shares[i], 3, 900, &got, &truth);
        /* one star of 12 leaves every third frame */
        double expected = shares[i] * (1.0 - 1.0 / 36.0);
        print_message(
            "share %.2f: estimate %.3f, of the attitudes' own errors %.3f, expected %.3f\n",
            shares[i], got, truth, expected);
        /* products of 900 frames of 8 effective stars are good to 0.02; 75 fields to 0.05 of it */
        bst_assert_close(got, expected, 0.03 + 0.15 * expected);
        bst_assert_close(truth, expected, 0.1 + 0.2 * expected);
    }
}

/* Before anything is seen it is the assumption, and it stays near that for a few frames. */
static void begins_with_the_assumption(void **state) {
    (void)state;
    static const bst_attitude_shared nothing;
    bst_assert_close(bst_attitude_shared_get(&nothing), 0.04, 1e-12);
    double got, truth;
    measure(12, 0.0, 0, 2, &got, &truth);
    bst_assert_close(got, 0.04, 0.1); /* one product in eleven */
}

/* Two frames of cameras that are turned and tilted against each other: the products of the pulls in
 * the sky's axes, by hand. */
static void products_are_those_of_the_sky(void **state) {
    (void)state;
    static bst_attitude_shared shared;
    memset(&shared, 0, sizeof shared);
    const bst_vec3 turns[2] = {{0.4, -0.9, 0.3}, {-0.2, 0.5, 1.7}};
    const double pulls[2][6][2] = {{{3, -1}, {-2, 4}, {1, 5}, {-6, 2}, {2, 2}, {9, 9}},
                                   {{-1, -4}, {-5, 3}, {2, -6}, {-3, -1}, {7, -8}, {9, 9}}};
    const double leverage[6] = {0.1, 0.3, 0.9, 0.2, 0.05, 0.0};
    const double variance[2][3] = {{30, 20, 1e4}, {45, 80, 2e4}};
    bst_vec3 seen[2][6];
    for (int f = 0; f < 2; f++) {
        bst_quat q = bst_quat_from_rotvec(turns[f]);
        bst_attitude_star stars[6] = {{0}};
        bst_attitude_solution fix = {.valid = true, .stars_used = 5, .q_cam_from_gcrf = q};
        for (int i = 0; i < 6; i++) {
            /* the fifth is another star in the second frame, the sixth is rejected there */
            stars[i] = (bst_attitude_star){.id = (uint32_t)(i == 4 ? 50 + f : 10 + i),
                                           .weight = f == 1 && i == 5 ? 0.0 : 1.0,
                                           .pull_rad = {pulls[f][i][0], pulls[f][i][1], 77.0},
                                           .leverage = leverage[i]};
            bst_vec3 x = bst_quat_rotate(bst_quat_conj(q), (bst_vec3){1, 0, 0});
            bst_vec3 y = bst_quat_rotate(bst_quat_conj(q), (bst_vec3){0, 1, 0});
            seen[f][i] = bst_vec3_axpy(bst_vec3_scale(x, pulls[f][i][0]), pulls[f][i][1], y);
        }
        for (int a = 0; a < 3; a++) {
            fix.covariance[a][a] = variance[f][a];
        }
        bst_attitude_shared_update(&shared, &fix, stars, 6);
        bst_assert_close(shared.variance_rad2, variance[f][0] + variance[f][1], 1e-12);
    }
    double sum = 0.0;
    for (int i = 0; i < 4; i++) {
        sum += bst_vec3_dot(seen[0][i], seen[1][i]) / (1.0 - fmin(leverage[i], 0.5));
    }
    double ratio = sum / sqrt(50.0 * 125.0), mean = (0.04 * 10.0 + ratio) / 11.0;
    bst_assert_close(shared.ratios, ratio, 1e-12);
    assert_true(ratio > 0.1);
    bst_assert_close(bst_attitude_shared_get(&shared), mean, 1e-12);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(follows_the_share),
                                       cmocka_unit_test(products_are_those_of_the_sky),
                                       cmocka_unit_test(begins_with_the_assumption)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
