/* Least-squares fit of attitude and plate scale to identified stars. */
#ifndef BST_IMGPROC_IDENTIFY_STAR_FIT_H
#define BST_IMGPROC_IDENTIFY_STAR_FIT_H

#include "boresight/camera.h"

/* A star and its place in the frame. */
typedef struct bst_star_fit_pair {
    bst_vec3 gcrf;                 /* unit, apparent */
    double x_px, y_px;             /* full-sensor coordinates */
    double cov_xx, cov_xy, cov_yy; /* of the place, px^2; positive definite */
} bst_star_fit_pair;

/* Attitude, and the true pixel scale over the camera's own: the tangent coordinates of a pixel are
 * `scale` times those of the camera. */
typedef struct bst_star_fit {
    bst_quat q_cam_from_gcrf;
    double scale;
    double rms_px;      /* residual per axis, of bst_star_fit_refine */
    double chi_squared; /* of its residuals, by the pairs' covariances */
} bst_star_fit;

/* Attitude from two stars of given scale.
 *
 * Given:     pairs  two stars
 * Returned:  false if they coincide
 * Reference: Black 1964, AIAA Journal 2, 1350 (TRIAD) */
bool bst_star_fit_start(const bst_camera *camera, const bst_star_fit_pair pairs[2], double scale,
                        bst_star_fit *out);

/* Improves attitude and scale by weighted least squares (Gauss-Newton).
 *
 * Given:     pairs  [count] stars, 3 or more
 * Returned:  false if the stars leave a parameter undetermined; then *fit is unchanged */
bool bst_star_fit_refine(const bst_camera *camera, const bst_star_fit_pair *pairs, int count,
                         bst_star_fit *fit);

/* Place of a direction in the frame; false: behind the camera. */
bool bst_star_fit_project(const bst_star_fit *fit, const bst_camera *camera, bst_vec3 gcrf,
                          double *x_px, double *y_px);

#endif
