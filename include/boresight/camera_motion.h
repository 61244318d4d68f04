/* How the camera moved during one exposure, as pointing telemetry tells it. */
#ifndef BORESIGHT_CAMERA_MOTION_H
#define BORESIGHT_CAMERA_MOTION_H

#include <stdbool.h>

#include "boresight/camera.h"
#include "boresight/messages.h"

#pragma GCC visibility push(default)

typedef struct bst_camera_motion {
    bst_quat q_cam_from_gcrf; /* mean over the exposure, so that a streak's centroid agrees */
    bst_vec3 turn_cam_rad;    /* rotation vector, camera axes: the attitude at the exposure's end is
                                 bst_quat_from_rotvec(turn / 2) * q_cam_from_gcrf, at its start with
                                 -turn / 2 */
    bst_vec3 bend_cam_rad; /* coefficient of (3 u^2 - 1) / 2, u from -1 to 1 over the exposure: how
                              far the motion departs from a uniform one */
    double bend_sigma_rad; /* 1 sigma per axis of the bend, from the telemetry's noise; 0 where
                              there are too few samples to tell it */
} bst_camera_motion;

/* Mean, least-squares slope and bend of the telemetry attitude over [start_tick, end_tick];
 * attitudes between samples are interpolated and beyond the ring's ends extrapolated from the two
 * last samples there. With at least 8 samples in the exposure their noise is told from their third
 * differences, which smooth motion leaves alone, and the bend about x and y is shrunk by 2 s^2 over
 * its square, s the sigma that such noise gives it (James and Stein 1961, positive part). A
 * zero-length exposure gives the attitude then, no turn and no bend. False, and *out untouched,
 * when the ring is empty. */
bool bst_camera_motion_from_telemetry(const bst_pointing_telemetry *telemetry, int64_t start_tick,
                                      int64_t end_tick, bst_camera_motion *out);

/* Path of a star that is at (x_px, y_px) in mid-exposure: end minus start, px. */
void bst_camera_motion_streak(const bst_camera_motion *motion, const bst_camera *camera,
                              double x_px, double y_px, double *dx_px, double *dy_px);
/* The bend of a star's path near the boresight, px. */
void bst_camera_motion_bend(const bst_camera_motion *motion, const bst_camera *camera, double *x_px,
                            double *y_px);
/* Widens the covariance of a detection's place, which stands for the mean of its path: a fit that
 * does not follow the camera's uneven turn (bend, px) finds the place where the source dwelt, half
 * the bend away when most of the path is there. followed: the bend that the fit had; a quadratic
 * does not tell all of a start or a stop, and 5 % of it are left. */
void bst_camera_motion_widen(double bend_x_px, double bend_y_px, double followed_x_px,
                             double followed_y_px, bst_detection *detection);
/* Adds to the motion what makes paths near the boresight longer by (dx_px, dy_px) and bends them by
 * (bend_x_px, bend_y_px) more. */
void bst_camera_motion_add(bst_camera_motion *motion, const bst_camera *camera, double dx_px,
                           double dy_px, double bend_x_px, double bend_y_px);

#pragma GCC visibility pop

#endif
