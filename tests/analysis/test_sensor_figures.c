/* Figures of a sensor from frames that are reduced already: noise, level with ramp and drift,
 * offsets, gain and response, each by sums of its own; the sensor is no square. */
#include <cjson/cJSON.h>

#include "boresight/rng.h"
#include "boresight/vec.h"
#include "sim/analysis/characterize/characterize.h"
#include "sim/analysis/characterize/sensor_figures.h"
#include "tests/io/scratch.h"
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
            /* hot pixels at the end and in the middle do not hide a column */
            bool dead = (x == 30 && y >= 40 && y != HEIGHT - 1 && y != HEIGHT - 25) ||
                        (x == 71 && y < 9) || (x == 50 && y < 7) || (x == 12 && y > 20 && y < 25);
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

static cJSON *read_json(scratch *s, const char *name) {
    static char text[65536];
    FILE *file = fopen(scratch_path(s, name), "r");
    assert_non_null(file);
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    cJSON *root = cJSON_Parse(text);
    assert_non_null(root);
    return root;
}

/* Number at a path of keys, of which the last may be that of an array's element; NAN: null. */
static double at(const cJSON *node, const char *const *keys) {
    for (; *keys; keys++) {
        const cJSON *next = cJSON_IsArray(node) ? cJSON_GetArrayItem(node, atoi(*keys))
                                                : cJSON_GetObjectItemCaseSensitive(node, *keys);
        if (!next) {
            fail_msg("there is no %s", *keys);
        }
        node = next;
    }
    return cJSON_IsNull(node) ? NAN : cJSON_IsBool(node) ? cJSON_IsTrue(node) : node->valuedouble;
}
#define AT(node, ...) at(node, (const char *const[]){__VA_ARGS__, NULL})
#define CAMERA "/observers/1/sensors/2/camera"
#define OF(set, key) cJSON_GetObjectItemCaseSensitive(set, CAMERA "/" key)

/* Figures that all differ; every third is not significant, the ramp is negative. */
static bst_sensor_figures written_figures(void) {
    bst_sensor_figures f = {.width = 3,
                            .height = 2,
                            .shielded_columns = 7,
                            .hot_found = 321,
                            .hot_limit_e_per_s = 45.5,
                            .trap_misfit = {0.011, 0.022}};
    for (int i = 0; i < BST_SENSOR_FIGURES; i++) {
        f.figures[i].value = 10.0 + i;
        f.figures[i].sigma = i % 3 == 2 ? 0.51 * f.figures[i].value : 0.49 * f.figures[i].value;
        f.method[i] = "as the test has it";
    }
    f.figures[BST_SENSOR_READ_NOISE].value = 30.0;
    f.figures[BST_SENSOR_GAIN].value = 2.5;
    f.figures[BST_SENSOR_LINE_FREQUENCY].value = 0.13;
    f.figures[BST_SENSOR_RAMP].value = -40.0;
    f.figures[BST_SENSOR_DSNU].sigma = NAN;
    f.figures[BST_SENSOR_PRNU].value = NAN;
    for (int i = 0; i < BST_SENSOR_PERCENTILES; i++) {
        f.percentiles_e_per_s[i] = NAN; /* no plot */
    }
    f.line = (bst_pick_up_line){.found = true, .phase_deg = 77.0, .pair_power = 3.0};
    f.linearity = (bst_linearity){
        .used = 9, .significance = 3.0, .terms = {{-0.03, 0.01}, {0.02, 0.02}, {-0.01, 0.03}}};
    f.trail = (bst_charge_trail){.used = 60, .parallel = {0.1, 0.01}, .serial_right = true};
    for (int c = 0; c < BST_TRAIL_CLASSES; c++) {
        f.trail.class_charge[c] = 100.0 + c;
        f.trail.class_parallel[c] = 0.1 + 0.01 * c;
        f.trail.class_serial[c] = 0.2 + 0.01 * c;
        for (int k = 0; k < BST_TRAIL_PIXELS; k++) {
            f.trail.profile[c][k] = c + 0.1 * k;
        }
    }
    f.traps = (bst_trap_model){.parallel = {{1, 2, 3}, {4, 5, 6}, 0.5, 1e4},
                               .serial = {{7, 8, 9}, {1.5, 2.5, 3.5}, 0.25, 2e4},
                               .right = true};
    return f;
}

