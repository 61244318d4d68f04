/* Streaks of unknown rate and direction in a frame in which the stars are points. */
#ifndef BST_IMGPROC_STREAK_SEARCH_H
#define BST_IMGPROC_STREAK_SEARCH_H

#include "imgproc/streak_refine.h"

typedef struct bst_streak_disc {
    double x_px, y_px, radius_px;
} bst_streak_disc;

enum { BST_STREAK_MAX_CANDIDATES = 8192, BST_STREAK_MAX_FOUND = 256 };

typedef struct bst_streak_search {
    bst_parallel *pool;
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

/* threads: 0, one per processor. */
bst_status bst_streak_search_create(bst_ctx *ctx, int max_width, int max_height, double max_px,
                                    int threads, bst_streak_search *out) BST_MUST_CHECK;
void bst_streak_search_free(bst_streak_search *search);

/* The SNR that noise exceeds `false_alarms` times in `pixels` pixels, over all places, directions
 * and lengths up to max_px, for a PSF of sigma_px. */
double bst_streak_threshold(double false_alarms, double pixels, double sigma_px, double max_px);

/* Searches signal [height][width] (see background.h) without the discs and leaves what exceeds
 * bst_streak_threshold in search->found, the brightest first; returns their number. */
int bst_streak_search_run(bst_streak_search *search, const float *signal, int width, int height,
                          const bst_background *background, double sigma_px,
                          const bst_streak_disc *discs, int disc_count, double false_alarms);

#endif
