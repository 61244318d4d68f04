/* Attitude of one frame from identified stars: robust weighted least squares on the sphere. */
#ifndef BST_TRACKER_ATTITUDE_ATTITUDE_H
#define BST_TRACKER_ATTITUDE_ATTITUDE_H

#include "boresight/camera.h"

/* One identified star: where it should be seen and where it was. */
typedef struct bst_attitude_star {
    uint32_t id;                   /* of the catalogue; not looked at */
    bst_vec3 apparent_gcrf;        /* unit, light deflection and aberration included */
    double x_px, y_px;             /* centroid */
    double cov_xx, cov_xy, cov_yy; /* px^2 */
    /* out */
    double weight;     /* 1 where the star was used, 0 where it was rejected */
    bst_vec3 pull_rad; /* where it was used: what its residual alone turns the attitude by, camera
                          axes; their sum over all stars is zero */
    double leverage;   /* where it was used: its share in the two angles about camera x and y */
} bst_attitude_star;

typedef struct bst_attitude_params {
    double floor_px;      /* 1 sigma per axis added to every centroid (catalogue, distortion) */
    double reject_chi2;   /* stars beyond this (2 degrees of freedom) are not used */
    double max_cross_rad; /* largest 1 sigma of a valid fix about camera x and y */
    double max_roll_rad;  /* the same about the boresight */
} bst_attitude_params;

typedef struct bst_attitude_solution {
    bool valid;
    int stars_used;
    bst_quat q_cam_from_gcrf;
    /* of the rotation vector e in camera axes with q = bst_quat_from_rotvec(e) * q_true, rad^2 */
    double covariance[3][3];
    double rms_px;    /* of the residuals of the stars used, per axis */
    double chi2;      /* of the stars used */
    int dof;          /* 2 * stars_used - 3 */
    double excess_px; /* 1 sigma per axis that was found missing from the stars' covariances */
} bst_attitude_solution;

/* Finds the rotation that brings `count` stars onto their centroids, starting from q_start (within
 * a few degrees). Gauss-Newton on the rotation vector; misidentified stars lose their weight by
 * graduated non-convexity (Cauchy weights whose scale shrinks; Black and Rangarajan 1996), then
 * those beyond reject_chi2 are dropped and the rest is solved by weighted least squares.
 *
 * What the covariances of the centroids do not know (errors of the catalogue and of the camera's
 * model) is a variance that all stars have besides: found from the median misfit before stars are
 * dropped and from the sum of chi-square afterwards, and taken for none where the misfit may be
 * chance. It needs at least 6 stars. Bright stars then count for no more than they are worth.
 * Not valid when: fewer than 2 stars agree, fewer than 3 when any star was rejected, less than 60 %
 * of the stars agree, two stars' separation is wrong, or the geometry leaves an axis worse than its
 * limit. The covariance is that of least squares. */
void bst_attitude_solve(const bst_camera *camera, const bst_attitude_params *params,
                        bst_quat q_start, bst_attitude_star *stars, int count,
                        bst_attitude_solution *out);

#endif
