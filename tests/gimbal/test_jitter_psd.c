/* Jitter from tables and lines: integrals, the spectrum of the output against its table, lines,
 * what samples lack, what is refused. */
#include <fcntl.h>
#include <unistd.h>

#include "boresight/vec.h"
#include "gimbal/jitter/jitter_noise.h"
#include "gimbal/jitter/jitter_spectrum.h"
#include "tests/gimbal/periodogram.h"
#include "tests/test_support.h"

#define DT 1e-3

static const bst_jitter_density_point steep_points[] = {{4.0, 2e-2}, {20.0, 8e-4}, {200.0, 8e-6}};
static const bst_jitter_density steep = {steep_points, 3}; /* f^-2 */
static const bst_jitter_density_point bent_points[] = {
    {5, 1e-3}, {40, 1e-3}, {80, 2e-2}, {150, 1e-4}};
static const bst_jitter_density bent = {bent_points, 4};
static const bst_jitter_density_point slow_points[] = {{0.02, 4.0}, {0.1, 4.0}, {1.0, 0.04}};
static const bst_jitter_density slow = {slow_points, 3};

static void integrals_are_closed_forms(void **state) {
    (void)state;
    /* a f^-2 from 4 to 200 Hz: a (1/4 - 1/200), a = 0.32; rounding of pow and log */
    bst_assert_close(bst_jitter_density_integral(&steep, 0.0, 1e9), 0.32 * (0.25 - 0.005), 1e-15);
    bst_assert_close(bst_jitter_density_integral(&steep, 10.0, 30.0), 0.32 * (0.1 - 1.0 / 30.0),
                     1e-15);
    bst_assert_close(bst_jitter_density_at(&steep, 100.0), 0.32e-4, 1e-18);
    assert_true(bst_jitter_density_at(&steep, 3.999) == 0.0 &&
                bst_jitter_density_at(&steep, 200.1) == 0.0);
    /* 1/f, whose power is no power */
    const bst_jitter_density_point pink[] = {{1.0, 3.0}, {10.0, 0.3}};
    bst_jitter_density p = {pink, 2};
    bst_assert_close(bst_jitter_density_integral(&p, 2.0, 8.0), 3.0 * log(4.0), 1e-14);
    /* straight from zero */
    const bst_jitter_density_point ramp[] = {{0.0, 0.0}, {10.0, 2.0}, {12.0, 0.0}};
    bst_jitter_density r = {ramp, 3};
    bst_assert_close(bst_jitter_density_integral(&r, 0.0, 20.0), 12.0, 1e-14);
    bst_assert_close(bst_jitter_density_at(&r, 5.0), 1.0, 1e-15);
}

enum { COUNT = 1024, SEGMENTS = 120, PLACES = 24 };

/* Averages of periodograms over both axes and SEGMENTS stretches far apart, over the density: chi
 * squared with 4 * SEGMENTS degrees of freedom, over their number. */
static void judge(const bst_jitter_density *density, int64_t hop, double from_hz, double to_hz,
                  double slack) {
    static bst_jitter_noise noise;
    bst_jitter_noise_init(&noise, density, 400.0, DT, bst_rng_make_key(3, 0, "a", "psd"));
    static double x[2][COUNT];
    double sum[PLACES] = {0.0};
    double step_s = DT * (double)hop;
    for (int s = 0; s < SEGMENTS; s++) {
        for (int n = 0; n < COUNT; n++) {
            double v[2];
            bst_jitter_noise_at(&noise, ((int64_t)s * 2 * COUNT + n) * hop, v);
            x[0][n] = v[0];
            x[1][n] = v[1];
        }
        for (int p = 0; p < PLACES; p++) {
            double f = from_hz * pow(to_hz / from_hz, p / (PLACES - 1.0));
            sum[p] += periodogram(x[0], COUNT, step_s, f) + periodogram(x[1], COUNT, step_s, f);
        }
    }
    double freedom = 4.0 * SEGMENTS, sigma = sqrt(2.0 / freedom), chi2 = 0.0;
    for (int p = 0; p < PLACES; p++) {
        double f = from_hz * pow(to_hz / from_hz, p / (PLACES - 1.0));
        double ratio = sum[p] / (2.0 * SEGMENTS) / bst_jitter_density_at(density, f);
        chi2 += pow((ratio - 1.0) / sigma, 2.0);
        /* 4 sigma of 24 values (1 in 600), and what the windows smooth */
        bst_assert_close(ratio, 1.0, 4.0 * sigma + slack);
    }
    /* 24 degrees of freedom: 51.2 is exceeded once in a thousand */
    assert_true(chi2 < 51.2 * (1.0 + 20.0 * slack));
}

