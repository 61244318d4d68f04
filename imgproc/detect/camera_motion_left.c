/* The camera's motion in a frame: corrected by star streaks, and what remains unknown of it. */
#include <assert.h>

#include "imgproc/detect/detect_internal.h"

/* Drift of the camera unknown to the telemetry, px per exposure. */
static const double DRIFT_PX = 1.0;

/* 1 sigma per axis of the bend before it is measured on streaks, sensor px. */
static double unknown_bend_px(const bst_imgproc *ip, const bst_camera_motion *motion) {
    return bst_camera_motion_unknown_bend_px(
        ip->config.jitter_px, ip->config.motion_bend_px,
        motion->bend_sigma_rad / bst_camera_scale_rad(&ip->camera));
}

/* Least RMS of the departure of a path, in sigmas of the PSF, that is drawn in streaks: their
 * places err in proportion to it, by a hundredth of a sigma. */
static const double LEAST_DEPARTURE = 0.02;

void bst_imgproc_set_departure(bst_imgproc *ip) {
    bst_locate_frame *view = &ip->view;
    bst_path_departure *d = &ip->departure;
    view->departure = NULL;
    view->uneven = false;
    if (!view->motion || ip->smeared) { /* no path is drawn in a smeared frame */
        return;
    }
    static_assert((int)BST_PATH_KNOTS == BST_CAMERA_MOTION_KNOTS, "knots are copied one by one");
    for (int k = 0; k < BST_PATH_KNOTS; k++) {
        bst_camera_motion_departure(view->motion, &ip->camera, k, &d->x_px[k], &d->y_px[k]);
        d->x_px[k] /= view->binning;
        d->y_px[k] /= view->binning;
    }
    bst_path_departure_finish(d);
    const double least = LEAST_DEPARTURE * view->sigma_px;
    if (d->variance[0] + d->variance[2] > least * least) {
        view->departure = d;
    }
    view->uneven =
        bst_camera_motion_is_uneven(view->motion, &ip->camera, view->binning * view->sigma_px);
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
    if (!motion || ip->smeared || !(ip->filter.streak || ip->view.uneven)) {
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
    if (ip->view.uneven) {
        const bst_camera_motion_unknown unknown = {
            .bend_px = before,
            .drift_px = BST_CAMERA_MOTION_DRIFT_PX,
            .covariance = corrected ? ip->streak_motion.covariance : NULL,
            .ex = ip->streak_motion.ex,
            .ey = ip->streak_motion.ey};
        bst_camera_motion_set_uneven_shift(corrected ? corrected : motion, &ip->camera, sigma,
                                           &unknown, out);
        return;
    }
    bst_camera_motion_shared_shift(length, sigma, before, after, &along, &across);
    bst_camera_motion_set_shared(dx, dy, along, across, out);
}

void bst_imgproc_add_bend_covariance(const bst_camera *camera, const bst_locate_frame *f,
                                     const bst_imgproc_found *found, bst_detection *d) {
    const bst_imgproc_shape *s = &found->source.shape;
    if (!f->motion || found->joined) {
        return;
    }
    double x, y;
    bst_camera_motion_bend(f->motion, camera, &x, &y);
    const bool drawn = s->bend_x_px == x / f->binning && s->bend_y_px == y / f->binning;
    /* beside a neighbour no path of its own was fitted */
    const bool alone = !(found->flags & BST_DETECTION_BLEND);
    if (f->uneven && drawn && alone && found->source.fitted && !found->rough) {
        bst_camera_motion_widen_drawn(x, y, d);
    } else {
        const double followed = f->uneven ? 0.0 : f->binning;
        bst_camera_motion_widen(x, y, followed * s->bend_x_px, followed * s->bend_y_px, d);
    }
}
