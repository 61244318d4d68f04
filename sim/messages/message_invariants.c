#include "sim/messages/message_invariants.h"

#include <math.h>

#include "sim/core/invariant.h"

static bool is_attitude(bst_quat q) {
    return bst_is_unit_quat(q, BST_LINK_UNIT_TOLERANCE);
}

bool bst_window_is_valid(const bst_window *w) {
    return w->x0 >= 0 && w->y0 >= 0 && w->width > 0 && w->height > 0;
}

bool bst_exposure_is_valid(const bst_exposure *e) {
    return e->id >= 0 && e->start_tick <= e->end_tick && bst_window_is_valid(&e->window) &&
           e->binning >= 0 && isfinite(e->pixel_scale_arcsec);
}

bool bst_frame_message_is_valid(const bst_frame_message *m) {
    return m->exposure_id >= 0 && m->start_tick <= m->end_tick && bst_window_is_valid(&m->window) &&
           m->binning >= 1 && m->bits >= 8 && m->bits <= 16;
}

bool bst_los_history_is_valid(const bst_los_history *h) {
    if (!(h->capacity > 0 && h->written > 0 && bst_is_variance(h->jitter_rad2))) {
        return false;
    }
    const bst_los_sample *newest = &h->items[(h->written - 1) % h->capacity];
    const bst_los_sample *before = &h->items[(h->written - 2 + h->capacity) % h->capacity];
    return is_attitude(newest->q_cam_from_gcrf) &&
           (h->written == 1 || h->capacity == 1 || before->tick < newest->tick);
}

bool bst_pointing_telemetry_is_valid(const bst_pointing_telemetry *t) {
    if (!(t->capacity > 0 && t->written > 0 && is_attitude(t->q_body_from_gcrf))) {
        return false;
    }
    const bst_pointing_sample *newest = &t->items[(t->written - 1) % t->capacity];
    const bst_pointing_sample *before = &t->items[(t->written - 2 + t->capacity) % t->capacity];
    return is_attitude(newest->q_cam_from_gcrf) && isfinite(newest->axis_rad[0]) &&
           isfinite(newest->axis_rad[1]) &&
           (t->written == 1 || t->capacity == 1 || before->tick < newest->tick);
}

bool bst_nav_telemetry_is_valid(const bst_nav_telemetry *t) {
    return bst_is_finite_vec3(t->position_gcrf_m) && bst_is_finite_vec3(t->velocity_gcrf_mps) &&
           bst_is_finite_vec3(t->velocity_bary_mps) && bst_is_finite_vec3(t->sun_m) &&
           bst_is_finite_vec3(t->moon_m);
}

static bool is_axis(const bst_mount_axis *a) {
    return bst_is_unit_vec3(a->axis_body, BST_UNIT_TOLERANCE) && isfinite(a->angle_rad) &&
           isfinite(a->rate_radps) && bst_is_variance(a->rate_limit_radps) &&
           bst_is_variance(a->accel_limit_radps2) && a->min_rad <= a->max_rad;
}

bool bst_mount_status_is_valid(const bst_mount_status *s) {
    if (!(s->axes >= 0 && s->axes <= BST_MOUNT_AXES && is_attitude(s->q_body_from_cam_at_zero) &&
          is_attitude(s->q_body_from_gcrf) && bst_is_finite_vec3(s->rate_body_radps))) {
        return false;
    }
    for (int i = 0; i < s->axes; i++) {
        if (!is_axis(&s->axis[i])) {
            return false;
        }
    }
    return true;
}

bool bst_los_command_is_valid(const bst_los_command *c) {
    bool valid = bst_is_unit_vec3(c->direction_gcrf, BST_UNIT_TOLERANCE) &&
                 bst_is_finite_vec3(c->rate_gcrf_radps) &&
                 bst_is_finite_vec3(c->accel_gcrf_radps2) &&
                 (!c->roll_given || isfinite(c->roll_rad));
    for (int i = 0; i < BST_MOUNT_AXES && c->near_given; i++) {
        valid = valid && isfinite(c->near_rad[i]) && isfinite(c->near_radps[i]);
    }
    return valid;
}

