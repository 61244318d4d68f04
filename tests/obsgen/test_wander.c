/* Where the top of the filters' output about a faint streak lies: against the bound where noise is
 * little, and against filtered pixels where it is much. */
#include "obsgen/wander.h"
#include "sim/core/vec.h"
#include "tests/test_support.h"

static const double LENGTH = 8.0, SIGMA = 0.9;

typedef struct spread {
    double along, across; /* RMS, px */
    double points;        /* share */
    int far, seen;        /* more than 1.5 px off along; above the threshold */
} spread;

static bst_rng_key key_of(int number) {
    const bst_rng_key key = {{0x1234u, (uint32_t)number}};
    return key;
}

static spread draw_many(const bst_wander_source *sources, int count, double threshold, int trials) {
    bst_wander w = {0};
    bst_wander_set(&w, LENGTH, SIGMA);
    assert_true(w.steps > 0);
    spread out = {0};
    for (int i = 0; i < trials; i++) {
        bst_wander_top top = bst_wander_draw(&w, key_of(i), sources, count, 1.0, threshold);
        if (!(top.snr > threshold)) {
            continue;
        }
        out.seen++;
        out.points += top.point;
        if (!top.point) {
            out.along += top.along_px * top.along_px;
            out.across += top.across_px * top.across_px;
            out.far += fabs(top.along_px) > 1.5;
        }
    }
    double streaks = out.seen - out.points;
    out.along = sqrt(out.along / streaks);
    out.across = sqrt(out.across / streaks);
    out.points /= out.seen;
    return out;
}

static void bright_streaks_scatter_as_the_bound_says(void **state) {
    (void)state;
    const double snr = 30.0;
    bst_wander w = {0};
    bst_wander_set(&w, LENGTH, SIGMA);
    const bst_wander_source alone = {0.0, 0.0, snr};
    spread s = draw_many(&alone, 1, 5.0, 3000);
    /* steps and rows are coarse: 4 % besides the 1.3 % that 3,000 trials tell */
    bst_assert_close(s.along * snr * sqrt(w.curvature), 1.0, 0.06);
    bst_assert_close(s.across * snr / (SIGMA * sqrt(2.0)), 1.0, 0.06);
    bst_assert_close(s.points, 0.0, 0.0);
}

enum { WIDE = 41, HIGH = 21, FINE = 2, TRIALS = 1200 };

/* Image of a streak along x, or of a point (length 0), about (x, y), of unit norm. */
static void draw_image(double x, double y, double length, double *out) {
    double square = 0.0, s = SIGMA * sqrt(2.0);
    for (int j = 0; j < HIGH; j++) {
        for (int i = 0; i < WIDE; i++) {
            double u = i - x, v = j - y;
            double along = length > 0.0 ? erf((u + 0.5 * length) / s) - erf((u - 0.5 * length) / s)
                                        : exp(-0.5 * u * u / (SIGMA * SIGMA));
            out[j * WIDE + i] = along * exp(-0.5 * v * v / (SIGMA * SIGMA));
            square += out[j * WIDE + i] * out[j * WIDE + i];
        }
    }
    for (int k = 0; k < WIDE * HIGH; k++) {
        out[k] /= sqrt(square);
    }
}

