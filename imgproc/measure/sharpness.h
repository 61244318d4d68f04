/* Sharpness test: detects charge that no light can produce through the PSF (hot pixels, cosmic
 * rays).
 *
 * Every image is a sum of PSFs of positive flux. A pixel's neighbours therefore hold at least the
 * share of its light that they hold for a point at its centre. Let c be the pixel's signal, d_k its
 * neighbours', and r_k = p_k / p_0 the ratios of the pixel-integrated PSF. The estimate of c from a
 * group of neighbours, sum r_k d_k / sum r_k^2, is on average at least s c. Here s = min(1, least
 * ratio to c over positions of a point in the pixel). There are five groups: all eight neighbours,
 * and the two opposite ones in each of four directions, because a cosmic-ray track is sharp across
 * its direction only. A deviation is in standard deviations of noise, shot noise and 9 % of c for
 * PSF errors. The pixel's deviation is the largest of the five. */
#ifndef BST_IMGPROC_MEASURE_SHARPNESS_H
#define BST_IMGPROC_MEASURE_SHARPNESS_H

#include <stdbool.h>

#include "imgproc/detect/known_psf.h"
#include "imgproc/detect/psf.h"

enum { BST_SHARP_GROUPS = 5 };

typedef struct bst_sharpness {
    double sigma_px; /* sigma and binning for which it was prepared */
    int binning;
    /* Least signal of a BST_PIXEL_SATURATED pixel, e-: its neighbours must be consistent with it.
     * 0: saturated pixels are not tested. The caller sets it. */
    double full_e;
    double ratio[3][3];
    double inverse_square[BST_SHARP_GROUPS]; /* 1 / sum r^2 of the group */
    double cube[BST_SHARP_GROUPS];           /* sum r^3 (inverse_square)^2 */
    double floor[BST_SHARP_GROUPS];          /* s */
    /* for bst_sharpness_is_open: factor of each pair's sum in its estimate, weight of the pairs'
     * estimates in the overall one, and the deviation limit of each group relative to the noise */
    float factor[BST_SHARP_GROUPS], share[BST_SHARP_GROUPS], deviation[BST_SHARP_GROUPS];
} bst_sharpness;

/* Deviation above which a pixel counts as charge; one star in several thousand exceeds it. */
#define BST_SHARP_DEVIATION 4.0

/* Prepares the PSF ratios: for a Gaussian of sigma_px, or for the known PSF (`known` not NULL) in
 * pixels of binning x binning at its sharpest in the field. It returns at once if they are already
 * prepared.
 *
 * Given:     sigma_px  of the Gaussian, or of the one nearest to the known PSF, px */
void bst_sharpness_set(bst_sharpness *sharpness, const bst_imgproc_gauss *psf,
                       const bst_known_psf *known, int binning, double sigma_px);

/* Least charge of a pixel, e-: full_e if `signal` is BST_PIXEL_SATURATED, else `signal`. */
double bst_sharpness_signal(const bst_sharpness *sharpness, float signal);

/* Quick sharpness test: false if bst_sharpness_at is certainly below BST_SHARP_DEVIATION. (x, y)
 * must lie inside the frame. */
bool bst_sharpness_is_open(const bst_sharpness *sharpness, const float *signal, int width,
                           int height, float noise_e, int x, int y);

/* True if the quick test is decisive for a pixel of this signal: with empty neighbours its
 * deviation would be at least twice BST_SHARP_DEVIATION. For a very narrow PSF it is not, and a
 * pixel that passes the quick test may still hold charge. */
bool bst_sharpness_is_telling(const bst_sharpness *sharpness, float signal, float noise_e);

/* Sharpness of pixel (x, y) of signal [height][width]: deviation beyond what light can produce, in
 * standard deviations; 0 or less: none. Neighbours outside the frame or without a measurement count
 * as consistent with light. */
double bst_sharpness_at(const bst_sharpness *sharpness, const float *signal, int width, int height,
                        double noise_e, int x, int y);

/* Deviations from light, and the value expected of each if the pixel holds only charge. The
 * expected value is 0 if the neighbours cannot be compared, and small if the PSF is so narrow that
 * a point looks like charge. */
typedef struct bst_sharpness_test {
    float worst, worst_alone; /* largest of the five groups', at least 0 */
    float all, all_alone;     /* of all eight neighbours; may be negative */
} bst_sharpness_test;

/* Compares a pixel with its neighbours; detailed result of bst_sharpness_at, with one difference:
 * full neighbours of a full pixel count with full_e, the least charge of each. Only charge in a
 * single pixel, or in one column of them (blooming), has less in some direction. */
bst_sharpness_test bst_sharpness_compare(const bst_sharpness *sharpness, const float *signal,
                                         int width, int height, double noise_e, int x, int y);

#endif
