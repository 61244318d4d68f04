/* The fit of one streak: parameters given back, covariance against a Fisher matrix by differences.
 */
#include "imgproc/streak/streak_fit.h"

#include "boresight/rng.h"
#include "imgproc/detect/background.h"
#include "sim/core/symmetric.h"
#include "tests/test_support.h"

enum { WIDTH = 60, HEIGHT = 50, PIXELS = WIDTH * HEIGHT, PARAMETERS = 5 };

static const double SIGMA_PX = 0.9;

/* x, y, dx, dy, flux: light of a Gaussian that is drawn along the path, by the midpoint rule; and
 * what the frame's first pixel is. */
static void light_of(const double p[PARAMETERS], double out[PIXELS]) {
    enum { PARTS = 64 };
    double root = SIGMA_PX * sqrt(2.0);
    memset(out, 0, PIXELS * sizeof *out);
    for (int k = 0; k < PARTS; k++) {
        double u = (k + 0.5) / PARTS - 0.5, x = p[0] + u * p[2], y = p[1] + u * p[3];
        double column[WIDTH];
        for (int i = 0; i < WIDTH; i++) {
            column[i] = 0.5 * (erf((i + 0.5 - x) / root) - erf((i - 0.5 - x) / root));
        }
        for (int j = 0; j < HEIGHT; j++) {
            double row = 0.5 * (erf((j + 0.5 - y) / root) - erf((j - 0.5 - y) / root));
            for (int i = 0; i < WIDTH; i++) {
                out[j * WIDTH + i] += p[4] * row * column[i] / PARTS;
            }
        }
    }
}

/* The inverse of sum (dm/dp)(dm/dp)^T / (noise^2 + m) over the pixels that are used. */
static void bound_of(const double p[PARAMETERS], double noise_e, const uint8_t *left_out,
                     double covariance[PARAMETERS][PARAMETERS]) {
    static double slope[PARAMETERS][PIXELS], side[2][PIXELS], model[PIXELS];
    light_of(p, model);
    for (int k = 0; k < PARAMETERS; k++) {
        double h = k == 4 ? 1.0 : 1e-4, q[PARAMETERS];
        for (int e = 0; e < 2; e++) {
            memcpy(q, p, sizeof q);
            q[k] += e ? -h : h;
            light_of(q, side[e]);
        }
        for (int i = 0; i < PIXELS; i++) {
            slope[k][i] = (side[0][i] - side[1][i]) / (2.0 * h);
        }
    }
    double fisher[PARAMETERS][PARAMETERS] = {{0.0}};
    for (int i = 0; i < PIXELS; i++) {
        for (int k = 0; k < PARAMETERS && !left_out[i]; k++) {
            for (int l = 0; l < PARAMETERS; l++) {
                fisher[k][l] += slope[k][i] * slope[l][i] / (noise_e * noise_e + model[i]);
            }
        }
    }
    assert_true(bst_symmetric_invert(PARAMETERS, fisher[0], covariance[0]));
}

typedef struct fixture {
    bst_ctx ctx;
    bst_imgproc_gauss psf;
    bst_streak_fit fit;
    float signal[PIXELS];
    uint8_t left_out[PIXELS];
    double light[PIXELS];
} fixture;

static int setup(void **state) {
    fixture *f = calloc(1, sizeof *f);
    assert_non_null(f);
    bst_imgproc_gauss_init(&f->psf);
    bst_assert_ok(&f->ctx, bst_streak_fit_create(&f->ctx, &f->psf, 64, &f->fit));
    *state = f;
    return 0;
}
static int teardown(void **state) {
    fixture *f = *state;
    bst_streak_fit_free(&f->fit);
    free(f);
    return 0;
}

static const double cases[][PARAMETERS] = {{30.3, 24.8, 14.0, 5.0, 6000.0},
                                           {28.7, 25.2, -6.0, 16.0, 9000.0},
                                           {30.0, 24.0, 11.0, -11.0, 2500.0},
                                           {31.6, 25.5, 0.5, 20.0, 20000.0}};

static bst_imgproc_source near_source(const double p[PARAMETERS]) {
    return (bst_imgproc_source){.shape = {.x_px = p[0] + 0.4,
                                          .y_px = p[1] - 0.3,
                                          .dx_px = p[2] + 0.7,
                                          .dy_px = p[3] - 0.6,
                                          .sigma_px = SIGMA_PX},
                                .flux_e = 0.9 * p[4]};
}

/* Light without noise gives its parameters back; what is said of the errors is the inverse of the
 * Fisher matrix with the source's own photons, off-diagonal terms and all, also with some of the
 * pixels left out. */
