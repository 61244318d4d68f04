#include <stdlib.h>

#include "boresight/rng.h"
#include "imgproc/detect/background.h"
#include "imgproc/detect/truncated_moments.h"
#include "tests/test_support.h"

enum { SIDE = 256 };

typedef struct fixture {
    bst_ctx ctx;
    bst_background b;
    bst_rng_key key;
    float image[SIDE * SIDE];
} fixture;

static int setup(void **state) {
    fixture *f = calloc(1, sizeof *f);
    assert_non_null(f);
    f->key = bst_rng_make_key(1, 2, "test", "background");
    bst_assert_ok(&f->ctx, bst_background_create(&f->ctx, 64, SIDE, SIDE, 1, &f->b));
    *state = f;
    return 0;
}
static int teardown(void **state) {
    fixture *f = *state;
    bst_background_free(&f->b);
    free(f);
    return 0;
}

/* level + slope x, normal noise, rounded to steps */
static void fill(fixture *f, double level, double slope, double sigma, double step) {
    for (int i = 0; i < SIDE * SIDE; i++) {
        double v = level + slope * (i % SIDE) + sigma * bst_rng_normal(f->key, 1, (uint64_t)i);
        f->image[i] = (float)(step * floor(v / step + 0.5));
    }
}

/* Noise from far above the step to half of it: 2048 pixels a mesh give the level to sigma / 45 and
 * the noise to 1.6 %; four of each over 16 meshes, and 1 % for clipping in steps. */
static void level_and_noise(void **state) {
    fixture *f = *state;
    static const double steps[] = {0.1, 1.0, 4.0, 8.0, 14.0};
    for (size_t c = 0; c < sizeof steps / sizeof *steps; c++) {
        double sigma = 7.0;
        fill(f, 103.3, 0.0, sigma, steps[c]);
        bst_background_estimate(&f->b, f->image, SIDE, SIDE, (float)steps[c]);
        double expected = sqrt(sigma * sigma + steps[c] * steps[c] / 12.0);
        for (int k = 0; k < 16; k++) {
            bst_assert_close(f->b.level[k], 103.3, 4.0 * expected / 45.0 + 0.01 * steps[c]);
            bst_assert_close(f->b.noise[k], expected, (0.064 + 0.01) * expected);
        }
    }
}

/* A tenth of the pixels 10 to 1000 sigma high: the level moves by less than 0.05 sigma, the noise
 * by less than 6 %. */
static void stars_do_not_count(void **state) {
    fixture *f = *state;
    fill(f, 50.0, 0.0, 5.0, 0.5);
    for (int i = 0; i < SIDE * SIDE; i += 10) {
        f->image[i] += (float)(50.0 * pow(100.0, bst_rng_uniform(f->key, 2, (uint64_t)i)));
    }
    bst_background_estimate(&f->b, f->image, SIDE, SIDE, 0.5f);
    bst_assert_close(f->b.median_level, 50.0, 0.25);
    bst_assert_close(f->b.median_noise, 5.0, 0.3);
}

/* Constant images and ones without a usable pixel. */
static void degenerate(void **state) {
    fixture *f = *state;
    fill(f, 20.0, 0.0, 0.0, 2.0);
    bst_background_estimate(&f->b, f->image, SIDE, SIDE, 2.0f);
    bst_assert_close(f->b.median_level, 20.0, 1e-6);
    bst_assert_close(f->b.median_noise, 2.0 / sqrt(12.0), 1e-6);
    for (int i = 0; i < SIDE * SIDE; i++) {
        f->image[i] = i % SIDE < 64 ? BST_PIXEL_BAD : 20.0f;
    }
    bst_background_estimate(&f->b, f->image, SIDE, SIDE, 2.0f);
    bst_assert_close(f->b.level[0], 20.0, 1e-6);
    for (int i = 0; i < SIDE * SIDE; i++) {
        f->image[i] = BST_PIXEL_BAD;
    }
    bst_background_estimate(&f->b, f->image, SIDE, SIDE, 2.0f);
    assert_true(isfinite(f->b.median_level) && f->b.median_noise > 0.0f);
}

/* A plane comes back as a plane, up to the edges; noise at a place agrees with the row. */
static void interpolation(void **state) {
    fixture *f = *state;
    fill(f, 10.0, 0.5, 0.0, 1e-3);
    bst_background_estimate(&f->b, f->image, SIDE, SIDE, 1e-3f);
    float level[SIDE], inverse[SIDE];
    for (int y = 0; y < SIDE; y += 17) {
        bst_background_row(&f->b, y, level, inverse);
        for (int x = 0; x < SIDE; x++) {
            /* a mesh samples whole columns: exact up to the image's step and rounding */
            bst_assert_close(level[x], 10.0 + 0.5 * x, 2e-3);
        }
        bst_assert_close(1.0 / (double)inverse[100] / bst_background_noise_at(&f->b, 100, y), 1.0,
                         1e-3);
    }
}

/* Where a coordinate is between mesh centres, which are at (k + 1/2) mesh - 1/2: the lower one, and
 * the part of the way to the next; less than 0 and more than 1 beyond the outermost. */
