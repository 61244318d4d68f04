#include "sim/optics/ramp_fit.h"

#include <assert.h>
#include <math.h>

/* Time constants of the 1/f noise, in reads, each four times the one before: in between their sum
 * falls as 1/f within 6 % (Lorentzians of equal variance; Milotti 2002, arXiv physics/0204033). */
enum { FLICKER_TERMS = 6 };

void bst_ramp_weights(const bst_detector_ramp_config *ramp, int used, double *weight) {
    assert(ramp && weight && used >= 2 && used <= ramp->reads && ramp->reads <= BST_RAMP_READS);
    double all = (double)ramp->reads - 1.0, n = used;
    for (int i = 0; i < used; i++) {
        weight[i] = 12.0 * all * (i - 0.5 * (n - 1.0)) / (n * (n * n - 1.0));
        if (ramp->fit == BST_RAMP_LAST_MINUS_FIRST) {
            weight[i] = all / (n - 1.0) * ((i == used - 1) - (i == 0));
        }
    }
}

double bst_ramp_excess(const bst_detector_ramp_config *ramp) {
    double weight[BST_RAMP_READS], of_interval = 0.0, squares = 0.0;
    int reads = (int)ramp->reads;
    bst_ramp_weights(ramp, reads, weight);
    for (int i = reads - 1; i > 0; i--) { /* the charge of an interval is in all later reads */
        of_interval += weight[i];
        squares += of_interval * of_interval;
    }
    return squares / (reads - 1.0);
}

double bst_ramp_noise_e(const bst_detector_ramp_config *ramp, double read_noise_e, int used) {
    assert(read_noise_e >= 0.0);
    double weight[BST_RAMP_READS], covariance[BST_RAMP_READS], variance = 0.0;
    bst_ramp_weights(ramp, used, weight);
    for (int n = 0; n < used; n++) {
        covariance[n] = n == 0 ? read_noise_e * read_noise_e : 0.0;
        for (int k = 0; k < FLICKER_TERMS; k++) {
            covariance[n] += ramp->flicker_noise_e * ramp->flicker_noise_e / FLICKER_TERMS *
                             exp(-n / pow(4.0, k));
        }
    }
    for (int i = 0; i < used; i++) {
        for (int j = 0; j < used; j++) {
            variance += weight[i] * weight[j] * covariance[i < j ? j - i : i - j];
        }
    }
    return sqrt(fmax(variance, 0.0));
}
