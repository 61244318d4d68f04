#include "obsgen/labels.h"

#include <assert.h>

#include "sim/onboard/nav_motion.h"

/* Variance of a star's position besides its covariance in the mean, px^2: the least of image
 * processing's fit (imgproc/identify/starid.c). */
static const double LEAST_VARIANCE_PX2 = 0.0625;

/* Attitude that a fit to the identified stars has: the true one with their mean error. */
static bst_quat attitude_by_stars(const bst_obsgen_labels_frame *f, const bst_detections *out) {
    double x = 0.0, y = 0.0, weights = 0.0;
    for (int i = 0; i < out->count; i++) {
        const bst_detection *d = &out->items[i];
        if (d->star_id == 0 || f->generated[i].item < 0) {
            continue;
        }
        const bst_truth_item *star = &f->truth->items[f->generated[i].item];
        double weight = 1.0 / (0.5 * (d->cov_xx + d->cov_yy) + LEAST_VARIANCE_PX2);
        x += weight * (d->x_px - star->x_centroid_px);
        y += weight * (d->y_px - star->y_centroid_px);
        weights += weight;
    }
    if (!(weights > 0.0)) {
        return f->truth->q_cam_from_gcrf_mean;
    }
    double cx = f->window.x0 + 0.5 * (f->window.width - 1);
    double cy = f->window.y0 + 0.5 * (f->window.height - 1);
    bst_vec3 from = bst_camera_unproject(f->camera, cx, cy);
    bst_vec3 to = bst_camera_unproject(f->camera, cx + x / weights, cy + y / weights);
    /* errors are of a few pixels: the sine of the angle is the angle */
    bst_quat turn = bst_quat_from_rotvec(bst_vec3_cross(from, to));
    return bst_quat_unit(bst_quat_mul(turn, f->truth->q_cam_from_gcrf_mean));
}

void bst_obsgen_label(bst_discriminator *discriminator, const bst_obsgen_labels_frame *f,
                      bst_detections *out) {
    assert(discriminator && f && f->camera && f->truth && out && out->count >= 0);
    assert(f->generated || out->count == 0);
    for (int i = 0; i < out->count; i++) { /* the generator knows what these are */
        bst_detection *d = &out->items[i];
        d->label_probability = d->label == BST_LABEL_UNKNOWN ? 0.0 : 1.0;
    }
    bst_frame_knowledge known = {.oriented = out->stars_identified > 0,
                                 .q_cam_from_gcrf = attitude_by_stars(f, out),
                                 .window = f->window,
                                 .streak_px = f->streak_px,
                                 .predictions = f->predicted};
    if (f->nav) {
        known.light =
            bst_nav_light_after(f->nav, (f->middle_tick - (double)f->nav->tick) / f->tick_rate_hz);
    }
    if (f->predicted) {
        known.predictions_age_s = (f->middle_tick - (double)f->predicted->tick) / f->tick_rate_hz;
    }
    bst_discriminator_label(discriminator, &known, out);
}
