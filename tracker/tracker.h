/* The tracker: detections of a frame in, tracks and predictions out.
 *
 * Steps: attitude from identified stars, other detections as inertial directions, multi-target
 * tracking, selection of the target of interest. It uses detections, telemetry, the onboard
 * catalogue and the cue; never the truth. */
#ifndef BST_TRACKER_TRACKER_H
#define BST_TRACKER_TRACKER_H

#include "boresight/archive.h"
#include "boresight/camera.h"
#include "boresight/config.h"
#include "boresight/messages.h"
#include "sim/astro/belt.h"
#include "tracker/clock_offset.h"
#include "tracker/identity.h"
#include "tracker/mtt/filter.h"

/* Values of a scenario's tracker block; bst_tracker_config_table describes each. */
typedef struct bst_tracker_config {
    bst_filter_kind filter; /* not in the table, which sets BST_FILTER_EKF; the caller sets it */
    double star_systematic_px, star_reject_chi2, max_attitude_sigma_px, max_roll_sigma_arcsec;
    double drift_sigma_arcsec_per_s, drift_noise_arcsec_per_s15, jitter_px, telemetry_sigma_arcsec;
    double process_noise_arcsec_per_s15, steady_noise_share;
    double gate_chi2, detection_probability, false_alarms_per_frame;
    int64_t confirm_hits, confirm_frames;
    double confirm_score, max_rate_arcsec_per_s, cue_rate_margin_arcsec_per_s, initiation_gap_s;
    int64_t max_misses;
    double max_coast_s, max_sigma_arcsec;
    double merge_distance_px, merged_systematic_px, object_systematic_px, blended_systematic_px,
        edge_margin_px;
    double cue_acceleration_radius_deg;
    double target_direction_chi2, target_rate_chi2, target_magnitude_chi2, target_release_chi2,
        target_rate_systematic_arcsec_per_s, target_max_rate_sigma_arcsec_per_s, target_dormant_s;
    double stationary_rate_arcsec_per_s, motion_chi2;
    int64_t target_min_hits, max_tracks, max_stationary_tracks, max_detections;
    int32_t association; /* bst_mtt_association */
    int32_t motion;      /* 1: orbit */
    double assumed_range_km, range_sigma, range_rate_sigma_mps, orbit_noise_mps15;
    double size_range_correlation_s;
    double manoeuvre_noise_arcsec_per_s15, quiescent_sojourn_s, manoeuvre_sojourn_s;
    double brightness_systematic_mag, brightness_random_walk_mag;
    int64_t event_window;
    double false_events_per_hour;
    int64_t max_dormant_tracks;
    double max_dormant_s, max_dormant_sigma_deg, dormant_gate_chi2;
    int64_t max_merged_frames, max_telemetry_rejections;
    double telemetry_gate_chi2, target_max_chi2, target_margin;
    int64_t target_margin_hits;
    int64_t smoothing_lag_frames;
    double identity_period_s, catalogue_sigma_m, catalogue_sigma_mps, catalogue_mag_sigma,
        uncatalogued_per_field;
    double clock_sigma_s, navigation_sigma_m;
} bst_tracker_config;

extern const bst_config_desc bst_tracker_config_table[];

/* Looks up a catalogue star: unit direction, ICRS, proper motion applied. Returns false if it is
 * unknown. */
typedef bool (*bst_tracker_star_fn)(void *user, uint32_t star_id, bst_vec3 *icrs);

/* The cue at one time, as bst_onboard_cue of sim/world. */
typedef struct bst_tracker_cue {
    bool valid;
    bst_vec3 direction_gcrf, rate_gcrf_radps;
    double sigma_rad, rate_sigma_radps;
    double v_mag, v_mag_sigma;
    /* of the cue's object; range 0: unknown or not requested (bst_tracker_may_start_orbit) */
    double range_m, range_rate_mps;
    /* the cue is a region: direction is its centre, and objects move as the belt does at their
     * position */
    bool in_region;
    bst_belt_eye belt_eye;
} bst_tracker_cue;

/* A search for catalogue objects in a cone. */
typedef struct bst_tracker_search {
    bst_vec3 axis;
    double half_angle_rad;
    const bst_vec3 *tracks; /* [track_count] directions of the tracks that are compared */
    int track_count;
} bst_tracker_search;

/* Finds catalogue objects near a direction, other than the cue's, at mid-exposure.
 *
 * Given:     user      as in the input
 *            room      of `out`, at most BST_IDENTITY_OBJECTS
 * Returned:  number of objects in `out`, at most `room`: those nearest to a track, without any
 *            to the axis; negative: the search has failed
 *            *left_out number of objects in the cone without room */
typedef int (*bst_tracker_near_fn)(void *user, const bst_tracker_search *search,
                                   bst_identity_object *out, int room, int *left_out);

/* Predicts a catalogue object at mid-exposure, also the cue's. False: it has no place. */
typedef bool (*bst_tracker_sight_fn)(void *user, int32_t object, bst_clock_sight *out);

typedef struct bst_tracker_input {
    const bst_detections *detections;
    const bst_nav_telemetry *nav; /* required */
    /* current attitude telemetry, for the axes of the predicted attitude error; NULL: that of the
     * detections' exposure */
    const bst_quat *q_telemetry_now;
    /* mid-exposure attitude by telemetry, for detections that do not have it; NULL: they do */
    const bst_quat *q_telemetry_mid;
    /* cue at mid-exposure */
    bst_tracker_cue cue;
    bst_tracker_near_fn near; /* NULL: no catalogue */
    bst_tracker_sight_fn sight;
    void *near_user;    /* of both */
    int32_t cue_object; /* index in the catalogue; negative: none */
} bst_tracker_input;

