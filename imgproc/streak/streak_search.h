/* Search for streaks of unknown rate and direction in a frame with point-like stars. */
#ifndef BST_IMGPROC_STREAK_STREAK_SEARCH_H
#define BST_IMGPROC_STREAK_STREAK_SEARCH_H

#include "imgproc/streak/streak_refine.h"

enum { BST_STREAK_MAX_CANDIDATES = 2048, BST_STREAK_MAX_FOUND = 256 };

typedef struct bst_streak_search {
    bst_parallel *pool; /* lent */
    bst_streak_map map;
    bst_streak_bank bank;
    double max_px;
    double threshold_snr; /* detection threshold of the latest frame */
    int candidates;       /* of the latest frame: refined lines of the filter bank */
    int *order;
    bst_streak_hit *chosen;
    bst_streak_line *lines;
    bst_streak_line found[BST_STREAK_MAX_FOUND];
} bst_streak_search;

/* Creates a streak search. Errors: BST_ERR_MEMORY.
 *
 * Given:     pool    must outlive it; NULL: the caller's thread
 *            max_px  longest streak, px */
bst_status bst_streak_search_create(bst_ctx *ctx, bst_parallel *pool, int max_width, int max_height,
                                    double max_px, bst_streak_search *out) BST_MUST_CHECK;
/* Frees the memory of a search and clears the struct, which belongs to the caller. */
void bst_streak_search_free(bst_streak_search *search);

/* Detection threshold, SNR, that noise alone exceeds `false_alarms` times in a frame, over all
 * positions, directions and lengths up to max_px that fit in it, for a PSF of sigma_px.
 *
 * Notes:     A smooth Gaussian field over the four dimensions of a line has V sqrt(det L) (2
 *            pi)^(-5/2) u^3 exp(-u^2 / 2) excursions above a high u in a volume V, L the covariance
 *            of its gradient. The gradient variances are 1 / (2 sigma^2) across, length^2 / (24
 *            sigma^2) by angle, and 1 / (2 sqrt(pi) sigma length) at each end. The length cancels;
 *            each pixel contributes pi max_px / (4 sqrt(12 pi) sigma^3). The discrete search finds
 *            a share of these, which was measured.
 * Reference: Adler, The Geometry of Random Fields, 1981, ch. 6 */
double bst_streak_threshold(double false_alarms, double width_px, double height_px, double sigma_px,
                            double max_px);

/* Fills the streak map with a frame.
 *
 * Given:     signal  [height][width], e-, see background.h */
void bst_streak_search_fill(bst_streak_search *search, const float *signal, int width, int height,
                            const bst_background *background, double sigma_px);
/* Finds streaks bright enough to have points detected on them: SNR 7.5 and more, 11 px and more,
 * lit along their whole length. They are stored in search->found, brightest first, and masked in
 * the map. Returns their number. */
int bst_streak_search_bright(bst_streak_search *search);
/* Finds the streaks above bst_streak_threshold, as bst_streak_search_bright. Points must be masked
 * in search->map before (bst_streak_map_blank).
 *
 * Two undetected points close together look like a short streak. The likelihood ratio of a line to
 * the two brightest points on it is e^(half the difference of the squared SNRs). It must exceed the
 * expected number of such pairs over the false alarms.
 *
 * Given:     points  number of points detected in the frame */
int bst_streak_search_faint(bst_streak_search *search, double false_alarms, int points);

#endif
