#include "imgproc/extended/extended_step.h"

#include <assert.h>
#include <math.h>

/* Share of the target's size that a frame passes on to the next: half of it after 14 frames. A
 * target that turns away becomes smaller as slowly. Of one whose panels reflect no light for some
 * frames the centre is as uncertain as of all of it; a covariance of the rest alone made the
 * tracker refuse the place when the panels came back. */
static const double SIZE_KEPT = 0.95;

bst_status bst_extended_step_open(bst_ctx *ctx, bst_extended_step *step,
                                  const bst_extended_config *config, bool whole) {
    assert(step && config);
    step->config = config;
    if (config->enabled && !whole) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "imgproc: extended goes neither with track_windows nor with stack; turn "
                        "them off");
    }
    if (!config->enabled || config->target_model[0] == '\0') {
        return BST_OK;
    }
    bst_status status = bst_target_model_load(ctx, config->target_model, &step->fit.model);
    return status == BST_OK ? BST_OK
                            : bst_fail_prefix(ctx, status, "imgproc/extended/target_model");
}

void bst_extended_step_close(bst_extended_step *step) {
    assert(step);
    bst_target_model_free(step->fit.model);
    step->fit.model = NULL;
}

void bst_extended_step_begin(bst_extended_step *step, const bst_extended_input *input,
                             bst_detections *out) {
    assert(step && step->config && input && input->message && out);
    step->targets.count = step->points.count = 0;
    if (!step->config->enabled) {
        return;
    }
    const bst_frame_message *m = input->message;
    step->view = (bst_extended_view){.camera = input->camera,
                                     .origin_x_px = m->window.x0 + 0.5 * (m->binning - 1),
                                     .origin_y_px = m->window.y0 + 0.5 * (m->binning - 1),
                                     .binning = m->binning,
                                     .sun_known = input->sun_known};
    step->q_cam_from_gcrf = input->q_cam_from_gcrf;
    step->middle_s = input->middle_s;
    if (input->sun_known) {
        step->view.sun_cam = bst_quat_rotate(input->q_cam_from_gcrf, bst_vec3_unit(input->sun_m));
    }
    bst_handover_select(&step->handover, input->silhouettes, &step->view, &step->targets,
                        &step->points, out);
}

/* Corrects the object at a small silhouette. */
static void correct_point(const bst_extended_step *step, const bst_silhouette *s,
                          bst_detections *out) {
    const bst_extended_view *v = &step->view;
    double x = v->origin_x_px + v->binning * s->light_x_px, closest = v->camera->psf_fwhm_px;
    double y = v->origin_y_px + v->binning * s->light_y_px;
    bst_detection *best = NULL;
    for (int i = 0; i < out->count; i++) {
        bst_detection *d = &out->items[i];
        double distance = hypot(d->x_px - x, d->y_px - y);
        bool object = d->label == BST_LABEL_OBJECT || d->label == BST_LABEL_UNKNOWN;
        if (object && !(d->flags & BST_DETECTION_EXTENDED) && distance < closest) {
            closest = distance;
            best = d;
        }
    }
    if (best) {
        bst_extended_correct_point(step->config, v, s, best);
    }
}

void bst_extended_step_append(bst_extended_step *step, double exposure_s,
                              const bst_optics_zero_point *zero_point, bst_detections *out,
                              int capacity) {
    assert(step && zero_point && out && out->count <= capacity);
    for (int i = 0; i < step->points.count; i++) {
        correct_point(step, &step->points.items[i], out);
    }
    step->handover.size_px = step->targets.count > 0 ? step->handover.size_px : 0.0;
    for (int i = 0; i < step->targets.count; i++) {
        if (out->count == capacity) {
            out->count--;
            out->lost++;
        }
        bst_detection *d = &out->items[out->count++];
        double size = i == 0 ? SIZE_KEPT * step->handover.size_px : 0.0;
        bst_extended_measure(step->config, &step->view, &step->targets.items[i], size, d);
        step->handover.size_px = i == 0 ? fmax(size, d->extent.size_px) : step->handover.size_px;
        if (i == 0 && step->fit.model) {
            const bst_target_fit_frame frame = {&step->view, step->q_cam_from_gcrf, step->middle_s,
                                                exposure_s};
            bst_target_fit_measure(&step->fit, step->config, &frame, &step->targets.items[i], d);
        }
        double one_e_per_s = bst_camera_electrons_per_s(step->view.camera, 0.0);
        d->v_mag = -2.5 * log10(d->flux_e / fmax(exposure_s, 1e-9) / one_e_per_s);
        bst_photometry_correct(zero_point, d);
    }
}

void bst_extended_step_archive(bst_extended_step *step, bst_archive *archive) {
    bst_archive_bool(archive, &step->handover.extended);
    BST_ARCHIVE(archive, step->handover.size_px);
    bst_target_fit_archive(&step->fit, archive);
}
