/* The fit of one point to several on pixels with a diffraction pattern, against the PSF itself. */
#include "boresight/vec.h"
#include "obsgen/model/psf_fit.h"
#include "sim/optics/psf_image.h"
#include "tests/test_support.h"

enum { PER_PX = 10, REACH = 16, HALF = 4 };

typedef struct fine_image {
    int side;
    double *share;
} fine_image;

/* Share of a point's light on a pixel that far from it, by bilinear interpolation of the image. */
static double share_at(const fine_image *m, double x, double y) {
    double u = (x + REACH) * PER_PX, v = (y + REACH) * PER_PX;
    int i = (int)u, j = (int)v;
    const double *p = m->share + j * m->side + i;
    double low = p[0] + (u - i) * (p[1] - p[0]);
    double high = p[m->side] + (u - i) * (p[m->side + 1] - p[m->side]);
    return low + (v - j) * (high - low);
}

static void make_psf(bst_ctx *ctx, bst_psf **psf, fine_image *m) {
    bst_camera camera = {.width_px = 512,
                         .height_px = 512,
                         .pixel_scale_arcsec = 2.0,
                         .aperture_m = 0.15,
                         .psf_fwhm_px = 2.0,
                         .optics = {.psf = BST_PSF_DIFFRACTION,
                                    .q = 2.1,
                                    .band_nm = {500.0, 800.0},
                                    .wavelengths = 6,
                                    .diffusion_px = 0.2,
                                    .zernike_nm = 550.0,
                                    .fill_factor = {1.0, 1.0},
                                    .field_columns = 1,
                                    .field_rows = 1}};
    bst_assert_ok(ctx, bst_psf_create(ctx, &camera, psf));
    m->side = bst_psf_image_side(PER_PX, REACH);
    m->share = calloc((size_t)m->side * (size_t)m->side, sizeof *m->share);
    assert_non_null(m->share);
    bst_assert_ok(ctx, bst_psf_image(ctx, *psf, 0, 0.0, PER_PX, REACH, m->share));
}

/* Two points of 8700 and 5200 electrons on one streak of their PSF. The derivative of chi-square by
 * x, y and flux at the place of the fit is that of no light left, to a small step. */
static void the_place_is_a_minimum_on_the_pixels(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_psf *psf;
    fine_image m;
    make_psf(&ctx, &psf, &m);
    bst_response r;
    const bst_response_side side = {psf, 0.0};
    bst_response_set(&r, &side, &side, 1, 255.5, 255.5);
    const double peak = share_at(&m, 0.0, 0.0);
    for (double d = 0.0; d < 7.0; d += 0.7) {
        double x = 0.8 * d, y = 0.6 * d, slope, curvature, expected = share_at(&m, x, y);
        /* mean over the directions: square pixels make 0.5 % of the peak */
        bst_assert_close(bst_response_image_share(&r, d), expected, 0.006 * peak);
        bst_assert_close(bst_response_model_share(&r, d, &slope, &curvature), expected,
                         0.006 * peak);
    }
    const bst_psf_fit_frame frame = {
        .reach_px = HALF, .sigma_px = 0.92, .limit_px = 2.4, .noise_e = 12.0};
    for (int i = 0; i < 6; i++) {
        double distance = 2.6 + 0.3 * i, angle = 0.4 + 0.9 * i, start[2] = {0.1 * i - 0.2, 0.15};
        const bst_path_point points[2] = {{0.0, 0.0, 8700.0},
                                          {distance * cos(angle), distance * sin(angle), 5200.0}};
        bst_path_point_fit f = bst_psf_fit_points(&r, points, 2, start, &frame);
        double a[3] = {0.0}, g[3] = {0.0}, h = 0.1;
        for (int v = -HALF; v <= HALF; v++) {
            for (int u = -HALF; u <= HALF; u++) {
                double light = 0.0, dx = u - start[0] - f.x_px, dy = v - start[1] - f.y_px;
                for (int k = 0; k < 2; k++) {
                    light += points[k].flux * share_at(&m, u - start[0] - points[k].x_px,
                                                       v - start[1] - points[k].y_px);
                }
                double here = share_at(&m, dx, dy), right = share_at(&m, dx + h, dy);
                double left = share_at(&m, dx - h, dy), up = share_at(&m, dx, dy + h);
                double down = share_at(&m, dx, dy - h);
                double wider = 0.5 * (right + left + up + down - 4.0 * here) / (h * h);
                double shape = here + f.widening_px2 * wider;
                const double by[3] = {f.flux * (left - right) / (2.0 * h),
                                      f.flux * (down - up) / (2.0 * h), shape};
                double weight = 1.0 / (144.0 + fmax(f.flux * shape, 0.0));
                for (int k = 0; k < 3; k++) {
                    g[k] += weight * by[k] * (light - f.flux * shape);
                    a[k] += weight * by[k] * by[k];
                }
            }
        }
        printf("%.1f px apart: at (%.3f, %.3f), flux %.0f, widening %.3f; steps %.4f %.4f %.0f\n",
               distance, f.x_px, f.y_px, f.flux, f.widening_px2, g[0] / a[0], g[1] / a[1],
               g[2] / a[2]);
        /* square pixels and differences over 0.1 px */
        bst_assert_close(g[0] / a[0], 0.0, 0.03);
        bst_assert_close(g[1] / a[1], 0.0, 0.03);
        bst_assert_close(g[2] / a[2] / f.flux, 0.0, 0.02);
        /* towards the fainter one, by much less than the centroid from 3.5 px on */
        double along = f.x_px * cos(angle) + f.y_px * sin(angle);
        assert_true(along > 0.0 && along < distance * 5200.0 / 13900.0 + 0.1);
        assert_true(distance < 3.5 || along < 0.6);
        bst_psf_fit_moments w = bst_psf_fit_measure(&r, points, 2, start, &frame, &f);
        double longest = 0.5 * (w.xx + w.yy) + hypot(0.5 * (w.xx - w.yy), w.xy);
        assert_true(longest > 0.92 * 0.92);
    }
    /* a point alone is found where it is, as wide as it is */
    const bst_path_point alone = {0.3, -0.2, 9000.0};
    const double start[2] = {0.0, 0.0};
    bst_path_point_fit f = bst_psf_fit_points(&r, &alone, 1, start, &frame);
    bst_assert_close(f.x_px, 0.3, 1e-3);
    bst_assert_close(f.y_px, -0.2, 1e-3);
    bst_assert_close(f.flux, 9000.0, 9.0);
    bst_assert_close(f.widening_px2, 0.0, 1e-3);
    /* an image that shakes by 0.5 px is 0.25 px^2 wider, less the limit of a linear model */
    bst_response wide = bst_response_widened(&r, 0.25);
    f = bst_psf_fit_points(&wide, &alone, 1, start, &frame);
    assert_true(f.widening_px2 > 0.12 && f.widening_px2 < 0.35);
    free(m.share);
    bst_psf_free(psf);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_place_is_a_minimum_on_the_pixels)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
