/* Sources that bloom: one detection each, placed by the light beside the bleeding columns. The
 * overflow is drawn here, charge by charge, without the renderer. */
#include <stdlib.h>

#include "boresight/rng.h"
#include "imgproc/detect/blooming.h"
#include "imgproc/detect/filter.h"
#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

enum { SIDE = 256, TRIALS = 30 };

/* Sends `charge` from row y one way along a column until wells have taken it. */
static void overflow(double *electrons, int x, int y, int way, double charge, double well) {
    for (y += way; charge > 0.0 && y >= 0 && y < SIDE; y += way) {
        double *e = &electrons[y * SIDE + x], room = fmax(well - *e, 0.0);
        double taken = fmin(room, charge);
        *e += taken;
        charge -= taken;
    }
}

/* A frame with shot and read noise, whose wells overflow by halves up and down their columns. */
static void expose(synthetic *s, bst_rng_key key, uint64_t frame) {
    static double electrons[SIDE * SIDE];
    for (int i = 0; i < SIDE * SIDE; i++) {
        double z[2];
        bst_rng_normal2(key, frame, (uint64_t)i, z);
        electrons[i] = fmax(s->mean_e[i] + sqrt(s->mean_e[i]) * z[0], 0.0);
    }
    double well = s->camera.full_well_e;
    static double excess[SIDE * SIDE];
    for (int i = 0; i < SIDE * SIDE; i++) {
        excess[i] = fmax(electrons[i] - well, 0.0);
        electrons[i] -= excess[i];
    }
    for (int i = 0; i < SIDE * SIDE; i++) {
        overflow(electrons, i % SIDE, i / SIDE, 1, 0.5 * excess[i], well);
        overflow(electrons, i % SIDE, i / SIDE, -1, 0.5 * excess[i], well);
    }
    for (int i = 0; i < SIDE * SIDE; i++) {
        double z[2];
        bst_rng_normal2(key, frame + 1000, (uint64_t)i, z);
        double dn = floor(s->camera.offset_dn +
                          (electrons[i] + s->read_e * z[0]) / s->camera.gain_e_per_dn + 0.5);
        s->pixels[i] = (uint16_t)fmin(fmax(dn, 0.0), 65535.0);
    }
}

/* From a source that just fills a well to one whose columns bleed over half of the frame, at random
 * places in the pixel, of the camera's width and 8 % wider than the onboard side believes: nothing
 * but that source and, of noise, a false alarm a frame; its error is what its covariance says, its
 * flux that of its charge. */
static void one_source_of_each(void **state) {
    (void)state;
    static const double fluxes_e[] = {1e6, 3e6, 1e7, 5e7};
    for (int wide = 0; wide < 2; wide++) {
        for (size_t k = 0; k < sizeof fluxes_e / sizeof *fluxes_e; k++) {
            bst_ctx ctx = {0};
            synthetic s;
            synthetic_init(&s, SIDE, SIDE);
            s.camera.detector.saturation = BST_WELL_BLOOM;
            s.config.threads = 1;
            bst_imgproc *ip = synthetic_processor(&ctx, &s);
            bst_detections *d = synthetic_detections(2048);
            bst_rng_key key = bst_rng_make_key(k, (unsigned)wide, "test", "bleed");
            s.camera.psf_fwhm_px *= wide ? 1.08 : 1.0;
            double chi2 = 0.0;
            int others = 0;
            for (uint64_t t = 0; t < TRIALS; t++) {
                double x = 127.5 + bst_rng_uniform(key, 1, t),
                       y = 127.5 + bst_rng_uniform(key, 2, t);
                synthetic_clear(&s);
                synthetic_add(&s, x, y, fluxes_e[k], 0, 0);
                expose(&s, key, 10 + t);
                bst_imgproc_frame frame = synthetic_frame(&s);
                bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &frame, NULL, d, 2048));
                assert_true(synthetic_sound(d));
                int n = synthetic_nearest(d, x, y, 0.5);
                assert_true(n >= 0);
                const bst_detection *found = &d->items[n];
                assert_int_equal(found->label, BST_LABEL_UNKNOWN);
                assert_true(found->flags & BST_DETECTION_SATURATED);
                assert_true(found->flags & BST_DETECTION_BLOOM);
                /* the charge is counted; wells are known to 2 % */
                bst_assert_close(found->flux_e / fluxes_e[k], 1.0, 0.03);
                bst_assert_close(
                    found->flux_sigma_e / hypot(sqrt(found->flux_e), 0.02 * found->flux_e), 1.0,
                    1e-6);
                double dx = found->x_px - x, dy = found->y_px - y;
                chi2 += dx * dx / found->cov_xx + dy * dy / found->cov_yy;
                others += d->count - 1;
            }
            /* 60 degrees of freedom: 1.73 is 4 sigma above their mean */
            assert_true(chi2 / (2 * TRIALS) < 1.73);
            assert_true(others < 2 * TRIALS);
            free(d);
            bst_imgproc_free(ip);
            synthetic_free(&s);
        }
    }
}

