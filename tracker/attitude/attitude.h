/* Attitude of one frame from identified stars: robust weighted least squares on the sphere. */
#ifndef BST_TRACKER_ATTITUDE_ATTITUDE_H
#define BST_TRACKER_ATTITUDE_ATTITUDE_H

#include "boresight/camera.h"

/* An identified star: catalogue direction and measured centroid. */
typedef struct bst_attitude_star {
    uint32_t id;                   /* catalogue identity, not used by the solution */
    bst_vec3 apparent_gcrf;        /* unit, light deflection and aberration included */
    double x_px, y_px;             /* centroid */
    double cov_xx, cov_xy, cov_yy; /* px^2 */
    /* results */
    double weight; /* 1: used, 0: rejected */
    /* used star: rotation of the attitude by its residual alone, camera axes; the sum over all
     * stars is zero */
    bst_vec3 pull_rad;
    double leverage; /* used star: its share in the two angles about camera x and y */
    /* work space at the latest attitude and excess variance: residual (measured - predicted, px),
     * its derivative by the camera rotation vector (px/rad), inverse covariance (xx, xy, yy) */
    bool in_front; /* of the camera; else the rest is undefined */
    bool positive; /* its covariance is positive definite; else `information` is undefined */
    bool fits;     /* both, and chi2 is finite */
    double residual_px[2], by_rotation_px[2][3], information[3], chi2;
    double sorted; /* chi2 of some star, for the median */
} bst_attitude_star;

typedef struct bst_attitude_params {
    double floor_px;      /* 1 sigma per axis added to every centroid (catalogue, distortion) */
    double reject_chi2;   /* largest chi-square of a used star, 2 degrees of freedom */
    double max_cross_rad; /* largest 1 sigma of a valid fix about camera x and y */
    double max_roll_rad;  /* largest 1 sigma about the boresight */
} bst_attitude_params;

typedef struct bst_attitude_solution {
    bool valid;
    int stars_used;
    bst_quat q_cam_from_gcrf;
    /* of the rotation vector e in camera axes with q = bst_quat_from_rotvec(e) * q_true, rad^2 */
    double covariance[3][3];
    double rms_px;    /* of the residuals of used stars, per axis */
    double chi2;      /* of the stars used */
    int dof;          /* 2 * stars_used - 3 */
    double excess_px; /* 1 sigma per axis of the excess variance */
} bst_attitude_solution;

/* Estimates the attitude from `count` identified stars, starting within a few degrees at q_start.
 *
 * Gauss-Newton on the rotation vector. Misidentified stars lose weight by graduated non-convexity:
 * Cauchy weights of shrinking scale (Black and Rangarajan 1996). Stars beyond reject_chi2 are then
 * dropped, and the others are solved by weighted least squares.
 *
 * An excess variance common to all stars covers errors of catalogue and camera model. It is
 * estimated from the median misfit before rejection and from the chi-square sum afterwards. It is
 * zero if the misfit may be chance, and needs at least 6 stars. It limits the weight of bright
 * stars.
 *
 * The solution is invalid if fewer than 2 stars agree, or fewer than 3 after a rejection, or fewer
 * than 60 %. It is also invalid if the separation of two stars is wrong, or if an axis is less
 * accurate than its limit. The covariance is that of least squares. */
void bst_attitude_solve(const bst_camera *camera, const bst_attitude_params *params,
                        bst_quat q_start, bst_attitude_star *stars, int count,
                        bst_attitude_solution *out);

#endif
