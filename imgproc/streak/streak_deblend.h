/* Joint fit of all stars of a frame along their common path, on the pixels. */
#ifndef BST_IMGPROC_STREAK_STREAK_DEBLEND_H
#define BST_IMGPROC_STREAK_STREAK_DEBLEND_H

#include <stdbool.h>

#include "boresight/status.h"
#include "imgproc/streak/star_path.h"

/* A star of the fit. */
typedef struct bst_deblended_star {
    double x_px, y_px; /* of the path's origin; may lie outside the frame */
    double flux;       /* of the whole streak, in units of the noise of a background pixel */
    double snr;        /* of its part in the frame, at its place, with the errors of its neighbours'
                          model as noise */
    double inside;     /* share of its squared image that the frame holds, 0 to 1 */
    double cov_xx, cov_xy, cov_yy; /* of the place, px^2; set by bst_streak_deblend_finish */
} bst_deblended_star;

/* The image, the model of its stars, and what is left. */
typedef struct bst_streak_deblend {
    int width, height;
    const bst_star_path *path; /* lent */
    double psf_sigma_px;       /* of a Gaussian that contains the pixel */
    double shot; /* variance of a unit of light, in units of the noise's: 1 / noise in electrons; 0:
                    no shot noise */
    double noise2; /* variance of a background pixel */
    double error;  /* relative error of the model, measured on the residual */
    double spread; /* standard deviation of the matched filter's response over that of white noise,
                      at least 1; set by the caller: structure of the background has it */
    float *residual; /* [height][width] image less background and stars, unit noise */
    float *model;    /* [height][width] of all stars */
    float *weight;   /* [height][width] 1 / variance; 0: no value */
    bst_deblended_star *stars;
    int count, room;
    /* image of one star and its derivatives by x and y */
    float *image, *image_x, *image_y;
    int *touched, touched_count; /* pixels where it is not 0 */
    float *scratch;
} bst_streak_deblend;

/* What a fit is made for. */
typedef struct bst_streak_deblend_config {
    int width, height, room;   /* room: most stars */
    const bst_star_path *path; /* must outlive the fit */
    double psf_sigma_px, shot; /* as in the fit */
} bst_streak_deblend_config;

/* Creates a fit without stars.
 *
 * Given:     image  [height][width], of unit noise; NAN: no value
 * Errors:    BST_ERR_MEMORY
 * Ownership: free with bst_streak_deblend_free */
bst_status bst_streak_deblend_create(bst_ctx *ctx, const float *image,
                                     const bst_streak_deblend_config *config,
                                     bst_streak_deblend *out) BST_MUST_CHECK;
/* Frees the memory of a fit and clears the struct, which belongs to the caller. */
void bst_streak_deblend_free(bst_streak_deblend *d);

/* Adds a star and subtracts it; false: there is no room. */
bool bst_streak_deblend_add(bst_streak_deblend *d, double x_px, double y_px, double flux);

/* Takes the pixels about a place out of the fit: what is there is no star of the path. */
void bst_streak_deblend_leave_out(bst_streak_deblend *d, double x_px, double y_px,
                                  double radius_px);

/* Improves flux and place of each star in turn by weighted least squares, `sweeps` times
 * (Gauss-Seidel on the normal equations of all stars), and measures the SNR of each.
 *
 * Given:     first  number of the first star of the last sweep; the sweeps before take all
 *
 * Notes:     The variance of a pixel is that of the background, the shot noise of the model, and
 *            for the light of other stars the error of their model, which is the same along a
 *            streak: COHERENT pixels have it in common. */
void bst_streak_deblend_fit(bst_streak_deblend *d, int sweeps, int first);

/* Removes the stars whose SNR is below a limit, and gives back their light; returns how many. */
int bst_streak_deblend_drop(bst_streak_deblend *d, double least_snr);

/* Measures background, noise and error of the model on what is left, and sets the weights. The
 * background is bilinear between medians of cells. */
void bst_streak_deblend_weigh(bst_streak_deblend *d);

/* Sets the covariances of the places.
 *
 * Given:     systematic_px  error beside the noise
 *
 * Notes:     Along a streak the likelihood is not parabolic: its ends fade into the noise. The
 *            standard deviation is the shift by which the expected logarithm of the likelihood
 *            falls by a half. */
void bst_streak_deblend_finish(bst_streak_deblend *d, double systematic_px);

#endif
