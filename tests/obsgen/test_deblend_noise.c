/* Noise between two maxima of the filter output: the pixels that are asked, and how their noise is
 * correlated along and across the stars' path, are those of the sources. Linked with a wrap of the
 * correlation, which keeps what it is asked. */
#include "boresight/vec.h"
#include "obsgen/generator_internal.h"
#include "tests/test_support.h"

enum { MOST_CALLS = 4000 };
#define FILTER 0.97 /* px: of the filter alone, to tell it from other widths */

typedef struct call {
    double along, across, length;
} call;

static call calls[MOST_CALLS];
static int count;

double __real_bst_matched_falloff(double along_px, double across_px, double length_px,
                                  double sigma_px);
double __wrap_bst_matched_falloff(double along_px, double across_px, double length_px,
                                  double sigma_px);
double __wrap_bst_matched_falloff(double along_px, double across_px, double length_px,
                                  double sigma_px) {
    if (sigma_px == FILTER && count < MOST_CALLS) {
        calls[count++] = (call){along_px, across_px, length_px};
    }
    return __real_bst_matched_falloff(along_px, across_px, length_px, sigma_px);
}

static bst_generator generator;

static bst_generator *make(generator_source *sources, bool streaks) {
    bst_generator *g = &generator;
    *g = (bst_generator){.binning = 1,
                         .width = 200,
                         .height = 150,
                         .sigma = 0.9,
                         .total_sigma = 0.945,
                         .fitted_sigma = 0.9,
                         .filter_sigma = FILTER,
                         .cross_sigma = sqrt(2.0) * FILTER,
                         .threshold = 5.0,
                         .reach = 30.0,
                         .calibration = {.blend_distance_factor = 1.0},
                         .filters = {{.variance = 1.0}, {.variance = 1.0}},
                         .sources = sources,
                         .source_count = 2};
    g->response.source.across_px = g->response.source.along_px = 0.945;
    g->response.filter = g->response.both = g->response.source;
    g->key = bst_rng_make_key(3, 0, "test", "saddle");
    if (streaks) {
        g->star_path = (bst_obsgen_path_px){.dx = -6.0, .dy = 8.0};
        g->streak = 10.0;
    }
    for (int k = 0; k < 2; k++) {
        sources[k].as_streak = streaks;
        sources[k].level = sources[k].amplitude = sources[k].peak = k == 0 ? 12.0 : 10.0;
        sources[k].name = (uint64_t)k;
        sources[k].length = streaks ? 10.0 : 0.0;
        sources[k].path = g->star_path;
    }
    return g;
}

/* Differences of pixels are whole ones in the frame's axes, on the line between the maxima. */
static void check(bool streaks, const double offset[2]) {
    generator_source sources[2] = {{.x = 80.2, .y = 60.9},
                                   {.x = 80.2 + offset[0], .y = 60.9 + offset[1]}};
    bst_generator *g = make(sources, streaks);
    double c = streaks ? -0.6 : 1.0, s = streaks ? 0.8 : 0.0, most = 0.0;
    bool sign[2] = {false, false};
    count = 0;
    (void)bst_generator_separates(g, &sources[0], &sources[1]);
    assert_true(count > 5);
    for (int i = 0; i < count; i++) {
        double dx = calls[i].along * c - calls[i].across * s,
               dy = calls[i].along * s + calls[i].across * c;
        bst_assert_close(dx, round(dx), 1e-9);
        bst_assert_close(dy, round(dy), 1e-9);
        /* beside the line by the rounding of places, and of maxima that light pulls */
        bst_assert_close((dx * offset[1] - dy * offset[0]) / hypot(offset[0], offset[1]), 0.0, 2.1);
        bst_assert_close(calls[i].length, streaks ? 10.0 : 0.0, 1e-12);
        most = fmax(most, hypot(dx, dy));
        double along = dx * offset[0] + dy * offset[1];
        sign[along > 0.0] = sign[along > 0.0] || along != 0.0;
    }
    /* from end to end */
    bst_assert_close(most, hypot(offset[0], offset[1]), 2.1);
    assert_true(sign[0] || sign[1]);
}

static void correlation_is_that_of_the_pixels(void **state) {
    (void)state;
    static const double points[][2] = {{4.0, 1.2}, {-1.4, 4.1}, {-3.1, -2.8}};
    for (int k = 0; k < 3; k++) {
        check(false, points[k]);
    }
    static const double streaks[][2] = {{4.6, 2.1}, {-3.8, -3.9}, {-9.2, 8.1}};
    for (int k = 0; k < 3; k++) {
        check(true, streaks[k]);
    }
}

/* Share of frames in which noise parts two sources whose saddle is near the limit. */
static void noise_decides_at_the_limit(void **state) {
    (void)state;
    enum { FRAMES = 6000 };
    int parted = 0, without = 0;
    for (int n = 0; n < FRAMES; n++) {
        generator_source sources[2] = {{.x = 80.0, .y = 60.0}, {.x = 84.0, .y = 60.0}};
        bst_generator *g = make(sources, false);
        sources[0].level = 14.0;
        g->exposure_id = n;
        parted += bst_generator_separates(g, &sources[0], &sources[1]);
        g->filters[0].variance = 1e-6;
        without += bst_generator_separates(g, &sources[0], &sources[1]);
    }
    /* the middle pixel, 2 px from both, needs 3 less than the fainter maximum, with its noise given
     * that of the maxima; the pixels beside it have 3 more */
    double light2 = exp(-4.0 / (4.0 * 0.945 * 0.945)), light4 = exp(-16.0 / (4.0 * 0.945 * 0.945));
    double near = exp(-4.0 / (4.0 * FILTER * FILTER)), far = exp(-16.0 / (4.0 * FILTER * FILTER));
    double limit = 10.0 + 14.0 * light4 - 3.0,
           z = (limit - 24.0 * light2) / sqrt(1.0 - 2.0 * near * near / (1.0 + far));
    double share = 0.5 * erfc(-z / sqrt(2.0));
    assert_true(share > 0.15 && share < 0.3);
    assert_int_equal(without, 0);
    /* four standard deviations of the count */
    bst_assert_close((double)parted / FRAMES, share, 4.0 * sqrt(share * (1.0 - share) / FRAMES));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(correlation_is_that_of_the_pixels),
        cmocka_unit_test(noise_decides_at_the_limit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
