/* Figures of dark frames with known contents: ramps of both directions, shielded columns, hot
 * pixels, percentiles. The sensor is no square. */
#include "boresight/rng.h"
#include "boresight/vec.h"
#include "sim/analysis/characterize/sensor_figures.h"
#include "tests/test_support.h"

enum { WIDTH = 96, HEIGHT = 72, PIXELS = WIDTH * HEIGHT, BIASES = 10, DARKS = 5 };
/* Dark signal and its noise in the mean of the frames, DN; electrons per DN; exposure. */
static const double SIGNAL = 50.0, GAIN = 2.0, EXPOSURE_S = 40.0, NOISE2 = 9.0;

static float bias_mean[PIXELS], dark_mean[PIXELS], last[PIXELS];
static double levels[BIASES];

static double draw(int i, uint64_t stream) {
    return bst_rng_normal((bst_rng_key){{18, 9}}, stream, (uint64_t)i);
}

static bst_sensor_stacks make(void) {
    bst_sensor_stacks s = {.bias = {.count = BIASES,
                                    .width = WIDTH,
                                    .height = HEIGHT,
                                    .gain_e_per_dn = GAIN,
                                    .levels = levels,
                                    .mean = bias_mean,
                                    .last = last,
                                    .pairs = BIASES / 2}};
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        s.bias.variance[k] = NOISE2;
    }
    for (int i = 0; i < BIASES; i++) {
        levels[i] = 300.0 + 0.2 * draw(i, 5);
    }
    s.dark = s.bias;
    s.dark.count = DARKS;
    s.dark.pairs = DARKS / 2;
    s.dark.exposure_s = EXPOSURE_S;
    s.dark.mean = dark_mean;
    double noise = sqrt(NOISE2 / BIASES), dark = sqrt((NOISE2 + SIGNAL / GAIN) / DARKS);
    for (int i = 0; i < PIXELS; i++) {
        bias_mean[i] = (float)(300.0 + noise * draw(i, 1));
        last[i] = (float)(300.0 + 3.0 * draw(i, 2));
        dark_mean[i] = (float)(300.0 + SIGNAL * (1.0 + 0.04 * draw(i, 3)) + dark * draw(i, 4));
    }
    return s;
}

/* Charge that rows gather until they are read: 12 DN from the row that is read first, which has the
 * exposure's alone, to the last one. */
static void ramps_of_both_directions(void **state) {
    (void)state;
    const double ramp = 12.0;
    for (int last_first = 0; last_first < 2; last_first++) {
        bst_ctx ctx = {0};
        bst_sensor_figures f;
        bst_sensor_stacks s = make();
        for (int i = 0; i < PIXELS; i++) {
            int y = i / WIDTH, rows = last_first ? HEIGHT - 1 - y : y;
            dark_mean[i] += (float)(ramp * rows / (HEIGHT - 1));
            dark_mean[i] += y == 40 ? 300.0F : 0.0F; /* a row that is left out of the line */
        }
        bst_assert_ok(&ctx, bst_sensor_figures_compute(&ctx, &s, &f));
        const bst_sensor_estimate *r = &f.figures[BST_SENSOR_RAMP];
        bst_assert_close(r->value, last_first ? -ramp : ramp, 5.0 * r->sigma);
        /* medians of 96 pixels: 1.25 x 3.5 / sqrt 96 is 0.45 in each of 72 rows, of a line */
        bst_assert_close(r->sigma, 0.45 * sqrt(12.0 / HEIGHT), 0.06);
        const bst_sensor_estimate *d = &f.figures[BST_SENSOR_DARK];
        bst_assert_close(d->value, SIGNAL * GAIN / EXPOSURE_S, 0.012); /* the ramp's 0.2 DN */
        /* the ramp over the charge of a pixel's dark current in the time of a row */
        const bst_sensor_estimate *t = &f.figures[BST_SENSOR_READOUT];
        double want = ramp / (HEIGHT - 1) * HEIGHT * EXPOSURE_S / (SIGNAL + 300.0 / HEIGHT);
        bst_assert_close(t->value, want, 0.05 * want); /* 5 sigma of the ramp, 2 % */
        bst_sensor_figures_free(&f);
    }
}

