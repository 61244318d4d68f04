/* Brightness of false alarms: noise gives faint ones, so a bright detection is rather of an object
 * (likelihood ratio of the amplitude: Lerro and Bar-Shalom, IEEE Trans. AES 29, 1993; here the
 * distribution of false alarms is learnt from the detections without a confirmed track). */
#include <assert.h>

#include "tracker/mtt/multitarget_internal.h"

/* Memory of the distribution, in frames. */
static const double MEMORY = 200.0;
/* Before anything is learnt it is that of objects, as if so many false alarms had been seen. */
static const double ASSUMED = 10.0;
enum { LAST = BST_MTT_SNR_INTERVALS - 1 };

/* Interval of a detection's SNR above the threshold, in steps of 1; the last one stands for all
 * above it; negative: unknown. */
static int interval(const bst_mtt *m, double snr) {
    bool known = m->threshold_snr > 0.0 && isfinite(snr);
    return known ? (int)fmin(fmax(snr - m->threshold_snr, 0.0), LAST) : -1;
}

/* Share of an interval of the objects above the threshold: their number above an SNR is taken to
 * fall with its inverse, a design choice. */
static double share_of_objects(const bst_mtt *m, int i) {
    double t = m->threshold_snr;
    return t / (t + i) - (i < LAST ? t / (t + i + 1) : 0.0);
}

/* Share of an interval of the false alarms. */
static double share_of_alarms(const bst_mtt *m, int i) {
    double total = 0.0;
    for (int k = 0; k <= LAST; k++) {
        total += m->alarm_snr[k];
    }
    return (m->alarm_snr[i] + ASSUMED * share_of_objects(m, i)) / (total + ASSUMED);
}

/* Probability that a detection of an object is in interval i if another one was in j: both have
 * noise of 1, so that their difference has the variance 2. A second one above the last interval's
 * limit follows the first, but for objects near that limit. */
static double share_of_same(int i, int j) {
    const double stays = 0.9;
    double sum = 0.0;
    for (int k = 0; k <= LAST - (j == LAST); k++) {
        sum += exp(-0.25 * (k - j) * (k - j));
    }
    double share = exp(-0.25 * (i - j) * (i - j)) / sum;
    return j < LAST ? share : i == LAST ? stays : (1.0 - stays) * share;
}

double bst_mtt_pair_brightness(const bst_mtt *m, double first_snr, double second_snr) {
    assert(m);
    int i = interval(m, first_snr), k = interval(m, second_snr);
    if (i < 0 || k < 0) {
        return 0.0;
    }
    double first = share_of_objects(m, i) / share_of_alarms(m, i);
    double second = share_of_same(k, i) / share_of_alarms(m, k);
    /* faint objects may be more frequent than assumed */
    return fmax(log(first * second), 0.0);
}

void bst_mtt_fade_alarms(bst_mtt *m) {
    for (int k = 0; k <= LAST; k++) {
        m->alarm_snr[k] *= 1.0 - 1.0 / MEMORY;
    }
}

void bst_mtt_note_alarm(bst_mtt *m, double snr, double count) {
    int i = interval(m, snr);
    if (i >= 0) {
        m->alarm_snr[i] = fmax(m->alarm_snr[i] + count, 0.0);
    }
}
