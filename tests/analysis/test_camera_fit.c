/* A camera from stars that a script puts on its focal plane: what comes back, and whether its
 * errors are as large as they are said to be. */
#include "tests/test_support.h"

#include <stdlib.h>

#include "sim/analysis/camera/camera_fit.h"
#include "sim/analysis/camera/point_width.h"

enum { FRAMES = 12, STARS = 40, ALL = FRAMES * STARS, SEEDS = 40 };

static uint64_t state_of_draws;

static double uniform(void) {
    state_of_draws = state_of_draws * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return ((double)(state_of_draws >> 12) + 0.5) / 4503599627370496.0;
}

static double normal(void) {
    return sqrt(-2.0 * log(uniform())) * cos(2.0 * BST_PI * uniform());
}

/* An anisotropic field of 1.5 by 1 degree with distortion in all terms. */
static bst_camera true_camera(void) {
    bst_camera c = {.width_px = 1800,
                    .height_px = 1200,
                    .pixel_scale_arcsec = 3.0,
                    .rotation_deg = 20.0,
                    .boresight_offset_px = {30.0, -12.0},
                    .distortion = {.k1 = -20.0, .k2 = 3e4, .p1 = 0.02, .p2 = -0.03}};
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &c));
    return c;
}

/* The camera as it is thought to be: 1 % of scale wrong, no distortion. */
static bst_camera first_guess(void) {
    bst_camera c = true_camera();
    c.pixel_scale_arcsec *= 1.01;
    c.distortion = (bst_camera_distortion){0};
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &c));
    return c;
}

typedef struct field {
    bst_camera_fit_star stars[ALL];
    double noise_px, own_px; /* of a place; of a star in all frames */
    bool at_rest;            /* the same stars at the same places in all frames */
} field;

/* Draws the stars of all frames, each with an attitude that is 20 arcsec and 0.05 deg wrong. */
static void draw(field *f, uint64_t seed) {
    const bst_camera c = true_camera();
    double place[STARS][2], own[STARS][2];
    state_of_draws = seed;
    for (int i = 0; i < STARS; i++) {
        own[i][0] = f->own_px * normal();
        own[i][1] = f->own_px * normal();
    }
    for (int k = 0; k < FRAMES; k++) {
        const bst_vec3 wrong = {1e-4 * normal(), 1e-4 * normal(), 1e-3 * normal()};
        for (int i = 0; i < STARS; i++) {
            bst_camera_fit_star *s = &f->stars[k * STARS + i];
            if (k == 0 || !f->at_rest) {
                place[i][0] = 1799.0 * uniform();
                place[i][1] = 1199.0 * uniform();
            }
            const bst_vec3 v = bst_camera_unproject(&c, place[i][0], place[i][1]);
            /* correlated errors, by the Cholesky factor of their covariance: so strongly that
             * weights of the wrong slant would show */
            const double n = f->noise_px, e1 = normal(), e2 = normal();
            *s = (bst_camera_fit_star){.frame = k,
                                       .id = f->at_rest ? i : k * STARS + i,
                                       .cam = bst_quat_rotate(bst_quat_from_rotvec(wrong), v),
                                       .x_px = place[i][0] + own[i][0] + n * e1,
                                       .y_px = place[i][1] + own[i][1] + n * (0.98 * e1 + 0.2 * e2),
                                       .cov_xx = n * n,
                                       .cov_xy = 0.98 * n * n,
                                       .cov_yy = n * n * (0.98 * 0.98 + 0.2 * 0.2)};
        }
    }
}

/* Distance of the field's corner from the boresight on the sensor, px. */
static double corner_px(const bst_camera_distortion *d, double pixel_scale_arcsec) {
    const double r = hypot(930.0, 612.0) * 3.0 * BST_ARCSEC_RAD, r2 = r * r;
    return r * (1.0 + d->k1 * r2 + d->k2 * r2 * r2) / (pixel_scale_arcsec * BST_ARCSEC_RAD);
}

static void errors_of(const bst_camera_geometry_fit *fit, double pull[6]) {
    const bst_camera c = true_camera();
    const bst_camera_distortion *d = &fit->distortion, *s = &fit->distortion_sigma;
    pull[0] = (fit->pixel_scale_arcsec - 3.0) / fit->pixel_scale_sigma_arcsec;
    pull[1] = (d->k1 - c.distortion.k1) / s->k1;
    pull[2] = (d->k2 - c.distortion.k2) / s->k2;
    pull[3] = (d->p1 - c.distortion.p1) / s->p1;
    pull[4] = (d->p2 - c.distortion.p2) / s->p2;
    pull[5] = (corner_px(d, fit->pixel_scale_arcsec) - corner_px(&c.distortion, 3.0)) /
              fit->corner_sigma_px;
}

