/* Weighted least-squares fit of one source, with its close neighbours, to the pixels of a stamp. */
#ifndef BST_IMGPROC_MEASURE_FIT_H
#define BST_IMGPROC_MEASURE_FIT_H

#include <stdbool.h>

#include "boresight/status.h"
#include "imgproc/measure/source_profile.h"

enum { BST_FIT_MAX_FREE = 5, BST_FIT_MAX_PARAMETERS = 3 * BST_FIT_MAX_FREE + 1 };

/* A source as the fit sees it; pixels of the frame. */
typedef struct bst_imgproc_source {
    bst_imgproc_shape shape; /* centroid, path, sigma of the PSF */
    double flux_e;
    double widening_px2; /* added to the PSF's variance, to first order */
    /* results */
    double cov_xx, cov_xy, cov_yy, flux_variance, widening_variance;
    double chi_square;
    int pixels; /* that it was fitted to */
    bool fitted;
} bst_imgproc_source;

/* Pixels and noise to fit to. */
typedef struct bst_fit_data {
    const float *signal; /* [height][width], electrons above background, see background.h */
    int width, height;
    double noise_e; /* of the background, at the source */
} bst_fit_data;

/* Work space; the planes are [height][width rounded up to lanes] of a stamp. */
typedef struct bst_fit {
    const bst_imgproc_gauss *psf;
    const bst_source_profiles *profiles; /* made for the sources' sigma before a fit */
    int max_side;
    float *value, *fixed, *valid;
    float *model; /* [BST_FIT_MAX_FREE][4]: share, by x, by y, by variance */
    float *scratch;
} bst_fit;

/* Allocates a fit on stamps of up to max_side x max_side pixels.
 *
 * Given:     psf, profiles  must outlive the fit
 * Errors:    BST_ERR_MEMORY; then `out` holds nothing to free
 * Ownership: free with bst_fit_free */
bst_status bst_fit_create(bst_ctx *ctx, const bst_imgproc_gauss *psf,
                          const bst_source_profiles *profiles, int max_side,
                          bst_fit *out) BST_MUST_CHECK;
/* Frees the memory of a fit and clears the struct, which belongs to the caller. */
void bst_fit_free(bst_fit *fit);

/* The stamp that holds a source with `reach_px` around its path, cut to the frame; width or height
 * is 0 when it lies outside. */
bst_imgproc_stamp bst_fit_stamp(const bst_imgproc_source *source, double reach_px, int max_side,
                                int width, int height);

/* What is to be fitted: x, y and flux of the `free` sources (the first is the one wanted, at most
 * BST_FIT_MAX_FREE) with the `fixed` ones taken off. */
typedef struct bst_fit_request {
    const bst_fit_data *data;
    const bst_imgproc_stamp *stamp; /* the first source's pixels */
    bst_imgproc_source *const *free;
    int free_count;
    const bst_imgproc_source *const *fixed;
    int fixed_count;
    bool free_width; /* also the first one's widening, where it is alone */
    double limit_px; /* by which a centre may move at most */
} bst_fit_request;

/* Gauss-Newton on sum (d - m)^2 / (noise^2 + m), the variance from the current model
 * (quasi-likelihood, equal to maximum likelihood to first order). Centres stay within limit_px of
 * where they start. The first source's covariance is the inverse of the Fisher matrix, its
 * neighbours' uncertainty included; saturated and bad pixels are left out. False and nothing
 * changed when the pixels do not determine the parameters. */
bool bst_fit_run(bst_fit *fit, const bst_fit_request *request);

/* sqrt(sum share^2) of the first source of the latest bst_fit_run on this stamp: its SNR is flux
 * times this over the background's noise. */
double bst_fit_norm(const bst_fit *fit, const bst_imgproc_stamp *stamp);

/* Second moments (variance along x, covariance, variance along y) of the source in its stamp with
 * the fixed sources taken off, from moments under a Gaussian window of twice the model's
 * covariance. False when they are not those of a peak. */
bool bst_fit_moments(bst_fit *fit, const bst_fit_data *data, const bst_imgproc_stamp *stamp,
                     const bst_imgproc_source *source, const bst_imgproc_source *const *fixed,
                     int fixed_count, double out[3]);

#endif
