/* Streaks among streaks of stars that have another path than theirs: what image processing
 * (imgproc/measure/other_path.h) and generator take for it. */
#ifndef BST_ONBOARD_OTHER_PATH_H
#define BST_ONBOARD_OTHER_PATH_H

#include <math.h>

/* Gain of chi-square, 5 sigma, by which a path is another one; difference of moments from which a
 * streak is looked at, px and share of the length of the stars'. */
#define BST_OTHER_PATH_GAIN 25.0
#define BST_OTHER_PATH_PX 1.0
#define BST_OTHER_PATH_SHARE 0.05
/* Two stars in one image look like a longer streak where the stars' streaks are shorter than four
 * FWHM: there only what is three times as long as wide has another path. */
#define BST_OTHER_PATH_SHORT_FWHM 4.0
#define BST_OTHER_PATH_LONG_SHARE 3.0

/* Distance between two paths, end minus start, either way round. */
static inline double bst_paths_apart_px(double ax, double ay, double bx, double by) {
    return fmin(hypot(ax - bx, ay - by), hypot(ax + bx, ay + by));
}

#endif
