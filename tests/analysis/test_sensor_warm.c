/* Doubling of the dark current with temperature: its error where rows or frames have noise that
 * blocks of pixels share. The sensor is no square. */
#include "boresight/rng.h"
#include "sim/analysis/characterize/sensor_figures.h"
#include "tests/test_support.h"

enum { WIDTH = 96, HEIGHT = 72, PIXELS = WIDTH * HEIGHT, STACKS = 3, MOST = 8, SEEDS = 60 };

typedef struct noise {
    double pixel, row, frame; /* of one frame, DN */
} noise;

static float means[STACKS][PIXELS];
static double levels[STACKS][MOST];

static double draw(int seed, int stream, int i) {
    return bst_rng_normal((bst_rng_key){{31, (uint32_t)seed}}, (uint64_t)stream, (uint64_t)i);
}

/* Mean and levels of frames: 300 DN, a signal of the pixels, and the noise of pixels, rows and
 * frames. */
static bst_frame_stack make(int seed, int kind, int count, double exposure_s, double per_s,
                            noise n) {
    static double rows[HEIGHT];
    memset(rows, 0, sizeof rows);
    for (int f = 0; f < count; f++) {
        levels[kind][f] = 300.0 + per_s * exposure_s;
        double frame = n.frame * draw(seed, 10 + kind, f);
        for (int y = 0; y < HEIGHT; y++) {
            double row = frame + n.row * draw(seed, 20 + kind, f * HEIGHT + y);
            rows[y] += row / count;
            levels[kind][f] += row / HEIGHT;
        }
    }
    for (int i = 0; i < PIXELS; i++) {
        double signal = per_s * exposure_s * (1.0 + 0.1 * draw(seed, 1, i));
        means[kind][i] = (float)(300.0 + signal + rows[i / WIDTH] +
                                 n.pixel / sqrt(count) * draw(seed, 30 + kind, i));
    }
    return (bst_frame_stack){.count = count,
                             .width = WIDTH,
                             .height = HEIGHT,
                             .exposure_s = exposure_s,
                             .levels = levels[kind],
                             .mean = means[kind]};
}

/* Chi-square of 60 sensors, whose doubling is 6.5 K, over 60. */
static double chi_square(noise n) {
    const double warmer_k = 5.0, doubling_k = 6.5;
    double sum = 0.0;
    for (int seed = 0; seed < SEEDS; seed++) {
        bst_ctx ctx = {0};
        double cold = 0.4, warm = cold * exp2(warmer_k / doubling_k);
        bst_sensor_stacks s = {.bias = make(seed, 0, 6, 0.0, 0.0, n),
                               .dark = make(seed, 1, 5, 30.0, cold, n),
                               .warm = make(seed, 2, 8, 20.0, warm, n),
                               .warmer_k = warmer_k};
        bst_sensor_figures f = {.width = WIDTH, .height = HEIGHT};
        bst_assert_ok(&ctx, bst_sensor_measure_warm(&ctx, &s, &f));
        bst_sensor_estimate found = f.figures[BST_SENSOR_DARK_DOUBLING];
        assert_true(found.sigma > 0.0);
        double off = (found.value - doubling_k) / found.sigma;
        sum += off * off / SEEDS;
    }
    return sum;
}

static void test_error_by_noise_of_pixels_rows_and_frames(void **state) {
    (void)state;
    static const noise noises[] = {
        {3.0, 0.0, 0.0}, {3.0, 0.8, 0.0}, {3.0, 0.0, 0.15}, {1.0, 0.5, 0.1}};
    for (size_t i = 0; i < sizeof noises / sizeof *noises; i++) {
        double chi2 = chi_square(noises[i]);
        /* a mean of 60 has 0.18; a level's scatter of 16 degrees of freedom makes 1.14 of it, noise
         * of rows that blocks show too makes it less */
        assert_true(chi2 > 0.5 && chi2 < 1.7);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_error_by_noise_of_pixels_rows_and_frames),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
