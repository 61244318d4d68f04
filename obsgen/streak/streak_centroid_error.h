/* Centroid error of a faint streak: position of the noisy filter outputs' peak. Internal to the
 * generator. */
#ifndef BST_OBSGEN_STREAK_STREAK_CENTROID_ERROR_H
#define BST_OBSGEN_STREAK_STREAK_CENTROID_ERROR_H

#include <stdbool.h>

#include "boresight/rng.h"
#include "obsgen/model/matched_filter_theory.h"

/* Rows across the streak, 0.7 sigma apart; most steps along it including the filters' reach; taps
 * of a point image on either side. */
enum { BST_WANDER_ROWS = 7, BST_WANDER_STEPS = 640, BST_WANDER_TAPS = 12, BST_WANDER_SOURCES = 25 };

/* Point and streak filter of a frame, sampled along the streak. */
typedef struct bst_streak_centroid_error {
    double length, sigma; /* for which it is set, px; sigma includes the pixel */
    double step;          /* px */
    /* steps: half the streak, reach of the taps, search range on either side */
    int half, reach, side;
    int steps; /* of white noise; 0: the streak is too long */
    double taps[2 * BST_WANDER_TAPS + 1];
    double streak_norm, point_norm; /* normalise the noise to unit variance */
    double shared;                  /* SNR of the streak in the point filter relative to its own */
    double curvature;               /* of the streak's autocorrelation along it, 1/px^2 */
    double mix[BST_WANDER_ROWS][BST_WANDER_ROWS]; /* white rows to output rows */
} bst_streak_centroid_error;

/* Sets the filters for streaks of length_px > 0. It returns at once if they are already set. */
void bst_streak_centroid_error_set(bst_streak_centroid_error *centroid_error, double length_px,
                                   double sigma_px);

/* A source on the streak's line and its SNR in its own filter; the streak itself is at (0, 0). */
typedef struct bst_streak_centroid_error_source {
    double along_px, across_px, snr;
} bst_streak_centroid_error_source;

typedef struct bst_streak_centroid_error_peak {
    double along_px, across_px, snr;
    bool point; /* the point filter's output exceeds the streak filter's */
} bst_streak_centroid_error_peak;

/* Draws the peak of the two filters' outputs for `count` sources, given that it exceeds
 * `threshold`: noise is redrawn until it does, up to a few times.
 *
 * Given:     noise  output noise relative to the white noise of the filters
 *            key    random key of this streak only */
bst_streak_centroid_error_peak bst_streak_centroid_error_draw(
    const bst_streak_centroid_error *centroid_error, bst_rng_key key,
    const bst_streak_centroid_error_source *sources, int count, double noise, double threshold);

#endif
