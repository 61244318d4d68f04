/* Pointing feasibility: whether a direction can be reached and followed, why not, and when. */
#ifndef BST_CONTROL_GUIDANCE_POINTING_FEASIBILITY_H
#define BST_CONTROL_GUIDANCE_POINTING_FEASIBILITY_H

#include "boresight/status.h"
#include "control/guidance/keep_out.h"
#include "control/guidance/mount_inverse_kinematics.h"

typedef enum bst_pointing_feasibility {
    BST_REACH_OK = 0,
    BST_REACH_NO_CUE,
    BST_REACH_BEHIND_EARTH,
    BST_REACH_SUN, /* inside a keep-out cone */
    BST_REACH_MOON,
    BST_REACH_EARTH,
    BST_REACH_TRAVEL,  /* outside the mount's travel */
    BST_REACH_RATE,    /* faster than an axis rate limit */
    BST_REACH_ACCEL,   /* above an axis acceleration limit */
    BST_REACH_KEYHOLE, /* rate or acceleration limit exceeded only because the pole is near */
    BST_REACH_COUNT
} bst_pointing_feasibility;

/* Reason in words: "in the keep-out cone of the Sun" for BST_REACH_SUN, and so on. */
const char *bst_pointing_feasibility_reason(int reach);

/* Predicted geometry at one time. */
typedef struct bst_pointing_feasibility_look {
    bool valid; /* false: no cue at that time */
    bst_vec3 direction_gcrf;
    double range_m;      /* 0: unknown, then occultation by the Earth is not tested */
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
    const bst_mount_status *mount; /* NULL: an ideal mount */
    double limit_fraction;         /* usable share of the rate and acceleration limits */
} bst_pointing_feasibility_problem;

/* Feasibility at a time: BST_REACH_OK, or the first reason in the order of
 * bst_pointing_feasibility. Axis rates and accelerations are differences over 0.1 s. */
bst_status bst_pointing_feasibility_at(bst_ctx *ctx,
                                       const bst_pointing_feasibility_problem *problem,
                                       double seconds,
                                       bst_pointing_feasibility *out) BST_MUST_CHECK;

/* Search for a change of feasibility from from_s to horizon_s later, in steps of step_s: the first
 * time with BST_REACH_OK (wanted), or without it (not wanted). */
typedef struct bst_pointing_feasibility_search {
    double from_s, horizon_s, step_s;
    bool wanted;
} bst_pointing_feasibility_search;

typedef struct bst_pointing_feasibility_change {
    bool found;                   /* false: none, other members are not set */
    double when_s;                /* to 0.01 s */
    bst_pointing_feasibility why; /* feasibility at that time */
} bst_pointing_feasibility_change;

/* First time that satisfies the search. Changes shorter than a step may be missed. */
bst_status bst_pointing_feasibility_next(bst_ctx *ctx,
                                         const bst_pointing_feasibility_problem *problem,
                                         const bst_pointing_feasibility_search *search,
                                         bst_pointing_feasibility_change *out) BST_MUST_CHECK;

/* Interval in which the boresight is off by more than the tolerance. */
typedef struct bst_pointing_feasibility_loss {
    double from_s, until_s; /* INFINITY: beyond the end */
    double worst_rad;
} bst_pointing_feasibility_loss;

/* Time span of a pursuit, and its tolerance. */
typedef struct bst_pointing_feasibility_span {
    double from_s, until_s, tolerance_rad;
} bst_pointing_feasibility_span;

/* Simulates the pursuit of the predicted directions with axis limits, starting exactly on the
 * target. Each axis moves to the nearest angle within travel at full rate and brakes at 0.8 of the
 * acceleration limit, as the mounts do.
 *
 * Returned:  losses  intervals off target by keyhole or limits, at most `most`; none for a mount
 *                    with a redundant axis, which is assumed to pass its pole */
bst_status bst_pointing_feasibility_chase(bst_ctx *ctx,
                                          const bst_pointing_feasibility_problem *problem,
                                          const bst_pointing_feasibility_span *span,
                                          bst_pointing_feasibility_loss *losses, int most,
                                          int *count) BST_MUST_CHECK;

#endif
