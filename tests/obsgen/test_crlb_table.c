/* The tabulated bound against closed forms and against a plain sum over pixels. */
#include "obsgen/model/crlb_table.h"
#include "tests/test_support.h"

static const double PI = 3.14159265358979323846;

/* Well sampled on white noise: var = 8 pi sigma^4 v / F^2 per axis, flux variance 4 pi sigma^2 v
 * (Winick 1986, J. Opt. Soc. Am. A 3, 1809); where shot noise is all: sigma^2 / F and F. */
static void closed_forms_of_a_point(void **state) {
    (void)state;
    bst_crlb_table b;
    const double sigma = 2.0, noise = 10.0;
    bst_crlb_table_init(&b, sigma);
    double s2 = sigma * sigma + 1.0 / 12.0, faint = 20.0, bright = 1e9;
    bst_crlb_table_at at = bst_crlb_table_of(&b, faint, noise, 0.0);
    /* pixels of half a sigma, and shot noise at r = 0.2: 1 % */
    bst_assert_close(at.var_along_px2, 8 * PI * s2 * s2 * 100.0 / (faint * faint),
                     0.02 * at.var_along_px2);
    bst_assert_close(at.var_across_px2, at.var_along_px2, 1e-6 * at.var_along_px2);
    bst_assert_close(at.flux_variance, 4 * PI * s2 * 100.0, 0.02 * at.flux_variance);
    bst_assert_close(at.norm, 1.0 / sqrt(4 * PI * s2), 0.005 * at.norm);
    at = bst_crlb_table_of(&b, bright, noise, 0.0);
    /* the table ends at r = 1e5, where the wings are still dark: 3 % */
    bst_assert_close(at.var_along_px2, s2 / bright, 0.03 * s2 / bright);
    bst_assert_close(at.flux_variance, bright, 0.02 * bright);
}

/* Fisher information of a streak along x by a plain sum, mean over places in the pixel. */
static void sums(double sigma, double length, double flux, double v, double excess, double out[3]) {
    enum { PARTS = 150, PHASES = 3 };
    out[0] = out[1] = out[2] = 0.0;
    double s = sigma * sqrt(2.0), h = 1e-4;
    int reach = (int)(0.5 * length + 6 * sigma + 3);
    for (int phase = 0; phase < PHASES * PHASES; phase++) {
        double cx = (phase % PHASES) / (double)PHASES, cy = (double)(phase / PHASES) / PHASES;
        for (int j = -reach; j <= reach; j++) {
            for (int i = -reach; i <= reach; i++) {
                double p[5] = {0};
                const double ox[5] = {0, h, -h, 0, 0}, oy[5] = {0, 0, 0, h, -h};
                for (int k = 0; k < 5; k++) {
                    double y = cy + oy[k];
                    double py = 0.5 * (erf((j + 0.5 - y) / s) - erf((j - 0.5 - y) / s));
                    if (py < 1e-14) {
                        continue;
                    }
                    for (int n = 0; n < PARTS; n++) {
                        double x = cx + ox[k] + length * ((n + 0.5) / PARTS - 0.5);
                        if (fabs(i - x) < 6 * sigma + 1) {
                            p[k] += py * 0.5 * (erf((i + 0.5 - x) / s) - erf((i - 0.5 - x) / s)) /
                                    PARTS;
                        }
                    }
                }
                double w = 1.0 / (v + excess * flux * p[0]);
                double dx = flux * (p[1] - p[2]) / (2 * h), dy = flux * (p[3] - p[4]) / (2 * h);
                out[0] += w * dx * dx / (PHASES * PHASES);
                out[1] += w * dy * dy / (PHASES * PHASES);
                out[2] += w * p[0] * p[0] / (PHASES * PHASES);
            }
        }
    }
}

static void streaks_are_those_of_a_sum(void **state) {
    (void)state;
    bst_crlb_table b;
    const double sigma = 0.85, noise = 8.0;
    bst_crlb_table_init(&b, sigma);
    const double lengths[] = {0.0, 3.0, 11.0}, fluxes[] = {150.0, 20000.0};
    for (int l = 0; l < 3; l++) {
        for (int f = 0; f < 2; f++) {
            double info[3];
            sums(sigma, lengths[l], fluxes[f], noise * noise, 1.0, info);
            bst_crlb_table_at at = bst_crlb_table_of(&b, fluxes[f], noise, lengths[l]);
            /* straight lines between lengths a factor of two apart: 5 % of a variance, 2.5 % of an
             * error */
            bst_assert_close(at.var_along_px2 * info[0], 1.0, 0.06);
            bst_assert_close(at.var_across_px2 * info[1], 1.0, 0.05);
            bst_assert_close(at.flux_variance * info[2], 1.0, 0.05);
        }
    }
}

