/* Writes the rows of run.sqlite from messages: frames, truth, detections, tracks, telemetry. */
#include <math.h>
#include <string.h>

#include "sim/engine/recorder/recorder_internal.h"

#define DEG (180.0 / BST_PI)
#define ARCSEC (1.0 / BST_ARCSEC_RAD)

/* A row under construction, column by column. */
typedef struct row {
    bst_io_value cells[BST_TABLE_COLUMNS];
    int count;
} row;

static void put_int(row *r, int64_t value) {
    r->cells[r->count++] = bst_io_int_value(value);
}
static void put_flag(row *r, bool value) {
    put_int(r, value ? 1 : 0);
}
static void put_real(row *r, double value) {
    r->cells[r->count++] = bst_io_real_value(value);
}
static void put_text(row *r, const char *value) {
    r->cells[r->count++] = bst_io_text_value(value);
}
static void put_vector(row *r, bst_vec3 v) {
    put_real(r, v.x);
    put_real(r, v.y);
    put_real(r, v.z);
}
static void put_quat(row *r, bst_quat q) {
    put_real(r, q.x);
    put_real(r, q.y);
    put_real(r, q.z);
    put_real(r, q.w);
}
static void put_radec(row *r, bst_vec3 v) {
    double ra, dec;
    bst_vec3_to_radec(v, &ra, &dec);
    put_real(r, ra * DEG);
    put_real(r, dec * DEG);
}
/* Direction of the camera's boresight in GCRF. */
static bst_vec3 boresight(bst_quat q_cam_from_gcrf) {
    return bst_quat_rotate(bst_quat_conj(q_cam_from_gcrf), (bst_vec3){0, 0, 1});
}

static double seconds(const bst_recorder *recorder, int64_t tick) {
    return (double)tick / (double)recorder->tick_rate_hz;
}
int64_t bst_recorder_not_due_before(const bst_recorder *recorder, int64_t last) {
    double hz = recorder->config.telemetry_hz, rate = (double)recorder->tick_rate_hz;
    double next = ((double)last + 1.0 - 1e-6) * rate / hz;
    return hz > 0.0 && next < 9e15 ? (int64_t)floor(next) : INT64_MAX;
}

bool bst_recorder_due(const bst_recorder *recorder, int64_t tick, int64_t *last) {
    double hz = recorder->config.telemetry_hz, rate = (double)recorder->tick_rate_hz;
    /* tick * hz / rate of an exact grid point may be below the integer by a rounding error */
    double period = (double)tick * hz / rate;
    int64_t now = (int64_t)floor(period + 1e-9);
    if (recorder->config.telemetry_hz <= 0.0 || now <= *last) {
        return false;
    }
    *last = now;
    return true;
}

/* Appends a row to a table of the run. */
static bst_status append(bst_ctx *ctx, bst_recorder *recorder, bst_recorder_table table,
                         const row *r) {
    return bst_io_table_append(ctx, recorder->tables[table], r->cells);
}

bst_status bst_recorder_run_row(bst_ctx *ctx, bst_recorder *recorder) {
    row r = {.count = 0};
    char epoch[40];
    bst_time_to_utc(recorder->epoch, 9, epoch, sizeof epoch);
    put_text(&r, recorder->program);
    put_text(&r, epoch);
    put_int(&r, recorder->tick_rate_hz);
    return append(ctx, recorder, BST_TABLE_RUN, &r);
}

bst_status bst_recorder_sensor_row(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                   const char *file) {
    const bst_recorder_state *s = &recorder->sensors[sensor];
    row r = {.count = 0};
    put_int(&r, sensor);
    put_text(&r, s->observer);
    put_text(&r, s->sensor);
    put_text(&r, s->target[0] ? s->target : NULL);
    put_text(&r, file);
    put_int(&r, s->camera.width_px);
    put_int(&r, s->camera.height_px);
    put_real(&r, s->camera.pixel_scale_arcsec);
    return append(ctx, recorder, BST_TABLE_SENSORS, &r);
}