/* Both files of the figures: intervals, what is not significant, and the noise that stays as read
 * noise when pick-up and the charge of the read-out have keys of their own. */
static void files_of_the_figures(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    scratch s;
    scratch_make(&s);
    const bst_characterize_request request = {.out = s.folder, .camera = CAMERA};
    bst_sensor_stacks stacks = {.bias = {.count = 4},
                                .dark = {.count = 5, .exposure_s = 12.5},
                                .flat = {.count = 6},
                                .pixel_pitch_um = 9.0};
    bst_sensor_figures f = written_figures();
    bst_characterize_comparison comparison = {.made = true, .kind = "dark"};
    comparison.real.percentiles_dn[7] = 812.0;
    comparison.simulated.percentiles_dn[7] = 900.5;
    comparison.real.along_columns[2] = 0.25;
    comparison.simulated.spectrum[BST_COMPARISON_BANDS - 1] = 17.0;
    for (int pairs = 0; pairs < 2; pairs++) {
        f.noise_of_pairs = pairs;
        f.line.locked = pairs;
        f.linearity.significance = pairs ? 3.0 : 1.9;
        bst_assert_ok(&ctx, bst_characterize_write(&ctx, &request, &stacks, &f, &comparison));
        cJSON *root = read_json(&s, "detector.json");
        const cJSON *set = cJSON_GetObjectItem(root, "set");
        double line = f.figures[BST_SENSOR_LINE_AMPLITUDE].value, sum = 0.0;
        for (int k = 0; k < 1000; k++) { /* half of the mean square of differences of neighbours */
            double d =
                line * (sin(2.0 * BST_PI * (0.13 + k / 1000.0)) - sin(2.0 * BST_PI * k / 1000.0));
            sum += 0.5 * d * d / 1000.0;
        }
        /* pairs: the line's power in DN^2, and shot noise of 0 to 100 e- over the rows */
        double rest = pairs ? 900.0 - 3.0 * 2.5 * 2.5 - 50.0 : 900.0 - sum;
        bst_assert_close(OF(set, "read_noise_e")->valuedouble, sqrt(rest), 1e-9);
        bst_assert_close(OF(set, "offset_dn")->valuedouble, 12.0, 0.0); /* not of the detector */
        bst_assert_close(OF(set, "dark_current_e_per_s")->valuedouble, 17.0, 0.0);
        bst_assert_close(OF(set, "detector/row_noise_e")->valuedouble, 14.0 * (4 % 3 != 2), 0.0);
        bst_assert_close(OF(set, "detector/column_offset_rms_e")->valuedouble, 0.0, 0.0);
        bst_assert_close(OF(set, "detector/hot_median_e_per_s")->valuedouble, 0.0, 0.0);
        bst_assert_close(OF(set, "detector/hot_spread_dex")->valuedouble, 22.0, 0.0);
        assert_null(OF(set, "detector/dsnu_rms")); /* of an unknown error */
        assert_null(OF(set, "detector/prnu_rms"));
        assert_true(cJSON_IsFalse(OF(set, "detector/output/top")));
        assert_true(cJSON_IsTrue(OF(set, "detector/output/right")));
        bst_assert_close(AT(OF(set, "detector/parallel_traps"), "release_px", "2"), 6.0, 0.0);
        bst_assert_close(AT(OF(set, "detector/serial_traps"), "traps_per_px", "1"), 8.0, 0.0);
        bst_assert_close(AT(OF(set, "detector/serial_traps"), "fill_exponent"), 0.25, 0.0);
        /* all terms of a curve that differs from a line, none otherwise */
        bst_assert_close(AT(OF(set, "detector/nonlinearity"), "1"), pairs ? 0.02 : 0.0, 1e-15);
        bst_assert_close(AT(OF(set, "detector/nonlinearity"), "2"), pairs ? -0.01 : 0.0, 1e-15);
        bst_assert_close(OF(set, "full_well_e")->valuedouble, 10.0 + BST_SENSOR_FULL_WELL, 0.0);
        bst_assert_close(OF(set, "detector/cosmic_rays/pixel_pitch_um")->valuedouble, 9.0, 0.0);
        const cJSON *phase = OF(set, "detector/pick_up/phase_deg");
        assert_true(pairs ? phase && phase->valuedouble == 77.0 : !phase);
        cJSON_Delete(root);
    }
    cJSON *report = read_json(&s, "report.json");
    bst_assert_close(AT(report, "frames", "bias"), 4, 0.0);
    bst_assert_close(AT(report, "frames", "dark"), 5, 0.0);
    bst_assert_close(AT(report, "frames", "flat"), 6, 0.0);
    bst_assert_close(AT(report, "frames", "dark_exposure_s"), 12.5, 0.0);
    for (int i = 0; i < BST_SENSOR_FIGURES; i++) {
        const bst_sensor_estimate *e = &f.figures[i];
        const char *key = bst_sensor_figure_names[i].key;
        if (isfinite(e->value) && isfinite(e->sigma)) {
            bst_assert_close(AT(report, "figures", key, "value"), e->value, 0.0);
            bst_assert_close(AT(report, "figures", key, "standard_error"), e->sigma, 1e-12);
            /* Student's t with 20 degrees of freedom: 2.086 */
            double low = AT(report, "figures", key, "low_95"),
                   high = AT(report, "figures", key, "high_95"), reach = 2.086 * e->sigma;
            if (i >= BST_SENSOR_HIT_RATE && i <= BST_SENSOR_HIT_STRAGGLING) { /* of the logarithm */
                bst_assert_close(log(e->value / low), reach / e->value, 5e-3 * reach / e->value);
                bst_assert_close(log(high / e->value), reach / e->value, 5e-3 * reach / e->value);
            } else {
                bst_assert_close(low, e->value - reach, 5e-3 * e->sigma);
                bst_assert_close(high, e->value + reach, 5e-3 * e->sigma);
            }
        }
    }
    bst_assert_close(AT(report, "shielded_columns"), 7, 0.0);
    const cJSON *both = cJSON_GetObjectItem(report, "reproduction");
    bst_assert_close(AT(both, "percentiles_over_median_dn", "7", "real"), 812.0, 0.0);
    bst_assert_close(AT(both, "percentiles_over_median_dn", "7", "simulated"), 900.5, 0.0);
    bst_assert_close(AT(both, "percentiles_over_median_dn", "7", "percentile"), 99.99, 1e-12);
    bst_assert_close(AT(both, "correlation_along_columns", "2", "real"), 0.25, 0.0);
    bst_assert_close(AT(both, "correlation_along_columns", "2", "distance_px"), 3.0, 0.0);
    bst_assert_close(AT(both, "power_along_rows_dn2_px", "24", "simulated"), 17.0, 0.0);
    bst_assert_close(AT(both, "power_along_rows_dn2_px", "24", "cycles_per_px"), 0.5, 1e-12);
    bst_assert_close(AT(report, "hot_pixels"), 321, 0.0);
    bst_assert_close(AT(report, "pick_up", "power_in_pairs_e2"), 3.0 * 6.25, 1e-12);
    static const char *const sides[] = {"rows_above", "rows_below", "columns_right",
                                        "columns_left"};
    const cJSON *trail = cJSON_GetObjectItem(report, "charge_trail");
    assert_string_equal(cJSON_GetObjectItem(trail, "parallel_direction")->valuestring,
                        "rows_below");
    assert_string_equal(cJSON_GetObjectItem(trail, "serial_direction")->valuestring,
                        "columns_right");
    for (int c = 0; c < BST_TRAIL_CLASSES; c++) {
        const char index[2] = {(char)('0' + c), '\0'};
        bst_assert_close(AT(trail, "by_charge", index, "charge_dn"), 100.0 + c, 0.0);
        bst_assert_close(AT(trail, "by_charge", index, "parallel"), 0.1 + 0.01 * c, 1e-12);
        bst_assert_close(AT(trail, "by_charge", index, "serial"), 0.2 + 0.01 * c, 1e-12);
        bst_assert_close(AT(trail, sides[c], "3"), c + 0.3, 1e-12);
    }
    bst_assert_close(AT(trail, "parallel_traps", "misfit_rms"), 0.011, 0.0);
    bst_assert_close(AT(trail, "serial_traps", "misfit_rms"), 0.022, 0.0);
    cJSON_Delete(report);
    scratch_remove(&s);
}

