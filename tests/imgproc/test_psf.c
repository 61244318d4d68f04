#include <stdlib.h>

#include "imgproc/detect/psf.h"
#include "tests/test_support.h"

enum { SIDE = 48, PIXELS = SIDE * SIDE };

static double share_of(double pixel, double centre, double sigma) {
    double root = sigma * sqrt(2.0);
    return 0.5 * (erf((pixel + 0.5 - centre) / root) - erf((pixel - 0.5 - centre) / root));
}

typedef struct fixture {
    bst_imgproc_gauss psf;
    double share[PIXELS], by_x[PIXELS], by_y[PIXELS], by_variance[PIXELS];
    double other[PIXELS], unused[3][PIXELS];
} fixture;

static const bst_imgproc_stamp stamp = {10, 20, SIDE, SIDE};

static int setup(void **state) {
    fixture *f = calloc(1, sizeof *f);
    assert_non_null(f);
    bst_imgproc_gauss_init(&f->psf);
    *state = f;
    return 0;
}
static int teardown(void **state) {
    free(*state);
    return 0;
}

/* Gauss-Legendre rules integrate t^k over [-1/2, 1/2] exactly for k < 2 n. */
static void rules_integrate_polynomials(void **state) {
    fixture *f = *state;
    for (int n = 1; n <= BST_PSF_MAX_NODES; n++) {
        const double *x = f->psf.node + n * (n - 1) / 2, *w = f->psf.weight + n * (n - 1) / 2;
        double sum = 0.0, square = 0.0, top = 0.0;
        int k = 2 * n - 2;
        for (int i = 0; i < n; i++) {
            sum += w[i];
            square += w[i] * x[i] * x[i];
            top += w[i] * pow(2.0 * x[i], k);
        }
        /* rounding of up to 96 terms */
        bst_assert_close(sum, 1.0, 1e-13);
        bst_assert_close(square, n > 1 ? 1.0 / 12.0 : 0.0, 1e-13);
        bst_assert_close(top, 1.0 / (k + 1), 1e-13);
    }
}

/* A point against erf(); 3e-9: cubic interpolation of the table at 1/64 sigma, and the cut at 6
 * sigma. */
static void point_is_product_of_erfs(void **state) {
    fixture *f = *state;
    for (int k = 0; k < 20; k++) {
        bst_imgproc_shape s = {33.0 + 0.05 * k, 43.0 + 0.037 * k, 0, 0, 0, 0, 0.6 + 0.1 * k, NULL};
        bst_imgproc_gauss_render(&f->psf, &s, &stamp, f->share, f->by_x, f->by_y, f->by_variance);
        for (int i = 0; i < PIXELS; i++) {
            double px = share_of(stamp.x0 + i % SIDE, s.x_px, s.sigma_px);
            double py = share_of(stamp.y0 + i / SIDE, s.y_px, s.sigma_px);
            bst_assert_close(f->share[i], px * py, 3e-9);
        }
    }
}

/* A streak against 20000 midpoints, whose own error is below 1e-8 of the peak. */
static void streak_is_the_line_integral(void **state) {
    fixture *f = *state;
    static const double paths[][4] = {{1.5, 0, 0, 0},   {8.3, 0, 0, 0}, {-6, 5, 0, 0},
                                      {0.2, -20, 0, 0}, {22, 13, 0, 0}, {8, 0, 1.3, 0.4}};
    for (size_t c = 0; c < sizeof paths / sizeof *paths; c++) {
        bst_imgproc_shape s = {33.3,        44.1,        paths[c][0], paths[c][1],
                               paths[c][2], paths[c][3], 0.85,        NULL};
        bst_imgproc_gauss_render(&f->psf, &s, &stamp, f->share, f->by_x, f->by_y, f->by_variance);
        memset(f->other, 0, sizeof f->other);
        enum { STEPS = 20000 };
        for (int k = 0; k < STEPS; k++) {
            double t = (k + 0.5) / STEPS - 0.5, bow = 6 * t * t - 0.5;
            double x = s.x_px + t * s.dx_px + bow * s.bend_x_px;
            double y = s.y_px + t * s.dy_px + bow * s.bend_y_px;
            double px[SIDE];
            for (int i = 0; i < SIDE; i++) {
                px[i] = fabs(stamp.x0 + i - x) < 7 ? share_of(stamp.x0 + i, x, s.sigma_px) : 0.0;
            }
            for (int j = 0; j < SIDE; j++) {
                if (fabs(stamp.y0 + j - y) >= 7) {
                    continue;
                }
                double py = share_of(stamp.y0 + j, y, s.sigma_px) / STEPS;
                for (int i = 0; i < SIDE; i++) {
                    f->other[j * SIDE + i] += px[i] * py;
                }
            }
        }
        double peak = 0.0, worst = 0.0;
        for (int i = 0; i < PIXELS; i++) {
            peak = fmax(peak, f->other[i]);
            worst = fmax(worst, fabs(f->share[i] - f->other[i]));
        }
        /* the header's bound */
        bst_assert_close(worst / peak, 0.0, 1e-5);
    }
}

