#include "sim/optics/photometry.h"

#include <math.h>
#include <stdlib.h>

enum { LEAST_STARS = 3 };
static const double LEAST_SNR = 10.0, CLIP_SIGMA = 3.0;
static const double MAG_PER_SHARE = 1.0857362047581296; /* 2.5 / ln 10 */
static const double SIGMA_PER_MEDIAN =
    1.4826022185056018; /* sigma of a normal distribution over its median deviation */

bst_status bst_optics_photometer_create(bst_ctx *ctx, int capacity, bst_optics_photometer *out) {
    size_t n = (size_t)capacity;
    *out =
        (bst_optics_photometer){.capacity = capacity, .excess = calloc(3 * n + 1, sizeof(double))};
    if (!out->excess) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the magnitudes of %d stars", capacity);
    }
    out->variance = out->excess + n;
    out->work = out->variance + n;
    return BST_OK;
}

void bst_optics_photometer_free(bst_optics_photometer *p) {
    free(p->excess);
    *p = (bst_optics_photometer){.capacity = 0};
}

void bst_optics_photometer_begin(bst_optics_photometer *p) {
    p->count = 0;
}

double bst_photometry_noise_mag(const bst_detection *item) {
    return item->flux_e > 0.0 ? MAG_PER_SHARE * item->flux_sigma_e / item->flux_e : INFINITY;
}

void bst_optics_photometer_add(bst_optics_photometer *p, const bst_detection *star, double v_mag) {
    const uint32_t spoilt = BST_DETECTION_SATURATED | BST_DETECTION_EDGE | BST_DETECTION_BLEND;
    double noise = bst_photometry_noise_mag(star), excess = v_mag - star->v_mag;
    if (p->count < p->capacity && (star->flags & spoilt) == 0 && star->snr >= LEAST_SNR &&
        isfinite(noise) && isfinite(excess)) {
        p->excess[p->count] = excess;
        p->variance[p->count++] = noise * noise;
    }
}

/* Median of the numbers in p->work, which are sorted (Shell's method). */
static double median_of_work(bst_optics_photometer *p) {
    double *v = p->work;
    int n = p->count, gap = 1;
    while (gap < n / 3) {
        gap = 3 * gap + 1;
    }
    for (; gap > 0; gap /= 3) {
        for (int i = gap; i < n; i++) {
            double moved = v[i];
            int j = i;
            for (; j >= gap && v[j - gap] > moved; j -= gap) {
                v[j] = v[j - gap];
            }
            v[j] = moved;
        }
    }
    return 0.5 * (v[(n - 1) / 2] + v[n / 2]);
}

bst_optics_zero_point bst_optics_photometer_zero_point(bst_optics_photometer *p) {
    const bst_optics_zero_point none = {.stars = 0};
    if (p->count < LEAST_STARS) {
        return none;
    }
    for (int i = 0; i < p->count; i++) {
        p->work[i] = p->excess[i];
    }
    double middle = median_of_work(p);
    for (int i = 0; i < p->count; i++) {
        p->work[i] = fabs(p->excess[i] - middle);
    }
    double spread = SIGMA_PER_MEDIAN * median_of_work(p);
    for (int i = 0; i < p->count; i++) {
        p->work[i] = p->variance[i];
    }
    double shared = fmax(spread * spread - median_of_work(p), 0.0), weights = 0.0, sum = 0.0;
    int kept = 0;
    for (int i = 0; i < p->count; i++) {
        double variance = p->variance[i] + shared, rest = p->excess[i] - middle;
        if (rest * rest <= CLIP_SIGMA * CLIP_SIGMA * variance) {
            weights += 1.0 / variance;
            sum += rest / variance;
            kept++;
        }
    }
    if (kept < LEAST_STARS) {
        return none;
    }
    return (bst_optics_zero_point){kept, middle + sum / weights, sqrt(1.0 / weights), sqrt(shared)};
}

void bst_photometry_correct(const bst_optics_zero_point *zero_point, bst_detection *item) {
    item->v_mag += zero_point->offset_mag;
    item->v_mag_sigma = hypot(bst_photometry_noise_mag(item), zero_point->sigma_mag);
}

void bst_photometry_apply(const bst_optics_zero_point *zero_point, double camera_zero_point_mag,
                          bst_detections *detections) {
    detections->zero_point_mag = camera_zero_point_mag + zero_point->offset_mag;
    detections->zero_point_sigma_mag = zero_point->sigma_mag;
    detections->zero_point_stars = zero_point->stars;
    for (int i = 0; i < detections->count; i++) {
        bst_photometry_correct(zero_point, &detections->items[i]);
    }
}
