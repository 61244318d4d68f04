/* Channel tracks: the state of the tracker after one frame. */
#ifndef BORESIGHT_MESSAGES_TRACKS_H
#define BORESIGHT_MESSAGES_TRACKS_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/vec.h"

#define BST_CHANNEL_TRACKS "tracks"

typedef enum bst_track_status {
    BST_TRACK_TENTATIVE = 0,
    BST_TRACK_CONFIRMED,
    BST_TRACK_COASTING, /* confirmed, no detection in the latest frames */
} bst_track_status;

/* Reason why the object of a track is not visible, by its estimated orbit. */
typedef enum bst_track_hidden {
    BST_HIDDEN_NOT = 0,
    BST_HIDDEN_SHADOW,  /* in the Earth's shadow */
    BST_HIDDEN_EARTH,   /* behind the Earth */
    BST_HIDDEN_AWAITED, /* visible again, not yet detected again */
    BST_HIDDEN_DIM,     /* visible, but too faint: distant, or at a large phase angle */
} bst_track_hidden;

typedef struct bst_track {
    int64_t id; /* 1, 2, ...: never reused */
    int32_t status;
    bool target_of_interest;
    bst_vec3 direction_gcrf;  /* unit, geometric */
    bst_vec3 rate_gcrf_radps; /* d(direction)/dt, perpendicular to direction */
    /* covariance of (direction, rate) along two tangent axes e1 = unit(z x d) (or unit(x x d) where
     * hypot(d.x, d.y) < 1e-6), e2 = d x e1: order d1, d2, r1, r2; rad^2, rad^2/s, rad^2/s^2 */
    double covariance[4][4];
    double v_mag;
    double snr;   /* of the latest detection */
    double score; /* log-likelihood ratio of an object against chance associations */
    int32_t hits, misses_in_row;
    int64_t first_tick, last_update_tick;
    double x_px, y_px; /* latest detection, full-sensor coordinates */
    bool uncorrelated; /* confirmed, and neither target nor object of the cue */
    int32_t hidden;    /* bst_track_hidden; not 0: coasting, and it takes a detection only after a
                          separate track at its position and motion has been confirmed */
} bst_track;

/* Attitude from stars, and the resulting error of telemetry. */
typedef struct bst_attitude_fix {
    bool valid;
    int32_t stars;
    int64_t tick;             /* mid-exposure */
    bst_quat q_cam_from_gcrf; /* from stars */
    bst_vec3 error_cam_rad;   /* rotation vector e, camera axes: q_stars = bst_quat_from_rotvec(e) *
                                 q_telemetry */
    double sigma_rad[3];      /* standard deviation about camera x, y, z */
    double correlation[3];    /* of the errors about x and y, x and z, y and z */
    double rms_px;            /* of the star residuals */
    double shared; /* fraction of the variance about camera x and y that successive frames share, 0
                      to 1: errors tied to the stars */
} bst_attitude_fix;

/* tracks (queue): the tracker's state after one frame, valid at `tick` (mid-exposure). */
typedef struct bst_tracks {
    int64_t exposure_id;
    int64_t tick;
    bst_attitude_fix attitude;
    int64_t target_id; /* track of interest, 0 when none */
    /* onboard clock minus true time as learnt from objects' places, and its standard deviation, s;
     * sigma 0: not estimated */
    double clock_offset_s, clock_sigma_s;
    int32_t at_rest; /* number of tracks that do not move relative to the stars; not in items */
    int32_t count, lost;
    bst_track items[];
} bst_tracks;

#endif
