/* Radiation hits, linearity and statistics of frames against numbers that are drawn here. */
#include "boresight/rng.h"
#include "boresight/vec.h"
#include "sim/analysis/characterize/frame_comparison.h"
#include "sim/analysis/characterize/linearity_fit.h"
#include "sim/analysis/characterize/radiation_hits.h"
#include "tests/test_support.h"

static const bst_rng_key KEY = {{3, 4}};

static double uniform(int i, int k) {
    return bst_rng_uniform(KEY, (uint64_t)i, (uint64_t)k);
}

/* Tracks through a layer of 1.6 px on a sensor without edges. */
static void law_of_hits(void **state) {
    (void)state;
    enum { HITS = 1500 };
    static bst_radiation_hit items[HITS];
    const double depth = 1.6, charge = 400.0, straggling = 0.2;
    for (int i = 0; i < HITS; i++) {
        double mu = sqrt(uniform(i, 0)), azimuth = 2.0 * BST_PI * uniform(i, 1);
        double length = depth * sqrt(1.0 - mu * mu) / mu;
        double columns = floor(uniform(i, 2) + length * fabs(cos(azimuth)));
        double rows = floor(uniform(i, 3) + length * fabs(sin(azimuth)));
        double z = bst_rng_normal(KEY, (uint64_t)i, 9);
        items[i].pixels = (int)(1.0 + columns + rows);
        items[i].charge_dn = (float)(charge * depth / mu * (1.0 - straggling * log(z * z)));
    }
    const bst_radiation_hits hits = {
        .frames = 2, .width = 1000000, .height = 1000000, .items = items, .used = HITS};
    bst_hit_law law = bst_radiation_hits_fit(&hits);
    /* four standard errors, which are 2 to 4 % of 1,500 hits */
    bst_assert_close(law.depth_px.value, depth, 4.0 * law.depth_px.sigma);
    bst_assert_close(law.charge_dn.value, charge, 4.0 * law.charge_dn.sigma);
    bst_assert_close(law.straggling.value, straggling, 4.0 * law.straggling.sigma);
    assert_true(law.depth_px.sigma < 0.04 * depth && law.depth_px.sigma > 0.01 * depth);
    assert_true(law.charge_dn.sigma < 0.04 * charge && law.straggling.sigma < 0.05 * straggling);
    bst_radiation_hits few = hits;
    few.used = BST_LEAST_HITS - 1;
    law = bst_radiation_hits_fit(&few);
    assert_true(isnan(law.depth_px.value) && isnan(law.straggling.value));
}

/* Hits of both frames, one at an edge that counts and one at an edge that does not. */
static void hits_of_a_pair(void **state) {
    (void)state;
    enum { W = 64, H = 48, SIDE = 8 };
    bst_ctx ctx = {0};
    static float a[W * H], b[W * H];
    static uint8_t mask[W * H];
    double rows[H], hot[SIDE * SIDE], level[SIDE * SIDE], sigma[SIDE * SIDE];
    for (int i = 0; i < W * H; i++) {
        a[i] = (float)(100.0 + bst_rng_normal(KEY, (uint64_t)i, 20));
        b[i] = (float)(103.0 + bst_rng_normal(KEY, (uint64_t)i, 21));
    }
    for (int y = 0; y < H; y++) {
        rows[y] = 3.0;
    }
    for (int k = 0; k < SIDE * SIDE; k++) {
        hot[k] = 110.0;
        level[k] = 101.5;
        sigma[k] = sqrt(2.0);
    }
    b[10 * W + 10] += 50.0F; /* two pixels, corner to corner */
    b[11 * W + 11] += 20.0F;
    a[30 * W + 40] += 400.0F;
    b[20 * W] += 90.0F;         /* first column */
    b[20 * W + W - 1] += 90.0F; /* last column */
    a[40 * W + 5] += 500.0F;    /* hot in both */
    b[40 * W + 5] += 700.0F;
    b[10 * W + 12] += 3.0F;         /* below four standard deviations */
    for (int x = 20; x < 27; x++) { /* a track across a hot pixel */
        b[35 * W + x] += 80.0F;
    }
    a[35 * W + 22] += 150.0F; /* noise of 17 */
    b[35 * W + 22] += 150.0F;
    a[44 * W + 50] += 10000.0F; /* noise of 141 is no hit */
    b[44 * W + 50] += 10300.0F;
    const bst_hit_pair pair = {W, H, a, b, rows, hot, level, sigma, 1.0, SIDE, 6.0, 4.0};
    bst_radiation_hits hits = {0};
    assert_int_equal(bst_radiation_hits_add(&ctx, &pair, mask, &hits), BST_OK);
    assert_int_equal(hits.count, 4);
    assert_int_equal(hits.used, 3);
    assert_int_equal(hits.frames, 2);
    assert_int_equal(hits.items[0].pixels, 2);
    assert_int_equal(hits.items[1].pixels, 1);
    assert_int_equal(hits.items[2].pixels, 7); /* and not one of 2 and one of 4 */
    bst_assert_close((double)hits.items[2].charge_dn, 7 * 80.0, 5 * 1.5 * sqrt(7.0));
    /* noise of 1.4 in each pixel: five standard deviations */
    bst_assert_close((double)hits.items[0].charge_dn, 70.0, 10.0);
    bst_assert_close((double)hits.items[1].charge_dn, 400.0, 7.0);
    bst_assert_close(hits.threshold_dn, 4.0 * sqrt(2.0), 1e-12);
    int marked = 0;
    for (int i = 0; i < W * H; i++) {
        marked += mask[i];
    }
    assert_int_equal(marked, 12);
    assert_true(mask[11 * W + 11] && !mask[10 * W + 12] && !mask[40 * W + 5]);
    bst_radiation_hits_free(&hits);
}

