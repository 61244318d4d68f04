/* Figures of a sensor from frames that are reduced already: noise, level with ramp and drift,
 * offsets, gain and response, each by sums of its own; the sensor is no square. */
#include "boresight/rng.h"
#include "boresight/vec.h"
#include "sim/analysis/characterize/sensor_figures.h"
#include "tests/test_support.h"

enum { WIDTH = 96, HEIGHT = 72, PIXELS = WIDTH * HEIGHT, BIASES = 10, FLATS = 8 };

static float bias_mean[PIXELS], flat_mean[PIXELS], last[PIXELS];
static double levels[BIASES], columns[WIDTH], rows[HEIGHT];

static double draw(int i, uint64_t stream) {
    return bst_rng_normal((bst_rng_key){{8, 9}}, stream, (uint64_t)i);
}

static bst_sensor_stacks make(double ramp) {
    for (int x = 0; x < WIDTH; x++) {
        columns[x] = 0.8 * draw(x, 1);
    }
    for (int y = 0; y < HEIGHT; y++) {
        rows[y] = ramp * y / (HEIGHT - 1) + 0.4 * draw(y, 2);
    }
    for (int i = 0; i < PIXELS; i++) {
        int x = i % WIDTH, y = i / WIDTH;
        bias_mean[i] = (float)(300.0 + columns[x] + rows[y]);
        double light = 4000.0 * (1.0 + 0.001 * x - 0.0005 * y) * (1.0 + 0.01 * draw(i, 3));
        flat_mean[i] = bias_mean[i] + (float)light;
        last[i] = bias_mean[i] + (float)draw(i, 4);
    }
    bst_sensor_stacks s = {.bias = {.count = BIASES,
                                    .width = WIDTH,
                                    .height = HEIGHT,
                                    .gain_e_per_dn = 2.0,
                                    .levels = levels,
                                    .mean = bias_mean,
                                    .last = last,
                                    .pairs = BIASES / 2,
                                    .row_variance = 0.3},
                           .flat = {.count = FLATS,
                                    .width = WIDTH,
                                    .height = HEIGHT,
                                    .gain_e_per_dn = 2.0,
                                    .exposure_s = 1.0,
                                    .levels = levels,
                                    .mean = flat_mean,
                                    .last = last,
                                    .pairs = FLATS / 2,
                                    .row_variance = 0.5}};
    for (int i = 0; i < BIASES; i++) {
        levels[i] = 300.0 + 0.7 * i + 0.2 * draw(i, 5);
    }
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        s.bias.variance[k] = 9.0 + 0.5 * (k % 3);
        s.flat.variance[k] = s.bias.variance[k] + 4000.0 / 1.6 * (1.0 + 0.02 * draw(k, 6));
    }
    return s;
}

/* Line through values: its slope for each step and the squared standard error. */
static double line(const double *v, int n, double *error2) {
    double t = 0.0, tt = 0.0, m = 0.0, tv = 0.0, rest = 0.0;
    for (int i = 0; i < n; i++) {
        t += (double)i / n;
        m += v[i] / n;
    }
    for (int i = 0; i < n; i++) {
        tt += (i - t) * (i - t);
        tv += (i - t) * (v[i] - m);
    }
    for (int i = 0; i < n; i++) {
        rest += pow(v[i] - m - tv / tt * (i - t), 2.0);
    }
    *error2 = rest / (n - 2) / tt;
    return tv / tt;
}

static double variance_of(const double *v, int n) {
    double m = 0.0, sum = 0.0;
    for (int i = 0; i < n; i++) {
        m += v[i] / n;
    }
    for (int i = 0; i < n; i++) {
        sum += (v[i] - m) * (v[i] - m) / (n - 1);
    }
    return sum;
}

static double mean_of(const double *v, int n) {
    double m = 0.0;
    for (int i = 0; i < n; i++) {
        m += v[i] / n;
    }
    return m;
}

