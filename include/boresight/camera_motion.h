/* Motion of the camera during one exposure, estimated from pointing telemetry. */
#ifndef BORESIGHT_CAMERA_MOTION_H
#define BORESIGHT_CAMERA_MOTION_H

#include <stdbool.h>

#include "boresight/camera.h"
#include "boresight/messages.h"

#pragma GCC visibility push(default)

enum { BST_CAMERA_MOTION_KNOTS = 65 };

typedef struct bst_camera_motion {
    bst_quat q_cam_from_gcrf; /* mean over the exposure: consistent with the centroid of a streak */
    bst_vec3 turn_cam_rad;    /* rotation vector, camera axes: the attitude at the exposure's end is
                                 bst_quat_from_rotvec(turn / 2) * q_cam_from_gcrf, at its start with
                                 -turn / 2 */
    bst_vec3 bend_cam_rad; /* coefficient of (3 u^2 - 1) / 2, u from -1 to 1 over the exposure: the
                              departure from uniform motion */
    double
        bend_sigma_rad; /* 1 sigma of the bend per axis, from telemetry noise; 0: too few samples */
    /* what is left of the rotation about camera x and y beside mean, turn and bend, at equal steps
     * from the start of the exposure to its end; all 0: nothing beyond the telemetry's noise */
    double departure_cam_rad[2][BST_CAMERA_MOTION_KNOTS];
} bst_camera_motion;

/* Estimates the camera's motion during one exposure from pointing telemetry.
 *
 * Given:     telemetry             ring of attitude samples
 *            start_tick, end_tick  begin and end of the exposure, ticks
 * Returned:  *out  mean attitude, turn and bend; unchanged if the result is false
 * Notes:     false if the ring is empty.
 *            Mean, least-squares slope and bend of the attitude over [start_tick, end_tick].
 *            Attitudes between samples are interpolated linearly; beyond the ring's ends they are
 *            extrapolated from the two last samples. With at least 8 samples in the exposure, the
 *            variance of the samples' noise is estimated from third differences, which smooth
 *            motion does not affect. The bend about x and y is then multiplied by 1 - 2 s^2 /
 *            bend^2 (0 if negative), s being the standard deviation that this noise gives the bend.
 *            bend_sigma_rad is the root of that share of s^2, of a third at least: a bend that
 *            noise hides is unknown, not zero.
 *            The departure is what telemetry shows beyond that, times 1 - 2 s^2 / (its mean square
 *            over the exposure, both axes together), s that noise. It is 0 below four times that
 *            noise or if fewer than 8 samples show it.
 *            An exposure of length zero gives the attitude at that time, no turn and no bend.
 * Reference: James and Stein 1961 (positive-part shrinkage); Strawderman, Annals of Mathematical
 *            Statistics 42, 385, 1971: with a uniform prior of the shrinkage, a third of s^2 is
 *            left where the measured bend is 0 */
bool bst_camera_motion_from_telemetry(const bst_pointing_telemetry *telemetry, int64_t start_tick,
                                      int64_t end_tick, bst_camera_motion *out);

/* Displacement of a star's image during the exposure.
 *
 * Given:     x_px, y_px  position at mid-exposure, full-sensor pixel coordinates
 * Returned:  dx_px, dy_px  position at the end minus position at the start, px; 0 if one of them
 *                          has no image */
void bst_camera_motion_streak(const bst_camera_motion *motion, const bst_camera *camera,
                              double x_px, double y_px, double *dx_px, double *dy_px);

/* Bend of a star's path near the boresight.
 *
 * Returned:  x_px, y_px  coefficient of (3 u^2 - 1) / 2, px (bst_camera_motion, bend_cam_rad) */
void bst_camera_motion_bend(const bst_camera_motion *motion, const bst_camera *camera, double *x_px,
                            double *y_px);

/* Departure of a star's path near the boresight from one with a bend.
 *
 * Given:     knot  0 to BST_CAMERA_MOTION_KNOTS - 1, from the start of the exposure to its end
 * Returned:  x_px, y_px  px */
void bst_camera_motion_departure(const bst_camera_motion *motion, const bst_camera *camera,
                                 int knot, double *x_px, double *y_px);

/* Adds the error that the bend of the motion causes to the covariance of a detection's position.
 *
 * Given:     bend_x_px, bend_y_px          bend of the path, px
 *            followed_x_px, followed_y_px  bend that the fit used, px; 0: a straight path
 *            detection                     its cov_xx, cov_xy and cov_yy are increased
 * Notes:     the position is to be the mean of the path. A fit that ignores the bend is biased
 *            towards the part of the path where the source moves slowly, by up to half the bend. 5
 *            % of the bend that the fit used are added as well, because a quadratic does not
 *            describe a start or a stop completely. */
void bst_camera_motion_widen(double bend_x_px, double bend_y_px, double followed_x_px,
                             double followed_y_px, bst_detection *detection);

/* Adds the error of a path by telemetry that is drawn with all of its bend and departure to the
 * covariance of a detection's position: a hundredth of the bend. */
