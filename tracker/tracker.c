#include "tracker/tracker_internal.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/pages.h"
#include "sim/onboard/nav_motion.h"
#include "tracker/attitude/sky_of_detection.h"

/* Least SNR of a detection used by the tracker, share of the detector's threshold: 2.5 at a
 * threshold of 5. */
static const double LEAST_SNR_SHARE = 0.5;

static double arcsec(double v) {
    return v * BST_ARCSEC_RAD;
}

static double square(double v) {
    return v * v;
}

/* Parameters of the selection of the target. */
static bst_target_params target_params_of(const bst_tracker_config *c) {
    return (bst_target_params){
        .direction_chi2 = c->target_direction_chi2,
        .rate_chi2 = c->target_rate_chi2,
        .magnitude_chi2 = c->target_magnitude_chi2,
        .release_chi2 = c->target_release_chi2,
        .rate_floor_radps = arcsec(c->target_rate_systematic_arcsec_per_s),
        .max_rate_sigma_radps = arcsec(c->target_max_rate_sigma_arcsec_per_s),
        .max_chi2 = c->target_max_chi2,
        .min_hits = (int)c->target_min_hits,
        .margin = c->target_margin,
        .margin_hits = (int)c->target_margin_hits,
        .max_dormant_s = c->target_dormant_s,
        .dormant_gate_chi2 = 23.5, /* 99.99 %, 4 degrees of freedom */
        /* a lost target may have manoeuvred: ten times the usual acceleration */
        .memory_noise_rad2ps3 = square(10.0 * arcsec(c->process_noise_arcsec_per_s15))};
}

/* Converts the configuration to the parameters of the multi-target tracker. */
static void make_params(bst_tracker *t, const bst_tracker_config *c, bst_mtt_params *mtt) {
    double scale = bst_camera_scale_rad(&t->camera);
    t->attitude_params = (bst_attitude_params){.floor_px = c->star_systematic_px,
                                               .reject_chi2 = c->star_reject_chi2,
                                               .max_cross_rad = c->max_attitude_sigma_px * scale,
                                               .max_roll_rad = arcsec(c->max_roll_sigma_arcsec)};
    t->error_params =
        (bst_attitude_error_params){.rate_sigma_radps = arcsec(c->drift_sigma_arcsec_per_s),
                                    .noise_rad2ps3 = square(arcsec(c->drift_noise_arcsec_per_s15)),
                                    .jitter_rad = c->jitter_px * scale,
                                    .gate_chi2 = c->telemetry_gate_chi2,
                                    .gate_patience = (int)c->max_telemetry_rejections,
                                    .telemetry_sigma_rad = arcsec(c->telemetry_sigma_arcsec)};
    t->target_params = target_params_of(c);
    t->orbits = c->motion == 1;
    t->assumed_range_m = 1e3 * c->assumed_range_km;
    t->range_sigma = c->range_sigma;
    t->range_rate_sigma_mps = c->range_rate_sigma_mps;
    t->floor_variance_px2 = square(c->object_systematic_px);
    t->blend_variance_px2 = square(c->blended_systematic_px);
    t->max_variance_px2 = square(c->max_attitude_sigma_px);
    t->edge_margin_px = c->edge_margin_px;
    t->max_attitude_sigma_rad = c->max_attitude_sigma_px * scale;
    t->max_detections = (int)c->max_detections;
    *mtt = (bst_mtt_params){
        .max_tracks = (int)c->max_tracks,
        .max_detections = (int)c->max_detections,
        .filter = c->filter,
        .association = (bst_mtt_association)c->association,
        .noise_rad2ps3 = square(arcsec(c->process_noise_arcsec_per_s15)),
        .steady_noise_rad2ps3 =
            c->steady_noise_share < 1.0
                ? square(arcsec(c->process_noise_arcsec_per_s15) * c->steady_noise_share)
                : 0.0,
        .manoeuvre_noise_rad2ps3 = square(arcsec(c->manoeuvre_noise_arcsec_per_s15)),
        .quiescent_sojourn_s = c->quiescent_sojourn_s,
        .manoeuvre_sojourn_s = c->manoeuvre_sojourn_s,
        .brightness_systematic_mag = c->brightness_systematic_mag,
        .brightness_random_walk_mag = c->brightness_random_walk_mag,
        .event_window = (int)c->event_window,
        .false_events_per_hour = c->false_events_per_hour,
        .max_dormant_tracks = (int)c->max_dormant_tracks,
        .max_dormant_s = c->max_dormant_s,
        .max_dormant_sigma_rad = c->max_dormant_sigma_deg * BST_DEG_RAD,
        .dormant_gate_chi2 = c->dormant_gate_chi2,
        .orbits = c->motion == 1,
        .range_correlation_s = c->size_range_correlation_s,
        .orbit_noise_m2ps3 = square(c->orbit_noise_mps15),
        .gate_chi2 = c->gate_chi2,
        .detection_probability = c->detection_probability,
        .false_alarms_per_frame = c->false_alarms_per_frame,
        .pixel_rad = scale,
        .field_sr = (double)t->camera.width_px * (double)t->camera.height_px * scale * scale,
        .confirm_hits = (int)c->confirm_hits,
        .confirm_frames = (int)c->confirm_frames,
        .confirm_score = c->confirm_score,
        .max_rate_radps = arcsec(c->max_rate_arcsec_per_s),
        .cue_rate_margin_radps = arcsec(c->cue_rate_margin_arcsec_per_s),
        .initiation_gap_s = c->initiation_gap_s,
        .max_misses = (int)c->max_misses,
        .max_coast_s = c->max_coast_s,
        .max_sigma_rad = arcsec(c->max_sigma_arcsec),
        .merge_rad = c->merge_distance_px * scale,
        .merge_floor_rad = c->merged_systematic_px * scale,
        .max_merged_frames = (int)c->max_merged_frames,
        .feed_forward_rad = c->cue_acceleration_radius_deg * BST_DEG_RAD,
        .star_rate_radps = arcsec(c->stationary_rate_arcsec_per_s),
        .motion_chi2 = c->motion_chi2,
        .keep_priors = c->smoothing_lag_frames > 0,
        .max_stationary_tracks = (int)c->max_stationary_tracks};
}

