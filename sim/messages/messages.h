/* The payloads that modules exchange. One struct per channel; the table in messages.c gives each
 * channel its kind.
 *
 * Camera frame: +z boresight, +x along columns (image x), +y along rows (image y), right-handed.
 * Pixel (0, 0) has its centre at (0.0, 0.0). Directions are unit vectors in GCRF axes (ICRS
 * orientation). "Apparent" directions contain stellar aberration of the observer; "geometric" ones
 * have it removed and hold light time. */
#ifndef BST_MESSAGES_MESSAGES_H
#define BST_MESSAGES_MESSAGES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sim/core/frame.h"
#include "sim/core/vec.h"

/* Names of the channels, without their "observer/sensor/" scope. */
#define BST_CHANNEL_SENSOR_COMMAND "sensor_command"
#define BST_CHANNEL_EXPOSURE "exposure"
#define BST_CHANNEL_LOS_COMMAND "los_command"
#define BST_CHANNEL_LOS_HISTORY "los_history"
#define BST_CHANNEL_POINTING_TELEMETRY "pointing_telemetry"
#define BST_CHANNEL_MOUNT_STATUS "mount_status"
#define BST_CHANNEL_NAV_TELEMETRY "nav_telemetry"
#define BST_CHANNEL_FRAME "frame"
#define BST_CHANNEL_TRUTH "truth"
#define BST_CHANNEL_PLANES "planes"
#define BST_CHANNEL_DETECTIONS "detections"
#define BST_CHANNEL_PREDICTIONS "predictions"
#define BST_CHANNEL_TRACKS "tracks"
#define BST_CHANNEL_CONTROL_STATUS "control_status"
#define BST_CHANNEL_TASK "task"

/* A read-out window in full-sensor pixels. */
typedef struct bst_window {
    int x0, y0, width, height;
} bst_window;

/* sensor_command (latest): what control asks of the exposure clock; latched at the next exposure's
 * start. */
typedef struct bst_sensor_command {
    double exposure_s;         /* <= 0: keep */
    double period_s;           /* <= 0: keep */
    bst_window window;         /* width 0: full sensor */
    int binning;               /* 0: keep */
    double pixel_scale_arcsec; /* at the boresight; <= 0: keep */
} bst_sensor_command;

/* exposure (queue): published at the tick at which the exposure ends. */
typedef struct bst_exposure {
    int64_t id;                   /* 0, 1, 2, ... */
    int64_t start_tick, end_tick; /* rolling shutter: of the window's middle row */
    bst_window window;
    int binning;
    bool dropped; /* the frame will be lost on its way: rendered truth is kept, no frame is
                     delivered */
    double pixel_scale_arcsec; /* 0: the camera's */
} bst_exposure;

/* los_history (latest, written in place): ring of the true camera attitude at the plant rate.
 * Sample number n (0, 1, ...) is items[n % capacity]; the newest is number written - 1. */
typedef struct bst_los_sample {
    int64_t tick;
    bst_quat q_cam_from_gcrf;
} bst_los_sample;

typedef struct bst_los_history {
    int64_t written;
    int32_t capacity;
    double jitter_rad2; /* variance of the true line of sight, per axis, about the straight way
                           between samples: motion too fast for them, which widens the PSF */
    bst_los_sample items[];
} bst_los_history;

/* pointing_telemetry (latest, written in place): ring of what encoders and attitude sensors say. */
typedef struct bst_pointing_sample {
    int64_t tick;
    bst_quat q_cam_from_gcrf; /* measured: attitude estimate and encoders */
    double axis_rad[2];       /* encoder readings, outer and inner axis */
} bst_pointing_sample;

typedef struct bst_pointing_telemetry {
    int64_t written;
    int32_t capacity;
    bst_quat q_body_from_gcrf; /* newest body attitude as the spacecraft believes it */
    bool settled;              /* the servo is within its settling tolerance of the command */
    bool limited;              /* an axis is at a rate, acceleration or travel limit */
    bst_pointing_sample items[];
} bst_pointing_telemetry;

enum { BST_MOUNT_AXES = 3 }; /* greatest number of axes of a mount */

enum {
    BST_AXIS_STUCK = 1u << 0,     /* commanded to move and does not */
    BST_AXIS_SATURATED = 1u << 1, /* at its rate, acceleration or torque limit */
    BST_AXIS_AT_STOP = 1u << 2,   /* held by the end of its travel */
};

