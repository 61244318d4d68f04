#include "imgproc/calibrate/pixel_learning.h"

#include <math.h>

#include "imgproc/measure/sharpness.h"

enum { MOST_PREDICTED = 256 };

/* Radius about a predicted track that its light may cover: px for the PSF, plus this many standard
 * deviations of the prediction. */
static const double PREDICTED_PX = 3.0, PREDICTED_SIGMAS = 5.0;

/* Counts the identified stars that appear sharper than the PSF. */
static void count_sharp_stars(bst_pixel_learner *learner, const bst_camera *camera,
                              const bst_pixel_shows *shows, const bst_detections *out) {
    for (int i = 0; i < out->count; i++) {
        const bst_detection *d = &out->items[i];
        if (d->label != BST_LABEL_STAR || (d->flags & BST_DETECTION_SATURATED)) {
            continue;
        }
        int64_t pixel = llround(d->y_px) * camera->width_px + llround(d->x_px);
        const bst_pixel_show *show = bst_pixel_shows_find(shows, (int32_t)pixel);
        bst_pixel_learner_note_star(learner,
                                    show && (double)show->sharp.worst > BST_SHARP_DEVIATION);
    }
}

/* Position and radius, px, of the predicted tracks in the frame. Returns their number. */
static int predict_track_positions(const bst_camera *camera, const bst_frame_knowledge *known,
                                   double out[MOST_PREDICTED][3]) {
    int count = 0, given = known->predictions ? known->predictions->count : 0;
    for (int i = 0; i < given && count < MOST_PREDICTED; i++) {
        const bst_prediction *p = &known->predictions->items[i];
        bst_vec3 d = bst_vec3_unit(
            bst_vec3_axpy(p->direction_gcrf, known->predictions_age_s, p->rate_gcrf_radps));
        if (known->oriented) {
            d = bst_light_aberrate(&known->light, d);
        }
        if (bst_camera_project(camera, bst_quat_rotate(known->q_cam_from_gcrf, d), &out[count][0],
                               &out[count][1])) {
            out[count++][2] =
                PREDICTED_PX + PREDICTED_SIGMAS * p->sigma_rad / bst_camera_scale_rad(camera);
        }
    }
    return count;
}

void bst_pixel_step(bst_pixel_learner *learner, const bst_camera *camera,
                    const bst_pixel_step_input *input) {
    if (!input->shows->usable) {
        return;
    }
    double predicted[MOST_PREDICTED][3];
    count_sharp_stars(learner, camera, input->shows, input->detections);
    bst_pixel_frame frame = {
        .q_cam_from_gcrf = input->detections->q_cam_from_gcrf,
        .time_s = input->time_s,
        .window = input->known->window,
        .binning = input->binning,
        .windows = input->windows->items,
        .window_count = input->windows->count,
        .predicted = (const double(*)[3])predicted,
        .predicted_count = predict_track_positions(camera, input->known, predicted)};
    bst_pixel_learner_update(learner, &frame, input->shows);
}