void bst_camera_motion_widen_drawn(double bend_x_px, double bend_y_px, bst_detection *detection);

/* True if bend and departure matter to the places of points: their RMS is above 0.2 sigma_px of the
 * PSF. Sources are then drawn with the whole path. */
bool bst_camera_motion_is_uneven(const bst_camera_motion *motion, const bst_camera *camera,
                                 double sigma_px);

/* Path of a star near the boresight against its mean, at equal steps in time from the start of the
 * exposure to its end, px. */
void bst_camera_motion_path(const bst_camera_motion *motion, const bst_camera *camera,
                            double path[BST_CAMERA_MOTION_KNOTS][2]);

/* Adds a displacement and a bend of the image near the boresight to the motion.
 *
 * Given:     dx_px, dy_px          displacement to add (end minus start), px
 *            bend_x_px, bend_y_px  bend to add, px */
void bst_camera_motion_add(bst_camera_motion *motion, const bst_camera *camera, double dx_px,
                           double dy_px, double bend_x_px, double bend_y_px);

/* 1 sigma per axis of the bend of an exposure's path before it is measured on streaks, px: of
 * jitter whose spectrum is flat from 2.5 to 100 cycles per exposure, of what neither it nor
 * telemetry shows, and of the telemetry's noise.
 *
 * Given:     jitter_px     RMS per axis
 *            own_px        bend that is known besides (motion_bend_px of imgproc)
 *            telemetry_px  bend_sigma_rad, in px */
double bst_camera_motion_unknown_bend_px(double jitter_px, double own_px, double telemetry_px);

/* Variance of the displacement that all star streaks of a frame share, because the motion of the
 * camera departs from the one that is fitted.
 *
 * Given:     length_px      of the streaks
 *            sigma_px       of the PSF with the pixel
 *            before_px      1 sigma per axis of the bend before it is measured on streaks
 *            after_px       1 sigma of the bend along the streaks that is left
 * Returned:  along_px2, across_px2
 * Notes:     the positions are to be the mean of the path. A fit of a uniform streak weighs the
 *            path along itself by what its two ends show, across it by the light that its profile
 *            catches. The departure has a flat spectrum: its Legendre coefficients of even degree n
 *            have variances in proportion to 2 n + 1, and that of degree 2 is the bend.
 * Reference: docs/explanation/equations/image_processing.md, "Motion of the stars" */
void bst_camera_motion_shared_shift(double length_px, double sigma_px, double before_px,
                                    double after_px, double *along_px2, double *across_px2);

/* Drift of the camera that no streak measures, 1 sigma per axis, px per exposure: 1 arcsec/s for
 * 0.5 s in pixels of 2 arcsec. */
#define BST_CAMERA_MOTION_DRIFT_PX 0.25

/* What is not known of a camera's motion in an exposure. */
typedef struct bst_camera_motion_unknown {
    double bend_px;  /* 1 sigma per axis of the bend before it is measured on streaks */
    double drift_px; /* 1 sigma per axis of end minus start, if it is not measured */
    /* measured on streaks: covariance of length, of end minus start across the path and of the bend
     * along it, whose direction is (ex, ey), px^2; NULL: not measured */
    const double (*covariance)[3];
    double ex, ey;
} bst_camera_motion_unknown;

/* Covariance of the displacement that all images of one path share, of any path:
 * bst_camera_motion_shared_shift where it is uniform.
 *
 * Given:     path      places at equal steps in time from the start of the exposure to its end, px
 *            sigma_px  of the PSF with the pixel
 * Returned:  shared    xx, xy, yy, px^2
 * Notes:     A fit of the image T of the path p(t) to one of p(t) + d(t) is displaced by the mean
 *            of W(t) d(t), to first order. W(t) is the mean over u of -grad grad K(p(t) - p(u)), K
 *            a Gaussian of twice the PSF's variance, times the inverse of the mean of that over t.
 *            A flux that is fitted too does not change it: T and grad T are orthogonal. d(t) has
 *            the spectrum of bst_camera_motion_shared_shift.
 * Reference: docs/explanation/equations/image_processing.md, "Motion of the stars" */
void bst_camera_motion_uneven_shift(const double path[BST_CAMERA_MOTION_KNOTS][2], double sigma_px,
                                    const bst_camera_motion_unknown *unknown, double shared[3]);

/* Sets the shared_xx, shared_xy and shared_yy of detections to those of
 * bst_camera_motion_uneven_shift for the path of a star near the boresight. */
void bst_camera_motion_set_uneven_shift(const bst_camera_motion *motion, const bst_camera *camera,
                                        double sigma_px, const bst_camera_motion_unknown *unknown,
                                        bst_detections *detections);

/* Sets the shared_xx, shared_xy and shared_yy of detections from variances along and across streaks
 * of direction (dx_px, dy_px). */
void bst_camera_motion_set_shared(double dx_px, double dy_px, double along_px2, double across_px2,
                                  bst_detections *detections);

#pragma GCC visibility pop

#endif
