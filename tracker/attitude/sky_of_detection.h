/* Detections as directions. */
#ifndef BST_TRACKER_ATTITUDE_SKY_OF_DETECTION_H
#define BST_TRACKER_ATTITUDE_SKY_OF_DETECTION_H

#include "boresight/camera.h"
#include "boresight/messages.h"
#include "sim/astro/bodies.h"
#include "tracker/mtt/sky_filter.h"

/* A detection as a geometric direction (aberration removed) with the covariance of its centroid,
 * widened by extra_px2 (px^2) per axis, and of the attitude (rad^2, about camera axes). */
bst_sky_measurement bst_sky_of_detection(const bst_camera *camera, const bst_detection *item,
                                         double extra_px2, bst_quat q_cam_from_gcrf,
                                         const double covariance_cam[3][3], const bst_light *light);

#endif
