/* Streaks of unknown rate and direction in a frame in which the stars are points. */
#ifndef BST_IMGPROC_STREAK_STREAK_SEARCH_H
#define BST_IMGPROC_STREAK_STREAK_SEARCH_H

#include "imgproc/streak/streak_refine.h"

enum { BST_STREAK_MAX_CANDIDATES = 2048, BST_STREAK_MAX_FOUND = 256 };

typedef struct bst_streak_search {
    bst_parallel *pool; /* not its own */
    bst_streak_map map;
    bst_streak_bank bank;
    double max_px;
    double threshold_snr; /* of the latest frame */
    int candidates;       /* of the latest frame: lines of the bank that were followed up */
    int *order;
    bst_streak_hit *chosen;
    bst_streak_line *lines;
    bst_streak_line found[BST_STREAK_MAX_FOUND];
} bst_streak_search;

/* pool is kept; NULL: the caller's thread alone. */
bst_status bst_streak_search_create(bst_ctx *ctx, bst_parallel *pool, int max_width, int max_height,
                                    double max_px, bst_streak_search *out) BST_MUST_CHECK;
/* Frees the memory of a search and clears the struct, which belongs to the caller. */
void bst_streak_search_free(bst_streak_search *search);

/* The SNR that noise alone exceeds `false_alarms` times in a frame, over all places, directions and
 * lengths up to max_px that fit in it, for a PSF of sigma_px.
 *
 * A smooth Gaussian field in the four dimensions of a line has V sqrt(det L) (2 pi)^(-5/2) u^3
 * exp(-u^2 / 2) excursions above a high u in a volume V, L the covariance of its gradient (Adler,
 * The Geometry of Random Fields, 1981, ch. 6). Across, the field turns with 1 / (2 sigma^2), by
 * angle with length^2 / (24 sigma^2), at each end with 1 / (2 sqrt(pi) sigma length): the length
 * cancels, and each pixel has pi max_px / (4 sqrt(12 pi) sigma^3). The search takes whole rows and
 * follows up what its bank shows, which leaves a share that was measured. */
double bst_streak_threshold(double false_alarms, double width_px, double height_px, double sigma_px,
                            double max_px);

/* Takes a frame: signal [height][width], see background.h. */
void bst_streak_search_fill(bst_streak_search *search, const float *signal, int width, int height,
                            const bst_background *background, double sigma_px);
/* Streaks so bright that points are found on them: SNR 7.5 and more, 11 px and more, lit all along.
 * Leaves them in search->found, the brightest first, takes them out of the map, and returns their
 * number. */
int bst_streak_search_bright(bst_streak_search *search);
/* The same for all that exceeds bst_streak_threshold. Points are to be taken out of search->map
 * before (bst_streak_map_blank).
 *
 * Two points too faint to be found, near one another, look like a short streak. The likelihood of a
 * line over that of the two brightest points on it, e^(half the difference of the squared SNRs),
 * must exceed the number of such pairs, as `points` that were found in the frame lead to expect,
 * over the false alarms. */
int bst_streak_search_faint(bst_streak_search *search, double false_alarms, int points);

#endif