enum { POINTS = 20 };
static const double GAIN = 2.5, WELL = 50000.0, TERMS[3] = {-0.03, 0.01, -0.006}, READ_DN = 4.0;

/* Flats in light that fills the well at 10 s; `most`: of the converter, DN above the level. */
static void make_series(bst_linearity_point *points, bst_linearity_series *s, double longest_s,
                        double most, double vignetting) {
    const double pixels = 1024.0;
    *s = (bst_linearity_series){POINTS, 256, 256, points};
    for (int i = 0; i < POINTS; i++) {
        points[i] = (bst_linearity_point){
            .exposure_s = longest_s * (i + 1) / POINTS, .frames = 2, .pairs = 1};
        for (int k = 0; k < BST_STACK_BLOCKS; k++) {
            double response = 1.0 - vignetting * k / BST_STACK_BLOCKS;
            double q = response * WELL / 10.0 * points[i].exposure_s, u = fmin(q / WELL, 1.0);
            double signal =
                u * WELL / GAIN * (1.0 + u * (TERMS[0] + u * (TERMS[1] + u * TERMS[2])));
            double bend = 1.0 + u * (2.0 * TERMS[0] + u * (3.0 * TERMS[1] + u * 4.0 * TERMS[2]));
            double shot = q < WELL ? q / (GAIN * GAIN) * bend * bend : 0.0;
            double v = signal < most ? shot + READ_DN * READ_DN : 0.0;
            int stream = 100 + i * BST_STACK_BLOCKS + k;
            points[i].mean[k] = 300.0 + fmin(signal, most) +
                                sqrt(v / (2.0 * pixels)) * bst_rng_normal(KEY, (uint64_t)stream, 1);
            points[i].variance[k] =
                v * (1.0 + sqrt(2.0 / pixels) * bst_rng_normal(KEY, (uint64_t)stream, 2));
            points[i].scatter[k] = sqrt(v) + 0.005 * signal;
        }
    }
}

static const bst_linearity_dark *dark_of_series(void) {
    static bst_linearity_dark dark;
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        dark.level[k] = 300.0;
        dark.variance[k] = READ_DN * READ_DN;
    }
    return &dark;
}