typedef enum bst_tracker_event_kind {
    BST_TRACKER_TRACK_CONFIRMED,
    BST_TRACKER_TRACK_LOST,
    BST_TRACKER_TARGET_SELECTED,
    BST_TRACKER_TARGET_LOST,
    BST_TRACKER_ATTITUDE_LOST, /* no attitude accurate enough to measure directions */
    BST_TRACKER_TRACK_RESUMED, /* a lost track is confirmed again under its identity */
    BST_TRACKER_MANOEUVRE,
    BST_TRACKER_BRIGHTNESS_CHANGE,
    BST_TRACKER_TARGET_AMBIGUOUS, /* another track may be the cue's object */
    BST_TRACKER_TARGET_RESOLVED,  /* the target's identity has become certain */
} bst_tracker_event_kind;

typedef struct bst_tracker_event {
    bst_tracker_event_kind kind;
    int64_t track_id; /* 0: not related to a track */
    bst_vec3 direction_gcrf, rate_gcrf_radps;
    double v_mag;
    /* chi-square of a manoeuvre (2 degrees of freedom) or of a brightness change (1); ambiguous or
     * resolved: probability that the track is the cue's object */
    double statistic;
    /* ambiguous: the likeliest other track */
    int64_t rival_id;
    double rival_probability;
} bst_tracker_event;

/* Outcome of a frame. */
typedef enum bst_tracker_outcome {
    BST_TRACKER_USED = 0,
    BST_TRACKER_NO_ATTITUDE, /* outputs written, tracks only predicted */
    BST_TRACKER_DUPLICATE,   /* exposure already processed: nothing done */
    BST_TRACKER_BACKWARDS,   /* not later than the previous frame: nothing done */
} bst_tracker_outcome;

typedef struct bst_tracker bst_tracker;

/* Creates a tracker; allocates all memory.
 *
 * Errors:    BST_ERR_ARGUMENT, BST_ERR_MEMORY
 * Ownership: `camera` and `star_user` must outlive it; free with bst_tracker_free */
bst_status bst_tracker_create(bst_ctx *ctx, const bst_tracker_config *config,
                              const bst_camera *camera, int64_t tick_rate_hz,
                              bst_tracker_star_fn star, void *star_user,
                              bst_tracker **out) BST_MUST_CHECK;
/* Frees a tracker; NULL is allowed. */
void bst_tracker_free(bst_tracker *tracker);

/* Saves or restores the state of a tracker, for bst_module_desc.archive. After a restore there are
 * no events.
 *
 * Errors:    BST_ERR_FORMAT for damaged tracks */
bst_status bst_tracker_archive(bst_tracker *tracker, bst_archive *archive) BST_MUST_CHECK;

/* Checks whether bst_tracker_step will accept a frame: BST_TRACKER_USED, or the reason for refusal.
 * The content is not examined. */
bst_tracker_outcome bst_tracker_check(const bst_tracker *tracker, const bst_detections *detections);

/* True if the next step may start an orbit, for which it needs the range of the cue's object. */
bool bst_tracker_may_start_orbit(const bst_tracker *tracker);

/* Processes one frame and, unless it is a duplicate or late, fills `tracks` (room for
 * track_capacity items) and `predictions`.
 *
 * Returned:  tracks  the target of interest, then confirmed, then tentative tracks, each by
 *                    identity; those beyond the capacity are counted in `lost`. Stationary tracks
 *                    that the cue does not expect are only counted (`at_rest`) */
bst_tracker_outcome bst_tracker_step(bst_tracker *tracker, const bst_tracker_input *input,
                                     bst_tracks *tracks, int track_capacity,
                                     bst_predictions *predictions, int prediction_capacity);

/* Number of smoothed tracks of a frame that there is room for: a deleted track has states for the
 * frames of the lag that remain. */
int bst_tracker_smoothed_room(const bst_tracker_config *config);

/* True if there is a frame that lies smoothing_lag_frames before the latest one; false with 0. */
bool bst_tracker_has_smoothed(const bst_tracker *tracker);

/* Writes the smoothed tracks of that frame, which exists; tracks beyond the capacity are counted
 * in `lost`. */
void bst_tracker_smoothed(const bst_tracker *tracker, bst_tracks_smoothed *out, int capacity);

/* Probabilities over the catalogue's objects, if the tracks were compared with it in the latest
 * processed frame; else NULL. Valid until the next step. */
const bst_identity *bst_tracker_identity(const bst_tracker *tracker);

/* 1 sigma of what the onboard clock's offset differs from `corrected_s`, s; 0: no offset is
 * estimated. */
double bst_tracker_clock_sigma_s(const bst_tracker *tracker, double corrected_s);

/* Announces that the cue has been corrected: its change to the next frame is no motion. */
void bst_tracker_cue_corrected(bst_tracker *tracker);

/* Announces a new cue from the next frame on: no track is the target until it fits the new cue. */
void bst_tracker_retarget(bst_tracker *tracker);

/* Events of the latest processed frame; valid until the next step. */
const bst_tracker_event *bst_tracker_events(const bst_tracker *tracker, int *count);

#endif
