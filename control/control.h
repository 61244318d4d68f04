/* The standard controller: acquires the target, keeps the boresight on it, and reacquires it after
 * a loss. */
#ifndef BST_CONTROL_CONTROL_H
#define BST_CONTROL_CONTROL_H

#include "boresight/config.h"
#include "boresight/messages.h"
#include "control/guidance/guidance.h"
#include "control/loop/image_loop.h"
#include "control/loop/model_error.h"
#include "control/loop/pointing_error.h"
#include "control/modes/search_pattern.h"
#include "sim/core/memo.h"
#include "sim/core/quintic.h"
#include "sim/onboard/knowledge.h"

typedef enum bst_control_strategy {
    BST_CONTROL_TRACK = 0, /* closed loop on the tracked target */
    BST_CONTROL_STARE,     /* inertially fixed at the cue's direction at stare_time_s */
    BST_CONTROL_RATE,      /* open loop along the cue */
    BST_CONTROL_FIXED,     /* fixed direction, inertial or in body axes */
    BST_CONTROL_SCAN,      /* along the centre line of the cue's region at a constant rate */
} bst_control_strategy;

/* Motion of the boresight while it dwells on a tile of a region. */
typedef enum bst_control_dwell_rate {
    BST_CONTROL_RATE_BELT = 0,
    BST_CONTROL_RATE_SIDEREAL,
} bst_control_dwell_rate;

typedef enum bst_control_fixed_frame {
    BST_CONTROL_FIXED_INERTIAL = 0,
    BST_CONTROL_FIXED_BODY,
} bst_control_fixed_frame;

/* An exposure time asked of the sensor from a time on. */
typedef struct bst_control_exposure {
    double time_s; /* after the epoch */
    double exposure_s;
} bst_control_exposure;

typedef struct bst_control_config {
    int32_t strategy;
    double stare_time_s;
    int32_t fixed_frame; /* bst_control_fixed_frame */
    double fixed_direction[3];
    double scan_rate_arcsec_per_s;
    double exposure_s, period_s;
    bst_config_list exposure_schedule; /* of bst_control_exposure, time_s ascending */
    double command_latency_s;
    bool compensate_attitude;
    bst_compensator_config compensator; /* for BST_CONTROL_OBSERVER: pointing_error's own */
    double servo_lag_s;
    bool robust_observer;
    double disturbance_px_rms, disturbance_cutoff_hz;
    double fix_sigma_floor_px;
    double attitude_sigma_arcsec, drift_sigma_arcsec_per_s;
    double arrival_tolerance_px;
    int32_t search_pattern; /* bst_search_pattern */
    int32_t search_rate;    /* bst_control_dwell_rate */
    double search_sigmas, search_max_deg, search_step, search_timeout_s;
    int64_t dwell_frames;
    double dwell_timeout_s;
    int64_t candidate_hits;
    double candidate_rate_sigmas, candidate_score;
    double acquire_timeout_s, track_handover_px;
    double reacquire_coast_s, reacquire_extent_deg;
    int32_t attitude;          /* at the start, 0: by telemetry, 1: unknown */
    int64_t lost_after_frames; /* without an attitude from stars, in a row; 0: never lost */
    bool lost_hold;            /* the line of sight is held at rest meanwhile */
    bst_guidance_config guidance;
} bst_control_config;

extern const bst_config_desc bst_control_config_table[];

/* Cue at `seconds` after the epoch. */
typedef bst_status (*bst_control_cue_fn)(void *user, bst_ctx *ctx, double seconds,
                                         bst_onboard_cue *out);
/* Direction of the cue only. */
typedef bst_status (*bst_control_cue_direction_fn)(void *user, bst_ctx *ctx, double seconds,
                                                   bool *valid, bst_vec3 *direction);

/* Range of the cue's object, m; 0: unknown. */
typedef bst_status (*bst_control_cue_range_fn)(void *user, bst_ctx *ctx, double seconds,
                                               double *range_m);

/* Direction of a point of the region (bst_knowledge_region_direction_at). */
typedef bst_status (*bst_control_region_fn)(void *user, bst_ctx *ctx, double seconds,
                                            double along_rad, double across_rad,
                                            bst_vec3 *direction);
