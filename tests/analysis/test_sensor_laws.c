/* Laws that `boresight characterize` fits to a sensor: dark currents against sums over fine steps
 * of their distributions, traps against lines of a whole sensor. */
#include <stdlib.h>

#include "boresight/rng.h"
#include "sim/analysis/characterize/dark_distribution.h"
#include "sim/analysis/characterize/neighbour_covariance.h"
#include "sim/analysis/characterize/readout_time.h"
#include "sim/analysis/characterize/trap_correction.h"
#include "sim/analysis/characterize/trap_fit.h"
#include "tests/test_support.h"

static double below_normal(double z) {
    return 0.5 * erfc(-z / sqrt(2.0));
}

/* Share below a rate of the dark current of relative RMS dsnu plus `extra`, with shot noise and the
 * other noise. */
static double core(const bst_dark_distribution *d, const bst_dark_noise *noise, double extra,
                   double rate) {
    double sum = 0.0, width = sqrt(log(1.0 + d->dsnu * d->dsnu));
    const double step = 0.2;
    for (double z = -6.0; z < 6.1; z += step) {
        /* the mean of exp(width z) is exp(width^2 / 2) */
        double mean = extra + d->dark * exp(width * z) / exp(0.5 * width * width);
        sum += step * exp(-0.5 * z * z) / sqrt(2.0 * BST_PI) *
               below_normal((rate - mean) / sqrt(noise->variance + mean / noise->exposure_s));
    }
    return sum;
}

static double below(const bst_dark_distribution *d, const bst_dark_noise *noise, double rate) {
    double sum = 0.0;
    const double step = 0.2;
    for (double z = -6.0; z < 6.1; z += step) {
        double extra = d->hot_median * exp(log(10.0) * d->hot_spread_dex * z);
        sum += step * exp(-0.5 * z * z) / sqrt(2.0 * BST_PI) * core(d, noise, extra, rate);
    }
    return (1.0 - d->hot_fraction) * core(d, noise, 0.0, rate) + d->hot_fraction * sum;
}

static const bst_dark_distribution sensors[] = {
    {3.0, 0.3, 0.02, 40.0, 0.4}, {0.2, 0.1, 0.7, 0.5, 0.25}, {12.0, 0.5, 0.2, 20.0, 0.25}};
static const bst_dark_noise noises[] = {{1.0, 3.0}, {0.005, 30.0}, {16.0, 2.0}};

static void shares_are_those_of_the_distributions(void **state) {
    (void)state;
    for (int i = 0; i < 3; i++) {
        static const double rates[] = {0.5, 0.9, 1.0, 1.3, 3.0, 20.0};
        for (int k = 0; k < 6; k++) {
            double rate = rates[k] * sensors[i].dark;
            /* its steps are 0.7 and 0.15 standard deviations, less than the noise here */
            bst_assert_close(bst_dark_distribution_below(&sensors[i], &noises[i], rate),
                             below(&sensors[i], &noises[i], rate), 2e-3);
        }
    }
}

static void fit_finds_the_distribution(void **state) {
    (void)state;
    const bst_dark_distribution *sensor = &sensors[0];
    double percentiles[BST_SENSOR_PERCENTILES];
    for (int k = 0; k < BST_SENSOR_PERCENTILES; k++) {
        double low = 0.0, high = 1e4, share = bst_sensor_percentiles[k] / 100.0;
        while (high - low > 1e-6 * high) {
            double rate = 0.5 * (low + high);
            *(bst_dark_distribution_below(sensor, &noises[0], rate) < share ? &low : &high) = rate;
        }
        percentiles[k] = low;
    }
    bst_dark_distribution found;
    assert_true(bst_dark_distribution_fit(percentiles, &noises[0], NULL, &found));
    const double got[5] = {found.dark, found.dsnu, found.hot_fraction, found.hot_median,
                           found.hot_spread_dex};
    const double expected[5] = {sensor->dark, sensor->dsnu, sensor->hot_fraction,
                                sensor->hot_median, sensor->hot_spread_dex};
    for (int k = 0; k < 5; k++) { /* a search in five dimensions; shares to 5 % of themselves */
        bst_assert_close(got[k] / expected[k], 1.0, k == 1 ? 0.1 : 0.03);
    }
    percentiles[3] = NAN;
    assert_false(bst_dark_distribution_fit(percentiles, &noises[0], NULL, &found));
}

enum { ROW = 700, BEYOND = 12 };

/* The trail behind the middle pixel of a line that is read pixel by pixel, as shares of its charge.
 */