/* One axis of a mount. Limits are what the mount allows a command to ask of it. */
typedef struct bst_mount_axis {
    bst_vec3 axis_body; /* unit: what it turns about, right-handed, when all angles are zero */
    double angle_rad;   /* encoder, with whole turns: a cable is wound by as much */
    double rate_radps;
    double rate_limit_radps, accel_limit_radps2; /* 0: none */
    double min_rad, max_rad; /* travel; both 0: turns without end, and angle_rad in (-pi, pi] */
    bool redundant; /* not needed to reach a direction: the mount follows its axis_near_rad, or
                       moves it as it sees fit */
    uint32_t flags; /* BST_AXIS_... */
} bst_mount_axis;

/* mount_status (latest): geometry, limits and state of the mount, as far as it is known onboard,
 * at the rate of pointing_telemetry. The attitude of the camera in the body is
 * q_body_from_cam = R(axis 0, angle 0) R(axis 1, angle 1) ... q_body_from_cam_at_zero, axes in
 * order from the body outwards to the camera, R(a, t) the rotation by t about a. */
/* A turn of the body about the axis of its pointing law, which the spacecraft makes on command. */
typedef struct bst_body_roll {
    bst_vec3 axis_body; /* unit; zero: it makes none */
    double angle_rad, rate_radps;
    double rate_limit_radps, accel_limit_radps2;
} bst_body_roll;

typedef struct bst_mount_status {
    int64_t tick; /* of validity */
    int32_t axes; /* 0: follows any command at once (an ideal mount) */
    bool wheels_saturated;
    bst_quat q_body_from_cam_at_zero;
    bst_quat q_body_from_gcrf; /* measured */
    bst_vec3 rate_body_radps;  /* measured inertial rate of the body, body axes */
    bst_body_roll roll;
    bst_mount_axis axis[BST_MOUNT_AXES];
} bst_mount_status;

/* nav_telemetry (latest): what the spacecraft knows of its own orbit. */
typedef struct bst_nav_telemetry {
    int64_t tick;               /* of validity */
    bst_vec3 position_gcrf_m;   /* geocentric */
    bst_vec3 velocity_gcrf_mps; /* geocentric */
    bst_vec3 velocity_bary_mps; /* relative to the solar-system barycentre, for aberration */
    bst_vec3 sun_m;             /* observer to Sun */
    bst_vec3 moon_m;            /* observer to Moon */
} bst_nav_telemetry;

/* los_command (latest): where the boresight shall be, as the onboard attitude knowledge sees it.
 * The command at tick t is the unit vector along direction + rate * dt + acceleration * dt^2 / 2,
 * dt = (t - tick) / tick rate. All zero after the rate: straight on, by the nearest way round. */
typedef struct bst_los_command {
    int64_t tick;                      /* of reference */
    bst_vec3 direction_gcrf;           /* unit, apparent */
    bst_vec3 rate_gcrf_radps;          /* d(direction)/dt, perpendicular to direction */
    bst_vec3 accel_gcrf_radps2;        /* d2(direction)/dt2 */
    bool near_given;                   /* which of the angles that point alike are meant is told: */
    double near_rad[BST_MOUNT_AXES];   /* those next to these (by axis of mount_status), at `tick`;
                                          else those next to the present angles */
    double near_radps[BST_MOUNT_AXES]; /* their rates */
    bool roll_given;                   /* the body is to go to this angle of bst_body_roll: */
    double roll_rad;
} bst_los_command;

/* frame (queue). The channel slot owns one reference of `frame`; NULL: shown to a hook that does
 * not look at the pixels. */
typedef struct bst_frame_message {
    bst_frame *frame;
    int64_t exposure_id;
    int64_t start_tick, end_tick;
    bst_window window;
    int binning;
    int bits; /* 8 to 16 */
} bst_frame_message;

typedef enum bst_source_kind { BST_SOURCE_STAR = 0, BST_SOURCE_OBJECT = 1 } bst_source_kind;

enum {
    BST_TRUTH_IN_FIELD = 1u << 0, /* mean position on the window */
    BST_TRUTH_OCCULTED = 1u << 1, /* behind the Earth */
    BST_TRUTH_SATURATED = 1u << 2,
};