static void noise_and_level(void **state) {
    (void)state;
    static const double ramps[] = {0.0, 6.0, -6.0};
    for (int k = 0; k < 3; k++) {
        bst_ctx ctx = {0};
        bst_sensor_stacks s = make(ramps[k]);
        s.flat.count = s.flat.pairs = 0;
        bst_sensor_figures f;
        bst_assert_ok(&ctx, bst_sensor_figures_compute(&ctx, &s, &f));
        const bst_sensor_estimate *e = f.figures;
        double v = mean_of(s.bias.variance, BST_STACK_BLOCKS), error2;
        bst_assert_close(e[BST_SENSOR_READ_NOISE].value, 2.0 * sqrt(v), 1e-9);
        bst_assert_close(e[BST_SENSOR_READ_NOISE].sigma,
                         2.0 * sqrt(variance_of(s.bias.variance, 64) / 64.0) / (2.0 * sqrt(v)),
                         1e-9);
        bst_assert_close(e[BST_SENSOR_ROW_NOISE].value, 2.0 * sqrt(0.3), 1e-9);
        /* of 71 degrees of freedom in each of five pairs */
        bst_assert_close(e[BST_SENSOR_ROW_NOISE].sigma,
                         2.0 * sqrt(2.0 / 71.0 / 5.0) * (0.3 + v / WIDTH) / (2.0 * sqrt(0.3)),
                         1e-9);
        double column = variance_of(columns, WIDTH) - v / BIASES / HEIGHT;
        bst_assert_close(e[BST_SENSOR_COLUMN_OFFSET].value, 2.0 * sqrt(column), 1e-4);
        double rest[HEIGHT], slope = line(rows, HEIGHT, &error2);
        bool ramp = ramps[k] != 0.0;
        for (int y = 0; y < HEIGHT; y++) {
            rest[y] = rows[y] - (ramp ? slope * y : 0.0);
        }
        double row = variance_of(rest, HEIGHT) - v / BIASES / WIDTH - 0.3 / BIASES;
        bst_assert_close(e[BST_SENSOR_ROW_OFFSET].value, 2.0 * sqrt(row), 1e-4);
        double level = 300.0 + mean_of(columns, WIDTH) + mean_of(rows, HEIGHT);
        if (ramp) {
            bst_assert_close(e[BST_SENSOR_RAMP].value, slope * (HEIGHT - 1), 1e-4);
            bst_assert_close(e[BST_SENSOR_RAMP].sigma, sqrt(error2) * (HEIGHT - 1), 1e-4);
            level -= 0.5 * fabs(slope) * (HEIGHT - 1); /* of the row that is read first */
        } else {
            assert_true(isnan(e[BST_SENSOR_RAMP].value));
        }
        bst_assert_close(e[BST_SENSOR_OFFSET].value, level, 1e-3);
        bst_assert_close(e[BST_SENSOR_OFFSET_DRIFT].value, line(levels, BIASES, &error2), 1e-9);
        bst_assert_close(e[BST_SENSOR_OFFSET_DRIFT].sigma, sqrt(error2), 1e-9);
        bst_assert_close(e[BST_SENSOR_GAIN].value, 2.0, 0.0);
        assert_true(f.gain_of_header && f.noise_of_pairs);
        bst_sensor_figures_free(&f);
    }
    /* whole numbers: their rounding is no read noise */
    bst_ctx ctx = {0};
    bst_sensor_stacks s = make(0.0);
    bst_sensor_figures f;
    s.flat.count = s.flat.pairs = 0;
    s.bias.integer = true;
    bst_assert_ok(&ctx, bst_sensor_figures_compute(&ctx, &s, &f));
    bst_assert_close(f.figures[BST_SENSOR_READ_NOISE].value,
                     2.0 * sqrt(mean_of(s.bias.variance, 64) - 1.0 / 12.0), 1e-9);
    bst_sensor_figures_free(&f);
}

/* Mean and variance of a map in a block. */
static void block_of(const double *map, int k, double *mean, double *variance) {
    double v[12 * 9];
    for (int i = 0; i < 12 * 9; i++) {
        int x = 12 * (k % 8) + i % 12, y = 9 * (k / 8) + i / 12;
        v[i] = map[y * WIDTH + x];
    }
    *mean = mean_of(v, 12 * 9);
    *variance = variance_of(v, 12 * 9);
}