bst_status bst_tracker_create(bst_ctx *ctx, const bst_tracker_config *config,
                              const bst_camera *camera, int64_t tick_rate_hz,
                              bst_tracker_star_fn star, void *star_user, bst_tracker **out) {
    assert(config && camera && star && out && tick_rate_hz > 0);
    *out = NULL;
    if (tick_rate_hz <= 0 || !star) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "tracker: needs a positive tick rate and a star look-up");
    }
    if (config->confirm_frames < config->confirm_hits) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "tracker: confirm_frames (%lld) must not be less than confirm_hits (%lld)",
                        (long long)config->confirm_frames, (long long)config->confirm_hits);
    }
    if (config->smoothing_lag_frames > 0 && config->motion == 1) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "tracker: smoothing_lag_frames (%lld) does not go with motion \"orbit\"; "
                        "give motion \"constant_rate\", or smoothing_lag_frames 0",
                        (long long)config->smoothing_lag_frames);
    }
    bst_tracker *t = bst_pages_zero(1, sizeof *t);
    if (!t) {
        return bst_fail(ctx, BST_ERR_MEMORY, "tracker: out of memory");
    }
    t->onboard = t->camera = *camera;
    t->tick_rate_hz = (double)tick_rate_hz;
    t->star = star;
    t->star_user = star_user;
    t->reference = BST_QUAT_IDENTITY;
    bst_mtt_params mtt;
    make_params(t, config, &mtt);
    t->cache = bst_pages_zero(STAR_CACHE, sizeof *t->cache);
    t->stars = bst_pages_zero(MAX_STARS, sizeof *t->stars);
    t->detections = bst_pages_zero((size_t)t->max_detections, sizeof *t->detections);
    /* per track: confirmed, lost, and two kinds of change; four more for the target */
    t->event_capacity = 4 * ((size_t)mtt.max_tracks + (size_t)mtt.max_stationary_tracks + 1) + 4;
    t->events = bst_pages_zero(t->event_capacity, sizeof *t->events);
    bst_status status = t->cache && t->stars && t->detections && t->events
                            ? bst_mtt_create(ctx, &mtt, &t->mtt)
                            : bst_fail(ctx, BST_ERR_MEMORY, "tracker: out of memory");
    if (status == BST_OK) {
        status = bst_tracker_identity_create(ctx, config, t);
    }
    if (status == BST_OK) {
        status = bst_tracker_clock_create(ctx, config, t);
    }
    t->smoother_room = 2 * (int)config->max_tracks;
    if (status == BST_OK && config->smoothing_lag_frames > 0) {
        status = bst_smoother_create(ctx, t->smoother_room, (int)config->smoothing_lag_frames,
                                     &t->smoother);
    }
    if (status != BST_OK) {
        bst_tracker_free(t);
        return status;
    }
    *out = t;
    return BST_OK;
}

