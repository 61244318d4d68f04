/* Jitter: RMS, spectrum, independence of the order of calls, a day without drift. */
#include <stdlib.h>

#include "boresight/vec.h"
#include "gimbal/jitter/jitter.h"
#include "tests/gimbal/periodogram.h"
#include "tests/test_support.h"

static bst_rng_key key(const char *stream) {
    return bst_rng_make_key(7, 0, "a/b/gimbal", stream);
}

static const bst_jitter_spec high_only = {
    .low_cutoff_hz = 0.05, .high_rms_rad = 3e-6, .high_min_hz = 5.0, .high_max_hz = 200.0};
static const bst_jitter_spec low_only = {
    .low_rms_rad = 7e-6, .low_cutoff_hz = 0.05, .high_min_hz = 5.0, .high_max_hz = 200.0};
static const bst_jitter_spec both = {.low_rms_rad = 7e-6,
                                     .low_cutoff_hz = 0.05,
                                     .high_rms_rad = 3e-6,
                                     .high_min_hz = 5.0,
                                     .high_max_hz = 200.0};

static double radial_rms(const bst_jitter_spec *spec, double dt_s, int steps) {
    bst_jitter j;
    bst_jitter_init(&j, spec, dt_s, key("rms"));
    double sum = 0.0;
    for (int n = 0; n < steps; n++) {
        double v[2];
        bst_jitter_at(&j, n, v);
        sum += v[0] * v[0] + v[1] * v[1];
    }
    return sqrt(sum / steps);
}

static void rms_is_what_was_asked(void **state) {
    (void)state;
    /* Cross terms of the lines average out as 1 / (line spacing * time): 6 Hz * 200 s, and
     * 3 mHz * 1e6 s. 1 % leaves room for neighbouring lines that happen to lie close. */
    bst_assert_close(radial_rms(&high_only, 1e-3, 200000) / 3e-6, 1.0, 0.01);
    bst_assert_close(radial_rms(&low_only, 2.0, 500000) / 7e-6, 1.0, 0.01);
}

static void spectrum_is_flat_in_its_band_and_empty_outside(void **state) {
    (void)state;
    enum { COUNT = 4096, SEGMENTS = 4 };
    static double x[COUNT];
    double total = 0.0, inside = 0.0, quarter[4] = {0};
    for (int axis = 0; axis < 2; axis++) {
        for (int segment = 0; segment < SEGMENTS; segment++) {
            bst_jitter j;
            bst_jitter_init(&j, &high_only, 1e-3, key("spectrum"));
            for (int n = 0; n < COUNT; n++) {
                double v[2];
                bst_jitter_at(&j, segment * 100000 + n, v);
                x[n] = v[axis];
            }
            for (int k = 0; k < COUNT / 2; k++) {
                double f = k / (COUNT * 1e-3);
                double p = periodogram(x, COUNT, 1e-3, f);
                total += p;
                if (f > 5.0 - 0.5 && f < 200.0 + 0.5) { /* two bins of window leakage */
                    inside += p;
                    int q = (int)((f - 5.0) / 195.0 * 4.0);
                    quarter[q < 0 ? 0 : q > 3 ? 3 : q] += p;
                }
            }
        }
    }
    assert_true(inside / total > 0.9999); /* Hann side lobes fall as f^-6 in power */
    for (int q = 0; q < 4; q++) {
        /* eight equal lines a quarter and axis: one at the edge may leak half of its power, and
         * lines less than 0.5 Hz apart beat within a segment */
        bst_assert_close(quarter[q] / total, 0.25, 0.03);
    }
}

static void slow_part_stays_below_its_cutoff(void **state) {
    (void)state;
    enum { COUNT = 8192 };
    static double x[COUNT];
    bst_jitter j;
    bst_jitter_init(&j, &low_only, 0.5, key("slow"));
    for (int n = 0; n < COUNT; n++) {
        double v[2];
        bst_jitter_at(&j, n, v);
        x[n] = v[0];
    }
    double total = 0.0, inside = 0.0;
    for (int k = 0; k < COUNT / 8; k++) {
        double f = k / (COUNT * 0.5), p = periodogram(x, COUNT, 0.5, f);
        total += p;
        inside += f <= 0.0505 ? p : 0.0;
    }
    assert_true(inside / total > 0.9999);
}

static void value_depends_on_the_step_alone(void **state) {
    (void)state;
    bst_jitter forward, jumping;
    bst_jitter_init(&forward, &both, 1e-3, key("order"));
    bst_jitter_init(&jumping, &both, 1e-3, key("order"));
    double at[3000][2];
    for (int n = 0; n < 3000; n++) {
        bst_jitter_at(&forward, n, at[n]);
    }
    for (int i = 0; i < 500; i++) {
        int n = (i * 1237) % 3000;
        double v[2];
        bst_jitter_at(&jumping, n, v);
        assert_memory_equal(v, at[n], sizeof v);
    }
}

