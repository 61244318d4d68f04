/* Refines a line of the filter bank to the best straight path near it. */
#ifndef BST_IMGPROC_STREAK_STREAK_REFINE_H
#define BST_IMGPROC_STREAK_STREAK_REFINE_H

#include "imgproc/streak/streak_bank.h"

typedef struct bst_streak_line {
    double x0, y0, x1, y1; /* ends of the path, frame px */
    /* of the sum along the path; bright outliers are limited to what the other samples predict */
    double snr;
    double point_snr[2]; /* of the two brightest points on the path */
    double filled;       /* share of its rows brighter than 0.35 of their mean */
} bst_streak_line;

/* Maximises the SNR of a streak path over its ends, in steps of 1/4 px across (linear interpolation
 * of the map) and one row along. The noise of each sum follows from the map's autocorrelation and
 * the interpolation weights. No path is longer than max_px. */
void bst_streak_refine(const bst_streak_map *map, const bst_streak_hit *hit, double max_px,
                       bst_streak_line *out);

#endif
