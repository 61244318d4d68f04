/* Kernels of the matched filters: their noise, powers and density of maxima, against sums over
 * pixels and integrals. */
#include "boresight/vec.h"
#include "imgproc/detect/filter.h"
#include "tests/test_support.h"

enum { SIDE = 64, REACH = 24, PLANE = 2 * REACH + 1 };

static double part(double from, double sigma) {
    double s = sigma * sqrt(2.0);
    return 0.5 * (erf((from + 0.5) / s) - erf((from - 0.5) / s));
}

/* Point kernel of the filter at a pixel. */
static double point_at(const bst_filter *f, int x, int y) {
    double sum = 0.0;
    if (abs(x) > f->radius || abs(y) > f->radius) {
        return 0.0;
    }
    if (!f->known) {
        return (double)f->kernel[x + f->radius] * (double)f->kernel[y + f->radius];
    }
    for (int k = 0; k < f->rank; k++) {
        sum += (double)f->across[k][x + f->radius] *
               (double)f->down[k * (2 * f->radius + 1) + y + f->radius];
    }
    return sum;
}

/* Both kernels drawn on a plane of pixels. */
static void draw(const bst_filter *f, double *point, double *streak) {
    for (int i = 0; i < PLANE * PLANE; i++) {
        int x = i % PLANE - REACH, y = i / PLANE - REACH;
        point[i] = point_at(f, x, y);
        streak[i] = 0.0;
        for (int t = 0; t < f->taps; t++) {
            streak[i] += (double)f->tap_weight[t] * point_at(f, x - f->tap_x[t], y - f->tap_y[t]);
        }
    }
}

/* Sum of the products of two planes, the second one shifted. */
static double product(const double *a, const double *b, int x, int y) {
    double sum = 0.0;
    for (int i = 0; i < PLANE * PLANE; i++) {
        int u = i % PLANE + x, v = i / PLANE + y;
        sum += u >= 0 && v >= 0 && u < PLANE && v < PLANE ? a[i] * b[v * PLANE + u] : 0.0;
    }
    return sum;
}

static void close_by(double actual, double expected, double share) {
    bst_assert_close(actual, expected, share * fabs(expected));
}

/* Root of the determinant of the gradient's covariance of a box of `length` behind a Gaussian:
 * the product of both axes, int k'^2 / int k^2 along, and 1 / (2 s^2) across. */
static double density_of(double length, double sigma2) {
    double s = sqrt(2.0 * sigma2), square = 0.0, step = 0.01;
    double slope = 2.0 * (1.0 - exp(-length * length / (4.0 * sigma2))) /
                   (2.0 * sqrt(BST_PI * sigma2) * length * length);
    for (double x = -0.5 * length - 8.0; x < 0.5 * length + 8.0; x += step) {
        double k = 0.5 * (erf((x + 0.5 * length) / s) - erf((x - 0.5 * length) / s)) / length;
        square += step * k * k;
    }
    return sqrt(slope / square / (2.0 * sigma2));
}

static void streaks_in_all_directions(void **state) {
    (void)state;
    static double point[PLANE * PLANE], streak[PLANE * PLANE];
    static const double ways[][2] = {{9.0, 0.0}, {5.0, 7.0}, {-7.0, 5.0}, {0.0, -9.0}, {6.0, -6.5}};
    const double sigma = 1.1;
    for (size_t n = 0; n < sizeof ways / sizeof *ways; n++) {
        bst_ctx ctx = {0};
        bst_filter f;
        double total = 0.0, power[3] = {0.0};
        bst_assert_ok(&ctx, bst_filter_create(&ctx, NULL, SIDE, SIDE, 30.0, 1, &f));
        bst_filter_set(&f, sigma, 1, ways[n][0], ways[n][1]);
        draw(&f, point, streak);
        for (int t = 0; t < f.taps; t++) {
            total += (double)f.tap_weight[t];
        }
        /* kernels are in single precision */
        close_by(product(point, point, 0, 0), 1.0, 1e-6);
        close_by(product(streak, streak, 0, 0), 1.0, 1e-6);
        close_by(f.overlap, product(point, streak, 0, 0), 1e-5);
        /* the streak of unit flux has the taps' shares, and the point its own norm */
        close_by(f.streak_norm, f.kernel_norm / total, 1e-5);
        for (int i = 0; i < PLANE * PLANE; i++) {
            for (int k = 0; k < 3; k++) {
                power[k] += pow(streak[i], 3 + k);
            }
        }
        for (int k = 0; k < 3; k++) {
            close_by(f.streak_weights.power[k], power[k], 1e-5);
        }
        /* -ln r is half the quadratic form of the gradient's covariance */
        double xx = -2.0 * log(product(streak, streak, 1, 0)),
               yy = -2.0 * log(product(streak, streak, 0, 1)),
               both = -2.0 * log(product(streak, streak, 1, 1)), xy = 0.5 * (both - xx - yy);
        close_by(f.streak_density, sqrt(xx * yy - xy * xy), 0.05);
        /* taps at whole pixels widen the kernel by up to 1/4 px^2 across */
        double least = density_of(9.0, sigma * sigma + 1.0 / 12.0 + 0.25),
               most = density_of(8.6, sigma * sigma);
        assert_true(f.streak_density > 0.97 * least && f.streak_density < 1.03 * most);
        bst_filter_free(&f);
    }
}