/* The same by filtering pixels at every half of one. */
static spread filter_many(double snr, double threshold) {
    enum { REACH = 12, ROWS = 4, PLACES = (2 * REACH + 1) * (2 * ROWS + 1) };
    double *kernel = malloc(2 * PLACES * WIDE * HIGH * sizeof *kernel);
    double light[WIDE * HIGH], data[WIDE * HIGH];
    assert_non_null(kernel);
    double x = 0.5 * (WIDE - 1), y = 0.5 * (HIGH - 1);
    draw_image(x, y, LENGTH, light);
    for (int p = 0; p < PLACES; p++) {
        double u = (p % (2 * REACH + 1) - REACH) / (double)FINE;
        double v = (double)(p / (2 * REACH + 1) - ROWS) / (double)FINE;
        draw_image(x + u, y + v, LENGTH, &kernel[(size_t)2 * p * WIDE * HIGH]);
        draw_image(x + u, y + v, 0.0, &kernel[(size_t)(2 * p + 1) * WIDE * HIGH]);
    }
    spread out = {0};
    for (int n = 0; n < TRIALS; n++) {
        for (int k = 0; k < WIDE * HIGH; k++) {
            data[k] = snr * light[k] + bst_rng_normal(key_of(7), (uint64_t)n, (uint64_t)k);
        }
        double best = -INFINITY;
        int at = 0;
        for (int p = 0; p < 2 * PLACES; p++) {
            const double *one = &kernel[(size_t)p * WIDE * HIGH];
            double sum = 0.0;
            for (int k = 0; k < WIDE * HIGH; k++) {
                sum += one[k] * data[k];
            }
            at = sum > best ? p : at;
            best = fmax(best, sum);
        }
        if (best > threshold) {
            double u = (at / 2 % (2 * REACH + 1) - REACH) / (double)FINE;
            double v = (double)(at / 2 / (2 * REACH + 1) - ROWS) / (double)FINE;
            out.seen++;
            out.points += at % 2;
            out.along += at % 2 ? 0.0 : u * u;
            out.across += at % 2 ? 0.0 : v * v;
            out.far += at % 2 == 0 && fabs(u) > 1.5;
        }
    }
    double streaks = out.seen - out.points;
    /* steps of half a pixel add a twelfth of their square */
    out.along = sqrt(out.along / streaks - 1.0 / 48.0);
    out.across = sqrt(out.across / streaks - 1.0 / 48.0);
    out.points /= out.seen;
    free(kernel);
    return out;
}

static void faint_streaks_scatter_as_filtered_pixels_do(void **state) {
    (void)state;
    const double snr = 5.5, threshold = 5.0;
    const bst_wander_source alone = {0.0, 0.0, snr};
    spread drawn = draw_many(&alone, 1, threshold, 4000), pixels = filter_many(snr, threshold);
    /* 900 or so pass in pixels: 2.4 % and more of an RMS with tails, 0.7 % of a share */
    bst_assert_close(drawn.along / pixels.along, 1.0, 0.1);
    bst_assert_close(drawn.across / pixels.across, 1.0, 0.1);
    bst_assert_close(drawn.points, pixels.points, 0.02);
    bst_assert_close(drawn.far / (double)drawn.seen, pixels.far / (double)pixels.seen, 0.025);
    /* the bound alone would have 0.6 of them */
    bst_wander w = {0};
    bst_wander_set(&w, LENGTH, SIGMA);
    assert_true(drawn.along * snr * sqrt(w.curvature) > 1.1);
}

/* Two streaks on one line, further apart than the bound: found about either, or between. */
static void two_on_one_line_are_found_anywhere_on_it(void **state) {
    (void)state;
    const bst_wander_source two[2] = {{0.0, 0.0, 9.0}, {LENGTH, 0.0, 9.0}};
    bst_wander w = {0};
    bst_wander_set(&w, LENGTH, SIGMA);
    int own = 0, between = 0;
    for (int i = 0; i < 2000; i++) {
        bst_wander_top top = bst_wander_draw(&w, key_of(i), two, 2, 1.0, 5.0);
        own += fabs(top.along_px) < 1.0;
        between += top.along_px > 2.0;
    }
    assert_true(own < 1200);
    assert_true(between > 500);
}

static void draws_are_the_keys_alone(void **state) {
    (void)state;
    bst_wander w = {0};
    bst_wander_set(&w, LENGTH, SIGMA);
    const bst_wander_source alone = {0.0, 0.0, 6.0};
    bst_wander_top first = bst_wander_draw(&w, key_of(1), &alone, 1, 1.0, 5.0);
    bst_wander_top other = bst_wander_draw(&w, key_of(2), &alone, 1, 1.0, 5.0);
    bst_wander_top again = bst_wander_draw(&w, key_of(1), &alone, 1, 1.0, 5.0);
    assert_true(first.along_px == again.along_px && first.snr == again.snr);
    assert_true(first.along_px != other.along_px);
    bst_wander_set(&w, 4000.0, SIGMA); /* too long: there is nothing to draw from */
    assert_int_equal(w.steps, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bright_streaks_scatter_as_the_bound_says),
        cmocka_unit_test(faint_streaks_scatter_as_filtered_pixels_do),
        cmocka_unit_test(two_on_one_line_are_found_anywhere_on_it),
        cmocka_unit_test(draws_are_the_keys_alone),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
