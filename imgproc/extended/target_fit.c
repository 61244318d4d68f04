#include "imgproc/extended/target_fit.h"

#include <assert.h>
#include <math.h>

#include "sim/optics/band.h"

/* Distance from the outline's centre, standard deviations, beyond which a fit is not believed. */
static const double GATE = 8.0;
/* Standard errors that the formal covariances do not have: of the centre, and of the size (edges
 * that are all too far in or out), px. */
static const double CENTRE_SIGMA_PX = 0.05, SIZE_SIGMA_PX = 0.5;
/* Standard deviation of the outline's centre if the model is larger than what is seen, share of the
 * difference. */
static const double HIDDEN_SIGMA = 0.5;
/* Extent that shows, in radii of the model: its mean for a body with arrays. */
static const double SEEN_SIZE = 1.4;

/* The sight of a silhouette. */
static bool make_sight(const bst_target_fit_frame *frame, double model_sigma,
                       const bst_silhouette *s, bst_target_sight *out, bst_quat *q_local_from_cam) {
    const bst_extended_view *v = frame->view;
    const bst_camera *camera = v->camera;
    double b = v->binning;
    bst_vec3 middle = bst_camera_unproject(camera, v->origin_x_px + b * s->centre_x_px,
                                           v->origin_y_px + b * s->centre_y_px);
    *q_local_from_cam = bst_quat_look(middle, bst_vec3_make(1.0, 0.0, 0.0));
    double scale = bst_camera_scale_rad(camera);
    *out = (bst_target_sight){
        .q_local_from_gcrf = bst_quat_mul(*q_local_from_cam, frame->q_cam_from_gcrf),
        .sun_local = bst_quat_rotate(*q_local_from_cam, v->sun_cam),
        .scale_rad = scale,
        .full_e = bst_camera_electrons_per_s(camera, BST_SUN_V_MAG) * frame->exposure_s * scale *
                  scale * b * b,
        .least_e = s->least_e,
        .size_px = b * s->length_px,
        .model_sigma = model_sigma};
    for (int k = 0; k < BST_TARGET_DIRECTIONS; k++) {
        out->support_px[k] = -INFINITY;
    }
    for (int i = 0; i < s->outline.count; i++) {
        bst_outline_point p = s->outline.corner[i];
        bst_vec3 at = bst_quat_rotate(
            *q_local_from_cam,
            bst_camera_unproject(camera, v->origin_x_px + b * p.x_px, v->origin_y_px + b * p.y_px));
        double x = at.x / (at.z * scale), y = at.y / (at.z * scale);
        for (int k = 0; k < BST_TARGET_DIRECTIONS; k++) {
            double angle = 2.0 * BST_PI * k / BST_TARGET_DIRECTIONS;
            out->support_px[k] = fmax(out->support_px[k], cos(angle) * x + sin(angle) * y);
        }
    }
    return s->outline.count >= 3 && out->size_px > 0.0;
}

/* True if a fit is more certain than the detection's place and agrees with it. */
static bool is_better(const bst_detection *fit, const bst_detection *d) {
    double dx = fit->x_px - d->x_px, dy = fit->y_px - d->y_px;
    double determinant = d->cov_xx * d->cov_yy - d->cov_xy * d->cov_xy;
    double square = d->cov_yy * dx * dx - 2.0 * d->cov_xy * dx * dy + d->cov_xx * dy * dy;
    return square < GATE * GATE * determinant && fit->cov_xx + fit->cov_yy < d->cov_xx + d->cov_yy;
}

/* Moves a detection to the estimate, if that is better. */
static bool take_place(const bst_target_fit_frame *frame, const bst_target_sight *sight,
                       bst_quat q_local_from_cam, const bst_pose_estimate *e, bst_detection *d) {
    double floor = hypot(CENTRE_SIGMA_PX, sight->model_sigma * sight->size_px);
    bst_detection fitted = *d;
    fitted.cov_xx = e->cov_xx + floor * floor;
    fitted.cov_xy = e->cov_xy;
    fitted.cov_yy = e->cov_yy + floor * floor;
    bst_vec3 at = {e->x_px * sight->scale_rad, e->y_px * sight->scale_rad, 1.0};
    fitted.extent.range_m = e->depth_m * bst_vec3_norm(at);
    fitted.extent.range_sigma_m =
        fitted.extent.range_m *
        hypot(e->depth_sigma_share, hypot(sight->model_sigma, SIZE_SIGMA_PX / sight->size_px));
    at = bst_quat_rotate(bst_quat_conj(q_local_from_cam), at);
    if (!bst_camera_project(frame->view->camera, at, &fitted.x_px, &fitted.y_px) ||
        !is_better(&fitted, d)) {
        return false;
    }
    *d = fitted;
    return true;
}

void bst_target_fit_measure(bst_target_model_fit *fit, const bst_extended_config *config,
                            const bst_target_fit_frame *frame, const bst_silhouette *s,
                            bst_detection *d) {
    assert(fit && fit->model && config && frame && frame->view && s && d);
    bst_target_sight sight;
    bst_quat q_local_from_cam;
    double model_sigma = config->target_model_sigma;
    if (s->edge || !frame->view->sun_known ||
        !make_sight(frame, model_sigma, s, &sight, &q_local_from_cam)) {
        return;
    }
    double depth =
        SEEN_SIZE * bst_target_model_radius_m(fit->model) / (sight.size_px * sight.scale_rad);
    bst_pose_estimate e;
    if (!bst_pose_bank_step(&fit->bank, fit->model, &sight, frame->middle_s, depth, &e) ||
        !take_place(frame, &sight, q_local_from_cam, &e, d)) {
        double hidden = HIDDEN_SIGMA * bst_pose_bank_hidden_px(&fit->bank, fit->model, &sight);
        d->cov_xx += hidden * hidden;
        d->cov_yy += hidden * hidden;
    }
}

void bst_target_fit_archive(bst_target_model_fit *fit, bst_archive *archive) {
    assert(fit && archive);
    if (fit->model) {
        BST_ARCHIVE(archive, fit->bank);
        fit->bank.count = bst_archive_count(archive, fit->bank.count, BST_POSE_BANK);
        bst_pose_bank_check(&fit->bank);
    }
}
