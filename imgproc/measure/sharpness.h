/* Tells charge that no light can leave through the PSF: hot pixels and radiation hits.
 *
 * Whatever the scene is, a pixel's neighbours hold at least the share of its light that they hold
 * when a point sits on its centre, because every image is a sum of PSFs of positive flux. With
 * c the pixel's signal, d_k its neighbours' and r_k = p_k / p_0 the pixel-integrated PSF's values
 * about its centre, the estimate of c from a group of neighbours, sum r_k d_k / sum r_k^2, is not
 * below s c on average, s = min(1, its least ratio to c over places of a point in the pixel). Five
 * groups are asked: all eight neighbours, and the two opposite ones in each of four directions,
 * because a track of charge is sharp across itself only. The least of the five deviations, in
 * standard deviations (noise, the light's own, and 9 % of c for an imperfectly known PSF), is the
 * pixel's. */
#ifndef BST_IMGPROC_MEASURE_SHARPNESS_H
#define BST_IMGPROC_MEASURE_SHARPNESS_H

#include <stdbool.h>

#include "imgproc/detect/known_psf.h"
#include "imgproc/detect/psf.h"

enum { BST_SHARP_GROUPS = 5 };

typedef struct bst_sharpness {
    double sigma_px; /* that it was made for */
    /* Least signal of a BST_PIXEL_SATURATED pixel; its neighbours must fit at least that. 0: such
     * pixels are not asked. Set by the caller. */
    double full_e;
    double ratio[3][3];
    double inverse_square[BST_SHARP_GROUPS]; /* 1 / sum r^2 of the group */
    double cube[BST_SHARP_GROUPS];           /* sum r^3 (inverse_square)^2 */
    double floor[BST_SHARP_GROUPS];          /* s */
    /* for bst_sharpness_is_open: factor of each pair's sum in its estimate, share of the pairs'
     * estimates in that of all, and the deviation of each group over the noise */
    float factor[BST_SHARP_GROUPS], share[BST_SHARP_GROUPS], deviation[BST_SHARP_GROUPS];
} bst_sharpness;

/* Deviation from which a pixel is taken for charge: one star in several thousand reaches it. */
#define BST_SHARP_DEVIATION 4.0

/* Prepares the ratios for a Gaussian of sigma_px, or, unless `known` is NULL, for the known PSF in
 * pixels of binning x binning, which sigma_px is the like of: at its sharpest in the field. At once
 * when they are already there. */
void bst_sharpness_set(bst_sharpness *sharpness, const bst_imgproc_gauss *psf,
                       const bst_known_psf *known, int binning, double sigma_px);

/* What a pixel holds at least: full_e where `signal` is BST_PIXEL_SATURATED, else `signal`. */
double bst_sharpness_signal(const bst_sharpness *sharpness, float signal);

/* Quick: false where bst_sharpness_at is sure to be below BST_SHARP_DEVIATION. (x, y) inside the
 * frame. */
bool bst_sharpness_is_open(const bst_sharpness *sharpness, const float *signal, int width,
                           int height, float noise_e, int x, int y);

/* Whether bst_sharpness_is_open is sure of a pixel that holds this much and whose neighbours hold
 * nothing: its deviation would be at least twice BST_SHARP_DEVIATION. Where the PSF is so narrow
 * that it is not, a pixel that is not open may hold charge all the same. */
bool bst_sharpness_is_telling(const bst_sharpness *sharpness, float signal, float noise_e);

/* How far, in standard deviations, the pixel (x, y) of signal [height][width] stands out of what
 * light could do; 0 or less: not at all. Neighbours outside or without a measurement speak for
 * light. */
double bst_sharpness_at(const bst_sharpness *sharpness, const float *signal, int width, int height,
                        double noise_e, int x, int y);

/* Deviations from light, and the mean that each has if the pixel's charge is all there is: 0 where
 * the neighbours cannot be compared, small where the PSF is so narrow that a point looks like
 * charge.
 */
typedef struct bst_sharpness_test {
    float worst, worst_alone; /* the greatest of the five groups', at least 0 */
    float all, all_alone;     /* of all eight neighbours; may be below 0 */
} bst_sharpness_test;

/* Compares a pixel with its neighbours, as bst_sharpness_at. */
bst_sharpness_test bst_sharpness_compare(const bst_sharpness *sharpness, const float *signal,
                                         int width, int height, double noise_e, int x, int y);

#endif