/* Derivatives against central differences: h^2 f''' / 6 is below 1e-6 at h = 1e-3. */
static void derivatives_are_slopes(void **state) {
    fixture *f = *state;
    bst_imgproc_shape s = {33.3, 44.1, 4.0, -3.0, 0.5, 0.2, 0.85, NULL};
    bst_imgproc_gauss_render(&f->psf, &s, &stamp, f->share, f->by_x, f->by_y, f->by_variance);
    const double h = 1e-3;
    for (int which = 0; which < 3; which++) {
        bst_imgproc_shape lo = s, hi = s;
        double variance = s.sigma_px * s.sigma_px;
        if (which == 0) {
            lo.x_px -= h;
            hi.x_px += h;
        } else if (which == 1) {
            lo.y_px -= h;
            hi.y_px += h;
        } else {
            lo.sigma_px = sqrt(variance - h);
            hi.sigma_px = sqrt(variance + h);
        }
        const double *slope = which == 0 ? f->by_x : which == 1 ? f->by_y : f->by_variance;
        double *a = f->other, *b = f->unused[0];
        double *scratch = f->unused[1], *scratch2 = f->unused[2];
        bst_imgproc_gauss_render(&f->psf, &lo, &stamp, a, scratch, scratch2, f->share);
        bst_imgproc_gauss_render(&f->psf, &hi, &stamp, b, scratch, scratch2, f->share);
        for (int i = 0; i < PIXELS; i++) {
            bst_assert_close(slope[i], (b[i] - a[i]) / (2 * h), 3e-6);
        }
    }
}

/* A source outside its stamp, or larger than it, touches only the stamp and stays finite. */
static void stamps_may_cut_the_source(void **state) {
    fixture *f = *state;
    static const double centres[][2] = {
        {-500, 30}, {9.6, 19.6}, {57.9, 68.2}, {1e6, -1e6}, {30, 90}};
    for (size_t c = 0; c < sizeof centres / sizeof *centres; c++) {
        bst_imgproc_shape s = {centres[c][0], centres[c][1], 30, 40, 1, -2, 1.3, NULL};
        bst_imgproc_gauss_render(&f->psf, &s, &stamp, f->share, f->by_x, f->by_y, f->by_variance);
        double sum = 0.0;
        for (int i = 0; i < PIXELS; i++) {
            assert_true(isfinite(f->share[i]) && f->share[i] >= 0.0);
            assert_true(isfinite(f->by_x[i]) && isfinite(f->by_y[i]));
            sum += f->share[i];
        }
        assert_true(sum <= 1.0 + 1e-9);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(rules_integrate_polynomials, setup, teardown),
        cmocka_unit_test_setup_teardown(point_is_product_of_erfs, setup, teardown),
        cmocka_unit_test_setup_teardown(streak_is_the_line_integral, setup, teardown),
        cmocka_unit_test_setup_teardown(derivatives_are_slopes, setup, teardown),
        cmocka_unit_test_setup_teardown(stamps_may_cut_the_source, setup, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