/* Rows of a dark that differ by 1.5 times the noise common to a row are no scatter of the pixels,
 * and count in the error of the mean. */
static void dark_current_beside_noise_of_rows(void **state) {
    (void)state;
    static float dark_mean[PIXELS];
    bst_ctx ctx = {0};
    bst_sensor_stacks s = make(0.0);
    s.flat.count = s.flat.pairs = 0;
    s.bias.row_variance = 4.0;
    s.dark = s.bias;
    s.dark.exposure_s = 1.0;
    s.dark.mean = dark_mean;
    double rows2 = 4.0 * 2.0 / BIASES; /* of darks less bias frames */
    double noise2 = mean_of(s.bias.variance, BST_STACK_BLOCKS) * 2.0 / BIASES;
    double shot2 = 20.0 / 2.0 / BIASES;
    for (int i = 0; i < PIXELS; i++) {
        double signal = 20.0 * (1.0 + 0.05 * draw(i, 7)) + sqrt(noise2 + shot2) * draw(i, 8);
        dark_mean[i] = bias_mean[i] + (float)(signal + 1.5 * sqrt(rows2) * draw(i / WIDTH, 9));
    }
    bst_sensor_figures f;
    bst_assert_ok(&ctx, bst_sensor_figures_compute(&ctx, &s, &f));
    /* variance 3.9 of 6,912 pixels: 0.07 of 1, four standard errors; 0.07 if rows were not levelled
     */
    bst_assert_close(f.figures[BST_SENSOR_DSNU].value, 0.05, 0.007);
    double least = 2.0 * sqrt(rows2 / HEIGHT);
    assert_true(f.figures[BST_SENSOR_DARK].sigma > least);
    assert_true(f.figures[BST_SENSOR_DARK].sigma < 2.0 * least);
    bst_sensor_figures_free(&f);
}

