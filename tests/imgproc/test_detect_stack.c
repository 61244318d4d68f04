/* What a stack adds to a frame's detections: not what is there within its own error, in units of
 * the frame. */
#include "imgproc/detect/detect_internal.h"
#include "tests/test_support.h"

static void sources_of_a_stack_join_the_list(void **state) {
    (void)state;
    bst_imgproc *ip = test_calloc(1, sizeof *ip);
    bst_detections *out = test_calloc(1, sizeof *out + 4 * sizeof out->items[0]);
    ip->left.sigma_px = 0.75; /* of a frame binned by 2 */
    ip->left.binning = 2;
    ip->exposure_s = 0.5;
    ip->electrons_per_s_v0 = 4e8;
    out->items[out->count++] = (bst_detection){.x_px = 100, .y_px = 50};
    const bst_stack_found found[] = {
        /* within 3 sigma of its longer axis, within the reach, beyond both, and no room */
        {.x_px = 101.5, .y_px = 52, .cov_xx = 0.04, .cov_yy = 1, .flux_e = 100},
        {.x_px = 100.9, .y_px = 50, .cov_xx = 0.01, .cov_yy = 0.01, .flux_e = 100},
        {.x_px = 102,
         .y_px = 52.5,
         .cov_xx = 0.25,
         .cov_xy = -0.1,
         .cov_yy = 1,
         .flux_e = 200,
         .flux_sigma_e = 40,
         .snr = 6.5,
         .rate_x_pxps = 1.5,
         .rate_y_pxps = -2.5,
         .rate_sigma_pxps = 0.2},
        {.x_px = 10, .y_px = 20, .cov_xx = 0.01, .cov_yy = 0.01, .flux_e = 300, .at_rest = true},
        {.x_px = 30, .y_px = 20, .cov_xx = 0.01, .cov_yy = 0.01, .flux_e = 300}};
    bst_imgproc_append_stack(ip, found, 5, 1.0, out, 3);
    assert_int_equal(out->count, 3);
    assert_int_equal(out->lost, 1);
    const bst_detection *d = &out->items[1];
    bst_assert_close(d->x_px, 102, 0);
    bst_assert_close(d->y_px, 52.5, 0);
    bst_assert_close(d->cov_xx, 0.25, 0);
    bst_assert_close(d->cov_xy, -0.1, 0);
    bst_assert_close(d->cov_yy, 1, 0);
    bst_assert_close(d->flux_sigma_e, 40, 0);
    bst_assert_close(d->snr, 6.5, 0);
    bst_assert_close(d->rate_x_pxps, 1.5, 0);
    bst_assert_close(d->rate_y_pxps, -2.5, 0);
    bst_assert_close(d->rate_sigma_pxps, 0.2, 0);
    /* FWHM of a Gaussian in sensor pixels; 400 e/s of 4e8 are 15 magnitudes, a fifth is 0.217 */
    bst_assert_close(d->width_px, 1.5 * sqrt(8 * log(2)), 1e-12);
    bst_assert_close(d->length_px, d->width_px, 0);
    bst_assert_close(d->v_mag, 15, 1e-12);
    bst_assert_close(d->v_mag_sigma, 2.5 / log(10) * 0.2, 1e-12);
    assert_int_equal(d->flags, BST_DETECTION_STACK);
    assert_int_equal(d->label, BST_LABEL_OBJECT);
    assert_int_equal(out->items[2].label, BST_LABEL_STAR);
    test_free(out);
    test_free(ip);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sources_of_a_stack_join_the_list),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