/* One source of the true scene. Pixels are full-sensor coordinates; NAN where behind the camera. */
typedef struct bst_truth_item {
    int32_t kind;  /* bst_source_kind */
    uint32_t id;   /* star: Tycho-2 identity, or statistical (bit 31); object: index in the world */
    int32_t norad; /* object: catalogue number, else 0 */
    uint32_t flags;
    double x_start_px, y_start_px, x_mid_px, y_mid_px, x_end_px, y_end_px;
    /* Means over the exposure, weighted with the source's light in time: of the chief ray, whose
     * the other places are too and whose place the WCS gives; and of the light on the focal plane,
     * which coma and other odd aberrations, the phase of a disc and vignetting move from there. */
    double x_chief_px, y_chief_px, x_centroid_px, y_centroid_px;
    double delay_s; /* rolling shutter: the exposure of the source's own row, whose these places
                       are, has its middle so much later than the header's ticks; else 0 */
    double ra_rad,
        dec_rad; /* ICRS; star: catalogue place at epoch; object: geometric with light time, mid */
    double v_mag;
    double electrons;       /* detected in the exposure, whole PSF */
    double snr;             /* sqrt(sum s^2 / sigma^2), sigma without the source's own light */
    double sunlit_fraction; /* object: of the Sun's disc, mid */
    double phase_rad;       /* object: Sun - object - observer */
    double range_m;         /* object: mid */
} bst_truth_item;

/* truth (queue): the true scene of one exposure. */
typedef struct bst_truth {
    int64_t exposure_id;
    int64_t start_tick, end_tick;
    bool dropped;
    bst_quat q_cam_from_gcrf_mid;  /* at the middle of the exposure, jitter included */
    bst_quat q_cam_from_gcrf_mean; /* averaged over the exposure, so that it shows stars at their
                                      mean places: the attitude of the header's WCS */
    bst_vec3 observer_gcrf_m, observer_gcrf_mps; /* mid */
    bst_vec3 velocity_bary_mps;            /* mid; with sun_m it gives the light's corrections */
    bst_vec3 sun_m;                        /* observer to Sun, mid */
    double boresight_x_px, boresight_y_px; /* where the boresight meets the focal plane */
    double background_e, dark_e;           /* expected electrons per pixel */
    double earth_fraction, moon_fraction, sun_fraction; /* of the window's area that their discs
                                                           cover, 0 to 1 */
    double hits_e;      /* charge of the radiation hits on the sensor, electrons */
    int32_t hits;       /* radiation hits */
    double error_sigma; /* largest error of the image expected in any pixel, in its noise; NAN: not
                           foreseen */
    int64_t nodes;      /* points that the sources' tracks became */
    bool one_track;     /* the stars followed one track */
    double pixel_scale_arcsec; /* of this exposure */
    int32_t count, lost;       /* items; sources that found no room */
    bst_truth_item items[];
} bst_truth;

/* Images of a frame that no detector took. */
typedef enum bst_plane {
    BST_PLANE_STARS = 0,
    BST_PLANE_TARGETS,
    BST_PLANE_BACKGROUND,
    BST_PLANE_SEGMENTATION,
    BST_PLANE_SATURATION,
    BST_PLANE_COUNT
} bst_plane;

/* planes (latest): expected electrons per pixel of the frame written in the same step, from stars,
 * from objects, and from sky and dark current; who each pixel belongs to; and whether it is
 * saturated. Only for hooks of the engine: the images are their writer's, and are written over in
 * its next step. */
typedef struct bst_planes {
    int64_t exposure_id;
    int width, height;                              /* of the frame: its window over its binning */
    const float *electrons[BST_PLANE_SEGMENTATION]; /* [height][width] by bst_plane; NULL: not
                                                       asked for */
    const int32_t *segmentation; /* [height][width]: 0, or 1 + number of the item of `truth` that
                                    gives most light there; NULL: not asked for */
    const uint8_t *saturation;   /* [height][width]: 0, or 1: the well is full (one of those that
                                    were added), 2: the converter is at its top, 3: both; NULL: not
                                    asked for */
} bst_planes;

typedef enum bst_label {
    BST_LABEL_UNKNOWN = 0,
    BST_LABEL_STAR,   /* identified in the onboard catalogue; without star_id: at rest among them */
    BST_LABEL_OBJECT, /* not a star: moves, or no catalogue star is there */
    BST_LABEL_ARTEFACT,  /* cut by the edge, spike of a bright star, no source's shape */
    BST_LABEL_HOT_PIXEL, /* sharper than the PSF, at the same pixel again, or one pixel alone */
    BST_LABEL_HIT,       /* radiation: sharper than the PSF, in this frame only */
} bst_label;

