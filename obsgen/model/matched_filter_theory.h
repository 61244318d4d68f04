/* Closed-form theory of matched filters on smeared Gaussian images: mismatched response, falloff
 * beside a source, and detection threshold. Pixels are read-out (binned) pixels; sigma_px includes
 * the pixel width. */
#ifndef BST_OBSGEN_MODEL_MATCHED_FILTER_THEORY_H
#define BST_OBSGEN_MODEL_MATCHED_FILTER_THEORY_H

#include <math.h>

/* Probability that a standard normal variable is below z. */
static inline double bst_matched_normal_below(double z) {
    return 0.5 * erfc(-z * 0.70710678118654752);
}

/* Straight smear path during the exposure, px; {0, 0}: at rest. */
typedef struct bst_obsgen_path_px {
    double dx, dy;
} bst_obsgen_path_px;

/* Overlap integral of two unit images at one position, 1/px^2: uniform segments p and q, each
 * blurred by a Gaussian of sigma_px. It is closed-form (error functions) along one segment and a
 * midpoint sum with steps of half a sigma along the shorter one. Accuracy 1 %. */
double bst_matched_product(bst_obsgen_path_px p, bst_obsgen_path_px q, double sigma_px);

/* SNR of the filter for path `filter` on a source that moved by `source`, relative to its matched
 * filter; 1 if the paths are equal. */
double bst_matched_efficiency(bst_obsgen_path_px source, bst_obsgen_path_px filter,
                              double sigma_px);

/* Filter output at (along, across) px from a matched streak of length_px, relative to its peak: the
 * image's autocorrelation. */
double bst_matched_falloff(double along_px, double across_px, double length_px, double sigma_px);

/* Detection threshold, SNR: noise alone gives `false_alarms` interpolated maxima in `pixels` pixels
 * of the point filter and, if length_px > 0, of the streak filter. At least 2.5.
 *
 * Returned:  *streak_share  streak filter's share of the false alarms; may be NULL
 * Notes:     as in image processing, sqrt(det L) (2 pi)^(-3/2) u exp(-u^2 / 2) maxima above u per
 *            pixel for unit variance and gradient covariance L
 * Reference: Adler, The Geometry of Random Fields, 1981, ch. 5 */
double bst_matched_threshold(double sigma_px, double length_px, double false_alarms, double pixels,
                             double *streak_share);

/* Density of maxima above `threshold` per pixel without interpolation: Q(u) times the
 * probabilities, per axis, that the next pixel is below u (bivariate normal, lag-1 correlation of
 * the point filter). */
double bst_matched_pixel_maxima(double sigma_px, double threshold);

/* Probability that at least one of two standard normal variables exceeds its threshold.
 *
 * Given:     first, second  means above the thresholds
 *            correlation    of the two, 0 to 1
 * Notes:     one integral: P(first) plus that of the second variable's excess where the first is
 *            below; Gauss-Legendre of eight nodes */
double bst_matched_either_above(double first, double second, double correlation);

#endif