/* The lines' closed form, a day on: the phasors are right there too. */
static void a_day_later_the_phase_is_still_right(void **state) {
    (void)state;
    bst_jitter j;
    bst_jitter_init(&j, &both, 1e-3, key("day"));
    int64_t n = (int64_t)86400 * 1000 + 255; /* the end of a rotation block */
    double v[2];
    bst_jitter_at(&j, n, v);
    long double expected = 0.0L;
    for (int i = 0; i < BST_JITTER_LINES; i++) {
        long double cycles = (long double)j.axis[0].frequency_hz[i] * (long double)n * 1e-3L +
                             (long double)j.axis[0].phase_cycles[i];
        expected += (long double)j.axis[0].amplitude[i] *
                    cosl(2.0L * 3.14159265358979323846L * (cycles - floorl(cycles)));
    }
    /* 200 Hz * 86400 s in double: 4e-9 cycles of phase, on 48 lines of at most 2.5e-6 rad */
    bst_assert_close(v[0], (double)expected, 1e-12);
}

static void silence_is_zero(void **state) {
    (void)state;
    bst_jitter_spec none = {.low_cutoff_hz = 0.05, .high_min_hz = 5.0, .high_max_hz = 200.0};
    bst_jitter j;
    bst_jitter_init(&j, &none, 1e-3, key("none"));
    double v[2] = {1.0, 1.0};
    bst_jitter_at(&j, 12345, v);
    assert_true(v[0] == 0.0 && v[1] == 0.0);
}

/* Mean square of straight lines through samples of what they can follow: with what they lack it is
 * what was asked for, at every rate, for bands below, across and above what samples can follow. */
static void samples_and_what_they_lack_are_all_of_it(void **state) {
    (void)state;
    const bst_jitter_spec specs[] = {
        high_only,
        {.high_rms_rad = 3e-6, .high_min_hz = 50.0, .high_max_hz = 900.0},
        {.high_rms_rad = 3e-6, .high_min_hz = 600.0, .high_max_hz = 900.0},
        {.low_rms_rad = 3e-6, .low_cutoff_hz = 800.0},
    };
    for (size_t i = 0; i < sizeof specs / sizeof *specs; i++) {
        for (double rate_hz = 300.0; rate_hz < 2e4; rate_hz *= 5.0) {
            double dt_s = 1.0 / rate_hz, sum = 0.0, before[2] = {0.0, 0.0};
            bst_jitter_spec resolved = bst_jitter_resolved(&specs[i], dt_s);
            bst_jitter j;
            bst_jitter_init(&j, &resolved, dt_s, key("lack"));
            int steps = (int)(20.0 * rate_hz);
            for (int n = 0; n <= steps; n++) {
                double v[2];
                bst_jitter_at(&j, n, v);
                for (int a = 0; a < 2; a++) {
                    sum += n > 0 ? (before[a] * before[a] + before[a] * v[a] + v[a] * v[a]) / 3.0
                                 : 0.0;
                    before[a] = v[a];
                }
            }
            double total = sum / steps + 2.0 * bst_jitter_unresolved_rad2(&specs[i], dt_s);
            /* lines lie somewhere in their slots of a 32nd of the band, and their cross terms
             * average out over 20 s of at least 3 Hz between them: 2 % */
            bst_assert_close(total / 9e-12, 1.0, 0.02);
        }
    }
    /* far below the rate, (w dt)^2 / 6 of the mean square: 200 Hz and less at 1 MHz */
    double lacks = bst_jitter_unresolved_rad2(&high_only, 1e-6) / (0.5 * 9e-12);
    double w2 = 4.0 * BST_PI * BST_PI * (200.0 * 200.0 + 200.0 * 5.0 + 25.0) / 3.0;
    bst_assert_close(lacks, w2 * 1e-12 / 6.0, 1e-12); /* the next term is (w dt)^4 / 72, 1e-14 */
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rms_is_what_was_asked),
        cmocka_unit_test(spectrum_is_flat_in_its_band_and_empty_outside),
        cmocka_unit_test(slow_part_stays_below_its_cutoff),
        cmocka_unit_test(value_depends_on_the_step_alone),
        cmocka_unit_test(a_day_later_the_phase_is_still_right),
        cmocka_unit_test(silence_is_zero),
        cmocka_unit_test(samples_and_what_they_lack_are_all_of_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