enum {
    BST_DETECTION_SATURATED = 1u << 0,
    BST_DETECTION_EDGE = 1u << 1,
    BST_DETECTION_STREAK = 1u << 2, /* elongated beyond the PSF */
    BST_DETECTION_BLEND = 1u << 3,
    BST_DETECTION_BLOOM = 1u << 5, /* charge overflowed along its columns: placed by its wings */
    BST_DETECTION_STACK = 1u << 4, /* seen in the sum of several frames, this one the last */
};

typedef struct bst_detection {
    double x_px, y_px;             /* full-sensor coordinates, mid-exposure centroid */
    double cov_xx, cov_xy, cov_yy; /* px^2 */
    double flux_e, flux_sigma_e;
    double snr;
    double length_px, width_px, angle_rad; /* extent; angle of the long axis from +x towards +y */
    double v_mag;                          /* from flux and zero point */
    double v_mag_sigma; /* of the flux's noise and the zero point; INFINITY without light */
    uint32_t flags;
    uint32_t star_id;         /* Tycho-2 identity, 0 when none */
    int32_t label;            /* bst_label */
    double label_probability; /* that the label is right, 0 to 1; 0 where the label is UNKNOWN */
    double rate_x_pxps, rate_y_pxps; /* against the stars; only of BST_DETECTION_STACK, else 0 */
    double rate_sigma_pxps;          /* of each */
} bst_detection;

/* detections (queue): what image processing (or the generator) found in one frame. */
typedef struct bst_detections {
    int64_t exposure_id;
    int64_t start_tick, end_tick;
    bst_quat q_cam_from_gcrf;       /* onboard attitude used for star identification, mid-exposure:
                                       telemetry with the       tracker's predicted correction */
    bst_quat q_telemetry_from_gcrf; /* telemetry alone, mid-exposure */
    double background_e, noise_e;   /* median per pixel */
    double threshold_snr;
    /* V of one electron per second, by zero_point_stars of the frame's stars; when these are 0, by
     * the camera's own figures */
    double zero_point_mag, zero_point_sigma_mag;
    int32_t zero_point_stars;
    int32_t stars_identified;
    int32_t windows; /* of the frame that were looked at, round predicted places; 0: all of it */
    int32_t count, lost; /* items; detections that found no room */
    int32_t bad_pixels;  /* of the sensor, that image processing has learned so far */
    bst_detection items[];
} bst_detections;

typedef enum bst_track_status {
    BST_TRACK_TENTATIVE = 0,
    BST_TRACK_CONFIRMED,
    BST_TRACK_COASTING, /* confirmed, no detection in the latest frames */
} bst_track_status;

/* What keeps a track's object from being seen, as its believed orbit has it. */
typedef enum bst_track_hidden {
    BST_HIDDEN_NOT = 0,
    BST_HIDDEN_SHADOW,  /* in the Earth's shadow */
    BST_HIDDEN_EARTH,   /* behind the Earth */
    BST_HIDDEN_AWAITED, /* nothing any more, but it has not been seen again yet */
    BST_HIDDEN_DIM,     /* nothing, but it is too dim: far away, or lit from behind */
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
    double score; /* log-likelihood ratio of an object against chance pairings of detections */
    int32_t hits, misses_in_row;
    int64_t first_tick, last_update_tick;
    double x_px, y_px; /* latest detection, full-sensor coordinates */
    bool uncorrelated; /* confirmed, and neither the target nor what the cue expects */
    int32_t hidden;    /* bst_track_hidden; other than 0: coasting, and no detection is taken for it
                          before one of its place and motion has been confirmed on its own */
} bst_track;

/* Attitude from stars, and the telemetry's error that follows from it. */
typedef struct bst_attitude_fix {
    bool valid;
    int32_t stars;
    int64_t tick;             /* mid-exposure */
    bst_quat q_cam_from_gcrf; /* from stars */
    bst_vec3 error_cam_rad;   /* rotation vector e, camera axes: q_stars = bst_quat_from_rotvec(e) *
                                 q_telemetry */
    double sigma_rad[3];      /* standard deviation about camera x, y, z */
    double rms_px;            /* of the star residuals */
    double shared; /* share of the variance about camera x and y that successive frames have in
                      common, 0 to 1: errors that stay with the stars */
} bst_attitude_fix;

/* tracks (queue): the tracker's state after one frame, valid at `tick` (mid-exposure). */
typedef struct bst_tracks {
    int64_t exposure_id;
    int64_t tick;
    bst_attitude_fix attitude;
    int64_t target_id; /* track of interest, 0 when none */
    int32_t at_rest;   /* followed but not told: at rest among the stars, as a star is */
    int32_t count, lost;
    bst_track items[];
} bst_tracks;

