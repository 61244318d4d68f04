/* Matched filters on smeared Gaussian images, in closed form: what a filter makes of a source that
 * it was not made for, how its output falls off beside a source, and the threshold for a rate of
 * false alarms. Pixels are those that are read (binned); sigma_px holds the pixel's own width. */
#ifndef BST_OBSGEN_MODEL_MATCHED_FILTER_THEORY_H
#define BST_OBSGEN_MODEL_MATCHED_FILTER_THEORY_H

#include <math.h>

/* Probability that a standard normal variable is below z. */
static inline double bst_matched_normal_below(double z) {
    return 0.5 * erfc(-z * 0.70710678118654752);
}

/* A straight path during the exposure, px; {0, 0}: at rest. */
typedef struct bst_obsgen_path_px {
    double dx, dy;
} bst_obsgen_path_px;

/* Integral over the plane of the product of two unit images centred on one place, 1/px^2: uniform
 * segments p and q, each blurred by a Gaussian of sigma_px. Over one of them in closed form (error
 * functions), over the shorter one by midpoints half a sigma apart: right to 1 % of the value. */
double bst_matched_product(bst_obsgen_path_px p, bst_obsgen_path_px q, double sigma_px);

/* SNR that the filter for `filter` gives of a source that moved by `source`, over the greatest
 * possible: 1 where they are equal. */
double bst_matched_efficiency(bst_obsgen_path_px source, bst_obsgen_path_px filter,
                              double sigma_px);

/* Output of a filter for a streak of length_px at (along, across) px from a source that it was made
 * for, over that at the source: the autocorrelation of the image. */
double bst_matched_falloff(double along_px, double across_px, double length_px, double sigma_px);

/* SNR above which noise alone gives `false_alarms` maxima in `pixels` pixels of the output of the
 * filter for a point, and, where length_px > 0, of that for a streak too, looked for between the
 * pixels: as image processing reckons, sqrt(det L) (2 pi)^(-3/2) u exp(-u^2 / 2) maxima above u per
 * pixel of a field of unit variance whose gradient has the covariance L (Adler, The Geometry of
 * Random Fields, 1981, ch. 5). At least 2.5. *streak_share (NULL allowed): of the false alarms. */
double bst_matched_threshold(double sigma_px, double length_px, double false_alarms, double pixels,
                             double *streak_share);

/* Maxima above `threshold` per pixel when only the pixels themselves are looked at: Q(u) times the
 * chances, per axis, that the next pixel is below u where this one is above (bivariate normal,
 * lag-1 correlation of the filter for a point). */
double bst_matched_pixel_maxima(double sigma_px, double threshold);

#endif