bst_status bst_recorder_frame_row(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                  const bst_frame_message *m, const bst_wcs *wcs,
                                  int64_t fits_index) {
    row r = {.count = 0};
    char start[40];
    bst_time_to_utc(bst_time_at_tick(recorder->epoch, m->start_tick, recorder->tick_rate_hz), 6,
                    start, sizeof start);
    put_int(&r, sensor);
    put_int(&r, m->exposure_id);
    put_int(&r, m->start_tick);
    put_int(&r, m->end_tick);
    put_real(&r, seconds(recorder, m->start_tick));
    put_real(&r, seconds(recorder, m->end_tick - m->start_tick));
    put_text(&r, start);
    put_int(&r, m->window.x0);
    put_int(&r, m->window.y0);
    put_int(&r, m->window.width);
    put_int(&r, m->window.height);
    put_int(&r, m->binning);
    put_int(&r, m->bits);
    r.cells[r.count++] =
        fits_index < 0 ? bst_io_null_value(BST_COLUMN_INT) : bst_io_int_value(fits_index);
    put_real(&r, wcs ? wcs->crpix[0] : NAN);
    put_real(&r, wcs ? wcs->crpix[1] : NAN);
    put_real(&r, wcs ? wcs->crval_deg[0] : NAN);
    put_real(&r, wcs ? wcs->crval_deg[1] : NAN);
    put_real(&r, wcs ? wcs->cd_deg[0][0] : NAN);
    put_real(&r, wcs ? wcs->cd_deg[0][1] : NAN);
    put_real(&r, wcs ? wcs->cd_deg[1][0] : NAN);
    put_real(&r, wcs ? wcs->cd_deg[1][1] : NAN);
    put_real(&r, wcs ? wcs->residual_px : NAN);
    return append(ctx, recorder, BST_TABLE_FRAMES, &r);
}

/* Writes the row of an exposure from its truth message. */
static bst_status exposure_row(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                               const bst_truth *t) {
    row r = {.count = 0};
    put_int(&r, sensor);
    put_int(&r, t->exposure_id);
    put_int(&r, t->start_tick);
    put_int(&r, t->end_tick);
    put_real(&r, bst_recorder_mid_s(recorder, t->start_tick, t->end_tick));
    put_flag(&r, t->dropped);
    put_quat(&r, t->q_cam_from_gcrf_mid);
    put_quat(&r, t->q_cam_from_gcrf_mean);
    put_radec(&r, boresight(t->q_cam_from_gcrf_mean));
    put_real(&r, t->boresight_x_px);
    put_real(&r, t->boresight_y_px);
    put_vector(&r, t->observer_gcrf_m);
    put_vector(&r, t->observer_gcrf_mps);
    put_vector(&r, t->velocity_bary_mps);
    put_vector(&r, t->sun_m);
    put_real(&r, t->background_e);
    put_real(&r, t->dark_e);
    put_real(&r, t->earth_fraction);
    put_real(&r, t->moon_fraction);
    put_real(&r, t->sun_fraction);
    put_real(&r, t->pixel_scale_arcsec);
    put_int(&r, t->count);
    put_int(&r, t->lost);
    put_int(&r, t->hits);
    put_real(&r, t->hits_e);
    put_real(&r, t->error_sigma);
    put_int(&r, t->nodes);
    put_int(&r, t->one_track);
    return append(ctx, recorder, BST_TABLE_EXPOSURES, &r);
}

/* Writes the row of an object at its first appearance. */
static bst_status object_row(bst_ctx *ctx, bst_recorder *recorder, uint32_t id) {
    if (!recorder->object_seen || recorder->object_seen[id]) {
        return BST_OK;
    }
    recorder->object_seen[id] = true;
    const bst_world_object_info *info = bst_world_object(recorder->world, (int)id);
    row r = {.count = 0};
    put_int(&r, id);
    put_text(&r, info->name);
    put_int(&r, info->norad);
    put_real(&r, info->area_m2);
    put_real(&r, info->albedo);
    return append(ctx, recorder, BST_TABLE_OBJECTS, &r);
}

