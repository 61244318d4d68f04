/* Silhouettes of drawn scenes without noise, rectangles blurred by a Gaussian in closed form, and
 * the size that frames pass on. */
#include <stdlib.h>

#include "imgproc/extended/extended_step.h"
#include "tests/test_support.h"

enum { SIDE = 96 };
static const double SIGMA_PX = 1.1;

/* A rectangle: middle and half sides, px; signal, e- per pixel. */
typedef struct rectangle {
    double x, y, half_x, half_y, signal_e;
} rectangle;

/* Share of a blurred bar from -half to half at a distance from its middle. */
static double bar(double distance, double half) {
    double scale = SIGMA_PX * sqrt(2.0);
    return 0.5 * (erf((distance + half) / scale) - erf((distance - half) / scale));
}

static void read_pixels(const void *user, int y, int x, int count, float *out) {
    const float *pixels = user;
    memcpy(out, pixels + y * SIDE + x, (size_t)count * sizeof *out);
}

/* The only silhouette of a scene. */
static bst_silhouette find(const rectangle *scene, int count) {
    static float pixels[SIDE * SIDE];
    static uint16_t raw[SIDE * SIDE];
    static uint8_t mask[SIDE * SIDE];
    for (int i = 0; i < SIDE * SIDE; i++) {
        double e = 0.0;
        for (int k = 0; k < count; k++) {
            const rectangle *r = &scene[k];
            double share = bar(i % SIDE - r->x, r->half_x) * bar(i / SIDE - r->y, r->half_y);
            e += r->signal_e * share;
        }
        pixels[i] = (float)e;
    }
    const bst_extended_config config = {
        .enabled = true, .handover_fwhm = 3.0, .return_share = 0.8, .join_share = 0.3};
    const bst_silhouette_frame frame = {.read = read_pixels,
                                        .user = pixels,
                                        .raw = raw,
                                        .width = SIDE,
                                        .height = SIDE,
                                        .saturated_dn = 65535,
                                        .full_e = 2e5,
                                        .read_variance_e2 = 2.25,
                                        .sigma_px = SIGMA_PX};
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_silhouette_finder finder;
    bst_silhouettes found;
    bst_assert_ok(&ctx, bst_silhouette_finder_create(&ctx, SIDE, SIDE, &finder));
    bst_silhouettes_find(&finder, &config, &frame, mask, &found);
    bst_silhouette_finder_free(&finder);
    assert_int_equal(found.count, 1);
    return found.items[0];
}

/* Two panels seen edge on beside a bright body: one gives 36 e-, the other 17 e- at most, which is
 * 3.9 times its noise. Both belong to the outline, whose centre is between them. */
static void dim_panels(void **state) {
    (void)state;
    /* a bar much narrower than the PSF has the peak signal_e * 2 half / (sigma sqrt(2 pi)) */
    double peak = 2.0 * 0.1 / (SIGMA_PX * sqrt(2.0 * BST_PI));
    const rectangle scene[] = {{48.2, 47.7, 4.0, 4.0, 5e4},
                               {34.2, 47.7, 0.1, 5.0, 36.0 / peak},
                               {62.2, 47.7, 0.1, 5.0, 17.0 / peak}};
    bst_silhouette s = find(scene, 3);
    assert_int_equal(s.parts, 3);
    /* without the dimmer panel the centre is 5.5 px to the left; bars without width have edges to
     * the PSF's sigma each */
    bst_assert_close(s.centre_x_px, 48.2, SIGMA_PX);
    bst_assert_close(s.centre_y_px, 47.7, 0.2);
    bst_assert_close(s.length_px, hypot(28.0, 10.0), 2.0);
}

/* Four bars about a dark middle: that belongs to the target too, so that its place is the middle of
 * all also where one bar is wider. */
static void a_hole_is_part_of_the_outline(void **state) {
    (void)state;
    const double x = 57.0, y = 38.0, half_x = 20.0, half_y = 14.0;
    for (int wide = 0; wide < 2; wide++) { /* the left bar, 4 or 12 px */
        const double left = wide ? 6.0 : 2.0;
        const rectangle scene[] = {{x - half_x + left, y, left, half_y, 2e4},
                                   {x + half_x - 2.0, y, 2.0, half_y, 2e4},
                                   {x, y - half_y + 2.0, half_x, 2.0, 2e4},
                                   {x, y + half_y - 2.0, half_x, 2.0, 2e4}};
        bst_silhouette s = find(scene, 4);
        bst_assert_close(s.centre_x_px, x, 0.3); /* of the whole outline, to a part of a pixel */
        bst_assert_close(s.centre_y_px, y, 0.3);
        bst_assert_close(s.x_px, x, 0.5); /* of its pixels, which are whole */
        bst_assert_close(s.y_px, y, 0.5);
        bst_assert_close(s.area_px2, 4.0 * half_x * half_y, 4.0 * (half_x + half_y));
        bst_assert_close(s.length_px, 2.0 * hypot(half_x, half_y), 4.0);
    }
}

/* Standard deviation of the centre of a target of `length_px`; 0: the frame has none. */
static double centre_sigma_px(bst_extended_step *step, double length_px) {
    enum { ITEMS = 4 };
    bst_detections *out = calloc(1, sizeof *out + ITEMS * sizeof *out->items);
    assert_non_null(out);
    const bst_optics_zero_point zero = {.stars = 0};
    step->targets.count = length_px > 0.0;
    step->targets.items[0] = (bst_silhouette){.length_px = length_px, .flux_e = 1e6};
    bst_extended_step_append(step, 1.0, &zero, out, ITEMS);
    double sigma = out->count > 0 ? sqrt(out->items[0].cov_xx) : 0.0;
    free(out);
    return sigma;
}

/* A target of which only a part has light remains as uncertain as all of it, for some frames. */
static void size_of_earlier_frames(void **state) {
    (void)state;
    const bst_camera camera = {
        .width_px = 512, .height_px = 512, .pixel_scale_arcsec = 120, .psf_fwhm_px = 2.5};
    const bst_extended_config config = {
        .enabled = true, .handover_fwhm = 3.0, .centre_sigma = 0.03};
    /* the Sun's direction is known: without it, it would make most of the uncertainty */
    bst_extended_step step = {
        .config = &config,
        .view = {.camera = &camera, .binning = 1.0, .sun_known = true, .sun_cam = {1, 0, 0}}};
    double all = centre_sigma_px(&step, 400.0);
    assert_true(all >= 12.0);
    /* 0.95 of the size passes on; noise adds little to that in quadrature */
    double part = centre_sigma_px(&step, 130.0);
    bst_assert_close(part, 0.03 * 0.95 * 400.0, 0.1);
    assert_true(centre_sigma_px(&step, 130.0) < part);
    bst_assert_close(centre_sigma_px(&step, 400.0), all, 1e-9);
    /* a target that is gone has no size */
    (void)centre_sigma_px(&step, 0.0);
    bst_extended_step fresh = {.config = &config, .view = step.view};
    bst_assert_close(centre_sigma_px(&step, 130.0), centre_sigma_px(&fresh, 130.0), 1e-9);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(dim_panels),
                                       cmocka_unit_test(a_hole_is_part_of_the_outline),
                                       cmocka_unit_test(size_of_earlier_frames)};
    return cmocka_run_group_tests_name("imgproc/silhouette", tests, NULL, NULL);
}
