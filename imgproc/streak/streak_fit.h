/* Least-squares fit of one streak: position, path and flux. */
#ifndef BST_IMGPROC_STREAK_STREAK_FIT_H
#define BST_IMGPROC_STREAK_STREAK_FIT_H

#include <stdint.h>

#include "imgproc/measure/fit.h"

typedef struct bst_streak_fit {
    const bst_imgproc_gauss *psf;
    int max_side;
    /* [6][max_side^2]: share, derivatives by x, y, variance, share of two shifted paths */
    double *image;
    double *spare; /* [3][max_side^2] */
} bst_streak_fit;

/* Allocates a fit of streaks on stamps of up to max_side x max_side pixels.
 *
 * Given:     psf  must outlive the fit
 * Errors:    BST_ERR_MEMORY; then `out` holds nothing to free
 * Ownership: free with bst_streak_fit_free */
bst_status bst_streak_fit_create(bst_ctx *ctx, const bst_imgproc_gauss *psf, int max_side,
                                 bst_streak_fit *out) BST_MUST_CHECK;
/* Frees the memory of a fit and clears the struct, which belongs to the caller. */
void bst_streak_fit_free(bst_streak_fit *fit);

/* Fits x, y, dx, dy and flux of a streak on a stamp, by damped Gauss-Newton (Levenberg 1944) on sum
 * (d - m)^2 / (noise^2 + m), as bst_fit_run.
 *
 * Given:     excluded  [height][width] of the stamp: pixels that are not 0 are excluded
 *            source    first estimate, near the solution
 * Returned:  source  parameters, covariance (inverse Fisher matrix of all five), chi-square, fitted
 *            norm    sqrt(sum share^2)
 *            false, with the source unchanged, if the pixels do not determine the parameters: the
 *            path is too short for the PSF
 * Notes:     The derivatives by the path are differences of two images 0.02 px apart. */
bool bst_streak_fit_run(bst_streak_fit *fit, const bst_fit_data *data,
                        const bst_imgproc_stamp *stamp, const uint8_t *excluded,
                        bst_imgproc_source *source, double *norm);

#endif
