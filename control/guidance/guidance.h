/* Guidance: how the boresight gets to where control wants it, and what it can expect there. */
#ifndef BST_CONTROL_GUIDANCE_GUIDANCE_H
#define BST_CONTROL_GUIDANCE_GUIDANCE_H

#include "boresight/config.h"
#include "boresight/messages.h"
#include "control/guidance/keep_out.h"
#include "control/guidance/pointing_feasibility.h"
#include "control/guidance/slew.h"

typedef enum bst_guidance_slews {
    BST_SLEWS_MOUNT = 0, /* the mount gets there by itself */
    BST_SLEWS_PLANNED,
} bst_guidance_slews;

/* The "guidance" block of a controller's configuration. */
typedef struct bst_guidance_config {
    double sun_keep_out_deg, moon_keep_out_deg;
    bool earth_keep_out;
    double earth_limb_keep_out_deg, earth_limb_altitude_km;
    int32_t slews;
    double slew_above_deg, limits_share;
    double look_ahead_s, look_ahead_every_s, loss_tolerance_px;
    bool acceleration, body_roll;
} bst_guidance_config;

extern const bst_config_desc bst_guidance_config_table[];

/* What is to be pointed at, at any tick: unit, apparent, as the attitude telemetry sees it. */
typedef bst_status (*bst_guidance_aim_fn)(void *user, bst_ctx *ctx, int64_t tick, bool *valid,
                                          bst_vec3 *direction);
/* Its range; 0: not known. */
typedef bst_status (*bst_guidance_range_fn)(void *user, bst_ctx *ctx, int64_t tick,
                                            double *range_m);

typedef struct bst_guidance_env {
    double tick_rate_hz, pixel_rad;
    bst_guidance_aim_fn aim;
    bst_guidance_range_fn range;
    void *user;
} bst_guidance_env;

typedef enum bst_guidance_event_kind {
    BST_GUIDANCE_UNREACHABLE, /* what is to be pointed at cannot be, now */
    BST_GUIDANCE_REACHABLE,   /* it can be again */
    BST_GUIDANCE_AHEAD,       /* it will not be reachable */
    BST_GUIDANCE_LOSS,        /* it will be lost for a while by the mount's limits */
    BST_GUIDANCE_DETOUR,      /* a slew goes round keep-out cones */
    BST_GUIDANCE_NO_WAY,      /* keep-out cones leave no way there */
    BST_GUIDANCE_ROLL,        /* the body rolls out of the way of the pole */
} bst_guidance_event_kind;

typedef struct bst_guidance_event {
    int kind;
    int reason;             /* bst_pointing_feasibility */
    double from_s, until_s; /* seconds since the epoch; INFINITY: not within look_ahead_s */
    double length_rad;      /* of a detour, a roll */
} bst_guidance_event;

#define BST_GUIDANCE_EVENTS 4 /* greatest number in one command */

/* A slew under way. */
typedef struct bst_guidance_slew {
    bool active, along_path; /* else by axis */
    int64_t start_tick;
    double duration_s;
    bst_vec3 arrival; /* where it ends */
    bst_slew_axis axis[BST_MOUNT_AXES];
    bst_keep_out_route path;
    bst_slew_path speed;
} bst_guidance_slew;

typedef struct bst_guidance {
    bst_guidance_config config;
    bst_guidance_env env;
    bst_mount_status mount;
    bool mount_known;
    bst_nav_telemetry nav;                   /* as the attitude telemetry sees it */
    bst_keep_out_zone zones[BST_ZONE_KINDS]; /* of nav, WIDER_RAD wider */
    int zone_count;
    bool nav_known;
    bool commanded;
    bst_los_command last;
    bst_guidance_slew slew;
    bst_slew_nodes nodes; /* work space of planning */
    /* the way of pointing and turn that were chosen */
    bool near_known;
    double near_rad[BST_MOUNT_AXES];
    bst_vec3 near_body; /* direction in body axes that near_rad was worked out for; zero: none */
    int reach;          /* bst_pointing_feasibility, as last told */
    bool no_way;        /* told */
    int64_t ahead_tick; /* of the next look ahead */
    bool roll_given;    /* the body has been asked for */
    double roll_rad;    /* this roll */
    double told_from_s, told_until_s; /* the loss ahead that was told; INFINITY: none */
    bst_guidance_event events[BST_GUIDANCE_EVENTS];
    int event_count;
} bst_guidance;

void bst_guidance_init(bst_guidance *guidance, const bst_guidance_config *config,
                       const bst_guidance_env *env);

/* Takes in the mount's newest status (NULL: nothing new). */
void bst_guidance_telemetry(bst_guidance *guidance, const bst_mount_status *mount);

/* Takes in navigation's newest message: where cones and the Earth are, by an attitude telemetry
 * with this error (as bst_pointing_error has it). They hardly move between two messages. */
void bst_guidance_see_sky(bst_guidance *guidance, const bst_nav_telemetry *nav, bst_quat error);

/* Turns the command that would put the boresight on the aim at command->tick into the one to give:
 * itself, unless keep-out cones are set, slews planned or turns to be chosen, and it is farther
 * than slew_above_deg from the last command (at first: from the present boresight) or within a
 * cone. `boresight`: unit, the telemetry's, NULL when there is none yet: then a slew cannot be
 * planned, and *give is false: there is to be no command. Looks ahead when that is due; what is
 * found is in events, which the caller empties (event_count = 0). */
bst_status bst_guidance_command(bst_ctx *ctx, bst_guidance *guidance, const bst_vec3 *boresight,
                                bst_los_command *command, bool *give) BST_MUST_CHECK;

/* guidance_state.c: the cones of keep-out at present. */
int bst_guidance_zones(const bst_guidance *guidance, const bst_nav_telemetry *nav,
                       bst_keep_out_zone zones[BST_ZONE_KINDS]);

/* Body attitude by the mount's status carried to a tick: at its rate, the roll that it was asked
 * for within its limits. */
bst_quat bst_guidance_body(const bst_guidance *guidance, int64_t tick);

/* guidance_roll.c: the body `seconds` after the mount's status, on its way to a roll. */
bst_quat bst_guidance_rolled(const bst_guidance *guidance, double seconds, double roll_rad);
/* Chooses the least roll of the body by which what `problem` expects (seconds from now) can be
 * followed up to horizon_s without loss; *found false: there is none. */
bst_status bst_guidance_choose_roll(bst_ctx *ctx, bst_guidance *guidance,
                                    const bst_pointing_feasibility_problem *problem,
                                    double horizon_s, bool *found) BST_MUST_CHECK;

/* guidance_ahead.c: looks look_ahead_s ahead of `tick` and notes what changes as events. */
bst_status bst_guidance_look_ahead(bst_ctx *ctx, bst_guidance *guidance,
                                   int64_t tick) BST_MUST_CHECK;

/* The event in words: "unreachable until 12.3 s: behind the Earth". */
void bst_guidance_describe(const bst_guidance_event *event, char *text, size_t bytes);

#endif
