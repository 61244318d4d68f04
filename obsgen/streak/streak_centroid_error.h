/* Where the top of the filters' output about a faint streak lies in noise. Inside of the generator.
 */
#ifndef BST_OBSGEN_STREAK_STREAK_CENTROID_ERROR_H
#define BST_OBSGEN_STREAK_STREAK_CENTROID_ERROR_H

#include <stdbool.h>

#include "boresight/rng.h"
#include "obsgen/model/matched_filter_theory.h"

/* Rows across the streak that are looked at, 0.7 sigma apart; most steps along it, with what the
 * filters need beyond; taps of a point's image on either side of its middle. */
enum { BST_WANDER_ROWS = 7, BST_WANDER_STEPS = 640, BST_WANDER_TAPS = 12, BST_WANDER_SOURCES = 25 };

/* Both filters of a frame on steps along the streak. */
typedef struct bst_streak_centroid_error {
    double length, sigma;  /* that it is for, px; sigma with the pixel's own width */
    double step;           /* px */
    int half, reach, side; /* steps: half the streak, a tap's reach, looked at on either side */
    int steps;             /* of white noise; 0: the streak is too long for it */
    double taps[2 * BST_WANDER_TAPS + 1];
    double streak_norm, point_norm; /* that make noise of unit variance */
    double shared;    /* SNR of the streak in the filter for points over that in its own */
    double curvature; /* of the streak's autocorrelation along it, 1/px^2 */
    double mix[BST_WANDER_ROWS][BST_WANDER_ROWS]; /* white rows to rows of the output */
} bst_streak_centroid_error;

/* For streaks of length_px > 0. Does nothing when it is set so already. */
void bst_streak_centroid_error_set(bst_streak_centroid_error *centroid_error, double length_px,
                                   double sigma_px);

/* Light of one source on the streak's line, SNR of its own filter; the streak itself is at 0, 0. */
typedef struct bst_streak_centroid_error_source {
    double along_px, across_px, snr;
} bst_streak_centroid_error_source;

typedef struct bst_streak_centroid_error_peak {
    double along_px, across_px, snr;
    bool point; /* the filter for points gives more than that for streaks */
} bst_streak_centroid_error_peak;

/* The greatest output of the two filters for `count` sources in noise of deviation `noise` (1:
 * white noise as the filters were made for), given that it exceeds `threshold`: noise is drawn
 * until it does, a few times at the most. The key belongs to this streak alone. */
bst_streak_centroid_error_peak bst_streak_centroid_error_draw(
    const bst_streak_centroid_error *centroid_error, bst_rng_key key,
    const bst_streak_centroid_error_source *sources, int count, double noise, double threshold);

#endif