static void spectrum_is_the_table(void **state) {
    (void)state;
    judge(&steep, 1, 6.0, 180.0, 0.01); /* a Hann window of 1 s on f^-2 at 6 Hz: 1 % */
    judge(&bent, 1, 8.0, 35.0, 0.0);
    judge(&slow, 64, 0.15, 0.9, 0.01);
}

static void variance_is_the_integral_at_every_step(void **state) {
    (void)state;
    static bst_jitter_noise noise;
    bst_jitter_noise_init(&noise, &bent, 400.0, DT, bst_rng_make_key(4, 0, "a", "psd"));
    double square[8] = {0.0}, product[4] = {0.0}, fourth = 0.0, cross = 0.0;
    const int blocks = 400;
    for (int n = 0; n < blocks * 1024; n++) {
        double v[2];
        bst_jitter_noise_at(&noise, n, v);
        square[(n + 2) % 1024 / 128] += v[0] * v[0] + v[1] * v[1];
        if ((n + 2) % 256 == 0) {
            product[(n + 2) % 1024 / 256] += v[0] * v[1];
        }
        fourth += pow(v[0], 4) + pow(v[1], 4);
        cross += v[0] * v[1];
    }
    double variance = bst_jitter_density_integral(&bent, 0.0, 1e9), count = blocks * 1024.0;
    double total = 0.0;
    for (int i = 0; i < 8; i++) {
        double mean = square[i] / (2.0 * count / 8.0);
        total += mean / 8.0;
        /* bands some 30 Hz wide give 8 free values in 128 ms: 2 axes, 400 blocks: 1.8 %, four times
         */
        bst_assert_close(mean / variance, 1.0, 0.07);
    }
    bst_assert_close(total / variance, 1.0, 0.025);
    for (int i = 0; i < 4; i++) {
        /* nor does one axis follow the other at a place of the blocks, their middle above all:
         * 1 / sqrt(400), four times */
        bst_assert_close(product[i] / blocks / variance, 0.0, 0.2);
    }
    /* Gaussian: the fourth moment is 3 squares; the axes are independent */
    bst_assert_close(fourth / (2.0 * count) / (variance * variance), 3.0, 0.25);
    bst_assert_close(cross / count / variance, 0.0, 0.025);
}

/* A density whose power is slower than half a bin: the mean of a block has all of it. */
static void what_is_slower_than_a_block_has_its_variance(void **state) {
    (void)state;
    static bst_jitter_noise noise;
    static const bst_jitter_density_point points[] = {
        {0.0, 1.0}, {0.05, 1.0}, {0.06, 1e-4}, {10.0, 1e-6}};
    const bst_jitter_density still = {points, 4};
    const int keys = 300;
    double square[2] = {0.0};
    for (int k = 0; k < keys; k++) {
        double v[2];
        bst_jitter_noise_init(&noise, &still, 400.0, DT,
                              bst_rng_make_key(9, (uint64_t)k, "a", "psd"));
        bst_jitter_noise_at(&noise, 700 * k, v);
        square[0] += v[0] * v[0] / keys;
        square[1] += v[1] * v[1] / keys;
    }
    assert_int_equal(noise.stride, 4); /* bins of 0.12 Hz */
    double variance = bst_jitter_density_integral(&still, 0.0, 1e9);
    for (int axis = 0; axis < 2; axis++) {
        bst_assert_close(square[axis] / variance, 1.0, 4.0 * sqrt(2.0 / keys)); /* 4 sigma */
    }
}