bst_status bst_recorder_truth_rows(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                   const void *payload, int64_t written_tick) {
    (void)written_tick;
    const bst_truth *t = payload;
    BST_TRY(exposure_row(ctx, recorder, sensor, t));
    double mid_s = bst_recorder_mid_s(recorder, t->start_tick, t->end_tick);
    for (int i = 0; i < t->count; i++) {
        const bst_truth_item *item = &t->items[i];
        bool star = !bst_source_is_object(item->kind);
        if (star && !recorder->config.truth_stars) {
            continue;
        }
        if (!star) {
            BST_TRY(object_row(ctx, recorder, item->id));
        }
        row r = {.count = 0};
        put_int(&r, sensor);
        put_int(&r, t->exposure_id);
        put_real(&r, mid_s + item->delay_s);
        put_int(&r, i + 1);
        put_text(&r, bst_recorder_source_name(item->kind));
        put_int(&r, item->id);
        put_int(&r, item->norad);
        put_flag(&r, item->flags & BST_TRUTH_IN_FIELD);
        put_flag(&r, item->flags & BST_TRUTH_OCCULTED);
        put_flag(&r, item->flags & BST_TRUTH_SATURATED);
        put_real(&r, item->x_start_px);
        put_real(&r, item->y_start_px);
        put_real(&r, item->x_mid_px);
        put_real(&r, item->y_mid_px);
        put_real(&r, item->x_end_px);
        put_real(&r, item->y_end_px);
        put_real(&r, item->x_chief_px);
        put_real(&r, item->y_chief_px);
        put_real(&r, item->x_centroid_px);
        put_real(&r, item->y_centroid_px);
        put_real(&r, item->ra_rad * DEG);
        put_real(&r, item->dec_rad * DEG);
        put_real(&r, item->v_mag);
        put_real(&r, item->electrons);
        put_real(&r, item->snr);
        put_real(&r, star ? NAN : item->sunlit_fraction);
        put_real(&r, star ? NAN : item->phase_rad * DEG);
        put_real(&r, star ? NAN : item->range_m);
        BST_TRY(append(ctx, recorder, BST_TABLE_TRUTH, &r));
    }
    return bst_recorder_shape_rows(ctx, recorder, sensor, t);
}

bst_status bst_recorder_los_rows(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                 const void *payload, int64_t written_tick) {
    const bst_los_history *h = payload;
    if (h->written < 1 ||
        !bst_recorder_due(recorder, written_tick, &recorder->sensors[sensor].last_los)) {
        return BST_OK;
    }
    const bst_los_sample *s = &h->items[(h->written - 1) % h->capacity];
    row r = {.count = 0};
    put_int(&r, sensor);
    put_int(&r, s->tick);
    put_real(&r, seconds(recorder, s->tick));
    put_quat(&r, s->q_cam_from_gcrf);
    put_radec(&r, boresight(s->q_cam_from_gcrf));
    return append(ctx, recorder, BST_TABLE_LOS_TRUTH, &r);
}

const char *bst_recorder_source_name(int32_t kind) {
    static const char *const names[] = {"star", "object", "star_ghost", "object_ghost"};
    return names[kind & 3];
}

const char *bst_recorder_label_name(int32_t label) {
    switch (label) {
        case BST_LABEL_STAR:
            return "star";
        case BST_LABEL_OBJECT:
            return "object";
        case BST_LABEL_ARTEFACT:
            return "artefact";
        case BST_LABEL_HOT_PIXEL:
            return "hot_pixel";
        case BST_LABEL_HIT:
            return "hit";
        default:
            return "unknown";
    }
}

/* Checks whether a detection is recorded, by its label. */
static bool kept(const bst_recorder *recorder, const bst_detection *item) {
    switch (recorder->config.detections_of) {
        case BST_RECORD_NO_STARS:
            return item->label != BST_LABEL_STAR;
        case BST_RECORD_OBJECTS:
            return item->label == BST_LABEL_OBJECT;
        default:
            return true;
    }
}

