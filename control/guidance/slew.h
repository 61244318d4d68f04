/* Time-optimal slews under rate and acceleration limits: of one axis to a moving target, and of
 * several axes along a path. */
#ifndef BST_CONTROL_GUIDANCE_SLEW_H
#define BST_CONTROL_GUIDANCE_SLEW_H

#include <stdbool.h>

/* Slew of one axis: accelerate, coast, brake. */
typedef struct bst_slew_axis {
    double from_rad, from_radps; /* at time 0 */
    double to_rad, to_radps;     /* the target at time 0, and its constant rate */
    double until_s[3];           /* ends of the three phases */
    double accel_radps2[3];
    double duration_s;
} bst_slew_axis;

/* Plans the time-optimal motion of an axis from (from_rad, from_radps) onto a target at to_rad at
 * time 0 with rate to_radps, for |rate| <= rate_limit_radps (0: no limit) and |acceleration| <=
 * accel_limit_radps2. An initial rate above the limit is first reduced to it.
 *
 * Returned:  false if the target cannot be met: it is not slower than the limit, the acceleration
 *            limit is not positive, or a value is not finite
 * Reference: Bryson and Ho 1975, 3.9: bang-bang law of the double integrator in the target's frame,
 * with a coast phase at the rate limit */
bool bst_slew_axis_plan(double from_rad, double from_radps, double to_rad, double to_radps,
                        double rate_limit_radps, double accel_limit_radps2, bst_slew_axis *out);

/* Angle, rate and acceleration of a slew at a time; at the start before it, on the target after its
 * end. */
void bst_slew_axis_at(const bst_slew_axis *slew, double seconds, double *angle_rad,
                      double *rate_radps, double *accel_radps2);

#define BST_SLEW_AXES 3
#define BST_SLEW_NODES 513 /* most nodes of a path */

/* Rate and acceleration limits of each axis; a rate limit of 0: none. */
typedef struct bst_slew_limits {
    int axes;
    double rate_radps[BST_SLEW_AXES], accel_radps2[BST_SLEW_AXES];
} bst_slew_limits;

/* A path as axis angles at equidistant positions s. */
typedef struct bst_slew_nodes {
    int count;   /* 2 to BST_SLEW_NODES */
    double step; /* spacing of s */
    double angle_rad[BST_SLEW_NODES][BST_SLEW_AXES];
    bool corner[BST_SLEW_NODES]; /* the path has a corner there, passed at rest */
} bst_slew_nodes;

/* Speed profile along a path. */
typedef struct bst_slew_path {
    int count;
    double step;
    double square[BST_SLEW_NODES]; /* (ds/dt)^2 at the nodes, linear between */
    double time_s[BST_SLEW_NODES];
    double duration_s;
} bst_slew_path;

/* Time-optimal speed along a path: some axis is always at a limit, or approaches a corner. With z =
 * (ds/dt)^2 and u = d2s/dt2 the limits q'^2 z <= V^2 and |q' u + q'' z| <= A are linear. A backward
 * pass finds the z from which the end is reachable; a forward pass takes the largest u
 * (reachability analysis).
 *
 * Given:     start_rate, end_rate  ds/dt at the ends, >= 0; reduced to what the path permits
 * Returned:  false for fewer than two nodes or a step, limit or angle that is not positive or
 *            finite
 * Reference: Pham and Pham, IEEE Trans. Robotics 34, 2018 */
bool bst_slew_path_plan(const bst_slew_nodes *nodes, const bst_slew_limits *limits,
                        double start_rate, double end_rate, bst_slew_path *out);

/* Position along the path and its first two time derivatives; at rest before the start and after
 * the end. */
void bst_slew_path_at(const bst_slew_path *path, double seconds, double *s, double *rate,
                      double *accel);

#endif
