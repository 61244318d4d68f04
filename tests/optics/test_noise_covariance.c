/* Noise that is correlated from read to read: its recursions against the sums over all pairs. */
#include "sim/optics/pixel_flicker.h"
#include "sim/optics/ramp_fit.h"
#include "tests/test_support.h"

enum { FRAMES = 7 };

/* The frames' covariance that the recursion's steps make of independent deviates is that of
 * Ornstein-Uhlenbeck processes at the times of the reads, with white noise. */
static void frames_have_the_covariance_of_their_reads(void **state) {
    (void)state;
    static const double reads[FRAMES] = {0.4, 0.9, 1.9, 2.0, 7.5, 8.1, 30.0};
    static const double doubles[2] = {0.0, 0.03}, whites[2] = {0.0, 1.7};
    bst_detector_config d = {0};
    d.pixel_flicker_noise.rms_e = 3.0;
    d.pixel_flicker_noise.lowest_hz = 0.01;
    d.pixel_flicker_noise.highest_hz = 2.0;
    for (int c = 0; c < 4; c++) {
        double apart = doubles[c / 2], white = whites[c % 2];
        double by_deviate[FRAMES][FRAMES] = {{0}};
        double mean[BST_FLICKER_TERMS][FRAMES] = {{0}}; /* of each process, by deviate */
        bst_pixel_flicker f, whole;
        bst_pixel_flicker_begin(&d, &f);
        whole = f;
        assert_in_range(f.terms, 4, BST_FLICKER_TERMS);
        for (int k = 0; k < FRAMES; k++) {
            bst_pixel_flicker_step step;
            bst_pixel_flicker_advance(&f, reads[k], apart, white, &step);
            for (int j = 0; j < k; j++) {
                for (int i = 0; i < step.terms; i++) {
                    by_deviate[k][j] += step.weight[i] * mean[i][j];
                    mean[i][j] *= step.decay[i];
                }
            }
            by_deviate[k][k] = step.spread;
            for (int i = 0; i < step.terms; i++) {
                mean[i][k] = step.gain[i];
            }
        }
        for (int k = 0; k < FRAMES; k++) {
            for (int m = 0; m <= k; m++) {
                double found = 0.0, t = reads[k] - reads[m];
                for (int j = 0; j <= m; j++) {
                    found += by_deviate[k][j] * by_deviate[m][j];
                }
                double expected = bst_pixel_flicker_covariance(&whole, t);
                if (apart > 0.0) { /* of differences of reads */
                    expected = 2.0 * expected - bst_pixel_flicker_covariance(&whole, t + apart) -
                               bst_pixel_flicker_covariance(&whole, t - apart);
                }
                expected += k == m ? white * white : 0.0;
                bst_assert_close(found, expected, 1e-9);
            }
        }
        /* the processes together have the stated RMS */
        bst_assert_close(bst_pixel_flicker_covariance(&whole, 0.0), 9.0, 1e-9);
    }
}

/* Noise of a slope through the reads, and of the last less the first. */
static void slopes_have_the_noise_of_their_reads(void **state) {
    (void)state;
    for (int c = 0; c < 8; c++) {
        const bst_detector_ramp_config ramp = {
            .reads = 9,
            .fit = c % 2 ? BST_RAMP_LAST_MINUS_FIRST : BST_RAMP_SLOPE,
            .flicker_noise_e = c & 2 ? 4.0 : 0.0};
        int used = c & 4 ? 5 : 9;
        double weight[BST_RAMP_READS], expected = 0.0, one = 0.0, zero = 0.0;
        bst_ramp_weights(&ramp, used, weight);
        for (int i = 0; i < used; i++) {
            zero += weight[i];
            one += weight[i] * i;
        }
        /* an offset counts for nothing, a slope for its signal in all reads */
        bst_assert_close(zero, 0.0, 1e-12);
        bst_assert_close(one, 8.0, 1e-12);
        for (int i = 0; i < used; i++) {
            for (int j = 0; j < used; j++) {
                double flicker = 0.0; /* six time constants, each four times the one before */
                for (double tau = 1.0; tau < 2000.0; tau *= 4.0) {
                    flicker += exp(-fabs((double)(i - j)) / tau) / 6.0;
                }
                expected += weight[i] * weight[j] *
                            ((i == j ? 2.5 * 2.5 : 0.0) +
                             ramp.flicker_noise_e * ramp.flicker_noise_e * flicker);
            }
        }
        bst_assert_close(bst_ramp_noise_e(&ramp, 2.5, used), sqrt(expected), 1e-9);
        /* shot noise: charge that comes between two reads is in all the later ones */
        double excess = 0.0, all[BST_RAMP_READS];
        bst_ramp_weights(&ramp, 9, all);
        for (int from = 1; from < 9; from++) {
            double later = 0.0;
            for (int i = from; i < 9; i++) {
                later += all[i];
            }
            excess += later * later / 8.0;
        }
        bst_assert_close(bst_ramp_excess(&ramp), excess, 1e-12);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(frames_have_the_covariance_of_their_reads),
                                       cmocka_unit_test(slopes_have_the_noise_of_their_reads)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
