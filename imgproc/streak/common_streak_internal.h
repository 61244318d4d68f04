/* State of a streak finder, shared by its source files. */
#ifndef BST_IMGPROC_STREAK_COMMON_STREAK_INTERNAL_H
#define BST_IMGPROC_STREAK_COMMON_STREAK_INTERNAL_H

#include "imgproc/streak/common_streak.h"
#include "imgproc/streak/path_filter.h"

enum { BST_STREAK_SHAPES = 64 };

/* A connected source. */
typedef struct bst_streak_shape {
    double sum, rank;
    int from; /* one of its pixels */
    float level;
    int x0, x1, y0, y1;
} bst_streak_shape;

struct bst_streak_finder {
    int width, height;
    double sigma, psf_sigma_px;
    float *image;  /* background removed, in units of `sigma` */
    float *smooth; /* convolved with the PSF, of unit noise */
    float *lines;  /* line filter's output */
    float *scratch;
    int *label, *stack;
    int count; /* pixels on the stack: those of the latest source */
    bst_star_path path;
    bst_common_streak_options options;
    bst_detection *items; /* [max_sources + REFINING_STARS] */
    bst_streak_shape shapes[BST_STREAK_SHAPES];
    int shape_count;
};

/* Removes the point source that makes a peak of the filter: light that is at one place of the path
 * only. Returns false if the light is spread along the path. */
bool bst_streak_finder_remove_point(bst_streak_finder *finder, bst_path_filter *filter,
                                    const bst_path_filter_peak *peak);
/* Notes the amplitude of a star around its path, in finder->lines. */
void bst_streak_finder_cover(bst_streak_finder *finder, const bst_path_filter_peak *peak);
/* True if most of a peak's path lies on those of much brighter stars: what their subtraction left.
 */
bool bst_streak_finder_is_covered(const bst_streak_finder *finder,
                                  const bst_path_filter_peak *peak);

#endif
