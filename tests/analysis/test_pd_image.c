/* Sampled images of targets against the closed forms of a Gaussian PSF. */
#include <math.h>

#include "sim/analysis/pd/pd_image.h"
#include "tests/test_support.h"

/* A full width at half maximum of 2 px. */
#define SIGMA_PX (2.0 / 2.354820045)

static bst_psf *gaussian(void) {
    bst_ctx ctx = {0};
    bst_psf *psf;
    const bst_camera camera = {.width_px = 512,
                               .height_px = 256,
                               .pixel_scale_arcsec = 2.0,
                               .aperture_m = 0.1,
                               .psf_fwhm_px = 2.0,
                               .optics = {.psf = BST_PSF_GAUSSIAN, .q = 2.0, .wavelengths = 1}};
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &psf));
    return psf;
}

/* Points between pixels, and paths in all quadrants up to 9 px, whole and broken, beside corners.
 */
static const bst_eval_match_target places[] = {{100, 50, 0, 0},         {100.25, 50.4375, 0, 0},
                                               {310.5, 200.5, 0, 0},    {70.125, 90.875, 4, 0},
                                               {70.125, 90.875, 0, -7}, {401.3125, 33.5, 5, 3.5},
                                               {22.75, 160, -8, 4},     {250, 41.0625, -1.5, -2.5}};

static void powers_and_bounds(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_psf *psf = gaussian();
    bst_pd_image *image;
    bst_assert_ok(&ctx, bst_pd_image_create(&ctx, psf, 9.0, &image));
    for (size_t i = 0; i < sizeof places / sizeof *places; i++) {
        const bst_eval_match_target *p = &places[i];
        const bst_eval_bound_source source = {p->x_px, p->y_px, p->dx_px, p->dy_px, SIGMA_PX, 4000};
        /* paths are drawn by points that lie on sixteenths of a pixel */
        double loose = hypot(p->dx_px, p->dy_px) > 0 ? 6e-3 : 1e-5;
        double powers[2], truth[2];
        bst_pd_image_powers(image, p, powers);
        bst_assert_ok(&ctx, bst_eval_gaussian_powers(&ctx, &source, truth));
        bst_assert_close(powers[0], truth[0], loose * truth[0]);
        bst_assert_close(powers[1], truth[1], 2 * loose * truth[1]);
        for (int own = 0; own < 2; own++) {
            const bst_eval_bound_noise noise = {11.0, own};
            bst_location_bound a, b;
            bst_assert_ok(&ctx, bst_pd_image_bound(&ctx, image, p, 4000, &noise, &a));
            bst_assert_ok(&ctx, bst_location_bound_gaussian(&ctx, &source, &noise, 8.0, &b));
            bst_assert_close(a.snr, b.snr, loose * b.snr);
            for (int k = 0; k < 2; k++) { /* x, y and their cross term */
                bst_assert_close(a.covariance[k][k], b.covariance[k][k],
                                 8 * loose * b.covariance[k][k]);
                double scale = sqrt(b.covariance[0][0] * b.covariance[1][1]);
                bst_assert_close(a.covariance[k][1 - k], b.covariance[k][1 - k], 8 * loose * scale);
            }
        }
    }
    bst_pd_image_free(image);
    bst_pd_image_free(NULL);
    bst_psf_free(psf);
}

/* A long streak after one in another direction: nothing of the light before is left, in stamps that
 * are wide, high, and square. */