static void trail_of(const bst_detector_traps_config *traps, double background_e, double charge_e,
                     double out[BST_TRAIL_PIXELS]) {
    static float line[ROW + BEYOND];
    for (int i = 0; i < ROW + BEYOND; i++) {
        line[i] = (float)(background_e + (i == ROW ? charge_e : 0.0));
    }
    bst_trap_pass_line(traps, 0, ROW + BEYOND, 1, line);
    for (int k = 0; k < BST_TRAIL_PIXELS; k++) {
        out[k] = ((double)line[ROW + 1 + k] - background_e) / (double)(line[ROW] - line[ROW - 1]);
    }
}

static void traps_are_found_on_each_side(void **state) {
    (void)state;
    static const bst_detector_traps_config traps = {.traps_per_px = {0.9, 0.5, 0.0},
                                                    .release_px = {0.6, 4.0, 1.0},
                                                    .fill_exponent = 0.6,
                                                    .reference_e = 10000.0};
    static const double charge_dn[BST_TRAIL_CLASSES] = {400, 900, 2200, 7000};
    const bst_trap_fit_input input = {.gain_e_per_dn = 1.7, .background_e = 15.0, .transfers = ROW};
    for (int side = 0; side < BST_TRAIL_SIDES; side++) {
        bst_charge_trail trail = {.parallel_up = side == 0, .serial_right = side == 2};
        double found[BST_TRAIL_PIXELS];
        for (int c = 0; c < BST_TRAIL_CLASSES; c++) {
            double sum = 0.0;
            trail_of(&traps, input.background_e, input.gain_e_per_dn * charge_dn[c], found);
            for (int k = 0; k < BST_TRAIL_PIXELS; k++) {
                sum += found[k];
            }
            trail.class_charge[c] = charge_dn[c];
            *(side < 2 ? &trail.class_parallel[c] : &trail.class_serial[c]) = sum;
        }
        trail_of(&traps, input.background_e, input.gain_e_per_dn * sqrt(900.0 * 2200.0), found);
        for (int k = 0; k < BST_TRAIL_PIXELS; k++) {
            /* both sides have wings, which the difference removes; the other direction has none */
            trail.profile[side][k] = found[k] + 0.01 / (k + 1);
            trail.profile[side ^ 1][k] = 0.01 / (k + 1);
        }
        bst_detector_traps_config out;
        double rms = bst_trap_fit(&trail, side < 2, &input, &out);
        assert_true(rms < 2e-4); /* of trails of some hundredths */
        int fast = out.release_px[0] > out.release_px[1];
        double scale = pow(out.reference_e / traps.reference_e, -traps.fill_exponent);
        bst_assert_close(out.release_px[fast], 0.6, 0.1);
        bst_assert_close(out.release_px[1 - fast], 4.0, 0.8);
        bst_assert_close(out.traps_per_px[fast] * scale, 0.9, 0.1);
        bst_assert_close(out.traps_per_px[1 - fast] * scale, 0.5, 0.07);
        bst_assert_close(out.fill_exponent, 0.6, 0.03);
        bst_assert_close(out.traps_per_px[2], 0.0, 0.0);
    }
}

/* Counts of hits in ten darks and four bias frames: a rate by area and time, and the time of
 * read-out, with the errors of counts. */
static void hits_are_counted_by_area_and_time(void **state) {
    (void)state;
    bst_sensor_stacks s = {.pixel_pitch_um = 15.0};
    s.dark.exposure_s = 20.0;
    s.dark.hits.frames = 10;
    s.dark.hits.count = 450;
    s.bias.hits.frames = 4;
    s.bias.hits.count = 80;
    bst_sensor_figures *f = calloc(1, sizeof *f);
    assert_non_null(f);
    f->width = 300;
    f->height = 200;
    f->figures[BST_SENSOR_GAIN] = (bst_sensor_estimate){1.5, 0.01};
    bst_sensor_measure_hits(&s, f);
    const double per_frame = 45.0 - 20.0, sigma = sqrt(45.0 / 10.0 + 20.0 / 4.0);
    const double unit = 20.0 * (300 * 15e-4) * (200 * 15e-4); /* cm^2 s */
    bst_assert_close(f->figures[BST_SENSOR_HIT_RATE].value, per_frame / unit, 1e-9);
    bst_assert_close(f->figures[BST_SENSOR_HIT_RATE].sigma, sigma / unit, 1e-9);
    /* 20 hits at 25 in 20 s */
    bst_assert_close(f->figures[BST_SENSOR_HIT_READOUT].value, 16.0, 1e-9);
    double of_bias = sqrt(20.0 / 4.0) / per_frame, of_rate = 0.8 * sigma / per_frame;
    bst_assert_close(f->figures[BST_SENSOR_HIT_READOUT].sigma,
                     20.0 * sqrt(of_bias * of_bias + of_rate * of_rate), 1e-9);
    assert_true(isnan(f->figures[BST_SENSOR_HIT_CHARGE].value));
    free(f);
}

