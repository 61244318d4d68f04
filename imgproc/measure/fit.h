/* Weighted least-squares fit of a source and its neighbours to the pixels of a stamp. */
#ifndef BST_IMGPROC_MEASURE_FIT_H
#define BST_IMGPROC_MEASURE_FIT_H

#include <stdbool.h>

#include "boresight/status.h"
#include "imgproc/measure/source_profile.h"

enum { BST_FIT_MAX_FREE = 5, BST_FIT_MAX_PARAMETERS = 3 * BST_FIT_MAX_FREE + 1 };

/* Model of a source and its fit results, in frame pixels. */
typedef struct bst_imgproc_source {
    bst_imgproc_shape shape; /* centroid, smear path, sigma of the PSF */
    double flux_e;
    double widening_px2; /* added to the PSF's variance, to first order */
    /* fit results */
    double cov_xx, cov_xy, cov_yy, flux_variance, widening_variance;
    double chi_square;
    int pixels; /* number of fitted pixels */
    bool fitted;
} bst_imgproc_source;

/* Image data of the fit. */
typedef struct bst_fit_data {
    const float *signal; /* [height][width], electrons above background, see background.h */
    int width, height;
    double noise_e; /* of the background, at the source */
    double excess;  /* variance of a source's shot noise per electron: bst_camera_excess_noise */
} bst_fit_data;

/* Work space of the fit; the planes are [height][width rounded up to lanes] of a stamp. */
typedef struct bst_fit {
    const bst_imgproc_gauss *psf;
    const bst_source_profiles *profiles; /* set for the sources' sigma before a fit */
    int max_side;
    float *value, *fixed, *valid;
    float *model; /* [BST_FIT_MAX_FREE][4]: share, and its derivatives by x, y and variance */
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

/* Stamp of a source: its path plus `reach_px` on every side, clipped to the frame. Width or height
 * is 0 if it lies outside. */
bst_imgproc_stamp bst_fit_stamp(const bst_imgproc_source *source, double reach_px, int max_side,
                                int width, int height);

/* Request of a fit: x, y and flux of the `free` sources (the first is the result, at most
 * BST_FIT_MAX_FREE), with the light of the `fixed` ones subtracted. */
typedef struct bst_fit_request {
    const bst_fit_data *data;
    const bst_imgproc_stamp *stamp; /* pixels of the first source */
    bst_imgproc_source *const *free;
    int free_count;
    const bst_imgproc_source *const *fixed;
    int fixed_count;
    bool free_width; /* also fits the first source's widening, if it is the only free one */
    double limit_px; /* largest shift of a centre */
} bst_fit_request;

/* Gauss-Newton fit of sources that minimises sum (d - m)^2 / (noise^2 + excess m). The variance is
 * from the current model (quasi-likelihood, equal to maximum likelihood to first order).
 *
 * Centres stay within limit_px of their start. Saturated and bad pixels are excluded. The first
 * source's covariance is the inverse Fisher matrix including its neighbours' uncertainty.
 *
 * Returned:  false, with the sources unchanged, if the pixels do not determine the parameters */
bool bst_fit_run(bst_fit *fit, const bst_fit_request *request);

/* sqrt(sum share^2) of the first source of the latest bst_fit_run on this stamp. SNR = flux * norm
 * / background noise. */
double bst_fit_norm(const bst_fit *fit, const bst_imgproc_stamp *stamp);

/* Second moments of a source in its stamp, px^2: variance along x, covariance, variance along y.
 * The fixed sources are subtracted; the moments are weighted by a Gaussian of twice the model's
 * covariance. Returns false if the moments are not those of a peak. */
bool bst_fit_moments(bst_fit *fit, const bst_fit_data *data, const bst_imgproc_stamp *stamp,
                     const bst_imgproc_source *source, const bst_imgproc_source *const *fixed,
                     int fixed_count, double out[3]);

#endif