bst_status bst_recorder_detection_rows(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                       const void *payload, int64_t written_tick) {
    const bst_detections *d = payload;
    double mid_s = bst_recorder_mid_s(recorder, d->start_tick, d->end_tick);
    row head = {.count = 0};
    put_int(&head, sensor);
    put_int(&head, d->exposure_id);
    put_int(&head, d->start_tick);
    put_int(&head, d->end_tick);
    put_real(&head, mid_s);
    put_int(&head, written_tick);
    put_quat(&head, d->q_cam_from_gcrf);
    put_quat(&head, d->q_telemetry_from_gcrf);
    put_real(&head, d->background_e);
    put_real(&head, d->noise_e);
    put_real(&head, d->threshold_snr);
    put_real(&head, d->shared_xx);
    put_real(&head, d->shared_xy);
    put_real(&head, d->shared_yy);
    put_real(&head, d->zero_point_mag);
    put_real(&head, d->zero_point_sigma_mag);
    put_int(&head, d->zero_point_stars);
    put_int(&head, d->stars_identified);
    put_int(&head, d->windows);
    put_int(&head, d->count);
    put_int(&head, d->lost);
    put_int(&head, d->bad_pixels);
    BST_TRY(append(ctx, recorder, BST_TABLE_DETECTION_FRAMES, &head));
    BST_TRY(bst_recorder_calibration_row(ctx, recorder, sensor, d));
    for (int i = 0; i < d->count; i++) {
        const bst_detection *item = &d->items[i];
        if (!kept(recorder, item)) {
            continue;
        }
        row r = {.count = 0};
        put_int(&r, sensor);
        put_int(&r, d->exposure_id);
        put_real(&r, mid_s);
        put_int(&r, i);
        put_text(&r, bst_recorder_label_name(item->label));
        put_int(&r, item->star_id);
        put_real(&r, item->x_px);
        put_real(&r, item->y_px);
        put_real(&r, item->cov_xx);
        put_real(&r, item->cov_xy);
        put_real(&r, item->cov_yy);
        put_real(&r, item->flux_e);
        put_real(&r, item->flux_sigma_e);
        put_real(&r, item->snr);
        put_real(&r, item->length_px);
        put_real(&r, item->width_px);
        put_real(&r, item->angle_rad * DEG);
        put_real(&r, item->v_mag);
        put_real(&r, isfinite(item->v_mag_sigma) ? item->v_mag_sigma : NAN);
        put_flag(&r, item->flags & BST_DETECTION_SATURATED);
        put_flag(&r, item->flags & BST_DETECTION_EDGE);
        put_flag(&r, item->flags & BST_DETECTION_STREAK);
        put_flag(&r, item->flags & BST_DETECTION_BLEND);
        put_real(&r, item->label_probability);
        put_flag(&r, item->flags & BST_DETECTION_STACK);
        put_real(&r, item->rate_x_pxps);
        put_real(&r, item->rate_y_pxps);
        put_real(&r, item->rate_sigma_pxps);
        put_flag(&r, item->flags & BST_DETECTION_BLOOM);
        BST_TRY(append(ctx, recorder, BST_TABLE_DETECTIONS, &r));
        BST_TRY(bst_recorder_extended_row(ctx, recorder, sensor, d, i));
    }
    return BST_OK;
}

const char *bst_recorder_track_status_name(int32_t status) {
    return status == BST_TRACK_CONFIRMED  ? "confirmed"
           : status == BST_TRACK_COASTING ? "coasting"
                                          : "tentative";
}

/* Puts direction, rate and covariance of a track. */
static void put_state(row *r, bst_vec3 direction, bst_vec3 rate, const double p[4][4]) {
    double ra, dec;
    bst_vec3_to_radec(direction, &ra, &dec);
    bst_vec3 east = {-sin(ra), cos(ra), 0.0};
    bst_vec3 north = bst_vec3_cross(direction, east);
    put_real(r, ra * DEG);
    put_real(r, dec * DEG);
    put_real(r, bst_vec3_dot(rate, east) * ARCSEC);
    put_real(r, bst_vec3_dot(rate, north) * ARCSEC);
    put_real(r, p[0][0]);
    put_real(r, p[0][1]);
    put_real(r, p[1][1]);
    put_real(r, p[0][2]);
    put_real(r, p[0][3]);
    put_real(r, p[1][2]);
    put_real(r, p[1][3]);
    put_real(r, p[2][2]);
    put_real(r, p[2][3]);
    put_real(r, p[3][3]);
}

/* Writes a track to the table tracks. */
static bst_status track_row(bst_ctx *ctx, bst_recorder *recorder, int sensor, const bst_tracks *t,
                            const bst_track *k) {
    row r = {.count = 0};
    put_int(&r, sensor);
    put_int(&r, t->exposure_id);
    put_int(&r, t->tick);
    put_real(&r, seconds(recorder, t->tick));
    put_int(&r, k->id);
    put_text(&r, bst_recorder_track_status_name(k->status));
    put_flag(&r, k->target_of_interest);
    put_state(&r, k->direction_gcrf, k->rate_gcrf_radps, k->covariance);
    put_real(&r, k->v_mag);
    put_real(&r, k->snr);
    put_real(&r, k->score);
    put_int(&r, k->hits);
    put_int(&r, k->misses_in_row);
    put_int(&r, k->first_tick);
    put_int(&r, k->last_update_tick);
    put_real(&r, k->x_px);
    put_real(&r, k->y_px);
    put_flag(&r, k->uncorrelated);
    return append(ctx, recorder, BST_TABLE_TRACKS, &r);
}