/* Charge and length of hits in electrons and micrometres: with a gain of 1.5 +- 0.03 e/DN (2 %) and
 * pixels of 15 um, neither of which is 1. */
static void hits_have_electrons_and_micrometres(void **state) {
    (void)state;
    enum { HITS = 200 };
    static bst_radiation_hit items[HITS];
    for (int i = 0; i < HITS; i++) { /* charges 10 to 1005 DN in another order, 1 to 4 pixels */
        items[i].charge_dn = (float)(10 + 5 * ((i * 77) % HITS));
        items[i].pixels = 1 + (i * 77) % HITS * 4 / HITS;
    }
    bst_sensor_stacks s = {.pixel_pitch_um = 15.0};
    s.dark.exposure_s = 20.0;
    s.dark.hits = (bst_radiation_hits){
        .frames = 10, .width = 300, .height = 200, .count = HITS + 3, .items = items, .used = HITS};
    const bst_hit_law law = bst_radiation_hits_fit(&s.dark.hits);
    assert_true(law.depth_px.value > 0.0 && law.charge_dn.value > 0.0 && law.depth_px.sigma > 0.0);
    bst_sensor_figures *f = test_calloc(1, sizeof *f);
    f->width = 300;
    f->height = 200;
    f->figures[BST_SENSOR_GAIN] = (bst_sensor_estimate){1.5, 0.03};
    bst_sensor_measure_hits(&s, f);
    /* the upper of the two middle charges; density at it from the charges of 3/8 and 5/8: 250 DN
     * apart for a quarter of the hits, so that sigma = 2 * 250 / sqrt(200) */
    const double median = 510.0, spread = 2.0 * 250.0 / sqrt((double)HITS);
    const struct {
        bst_sensor_figure figure;
        double value, relative; /* and its error over it */
    } rows[] = {
        {BST_SENSOR_HIT_CHARGE, 1.5 * median, hypot(spread / median, 0.02)},
        {BST_SENSOR_HIT_LENGTH, law.depth_px.value, law.depth_px.sigma / law.depth_px.value},
        {BST_SENSOR_HIT_DEPTH, 15.0 * law.depth_px.value, law.depth_px.sigma / law.depth_px.value},
        {BST_SENSOR_HIT_E_PER_UM, 1.5 * law.charge_dn.value / 15.0,
         hypot(law.charge_dn.sigma / law.charge_dn.value, 0.02)},
        {BST_SENSOR_HIT_STRAGGLING, law.straggling.value,
         law.straggling.sigma / law.straggling.value}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const bst_sensor_estimate *e = &f->figures[rows[i].figure];
        bst_assert_close(e->value, rows[i].value, 1e-9 * rows[i].value);
        bst_assert_close(e->sigma, rows[i].value * rows[i].relative, 1e-9 * rows[i].value);
    }
    test_free(f);
}

enum { SIDE = 200 };

static double normal(uint32_t stream, size_t i) {
    return bst_rng_normal((bst_rng_key){{21, 7}}, i, stream);
}

/* Noise of SIDE x SIDE pixels of which each has parts of its neighbours' (column, row), rows
 * levelled; returns its variance. */
static double make_noise(float *out, uint32_t stream, double sigma, double beside, double above) {
    double square = 0.0;
    for (size_t y = 0; y < SIDE; y++) {
        double mean = 0.0;
        for (size_t x = 0; x < SIDE; x++) {
            size_t i = y * (SIDE + 1) + x;
            double v = (1.0 - beside - above) * normal(stream, i) + beside * normal(stream, i + 1) +
                       above * normal(stream, i + SIDE + 1);
            out[y * SIDE + x] = (float)(sigma * sqrt(2.0) * v);
            mean += sigma * sqrt(2.0) * v / SIDE;
        }
        for (size_t x = 0; x < SIDE; x++) {
            out[y * SIDE + x] -= (float)mean;
            square += 0.5 * (double)out[y * SIDE + x] * (double)out[y * SIDE + x];
        }
    }
    return square / (SIDE * (SIDE - 1.0));
}

