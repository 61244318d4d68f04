/* Slews that take the least time that rate and acceleration limits allow: of one axis to a moving
 * target, and of several axes along a given path. */
#ifndef BST_CONTROL_GUIDANCE_SLEW_H
#define BST_CONTROL_GUIDANCE_SLEW_H

#include <stdbool.h>

/* One axis: accelerate, coast, brake. */
typedef struct bst_slew_axis {
    double from_rad, from_radps; /* at time 0 */
    double to_rad, to_radps;     /* the target at time 0, and its constant rate */
    double until_s[3];           /* ends of the three parts */
    double accel_radps2[3];
    double duration_s;
} bst_slew_axis;

/* Plans the motion of least time from (from_rad, from_radps) onto a target that is at to_rad at
 * time 0 and moves at to_radps, with |rate| <= rate_limit_radps (0: none) and |acceleration| <=
 * accel_limit_radps2. In the target's frame: the double integrator's bang-bang law (Bryson and Ho
 * 1975, 3.9) with a coast where the rate limit cuts its peak. A rate beyond the limit at the start
 * is first braked to it. False when the target cannot be met: it is not slower than the limit, the
 * acceleration limit is not positive, or something is not finite. */
bool bst_slew_axis_plan(double from_rad, double from_radps, double to_rad, double to_radps,
                        double rate_limit_radps, double accel_limit_radps2, bst_slew_axis *out);

/* Angle, rate and acceleration at a time; on the target after the end, at the start before it. */
void bst_slew_axis_at(const bst_slew_axis *slew, double seconds, double *angle_rad,
                      double *rate_radps, double *accel_radps2);

#define BST_SLEW_AXES 3
#define BST_SLEW_NODES 513 /* greatest number of nodes of a path */

/* Rate and acceleration limits of each axis; a rate limit of 0: none. */
typedef struct bst_slew_limits {
    int axes;
    double rate_radps[BST_SLEW_AXES], accel_radps2[BST_SLEW_AXES];
} bst_slew_limits;

/* A path by its axis angles at equidistant places s. */
typedef struct bst_slew_nodes {
    int count;   /* 2 to BST_SLEW_NODES */
    double step; /* of s between nodes */
    double angle_rad[BST_SLEW_NODES][BST_SLEW_AXES];
    bool corner[BST_SLEW_NODES]; /* the path turns there: passed at rest */
} bst_slew_nodes;

/* How fast a path is gone along. */
typedef struct bst_slew_path {
    int count;
    double step;
    double square[BST_SLEW_NODES]; /* (ds/dt)^2 at the nodes, linear between them */
    double time_s[BST_SLEW_NODES];
    double duration_s;
} bst_slew_path;

/* The fastest way along a path on which some axis always is at a limit (or coming to a corner):
 * with z = (ds/dt)^2 and u = d2s/dt2 the limits q'^2 z <= V^2 and |q' u + q'' z| <= A are linear;
 * one pass backwards finds from which z the end can still be met, one forwards takes the greatest u
 * (reachability analysis; Pham and Pham, IEEE Trans. Robotics 34, 2018). It begins at ds/dt =
 * start_rate and ends at end_rate (both >= 0), lowered to what the path allows there. False for
 * fewer than two nodes, a step, limit or angle that is no positive or finite number. */
bool bst_slew_path_plan(const bst_slew_nodes *nodes, const bst_slew_limits *limits,
                        double start_rate, double end_rate, bst_slew_path *out);

/* Place along the path and its two time derivatives; at rest at the ends before and after. */
void bst_slew_path_at(const bst_slew_path *path, double seconds, double *s, double *rate,
                      double *accel);

#endif