static void slow_noise_is_smooth_between_its_nodes(void **state) {
    (void)state;
    static bst_jitter_noise noise;
    bst_jitter_noise_init(&noise, &slow, 400.0, DT, bst_rng_make_key(5, 0, "a", "psd"));
    assert_int_equal(noise.stride, 32); /* 20 nodes in a second, 50 steps apart at the most */
    static double x[8192];
    for (int n = 0; n < 8192; n++) {
        double v[2];
        bst_jitter_noise_at(&noise, 100000 + n, v);
        x[n] = v[0];
    }
    double above = 0.0;
    for (int k = 0; k < 40; k++) {
        above = fmax(above, periodogram(x, 8192, DT, 5.0 + 10.0 * k));
    }
    /* images of the cubic at multiples of 31 Hz, 1e-8 of the power */
    assert_true(above < 1e-6 * 4.0);
    double worst = 0.0;
    for (int n = 2; n < 8192; n++) {
        worst = fmax(worst, fabs(x[n] - 2.0 * x[n - 1] + x[n - 2]));
    }
    /* an acceleration of (2 pi f)^2 x: 40 * 0.6 at 1 Hz, six sigma, times dt^2, and as much for the
     * cubic's bends */
    assert_true(worst < 40.0 * 0.6 * 6.0 * 1e-6 * 2.0);
}

static void value_depends_on_the_step_alone(void **state) {
    (void)state;
    const bst_jitter_density *tables[] = {&bent, &slow};
    for (int t = 0; t < 2; t++) {
        static bst_jitter_noise forward, jumping;
        bst_rng_key key = bst_rng_make_key(6, 0, "a", "psd");
        bst_jitter_noise_init(&forward, tables[t], 400.0, DT, key);
        bst_jitter_noise_init(&jumping, tables[t], 400.0, DT, key);
        static double at[5000][2];
        for (int n = 0; n < 5000; n++) {
            bst_jitter_noise_at(&forward, n, at[n]);
        }
        for (int i = 0; i < 300; i++) {
            int n = (i * 1237) % 5000;
            double v[2];
            bst_jitter_noise_at(&jumping, n, v);
            assert_memory_equal(v, at[n], sizeof v);
        }
    }
}

static bst_jitter_psd_config empty_config(void) {
    bst_ctx ctx = {0};
    bst_jitter_psd_config c;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_jitter_psd_config_table, &c));
    return c;
}

static const bst_jitter_spec no_bands = {.low_cutoff_hz = 0.05, .high_max_hz = 200.0};

static void lines_are_sines(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_jitter_psd_config c = empty_config();
    bst_jitter_line_config lines[] = {{37.0, 0.5, 0, false, 30.0}, {12.5, 0.2, 1, false, -90.0}};
    c.unit = 1;
    c.lines = (bst_config_list){lines, 2};
    bst_jitter_spectrum s;
    bst_assert_ok(&ctx, bst_jitter_spectrum_create(&ctx, &no_bands, &c, 1e-5, &s));
    bst_jitter j;
    bst_jitter_init(&j, &no_bands, DT, (bst_rng_key){{1, 2}});
    bst_assert_ok(&ctx, bst_jitter_add(&ctx, &j, &s, (bst_rng_key){{3, 4}}));
    for (int i = 0; i < 1000; i++) {
        int64_t n = i < 500 ? i : 86400000 + i;
        double v[2], t = (double)n * DT;
        bst_jitter_at(&j, n, v);
        double a = 2.0 * BST_PI * (fmod(37.0 * t, 1.0) + 1.0 / 12.0);
        double b = 2.0 * BST_PI * (fmod(12.5 * t, 1.0) - 0.25);
        /* 37 Hz * 86400 s in double: 1e-9 cycles of 2.4e-6 rad */
        bst_assert_close(v[0], 0.5 * BST_ARCSEC_RAD * sin(a), 3e-14);
        bst_assert_close(v[1], 0.2 * BST_ARCSEC_RAD * sin(b), 1e-14);
    }
    bst_assert_close(bst_jitter_spectrum_variance(&s, 0, 0.0, 100.0),
                     0.125 * BST_ARCSEC_RAD * BST_ARCSEC_RAD, 1e-20);
    bst_assert_close(bst_jitter_spectrum_variance(&s, 0, 38.0, 100.0), 0.0, 0.0);
    bst_jitter_free(&j);
    bst_jitter_spectrum_free(&s);
}