void bst_tracker_free(bst_tracker *t) {
    if (!t) {
        return;
    }
    bst_mtt_free(t->mtt);
    bst_smoother_free(t->smoother);
    free(t->identity);
    free(t->clock);
    bst_pages_free(t->cache);
    bst_pages_free(t->stars);
    bst_pages_free(t->detections);
    bst_pages_free(t->events);
    bst_pages_free(t);
}

/* `cache` is left out: its directions depend on the catalogue alone. */
bst_status bst_tracker_archive(bst_tracker *t, bst_archive *archive) {
    BST_ARCHIVE(archive, t->error);
    bst_archive_bool(archive, &t->referred);
    BST_ARCHIVE(archive, t->reference);
    bst_attitude_shared_archive(&t->shared, archive);
    BST_ARCHIVE(archive, t->target);
    BST_ARCHIVE(archive, t->cue_before);
    bst_archive_bool(archive, &t->started);
    bst_archive_bool(archive, &t->attitude_was_lost);
    BST_ARCHIVE(archive, t->last_exposure_id);
    BST_ARCHIVE(archive, t->last_tick);
    if (bst_archive_is_restoring(archive)) {
        t->event_count = 0;
    }
    BST_TRY(bst_tracker_identity_archive(t, archive));
    BST_TRY(bst_tracker_clock_archive(t, archive));
    BST_TRY(bst_smoother_archive(t->smoother, t->smoother_room, archive));
    return bst_mtt_archive(t->mtt, archive);
}

const bst_tracker_event *bst_tracker_events(const bst_tracker *t, int *count) {
    *count = t->event_count;
    return t->events;
}

/* Direction of a detection with its covariance. */
static bst_sky_measurement direction_of(const bst_tracker *t, const bst_detection *item,
                                        const bst_tracker_attitude *attitude,
                                        const bst_light *light) {
    double extra = t->floor_variance_px2;
    bool blend = (item->flags & (BST_DETECTION_BLEND | BST_DETECTION_EDGE)) != 0;
    if (blend && !(item->flags & BST_DETECTION_EXTENDED)) { /* its covariance includes the edge */
        extra += t->blend_variance_px2;
    }
    return bst_sky_of_detection(&t->camera, item, extra, attitude->q_cam_from_gcrf,
                                attitude->covariance_cam, light);
}

