/* Two sources in one image: pairs that are closer than the matched filter separates, found by a
 * likelihood ratio test. */
#ifndef BST_IMGPROC_MEASURE_PAIR_SPLIT_H
#define BST_IMGPROC_MEASURE_PAIR_SPLIT_H

#include "imgproc/measure/deblend.h"

/* Two sources fitted in place of one. */
typedef struct bst_pair {
    bst_imgproc_source source[2]; /* the brighter one first, each with its covariance */
    double gain;                  /* chi-square of the best single source less that of the pair */
} bst_pair;

/* Fits two sources of the shape of source i in its place, with the PSF's widening given.
 *
 * Given:     least_gain  a pair whose gain is surely below is not fitted
 * Returned:  false: the source has neighbours, is cut off, or holds charge or full pixels; it shows
 * no elongation; the fit fails; or a streak explains it clearly better
 * Notes:     the elongation is the
 * coefficient of the PSF's second derivatives in the residuals of the single source (a pair of
 * shares a and 1 - a at the distance d has a (1 - a) d d^T), which is also the start of the fit, at
 * three ratios of brightness */
bool bst_pair_fit(const bst_imgproc_worker *w, int i, double widening_px2, double least_gain,
                  bst_pair *out);

/* Replaces fitted sources of the frame by two where the likelihood ratio says so; about a share
 * `rate` of the single ones. Both are then flagged as a blend. */
void bst_pair_split(bst_imgproc_locator *locator, const bst_locate_frame *frame, int fits,
                    double rate);

#endif
