/* Guidance: slews of the boresight to its aim, and prediction of the aim's reachability. */
#ifndef BST_CONTROL_GUIDANCE_GUIDANCE_H
#define BST_CONTROL_GUIDANCE_GUIDANCE_H

#include "boresight/archive.h"
#include "boresight/config.h"
#include "boresight/messages.h"
#include "control/guidance/keep_out.h"
#include "control/guidance/pointing_feasibility.h"
#include "control/guidance/slew.h"

typedef enum bst_guidance_slews {
    BST_SLEWS_MOUNT = 0, /* performed by the mount's servo */
    BST_SLEWS_PLANNED,
} bst_guidance_slews;

/* The "guidance" block of a controller's configuration. */
typedef struct bst_guidance_config {
    double sun_keep_out_deg, moon_keep_out_deg;
    bool earth_keep_out;
    double earth_limb_keep_out_deg, earth_limb_altitude_km;
    int32_t slews;
    double min_planned_slew_deg, limit_fraction;
    double prediction_horizon_s, prediction_interval_s, loss_tolerance_px;
    bool acceleration_feed_forward, body_roll;
} bst_guidance_config;

extern const bst_config_desc bst_guidance_config_table[];

/* Direction of the aim at a tick: unit, apparent, in the frame of the attitude telemetry. */
typedef bst_status (*bst_guidance_aim_fn)(void *user, bst_ctx *ctx, int64_t tick, bool *valid,
                                          bst_vec3 *direction);
/* Range of the aim at a tick, m; 0: unknown. */
typedef bst_status (*bst_guidance_range_fn)(void *user, bst_ctx *ctx, int64_t tick,
                                            double *range_m);

typedef struct bst_guidance_env {
    double tick_rate_hz, pixel_rad;
    bst_guidance_aim_fn aim;
    bst_guidance_range_fn range;
    void *user;
} bst_guidance_env;

typedef enum bst_guidance_event_kind {
    BST_GUIDANCE_UNREACHABLE, /* the aim cannot be reached now */
    BST_GUIDANCE_REACHABLE,   /* the aim can be reached again */
    BST_GUIDANCE_AHEAD,       /* the aim will become unreachable */
    BST_GUIDANCE_LOSS,        /* limits of the mount will lose the aim for a while */
    BST_GUIDANCE_DETOUR,      /* a slew avoids keep-out cones */
    BST_GUIDANCE_NO_WAY,      /* keep-out cones block every path to the aim */
    BST_GUIDANCE_ROLL,        /* the body rolls to keep the aim away from the mount's pole */
} bst_guidance_event_kind;

typedef struct bst_guidance_event {
    int kind;
    int reason;             /* bst_pointing_feasibility */
    double from_s, until_s; /* seconds since the epoch; INFINITY: not within prediction_horizon_s */
    double length_rad;      /* of a detour or a roll */
} bst_guidance_event;

#define BST_GUIDANCE_EVENTS 4 /* most events of one command */

/* A slew in progress. */
typedef struct bst_guidance_slew {
    bool active, along_path; /* along_path: on a path, else axis by axis */
    int64_t start_tick;
    double duration_s;
    bst_vec3 arrival; /* final direction */
    bst_slew_axis axis[BST_MOUNT_AXES];
    bst_keep_out_route path;
    bst_slew_path speed;
} bst_guidance_slew;

typedef struct bst_guidance {
    bst_guidance_config config;
    bst_guidance_env env;
    bst_mount_status mount;
    bool mount_known;
    bst_nav_telemetry nav;                   /* in the frame of the attitude telemetry */
    bst_keep_out_zone zones[BST_ZONE_KINDS]; /* keep-out cones of nav, widened by WIDER_RAD */
    int zone_count;
    bool nav_known;
    bool commanded;
    bst_los_command last;
    bst_guidance_slew slew;
    bst_slew_nodes nodes; /* work space of planning */
    /* chosen mount solution and whole turns */
    bool near_known;
    double near_rad[BST_MOUNT_AXES];
    bst_vec3 near_body; /* body-axes direction for which near_rad was computed; zero: none */
    int reach;          /* bst_pointing_feasibility as last reported */
    bool no_way;        /* reported: keep-out zones block the way to the target */
    int64_t ahead_tick; /* of the next prediction */
    bool roll_given;    /* a roll of the body is commanded */
    double roll_rad;    /* commanded roll */
    double told_from_s, told_until_s; /* predicted loss as last reported; INFINITY: none */
    bst_guidance_event events[BST_GUIDANCE_EVENTS];
    int event_count;
} bst_guidance;

