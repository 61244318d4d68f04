/* Place, path and flux of one streak by least squares. */
#ifndef BST_IMGPROC_STREAK_STREAK_FIT_H
#define BST_IMGPROC_STREAK_STREAK_FIT_H

#include <stdint.h>

#include "imgproc/measure/fit.h"

typedef struct bst_streak_fit {
    const bst_imgproc_gauss *psf;
    int max_side;
    double *image; /* [6][max_side^2]: share, by x, by y, by variance, share of two other paths */
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

/* Fits x, y, dx, dy and flux of `source`, which starts near the solution, on a stamp of the frame;
 * pixels whose `excluded` [height][width] of the stamp is not 0 are left out.
 *
 * Damped Gauss-Newton (Levenberg 1944) on sum (d - m)^2 / (noise^2 + m), as bst_fit_run. The
 * derivatives by the path are differences of two images 0.02 px apart. Fills the covariance (the
 * inverse of the Fisher matrix of all five parameters), chi-square and fitted; `norm` is sqrt(sum
 * share^2). False and nothing changed when the pixels do not determine the five: the path is then
 * shorter than the PSF can tell. */
bool bst_streak_fit_run(bst_streak_fit *fit, const bst_fit_data *data,
                        const bst_imgproc_stamp *stamp, const uint8_t *excluded,
                        bst_imgproc_source *source, double *norm);

#endif
