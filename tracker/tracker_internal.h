/* Declarations shared by the files of the tracker. */
#ifndef BST_TRACKER_TRACKER_INTERNAL_H
#define BST_TRACKER_TRACKER_INTERNAL_H

#include "sim/astro/bodies.h"
#include "tracker/attitude/attitude.h"
#include "tracker/attitude/attitude_error.h"
#include "tracker/attitude/attitude_shared.h"
#include "tracker/mtt/smoother.h"
#include "tracker/target.h"
#include "tracker/tracker.h"

/* Size of the cache of catalogue directions; a power of two. */
#define STAR_CACHE 4096
/* Most stars of a frame used for the attitude. */
#define MAX_STARS 16384
/* Detection threshold assumed if the detector does not report one. */
#define USUAL_THRESHOLD_SNR 5.0

typedef struct cached_star {
    uint32_t id; /* 0: empty */
    bst_vec3 icrs;
} cached_star;

struct bst_tracker {
    bst_camera onboard, camera; /* before the flight; as image processing has calibrated it */
    double tick_rate_hz;
    bst_tracker_star_fn star;
    void *star_user;
    bst_attitude_params attitude_params;
    bst_attitude_error_params error_params;
    bst_target_params target_params;
    bool orbits;
    double assumed_range_m, range_sigma, range_rate_sigma_mps;
    double floor_variance_px2, blend_variance_px2, max_variance_px2, edge_margin_px,
        max_attitude_sigma_rad;
    int max_detections;
    bst_mtt *mtt;
    double identity_period_s; /* 0: never */
    bst_identity_params identity_params;
    bst_identity *identity; /* latest comparison; NULL: none are made */
    double identified_s;    /* its time */
    bool identified;        /* in the latest frame */
    bst_clock_params clock_params;
    bst_clock *clock;       /* NULL: the onboard clock is right */
    bst_smoother *smoother; /* NULL: no smoothing */
    int smoother_room;      /* also without one */
    cached_star *cache;
    bst_attitude_star *stars;
    bst_mtt_detection *detections;
    bst_tracker_event *events;
    size_t event_capacity;
    int event_count;
    /* of the telemetry after `reference`: q_true = q_telemetry * reference * error */
    bst_attitude_error error;
    bst_quat reference; /* a large error of the telemetry, from stars */
    bool referred;      /* `reference` is not the identity */
    bst_attitude_shared shared;
    bst_target target;
    bst_tracker_cue cue_before;
    bool started, attitude_was_lost;
    int64_t last_exposure_id, last_tick;
};

/* Context of the multi-target tracker's queries for one frame. */
typedef struct bst_tracker_frame_view {
    const bst_tracker *tracker;
    bst_quat q_cam_from_gcrf;
    bst_light light;
    bst_target_cue cue;
    double range_m, range_rate_mps; /* of the cue's object; range 0: unknown */
    bst_od_observer observer;
    double threshold_snr;
} bst_tracker_frame_view;

/* Callback of bst_mtt_frame: true if a direction is in the field.
 *
 * Given:     user  a bst_tracker_frame_view; so for the callbacks below */
bool bst_tracker_frame_in_field(const void *user, bst_vec3 direction);

/* Callback: true if the cue expects the motion of a track. */
bool bst_tracker_frame_is_expected(const void *user, const bst_mtt_track *track);
/* Callback: rate that the cue expects in a direction, rad/s; false without a cue. */
bool bst_tracker_frame_expected_rate(const void *user, bst_vec3 direction, bst_vec3 *rate_radps);
/* Callback: range and range rate to assume for a track; false if nothing is known. */
bool bst_tracker_frame_range_of(const void *user, const bst_mtt_track *track, bst_orbit_range *out);
/* Callback: visibility of a track's object by its estimated orbit. */
bst_mtt_sight bst_tracker_frame_sight_of(const void *user, const bst_mtt_track *track,
                                         bst_mtt_light *light);

/* Observer's state at mid-exposure from navigation telemetry; false if it is not available. A state
 * on no orbit is extrapolated in a straight line. */
bool bst_tracker_frame_observer(const bst_tracker *tracker, const bst_nav_telemetry *nav,
                                double seconds, bst_od_observer *out);

/* Attitude of a frame and its accuracy. */
typedef struct bst_tracker_attitude {
    bst_attitude_fix fix;
    bst_quat q_cam_from_gcrf;
    double covariance_cam[3][3];
    /* 1 sigma of the attitude's drift rate that no star of this frame shows */
    double rate_sigma_radps;
    bool usable;
} bst_tracker_attitude;

/* ---- attitude/frame_attitude.c ---- */

/* Mid-exposure attitude by telemetry. */
bst_quat bst_tracker_telemetry(const bst_tracker_input *input);
/* Telemetry without the large error that stars have shown. */
bst_quat bst_tracker_refer(const bst_tracker *t, bst_quat q_telemetry);
/* Takes the camera over as calibrated and determines the frame's attitude: from stars, else
 * predicted by the telemetry error filter. */
void bst_tracker_find_attitude(bst_tracker *t, const bst_tracker_input *input,
                               const bst_light *light, int64_t tick, double dt_s,
                               bst_tracker_attitude *out);

/* ---- identify.c ---- */

/* Sets the parameters of comparisons with the catalogue; allocates their memory.
 *
 * Errors:    BST_ERR_MEMORY */
bst_status bst_tracker_identity_create(bst_ctx *ctx, const bst_tracker_config *config,
                                       bst_tracker *t) BST_MUST_CHECK;
/* Saves or restores the latest comparison. A change during a run may switch comparisons on or off:
 * then they begin anew, or what was saved is dropped.
 *
 * Errors:    BST_ERR_FORMAT */
bst_status bst_tracker_identity_archive(bst_tracker *t, bst_archive *archive) BST_MUST_CHECK;
/* Compares the tracks with the catalogue, if it is time, sets the cue's comparison, and updates the
 * clock's offset.
 *
 * Given:     usable  the frame has an attitude */
void bst_tracker_identify(bst_tracker *t, const bst_tracker_input *input, bool usable,
                          const bst_mtt_frame *frame, bst_target_cue *cue);

/* ---- clock_learning.c ---- */

/* Sets the parameters of the clock's offset; allocates its state.
 *
 * Errors:    BST_ERR_CONFIG, BST_ERR_MEMORY */
bst_status bst_tracker_clock_create(bst_ctx *ctx, const bst_tracker_config *config,
                                    bst_tracker *t) BST_MUST_CHECK;
/* Saves or restores the clock's offset; a change during a run may switch its estimation on or off.
 *
 * Errors:    BST_ERR_FORMAT */
bst_status bst_tracker_clock_archive(bst_tracker *t, bst_archive *archive) BST_MUST_CHECK;
/* Estimated offset of the onboard clock, s; 0 without an estimate. */
static inline double bst_tracker_clock_s(const bst_tracker *t) {
    return t->clock ? t->clock->state[0] : 0.0;
}
/* Updates the clock's offset by the detections of tracks of known objects. */
void bst_tracker_learn_clock(bst_tracker *t, const bst_tracker_input *input,
                             const bst_mtt_frame *frame);

#endif