bool bst_sensor_command_is_valid(const bst_sensor_command *c) {
    return isfinite(c->exposure_s) && isfinite(c->period_s) && isfinite(c->pixel_scale_arcsec) &&
           c->binning >= 0 && c->window.width >= 0;
}

bool bst_control_status_is_valid(const bst_control_status *s) {
    return s->mode >= 0 && s->mode < BST_MODE_COUNT && s->target_id >= 0 && s->search_step >= 0;
}

bool bst_task_is_valid(const bst_task *t) {
    return t->id >= 0 && t->object >= -1 && bst_is_variance(t->sigma_rad) &&
           bst_is_variance(t->rate_sigma_radps) && bst_is_variance(t->v_mag_sigma) &&
           bst_is_variance(t->snr) && t->before >= 0 && t->before < BST_TASK_END_COUNT;
}

static bool is_count(int32_t count, int32_t lost, int capacity) {
    return count >= 0 && count <= capacity && lost >= 0;
}

static bool is_detection(const bst_detection *d) {
    return isfinite(d->x_px) && isfinite(d->y_px) && bst_is_variance(d->cov_xx) &&
           bst_is_variance(d->cov_yy) && isfinite(d->cov_xy) && isfinite(d->flux_e) &&
           bst_is_variance(d->flux_sigma_e) && isfinite(d->snr) && bst_is_variance(d->length_px) &&
           bst_is_variance(d->width_px) && d->label >= 0 && d->label <= BST_LABEL_HIT &&
           bst_is_share(d->label_probability);
}

static bool is_calibration(const bst_camera_calibration *c) {
    return c->frames == 0 ||
           (c->frames > 0 && c->scale > 0.0 && isfinite(c->scale) && isfinite(c->rotation_rad) &&
            isfinite(c->k1) && isfinite(c->p1) && isfinite(c->p2) &&
            bst_is_covariance(&c->covariance[0][0], BST_CAMERA_CALIBRATION_SIZE));
}

bool bst_detections_are_valid(const bst_detections *d, int capacity) {
    bool valid = is_count(d->count, d->lost, capacity) && d->start_tick <= d->end_tick &&
                 is_attitude(d->q_cam_from_gcrf) && is_attitude(d->q_telemetry_from_gcrf) &&
                 d->stars_identified >= 0 && d->windows >= 0 && d->bad_pixels >= 0 &&
                 bst_is_variance(d->shared_xx) && bst_is_variance(d->shared_yy) &&
                 fabs(d->shared_xy) <= (1.0 + 1e-12) * sqrt(d->shared_xx * d->shared_yy) &&
                 is_calibration(&d->calibration);
    for (int i = 0; valid && i < d->count; i++) {
        valid = is_detection(&d->items[i]);
    }
    return valid;
}

static bool is_track(const bst_track *t) {
    return t->id >= 1 && t->status >= BST_TRACK_TENTATIVE && t->status <= BST_TRACK_COASTING &&
           bst_is_unit_vec3(t->direction_gcrf, BST_UNIT_TOLERANCE) &&
           bst_is_finite_vec3(t->rate_gcrf_radps) && bst_is_covariance(&t->covariance[0][0], 4) &&
           t->hits >= 0 && t->misses_in_row >= 0 && t->first_tick <= t->last_update_tick &&
           t->hidden >= BST_HIDDEN_NOT && t->hidden <= BST_HIDDEN_DIM;
}

bool bst_tracks_are_valid(const bst_tracks *t, int capacity) {
    bool valid = is_count(t->count, t->lost, capacity) && t->target_id >= 0 && t->at_rest >= 0 &&
                 isfinite(t->clock_offset_s) && t->clock_sigma_s >= 0.0 &&
                 isfinite(t->clock_sigma_s);
    if (t->attitude.valid) {
        const double *sigma = t->attitude.sigma_rad, *c = t->attitude.correlation;
        valid = valid && is_attitude(t->attitude.q_cam_from_gcrf) && t->attitude.stars >= 0 &&
                bst_is_variance(sigma[0]) && bst_is_variance(sigma[1]) &&
                bst_is_variance(sigma[2]) && bst_is_share(t->attitude.shared) &&
                fabs(c[0]) <= 1.0 && fabs(c[1]) <= 1.0 && fabs(c[2]) <= 1.0;
    }
    for (int i = 0; valid && i < t->count; i++) {
        valid = is_track(&t->items[i]);
    }
    return valid;
}

