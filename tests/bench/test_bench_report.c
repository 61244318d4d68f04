/* Report of speed and error: best points, fitted lines, and the table read back. */
#include <cjson/cJSON.h>
#include <math.h>

#include "sim/bench/bench_report.h"
#include "tests/io/scratch.h"
#include "tests/test_support.h"

static double draw(uint64_t *seed) {
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(*seed >> 33) / 2147483648.0;
}

/* Sorted by time, then error, a point is best if its error is below those of all quicker ones. */
static void best_points(void **state) {
    (void)state;
    static bst_bench_error_curve curve;
    uint64_t seed = 3;
    for (int round = 0; round < 200; round++) {
        curve.count = 1 + (int)(30 * draw(&seed));
        for (int i = 0; i < curve.count; i++) {
            curve.points[i].ms_min = floor(8 * draw(&seed)); /* many equal ones */
            curve.points[i].error_sigma_max = floor(8 * draw(&seed));
        }
        bst_bench_error_curve_mark_best(&curve);
        for (int i = 0; i < curve.count; i++) {
            double ms = curve.points[i].ms_min, quicker = INFINITY, as_quick = INFINITY;
            for (int k = 0; k < curve.count; k++) {
                const bst_bench_error_curve_point *q = &curve.points[k];
                if (q->ms_min < ms) {
                    quicker = fmin(quicker, q->error_sigma_max);
                } else if (q->ms_min == ms) {
                    as_quick = fmin(as_quick, q->error_sigma_max);
                }
            }
            double error = curve.points[i].error_sigma_max;
            assert_int_equal(curve.points[i].best, error < quicker && error == as_quick);
        }
    }
}

/* At the least squares of (a + b x) / y - 1 its derivatives by a and b vanish. */
static void lines(void **state) {
    (void)state;
    uint64_t seed = 4;
    bst_bench_growth_law g = {.count = 5};
    for (int i = 0; i < 5; i++) {
        g.size[i] = pow(10, i);
        g.ms_min[i] = 3.0 + 0.02 * g.size[i];
    }
    bst_bench_growth_law_fit(&g);
    bst_assert_close(g.offset_ms, 3.0, 1e-9);
    bst_assert_close(g.slope_ms, 0.02, 1e-11);
    bst_assert_close(g.worst_rel, 0.0, 1e-9);
    for (int round = 0; round < 20; round++) {
        double by_a = 0, by_b = 0, worst = 0;
        g.count = 4 + round % 12;
        for (int i = 0; i < g.count; i++) {
            g.size[i] = 1 + 50 * draw(&seed);
            g.ms_min[i] = (2 + 0.5 * g.size[i]) * (0.5 + draw(&seed));
        }
        bst_bench_growth_law_fit(&g);
        for (int i = 0; i < g.count; i++) {
            double miss = (g.offset_ms + g.slope_ms * g.size[i]) / g.ms_min[i] - 1;
            by_a += miss / g.ms_min[i];
            by_b += miss * g.size[i] / g.ms_min[i];
            worst = fmax(worst, fabs(miss));
        }
        bst_assert_close(by_a, 0, 1e-9);
        bst_assert_close(by_b, 0, 1e-9);
        bst_assert_close(g.worst_rel, worst, 1e-12);
    }
    g.count = 1;
    bst_bench_growth_law_fit(&g);
    assert_true(isnan(g.offset_ms) && isnan(g.slope_ms));
}

static void expect(const char *text, const char *line) {
    if (!strstr(text, line)) {
        fail_msg("no \"%s\" in\n%s", line, text);
    }
}

static void page(void **state) {
    (void)state;
    static bst_bench_report r = {
        .curves = {{"dense",
                    {{"stamp_radius_px", "3", 1.25, 1.5, 2.75, 0.031, 0.04, 2e-4, true},
                     {"stamp_radius_px", "5", 2.5, NAN, 4.0, 0.02, NAN, -3.21e-5, false}},
                    2},
                   {"sparse", {{"fft_taps", "6", 12.5, 13, 14, 0.5, 0.6, 0.01, false}}, 1}},
        .factors = {{"dense", .ms = {{1.5, 2.5}, {3.5, 4.5}},
                     .error_sigma = {{0.11, 0.12}, {0.13, 0.14}}}},
        .stars = {.size = {100, 3000},
                  .ms_min = {2, 8},
                  .cpu_ms = {4, 16},
                  .peak_rss_mib = {50, 75},
                  .count = 2,
                  .offset_ms = 1.75,
                  .slope_ms = 0.0025,
                  .worst_rel = 0.25},
        .streak = {.size = {7},
                   .ms_min = {3},
                   .cpu_ms = {5},
                   .peak_rss_mib = {60},
                   .count = 1,
                   .offset_ms = 1,
                   .slope_ms = 0.5,
                   .worst_rel = 0.5},
        .curve_count = 2,
        .factor_count = 1,
        .has_growth = true};
    static char text[20000];
    bst_ctx ctx = {0};
    scratch place;
    cJSON *machine = cJSON_Parse(
        "{\"cores\": 6, \"cpu\": \"abacus\", \"device\": \"\", \"date\": \"today\", "
        "\"load_before\": 0.25}");
    assert_int_equal(setenv("PATH", "", 1), 0); /* no pictures */
    scratch_make(&place);
    bst_assert_ok(&ctx, bst_bench_report_write(&ctx, &r, machine, place.folder));
    cJSON_Delete(machine);
    FILE *file = fopen(scratch_path(&place, "speed_error.md"), "r");
    assert_non_null(file);
    size_t n = fread(text, 1, sizeof text - 1, file);
    text[n] = '\0';
    fclose(file);
    expect(text, "\n\nMachine: 6 cores, abacus, today. Load before it began: 0.2.\n\n");
    expect(text,
           "| `dense` | 3 | 1.25 | 1.5 | 2.75 | 0.031 | 0.04 | 2.0e-04 | ● |\n"
           "| `dense` | 5 | 2.5 | | 4 | 0.02 | | -3.2e-05 | |\n\n");
    expect(text, "| `sparse` | 6 | 12.5 | 13 | 14 | 0.5 | 0.6 | 1.0e-02 | |\n\n");
    assert_null(strstr(text, "psf_degree")); /* nothing measured */
    assert_null(strstr(text, "!["));
    expect(text, "| factor | renderer | `dense` ms | σ |\n|---|---|---|---|\n");
    expect(text, "| single | 1.5 | 0.11 |\n");
    expect(text, "| multi | 2.5 | 0.12 |\n");
    expect(text, "| single | 3.5 | 0.13 |\n");
    expect(text, "| multi | 4.5 | 0.14 |\n");
    expect(text,
           "| 100 | 2 | 2 | 4 | 50 |\n| 3000 | 8 | 9.25 | 16 | 75 |\n\n"
           "Fit: 1.75 ms + 2.5 ms per 1000 stars; the measured times differ from it by at most 25 "
           "%.\n");
    expect(text,
           "| 7 | 3 | 4.5 | 5 | 60 |\n\n"
           "Fit: 1 ms + 500 ms per 1000 px; the measured times differ from it by at most 50 %.\n");
    assert_true(text[n - 1] == '\n' && text[n - 2] != '\n');
    scratch_remove(&place);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(best_points),
        cmocka_unit_test(lines),
        cmocka_unit_test(page),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