static void gain_and_response(void **state) {
    (void)state;
    static double light[PIXELS], response[PIXELS];
    bst_ctx ctx = {0};
    bst_sensor_stacks s = make(0.0);
    bst_sensor_figures f;
    bst_assert_ok(&ctx, bst_sensor_figures_compute(&ctx, &s, &f));
    double charge[64], excess[64], a = 0.0, b = 0.0, rest = 0.0, ignored;
    for (int i = 0; i < PIXELS; i++) {
        light[i] = (double)flat_mean[i] - (double)bias_mean[i];
    }
    for (int k = 0; k < 64; k++) {
        block_of(light, k, &charge[k], &ignored);
        excess[k] = s.flat.variance[k] - s.bias.variance[k];
        a += charge[k];
        b += excess[k];
    }
    for (int k = 0; k < 64; k++) { /* the jackknife */
        double d = (a - charge[k]) / (b - excess[k]) - a / b;
        rest += d * d * 63.0 / 64.0;
    }
    const bst_sensor_estimate *gain = &f.figures[BST_SENSOR_GAIN];
    bst_assert_close(gain->value, a / b, 1e-5);
    bst_assert_close(gain->sigma, sqrt(rest), 1e-3 * sqrt(rest));
    bst_assert_close(gain->value, 1.6, 0.1);
    assert_false(f.gain_of_header);
    /* other figures by this gain, with its error */
    double v = mean_of(s.bias.variance, 64),
           own = sqrt(variance_of(s.bias.variance, 64) / 64.0 / v);
    bst_assert_close(f.figures[BST_SENSOR_READ_NOISE].value, gain->value * sqrt(v), 1e-6);
    bst_assert_close(f.figures[BST_SENSOR_READ_NOISE].sigma,
                     hypot(0.5 * own * gain->value, sqrt(v) * gain->sigma), 1e-6);
    /* scatter in blocks, less the noise of both means */
    double prnu[64];
    for (int i = 0; i < PIXELS; i++) {
        int k = i % WIDTH / 12 + 8 * (i / WIDTH / 9);
        response[i] = light[i] / charge[k];
        bst_assert_close(f.prnu_map[i], response[i], 1e-5);
    }
    double flats = (mean_of(s.flat.variance, 64) + 0.5) / FLATS, biases = (v + 0.3) / BIASES;
    for (int k = 0; k < 64; k++) {
        block_of(response, k, &ignored, &prnu[k]);
        prnu[k] -= (flats + biases) / (charge[k] * charge[k]);
    }
    bst_assert_close(f.figures[BST_SENSOR_PRNU].value, sqrt(mean_of(prnu, 64)), 1e-6);
    bst_assert_close(f.figures[BST_SENSOR_DEAD_FRACTION].value, 0.0, 0.0);
    bst_sensor_figures_free(&f);
}

static void dead_pixels_and_columns(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_sensor_stacks s = make(0.0);
    bst_sensor_figures f;
    for (int y = 0; y < HEIGHT; y++) { /* from either end; and too short for a column */
        for (int x = 0; x < WIDTH; x++) {
            bool dead = (x == 30 && y >= 40) || (x == 71 && y < 9) || (x == 50 && y < 7) ||
                        (x == 12 && y > 20 && y < 25);
            int i = y * WIDTH + x;
            flat_mean[i] = dead ? bias_mean[i] : flat_mean[i];
        }
    }
    bst_assert_ok(&ctx, bst_sensor_figures_compute(&ctx, &s, &f));
    bst_assert_close(f.figures[BST_SENSOR_BAD_COLUMNS].value, 2.0, 0.0);
    double good = (WIDTH - 2.0) * HEIGHT;
    bst_assert_close(f.figures[BST_SENSOR_DEAD_FRACTION].value, 11.0 / good, 1e-12);
    bst_assert_close(f.figures[BST_SENSOR_DEAD_FRACTION].sigma, sqrt(11.0) / good, 1e-12);
    bst_sensor_figures_free(&f);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(noise_and_level),
        cmocka_unit_test(gain_and_response),
        cmocka_unit_test(dead_pixels_and_columns),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
