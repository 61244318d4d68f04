/* Calibration files: written and read back; what is wrong with one is said. */
#include <unistd.h>

#include "boresight/rng.h"
#include "obsgen/calibration.h"
#include "tests/test_support.h"

static void write_text(const char *path, const char *text) {
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

static void a_file_reads_back_as_it_was(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char path[BST_TEST_PATH];
    bst_test_template(path, "calibration");
    close(mkstemp(path));
    bst_obsgen_calibration c, back;
    bst_obsgen_calibration_theory(&c);
    c.gain[2] = 0.93;
    c.threshold_offset = -0.012345678901234567;
    memset(c.made_from, 0, sizeof c.made_from);
    snprintf(c.made_from, sizeof c.made_from, "a, b");
    bst_assert_ok(&ctx, bst_obsgen_calibration_write(&ctx, path, &c));
    bst_assert_ok(&ctx, bst_obsgen_calibration_read(&ctx, path, &back));
    assert_memory_equal(&c, &back, sizeof c);
    remove(path);
}

static void refuse(const char *text, const char *part) {
    bst_ctx ctx = {0};
    char path[BST_TEST_PATH];
    bst_test_template(path, "calibration");
    close(mkstemp(path));
    write_text(path, text);
    bst_obsgen_calibration c;
    assert_int_not_equal(bst_obsgen_calibration_read(&ctx, path, &c), BST_OK);
    if (!strstr(ctx.message, part) || !strstr(ctx.message, path)) {
        fail_msg("\"%s\" does not hold \"%s\" and the file", ctx.message, part);
    }
    remove(path);
}

static void what_is_wrong_is_said(void **state) {
    (void)state;
    refuse("{}", "make one with `boresight calibrate-obsgen`");
    refuse("{\"boresight_obsgen\": 99}", "make the calibration anew");
    refuse("{\"boresight_obsgen\": \"1\"}", "make the calibration anew");
    refuse("{\"boresight_obsgen\": 5}", "/threshold_offset: missing");
    refuse("{\"boresight_obsgen\": 5, \"gian\": 2}", "did you mean \"gain\"");
    refuse("not json", "");
    bst_ctx ctx = {0};
    bst_obsgen_calibration c;
    assert_int_not_equal(bst_obsgen_calibration_read(&ctx, "/nonexistent.json", &c), BST_OK);
    assert_non_null(strstr(ctx.message, "/nonexistent.json"));
}

static void tables_are_straight_between_nodes(void **state) {
    (void)state;
    const double x[] = {1, 2, 4}, y[] = {10, 20, 0};
    /* exact in binary */
    bst_assert_close(bst_obsgen_between(x, y, 3, 0.0), 10.0, 0.0);
    bst_assert_close(bst_obsgen_between(x, y, 3, 1.5), 15.0, 0.0);
    bst_assert_close(bst_obsgen_between(x, y, 3, 3.0), 10.0, 0.0);
    bst_assert_close(bst_obsgen_between(x, y, 3, 9.0), 0.0, 0.0);
}

/* Mean of the highest output within 1.6 S sqrt(2) of a source of this SNR: a smooth normal field
 * whose correlation is the output's own shape, by its exact expansion exp(-r^2 / 2) sum z_ij u^i
 * v^j / sqrt(i! j!). */
static double mean_peak(double snr) {
    enum { ORDER = 8, DRAWS = 4000, SIDE = 33 };
    bst_rng_key key = bst_rng_make_key(4, 0, "test", "peak");
    double factorial[ORDER + 1] = {1.0}, sum = 0.0;
    for (int i = 1; i <= ORDER; i++) {
        factorial[i] = i * factorial[i - 1];
    }
    for (uint64_t n = 0; n < DRAWS; n++) {
        double z[ORDER + 1][ORDER + 1], most = 0.0;
        for (int i = 0; i <= ORDER; i++) {
            for (int j = 0; j <= ORDER; j++) {
                z[i][j] = bst_rng_normal(key, n, (uint64_t)(i * 16 + j)) /
                          sqrt(factorial[i] * factorial[j]);
            }
        }
        z[0][0] += snr;
        for (int k = 0; k < SIDE * SIDE; k++) {
            double u = 0.1 * (k % SIDE - SIDE / 2), v = 0.1 * (k / SIDE - SIDE / 2), value = 0.0;
            for (int i = ORDER; i >= 0; i--) { /* Horner */
                double row = 0.0;
                for (int j = ORDER; j >= 0; j--) {
                    row = row * v + z[i][j];
                }
                value = value * u + row;
            }
            most = fmax(most, value * exp(-0.5 * (u * u + v * v)));
        }
        sum += most / DRAWS;
    }
    return sum;
}

/* Noise raises the peak near a source by 1 / SNR. */
static void peaks_are_raised_by_noise(void **state) {
    (void)state;
    for (double snr = 4.5; snr < 13.0; snr += 4.0) {
        double raised = bst_obsgen_peak(snr, 1.0 + 1.0 / 25.0) - snr;
        /* 4000 draws: 0.016; terms of the next order, 1 / SNR^3, are below 0.03 */
        bst_assert_close(mean_peak(snr) - snr, raised, 0.06);
        bst_assert_close(raised, 1.0 / snr, 1e-12);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_file_reads_back_as_it_was),
        cmocka_unit_test(what_is_wrong_is_said),
        cmocka_unit_test(tables_are_straight_between_nodes),
        cmocka_unit_test(peaks_are_raised_by_noise),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