bst_status bst_recorder_track_rows(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                   const void *payload, int64_t written_tick) {
    const bst_tracks *t = payload;
    const bst_attitude_fix *a = &t->attitude;
    const bst_quat no_quat = {NAN, NAN, NAN, NAN};
    row r = {.count = 0};
    put_int(&r, sensor);
    put_int(&r, t->exposure_id);
    put_int(&r, t->tick);
    put_real(&r, seconds(recorder, t->tick));
    put_int(&r, written_tick);
    put_int(&r, t->target_id);
    put_int(&r, t->count);
    put_int(&r, t->lost);
    put_int(&r, t->at_rest);
    put_flag(&r, a->valid);
    put_int(&r, a->stars);
    put_quat(&r, a->valid ? a->q_cam_from_gcrf : no_quat);
    const double *sigma = a->sigma_rad, *c = a->correlation, arcsec = a->valid ? ARCSEC : NAN;
    put_vector(&r, bst_vec3_scale(a->error_cam_rad, arcsec));
    put_vector(&r, bst_vec3_scale((bst_vec3){sigma[0], sigma[1], sigma[2]}, arcsec));
    put_vector(&r, bst_vec3_scale((bst_vec3){c[0], c[1], c[2]}, a->valid ? 1.0 : NAN));
    put_real(&r, a->valid ? a->rms_px : NAN);
    put_real(&r, a->valid ? a->shared : NAN);
    put_real(&r, t->clock_sigma_s > 0.0 ? t->clock_offset_s : NAN);
    put_real(&r, t->clock_sigma_s > 0.0 ? t->clock_sigma_s : NAN);
    BST_TRY(append(ctx, recorder, BST_TABLE_TRACK_FRAMES, &r));
    for (int i = 0; i < t->count; i++) {
        BST_TRY(track_row(ctx, recorder, sensor, t, &t->items[i]));
    }
    return BST_OK;
}

bst_status bst_recorder_smoothed_rows(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                      const void *payload, int64_t written_tick) {
    (void)written_tick;
    const bst_tracks_smoothed *t = payload;
    for (int i = 0; i < t->count; i++) {
        const bst_track_smoothed *k = &t->items[i];
        row r = {.count = 0};
        put_int(&r, sensor);
        put_int(&r, t->exposure_id);
        put_int(&r, t->tick);
        put_real(&r, seconds(recorder, t->tick));
        put_int(&r, k->id);
        put_text(&r, bst_recorder_track_status_name(k->status));
        put_flag(&r, k->target_of_interest);
        put_int(&r, k->later_frames);
        put_state(&r, k->direction_gcrf, k->rate_gcrf_radps, k->covariance);
        BST_TRY(append(ctx, recorder, BST_TABLE_TRACKS_SMOOTHED, &r));
    }
    return BST_OK;
}

bst_status bst_recorder_identity_rows(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                      const void *payload, int64_t written_tick) {
    (void)written_tick;
    const bst_track_identities *t = payload;
    for (int i = 0; i < t->count; i++) {
        const bst_track_identity *k = &t->items[i];
        bool known = recorder->world && k->object >= 0 &&
                     k->object < bst_world_object_count(recorder->world);
        const bst_world_object_info *info =
            known ? bst_world_object(recorder->world, k->object) : NULL;
        row r = {.count = 0};
        put_int(&r, sensor);
        put_int(&r, t->exposure_id);
        put_int(&r, t->tick);
        put_real(&r, seconds(recorder, t->tick));
        put_int(&r, k->track_id);
        put_int(&r, k->object);
        put_text(&r, info ? info->name : NULL);
        put_int(&r, info ? info->norad : 0);
        put_real(&r, k->probability);
        BST_TRY(append(ctx, recorder, BST_TABLE_TRACK_IDENTITIES, &r));
    }
    return BST_OK;
}

bst_status bst_recorder_los_command_rows(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                         const void *payload, int64_t written_tick) {
    const bst_los_command *c = payload;
    row r = {.count = 0};
    put_int(&r, sensor);
    put_int(&r, written_tick);
    put_int(&r, c->tick);
    put_real(&r, seconds(recorder, c->tick));
    put_radec(&r, c->direction_gcrf);
    put_vector(&r, c->rate_gcrf_radps);
    put_vector(&r, c->accel_gcrf_radps2);
    return append(ctx, recorder, BST_TABLE_LOS_COMMANDS, &r);
}