/* Collects the detections that may be objects, as directions. Returns their number. */
static int collect_objects(bst_tracker *t, const bst_detections *d,
                           const bst_tracker_attitude *attitude, const bst_light *light,
                           int *lost) {
    double scale = bst_camera_scale_rad(&t->camera);
    int count = 0;
    *lost = 0;
    for (int i = 0; i < d->count; i++) {
        const bst_detection *item = &d->items[i];
        bool positive =
            item->cov_xx > 0.0 && item->cov_xx * item->cov_yy > item->cov_xy * item->cov_xy;
        /* positions less accurate than an unusable attitude would only cause false tracks */
        bool extended = (item->flags & BST_DETECTION_EXTENDED) != 0; /* cannot be a star */
        bool sharp = extended ||
                     (item->cov_xx <= t->max_variance_px2 && item->cov_yy <= t->max_variance_px2);
        /* an uncatalogued star is distinguished from a slow object by its track */
        bool may_move = item->label == BST_LABEL_OBJECT || item->label == BST_LABEL_UNKNOWN ||
                        (item->label == BST_LABEL_STAR && item->star_id == 0);
        /* residue of a masked bad pixel: the matched filter's maximum without a source */
        bool empty = d->bad_pixels > 0 && item->snr < LEAST_SNR_SHARE * d->threshold_snr;
        if (empty || !may_move || !positive || !sharp || !isfinite(item->x_px) ||
            !isfinite(item->y_px)) {
            continue;
        }
        if (count == t->max_detections) {
            ++*lost;
            continue;
        }
        bool bright = isfinite(item->v_mag) && isfinite(item->v_mag_sigma);
        bool whole = extended && !(item->flags & BST_DETECTION_EDGE); /* else too small */
        assert(count < t->max_detections);
        t->detections[count++] =
            (bst_mtt_detection){.sky = direction_of(t, item, attitude, light),
                                .x_px = item->x_px,
                                .y_px = item->y_px,
                                .v_mag = bright ? item->v_mag : 0.0,
                                .v_mag_sigma = bright ? item->v_mag_sigma : INFINITY,
                                .snr = item->snr,
                                .length_rad = extended ? 0.0 : scale * item->length_px,
                                .width_px = item->width_px,
                                .range_m = whole ? item->extent.range_m : 0.0,
                                .range_sigma_m = whole ? item->extent.range_sigma_m : 0.0};
    }
    return count;
}

/* Number of detections labelled as charge. */
static int count_charge(const bst_detections *d) {
    int count = 0;
    for (int i = 0; i < d->count; i++) {
        count += d->items[i].label == BST_LABEL_HOT_PIXEL || d->items[i].label == BST_LABEL_HIT;
    }
    return count;
}

/* Appends an event of the tracker. */
static void add_event(bst_tracker *t, bst_tracker_event_kind kind, const bst_mtt_track *track) {
    if ((size_t)t->event_count == t->event_capacity) {
        return;
    }
    bst_tracker_event *event = &t->events[t->event_count++];
    *event = (bst_tracker_event){.kind = kind};
    if (track) {
        event->track_id = track->id;
        event->direction_gcrf = track->state.direction;
        event->rate_gcrf_radps = track->state.rate_radps;
        event->v_mag = track->v_mag;
    }
}

/* Selects the target of interest and records its changes. */
static void choose_target(bst_tracker *t, const bst_target_cue *cue, double seconds) {
    int count;
    const bst_mtt_event *events = bst_mtt_events(t->mtt, &count);
    static const bst_tracker_event_kind kinds[] = {
        [BST_MTT_CONFIRMED] = BST_TRACKER_TRACK_CONFIRMED,
        [BST_MTT_RESUMED] = BST_TRACKER_TRACK_RESUMED,
        [BST_MTT_LOST] = BST_TRACKER_TRACK_LOST,
        [BST_MTT_MANOEUVRE] = BST_TRACKER_MANOEUVRE,
        [BST_MTT_BRIGHTNESS] = BST_TRACKER_BRIGHTNESS_CHANGE};
    for (int i = 0; i < count; i++) {
        add_event(t, kinds[events[i].kind], &events[i].track);
        t->events[t->event_count - 1].statistic = events[i].statistic;
    }
    int64_t before = t->target.id;
    bool was_ambiguous = t->target.ambiguous;
    const bst_mtt_track *tracks = bst_mtt_tracks(t->mtt, &count);
    bst_target_step(&t->target, &t->target_params, cue, seconds, tracks, count);
    if (t->target.id != before && before != 0) {
        add_event(t, BST_TRACKER_TARGET_LOST, NULL);
        t->events[t->event_count - 1].track_id = before;
    }
    if (t->target.id != before && t->target.id != 0) {
        add_event(t, BST_TRACKER_TARGET_SELECTED, bst_mtt_find(t->mtt, t->target.id));
        was_ambiguous = was_ambiguous && before != 0;
    }
    if (t->target.id != 0 && t->target.ambiguous != was_ambiguous) {
        add_event(t, was_ambiguous ? BST_TRACKER_TARGET_RESOLVED : BST_TRACKER_TARGET_AMBIGUOUS,
                  bst_mtt_find(t->mtt, t->target.id));
        bst_tracker_event *event = &t->events[t->event_count - 1];
        event->statistic = t->target.probability;
        event->rival_id = t->target.rival_id;
        event->rival_probability = t->target.rival_probability;
    }
}