static void neighbours_give_back_the_noise_that_they_share(void **state) {
    (void)state;
    float *noise = malloc(SIDE * SIDE * sizeof *noise);
    assert_non_null(noise);
    for (int shared = 0; shared < 2; shared++) {
        bst_neighbour_covariance light = {.count = 0.0}, dark = {.count = 0.0};
        double beside = shared ? 0.04 : 0.0, above = shared ? 0.06 : 0.0, v[2] = {0.0, 0.0};
        for (uint32_t pair = 0; pair < 4; pair++) {
            v[0] += make_noise(noise, pair, 100.0, beside, above) / 4.0;
            noise[0] = NAN;
            bst_neighbour_covariance_add(&light, noise, SIDE, SIDE);
            v[1] += make_noise(noise, 8 + pair, 10.0, 0.0, 0.0) / 4.0;
            bst_neighbour_covariance_add(&dark, noise, SIDE, SIDE);
        }
        bst_shared_noise sum = {.excess = 0.0};
        bst_shared_noise_add(&sum, 3.0, &light, v[0], &dark, v[1]);
        bst_sensor_estimate factor = bst_shared_noise_factor(&sum);
        /* the charge that is shared is kept: 100^2 of a pixel with all its neighbours */
        double own = 1.0 - beside - above;
        double expected = 1.0 / (own * own + beside * beside + above * above);
        if (shared) { /* two neighbours of 160,000 products are certain; of variances sqrt(2 / n) */
            bst_assert_close(factor.value, expected, 4.0 * factor.sigma);
            assert_true(factor.sigma > 0.006 && factor.sigma < 0.011);
            bst_assert_close(factor.value * (v[0] - v[1]), 1e4 - 1e2, 4.0 * 1e4 * factor.sigma);
        } else {
            bst_assert_close(factor.value, 1.0, 1e-12);
            bst_assert_close(factor.sigma, 0.0, 1e-12);
        }
    }
    free(noise);
}

/* Fills frames that are read in 3 s with the noise sigma of a bias frame and of a dark. */
static bst_readout_frames make_readout(bst_readout_frames f, float *bias, float *dark, double hot,
                                       double sigma) {
    const size_t columns = (size_t)f.width, rows = (size_t)f.height;
    for (size_t x = 0; x < columns; x++) {
        double passed = 0.0;
        for (size_t n = 0; n < rows; n++) {
            size_t i = (f.last_first ? rows - 1 - n : n) * columns + x;
            bool is_hot = bst_rng_uniform((bst_rng_key){{3, 4}}, i, 0) < 0.01;
            double rate = 2.0 + (is_hot ? hot : 0.0), noise = sigma * normal(40, i);
            dark[i] = (float)(rate * f.exposure_s + sigma * normal(41, i) - noise);
            bias[i] = (float)(500.0 + 3.0 * (double)(x % 7) + passed * 3.0 / (double)rows + noise);
            passed += rate;
        }
    }
    f.bias = bias;
    f.dark = dark;
    f.bias_variance = sigma * sigma;
    f.dark_variance = 2.0 * sigma * sigma;
    return f;
}

static void readout_time_is_that_of_the_charge_behind_hot_pixels(void **state) {
    (void)state;
    enum { MOST = 64000 };
    float *bias = malloc(sizeof *bias * MOST), *dark = malloc(sizeof *dark * MOST);
    assert_true(bias && dark);
    bst_readout_frames f;
    for (int last_first = 0; last_first < 2; last_first++) {
        f = make_readout(
            (bst_readout_frames){
                .width = 90, .height = 120, .exposure_s = 8.0, .last_first = last_first},
            bias, dark, 300.0, 2.0);
        bias[7 * 90 + 5] += 4000.0F; /* a radiation hit */
        dark[9 * 90 + 11] = NAN;
        bst_sensor_estimate time = bst_readout_time(&f);
        bst_assert_close(time.value, 3.0, 4.0 * time.sigma);
        assert_true(time.sigma > 0.0 && time.sigma < 0.01 * 3.0);
        /* dark signal of 8, noise of 12 in both frames: 3.6 standard errors too long if it counted
         */
        f = make_readout(
            (bst_readout_frames){
                .width = 1000, .height = 64, .exposure_s = 4.0, .last_first = last_first},
            bias, dark, 0.0, 12.0);
        time = bst_readout_time(&f);
        bst_assert_close(time.value, 3.0, 4.0 * time.sigma);
        assert_true(time.sigma > 0.0 && time.sigma < 0.15 * 3.0);
        bst_readout_frames quiet = f;
        quiet.bias_variance = quiet.dark_variance = 0.0;
        bst_sensor_estimate naive = bst_readout_time(&quiet);
        assert_true(naive.value - 3.0 > 3.0 * naive.sigma);
    }
    for (int x = 0; x < f.width - BST_READOUT_TIME_COLUMNS + 1; x++) {
        dark[x] = NAN;
    }
    assert_true(isnan(bst_readout_time(&f).value));
    free(bias);
    free(dark);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(shares_are_those_of_the_distributions),
        cmocka_unit_test(fit_finds_the_distribution),
        cmocka_unit_test(traps_are_found_on_each_side),
        cmocka_unit_test(hits_are_counted_by_area_and_time),
        cmocka_unit_test(hits_have_electrons_and_micrometres),
        cmocka_unit_test(neighbours_give_back_the_noise_that_they_share),
        cmocka_unit_test(readout_time_is_that_of_the_charge_behind_hot_pixels)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
