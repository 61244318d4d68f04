/* State of a streak finder, shared by its source files. */
#ifndef BST_IMGPROC_STREAK_COMMON_STREAK_INTERNAL_H
#define BST_IMGPROC_STREAK_COMMON_STREAK_INTERNAL_H

#include "imgproc/streak/common_streak.h"
#include "imgproc/streak/path_filter.h"

/* BST_STREAK_LINE_REACH: furthest sample of the line filter, px. */
enum { BST_STREAK_SHAPES = 64, BST_STREAK_LINE_REACH = 11 };

/* Share of the path inside the frame from which on a streak is whole. */
#define BST_STREAK_WHOLE 0.97
/* A peak that is no streak is left out of the search up to this distance, px. */
#define BST_STREAK_CLOSE_PX 5.0

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
    float *image;   /* background removed, in units of `sigma` */
    float *smooth;  /* convolved with the PSF, of unit noise */
    float *lines;   /* line filter's output */
    float *scratch; /* amplitude of the brightest star found about each pixel */
    int *label, *stack;
    const float *weights; /* of the smooth image's pixels, see bst_path_filter_create_weighted;
                             NULL: all are 1 */
    double point[2];      /* place of the point source that was removed last; NAN: none was */
    int count;            /* pixels on the stack: those of the latest source */
    int floods;           /* numbers in use as labels */
    bst_star_path path;
    bst_path_filter *filter; /* of the latest search; NULL: none yet */
    bst_common_streak_options options;
    bst_detection *items; /* [max_sources + REFINING_STARS] */
    bst_streak_shape shapes[BST_STREAK_SHAPES];
    int shape_count;
    double measured[BST_STREAK_SHAPES][4]; /* ends of the paths that have been measured */
    int measured_count;
};

/* Removes the medians of columns and rows, and a very uneven background; divides by the noise, and
 * clears hot pixels. Uses finder->scratch, lines and label. */
void bst_streak_finder_clean(bst_streak_finder *finder);
/* Convolves an image of the frame's size with a Gaussian; uses finder->scratch.
 *
 * Given:     sigma_px  at most 4 px
 *            squared   with the squared Gaussian of unit sum, in place of that of unit noise */
void bst_streak_finder_convolve(bst_streak_finder *finder, const float *from, float *to,
                                double sigma_px, bool squared);
/* Collects the connected pixels of a source above a level, in finder->stack.
 *
 * Given:     from    its first pixel
 *            number  label for its pixels */
bst_streak_shape bst_streak_finder_flood(bst_streak_finder *finder, float level, int from,
                                         int number);
/* Lists the sources at several levels, by rank; returns their number. */
int bst_streak_finder_list_shapes(bst_streak_finder *finder,
                                  bst_streak_shape out[BST_STREAK_SHAPES]);
/* Removes the point source that makes a peak of the filter: light that is at one place of the path
 * only. Returns false if the light is spread along the path. */
bool bst_streak_finder_remove_point(bst_streak_finder *finder, bst_path_filter *filter,
                                    const bst_path_filter_peak *peak);
/* Notes the amplitude of a star around its path, in finder->scratch. */
void bst_streak_finder_cover(bst_streak_finder *finder, const bst_path_filter_peak *peak);
/* True if most of a peak's path lies on those of much brighter stars: what their subtraction left.
 */
bool bst_streak_finder_is_covered(const bst_streak_finder *finder,
                                  const bst_path_filter_peak *peak);
/* True for a peak without light of its own over most of its path: what the subtraction of a bright
 * star left beyond its ends. Places on the paths of much brighter stars are not looked at. */
bool bst_streak_finder_is_uneven(const bst_streak_finder *finder, const bst_path_filter_peak *peak);

/* The image in which paths are measured; lent. */
bst_star_path_image bst_streak_finder_image(const bst_streak_finder *finder);
/* Finds all stars by the finder's path. */
bst_status bst_streak_finder_find_all(bst_ctx *ctx, bst_streak_finder *finder,
                                      bst_common_streak *out) BST_MUST_CHECK;
/* Lists the first stars, or those that are chosen, with the amplitudes of their samples.
 *
 * Given:     chosen  NULL: all
 * Returned:  their number, at most `most` */
int bst_streak_finder_choose(const bst_streak_finder *finder, const bst_common_streak *found,
                             const bool *chosen, bst_star_path_star *stars, int most);

#endif
