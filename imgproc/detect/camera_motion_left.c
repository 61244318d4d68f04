/* The camera's motion in a frame: corrected by star streaks, and what remains unknown of it. */
#include "imgproc/detect/detect_internal.h"

/* Drift of the camera unknown to the telemetry, px per exposure. */
static const double DRIFT_PX = 1.0;

/* 1 sigma per axis of the bend before it is measured on streaks, sensor px. */
static double unknown_bend_px(const bst_imgproc *ip, const bst_camera_motion *motion) {
    return bst_camera_motion_unknown_bend_px(
        ip->config.jitter_px, ip->config.motion_bend_px,
        motion->bend_sigma_rad / bst_camera_scale_rad(&ip->camera));
}

void bst_imgproc_correct_motion(bst_imgproc *ip, double binning, bst_camera_motion *motion) {
    const double bend_px = unknown_bend_px(ip, motion);
    if (!bst_streak_motion_solve(&ip->streak_motion, &ip->locator.psf, &ip->locator.profiles,
                                 &ip->camera, DRIFT_PX / binning, bend_px / binning, motion)) {
        motion->bend_sigma_rad = bend_px * bst_camera_scale_rad(&ip->camera);
    }
}

void bst_imgproc_set_shared_shift(const bst_imgproc *ip, const bst_camera_motion *motion,
                                  const bst_camera_motion *corrected, bst_detections *out) {
    if (!motion || !ip->filter.streak || ip->smeared) {
        return;
    }
    double dx, dy, along, across;
    bst_camera_motion_streak(corrected ? corrected : motion, &ip->camera,
                             bst_camera_centre_x(&ip->camera), bst_camera_centre_y(&ip->camera),
                             &dx, &dy);
    const double before = unknown_bend_px(ip, motion), length = hypot(dx, dy);
    const double after =
        corrected ? corrected->bend_sigma_rad / bst_camera_scale_rad(&ip->camera) : before;
    const double binning = ip->view.binning;
    const double sigma = binning * sqrt(ip->view.sigma_px * ip->view.sigma_px + 1.0 / 12.0);
    bst_camera_motion_shared_shift(length, sigma, before, after, &along, &across);
    bst_camera_motion_set_shared(dx, dy, along, across, out);
}