bst_status bst_recorder_sensor_command_rows(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                            const void *payload, int64_t written_tick) {
    const bst_sensor_command *c = payload;
    row r = {.count = 0};
    put_int(&r, sensor);
    put_int(&r, written_tick);
    put_real(&r, seconds(recorder, written_tick));
    put_real(&r, c->exposure_s);
    put_real(&r, c->period_s);
    put_int(&r, c->window.x0);
    put_int(&r, c->window.y0);
    put_int(&r, c->window.width);
    put_int(&r, c->window.height);
    put_int(&r, c->binning);
    return append(ctx, recorder, BST_TABLE_SENSOR_COMMANDS, &r);
}

bst_status bst_recorder_pointing_rows(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                      const void *payload, int64_t written_tick) {
    const bst_pointing_telemetry *p = payload;
    if (p->written < 1 ||
        !bst_recorder_due(recorder, written_tick, &recorder->sensors[sensor].last_pointing)) {
        return BST_OK;
    }
    const bst_pointing_sample *s = &p->items[(p->written - 1) % p->capacity];
    row r = {.count = 0};
    put_int(&r, sensor);
    put_int(&r, s->tick);
    put_real(&r, seconds(recorder, s->tick));
    put_quat(&r, s->q_cam_from_gcrf);
    put_real(&r, s->axis_rad[0] * DEG);
    put_real(&r, s->axis_rad[1] * DEG);
    put_quat(&r, p->q_body_from_gcrf);
    put_flag(&r, p->settled);
    put_flag(&r, p->limited);
    return append(ctx, recorder, BST_TABLE_POINTING, &r);
}

bst_status bst_recorder_mount_rows(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                   const void *payload, int64_t written_tick) {
    const bst_mount_status *m = payload;
    if (!bst_recorder_due(recorder, written_tick, &recorder->sensors[sensor].last_mount)) {
        return BST_OK;
    }
    row r = {.count = 0};
    put_int(&r, sensor);
    put_int(&r, m->tick);
    put_real(&r, seconds(recorder, m->tick));
    put_int(&r, m->axes);
    for (int i = 0; i < BST_MOUNT_AXES; i++) {
        const bst_mount_axis *a = &m->axis[i];
        double there = i < m->axes ? DEG : NAN;
        put_real(&r, a->angle_rad * there);
        put_real(&r, a->rate_radps * there);
        put_int(&r, i < m->axes ? (int64_t)a->flags : 0);
    }
    put_vector(&r, bst_vec3_scale(m->rate_body_radps, DEG));
    put_flag(&r, m->wheels_saturated);
    return append(ctx, recorder, BST_TABLE_MOUNT, &r);
}

bst_status bst_recorder_nav_rows(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                 const void *payload, int64_t written_tick) {
    const bst_nav_telemetry *n = payload;
    if (!bst_recorder_due(recorder, written_tick, &recorder->sensors[sensor].last_nav)) {
        return BST_OK;
    }
    row r = {.count = 0};
    put_int(&r, sensor);
    put_int(&r, n->tick);
    put_real(&r, seconds(recorder, n->tick));
    put_vector(&r, n->position_gcrf_m);
    put_vector(&r, n->velocity_gcrf_mps);
    return append(ctx, recorder, BST_TABLE_NAV, &r);
}

bst_status bst_recorder_control_rows(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                     const void *payload, int64_t written_tick) {
    const bst_control_status *c = payload;
    bst_recorder_state *s = &recorder->sensors[sensor];
    bool due = bst_recorder_due(recorder, written_tick, &s->last_control);
    if (!due && c->mode == s->last_mode && c->target_id == s->last_target) {
        return BST_OK;
    }
    s->last_mode = c->mode;
    s->last_target = c->target_id;
    row r = {.count = 0};
    put_int(&r, sensor);
    put_int(&r, c->tick);
    put_real(&r, seconds(recorder, c->tick));
    put_text(&r, bst_mode_name(c->mode));
    put_int(&r, c->target_id);
    put_int(&r, c->search_step);
    put_real(&r, c->aim_error_px[0]);
    put_real(&r, c->aim_error_px[1]);
    return append(ctx, recorder, BST_TABLE_CONTROL, &r);
}
