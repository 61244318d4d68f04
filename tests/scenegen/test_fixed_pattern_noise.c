/* The detector's fixed pattern by itself, without a device. */
#include "scenegen/detector/fixed_pattern_noise.h"

#include "tests/test_support.h"

/* At 2 electrons per number: offsets are given in electrons and come in numbers; columns and rows
 * have their own deviations and draws of their own. */
static void offsets_of_columns_and_rows(void **state) {
    (void)state;
    enum { COUNT = 4000 };
    static float columns[COUNT], rows[COUNT], none[COUNT];
    const bst_camera camera = {.gain_e_per_dn = 2.0,
                               .detector = {.column_offset_rms_e = 6.0, .row_offset_rms_e = 9.0}};
    const bst_camera even = {.gain_e_per_dn = 2.0};
    const bst_rng_key key = {{21, 22}};
    bst_fixed_pattern_noise_offsets(&camera, key, "columns", COUNT, columns);
    bst_fixed_pattern_noise_offsets(&camera, key, "rows", COUNT, rows);
    bst_fixed_pattern_noise_offsets(&even, key, "rows", COUNT, none);
    double c2 = 0.0, r2 = 0.0, both = 0.0, beside = 0.0;
    for (int i = 0; i < COUNT; i++) {
        double c = (double)columns[i], r = (double)rows[i];
        c2 += c * c / COUNT;
        r2 += r * r / COUNT;
        both += c * r / COUNT;
        beside += i > 0 ? c * (double)columns[i - 1] / COUNT : 0.0;
        assert_true(none[i] == 0.0f);
    }
    /* four standard deviations of 4000 normal deviates' */
    bst_assert_close(sqrt(c2), 3.0, 4.0 * 3.0 / sqrt(2.0 * COUNT));
    bst_assert_close(sqrt(r2), 4.5, 4.0 * 4.5 / sqrt(2.0 * COUNT));
    bst_assert_close(both, 0.0, 4.0 * 13.5 / sqrt(COUNT));
    bst_assert_close(beside, 0.0, 4.0 * 9.0 / sqrt(COUNT));
}

/* Dark current on a sensor that is no square: a log-normal law of the mean and deviation that are
 * asked for, hot pixels log-normal about their median, no draw used twice, nothing beyond the rows'
 * end. 300 x 200 pixels in rows of 320. */
static void dark_current_of_pixels(void **state) {
    (void)state;
    enum { WIDTH = 300, HEIGHT = 200, STRIDE = 320 };
    static float dark[STRIDE * HEIGHT];
    bst_ctx ctx = {0};
    bst_camera camera = {.width_px = WIDTH,
                         .height_px = HEIGHT,
                         .dark_current_e_per_s = 4.0,
                         .detector = {.dsnu_rms = 0.5}};
    const bst_rng_key key = {{5, 6}};
    double factor = bst_detector_dark_factor(&camera.detector);
    bst_assert_ok(&ctx, bst_fixed_pattern_noise_dark(&ctx, &camera, key, NULL, STRIDE, dark));
    const double n = WIDTH * HEIGHT;
    double sum = 0.0, squares = 0.0, logs = 0.0, across = 0.0, down = 0.0;
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < STRIDE; x++) {
            double v = (double)dark[y * STRIDE + x];
            if (x >= WIDTH) {
                assert_true(v == 0.0);
                continue;
            }
            sum += v / n;
            squares += v * v / n;
            logs += log(v) / n;
            double off = v - 4.0 * factor;
            across += x > 0 ? off * ((double)dark[y * STRIDE + x - 1] - 4.0 * factor) / n : 0.0;
            down += y > 0 ? off * ((double)dark[(y - 1) * STRIDE + x] - 4.0 * factor) / n : 0.0;
        }
    }
    double mean = 4.0 * factor, rms = 0.5 * mean;
    bst_assert_close(sum, mean, 4.0 * rms / sqrt(n));
    bst_assert_close(sqrt(squares - sum * sum), rms, 0.03 * rms); /* its fourth moment is large */
    /* mean of the logarithm: that of the mean less half its variance ln(1 + 0.5^2) */
    bst_assert_close(logs, log(mean) - 0.5 * log(1.25), 4.0 * sqrt(log(1.25) / n));
    bst_assert_close(across / (rms * rms), 0.0, 4.0 / sqrt(n));
    bst_assert_close(down / (rms * rms), 0.0, 4.0 / sqrt(n));
    /* hot ones: a tenth, median 50 e/s, a deviation of 0.3 of their decimal logarithm */
    camera.dark_current_e_per_s = 0.0;
    camera.detector = (bst_detector_config){
        .hot_fraction = 0.1, .hot_median_e_per_s = 50.0, .hot_spread_dex = 0.3};
    factor = bst_detector_dark_factor(&camera.detector);
    memset(dark, 0, sizeof dark);
    bst_assert_ok(&ctx, bst_fixed_pattern_noise_dark(&ctx, &camera, key, NULL, STRIDE, dark));
    double hot = 0.0, dex = 0.0, dex2 = 0.0;
    for (int i = 0; i < STRIDE * HEIGHT; i++) {
        if (dark[i] > 0.0f) {
            double l = log10((double)dark[i] / (50.0 * factor));
            hot += 1.0;
            dex += l;
            dex2 += l * l;
        }
    }
    bst_assert_close(hot, 0.1 * n, 4.0 * sqrt(0.09 * n));
    bst_assert_close(dex / hot, 0.0, 4.0 * 0.3 / sqrt(hot));
    bst_assert_close(sqrt(dex2 / hot), 0.3, 4.0 * 0.3 / sqrt(2.0 * hot));
}

static void dark_current_doubles(void **state) {
    (void)state;
    bst_camera camera = {.dark_current_e_per_s = 3.0,
                         .detector = {.dark_doubling_k = 6.5, .reference_temperature_c = 20.0}};
    camera.detector.temperature_c = 33.0; /* two doublings */
    bst_assert_close(bst_camera_dark_e_per_s(&camera), 12.0, 1e-12);
    camera.detector.temperature_c = 7.0;
    bst_assert_close(bst_camera_dark_e_per_s(&camera), 0.75, 1e-12);
    camera.detector = (bst_detector_config){0};
    bst_assert_close(bst_camera_dark_e_per_s(&camera), 3.0, 0.0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(dark_current_doubles),
        cmocka_unit_test(offsets_of_columns_and_rows),
        cmocka_unit_test(dark_current_of_pixels),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