static void linearity_and_full_well(void **state) {
    (void)state;
    static bst_linearity_point points[POINTS];
    bst_linearity_series s;
    bst_linearity fit;
    const bst_sensor_estimate header = {2.0, NAN};
    for (int vignetted = 0; vignetted < 2; vignetted++) {
        make_series(points, &s, 14.0, INFINITY, vignetted ? 0.2 : 0.0);
        bst_linearity_fit(&s, dark_of_series(), header, &fit);
        assert_true(fit.saturates && !fit.of_converter);
        /* the 14th is at 98 % of the well, within five times the scatter of it; with vignetting too
         */
        assert_in_range(fit.used, 10, 13);
        double full = WELL / GAIN * (1.0 + TERMS[0] + TERMS[1] + TERMS[2]);
        bst_assert_close(fit.saturation_dn.value, full,
                         5.0 * fit.saturation_dn.sigma + 1e-3 * full);
        /* four standard errors, and that they are small enough to say something */
        bst_assert_close(fit.gain_e_per_dn.value, GAIN, 4.0 * fit.gain_e_per_dn.sigma);
        assert_true(fit.gain_e_per_dn.sigma < 0.005 * GAIN);
        bst_assert_close(fit.full_well_e.value, WELL, 4.0 * fit.full_well_e.sigma);
        assert_true(fit.full_well_e.sigma < 0.005 * WELL);
        for (int i = 0; i < 3; i++) {
            bst_assert_close(fit.terms[i].value, TERMS[i], 4.0 * fit.terms[i].sigma);
            assert_true(fit.terms[i].sigma > 1e-5 && fit.terms[i].sigma < 0.01);
        }
        assert_true(fit.significance > 5.0);
        /* the relative change of the signal at half the well, in closed form */
        double u = 0.5, r = 1.0 + u * (TERMS[0] + u * (TERMS[1] + u * TERMS[2]));
        double bend = 1.0 + u * (2.0 * TERMS[0] + u * (3.0 * TERMS[1] + u * 4.0 * TERMS[2]));
        bst_assert_close(bst_linearity_slope(&fit, u * WELL / GAIN * r), bend / r, 1e-3);
    }
    /* a converter that is full before the pixels: no full well, and no terms in its unit */
    make_series(points, &s, 14.0, 15000.0, 0.0);
    bst_linearity_fit(&s, dark_of_series(), header, &fit);
    assert_true(fit.saturates && fit.of_converter);
    bst_assert_close(fit.saturation_dn.value, 15000.0, 1e-6);
    assert_true(isnan(fit.full_well_e.value) && isnan(fit.terms[0].value));
    bst_assert_close(fit.gain_e_per_dn.value, GAIN, 4.0 * fit.gain_e_per_dn.sigma);
    /* nothing saturates */
    make_series(points, &s, 8.0, INFINITY, 0.0);
    bst_linearity_fit(&s, dark_of_series(), header, &fit);
    assert_true(!fit.saturates && isnan(fit.full_well_e.value) && isnan(fit.saturation_dn.value));
    assert_int_equal(fit.used, POINTS);
    double u = 0.8;
    bst_assert_close(fit.error.value, u * (TERMS[0] + u * (TERMS[1] + u * TERMS[2])),
                     4.0 * fit.error.sigma);
}

/* Noise whose neighbours along a row have a correlation of 0.4, a ramp over the rows, hot pixels.
 */
static void statistics_of_a_frame(void **state) {
    (void)state;
    enum { W = 300, H = 200 };
    bst_ctx ctx = {0};
    static float image[W * H];
    bst_frame_statistics s;
    for (int i = 0; i < W * H; i++) {
        double e = bst_rng_normal(KEY, (uint64_t)i, 30),
               before = bst_rng_normal(KEY, (uint64_t)i - 1, 30);
        image[i] = (float)(1000.0 + 4.0 * (e + 0.5 * before) + 0.02 * (i / W));
        image[i] += i % 997 == 0 ? 5000.0F : 0.0F;
    }
    image[7] = NAN;
    bst_assert_ok(&ctx, bst_frame_statistics_of(&ctx, image, W, H, &s));
    /* of 60,000 values: 0.4 % of the correlation, five standard errors; hot pixels are 0.1 % and
     * limited to five standard deviations, 2.5 % of the variance */
    bst_assert_close(s.along_rows[0], 0.4, 0.035);
    bst_assert_close(s.along_rows[1], 0.0, 0.03);
    bst_assert_close(s.along_columns[0], 0.0, 0.03);
    bst_assert_close(s.along_columns[9], 0.0, 0.03); /* no ramp */
    const double variance = 20.0;
    double window = 1.0 - 6.0 / (49.0 * 49.0) * (1.0 - 1.0 / 49.0);
    /* the sum of 48 correlations within Parzen's window: 15 % of the power, four standard errors */
    bst_assert_close(s.spectrum[0], variance * (1.0 + 0.8 * window), 0.15 * 36.0);
    bst_assert_close(s.spectrum[BST_COMPARISON_BANDS - 1], variance * (1.0 - 0.8 * window), 2.0);
    bst_assert_close(bst_comparison_frequency(BST_COMPARISON_BANDS - 1), 0.5, 1e-15);
    /* a normal law with the ramp of 4 DN: 16th percentile one standard deviation below the median
     */
    double sigma = sqrt(variance + 16.0 / 12.0);
    bst_assert_close(s.percentiles_dn[1], -sigma, 0.15);
    bst_assert_close(s.percentiles_dn[2], 0.0, 1e-6);
    bst_assert_close(s.median_dn, 1002.0, 0.15);
    assert_true(s.percentiles_dn[7] > 4900.0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(law_of_hits),
        cmocka_unit_test(hits_of_a_pair),
        cmocka_unit_test(linearity_and_full_well),
        cmocka_unit_test(statistics_of_a_frame),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
