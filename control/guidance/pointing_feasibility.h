/* What cannot be pointed at or followed, why, and when it can be. */
#ifndef BST_CONTROL_GUIDANCE_POINTING_FEASIBILITY_H
#define BST_CONTROL_GUIDANCE_POINTING_FEASIBILITY_H

#include "boresight/status.h"
#include "control/guidance/keep_out.h"
#include "control/guidance/mount_inverse_kinematics.h"

typedef enum bst_pointing_feasibility {
    BST_REACH_OK = 0,
    BST_REACH_NO_CUE,
    BST_REACH_BEHIND_EARTH,
    BST_REACH_SUN, /* in a keep-out cone */
    BST_REACH_MOON,
    BST_REACH_EARTH,
    BST_REACH_TRAVEL,  /* outside of the mount's travel */
    BST_REACH_RATE,    /* faster than an axis turns */
    BST_REACH_ACCEL,   /* speeding up faster than an axis does */
    BST_REACH_KEYHOLE, /* the same, but only because the pole is near */
    BST_REACH_COUNT
} bst_pointing_feasibility;

/* "in the keep-out cone of the Sun" for BST_REACH_SUN, and so on. */
const char *bst_pointing_feasibility_reason(int reach);

/* What is expected at one time. */
typedef struct bst_pointing_feasibility_look {
    bool valid; /* false: there is no cue then */
    bst_vec3 direction_gcrf;
    double range_m;      /* 0: not known, then nothing is behind the Earth */
    bst_vec3 position_m; /* of the observer, geocentric */
    bst_quat q_body_from_gcrf;
    int zone_count;
    bst_keep_out_zone zones[BST_ZONE_KINDS];
} bst_pointing_feasibility_look;

typedef bst_status (*bst_pointing_feasibility_fn)(void *user, bst_ctx *ctx, double seconds,
                                                  bst_pointing_feasibility_look *out);

typedef struct bst_pointing_feasibility_problem {
    bst_pointing_feasibility_fn look;
    void *user;
    const bst_mount_status *mount; /* NULL: one that follows at once */
    double limit_fraction;         /* of the rate and acceleration limits that may be used */
} bst_pointing_feasibility_problem;

/* Whether what is expected at a time can be followed there, or the first reason in the order of
 * bst_pointing_feasibility why not. Rates and accelerations of the axes are those of the
 * differences over 0.1 s.
 */
bst_status bst_pointing_feasibility_at(bst_ctx *ctx,
                                       const bst_pointing_feasibility_problem *problem,
                                       double seconds,
                                       bst_pointing_feasibility *out) BST_MUST_CHECK;

/* What is looked for: a time from from_s to horizon_s later, in steps of step_s, at which
 * bst_pointing_feasibility_at says OK (wanted) or something else (not wanted). */
typedef struct bst_pointing_feasibility_search {
    double from_s, horizon_s, step_s;
    bool wanted;
} bst_pointing_feasibility_search;

typedef struct bst_pointing_feasibility_change {
    bool found;                   /* false: there is none, and the rest is not set */
    double when_s;                /* to 0.01 s */
    bst_pointing_feasibility why; /* then */
} bst_pointing_feasibility_change;

/* The first such time. Changes shorter than a step may be missed. */
bst_status bst_pointing_feasibility_next(bst_ctx *ctx,
                                         const bst_pointing_feasibility_problem *problem,
                                         const bst_pointing_feasibility_search *search,
                                         bst_pointing_feasibility_change *out) BST_MUST_CHECK;

/* A time in which the boresight is off by more than the tolerance. */
typedef struct bst_pointing_feasibility_loss {
    double from_s, until_s; /* INFINITY: not by the end */
    double worst_rad;
} bst_pointing_feasibility_loss;

/* A span of time to follow, and how far off the boresight may be. */
typedef struct bst_pointing_feasibility_span {
    double from_s, until_s, tolerance_rad;
} bst_pointing_feasibility_span;

/* Follows what is expected in a span with axes that keep their limits, from perfectly on it: each
 * axis heads for the nearest angle within travel, at full rate, braking at the last moment that 0.8
 * of the acceleration allow, as the mounts do. What is lost by a keyhole or by limits is lost from,
 * and back at, those times. Ends after `most` losses; finds none for a mount with a redundant axis,
 * which is taken to pass its pole. */
bst_status bst_pointing_feasibility_chase(bst_ctx *ctx,
                                          const bst_pointing_feasibility_problem *problem,
                                          const bst_pointing_feasibility_span *span,
                                          bst_pointing_feasibility_loss *losses, int most,
                                          int *count) BST_MUST_CHECK;

#endif