/* Mean square of the pulls over the seeds: 1 but for chance. Returned: mean scatter, px. */
static double check_pulls(field *f, double low, double high) {
    double sum[6] = {0}, scatter = 0.0;
    for (int seed = 0; seed < SEEDS; seed++) {
        bst_ctx ctx = {0};
        const bst_camera start = first_guess();
        bst_camera_geometry_fit fit;
        double pull[6];
        draw(f, 1000 + (uint64_t)seed);
        bst_assert_ok(&ctx, bst_camera_fit_geometry(&ctx, &start, f->stars, ALL, FRAMES, &fit));
        errors_of(&fit, pull);
        scatter += fit.scatter_px / SEEDS;
        for (int k = 0; k < 6; k++) {
            assert_true(fabs(pull[k]) < 5.0);
            sum[k] += pull[k] * pull[k] / SEEDS;
        }
    }
    for (int k = 0; k < 6; k++) {
        if (!(sum[k] > low && sum[k] < high)) {
            fail_msg("parameter %d: mean square of the pulls %.3f", k, sum[k]);
        }
    }
    return scatter;
}

static void test_errors_are_as_stated(void **state) {
    (void)state;
    static field f = {.noise_px = 0.1};
    /* chi squared of 40 over 40: 0.46 to 1.8 with 99.9 % */
    double scatter = check_pulls(&f, 0.46, 1.8);
    /* the covariances say all: what is left is chance of 900 degrees of freedom, 0.022 px in half
     * of the seeds */
    assert_true(scatter < 0.02);
    /* the same stars with their own errors in all frames: 12 times as many places say no more */
    static field rest = {.noise_px = 0.02, .own_px = 0.1, .at_rest = true};
    (void)check_pulls(&rest, 0.46, 2.4);
}

static void test_exact_places(void **state) {
    (void)state;
    static field f = {.noise_px = 1e-6};
    bst_ctx ctx = {0};
    const bst_camera start = first_guess(), truth = true_camera();
    bst_camera_geometry_fit fit;
    draw(&f, 7);
    f.stars[17].x_px += 0.5; /* another star */
    f.stars[200].y_px -= 3.0;
    bst_assert_ok(&ctx, bst_camera_fit_geometry(&ctx, &start, f.stars, ALL, FRAMES, &fit));
    bst_assert_close(fit.pixel_scale_arcsec, 3.0, 1e-6);
    bst_assert_close(fit.distortion.k1, truth.distortion.k1, 2e-2);
    bst_assert_close(fit.distortion.k2, truth.distortion.k2, 2e2);
    bst_assert_close(fit.distortion.p1, truth.distortion.p1, 1e-5);
    bst_assert_close(fit.distortion.p2, truth.distortion.p2, 1e-5);
    assert_int_equal(fit.rejected, 2);
    assert_int_equal(fit.frames, FRAMES);
    assert_true(isnan(f.stars[17].residual_x_px) && isnan(f.stars[200].residual_y_px));
    assert_true(fit.rms_px < 2e-4 && fit.corner_sigma_px < 2e-3);
}

static void test_scatter(void **state) {
    (void)state;
    static field f = {.noise_px = 0.05};
    bst_ctx ctx = {0};
    const bst_camera start = first_guess();
    bst_camera_geometry_fit fit;
    draw(&f, 9);
    for (int i = 0; i < ALL; i++) {
        f.stars[i].x_px += 0.12 * normal();
        f.stars[i].y_px += 0.12 * normal();
    }
    bst_assert_ok(&ctx, bst_camera_fit_geometry(&ctx, &start, f.stars, ALL, FRAMES, &fit));
    bst_assert_close(fit.scatter_px, 0.12, 0.012);
    bst_assert_close(fit.rms_px, sqrt(0.12 * 0.12 + 0.0025 * 0.87), 0.012);
}

