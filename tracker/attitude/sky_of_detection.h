/* Converts detections from pixels to directions on the sky. */
#ifndef BST_TRACKER_ATTITUDE_SKY_OF_DETECTION_H
#define BST_TRACKER_ATTITUDE_SKY_OF_DETECTION_H

#include "boresight/camera.h"
#include "boresight/messages.h"
#include "sim/astro/bodies.h"
#include "tracker/mtt/sky_filter.h"

/* Geometric direction of a detection (aberration removed) with its covariance.
 *
 * Given:     extra_px2       variance per axis added to the centroid's, px^2
 *            covariance_cam  of the attitude about camera axes, rad^2 */
bst_sky_measurement bst_sky_of_detection(const bst_camera *camera, const bst_detection *item,
                                         double extra_px2, bst_quat q_cam_from_gcrf,
                                         const double covariance_cam[3][3], const bst_light *light);

#endif