/* Two that bloom side by side, and a faint one that no bleeding touches, are three sources. */
static void neighbours_stay(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    synthetic s;
    synthetic_init(&s, SIDE, SIDE);
    s.camera.detector.saturation = BST_WELL_BLOOM;
    bst_imgproc *ip = synthetic_processor(&ctx, &s);
    bst_detections *d = synthetic_detections(2048);
    bst_rng_key key = bst_rng_make_key(8, 0, "test", "bleed");
    synthetic_add(&s, 100.2, 90.4, 5e6, 0, 0);
    synthetic_add(&s, 118.7, 101.1, 4e6, 0, 0);
    synthetic_add(&s, 109.4, 95.0, 3000, 0, 0);
    expose(&s, key, 1);
    bst_imgproc_frame frame = synthetic_frame(&s);
    bst_assert_ok(&ctx, bst_imgproc_detect(&ctx, ip, &frame, NULL, d, 2048));
    assert_true(synthetic_nearest(d, 100.2, 90.4, 0.2) >= 0);
    assert_true(synthetic_nearest(d, 118.7, 101.1, 0.2) >= 0);
    assert_true(synthetic_nearest(d, 109.4, 95.0, 0.3) >= 0);
    /* and of noise one false alarm expected, five at most */
    assert_true(d->count <= 8);
    free(d);
    bst_imgproc_free(ip);
    synthetic_free(&s);
}

/* Errors of places: a fit has its own, three times what it misses by beyond chance, and 0.4 % of
 * the bleed's width; without one it is 3 % of the width, 0.1 px at least. Those of the light are
 * its shot noise and 2 % of the wells. */
static void errors_go_by_misfit_and_width(void **state) {
    (void)state;
    static const double widths[] = {2.0, 3.5, 40.0}, misfits[] = {0.5, 1.0, 7.0};
    bst_filter filter = {.norm = 1.7, .streak_norm = 3.1};
    bst_locate_frame f = {.filter = &filter, .sigma_px = 0.9};
    for (int k = 0; k < 9; k++) {
        double width = widths[k / 3], misfit = misfits[k % 3];
        for (int fitted = 0; fitted < 2; fitted++) {
            bst_imgproc_found found = {.source = {.fitted = fitted,
                                                  .pixels = 54,
                                                  .chi_square = 50.0 * misfit,
                                                  .shape = {.x_px = 1.0, .y_px = 2.0},
                                                  .cov_xx = 0.04,
                                                  .cov_xy = -0.02,
                                                  .cov_yy = 0.09},
                                       .bleed_px = width,
                                       .bleed_e = 1e5,
                                       .top_x_px = 31.0,
                                       .top_y_px = 17.0,
                                       .noise_e = 20.0,
                                       .angle_rad = 1.0};
            bst_blooming_finish(&f, 1.7, &found);
            const bst_imgproc_source *s = &found.source;
            double more = misfit < 1.0 ? 1.0 : 3.0 * misfit - 2.0, floor = pow(0.004 * width, 2.0),
                   alone = fmax(9e-4 * width * width, 0.01);
            bst_assert_close(s->cov_xx, fitted ? 0.04 * more + floor : alone, 1e-12);
            bst_assert_close(s->cov_xy, fitted ? -0.02 * more : 0.0, 1e-12);
            bst_assert_close(s->cov_yy, fitted ? 0.09 * more + floor : alone, 1e-12);
            bst_assert_close(s->shape.x_px, fitted ? 1.0 : 31.0, 0.0);
            bst_assert_close(s->shape.y_px, fitted ? 2.0 : 17.0, 0.0);
            bst_assert_close(s->flux_e, 1e5, 0.0);
            bst_assert_close(s->flux_variance, 1e5 + 2e3 * 2e3, 1e-6);
            bst_assert_close(found.snr, 1e5 * 1.7 / 20.0, 1e-6);
            bst_assert_close(found.length_px, 0.9 * 2.0 * sqrt(2.0 * log(2.0)), 1e-12);
            bst_assert_close(found.width_px, found.length_px, 0.0);
            bst_assert_close(found.angle_rad, 0.0, 0.0);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_source_of_each),
        cmocka_unit_test(neighbours_stay),
        cmocka_unit_test(errors_go_by_misfit_and_width),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