static void parameters_and_covariance_of_exact_light(void **state) {
    fixture *f = *state;
    const double noise_e = 12.0;
    const bst_imgproc_stamp stamp = {0, 0, WIDTH, HEIGHT};
    const bst_fit_data data = {f->signal, WIDTH, HEIGHT, noise_e, 1.0};
    for (size_t n = 0; n < 2 * sizeof cases / sizeof *cases; n++) {
        const double *p = cases[n / 2];
        light_of(p, f->light);
        double squares = 0.0;
        for (int i = 0; i < PIXELS; i++) {
            f->signal[i] = (float)f->light[i];
            /* a piece beside its middle, or nothing */
            f->left_out[i] = n % 2 == 1 && fabs(i % WIDTH - p[0] - 2.0) < 1.6 && i / WIDTH > p[1];
            squares += f->light[i] * f->light[i] / (p[4] * p[4]);
        }
        bst_imgproc_source s = near_source(p);
        double norm, c[PARAMETERS][PARAMETERS];
        assert_true(bst_streak_fit_run(&f->fit, &data, &stamp, f->left_out, &s, &norm));
        bound_of(p, noise_e, f->left_out, c);
        /* the fit ends when a tenth of an error is left */
        bst_assert_close(s.shape.x_px, p[0], 0.15 * sqrt(c[0][0]));
        bst_assert_close(s.shape.y_px, p[1], 0.15 * sqrt(c[1][1]));
        bst_assert_close(s.shape.dx_px, p[2], 0.15 * sqrt(c[2][2]));
        bst_assert_close(s.shape.dy_px, p[3], 0.15 * sqrt(c[3][3]));
        bst_assert_close(s.flux_e, p[4], 0.15 * sqrt(c[4][4]));
        /* where the fit has ended; derivatives by the path are differences over 0.02 px */
        const double found[PARAMETERS] = {s.shape.x_px, s.shape.y_px, s.shape.dx_px, s.shape.dy_px,
                                          s.flux_e};
        bound_of(found, noise_e, f->left_out, c);
        double size = c[0][0] + c[1][1];
        bst_assert_close(s.cov_xx, c[0][0], 0.01 * size);
        bst_assert_close(s.cov_xy, c[0][1], 0.01 * size);
        bst_assert_close(s.cov_yy, c[1][1], 0.01 * size);
        bst_assert_close(s.flux_variance / c[4][4], 1.0, 0.01);
        bst_assert_close(norm, sqrt(squares), 1e-3 * norm);
        assert_true(s.fitted && s.chi_square < 0.1);
    }
}

/* Drawn noise: errors of place and flux are as stated in the mean of many, and chi-square is as
 * many as there are pixels; `excess` is the variance of shot noise per electron. */
static void expect_errors_as_stated(fixture *f, double excess) {
    enum { RUNS = 150 };
    const double noise_e = 12.0, *p = cases[0];
    const bst_imgproc_stamp stamp = {0, 0, WIDTH, HEIGHT};
    const bst_fit_data data = {f->signal, WIDTH, HEIGHT, noise_e, excess};
    const bst_rng_key key = bst_rng_make_key(9, 0, "test", "streak_fit");
    double place = 0.0, flux = 0.0, chi = 0.0;
    light_of(p, f->light);
    memset(f->left_out, 0, sizeof f->left_out);
    for (uint64_t run = 0; run < RUNS; run++) {
        for (int i = 0; i < PIXELS; i++) {
            double sigma = sqrt(noise_e * noise_e + excess * f->light[i]);
            f->signal[i] = (float)(f->light[i] + sigma * bst_rng_normal(key, run, (uint64_t)i));
        }
        bst_imgproc_source s = near_source(p);
        double norm;
        assert_true(bst_streak_fit_run(&f->fit, &data, &stamp, f->left_out, &s, &norm));
        double x = s.shape.x_px - p[0], y = s.shape.y_px - p[1];
        double det = s.cov_xx * s.cov_yy - s.cov_xy * s.cov_xy;
        place += (s.cov_yy * x * x - 2.0 * s.cov_xy * x * y + s.cov_xx * y * y) / det / RUNS;
        flux += (s.flux_e - p[4]) * (s.flux_e - p[4]) / s.flux_variance / RUNS;
        chi += s.chi_square / RUNS;
    }
    /* chi-square of 2 RUNS and RUNS degrees of freedom, of PIXELS - 5 each: four sigma */
    bst_assert_close(place / 2.0, 1.0, 4.0 / sqrt(RUNS));
    bst_assert_close(flux, 1.0, 4.0 * sqrt(2.0 / RUNS));
    bst_assert_close(chi / (PIXELS - 5), 1.0, 4.0 * sqrt(2.0 / RUNS / PIXELS));
}

static void errors_are_as_stated(void **state) {
    expect_errors_as_stated(*state, 1.0);
    expect_errors_as_stated(*state, 1.98); /* a register of gain 50 */
}

/* A point does not determine a path's direction. */
static void a_point_is_no_streak(void **state) {
    fixture *f = *state;
    const double point[PARAMETERS] = {30.3, 24.8, 0.0, 0.0, 6000.0};
    const bst_imgproc_stamp stamp = {0, 0, WIDTH, HEIGHT};
    const bst_fit_data data = {f->signal, WIDTH, HEIGHT, 12.0, 1.0};
    light_of(point, f->light);
    memset(f->left_out, 0, sizeof f->left_out);
    for (int i = 0; i < PIXELS; i++) {
        f->signal[i] = (float)f->light[i];
    }
    bst_imgproc_source s = near_source(point), before = s;
    double norm;
    assert_false(bst_streak_fit_run(&f->fit, &data, &stamp, f->left_out, &s, &norm));
    assert_memory_equal(&s, &before, sizeof s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(parameters_and_covariance_of_exact_light, setup, teardown),
        cmocka_unit_test_setup_teardown(errors_are_as_stated, setup, teardown),
        cmocka_unit_test_setup_teardown(a_point_is_no_streak, setup, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