/* Writes a track to the output message. */
static void write_track(const bst_tracker *t, const bst_target_cue *cue, const bst_mtt_track *track,
                        bst_track *out) {
    bool is_target = track->id == t->target.id;
    *out = (bst_track){.id = track->id,
                       .status = (int32_t)track->status,
                       .target_of_interest = is_target,
                       .direction_gcrf = track->state.direction,
                       .rate_gcrf_radps = track->state.rate_radps,
                       .v_mag = track->v_mag,
                       .snr = track->snr,
                       .score = track->score,
                       .hits = track->hits,
                       .misses_in_row = track->misses_in_row,
                       .first_tick = track->first_tick,
                       .last_update_tick = track->last_update_tick,
                       .x_px = track->x_px,
                       .y_px = track->y_px,
                       .uncorrelated = !is_target && track->status != BST_TRACK_TENTATIVE &&
                                       !bst_target_is_expected(&t->target_params, cue, track, NULL),
                       .hidden = !track->asleep                  ? BST_HIDDEN_NOT
                                 : track->sight == BST_MTT_EARTH ? BST_HIDDEN_EARTH
                                 : track->sight == BST_MTT_CLEAR ? BST_HIDDEN_AWAITED
                                 : track->light.sunlight < 1.0   ? BST_HIDDEN_SHADOW
                                                                 : BST_HIDDEN_DIM};
    memcpy(out->covariance, track->state.covariance, sizeof out->covariance);
}

/* Output order: 0 target, 1 confirmed, 2 tentative, 3 not reported. */
static int output_rank(const bst_mtt_track *track, int64_t target_id) {
    if (track->at_rest) {
        return 3;
    }
    return track->id == target_id ? 0 : track->status == BST_TRACK_TENTATIVE ? 2 : 1;
}

/* Writes the tracks message. */
static void write_tracks(const bst_tracker *t, const bst_detections *d, const bst_attitude_fix *fix,
                         const bst_target_cue *cue, int detections_lost, bst_tracks *out,
                         int capacity) {
    int count;
    const bst_mtt_track *all = bst_mtt_tracks(t->mtt, &count);
    *out = (bst_tracks){.exposure_id = d->exposure_id,
                        .tick = fix->tick,
                        .attitude = *fix,
                        .target_id = t->target.id,
                        .clock_offset_s = bst_tracker_clock_s(t),
                        .clock_sigma_s = bst_tracker_clock_sigma_s(t, bst_tracker_clock_s(t)),
                        .lost = bst_mtt_lost(t->mtt) + detections_lost};
    for (int i = 0; i < count; i++) {
        out->at_rest += all[i].at_rest;
    }
    for (int r = 0; r < 3; r++) {
        for (int i = 0; i < count; i++) {
            if (output_rank(&all[i], t->target.id) != r) {
                continue;
            }
            if (out->count < capacity) {
                write_track(t, cue, &all[i], &out->items[out->count++]);
            } else {
                out->lost++;
            }
        }
    }
}

/* Writes the predictions message: predicted tracks and attitude error.
 *
 * Given:     q_cam_from_gcrf  camera attitude by telemetry, now */
static void write_predictions(const bst_tracker *t, int64_t tick, bst_quat q_cam_from_gcrf,
                              bst_predictions *out, int capacity) {
    int count;
    double p[3][3];
    const bst_mtt_track *all = bst_mtt_tracks(t->mtt, &count);
    *out = (bst_predictions){.tick = tick};
    bst_attitude_error_get(&t->error, &t->error_params, bst_tracker_refer(t, q_cam_from_gcrf),
                           &out->attitude_error_cam_rad, &out->attitude_error_rate_cam_radps, p);
    /* a correction in camera axes is one of small angles; the camera turns before its use */
    out->attitude_valid = !t->referred && t->error.started &&
                          sqrt(fmax(p[0][0], p[1][1])) <= 10.0 * t->max_attitude_sigma_rad;
    for (int r = 0; r < 2; r++) { /* tentative tracks are omitted */
        for (int i = 0; i < count; i++) {
            if (output_rank(&all[i], t->target.id) != r) {
                continue;
            }
            if (out->count < capacity) {
                const bst_sky_state *s = &all[i].state;
                out->items[out->count++] = (bst_prediction){
                    .track_id = all[i].id,
                    .direction_gcrf = s->direction,
                    .rate_gcrf_radps = s->rate_radps,
                    .sigma_rad = sqrt(fmax(s->covariance[0][0], s->covariance[1][1])),
                    .target_of_interest = r == 0};
            } else {
                out->lost++;
            }
        }
    }
}