/* Most places are far better than the scatter, some far worse. */
static void test_scatter_of_unequal_places(void **state) {
    (void)state;
    static field f = {.noise_px = 1e-4};
    bst_ctx ctx = {0};
    const bst_camera start = first_guess();
    bst_camera_geometry_fit fit;
    draw(&f, 13);
    for (int i = 0; i < ALL; i++) {
        bst_camera_fit_star *s = &f.stars[i];
        double noise = i % 3 == 0 ? 5e-4 : 0.05;
        s->cov_xx = s->cov_yy = noise * noise;
        s->cov_xy = 0.0;
        s->x_px += 0.004 * normal() + 0.85 * noise * normal();
        s->y_px += 0.004 * normal() + 0.85 * noise * normal();
    }
    bst_assert_ok(&ctx, bst_camera_fit_geometry(&ctx, &start, f.stars, ALL, FRAMES, &fit));
    /* 320 values of the better places have a standard deviation of 4 %; the stated errors of the
     * others are too large, which lowers it by a third */
    assert_true(fit.scatter_px > 0.002 && fit.scatter_px < 0.0045);
}

static void test_too_few_stars(void **state) {
    (void)state;
    static field f = {.noise_px = 0.05};
    const bst_camera start = first_guess();
    bst_camera_geometry_fit fit;
    draw(&f, 11);
    bst_ctx ctx = {0};
    assert_int_equal(bst_camera_fit_geometry(&ctx, &start, f.stars, 0, 0, &fit), BST_ERR_RANGE);
    assert_int_equal(bst_camera_fit_geometry(&ctx, &start, f.stars, 4, 1, &fit), BST_ERR_RANGE);
    /* three stars in each frame give its attitude only */
    int n = 0;
    for (int i = 0; i < ALL; i++) {
        if (i % STARS < 3) {
            f.stars[n++] = f.stars[i];
        }
    }
    assert_int_equal(bst_camera_fit_geometry(&ctx, &start, f.stars, n, FRAMES, &fit),
                     BST_ERR_RANGE);
    assert_non_null(strstr(ctx.message, "36 identified stars in 12 frames do not determine"));
}

/* ---------------------------------------------------------------- photometry */

static void test_photometry(void **state) {
    (void)state;
    static bst_camera_fit_star stars[ALL];
    double zero2 = 0.0, colour2 = 0.0;
    for (int seed = 0; seed < SEEDS; seed++) {
        state_of_draws = 5000 + (uint64_t)seed;
        double v[STARS], colour[STARS], own[STARS];
        for (int i = 0; i < STARS; i++) {
            v[i] = 7.0 + 4.0 * uniform();
            colour[i] = -0.2 + 1.8 * uniform();
            own[i] = 0.05 * normal(); /* error of the catalogue */
        }
        for (int k = 0; k < ALL; k++) {
            const int i = k % STARS;
            const double rate = pow(10.0, 0.4 * (21.0 + 0.15 * colour[i] - v[i]));
            const double sigma = 0.02 * rate;
            stars[k] = (bst_camera_fit_star){.id = i,
                                             .v_mag = v[i] + own[i],
                                             .b_minus_v = colour[i],
                                             .rate_e_per_s = rate + sigma * normal(),
                                             .rate_sigma_e_per_s = sigma};
        }
        stars[3].rate_e_per_s *= 3.0;
        stars[4].b_minus_v = NAN;
        stars[5].rate_e_per_s = -1.0;
        bst_ctx ctx = {0};
        bst_camera_photometry_fit fit;
        bst_assert_ok(&ctx, bst_camera_fit_photometry(&ctx, stars, ALL, &fit));
        assert_int_equal(fit.stars, ALL - 3);
        assert_int_equal(fit.rejected, 1);
        bst_assert_close(fit.scatter_mag, 0.05, 0.025);
        zero2 += pow((fit.zero_point_mag - 21.0) / fit.zero_point_sigma_mag, 2.0) / SEEDS;
        colour2 += pow((fit.colour_term - 0.15) / fit.colour_term_sigma, 2.0) / SEEDS;
    }
    assert_true(zero2 > 0.46 && zero2 < 2.0);
    assert_true(colour2 > 0.46 && colour2 < 2.0);
    bst_ctx ctx = {0};
    bst_camera_photometry_fit fit;
    for (int k = 0; k < ALL; k++) {
        stars[k].b_minus_v = 0.6;
    }
    assert_int_equal(bst_camera_fit_photometry(&ctx, stars, ALL, &fit), BST_ERR_RANGE);
}

/* Errors against the sums of a line's regression with clusters, written out for a star of several
 * frames: as many places of equal weight, so that all follows from the means of each star. */
