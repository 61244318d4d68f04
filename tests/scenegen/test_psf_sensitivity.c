/* Sensitivity of a PSF to nodes: against the closed form of an elongated Gaussian. */
#include <math.h>

#include "boresight/vec.h"
#include "scenegen/fourier/psf_sensitivity.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

enum { SAMPLES = 121, PER_PX = 5 };
static const double LONG_PX = 1.6, SHORT_PX = 0.9;

/* A Gaussian of LONG_PX along x and SHORT_PX along y. */
static bst_psf *make_psf(bst_ctx *ctx, bst_camera *camera) {
    static float image[SAMPLES * SAMPLES];
    for (int k = 0; k < SAMPLES * SAMPLES; k++) {
        double x = (double)(k % SAMPLES - SAMPLES / 2) / PER_PX / LONG_PX;
        double y = (double)(k / SAMPLES - SAMPLES / 2) / PER_PX / SHORT_PX;
        image[k] = (float)exp(-0.5 * (x * x + y * y));
    }
    bst_psf *psf;
    bst_psf_samples samples = {image, SAMPLES, SAMPLES, 1, (double)PER_PX};
    bst_psf_inputs inputs = {.samples = &samples};
    *camera = scene_camera(64, 64);
    camera->optics.psf = BST_PSF_FILE;
    bst_assert_ok(ctx, bst_psf_create_from(ctx, camera, &inputs, &psf));
    return psf;
}

static void derivatives_are_those_of_each_direction(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera;
    bst_psf_sensitivity s;
    bst_psf *psf = make_psf(&ctx, &camera);
    bst_assert_ok(&ctx, bst_psf_sensitivity_measure(&ctx, psf, 0.9, SHORT_PX, &s));
    /* pixels add a twelfth to either variance */
    double wide = LONG_PX * LONG_PX + 1.0 / 12.0, narrow = SHORT_PX * SHORT_PX + 1.0 / 12.0;
    for (int d = 0; d < BST_NODE_DIRECTIONS; d++) {
        double angle = d * BST_PI / BST_NODE_DIRECTIONS, c = cos(angle), n = sin(angle);
        double inverse = c * c / wide + n * n / narrow, power = 1.0;
        for (int k = 0; k < 3; k++) {
            power *= SHORT_PX * SHORT_PX * inverse;
            /* the variance of a pixel is not all of its shape: 2 % in the sixth order */
            bst_assert_close(s.part[d][k], power, 0.04 * power);
        }
    }
    /* the derivative is greatest where the light is, and no pixel without light has much of it */
    assert_true(s.flank[0] > 0.99);
    assert_true(s.noisy[0] > 0.99 && s.noisy[0] < 1.3);
    assert_true(s.flank[12] < 0.05);
    bst_psf_free(psf);
}

/* A row of groups of length L: 2 w^6 exp(-w^2 variance / 2) sigma^6 / 15 times the kernel's part,
 * with w = 2 pi / L. */
static void rows_have_the_frequencies_of_a_comb(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera;
    bst_psf_sensitivity s;
    bst_psf *psf = make_psf(&ctx, &camera);
    bst_assert_ok(&ctx, bst_psf_sensitivity_measure(&ctx, psf, 0.9, SHORT_PX, &s));
    double variance = LONG_PX * LONG_PX + 1.0 / 12.0;
    for (int b = 2; b <= 8; b++) { /* along x, the direction 0 */
        double w = 2.0 * BST_PI * b * s.most_per_px / BST_ROW_STEPS,
               sw2 = w * w * SHORT_PX * SHORT_PX;
        double expected = 0.74 * 2.0 * sw2 * sw2 * sw2 / 15.0 * exp(-0.5 * w * w * variance);
        bst_assert_close(s.row[0][b][1], expected, 0.1 * expected + 0.002);
    }
    bst_psf_free(psf);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(derivatives_are_those_of_each_direction),
        cmocka_unit_test(rows_have_the_frequencies_of_a_comb),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