static int64_t mid_tick(const bst_detections *d) {
    return d->start_tick + (d->end_tick - d->start_tick) / 2;
}

bst_tracker_outcome bst_tracker_check(const bst_tracker *t, const bst_detections *d) {
    if (t->started && d->exposure_id == t->last_exposure_id) {
        return BST_TRACKER_DUPLICATE;
    }
    return t->started && mid_tick(d) <= t->last_tick ? BST_TRACKER_BACKWARDS : BST_TRACKER_USED;
}

bool bst_tracker_may_start_orbit(const bst_tracker *t) {
    int count;
    const bst_mtt_track *tracks = bst_mtt_tracks(t->mtt, &count);
    bool may = false;
    for (int i = 0; t->orbits && i < count; i++) {
        may = may || (!tracks[i].star && !tracks[i].orbit.valid);
    }
    return may;
}

/* The part of the cue that chooses the target. */
static bst_target_cue target_cue(const bst_tracker_cue *cue) {
    return (bst_target_cue){.valid = cue->valid,
                            .direction = cue->direction_gcrf,
                            .rate_radps = cue->rate_gcrf_radps,
                            .sigma_rad = cue->sigma_rad,
                            .rate_sigma_radps = cue->rate_sigma_radps,
                            .v_mag = cue->v_mag,
                            .v_mag_sigma = cue->v_mag_sigma,
                            .in_region = cue->in_region,
                            .belt_eye = cue->belt_eye};
}

static void smooth(bst_tracker *t, const bst_smoother_frame *frame) {
    if (t->smoother) {
        bst_smoother_step(t->smoother, frame, t->mtt);
    }
}