static void points(void **state) {
    (void)state;
    enum { PHASES = 20 };
    for (double sigma = 0.7; sigma < 2.0; sigma += 0.4) {
        bst_ctx ctx = {0};
        bst_filter f;
        double power[3] = {0.0};
        bst_assert_ok(&ctx, bst_filter_create(&ctx, NULL, SIDE, SIDE, 30.0, 1, &f));
        bst_filter_set(&f, sigma, 1, 0.0, 0.0);
        for (int p = 0; p < PHASES * PHASES; p++) {
            double x0 = (p % PHASES + 0.5) / PHASES - 0.5, y0 = (p / PHASES + 0.5) / PHASES - 0.5;
            double x2 = 0.0, y2 = 0.0, x[3] = {0.0}, y[3] = {0.0};
            for (int i = -REACH; i <= REACH; i++) {
                x2 += part(i - x0, sigma) * part(i - x0, sigma);
                y2 += part(i - y0, sigma) * part(i - y0, sigma);
            }
            for (int i = -REACH; i <= REACH; i++) {
                for (int k = 0; k < 3; k++) {
                    x[k] += pow(part(i - x0, sigma) / sqrt(x2), 3 + k);
                    y[k] += pow(part(i - y0, sigma) / sqrt(y2), 3 + k);
                }
            }
            for (int k = 0; k < 3; k++) {
                power[k] += x[k] * y[k] / (PHASES * PHASES);
            }
        }
        for (int k = 0; k < 3; k++) { /* five phases an axis, the ends in full: 7.4 % at 0.7 px */
            close_by(f.point_weights.power[k], power[k], sigma < 1.0 ? 0.1 : 0.02);
        }
        double wide2 = sigma * sigma + 1.0 / 12.0;
        close_by(f.point_density, 1.0 / (2.0 * wide2), 0.02);
        /* half a pixel off on both axes */
        close_by(f.corner, exp(-0.5 / (4.0 * wide2)), 0.02);
        bst_filter_free(&f);
    }
}

/* Shares of a source's light in the pixels of a filter's largest kernel, of unit norm; returns the
 * norm. */
static double known_image(const bst_known_psf *k, int side, double x, double y, double *out) {
    double square = 0.0;
    for (int i = 0; i < side * side; i++) {
        out[i] =
            bst_known_psf_share(k, k->nodes, 1, i % side - side / 2 - x, i / side - side / 2 - y);
        square += out[i] * out[i];
    }
    for (int i = 0; i < side * side; i++) {
        out[i] /= sqrt(square);
    }
    return sqrt(square);
}

/* Astigmatism along a slanting axis out of focus, and coma: no axis is like the other one. */
static void known_psf(void **state) {
    (void)state;
    enum { PHASES = 7 };
    static const double by[3][2] = {{0.1, 0.0}, {0.0, 0.1}, {0.1, 0.1}};
    static double here[PLANE * PLANE], there[PLANE * PLANE];
    bst_ctx ctx = {0};
    bst_psf *psf;
    bst_known_psf *known;
    bst_filter f;
    bst_camera camera = {.width_px = SIDE,
                         .height_px = SIDE,
                         .pixel_scale_arcsec = 3.0,
                         .aperture_m = 0.15,
                         .psf_fwhm_px = 2.0,
                         .optics = {.psf = BST_PSF_DIFFRACTION, .q = 1.8, .wavelengths = 1}};
    camera.optics.zernike_waves.waves[4 - 2] = 0.10;
    camera.optics.zernike_waves.waves[5 - 2] = 0.09;
    camera.optics.zernike_waves.waves[6 - 2] = 0.04;
    camera.optics.zernike_waves.waves[8 - 2] = 0.03;
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
    bst_assert_ok(&ctx, bst_known_psf_create(&ctx, psf, SIDE, SIDE, 0.2, &known));
    bst_assert_ok(&ctx, bst_filter_create(&ctx, known, SIDE, SIDE, 30.0, 1, &f));
    bst_filter_set(&f, known->sigma_px, 1, 0.0, 0.0);
    for (int k = -f.radius; k <= f.radius; k++) {
        double column = 0.0, row = 0.0;
        for (int i = -f.radius; i <= f.radius; i++) {
            column += point_at(&f, k, i) * point_at(&f, k, i);
            row += point_at(&f, i, k) * point_at(&f, i, k);
        }
        bst_assert_close(f.square_x[k + f.radius], column, 1e-6); /* single precision */
        bst_assert_close(f.square_y[k + f.radius], row, 1e-6);
    }
    double norm2 = 0.0, form[3] = {0.0};
    int side = 2 * f.radius + 3;
    for (int p = 0; p < PHASES * PHASES; p++) {
        double x = (p % PHASES + 0.5) / PHASES - 0.5, y = (p / PHASES + 0.5) / PHASES - 0.5;
        double norm = known_image(known, side, x, y, here);
        norm2 += norm * norm / (PHASES * PHASES);
        for (int k = 0; k < 3; k++) {
            double r = 0.0;
            (void)known_image(known, side, x + by[k][0], y + by[k][1], there);
            for (int i = 0; i < side * side; i++) {
                r += here[i] * there[i];
            }
            form[k] += 2.0 * (1.0 - r) / 0.01 / (PHASES * PHASES);
        }
    }
    double xy = 0.5 * (form[2] - form[0] - form[1]);
    assert_true(xy * xy > 0.02 * form[0] * form[1]); /* the axes do matter here */
    close_by(f.norm, sqrt(norm2), 0.005);            /* five phases an axis for seven */
    close_by(f.point_density, sqrt(form[0] * form[1] - xy * xy), 0.01); /* steps of 0.1 px too */
    bst_filter_free(&f);
    bst_known_psf_free(known);
    bst_psf_free(psf);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(streaks_in_all_directions),
                                       cmocka_unit_test(points), cmocka_unit_test(known_psf)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