/* Columns without dark signal at both sides have no part in it. */
static void shielded_columns_are_left_out(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_sensor_figures f;
    bst_sensor_stacks s = make();
    for (int i = 0; i < PIXELS; i++) {
        int x = i % WIDTH;
        if (x < 4 || x >= WIDTH - 7) {
            dark_mean[i] -= 50.0F;
        }
        dark_mean[i] -= x == 30 ? 11.0F : x == 31 ? 15.0F : 0.0F; /* 78 and 70 % of the others */
    }
    bst_assert_ok(&ctx, bst_sensor_figures_compute(&ctx, &s, &f));
    assert_int_equal(f.shielded_columns, 12);
    /* 84 of 96 columns, one of them lower by 11: 0.13 DN */
    const bst_sensor_estimate *d = &f.figures[BST_SENSOR_DARK];
    bst_assert_close(d->value, (SIGNAL - 11.0 / 84.0) * GAIN / EXPOSURE_S, 0.01);
    bst_assert_close(f.figures[BST_SENSOR_DARK_MEDIAN].value, SIGNAL * GAIN / EXPOSURE_S, 0.015);
    assert_true(isnan(f.figures[BST_SENSOR_RAMP].value));
    assert_true(isnan(f.figures[BST_SENSOR_READOUT].value));
    bst_sensor_figures_free(&f);
}

/* A hundredth of the pixels has a dark current of its own, normal in its logarithm. */
static void hot_pixels_by_their_law(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_sensor_figures f;
    bst_sensor_stacks s = make();
    int hot = 0, above = 0;
    for (int i = 7; i < PIXELS; i += 41) { /* 169, beside no other one */
        dark_mean[i] += (float)(1500.0 * pow(10.0, 0.25 * draw(i, 8)));
        hot++;
        above += 0.25 * draw(i, 8) > 0.0;
    }
    assert_true(abs(2 * above - hot) < 30);
    bst_assert_ok(&ctx, bst_sensor_figures_compute(&ctx, &s, &f));
    double per_s = GAIN / EXPOSURE_S;
    /* its sampling errors, four standard ones: 0.25 / sqrt 169 dex, and that over sqrt 2 */
    bst_assert_close(log10(f.figures[BST_SENSOR_HOT_MEDIAN].value / (1500.0 * per_s)), 0.0, 0.08);
    bst_assert_close(f.figures[BST_SENSOR_HOT_SPREAD].value, 0.25, 0.055);
    bst_assert_close(f.figures[BST_SENSOR_HOT_FRACTION].value, (double)hot / PIXELS,
                     0.01 * hot / PIXELS);
    assert_int_equal(f.hot_found, hot);
    /* the core's mean and five of its standard deviations: 2 of DSNU, 2.8 of noise */
    double limit = (SIGNAL + 5.0 * (2.0 + sqrt(NOISE2 / BIASES + (NOISE2 + 25.0) / DARKS))) * per_s;
    assert_true(f.hot_limit_e_per_s > SIGNAL * per_s && f.hot_limit_e_per_s < 1.3 * limit);
    const bst_sensor_estimate *d = &f.figures[BST_SENSOR_DARK];
    bst_assert_close(d->value, SIGNAL * per_s, 0.01);
    bst_assert_close(f.figures[BST_SENSOR_DSNU].value, 0.04, 0.008);
    bst_sensor_figures_free(&f);
}

/* Without darks, or without bias frames, each figure of them says so; with both none
 * does. */
static void what_is_missing_is_said(void **state) {
    (void)state;
    static const int of_darks[9] = {
        BST_SENSOR_DARK,         BST_SENSOR_DARK_MEDIAN,    BST_SENSOR_DSNU,
        BST_SENSOR_HOT_FRACTION, BST_SENSOR_HOT_MEDIAN,     BST_SENSOR_HOT_SPREAD,
        BST_SENSOR_READOUT,      BST_SENSOR_PARALLEL_TRAIL, BST_SENSOR_SERIAL_TRAIL};
    for (int n = 0; n < 4; n++) {
        bst_ctx ctx = {0};
        bst_sensor_figures f;
        bst_sensor_stacks s = make();
        s.dark.count = n == 1 ? 0 : s.dark.count;
        s.dark.exposure_s = n == 2 ? 0.0 : s.dark.exposure_s;
        s.bias.count = n == 3 ? 0 : s.bias.count;
        bst_assert_ok(&ctx, bst_sensor_figures_compute(&ctx, &s, &f));
        for (int i = 0; i < BST_SENSOR_FIGURES; i++) {
            assert_non_null(f.method[i]);
        }
        for (int i = 0; i < 9; i++) {
            const int k = of_darks[i];
            bool said = strncmp(f.method[k], "not determined: needs darks", 27) == 0;
            assert_int_equal(said, n > 0);
            assert_true(n == 0 || isnan(f.figures[k].value));
        }
        bst_sensor_figures_free(&f);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ramps_of_both_directions), cmocka_unit_test(shielded_columns_are_left_out),
        cmocka_unit_test(hot_pixels_by_their_law), cmocka_unit_test(what_is_missing_is_said)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