/* Mean square of straight lines through samples, and what they lack, is the spectrum's integral at
 * every rate; flat bands, both tables and lines add up. */
static void samples_and_what_they_lack_are_all_of_it(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_jitter_psd_config c = empty_config();
    bst_jitter_density_point low[] = {{0.5, 0.02}, {5.0, 0.02}},
                             high[] = {{20.0, 2e-4}, {900.0, 2e-4}};
    bst_jitter_line_config lines[] = {{90.0, 0.1, 2, true, 0.0}, {700.0, 0.1, 0, true, 0.0}};
    c.low = (bst_config_list){low, 2};
    c.high = (bst_config_list){high, 2};
    c.lines = (bst_config_list){lines, 2};
    c.y_scale = 2.0;
    double px = 1e-5;
    bst_jitter_spec flat = {
        .low_cutoff_hz = 0.05, .high_rms_rad = 0.2 * px, .high_min_hz = 5.0, .high_max_hz = 200.0};
    bst_jitter_spectrum s;
    bst_assert_ok(&ctx, bst_jitter_spectrum_create(&ctx, &flat, &c, px, &s));
    double whole = bst_jitter_spectrum_variance(&s, 0, 0.0, 1e9) +
                   bst_jitter_spectrum_variance(&s, 1, 0.0, 1e9);
    /* 0.09 and 0.176 px^2 of the tables, twice in y; 0.005 each of three lines; 0.04 radial */
    bst_assert_close(whole / (px * px), 3.0 * (0.09 + 0.176) + 3.0 * 0.005 + 0.04, 1e-12);
    bst_assert_close(bst_jitter_spectrum_at(&s, 1, 100.0) / (px * px), 2.0 * 2e-4 + 0.02 / 195.0,
                     1e-15);
    /* the tables twice in y alone, one line in both axes, the other one in x */
    bst_assert_close(bst_jitter_spectrum_variance(&s, 0, 0.0, 1e9) / (px * px),
                     0.09 + 0.176 + 2.0 * 0.005 + 0.02, 1e-12);
    bst_assert_close(bst_jitter_spectrum_variance(&s, 1, 0.0, 1e9) / (px * px),
                     2.0 * (0.09 + 0.176) + 0.005 + 0.02, 1e-12);
    for (int axis = 0; axis < 2; axis++) { /* a band in which there is all but the second line */
        double sum = 0.0;
        for (double hz = 3.05; hz < 150.0; hz += 0.1) {
            sum += 0.1 * bst_jitter_spectrum_at(&s, axis, hz);
        }
        /* half a step at each of the ends of table and band within */
        bst_assert_close(bst_jitter_spectrum_variance(&s, axis, 3.0, 150.0) / (px * px),
                         sum / (px * px) + 0.005, 3e-3);
    }
    for (double rate_hz = 300.0; rate_hz < 1e4; rate_hz *= 5.0) {
        double dt_s = 1.0 / rate_hz, sum = 0.0, before[2] = {0.0, 0.0};
        bst_jitter_spec resolved = bst_jitter_resolved(&flat, dt_s);
        bst_jitter j;
        bst_jitter_init(&j, &resolved, dt_s, (bst_rng_key){{5, 6}});
        bst_assert_ok(&ctx, bst_jitter_add(&ctx, &j, &s, (bst_rng_key){{7, 8}}));
        int steps = (int)(200.0 * rate_hz) > 400000 ? 400000 : (int)(200.0 * rate_hz);
        for (int n = 0; n <= steps; n++) {
            double v[2];
            bst_jitter_at(&j, n, v);
            for (int a = 0; a < 2; a++) {
                sum += n > 0 ? (before[a] * before[a] + before[a] * v[a] + v[a] * v[a]) / 3.0 : 0.0;
                before[a] = v[a];
            }
        }
        double lack = 2.0 * (bst_jitter_unresolved_rad2(&flat, dt_s) +
                             bst_jitter_spectrum_unresolved_rad2(&s, dt_s));
        /* the slow band has 4.5 Hz * 53 s * 2 free values: 6 % of a third of it all */
        bst_assert_close((sum / steps + lack) / whole, 1.0, 0.05);
        bst_jitter_free(&j);
    }
    bst_jitter_spectrum_free(&s);
}