/* Hot pixels, 2 % of all, show another response: they lie elsewhere on a bent one. */
static void response_beside_hot_pixels(void **state) {
    (void)state;
    static float dark_mean[PIXELS];
    double found[2];
    for (int k = 0; k < 2; k++) {
        bst_ctx ctx = {0};
        bst_sensor_stacks s = make(0.0);
        s.dark = s.bias;
        s.dark.exposure_s = s.flat.exposure_s;
        s.dark.mean = dark_mean;
        for (int i = 0; i < PIXELS; i++) {
            bool hot = k > 0 && i % 50 == 0;
            double light = (double)flat_mean[i] - (double)bias_mean[i];
            dark_mean[i] = bias_mean[i] + (float)(20.0 + draw(i, 7) + (hot ? 800.0 : 0.0));
            flat_mean[i] = dark_mean[i] + (float)(hot ? 1.05 * light : light);
        }
        bst_sensor_figures f;
        bst_assert_ok(&ctx, bst_sensor_figures_compute(&ctx, &s, &f));
        found[k] = f.figures[BST_SENSOR_PRNU].value;
        bst_sensor_figures_free(&f);
    }
    /* 2 % fewer pixels change the scatter by 0.2 %; 20 % if they were part of it */
    bst_assert_close(found[1] / found[0], 1.0, 0.01);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(dark_current_beside_noise_of_rows),
        cmocka_unit_test(response_beside_hot_pixels),
        cmocka_unit_test(noise_and_level),
        cmocka_unit_test(gain_and_response),
        cmocka_unit_test(dead_pixels_and_columns),
        cmocka_unit_test(files_of_the_figures),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
