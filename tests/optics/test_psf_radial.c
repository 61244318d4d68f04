/* OTFs with closed forms: Moffat profiles, annuli, and the interpolation of radial tables. */
#include "sim/optics/psf_internal.h"
#include "tests/test_support.h"

/* A polynomial of third order in the root of the frequency comes back. */
static void tables_are_cubic(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_optics_radial_otf t;
    const double limit = 0.8;
    bst_assert_ok(&ctx, bst_optics_radial_create(&ctx, limit, &t));
    bst_assert_close(bst_optics_radial_frequency(limit, 0), 0.0, 0.0);
    bst_assert_close(bst_optics_radial_frequency(limit, BST_RADIAL_NODES - 1), limit, 1e-15);
    for (int i = 0; i < BST_RADIAL_NODES; i++) {
        double s = sqrt(bst_optics_radial_frequency(limit, i) / limit) * (BST_RADIAL_NODES - 1);
        t.value[i] = 5.0 + 3.0 * s - 0.7 * s * s + 0.01 * s * s * s;
    }
    const double at[] = {0.0, 0.3, 1.0, 1.7, 2.5, 7.9, 1000.2, 16380.4, 16382.6};
    for (int i = 0; i < 9; i++) {
        double s = at[i], f = limit * pow(s / (BST_RADIAL_NODES - 1), 2.0);
        double want = 5.0 + 3.0 * s - 0.7 * s * s + 0.01 * s * s * s;
        bst_assert_close(bst_optics_radial_at(&t, f), want, 1e-8 * (10.0 + 0.01 * s * s * s));
    }
    bst_assert_close(bst_optics_radial_at(&t, limit), 0.0, 0.0);
    bst_assert_close(bst_optics_radial_at(&t, 2.0), 0.0, 0.0);
    free(t.value);
}

/* Half-integer orders are elementary: exp(-x), (1 + x) exp(-x), (1 + x + x^2 / 3) exp(-x); beta 2
 * is x K_1(x), with K_1(1) = 0.60190723019723 (Abramowitz and Stegun, table 9.8). */
static void moffat_profiles(void **state) {
    (void)state;
    for (double f = 0.0; f < 2.0; f += 0.037) {
        for (double alpha = 0.4; alpha < 3.0; alpha *= 2.5) {
            double x = 2.0 * BST_PI * alpha * f, e = exp(-x);
            bst_assert_close(bst_optics_moffat_otf(alpha, 1.5, f), e, 1e-12);
            bst_assert_close(bst_optics_moffat_otf(alpha, 2.5, f), (1.0 + x) * e, 1e-12);
            bst_assert_close(bst_optics_moffat_otf(alpha, 3.5, f), (1.0 + x + x * x / 3.0) * e,
                             1e-12);
        }
    }
    bst_assert_close(bst_optics_moffat_otf(0.5, 2.0, 1.0 / BST_PI), 0.60190723019723, 1e-12);
}

/* Length that is common to two sorted lists of intervals. */
static double common(const double a[2][2], const double b[2][2]) {
    double sum = 0.0;
    for (int i = 0; i < 2; i++) {
        for (int k = 0; k < 2; k++) {
            sum += fmax(fmin(a[i][1], b[k][1]) - fmax(a[i][0], b[k][0]), 0.0);
        }
    }
    return sum;
}

/* Circles by their formula; annuli by rows of the common area of one and itself moved. */
static void annuli(void **state) {
    (void)state;
    enum { ROWS = 20000 };
    for (double s = 0.0; s < 1.2; s += 0.0731) {
        double circle = s < 1.0 ? 2.0 / BST_PI * (acos(s) - s * sqrt(1.0 - s * s)) : 0.0;
        bst_assert_close(bst_optics_annulus_otf(0.0, s), circle, 1e-13);
        for (double inner = 0.2; inner < 0.8; inner += 0.25) {
            double sum = 0.0;
            for (int n = 0; n < ROWS; n++) {
                double y = (n + 0.5) / ROWS - 0.5, out = sqrt(fmax(0.25 - y * y, 0.0));
                double in = sqrt(fmax(0.25 * inner * inner - y * y, 0.0));
                const double a[2][2] = {{-out, -in}, {in, out}};
                const double b[2][2] = {{s - out, s - in}, {s + in, s + out}};
                sum += common(a, b) / ROWS;
            }
            double whole = 0.25 * BST_PI * (1.0 - inner * inner);
            /* rows miss roots at the edges by their width to the power 3/2 */
            bst_assert_close(bst_optics_annulus_otf(inner, s), sum / whole, 2e-5);
        }
    }
    bst_assert_close(bst_optics_annulus_otf(0.35, 0.0), 1.0, 1e-13);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(tables_are_cubic),
                                       cmocka_unit_test(moffat_profiles), cmocka_unit_test(annuli)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