bool bst_track_identities_are_valid(const bst_track_identities *t, int capacity) {
    bool valid = is_count(t->count, t->lost, capacity);
    for (int i = 0; valid && i < t->count; i++) {
        valid = t->items[i].track_id >= 1 && t->items[i].object >= -1 &&
                bst_is_share(t->items[i].probability);
    }
    return valid;
}

bool bst_regions_of_interest_are_valid(const bst_regions_of_interest *r, int capacity) {
    bool valid = r->exposure_id >= 0 && r->start_tick <= r->end_tick && r->count >= 0 &&
                 r->count <= capacity;
    for (int i = 0; valid && i < r->count; i++) {
        const bst_searched_window *item = &r->items[i];
        valid = bst_window_is_valid(&item->window) && item->number >= 0 &&
                item->number < r->count && item->reason >= 0 &&
                item->reason < BST_REGION_REASON_COUNT && isfinite(item->x_px) &&
                isfinite(item->y_px) && (item->reason != BST_REGION_STAR || item->track_id == 0);
    }
    return valid;
}

bool bst_wheel_status_is_valid(const bst_wheel_status *s, int capacity) {
    bool valid = s->count >= 0 && s->count <= capacity;
    for (int i = 0; valid && i < s->count; i++) {
        const bst_wheel_state *w = &s->items[i];
        valid = isfinite(w->speed_radps) && bst_is_variance(w->speed_limit_radps) &&
                isfinite(w->motor_nm) && bst_is_variance(w->motor_limit_nm);
    }
    return valid;
}

bool bst_tracks_smoothed_are_valid(const bst_tracks_smoothed *t, int capacity) {
    bool valid = is_count(t->count, t->lost, capacity);
    for (int i = 0; valid && i < t->count; i++) {
        const bst_track_smoothed *item = &t->items[i];
        valid = item->id >= 1 && item->status >= BST_TRACK_TENTATIVE &&
                item->status <= BST_TRACK_COASTING && item->later_frames >= 0 &&
                bst_is_unit_vec3(item->direction_gcrf, BST_UNIT_TOLERANCE) &&
                bst_is_finite_vec3(item->rate_gcrf_radps) &&
                bst_is_covariance(&item->covariance[0][0], 4);
    }
    return valid;
}

bool bst_predictions_are_valid(const bst_predictions *p, int capacity) {
    bool valid = is_count(p->count, p->lost, capacity) &&
                 (!p->attitude_valid || (bst_is_finite_vec3(p->attitude_error_cam_rad) &&
                                         bst_is_finite_vec3(p->attitude_error_rate_cam_radps)));
    for (int i = 0; valid && i < p->count; i++) {
        const bst_prediction *item = &p->items[i];
        valid = item->track_id >= 1 && bst_is_unit_vec3(item->direction_gcrf, BST_UNIT_TOLERANCE) &&
                bst_is_finite_vec3(item->rate_gcrf_radps) && bst_is_variance(item->sigma_rad);
    }
    return valid;
}

static bool is_truth_item(const bst_truth_item *t) {
    return t->kind >= BST_SOURCE_STAR && t->kind <= BST_SOURCE_OBJECT_GHOST &&
           bst_is_variance(t->electrons) && t->snr >= 0.0 &&
           (!bst_source_is_object(t->kind) || bst_is_share(t->sunlit_fraction));
}

bool bst_truth_is_valid(const bst_truth *t, int capacity) {
    bool valid = is_count(t->count, t->lost, capacity) && t->start_tick <= t->end_tick &&
                 is_attitude(t->q_cam_from_gcrf_mid) && is_attitude(t->q_cam_from_gcrf_mean) &&
                 bst_is_finite_vec3(t->observer_gcrf_m) && bst_is_variance(t->background_e) &&
                 bst_is_variance(t->dark_e) && bst_is_share(t->earth_fraction) &&
                 bst_is_share(t->moon_fraction) && bst_is_share(t->sun_fraction) && t->hits >= 0 &&
                 t->nodes >= 0;
    for (int i = 0; valid && i < t->count; i++) {
        valid = is_truth_item(&t->items[i]);
    }
    return valid;
}