static void tables_come_from_files_and_bad_ones_are_refused(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char path[BST_TEST_PATH];
    bst_test_template(path, "psd");
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    const char text[] = "# Hz, px^2/Hz\n\n0.5, 1e-3\n 5 2e-3 # to here\n50\t1e-4\n";
    assert_true(write(fd, text, sizeof text - 1) == (ssize_t)(sizeof text - 1));
    close(fd);
    bst_jitter_psd_config c = empty_config();
    snprintf(c.low_file, sizeof c.low_file, "%s", path);
    bst_jitter_spectrum s;
    bst_assert_ok(&ctx, bst_jitter_spectrum_create(&ctx, &no_bands, &c, 2.0, &s));
    assert_int_equal(s.low.count, 3);
    bst_assert_close(s.low.points[1].psd, 4.0 * 2e-3, 1e-18);
    bst_jitter_spectrum_free(&s);
    bst_jitter_density_point one[] = {{1.0, 1.0}}, back[] = {{2.0, 1.0}, {1.0, 1.0}};
    c.low = (bst_config_list){back, 2};
    assert_int_equal(bst_jitter_spectrum_create(&ctx, &no_bands, &c, 2.0, &s), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "both a table and low_file"));
    c.low_file[0] = '\0';
    assert_int_equal(bst_jitter_spectrum_create(&ctx, &no_bands, &c, 2.0, &s), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "platform/jitter_psd/low: 1 Hz come after 2 Hz"));
    c.low = (bst_config_list){one, 1};
    assert_int_equal(bst_jitter_spectrum_create(&ctx, &no_bands, &c, 2.0, &s), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "give at least two"));
    fd = open(path, O_WRONLY | O_TRUNC);
    assert_true(write(fd, "1 2\n3 x\n", 8) == 8);
    close(fd);
    c = empty_config();
    snprintf(c.high_file, sizeof c.high_file, "%s", path);
    assert_int_equal(bst_jitter_spectrum_create(&ctx, &no_bands, &c, 2.0, &s), BST_ERR_FORMAT);
    assert_non_null(strstr(ctx.message, "line 2: \"3 x\" is not a frequency and a density"));
    unlink(path);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(integrals_are_closed_forms),
        cmocka_unit_test(spectrum_is_the_table),
        cmocka_unit_test(variance_is_the_integral_at_every_step),
        cmocka_unit_test(what_is_slower_than_a_block_has_its_variance),
        cmocka_unit_test(slow_noise_is_smooth_between_its_nodes),
        cmocka_unit_test(value_depends_on_the_step_alone),
        cmocka_unit_test(lines_are_sines),
        cmocka_unit_test(samples_and_what_they_lack_are_all_of_it),
        cmocka_unit_test(tables_come_from_files_and_bad_ones_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
