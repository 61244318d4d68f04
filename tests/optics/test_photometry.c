/* Zero point of a frame, on drawn magnitudes whose distribution is known. */
#include "boresight/rng.h"
#include "sim/optics/photometry.h"
#include "tests/test_support.h"

enum { FRAMES = 2000, ROOM = 64 };

static const double OFFSET = -0.3;

static bst_detection star(double v_mag, double snr) {
    return (bst_detection){
        .flux_e = 100.0 * snr, .flux_sigma_e = 100.0, .snr = snr, .v_mag = v_mag};
}

/* Frames of `stars` stars of SNR 10 to 200 with a scatter of their own, of which `wrong` are a
 * magnitude off: mean error over its standard deviation's, and the mean of its square. */
static void run(int stars, int wrong, double scatter, double *bias, double *square,
                double *shared) {
    bst_rng_key key = bst_rng_make_key(3, 0, "test", "photometry");
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_optics_photometer p;
    bst_assert_ok(&ctx, bst_optics_photometer_create(&ctx, ROOM, &p));
    double sum = 0.0, squares = 0.0;
    *shared = 0.0;
    for (uint64_t f = 0; f < FRAMES; f++) {
        bst_optics_photometer_begin(&p);
        for (int i = 0; i < stars; i++) {
            uint64_t n = (uint64_t)i;
            double snr = 10.0 * pow(20.0, bst_rng_uniform(key, f, 3 * n)), draw[2];
            bst_rng_normal2(key, f, 3 * n + 1, draw);
            double v_mag = 8.0 + 0.1 * i;
            bst_detection d =
                star(v_mag - OFFSET + 1.0857 / snr * draw[0] + scatter * draw[1], snr);
            d.v_mag -= i < wrong ? 1.0 : 0.0;
            bst_optics_photometer_add(&p, &d, v_mag);
        }
        bst_optics_zero_point z = bst_optics_photometer_zero_point(&p);
        assert_true(z.stars >= 3 && z.stars <= stars);
        double error = (z.offset_mag - OFFSET) / z.sigma_mag;
        sum += error;
        squares += error * error;
        *shared += z.scatter_mag / FRAMES;
    }
    bst_optics_photometer_free(&p);
    *bias = sum / FRAMES;
    *square = squares / FRAMES;
}

static void errors_are_as_stated(void **state) {
    (void)state;
    double bias, square, shared;
    /* mean of FRAMES squares of a unit normal: 1 +- 0.032; weights from an estimated scatter and
     * the clipping of three-sigma tails make it up to a tenth more */
    run(40, 0, 0.0, &bias, &square, &shared);
    bst_assert_close(square, 1.0, 0.13);
    bst_assert_close(bias, 0.0, 0.1); /* 4.5 standard errors */
    run(40, 0, 0.05, &bias, &square, &shared);
    bst_assert_close(square, 1.05, 0.15);
    bst_assert_close(bias, 0.0, 0.1);
    /* the median deviation knows the spread of 40 to 0.17 of it; the noise is taken off as its
     * median's, 0.024 mag */
    bst_assert_close(shared, 0.05, 0.01);
}

static void wrong_stars_count_little(void **state) {
    (void)state;
    double bias, square, shared;
    run(40, 8, 0.02, &bias, &square, &shared);
    /* a fifth that is a magnitude off would move a mean by 0.2 mag, some 30 standard deviations */
    assert_true(fabs(bias) < 1.0 && square < 2.5);
}

/* Four stars by hand. Their magnitudes are 0.10, 0.16, 0.22 and 0.12 too faint, with noise of 0.02,
 * 0.04, 0.02 and 0.04 mag (1.0857 over the SNR): the median is 0.14, the deviations 0.04, 0.02,
 * 0.08, 0.02, their median 0.03, the spread 1.4826 times that, 0.04448. The median variance of the
 * noise is (0.0004 + 0.0016) / 2 = 0.001: 0.04448^2 - 0.001 = 9.784e-4 is shared. */
