#include "imgproc/measure/frame_width.h"

#include <math.h>

/* Standard deviation of the prior, and least one of a single source's measurement, shares of the
 * PSF's variance. */
static const double PRIOR = 0.05, LEAST_ERROR = 0.03;
/* Largest widening that counts in the mean, share of the variance. */
static const double MOST = 0.5;
/* A widening below this share of the variance takes less than 0.6 % of the light. */
static const double LINEAR = 0.15;
/* An adapted PSF is wrong by less: squared errors of places are 1 + 2 u of what is stated. */
static const double ADAPTED = 0.04;
/* Sources that adapt the PSF at least; rounds: from half to twice the variance (test_detect.c). */
enum { SOURCES = 5, ROUNDS = 5 };

static double variance_of(const bst_source_profiles *profiles) {
    return profiles->sigma_px * profiles->sigma_px;
}

static void forget(bst_frame_width *width, const bst_source_profiles *profiles) {
    double prior = PRIOR * variance_of(profiles);
    width->sum_px2 = 0.0;
    width->weight = 1.0 / (prior * prior);
    width->count = 0;
}

void bst_frame_width_clear(bst_frame_width *width, const bst_source_profiles *profiles) {
    forget(width, profiles);
    width->rounds = 0;
}

void bst_frame_width_add(bst_frame_width *width, const bst_source_profiles *profiles,
                         const bst_imgproc_source *source) {
    double variance = variance_of(profiles), least = LEAST_ERROR * variance;
    double widening = source->widening_px2;
    if (!(source->fitted && source->widening_variance > 0.0)) {
        return;
    }
    if (fabs(widening) < MOST * variance) {
        double weight = 1.0 / (source->widening_variance + least * least);
        width->sum_px2 += weight * widening;
        width->weight += weight;
    }
    if (width->count < BST_FRAME_WIDTH_SOURCES) {
        int at = width->count++;
        for (; at > 0 && width->first_px2[at - 1] > widening; at--) {
            width->first_px2[at] = width->first_px2[at - 1];
        }
        width->first_px2[at] = widening;
    }
}

double bst_frame_width_mean(const bst_frame_width *width) {
    return width->weight > 0.0 ? width->sum_px2 / width->weight : 0.0;
}

bool bst_frame_width_adapt(bst_frame_width *width, bst_source_profiles *profiles,
                           const bst_imgproc_gauss *psf) {
    double variance = variance_of(profiles);
    if (profiles->known || width->count < SOURCES || width->rounds == ROUNDS) {
        return false;
    }
    double median = width->first_px2[width->count / 2];
    if (fabs(median) < (width->rounds == 0 ? LINEAR : ADAPTED) * variance) {
        return false;
    }
    bst_source_profiles_set(profiles, psf, sqrt(variance + median));
    forget(width, profiles);
    width->rounds++;
    return true;
}
