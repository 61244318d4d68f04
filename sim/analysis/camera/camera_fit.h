/* A camera's geometry and photometry from identified stars of many frames. */
#ifndef BST_ANALYSIS_CAMERA_CAMERA_FIT_H
#define BST_ANALYSIS_CAMERA_CAMERA_FIT_H

#include <stdint.h>

#include "boresight/camera.h"
#include "boresight/status.h"

/* An identified star in a frame. */
typedef struct bst_camera_fit_star {
    int frame;                     /* from 0, in ascending order */
    int64_t id;                    /* of the star: errors of one star's places go together */
    bst_vec3 cam;                  /* unit, apparent, by the frame's approximate attitude */
    double x_px, y_px;             /* measured, full-sensor coordinates */
    double cov_xx, cov_xy, cov_yy; /* px^2 */
    double v_mag, b_minus_v;       /* of the catalogue; b_minus_v NAN: unknown */
    double rate_e_per_s, rate_sigma_e_per_s; /* NAN: no photometry of this star */
    double residual_x_px,
        residual_y_px; /* set by the fit: measured minus computed; NAN: rejected */
} bst_camera_fit_star;

/* The camera's parameters: scale ratio - 1, k1, k2, p1, p2. */
enum { BST_CAMERA_FIT_SIZE = 5 };

typedef struct bst_camera_geometry_fit {
    double pixel_scale_arcsec, pixel_scale_sigma_arcsec;
    bst_camera_distortion distortion, distortion_sigma; /* k3 stays that of the start */
    double corner_sigma_px; /* 1 sigma of the camera's map in the corner of the field */
    double scatter_px;      /* of a star's place per axis beyond its covariance */
    double rms_px;          /* of what is left, per axis */
    int stars, rejected, frames;
} bst_camera_geometry_fit;

/* Fits scale and distortion, and each frame's attitude, to all stars by least squares. Stars more
 * than 4.5 sigma off are left out; the scatter makes chi squared its expectation.
 *
 * Given:     start  camera near the true one, prepared; its rotation and offset are kept, as they
 *                   are not separable from the attitudes
 *            stars  [count]; their `left` are set
 *            frames number of frames; those with fewer than 4 stars are not used
 * Errors:    BST_ERR_RANGE: too few stars, or they do not determine the camera; BST_ERR_MEMORY
 * Notes:     a frame's attitude is eliminated from the normal equations (Schur complement), so that
 *            cost grows with the stars only. The covariance is that of clusters, one for each star,
 *            as its errors (catalogue, neighbours) are the same in all frames: Liang & Zeger 1986,
 *            Biometrika 73, 13 */
bst_status bst_camera_fit_geometry(bst_ctx *ctx, const bst_camera *start,
                                   bst_camera_fit_star *stars, int count, int frames,
                                   bst_camera_geometry_fit *out) BST_MUST_CHECK;

typedef struct bst_camera_photometry_fit {
    double zero_point_mag, zero_point_sigma_mag; /* V of a star with B-V = 0 and 1 electron/s */
    double colour_term, colour_term_sigma;       /* mag per mag of B-V */
    double scatter_mag;                          /* beyond the noise of the light */
    int stars, rejected;
} bst_camera_photometry_fit;

/* Fits V = zero_point - 2.5 log10(rate) + colour_term (B-V) to the stars with photometry and a
 * colour; stars more than 4 sigma off are left out.
 *
 * Notes:     standard errors by clusters, as of the geometry
 * Errors:    BST_ERR_RANGE: fewer than 3 such stars, or all of one colour; BST_ERR_MEMORY */
bst_status bst_camera_fit_photometry(bst_ctx *ctx, const bst_camera_fit_star *stars, int count,
                                     bst_camera_photometry_fit *out) BST_MUST_CHECK;

#endif