static void a_zero_point_by_hand(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_optics_photometer p;
    bst_assert_ok(&ctx, bst_optics_photometer_create(&ctx, 8, &p));
    bst_optics_photometer_begin(&p);
    static const double off[] = {0.10, 0.16, 0.22, 0.12}, noise[] = {0.02, 0.04, 0.02, 0.04};
    const double unit = 2.5 / log(10.0);
    double shared = 1.4826 * 0.03 * 1.4826 * 0.03 - 0.001, weights = 0, sum = 0;
    for (int i = 0; i < 4; i++) {
        bst_detection d = star(9.0 + off[i], unit / noise[i]);
        bst_optics_photometer_add(&p, &d, 9.0);
        double w = 1 / (noise[i] * noise[i] + shared);
        weights += w;
        sum -= w * off[i]; /* what has to be added to a magnitude that is measured */
    }
    bst_optics_zero_point z = bst_optics_photometer_zero_point(&p);
    assert_int_equal(z.stars, 4);
    /* 1.4826 is rounded to five digits */
    bst_assert_close(z.offset_mag, sum / weights, 1e-6);
    bst_assert_close(z.sigma_mag, sqrt(1 / weights), 1e-6);
    bst_assert_close(z.scatter_mag, sqrt(shared), 2e-6);
    bst_detections *d = calloc(1, sizeof *d + 2 * sizeof d->items[0]);
    assert_non_null(d);
    d->count = 1;
    d->items[0] = star(11.0, unit / 0.03);
    d->items[1] = star(11.0, unit / 0.03); /* past the end */
    bst_photometry_apply(&z, 22.5, d);
    bst_assert_close(d->zero_point_mag, 22.5 + sum / weights, 1e-6);
    bst_assert_close(d->zero_point_sigma_mag, sqrt(1 / weights), 1e-6);
    assert_int_equal(d->zero_point_stars, 4);
    bst_assert_close(d->items[0].v_mag, 11.0 + sum / weights, 1e-6);
    bst_assert_close(d->items[0].v_mag_sigma, sqrt(0.0009 + 1 / weights), 1e-6);
    bst_assert_close(d->items[1].v_mag, 11.0, 0);
    free(d);
    bst_optics_photometer_free(&p);
}

static void too_few_leave_the_camera_alone(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_optics_photometer p;
    bst_assert_ok(&ctx, bst_optics_photometer_create(&ctx, 8, &p));
    bst_detections *d = calloc(1, sizeof *d + 3 * sizeof d->items[0]);
    assert_non_null(d);
    d->count = 3;
    d->items[0] = star(9.0, 50.0);
    d->items[1] = star(10.0, 20.0);
    d->items[2] = (bst_detection){.v_mag = 12.0, .flux_e = 0.0};
    bst_optics_photometer_begin(&p);
    bst_optics_photometer_add(&p, &d->items[0], 9.2);
    bst_optics_photometer_add(&p, &d->items[1], 10.2);
    /* of no use */
    static const uint32_t spoilt[] = {BST_DETECTION_SATURATED, BST_DETECTION_EDGE,
                                      BST_DETECTION_BLEND};
    for (int i = 0; i < 3; i++) {
        bst_detection no = star(9.0, 50.0);
        no.flags = spoilt[i];
        bst_optics_photometer_add(&p, &no, 9.2);
    }
    bst_detection faint = star(9.0, 9.9);
    bst_optics_photometer_add(&p, &faint, 9.2);
    bst_optics_photometer_add(&p, &d->items[0], NAN);
    bst_optics_photometer_add(&p, &d->items[2], 12.0);
    assert_int_equal(p.count, 2);
    bst_optics_zero_point z = bst_optics_photometer_zero_point(&p);
    assert_int_equal(z.stars, 0);
    bst_photometry_apply(&z, 21.5, d);
    assert_int_equal(d->zero_point_stars, 0);
    assert_true(d->zero_point_mag == 21.5 && d->zero_point_sigma_mag == 0.0);
    assert_true(d->items[0].v_mag == 9.0);
    bst_assert_close(d->items[0].v_mag_sigma, 1.0857362 / 50.0, 1e-8); /* digits given */
    assert_true(isinf(d->items[2].v_mag_sigma));
    /* a third makes one: equal differences leave the noise of their light */
    bst_optics_photometer_add(&p, &d->items[0], 9.2);
    z = bst_optics_photometer_zero_point(&p);
    assert_int_equal(z.stars, 3);
    bst_assert_close(z.offset_mag, 0.2, 1e-12); /* rounding */
    bst_assert_close(z.sigma_mag, 1.0857362 / sqrt(50.0 * 50.0 * 2.0 + 20.0 * 20.0), 1e-8);
    bst_photometry_apply(&z, 21.5, d);
    bst_assert_close(d->zero_point_mag, 21.7, 1e-12);
    bst_assert_close(d->items[1].v_mag, 10.2, 1e-12);
    bst_assert_close(d->items[1].v_mag_sigma, hypot(1.0857362 / 20.0, z.sigma_mag), 1e-8);
    free(d);
    bst_optics_photometer_free(&p);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(errors_are_as_stated),
        cmocka_unit_test(wrong_stars_count_little),
        cmocka_unit_test(a_zero_point_by_hand),
        cmocka_unit_test(too_few_leave_the_camera_alone),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