/* Observer's position for the belt (bst_knowledge_belt_eye_at). */
typedef bst_status (*bst_control_belt_eye_fn)(void *user, bst_ctx *ctx, double seconds, bool *known,
                                              bst_belt_eye *eye);

/* Environment of a controller: its inputs besides messages. */
typedef struct bst_control_env {
    double tick_rate_hz;
    double pixel_rad;
    /* rotation of the image axes about the boresight, from camera +x towards +y */
    double rotation_rad;
    int width_px, height_px;                                  /* field of view, undistorted */
    double frame_exposure_s, frame_period_s, frame_latency_s; /* as in bst_module_env */
    bst_control_cue_fn cue_at;
    bst_control_cue_direction_fn cue_direction_at;
    bst_control_cue_range_fn cue_range_at; /* NULL: range unknown */
    bst_region region; /* kind BST_REGION_NONE: no region, and the next two may be NULL */
    bst_control_region_fn region_at;
    bst_control_belt_eye_fn belt_eye_at;
    void *cue_user;
    bst_memo *memo; /* of what simulations share; NULL: none */
} bst_control_env;

typedef struct bst_control_transition {
    int from, to; /* bst_mode */
    const char *reason;
} bst_control_transition;

/* A track as of its latest message, held as the aim. */
typedef struct bst_control_held {
    int64_t id, tick;
    bst_vec3 direction_gcrf, rate_gcrf_radps; /* geometric */
    bst_onboard_cue cue;                      /* cue at that time */
} bst_control_held;

/* Latest cues, to detect the end and jumps of the cue. */
typedef struct bst_control_watch {
    int count; /* number of directions below, newest first: 0 to 2 */
    int64_t tick, tick_before;
    bst_vec3 direction, direction_before;
    bool ended;        /* the cue was valid and is no longer */
    int64_t jump_tick; /* tick of its latest jump */
} bst_control_watch;

#define BST_CONTROL_TRANSITIONS 4 /* most transitions in one observe and one update */

/* A cached aim: each tick is needed several times, for a command and for the differences that give
 * its rate. */
typedef struct bst_control_aimed {
    bool known, valid;
    int64_t tick;
    int64_t nav_tick;        /* of the navigation telemetry that gave the velocity for aberration */
    bst_vec3 boresight_gcrf; /* bst_control_boresight_at */
} bst_control_aimed;

#define BST_CONTROL_AIMED 128

/* Path of the boresight over rate_half_ticks: quintic through six aims at this spacing. */
typedef struct bst_control_piece {
    bool made, smooth;
    int64_t index; /* start, in units of rate_half_ticks */
    int64_t nav_tick;
    bst_vec3 way[BST_QUINTIC_POINTS];
} bst_control_piece;

#define BST_CONTROL_PIECES 8