static int between(double p, int meshes, double *part) {
    int k = (int)floor((p + 0.5) / 64 - 0.5);
    k = k < 0 ? 0 : k > meshes - 2 ? meshes - 2 : k;
    *part = (p - (64 * k + 31.5)) / 64;
    return k;
}

static double mixed(const float *v, int columns, int i, int j, double u, double w) {
    const float *n = v + j * columns + i;
    return (1 - w) * ((1 - u) * (double)n[0] + u * (double)n[1]) +
           w * ((1 - u) * (double)n[columns] + u * (double)n[columns + 1]);
}

/* Maps in which all meshes differ: the level of a row is bilinear, and linear beyond the outermost
 * centres; noise at a place is bilinear, and 1 / noise of a row is linear between columns, both
 * constant beyond. */
static void every_pixel_between_meshes(void **state) {
    fixture *f = *state;
    bst_background *b = &f->b;
    enum { COLUMNS = 4, ROWS = 3 };
    b->columns = COLUMNS;
    b->rows = ROWS;
    b->width = SIDE - 20; /* the last column of meshes is cut */
    for (int k = 0; k < COLUMNS * ROWS; k++) {
        b->level[k] = (float)(20.0 + 13.0 * sin(7.0 * k));
        b->noise[k] = (float)(6.0 + 3.0 * cos(5.0 * k));
    }
    float level[SIDE], inverse[SIDE];
    for (int y = 0; y < 64 * ROWS; y += 5) {
        double w, u;
        int j = between(y, ROWS, &w);
        double held = fmin(fmax(w, 0.0), 1.0);
        bst_background_row(b, y, level, inverse);
        for (int x = 0; x < b->width; x++) {
            int i = between(x, COLUMNS, &u);
            double part = fmin(fmax(u, 0.0), 1.0);
            bst_assert_close(level[x], mixed(b->level, COLUMNS, i, j, u, w), 1e-4);
            bst_assert_close(bst_background_level_at(b, x, y),
                             mixed(b->level, COLUMNS, i, j, part, held), 1e-4);
            bst_assert_close(bst_background_noise_at(b, x, y),
                             mixed(b->noise, COLUMNS, i, j, part, held), 1e-5);
            double left = mixed(b->noise, COLUMNS, i, j, 0.0, held),
                   right = mixed(b->noise, COLUMNS, i, j, 1.0, held);
            bst_assert_close(inverse[x], (1 - part) / left + part / right, 1e-6);
        }
    }
}

static void of_image(const void *user, int y, int x, int count, float *out) {
    memcpy(out, (const float *)user + y * SIDE + x, (size_t)count * sizeof *out);
}

/* A Poisson variate, by multiplication of uniform ones (Knuth 1969). */
static int poisson(const fixture *f, double mean, uint64_t pixel) {
    double product = 1.0, least = exp(-mean);
    int n = -1;
    do {
        product *= bst_rng_uniform(f->key, 7, 64 * pixel + (uint64_t)++n);
    } while (product > least);
    return n;
}

/* The last clip of each mesh: its half width, least and greatest, and what is not counted noise. */
static struct {
    double least, most, read_variance_e2, step_e, origin_e;
    int count;
} clips;

void __real_bst_truncated_moments_solve(const bst_truncated_moments_noise *noise, double low,
                                        double high, double inner_mean, double inner_variance,
                                        double *mean, double *deviation);
void __wrap_bst_truncated_moments_solve(const bst_truncated_moments_noise *noise, double low,
                                        double high, double inner_mean, double inner_variance,
                                        double *mean, double *deviation);
void __wrap_bst_truncated_moments_solve(const bst_truncated_moments_noise *noise, double low,
                                        double high, double inner_mean, double inner_variance,
                                        double *mean, double *deviation) {
    if (clips.step_e > 0.0) {
        bst_assert_close(noise->read_variance_e2, clips.read_variance_e2, 1e-9);
        bst_assert_close(noise->step_e, clips.step_e, 1e-6);
        /* midway between digital values */
        double steps = (low - clips.origin_e) / clips.step_e;
        bst_assert_close(fabs(steps - floor(steps) - 0.5), 0.0, 1e-3);
        clips.least = fmin(clips.least, 0.5 * (high - low));
        clips.most = fmax(clips.most, 0.5 * (high - low));
        clips.count++;
    }
    __real_bst_truncated_moments_solve(noise, low, high, inner_mean, inner_variance, mean,
                                       deviation);
}

/* Few counted electrons: their noise is skewed, and the steps of the converter are coarse, with
 * digital values off zero. The clip takes more on one side, which the model of the noise gives
 * back: 16 meshes of 2048 pixels tell the level to sigma / 181 and the noise to 0.4 %. */
