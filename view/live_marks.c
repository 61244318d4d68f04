#include "view/live_marks.h"

#include <math.h>

#include "boresight/vec.h"
#include "sim/core/json_number.h"
#include "sim/engine/recorder/recorder.h"
#include "sim/io/wcs.h"
#include "view/json_list.h"

/* Marks of one kind that are sent. */
enum { MARKS_MOST = 5000 };

static double binning_of(const bst_frame_message *frame) {
    return frame->binning > 1 ? frame->binning : 1;
}

/* Adds a position on the sensor as pixels of the frame: the first pixel's centre is 0. */
static void add_place(cJSON *node, double x_px, double y_px, const bst_frame_message *frame) {
    const double binning = binning_of(frame);
    bst_json_add_number(node, "x", (x_px - frame->window.x0 + 0.5) / binning - 0.5);
    bst_json_add_number(node, "y", (y_px - frame->window.y0 + 0.5) / binning - 0.5);
}

static void add_wcs(cJSON *node, const bst_truth *truth, const bst_frame_message *frame,
                    const bst_camera *camera) {
    const bst_light light = {.velocity_mps = truth->velocity_bary_mps, .sun_m = truth->sun_m};
    bst_ctx ignored = {0};
    bst_wcs full;
    if (bst_wcs_fit(&ignored, camera, truth->q_cam_from_gcrf_mean, &light, &full) != BST_OK) {
        return;
    }
    const bst_wcs wcs = bst_wcs_window(&full, frame->window, (int)binning_of(frame));
    const double cd[4] = {wcs.cd_deg[0][0], wcs.cd_deg[0][1], wcs.cd_deg[1][0], wcs.cd_deg[1][1]};
    cJSON *w = cJSON_AddObjectToObject(node, "wcs");
    cJSON_AddItemToObject(w, "crpix", cJSON_CreateDoubleArray(wcs.crpix, 2));
    cJSON_AddItemToObject(w, "crval_deg", cJSON_CreateDoubleArray(wcs.crval_deg, 2));
    cJSON_AddItemToObject(w, "cd_deg", cJSON_CreateDoubleArray(cd, 4));
    cJSON_AddArrayToObject(w, "A");
    cJSON_AddArrayToObject(w, "B");
    if (wcs.sip.order > 0) {
        cJSON_AddTrueToObject(w, "without_distortion");
    }
}

void bst_view_add_live_truth(cJSON *node, const bst_truth *truth, const bst_frame_message *frame,
                             const bst_camera *camera) {
    cJSON *list = cJSON_AddArrayToObject(node, "truth");
    add_wcs(node, truth, frame, camera);
    for (int i = 0, added = 0; i < truth->count && added < MARKS_MOST; i++) {
        const bst_truth_item *item = &truth->items[i];
        if (!(item->flags & BST_TRUTH_IN_FIELD)) {
            continue;
        }
        cJSON *mark = bst_view_add_object(list);
        cJSON_AddStringToObject(mark, "kind", bst_recorder_source_name(item->kind));
        cJSON_AddNumberToObject(mark, "id", item->id);
        cJSON_AddNumberToObject(mark, "norad", item->norad);
        add_place(mark, item->x_centroid_px, item->y_centroid_px, frame);
        bst_json_add_number(mark, "v_mag", item->v_mag);
        bst_json_add_number(mark, "snr", item->snr);
        added++;
    }
}

void bst_view_add_live_detections(cJSON *node, const bst_detections *detections,
                                  const bst_frame_message *frame) {
    cJSON *list = cJSON_AddArrayToObject(node, "detections");
    const double binning = binning_of(frame), per_area = 1.0 / (binning * binning);
    for (int i = 0; i < detections->count && i < MARKS_MOST; i++) {
        const bst_detection *d = &detections->items[i];
        cJSON *mark = bst_view_add_object(list);
        cJSON_AddStringToObject(mark, "label", bst_recorder_label_name(d->label));
        cJSON_AddNumberToObject(mark, "star_id", d->star_id);
        add_place(mark, d->x_px, d->y_px, frame);
        bst_json_add_number(mark, "xx", d->cov_xx * per_area);
        bst_json_add_number(mark, "xy", d->cov_xy * per_area);
        bst_json_add_number(mark, "yy", d->cov_yy * per_area);
        bst_json_add_number(mark, "flux_e", d->flux_e);
        bst_json_add_number(mark, "snr", d->snr);
        bst_json_add_number(mark, "length", d->length_px / binning);
        bst_json_add_number(mark, "angle_deg", d->angle_rad / BST_DEG_RAD);
        bst_json_add_number(mark, "v_mag", d->v_mag);
    }
}

void bst_view_add_live_windows(cJSON *node, const bst_regions_of_interest *regions,
                               const bst_frame_message *frame) {
    cJSON *list = cJSON_AddArrayToObject(node, "windows");
    const double binning = binning_of(frame);
    for (int i = 0; i < regions->count; i++) {
        const bst_searched_window *k = &regions->items[i];
        cJSON *mark = bst_view_add_object(list);
        cJSON_AddNumberToObject(mark, "window", k->number);
        bst_json_add_number(mark, "x0", (k->window.x0 - frame->window.x0) / binning);
        bst_json_add_number(mark, "y0", (k->window.y0 - frame->window.y0) / binning);
        bst_json_add_number(mark, "width", k->window.width / binning);
        bst_json_add_number(mark, "height", k->window.height / binning);
        cJSON_AddStringToObject(mark, "reason", bst_recorder_region_reason_name(k->reason));
        cJSON_AddNumberToObject(mark, "track_id", (double)k->track_id);
        cJSON_AddNumberToObject(mark, "star_id", k->star_id);
    }
}

void bst_view_add_live_tracks(cJSON *node, const bst_tracks *tracks,
                              const bst_frame_message *frame) {
    cJSON *list = cJSON_AddArrayToObject(node, "tracks");
    for (int i = 0; i < tracks->count && i < MARKS_MOST; i++) {
        const bst_track *t = &tracks->items[i];
        double ra, dec;
        bst_vec3_to_radec(t->direction_gcrf, &ra, &dec);
        cJSON *mark = bst_view_add_object(list);
        cJSON_AddTrueToObject(mark, "now");
        cJSON_AddNumberToObject(mark, "id", (double)t->id);
        cJSON_AddStringToObject(mark, "status", bst_recorder_track_status_name(t->status));
        cJSON_AddBoolToObject(mark, "target", t->target_of_interest);
        add_place(mark, t->x_px, t->y_px, frame);
        bst_json_add_number(mark, "snr", t->snr);
        bst_json_add_number(mark, "ra_deg", ra / BST_DEG_RAD);
        bst_json_add_number(mark, "dec_deg", dec / BST_DEG_RAD);
        cJSON_AddNumberToObject(mark, "misses", t->misses_in_row);
        bst_json_add_number(mark, "v_mag", t->v_mag);
    }
}