typedef struct bst_control {
    bst_control_config config;
    bst_control_env env;
    int64_t latency_ticks, rate_half_ticks;
    bst_pointing_error pointing_error;
    bst_image_loop image_loop;   /* sets pointing_error, unless the compensator is the observer */
    bst_model_error model_error; /* of the observer */
    int mode;
    int64_t mode_tick;               /* start of the mode */
    bool attitude_found;             /* from stars, since the start or the latest loss */
    int64_t frames_without_attitude; /* at rest, in a row */
    bst_control_transition transitions[BST_CONTROL_TRANSITIONS];
    int transition_count;
    bst_nav_telemetry nav;
    bst_light_aberration aberration; /* by nav, once it is valid */
    bool nav_valid;
    bst_control_held held; /* track that defines the aim */
    bst_control_held lost; /* target sought by BST_MODE_REACQUIRE */
    int64_t lost_tick;     /* time of the loss */
    bst_control_watch watch;
    int64_t search_since_tick; /* start of the current search, including failed candidates */
    bool gave_up;
    int64_t target_id;   /* 0: the tracker reports no target */
    int64_t rejected_id; /* candidates up to this identity were rejected */
    int64_t newest_id;   /* largest track identity so far */
    /* mid-exposure of the newest frame; shortest interval, 0: none */
    int64_t frame_tick, frame_interval_ticks;
    /* search about the cue or the lost target */
    bst_search search;
    int32_t search_step;
    int search_mode; /* BST_MODE_SEARCH or BST_MODE_REACQUIRE: mode after a failed acquisition */
    bool search_in_region; /* tiles are angles of the cue's region */
    /* tile of the region that the boresight does not follow: direction at tile_tick, and rate */
    bst_vec3 tile_gcrf, tile_rate_radps;
    bst_vec3 search_x_gcrf; /* image x axis in GCRF at the start of the search */
    int64_t tile_tick;      /* time of the tile's command */
    int64_t arrival_tick;   /* time at which the boresight settled on it; < 0: not yet */
    int64_t frames;         /* frames since then */
    /* newest telemetry */
    bst_pointing_sample pointing;
    bool pointing_valid, settled;
    /* newest body attitude, and its smoothed rate, body axes */
    bst_quat q_body_from_gcrf;
    int64_t body_tick;
    bst_vec3 body_rate_radps;
    bst_vec3 rest_gcrf; /* apparent direction held in BST_MODE_LOST, in the telemetry's axes */
    bool rest_valid;
    bst_vec3 stare_gcrf;
    bool stare_valid;
    bst_guidance guidance;
    /* caches, valid until one of their inputs changes */
    bst_control_aimed aimed[BST_CONTROL_AIMED];
    bst_control_piece pieces[BST_CONTROL_PIECES]; /* by index modulo their number */
} bst_control;

/* Disturbance density (rad^2/s^3) for the observer's gains: the configured one, or with
 * robust_observer the one that bst_observer_design permits.
 *
 * Given:     timing  of the loop; command and servo delays are the configuration's
 *            memo    as in bst_observer_design
 * Errors:    BST_ERR_CONFIG for a gain_scale of 0; those of bst_observer_design */
bst_status bst_control_observer_density(bst_ctx *ctx, const bst_control_config *config,
                                        const bst_image_loop_env *timing, double pixel_rad,
                                        bst_memo *memo, double *density) BST_MUST_CHECK;

/* Initialises a controller; config and env are copied. The struct must not be moved afterwards.
 * Errors: BST_ERR_CONFIG for inconsistent settings. */
bst_status bst_control_init(bst_ctx *ctx, bst_control *control, const bst_control_config *config,
                            const bst_control_env *env) BST_MUST_CHECK;

/* Saves or restores the state of a controller, for bst_module_desc.archive. Transitions and events
 * are not saved: the caller clears them after each update.
 *
 * Errors:    those of bst_guidance_archive and bst_image_loop_archive */
bst_status bst_control_archive(bst_control *control, bst_archive *archive) BST_MUST_CHECK;

/* Updates the controller with telemetry; NULL: no new message. */
void bst_control_telemetry(bst_control *control, const bst_pointing_telemetry *pointing,
                           const bst_nav_telemetry *nav);

/* Processes the tracker's message about a frame: attitude fix, target, candidates.
 *
 * Given:     tick  now */
bst_status bst_control_observe(bst_ctx *ctx, bst_control *control, int64_t tick,
                               const bst_tracks *tracks) BST_MUST_CHECK;

/* Switches to a new cue (env.cue_at and so on already give it) with a new region or none. Held
 * tracks, the search and rejections are cleared; existing tracks are no candidates. */
void bst_control_retarget(bst_control *control, int64_t tick, const bst_region *region);

/* Runs the mode logic at `tick` and computes the pointing command and status.
 *
 * Returned:  *commanded  false, with *command unchanged, if there is no aim or no navigation
 *                        telemetry yet */
bst_status bst_control_update(bst_ctx *ctx, bst_control *control, int64_t tick, bool *commanded,
                              bst_los_command *command, bst_control_status *status) BST_MUST_CHECK;

/* Geometric direction (unit, GCRF) of the aim at a tick.
 *
 * Returned:  *valid  false: there is no aim */
bst_status bst_control_aim(bst_ctx *ctx, const bst_control *control, int64_t tick, bool *valid,
                           bst_vec3 *direction) BST_MUST_CHECK;

#endif