static void skewed_noise_in_coarse_steps(void **state) {
    fixture *f = *state;
    /* electrons, read noise, step, half width of the last clip in sigmas: more in coarse steps, and
     * where the counted variance is above 0.4 sigma^3 */
    static const double cases[][4] = {{4.0, 1.2, 0.5, 3.0},  {4.0, 1.2, 2.5, 4.0},
                                      {20.0, 3.0, 2.5, 3.0}, {1.0, 2.0, 0.5, 3.0},
                                      {2.0, 0.5, 0.3, 5.0},  {2.0, 1.2, 0.3, 3.0}};
    for (int c = 0; c < 6; c++) {
        double mean = cases[c][0], read = cases[c][1], step = cases[c][2], origin = -240.3;
        for (int i = 0; i < SIDE * SIDE; i++) {
            double e =
                poisson(f, mean, (uint64_t)i) + read * bst_rng_normal(f->key, 8, (uint64_t)i);
            f->image[i] = (float)(step * floor((e - origin) / step + 0.5) + origin);
        }
        const bst_background_input input = {of_image, f->image, step, origin, read * read};
        memset(&clips, 0, sizeof clips);
        clips.least = INFINITY;
        clips.read_variance_e2 = read * read;
        clips.step_e = step;
        clips.origin_e = origin;
        bst_background_read(&f->b, NULL, &input, SIDE, SIDE);
        clips.step_e = 0.0;
        double level = 0.0, noise = 0.0, want = sqrt(mean + read * read + step * step / 12.0);
        for (int k = 0; k < 16; k++) {
            level += (double)f->b.level[k] / 16.0;
            noise += (double)f->b.noise[k] / 16.0;
        }
        print_message("         %g: level %.4f noise %.4f of %.4f\n", mean, level, noise, want);
        bst_assert_close(level, mean, 4.0 * want / 181.0);
        bst_assert_close(noise / want, 1.0, 0.016);
        assert_int_equal(clips.count, 16);
        bst_assert_close(clips.least, cases[c][3] * want, step + 0.15 * want);
        bst_assert_close(clips.most, cases[c][3] * want, step + 0.15 * want);
    }
}

/* Moments of the values k - 1/2 < (e - origin) / step < k + 1/2 of Poisson electrons with read
 * noise, of those from k = first to last, by their probabilities. */
static void moments_by_probabilities(double counted, double read, double step, double origin,
                                     int first, int last, double *mean, double *variance) {
    double sum[3] = {0.0, 0.0, 0.0};
    for (int k = first; k <= last; k++) {
        double p = 0.0, value = origin + k * step, share = exp(-counted), c = read * sqrt(2.0);
        for (int n = 0; n < 150; n++) {
            p += share * 0.5 *
                 (erf((value + 0.5 * step - n) / c) - erf((value - 0.5 * step - n) / c));
            share *= counted / (n + 1);
        }
        sum[0] += p;
        sum[1] += p * value;
        sum[2] += p * value * value;
    }
    *mean = sum[1] / sum[0];
    *variance = sum[2] / sum[0] - *mean * *mean;
}

/* Mean and deviation of all values from those between two edges, at different distances. */
static void clipped_moments_are_corrected(void **state) {
    (void)state;
    /* electrons, read noise, step; least part of a deviation that is off in mean and in deviation
     */
    static const double cases[][4] = {{2.0, 0.5, 0.4, 1e-3},
                                      {8.0, 0.8, 1.0, 1e-3},
                                      {50.0, 4.0, 1.0, 2e-3},
                                      {30.0, 5.0, 3.0, 2e-3},
                                      {0.0, 6.0, 2.0, 2e-3}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        double counted = cases[c][0], read = cases[c][1], step = cases[c][2], mean, variance;
        double inner, inner_variance, origin = -7.3;
        moments_by_probabilities(counted, read, step, origin, -300, 400, &mean, &variance);
        double sigma = sqrt(variance);
        int first = (int)ceil((mean - 2.6 * sigma - origin) / step),
            last = (int)floor((mean + 3.2 * sigma - origin) / step);
        moments_by_probabilities(counted, read, step, origin, first, last, &inner, &inner_variance);
        const bst_truncated_moments_noise noise = {read * read, step};
        double got = mean + 0.05 * sigma, deviation = 0.97 * sigma;
        bst_truncated_moments_solve(&noise, origin + (first - 0.5) * step,
                                    origin + (last + 0.5) * step, inner, inner_variance, &got,
                                    &deviation);
        print_message("         off by %.5f and %.5f (inner %.5f %.5f)\n", (got - mean) / sigma,
                      deviation / sigma - 1.0, (inner - mean) / sigma,
                      sqrt(inner_variance) / sigma - 1.0);
        bst_assert_close((got - mean) / sigma, 0.0, cases[c][3]);
        bst_assert_close(deviation / sigma, 1.0, cases[c][3]);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(level_and_noise, setup, teardown),
        cmocka_unit_test_setup_teardown(stars_do_not_count, setup, teardown),
        cmocka_unit_test_setup_teardown(degenerate, setup, teardown),
        cmocka_unit_test_setup_teardown(interpolation, setup, teardown),
        cmocka_unit_test_setup_teardown(every_pixel_between_meshes, setup, teardown),
        cmocka_unit_test_setup_teardown(skewed_noise_in_coarse_steps, setup, teardown),
        cmocka_unit_test(clipped_moments_are_corrected),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