typedef struct bst_prediction {
    int64_t track_id;
    bst_vec3 direction_gcrf; /* geometric, at the header's tick */
    bst_vec3 rate_gcrf_radps;
    double sigma_rad;
    bool target_of_interest;
} bst_prediction;

/* predictions (latest): the tracker's help for image processing of later frames. */
typedef struct bst_predictions {
    int64_t tick; /* of validity */
    bool attitude_valid;
    bst_vec3 attitude_error_cam_rad; /* as in bst_attitude_fix, filtered */
    bst_vec3 attitude_error_rate_cam_radps;
    int32_t count, lost;
    bst_prediction items[];
} bst_predictions;

typedef enum bst_mode {
    BST_MODE_IDLE = 0,
    BST_MODE_SLEW,    /* to the cue */
    BST_MODE_SEARCH,  /* step-stare pattern about the cue */
    BST_MODE_ACQUIRE, /* a candidate is being centred and confirmed */
    BST_MODE_TRACK,
    BST_MODE_REACQUIRE, /* target lost: predicted place, then search about it */
    BST_MODE_STARE,     /* open loop, inertial */
    BST_MODE_RATE,      /* open loop, on the cue */
    BST_MODE_COAST,     /* on the prediction of a target that cannot be seen */
    BST_MODE_FIXED,     /* open loop, a direction held in inertial space or in the body */
    BST_MODE_SCAN,      /* open loop, along an arc at a constant rate */
    BST_MODE_COUNT
} bst_mode;

/* control_status (latest): for the record, the progress line and the evaluator. */
typedef struct bst_control_status {
    int64_t tick;
    int32_t mode; /* bst_mode */
    int64_t target_id;
    int32_t search_step;
    double aim_error_px[2]; /* as control believes: where the target is from the boresight */
} bst_control_status;

/* How a task ended. */
typedef enum bst_task_end {
    BST_TASK_NONE = 0,  /* there was none, or it was the own cue */
    BST_TASK_DONE,      /* the target was seen as often as it was to be */
    BST_TASK_NOT_FOUND, /* it was not found in time */
    BST_TASK_LOST,      /* it was found, and not seen any more */
    BST_TASK_END_COUNT
} bst_task_end;

/* task (latest): whom a sensor is to look for from now on, from who plans for several. Before the
 * first one, and with object -1, it is the sensor's own cue. */
typedef struct bst_task {
    int64_t id;     /* 1, 2, ... by sensor: what follows a new one begins anew; 0: none was given */
    int64_t tick;   /* when it was given */
    int32_t object; /* in the onboard catalogue (bst_knowledge_object_count), -1: the own cue */
    int32_t norad;  /* its catalogue number, 0: none */
    double sigma_rad, rate_sigma_radps; /* how far its place and rate may be off, 1 sigma per axis;
                                           0: as the own cue's */
    double v_mag, v_mag_sigma;          /* brightness to be expected; sigma 0: as the own cue's */
    double snr;                         /* expected of a frame, 0: not known */
    int32_t before;                     /* bst_task_end of the task before this one */
} bst_task;

/* "track" for BST_MODE_TRACK, and so on. */
const char *bst_mode_name(int mode);
/* "done" for BST_TASK_DONE, and so on. */
const char *bst_task_end_name(int end);

typedef enum bst_channel_kind { BST_CHANNEL_LATEST, BST_CHANNEL_QUEUE } bst_channel_kind;

/* How a channel stores its payload: `header_bytes` then `capacity` items of `item_bytes`. */
typedef struct bst_channel_type {
    const char *name;
    bst_channel_kind kind;
    size_t header_bytes;
    size_t item_bytes; /* 0: no items */
    bool in_place;     /* a ring that its writer extends in place: cannot be read with a delay */
    void (*release)(
        void *payload); /* lets go of what a slot owns before it is written again; may be NULL */
    void (*retain)(void *payload); /* makes a copy of the payload own the same; with release */
    bool lends; /* the payload points to memory of its writer that the next message overwrites */
    int (*count)(const void *payload); /* items in use, the first ones; NULL: any may be */
} bst_channel_type;

/* The type of a channel by its unscoped name; NULL when there is none. */
const bst_channel_type *bst_channel_type_find(const char *name);

/* Which modules write a channel, for messages: "gimbal", "imgproc or obsgen"; NULL for channels
 * that every sensor has, and for unknown names. */
const char *bst_channel_writers(const char *name);

#endif