/* Initialises guidance; configuration and environment are copied. */
void bst_guidance_init(bst_guidance *guidance, const bst_guidance_config *config,
                       const bst_guidance_env *env);

/* Saves or restores the state of guidance, for bst_module_desc.archive, with a slew in progress.
 * Events are not saved: the caller clears them after each command.
 *
 * Errors:    BST_ERR_FORMAT for a damaged slew or mount */
bst_status bst_guidance_archive(bst_guidance *guidance, bst_archive *archive) BST_MUST_CHECK;

/* Updates the status of the mount; NULL: no new status. */
void bst_guidance_telemetry(bst_guidance *guidance, const bst_mount_status *mount);

/* Updates keep-out cones and the Earth's direction from navigation.
 *
 * Given:     nav    newest message; the cones hardly move until the next one
 *            error  error of the attitude telemetry, as in bst_pointing_error */
void bst_guidance_see_sky(bst_guidance *guidance, const bst_nav_telemetry *nav, bst_quat error);

/* Replaces the command for the aim by the next command of a slew, if a slew is needed.
 *
 * Given:     boresight  unit vector by telemetry; NULL: unknown
 *            command    points the boresight to the aim at command->tick
 * Returned:  command  the command to send
 *            *give    false: send none, because a slew is needed and the boresight is unknown
 * Errors:    those of the aim's function
 * Notes:     the command stays as it is unless keep-out cones are set, slews are planned or mount
 *            angles must be chosen, and the aim is within a cone or farther than
 * min_planned_slew_deg from the last command (at first from the boresight). When due, the function
 * also predicts the reachability of the aim. Events are appended; the caller clears them
 *            (event_count = 0). */
bst_status bst_guidance_command(bst_ctx *ctx, bst_guidance *guidance, const bst_vec3 *boresight,
                                bst_los_command *command, bool *give) BST_MUST_CHECK;

/* Keep-out cones at the time of `nav` (guidance_state.c).
 *
 * Returned:  number of zones */
int bst_guidance_zones(const bst_guidance *guidance, const bst_nav_telemetry *nav,
                       bst_keep_out_zone zones[BST_ZONE_KINDS]);

/* Body attitude at a tick: the mount's status propagated at its rate, with the commanded roll
 * within its limits. */
bst_quat bst_guidance_body(const bst_guidance *guidance, int64_t tick);

/* Body attitude during a roll, `seconds` after the mount's status (guidance_roll.c). */
bst_quat bst_guidance_rolled(const bst_guidance *guidance, double seconds, double roll_rad);
/* Chooses the smallest roll of the body that lets the mount follow the aim without loss.
 *
 * Given:     problem    the aim and the mount, times in seconds from now
 *            horizon_s  time up to which the aim must be followed, s
 * Returned:  *found  false: no roll does */
bst_status bst_guidance_choose_roll(bst_ctx *ctx, bst_guidance *guidance,
                                    const bst_pointing_feasibility_problem *problem,
                                    double horizon_s, bool *found) BST_MUST_CHECK;

/* Predicts the reachability of the aim for prediction_horizon_s and appends its changes to the
 * events (guidance_ahead.c). */
bst_status bst_guidance_look_ahead(bst_ctx *ctx, bst_guidance *guidance,
                                   int64_t tick) BST_MUST_CHECK;

/* Writes an event in words: "unreachable until 12.3 s: behind the Earth". */
void bst_guidance_describe(const bst_guidance_event *event, char *text, size_t bytes);

#endif
