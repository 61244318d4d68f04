/* Estimation of the camera's geometry from identified stars: pixel scale, rotation of the focal
 * plane and low-order distortion. */
#ifndef BST_IMGPROC_IDENTIFY_CAMERA_CALIBRATOR_H
#define BST_IMGPROC_IDENTIFY_CAMERA_CALIBRATOR_H

#include "boresight/archive.h"
#include "sim/optics/calibrated_camera.h"

typedef struct bst_camera_calibrator_config {
    bool enabled;
    /* 1 sigma of the onboard camera's errors; 0: known exactly */
    double scale_sigma;
    double rotation_sigma_deg;
    double distortion_sigma_px; /* at the field's corner, radial and tangential each */
    double telemetry_roll_sigma_arcsec;
    double drift_px_per_sqrt_h; /* random walk of each parameter, at the field's corner */
    double star_sigma_px;       /* error of a star's place beyond its covariance */
} bst_camera_calibrator_config;

extern const bst_config_desc bst_camera_calibrator_config_table[];

/* A star and its place in the frame. */
typedef struct bst_camera_calibrator_star {
    bst_vec3 cam; /* unit, apparent, in the camera frame by the predicted attitude */
    double x_px, y_px;
    double cov_xx, cov_xy, cov_yy; /* of the place, px^2 */
} bst_camera_calibrator_star;

/* State of the estimate: a Kalman filter of a random walk. Its five parameters are the logarithm of
 * the scale ratio, the rotation (rad), and k1, p1 and p2 as relative displacements at the field's
 * corner. */
typedef struct bst_camera_calibrator {
    const bst_camera_calibrator_config *config;
    bst_camera onboard, camera; /* before the flight; with the estimate */
    double corner;              /* tangent radius of the field's corner */
    double x[BST_CAMERA_CALIBRATION_SIZE];
    double p[BST_CAMERA_CALIBRATION_SIZE][BST_CAMERA_CALIBRATION_SIZE];
    int32_t frames;
    double seconds; /* of the latest frame */
} bst_camera_calibrator;

/* Starts an estimate at the onboard camera.
 *
 * Given:     config   must outlive *out
 *            onboard  prepared */
void bst_camera_calibrator_begin(const bst_camera_calibrator_config *config,
                                 const bst_camera *onboard, bst_camera_calibrator *out);

/* Sets scale and rotation, found coarsely by other means.
 *
 * Given:     scale         true pixel scale over the onboard one, > 0
 *            rotation_rad  to be added to the onboard rotation
 *            sigma         1 sigma of both, relative and rad; the distortion's is not changed
 * Errors:    BST_ERR_CONFIG as bst_camera_apply_calibration; nothing is changed */
bst_status bst_camera_calibrator_set(bst_ctx *ctx, bst_camera_calibrator *c, double scale,
                                     double rotation_rad, double sigma) BST_MUST_CHECK;

/* Stars of one frame. */
typedef struct bst_camera_calibrator_frame {
    const bst_camera_calibrator_star *stars; /* [count] */
    int count;
    double seconds; /* mid-exposure; frames come in order */
    /* rotation about the boresight of the telemetry's attitude against the predicted one, rad; NAN:
     * telemetry does not measure it, and the focal plane's rotation is not estimated */
    double telemetry_roll_rad;
} bst_camera_calibrator_frame;

/* Updates the estimate with a frame, by iterated weighted least squares over the five parameters
 * and the attitude's error of this frame, which is unknown.
 *
 * Returned:  false if there were too few stars, or they do not agree with any camera near the
 *            estimate; then nothing is changed
 * Notes:     Errors that stay with a star are not averaged by more frames; star_sigma_px is to
 *            contain them. The rotation contains the telemetry's error about the boresight, as its
 *            covariance says.
 * Reference: Bell & Cathey 1993, SIAM J. Control Optim. 31, 294 (iterated Kalman update as
 *            Gauss-Newton) */
bool bst_camera_calibrator_update(bst_camera_calibrator *c,
                                  const bst_camera_calibrator_frame *frame);

/* The estimate with its covariance; frames 0: none yet. */
void bst_camera_calibrator_get(const bst_camera_calibrator *c, bst_camera_calibration *out);

/* Saves or restores the estimate. Errors: BST_ERR_RANGE for a damaged one. */
bst_status bst_camera_calibrator_archive(bst_camera_calibrator *c,
                                         bst_archive *archive) BST_MUST_CHECK;

#endif