static void streaks_one_after_another(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_psf *psf = gaussian();
    bst_pd_image *image;
    bst_assert_ok(&ctx, bst_pd_image_create(&ctx, psf, 41.0, &image));
    static const bst_eval_match_target streaks[] = {
        {200.25, 120.5, 28, 28},   {200.25, 120.5, 0, 40},   {200.25, 120.5, -28, 28},
        {200.25, 120.5, 40, 0},    {120.5, 90.75, 9, -33},   {120.5, 90.75, 33, 9},
        {310.07, 44.31, 4.1, 2.3}, {310.0, 44.25, 0.5, -38}, {310.0, 44.25, 0, 0}};
    for (size_t i = 0; i < sizeof streaks / sizeof *streaks; i++) {
        const bst_eval_match_target *p = &streaks[i];
        const bst_eval_bound_source source = {p->x_px, p->y_px, p->dx_px, p->dy_px, SIGMA_PX, 9000};
        double powers[2], truth[2];
        bst_pd_image_powers(image, p, powers);
        bst_assert_ok(&ctx, bst_eval_gaussian_powers(&ctx, &source, truth));
        bst_assert_close(powers[0], truth[0], 6e-3 * truth[0]); /* points on sixteenths */
        bst_assert_close(powers[1], truth[1], 12e-3 * truth[1]);
        const bst_eval_bound_noise noise = {6.0, true};
        bst_location_bound a, b;
        bst_assert_ok(&ctx, bst_pd_image_bound(&ctx, image, p, 9000, &noise, &a));
        bst_assert_ok(&ctx, bst_location_bound_gaussian(&ctx, &source, &noise, 8.0, &b));
        for (int k = 0; k < 3; k++) {
            for (int m = 0; m < 3; m++) {
                double scale = sqrt(b.covariance[k][k] * b.covariance[m][m]);
                bst_assert_close(a.covariance[k][m], b.covariance[k][m], 0.05 * scale);
            }
        }
    }
    bst_pd_image_free(image);
    bst_psf_free(psf);
}

/* Light of a streak in a region that is not square, cut by it on one side. */
static void shares_in_a_part(void **state) {
    (void)state;
    enum { WIDE = 31, HIGH = 17 };
    bst_ctx ctx = {0};
    bst_psf *psf = gaussian();
    bst_pd_image *image;
    bst_assert_ok(&ctx, bst_pd_image_create(&ctx, psf, 9.0, &image));
    static const bst_eval_match_target exact[] = {{300.3, 100.2, 7, 5}, {292.1, 104.7, -3, 6}};
    for (int i = 0; i < 2; i++) {
        for (int turned = 0; turned < 2; turned++) {
            int width = turned ? HIGH : WIDE, height = turned ? WIDE : HIGH;
            const bst_eval_match_target *p = &exact[i];
            double work[2 * (WIDE + HIGH)], truth[WIDE * HIGH], got[WIDE * HIGH];
            const bst_eval_region region = {285, 92, width, height, work};
            const bst_eval_bound_source source = {p->x_px,  p->y_px,  p->dx_px,
                                                  p->dy_px, SIGMA_PX, 1};
            bst_eval_gaussian_shares(&source, &region, truth);
            bst_pd_image_shares(image, p, 285, 92, width, height, got);
            for (int k = 0; k < WIDE * HIGH; k++) {
                bst_assert_close(got[k], truth[k], 1e-4); /* as below */
            }
        }
    }
    bst_pd_image_free(image);
    bst_psf_free(psf);
}

/* Shares at exact places: no sixteenths. */
static void shares(void **state) {
    (void)state;
    enum { SIDE = 25 };
    bst_ctx ctx = {0};
    bst_psf *psf = gaussian();
    bst_pd_image *image;
    bst_assert_ok(&ctx, bst_pd_image_create(&ctx, psf, 9.0, &image));
    static const bst_eval_match_target exact[] = {{100.013, 49.977, 0, 0},
                                                  {99.541, 50.272, 0, 0},
                                                  {100.303, 50.111, 4, -3},
                                                  {100.4999, 49.5001, 0, 6}};
    for (size_t i = 0; i < sizeof exact / sizeof *exact; i++) {
        const bst_eval_match_target *p = &exact[i];
        double work[4 * SIDE], truth[SIDE * SIDE], got[SIDE * SIDE];
        const bst_eval_region region = {88, 38, SIDE, SIDE, work};
        const bst_eval_bound_source source = {p->x_px, p->y_px, p->dx_px, p->dy_px, SIGMA_PX, 1};
        bst_eval_gaussian_shares(&source, &region, truth);
        bst_pd_image_shares(image, p, region.x0, region.y0, SIDE, SIDE, got);
        for (int k = 0; k < SIDE * SIDE; k++) {
            /* cubic interpolation over sixteenths of a pixel: (1/16)^4 / 24 of a fourth derivative
             * of 0.4; of streaks the midpoint rule at their ends: (1/4)^2 / 24 of a slope of 0.03
             */
            bst_assert_close(got[k], truth[k], i < 2 ? 1e-6 : 1e-4);
        }
    }
    bst_pd_image_free(image);
    bst_psf_free(psf);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(powers_and_bounds), cmocka_unit_test(streaks_one_after_another),
        cmocka_unit_test(shares_in_a_part), cmocka_unit_test(shares)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
