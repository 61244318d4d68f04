/* Matched filter for stars that follow a common path: finds them one after the other. */
#ifndef BST_IMGPROC_STREAK_PATH_FILTER_H
#define BST_IMGPROC_STREAK_PATH_FILTER_H

#include "boresight/status.h"
#include "imgproc/streak/star_path.h"

typedef struct bst_path_filter bst_path_filter;

/* Filters an image.
 *
 * The response at a place is the sum of the image along the path there, weighted by the path's
 * light. Its noise is that of the samples inside the frame.
 *
 * Given:     path          copied
 *            image         of unit noise after the convolution with a Gaussian of psf_sigma_px
 *            psf_sigma_px  up to 4 px
 *            least_inside  share of the path that must be inside the frame, by its squared light
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_path_filter_free */
bst_status bst_path_filter_create(bst_ctx *ctx, const bst_star_path *path,
                                  const bst_star_path_image *image, double psf_sigma_px,
                                  double least_inside, bst_path_filter **out) BST_MUST_CHECK;
/* Filters an image whose pixels have different variances.
 *
 * Given:     image    divided by the variance before the convolution
 *            weights  [height][width] one over the variance, convolved with the squared PSF of unit
 *                     sum; not needed after the call. The share inside the frame counts by it
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_path_filter_free
 *
 * Notes:     bst_path_filter_subtract subtracts the response of unit weights, which is too much
 *            where they are smaller */
bst_status bst_path_filter_create_weighted(bst_ctx *ctx, const bst_star_path *path,
                                           const bst_star_path_image *image, const float *weights,
                                           double psf_sigma_px, double least_inside,
                                           bst_path_filter **out) BST_MUST_CHECK;
/* As bst_path_filter_create_weighted, in the memory of an earlier filter.
 *
 * Given:     weights  NULL: all are 1
 *            *filter  NULL, or the earlier filter
 * Errors:    BST_ERR_MEMORY; *filter is then NULL, and the earlier one is freed */
bst_status bst_path_filter_renew(bst_ctx *ctx, const bst_star_path *path,
                                 const bst_star_path_image *image, const float *weights,
                                 double psf_sigma_px, double least_inside,
                                 bst_path_filter **filter) BST_MUST_CHECK;
/* True for the filter of a path. */
bool bst_path_filter_is_of(const bst_path_filter *filter, const bst_star_path *path);
/* Begins the search anew, with nothing subtracted and nothing left out.
 *
 * Given:     image  that of the filter's creation, with the same values */
void bst_path_filter_restart(bst_path_filter *filter, const bst_star_path_image *image);
/* Frees a filter; NULL is allowed. */
void bst_path_filter_free(bst_path_filter *filter);

/* Standard deviation of the response over that of white noise: the root mean square of what is
 * below zero and not below three standard deviations, where no stars are. 1: too few places are
 * searched.
 *
 * Given:     filter  before its first subtraction: later, only a part of the response is up to date
 */
double bst_path_filter_spread(const bst_path_filter *filter);

/* A maximum of the response. */
typedef struct bst_path_filter_peak {
    double x_px, y_px; /* of the path's middle; may lie outside the frame */
    double amplitude;  /* of the light per sample, in units of the image's noise */
    double snr;
    double inside;                 /* share of the path inside the frame, by its squared light */
    double cov_xx, cov_xy, cov_yy; /* of the place, px^2 */
    bool whole; /* a maximum on all sides, not one at the limit of what is searched */
} bst_path_filter_peak;

/* Highest maximum in SNR. Filters the places again that may hold it. Returns false if no value is
 * positive. */
bool bst_path_filter_highest(bst_path_filter *filter, bst_path_filter_peak *out);

/* Subtracts the response to a star (Hogbom 1974, A&AS 15, 417).
 *
 * Given:     peak  of positive amplitude
 *
 * Notes:     The star is subtracted from the filter's copy of the image. The response can only
 *            fall, so places are filtered again when their former response is the highest of all.
 *            An amplitude below zero would raise responses that are then missed. */
void bst_path_filter_subtract(bst_path_filter *filter, const bst_path_filter_peak *peak);

/* Subtracts the response to a point source of the image, as bst_path_filter_subtract does.
 *
 * Given:     x_px, y_px  its place
 *            amplitude   value of the convolved image there, positive */
void bst_path_filter_subtract_point(bst_path_filter *filter, double x_px, double y_px,
                                    double amplitude);

/* Leaves a circle about a peak out of the search: what the subtraction of a bright star left. */
void bst_path_filter_leave_out(bst_path_filter *filter, const bst_path_filter_peak *peak,
                               double radius_px);

#endif
