#include "sim/eval/loop_figures.h"

#include "boresight/messages.h"

double bst_eval_pointing_error_px(const bst_camera *camera, double pixel_scale_arcsec,
                                  bst_quat q_cam_from_gcrf, bst_vec3 apparent, double *x_px,
                                  double *y_px) {
    bst_vec3 v = bst_quat_rotate(q_cam_from_gcrf, apparent);
    double scale_rad =
        (pixel_scale_arcsec > 0.0 ? pixel_scale_arcsec : camera->pixel_scale_arcsec) *
        BST_ARCSEC_RAD;
    double across = hypot(v.x, v.y), error_px = atan2(across, v.z) / scale_rad;
    double cs = 1.0, sn = 0.0;
    if (camera->geometry.general) {
        cs = camera->geometry.cos_rotation;
        sn = camera->geometry.sin_rotation;
    }
    /* at 180 degrees the position angle is undefined: use any */
    double a = across > 0.0 ? v.x / across : 1.0, b = across > 0.0 ? v.y / across : 0.0;
    *x_px = error_px * (cs * a + sn * b);
    *y_px = error_px * (cs * b - sn * a);
    return error_px;
}

bool bst_eval_track_is_on_target(bst_vec3 direction, bst_vec3 rate_radps, double seconds,
                                 bst_vec3 truth, double scale_rad) {
    bst_vec3 carried = bst_vec3_axpy(direction, seconds, rate_radps);
    return bst_vec3_angle(carried, truth) <= BST_RIGHT_TARGET_PX * scale_rad;
}

bool bst_loop_settles(bool acquired, int mode, double error_px) {
    return acquired && mode == BST_MODE_TRACK && error_px < BST_SETTLED_PX;
}

bool bst_loop_frame_is_pointing(const bst_loop_frame *f) {
    return f->settled && f->mode == BST_MODE_TRACK && f->visible && !isnan(f->error_px);
}

void bst_loop_tally_add(bst_loop_tally *t, const bst_loop_frame *f) {
    t->frames++;
    if (f->visible) {
        t->visible++;
        t->in_track += f->in_track;
        t->breaks += t->was_in_track && !f->in_track;
        t->was_in_track = f->in_track;
        t->visible_acquired += f->acquired;
        t->in_track_acquired += f->acquired && f->in_track;
    }
    t->in_track_at_end = f->in_track;
    if (bst_loop_frame_is_pointing(f)) {
        bst_error_statistics_add(&t->pointing, f->error_x_px, f->error_y_px);
    }
}

void bst_loop_tally_figures(const bst_loop_tally *t, bst_loop_figures *f) {
    f->frames = t->frames;
    f->visible_frames = t->visible;
    f->in_track_frames = t->in_track;
    f->breaks = t->breaks;
    f->in_track_at_end = t->in_track_at_end;
    f->custody = t->visible > 0 ? (double)t->in_track / (double)t->visible : NAN;
    f->track_fraction =
        t->visible_acquired > 0 ? (double)t->in_track_acquired / (double)t->visible_acquired : 0.0;
    f->pointing_frames = t->pointing.count;
    f->pointing_rms_px = bst_error_statistics_rms(&t->pointing);
    f->pointing_bias_px = bst_error_statistics_bias(&t->pointing);
    f->pointing_median_px = bst_error_statistics_quantile(&t->pointing, 0.5);
    f->pointing_p95_px = bst_error_statistics_quantile(&t->pointing, 0.95);
    f->pointing_p99_px = bst_error_statistics_quantile(&t->pointing, 0.99);
    f->pointing_max_px = bst_error_statistics_largest(&t->pointing);
}

void bst_loop_tally_archive(bst_loop_tally *t, bst_archive *archive) {
    BST_ARCHIVE(archive, t->frames);
    BST_ARCHIVE(archive, t->visible);
    BST_ARCHIVE(archive, t->in_track);
    BST_ARCHIVE(archive, t->breaks);
    BST_ARCHIVE(archive, t->visible_acquired);
    BST_ARCHIVE(archive, t->in_track_acquired);
    bst_archive_bool(archive, &t->was_in_track);
    bst_archive_bool(archive, &t->in_track_at_end);
    bst_error_statistics_archive(&t->pointing, archive);
}