bst_tracker_outcome bst_tracker_step(bst_tracker *t, const bst_tracker_input *input,
                                     bst_tracks *tracks, int track_capacity,
                                     bst_predictions *predictions, int prediction_capacity) {
    assert(t && input && input->detections && input->nav && tracks && predictions);
    assert(track_capacity >= 0 && prediction_capacity >= 0);
    const bst_detections *d = input->detections;
    int64_t tick = mid_tick(d);
    bst_tracker_outcome refusal = bst_tracker_check(t, d);
    if (refusal != BST_TRACKER_USED) {
        return refusal;
    }
    double seconds = (double)tick / t->tick_rate_hz;
    double dt = t->started ? (double)(tick - t->last_tick) / t->tick_rate_hz : 0.0;
    bst_light light =
        bst_nav_light_after(input->nav, seconds - (double)input->nav->tick / t->tick_rate_hz);
    bst_tracker_attitude attitude;
    bst_tracker_find_attitude(t, input, &light, tick, dt, &attitude);
    t->event_count = 0;
    const bst_tracker_cue *cue = &input->cue;
    bst_tracker_frame_view view = {.tracker = t,
                                   .q_cam_from_gcrf = attitude.q_cam_from_gcrf,
                                   .light = light,
                                   .range_m = cue->range_m,
                                   .range_rate_mps = cue->range_rate_mps,
                                   .cue = target_cue(cue)};
    bst_mtt_frame frame = {
        .tick = tick,
        .seconds = seconds,
        .detections = t->detections,
        .partial = d->windows > 0,
        .bad_pixels = d->bad_pixels,
        .charged = count_charge(d),
        .in_field = bst_tracker_frame_in_field,
        .expected = bst_tracker_frame_is_expected,
        .range = bst_tracker_frame_range_of,
        .user = &view,
        .boresight = bst_quat_rotate(bst_quat_conj(attitude.q_cam_from_gcrf), (bst_vec3){0, 0, 1}),
        .expected_rate = cue->in_region ? bst_tracker_frame_expected_rate : NULL,
        .cue_valid = cue->valid,
        .cue_before_valid = t->cue_before.valid,
        .cue_direction = cue->direction_gcrf,
        .cue_rate_radps = cue->rate_gcrf_radps,
        .cue_before_direction = t->cue_before.direction_gcrf,
        .cue_before_rate_radps = t->cue_before.rate_gcrf_radps,
        .cue_rate_sigma_radps = cue->rate_sigma_radps,
        .common_rate_sigma_radps = attitude.rate_sigma_radps,
        .threshold_snr = d->threshold_snr};
    if (t->orbits && bst_tracker_frame_observer(t, input->nav, seconds, &view.observer)) {
        frame.observer = &view.observer;
        frame.sight = bst_tracker_frame_sight_of;
        view.threshold_snr = d->threshold_snr > 0.0 ? d->threshold_snr : USUAL_THRESHOLD_SNR;
    }
    int detections_lost = 0;
    if (attitude.usable) {
        frame.count = collect_objects(t, d, &attitude, &light, &detections_lost);
        bst_mtt_step(t->mtt, &frame);
    } else {
        bst_mtt_skip(t->mtt, &frame);
        if (!t->attitude_was_lost) {
            add_event(t, BST_TRACKER_ATTITUDE_LOST, NULL);
        }
    }
    t->attitude_was_lost = !attitude.usable;
    if (t->identity && input->near) {
        bst_tracker_identify(t, input, attitude.usable, &frame, &view.cue);
    }
    choose_target(t, &view.cue, seconds);
    smooth(t, &(bst_smoother_frame){d->exposure_id, tick, seconds, t->target.id});
    write_tracks(t, d, &attitude.fix, &view.cue, detections_lost, tracks, track_capacity);
    write_predictions(
        t, attitude.fix.tick,
        input->q_telemetry_now ? *input->q_telemetry_now : bst_tracker_telemetry(input),
        predictions, prediction_capacity);
    t->cue_before = *cue;
    t->started = true;
    t->last_exposure_id = d->exposure_id;
    t->last_tick = tick;
    return attitude.usable ? BST_TRACKER_USED : BST_TRACKER_NO_ATTITUDE;
}

const bst_identity *bst_tracker_identity(const bst_tracker *t) {
    return t->identified ? t->identity : NULL;
}

void bst_tracker_cue_corrected(bst_tracker *t) {
    t->cue_before.valid = false; /* the change of the cue is no motion of a track */
}

void bst_tracker_retarget(bst_tracker *t) {
    t->target = (bst_target){.id = 0};
    bst_tracker_cue_corrected(t);
}

int bst_tracker_smoothed_room(const bst_tracker_config *config) {
    return config->smoothing_lag_frames > 0 ? 2 * (int)config->max_tracks : 0;
}

bool bst_tracker_has_smoothed(const bst_tracker *t) {
    bst_smoother_frame frame;
    const bst_smoothed *states;
    int count, lost;
    return t->smoother && bst_smoother_get(t->smoother, &frame, &states, &count, &lost);
}

void bst_tracker_smoothed(const bst_tracker *t, bst_tracks_smoothed *out, int capacity) {
    assert(t && bst_tracker_has_smoothed(t) && out && capacity >= 0);
    bst_smoother_frame frame = {0};
    const bst_smoothed *states;
    int count, lost;
    bst_smoother_get(t->smoother, &frame, &states, &count, &lost);
    *out =
        (bst_tracks_smoothed){.exposure_id = frame.exposure_id, .tick = frame.tick, .lost = lost};
    for (int i = 0; i < count; i++) {
        if (out->count == capacity) {
            out->lost++;
            continue;
        }
        bst_track_smoothed *item = &out->items[out->count++];
        *item = (bst_track_smoothed){.id = states[i].id,
                                     .status = (int32_t)states[i].status,
                                     .target_of_interest = states[i].id == frame.target_id,
                                     .later_frames = states[i].later_frames,
                                     .direction_gcrf = states[i].state.direction,
                                     .rate_gcrf_radps = states[i].state.rate_radps};
        memcpy(item->covariance, states[i].state.covariance, sizeof item->covariance);
    }
}
