/* The best straight path near a line of the bank. */
#ifndef BST_IMGPROC_STREAK_STREAK_REFINE_H
#define BST_IMGPROC_STREAK_STREAK_REFINE_H

#include "imgproc/streak/streak_bank.h"

typedef struct bst_streak_line {
    double x0, y0, x1, y1; /* ends of the path, frame px */
    double snr;            /* of the sum along it; single bright pixels count only as what the rest
                              of the path leads to expect */
    double point_snr[2];   /* of the two brightest points on it */
    double filled;         /* share of its rows that are brighter than 0.35 of their mean */
} bst_streak_line;

/* Moves the ends across and along until the SNR of the sum between them is greatest: steps of 1/4
 * px across, with the map interpolated linearly, and of one row along. The noise of each sum
 * follows from the map's correlation and the weights that the interpolation really has. No path is
 * longer than max_px. */
void bst_streak_refine(const bst_streak_map *map, const bst_streak_hit *hit, double max_px,
                       bst_streak_line *out);

#endif