/* Shot noise of a multiplied source: the excess counts where light decides, and nowhere else. */
static void multiplied_light_has_its_own_bound(void **state) {
    (void)state;
    bst_crlb_table b;
    const double sigma = 0.85, noise = 8.0, excess = 1.98;
    bst_crlb_table_init(&b, sigma);
    const double fluxes[] = {150.0, 20000.0};
    for (int f = 0; f < 2; f++) {
        double info[3];
        sums(sigma, 3.0, fluxes[f], noise * noise, excess, info);
        bst_crlb_table_at at = bst_crlb_table_wider(&b, fluxes[f], noise, 3.0, 1.0, excess);
        /* tolerances as above */
        bst_assert_close(at.var_along_px2 * info[0], 1.0, 0.06);
        bst_assert_close(at.var_across_px2 * info[1], 1.0, 0.05);
        bst_assert_close(at.flux_variance * info[2], 1.0, 0.05);
    }
    const double bright = 1e9, s2 = sigma * sigma + 1.0 / 12.0;
    bst_crlb_table_at at = bst_crlb_table_wider(&b, bright, noise, 0.0, 1.0, excess);
    bst_crlb_table_at plain = bst_crlb_table_of(&b, bright, noise, 0.0);
    bst_assert_close(at.flux_variance, excess * bright, 0.02 * excess * bright);
    bst_assert_close(at.var_along_px2 / plain.var_along_px2, excess, 1e-6 * excess);
    /* the pixel is as wide as the image */
    bst_assert_close(at.var_along_px2, excess * s2 / bright, 0.1 * excess * s2 / bright);
    bst_assert_close(at.norm, plain.norm, 0.0);
}

/* A wider image has the bound of that width, and is not the narrow one with a factor: by shot noise
 * alone errors grow with the width, on white noise with its square. */
static void a_wider_image_has_its_own_bound(void **state) {
    (void)state;
    bst_crlb_table narrow, wide;
    const double sigma = 0.9, wider = 1.5, pixel = 1.0 / 12.0;
    bst_crlb_table_init(&narrow, sigma);
    bst_crlb_table_init(&wide, sqrt(wider * wider * (sigma * sigma + pixel) - pixel));
    const double lengths[] = {0.0, 4.0}, fluxes[] = {150.0, 3000.0, 1e6};
    for (int l = 0; l < 2; l++) {
        for (int f = 0; f < 3; f++) {
            bst_crlb_table_at a =
                bst_crlb_table_wider(&narrow, fluxes[f], 8.0, lengths[l], wider, 1.0);
            bst_crlb_table_at b = bst_crlb_table_of(&wide, fluxes[f], 8.0, lengths[l]);
            /* pixels are as wide as the narrow image and lengths stand a factor of two apart */
            bst_assert_close(a.var_along_px2 / b.var_along_px2, 1.0, 0.06);
            bst_assert_close(a.var_across_px2 / b.var_across_px2, 1.0, 0.06);
            bst_assert_close(a.flux_variance / b.flux_variance, 1.0, 0.05);
            bst_assert_close(a.norm / b.norm, 1.0, 0.03);
        }
    }
}

static void long_streaks_and_wide_psfs_stay_finite(void **state) {
    (void)state;
    bst_crlb_table b;
    const double widths[] = {0.2, 0.85, 7.0};
    for (int k = 0; k < 3; k++) {
        bst_crlb_table_init(&b, widths[k]);
        double before = INFINITY;
        for (double length = 0.0; length < 3000.0; length = 1.3 * length + 0.2) {
            bst_crlb_table_at at = bst_crlb_table_of(&b, 1000.0, 5.0, length);
            assert_true(at.norm > 0.0 && at.norm < before);
            assert_true(isfinite(at.var_along_px2) && at.var_along_px2 > 0.0);
            assert_true(isfinite(at.var_across_px2) && at.var_across_px2 > 0.0);
            before = at.norm * 1.0001;
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(closed_forms_of_a_point),
        cmocka_unit_test(streaks_are_those_of_a_sum),
        cmocka_unit_test(multiplied_light_has_its_own_bound),
        cmocka_unit_test(a_wider_image_has_its_own_bound),
        cmocka_unit_test(long_streaks_and_wide_psfs_stay_finite),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