static void test_photometry_errors(void **state) {
    (void)state;
    enum { EACH = 5, OWN = 30 };
    static bst_camera_fit_star stars[OWN * EACH];
    for (int shift = 0; shift < 2; shift++) {
        double x[OWN], y[OWN], mean_x = 0.0, mean_y = 0.0, xx = 0.0, xy = 0.0, in[3] = {0};
        state_of_draws = 77;
        for (int i = 0; i < OWN; i++) {
            x[i] = 2.0 * shift + 1.8 * uniform();
            double light = pow(10.0, 0.4 * (21.0 + 0.15 * x[i] + 0.04 * normal() - 9.0));
            for (int k = 0; k < EACH; k++) {
                stars[i * EACH + k] = (bst_camera_fit_star){.id = i,
                                                            .v_mag = 9.0,
                                                            .b_minus_v = x[i],
                                                            .rate_e_per_s = light,
                                                            .rate_sigma_e_per_s = 0.001 * light};
            }
            y[i] = 9.0 + 2.5 * log10(light);
            mean_x += x[i] / OWN;
            mean_y += y[i] / OWN;
        }
        for (int i = 0; i < OWN; i++) {
            xx += pow(x[i] - mean_x, 2.0);
            xy += (x[i] - mean_x) * (y[i] - mean_y);
        }
        for (int i = 0; i < OWN; i++) {
            double slope = xy / xx, left = y[i] - mean_y - slope * (x[i] - mean_x);
            double by_zero = 1.0 / OWN - mean_x * (x[i] - mean_x) / xx,
                   by_slope = (x[i] - mean_x) / xx;
            in[0] += pow(by_zero * left, 2.0) * OWN / (OWN - 2);
            in[1] += pow(by_slope * left, 2.0) * OWN / (OWN - 2);
            in[2] = slope;
        }
        bst_ctx ctx = {0};
        bst_camera_photometry_fit fit;
        bst_assert_ok(&ctx, bst_camera_fit_photometry(&ctx, stars, OWN * EACH, &fit));
        bst_assert_close(fit.colour_term, in[2], 1e-6); /* weights are equal to 1e-6 */
        bst_assert_close(fit.zero_point_mag, mean_y - in[2] * mean_x, 1e-6);
        bst_assert_close(fit.zero_point_sigma_mag, sqrt(in[0]), 1e-3 * sqrt(in[0]));
        bst_assert_close(fit.colour_term_sigma, sqrt(in[1]), 1e-3 * sqrt(in[1]));
    }
}

/* ---------------------------------------------------------------- width */

static void test_width(void **state) {
    (void)state;
    enum { SIDE = BST_POINT_WIDTH_SIDE };
    static const double places[][2] = {{6.0, 6.0}, {6.5, 5.5}, {5.7, 6.2}};
    static const double sigmas[] = {0.35, 0.85, 1.6};
    for (int p = 0; p < 3; p++) {
        for (int w = 0; w < 3; w++) {
            double pixels[SIDE * SIDE], fwhm;
            for (int row = 0; row < SIDE; row++) {
                for (int column = 0; column < SIDE; column++) {
                    /* the pixel as 20 x 20 points */
                    double sum = 0.0;
                    for (int k = 0; k < 400; k++) {
                        double x = column + (k % 20 + 0.5) / 20.0 - 0.5 - places[p][0],
                               y = row + (k / 20 + 0.5) / 20.0 - 0.5 - places[p][1];
                        sum += exp(-0.5 * (x * x + y * y) / (sigmas[w] * sigmas[w])) / 400.0;
                    }
                    pixels[row * SIDE + column] = 300.0 + 2000.0 * sum;
                }
            }
            assert_true(bst_point_width_fit(pixels, 6.2, 5.9, &fwhm));
            bst_assert_close(fwhm, 2.3548200450309493 * sigmas[w], 2e-3);
        }
    }
    double flat[SIDE * SIDE], fwhm;
    for (int i = 0; i < SIDE * SIDE; i++) {
        flat[i] = 100.0;
    }
    assert_false(bst_point_width_fit(flat, 6.0, 6.0, &fwhm));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_errors_are_as_stated),
        cmocka_unit_test(test_exact_places),
        cmocka_unit_test(test_scatter),
        cmocka_unit_test(test_scatter_of_unequal_places),
        cmocka_unit_test(test_too_few_stars),
        cmocka_unit_test(test_photometry),
        cmocka_unit_test(test_photometry_errors),
        cmocka_unit_test(test_width),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
