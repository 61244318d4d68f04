/* The onboard camera with the geometry that image processing has learned from stars. */
#ifndef BST_OPTICS_CALIBRATED_CAMERA_H
#define BST_OPTICS_CALIBRATED_CAMERA_H

#include "boresight/camera.h"
#include "boresight/messages/detections.h"
#include "boresight/status.h"

/* Applies a calibration to the onboard camera.
 *
 * Given:     onboard      camera as known before the flight, prepared
 *            calibration  frames 0: the result is `onboard`
 * Returned:  out  prepared; may be `onboard`
 * Errors:    BST_ERR_CONFIG if the distortion folds the image inside the sensor; *out is unchanged
 */
bst_status bst_camera_apply_calibration(bst_ctx *ctx, const bst_camera *onboard,
                                        const bst_camera_calibration *calibration,
                                        bst_camera *out) BST_MUST_CHECK;

#endif
