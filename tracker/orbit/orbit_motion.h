/* Orbits as angles-only determination needs them: states, the directions in which they are seen,
 * and both with covariance. No truth: what an observer knows of itself and of the forces. */
#ifndef BST_TRACKER_ORBIT_ORBIT_MOTION_H
#define BST_TRACKER_ORBIT_ORBIT_MOTION_H

#include "sim/astro/sky_clock.h"
#include "sim/astro/trajectory.h"

/* SGP4's theory in place of forces: an orbit is the one that passes through a state
 * (bst_sgp4_through), and velocities are the derivatives of places. */
typedef struct bst_od_sgp4 {
    bst_sky_clock *clock; /* borrowed; one user at a time */
    double bstar;         /* 1 / Earth radii */
    /* of the motion's own: rotations from TEME at full hours after its epoch; zeroed by the caller
     */
    struct {
        bool valid;
        int64_t hour;
        bst_mat3 gcrf_from_teme;
    } hours[64];
} bst_od_sgp4;

/* How a body moves: by `sgp4` where that is set; else by `forces`, as sim/astro/trajectory.h
 * integrates them; with both NULL about a point mass in closed form. `epoch` is what seconds count
 * from (unused for a point mass). */
typedef struct bst_od_motion {
    const bst_force_model *forces; /* borrowed */
    bst_od_sgp4 *sgp4;             /* borrowed */
    bst_time epoch;
} bst_od_motion;

/* A geocentric state (GCRF, m and m/s) at `time_s`. */
typedef struct bst_od_state {
    double time_s;
    bst_vec3 position_m, velocity_mps;
} bst_od_state;

/* The observer when light arrives. */
typedef struct bst_od_observer {
    double time_s;
    bst_vec3 position_m, velocity_mps; /* geocentric, GCRF */
    bst_vec3 earth_bary_mps;           /* Earth's velocity relative to the barycentre; 0: ignored */
} bst_od_observer;

/* One orbit, evaluated at many times. */
typedef struct bst_od_path bst_od_path;
/* BST_ERR_NUMERIC or BST_ERR_ARGUMENT for a state that no orbit near the Earth has. The caller
 * frees. */
bst_status bst_od_path_create(bst_ctx *ctx, const bst_od_motion *motion, const bst_od_state *state,
                              bst_od_path **out) BST_MUST_CHECK;
void bst_od_path_free(bst_od_path *path); /* NULL allowed */
/* State at a time. Errors as bst_kepler_propagate or bst_trajectory_state. Times that run away from
 * the initial one are cheapest. */
bst_status bst_od_path_state(bst_ctx *ctx, const bst_od_path *path, double time_s,
                             bst_od_state *out) BST_MUST_CHECK;

/* What the observer sees: the unit vector, geometric as bst_track has it (light time in, aberration
 * out), from the observer at reception to the body at emission in the barycentric frame (see
 * bst_light_path), and its rate; range_m is the length of the light's path. The light time is
 * solved on the body's path about `state` (that of reception) to third order in it: below 0.1 mm
 * within 0.3 s of light of the Earth. */
typedef struct bst_od_sight {
    bst_vec3 direction;
    bst_vec3 rate_radps; /* d(direction)/dt, perpendicular to direction */
    double range_m, range_rate_mps;
} bst_od_sight;

/* Direction, range and rates of an object, with light time.
 *
 * Given:     state     geocentric state of the object at the time of reception
 *            observer  state of the observer then
 * Notes:     the object moves in the Earth's central field during the light time. */
void bst_od_see(const bst_od_state *state, const bst_od_observer *observer, bst_od_sight *out);

/* The state and covariance (GCRF, m and m/s, order r, v) at `time_s` from those at another time:
 * transition matrix by central differences of `motion`. Errors as bst_od_path_state. */
bst_status bst_od_propagate(bst_ctx *ctx, const bst_od_motion *motion, const bst_od_state *state,
                            const double covariance[6][6], double time_s, bst_od_state *out,
                            double covariance_out[6][6]) BST_MUST_CHECK;

/* What the observer sees of a state with covariance at the same time: direction and rate, their
 * derivatives by r and v (rows d1, d2, r1, r2 in the tangent axes at the direction; rad/m, rad s/m,
 * 1/s ...), and their covariance in those axes. */
void bst_od_project(const bst_od_state *state, const double covariance[6][6],
                    const bst_od_observer *observer, bst_od_sight *out, double slope[4][6],
                    double sky_covariance[4][4]);

/* Direction and rate that an orbit with covariance predicts for the observer at observer->time_s,
 * and their covariance in the tangent axes at the direction, as bst_track has it: d1, d2, r1, r2
 * (rad^2, rad^2/s, rad^2/s^2). The orbital-motion model of a track whose range is known or assumed:
 * a target at an assumed range is a state with a large variance along the line of sight. To first
 * order in the covariance. */
bst_status bst_od_predict(bst_ctx *ctx, const bst_od_motion *motion, const bst_od_state *state,
                          const double covariance[6][6], const bst_od_observer *observer,
                          bst_od_sight *out, double sky_covariance[4][4]) BST_MUST_CHECK;

/* What is believed of a range, m and m/s, with standard deviations. */
typedef struct bst_orbit_range {
    double range_m, range_sigma_m, range_rate_mps, range_rate_sigma_mps;
} bst_orbit_range;

/* A state with covariance from a track (unit direction, rate, covariance of both in the tangent
 * axes at the direction) and an assumed range and range rate: what bst_od_predict then carries on.
 * Light time is taken as that of the assumed range. */
void bst_od_from_track(const bst_od_observer *observer, bst_vec3 direction, bst_vec3 rate_radps,
                       const double sky_covariance[4][4], const bst_orbit_range *range,
                       bst_od_state *out, double covariance[6][6]);

/* Gravitational parameter that a motion has (m^3/s^2). */
double bst_od_gm(const bst_od_motion *motion);

#endif
