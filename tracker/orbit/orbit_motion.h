/* Orbit states for angles-only determination: propagation and projection to directions, both with
 * covariance. Onboard knowledge only, no truth. */
#ifndef BST_TRACKER_ORBIT_ORBIT_MOTION_H
#define BST_TRACKER_ORBIT_ORBIT_MOTION_H

#include "sim/astro/sky_clock.h"
#include "sim/astro/trajectory.h"

/* Longest time from an epoch that a saved state may have, s: SGP4 steps to it by 720 minutes. */
#define BST_OD_LONGEST_S 1e10

/* SGP4 as motion model: the orbit is the one that passes through a state (bst_sgp4_through);
 * velocities are derivatives of positions. */
typedef struct bst_od_sgp4 {
    bst_sky_clock *clock; /* lent; one user at a time */
    double bstar;         /* 1 / Earth radii */
    /* cache of rotations from TEME at full hours after the epoch; the caller zeroes it */
    struct {
        bool valid;
        int64_t hour;
        bst_mat3 gcrf_from_teme;
    } hours[64];
} bst_od_sgp4;

/* Motion model of an orbit: `sgp4` if set; else numerical integration of `forces`
 * (sim/astro/trajectory.h); both NULL: point-mass Earth in closed form. Seconds count from `epoch`
 * (unused for a point mass). */
typedef struct bst_od_motion {
    const bst_force_model *forces; /* lent */
    bst_od_sgp4 *sgp4;             /* lent */
    bst_time epoch;
} bst_od_motion;

/* Geocentric orbit state at `time_s`, GCRF, m and m/s. */
typedef struct bst_od_state {
    double time_s;
    bst_vec3 position_m, velocity_mps;
} bst_od_state;

/* Observer's state at the reception of light. */
typedef struct bst_od_observer {
    double time_s;
    bst_vec3 position_m, velocity_mps; /* geocentric, GCRF */
    bst_vec3 earth_bary_mps; /* Earth's velocity relative to the barycentre; 0: neglected */
} bst_od_observer;

/* An orbit evaluated at many times. */
typedef struct bst_od_path bst_od_path;
/* Creates the path of an orbit.
 *
 * Errors:    BST_ERR_NUMERIC or BST_ERR_ARGUMENT for a state outside the Earth's vicinity
 * Ownership: free with bst_od_path_free */
bst_status bst_od_path_create(bst_ctx *ctx, const bst_od_motion *motion, const bst_od_state *state,
                              bst_od_path **out) BST_MUST_CHECK;
void bst_od_path_free(bst_od_path *path); /* NULL allowed */
/* State of a path at a time. Successive times away from the initial one are fastest. Errors as
 * bst_kepler_propagate or bst_trajectory_state. */
bst_status bst_od_path_state(bst_ctx *ctx, const bst_od_path *path, double time_s,
                             bst_od_state *out) BST_MUST_CHECK;

/* Line of sight of an orbit: unit vector, geometric as in bst_track (with light time, without
 * aberration), from the observer at reception to the body at emission in the barycentric frame (see
 * bst_light_path), and its rate. range_m is the length of the light path. The light time is solved
 * to third order about the state at reception: below 0.1 mm within 0.3 light seconds of the Earth.
 */
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

/* Propagates a state and covariance (GCRF, m and m/s, order r, v) to `time_s`. The transition
 * matrix is by central differences of `motion`. Errors as bst_od_path_state. */
bst_status bst_od_propagate(bst_ctx *ctx, const bst_od_motion *motion, const bst_od_state *state,
                            const double covariance[6][6], double time_s, bst_od_state *out,
                            double covariance_out[6][6]) BST_MUST_CHECK;

/* Projects a state and covariance to the observer's sky at the same time.
 *
 * Returned:  out             direction and rate
 *            slope           their derivatives by r and v (rows d1, d2, r1, r2 in the tangent axes
 *                            at the direction; rad/m, rad s/m, 1/s ...)
 *            sky_covariance  covariance in those axes */
void bst_od_project(const bst_od_state *state, const double covariance[6][6],
                    const bst_od_observer *observer, bst_od_sight *out, double slope[4][6],
                    double sky_covariance[4][4]);

/* Predicts direction, rate and their covariance from an orbit at observer->time_s: d1, d2, r1, r2
 * in the tangent axes as in bst_track (rad^2, rad^2/s, rad^2/s^2), to first order.
 *
 * Notes:     This is the orbital motion model of a track whose range is known or assumed. An
 *            assumed range is a state with a large variance along the line of sight. */
bst_status bst_od_predict(bst_ctx *ctx, const bst_od_motion *motion, const bst_od_state *state,
                          const double covariance[6][6], const bst_od_observer *observer,
                          bst_od_sight *out, double sky_covariance[4][4]) BST_MUST_CHECK;

/* 1 sigma of the range rate of an object about the Earth of which none is known. */
#define BST_ANY_RANGE_RATE_MPS 3000.0

/* Prior of a range and range rate, m and m/s, with standard deviations. */
typedef struct bst_orbit_range {
    double range_m, range_sigma_m, range_rate_mps, range_rate_sigma_mps;
} bst_orbit_range;

/* Orbit state with covariance from a track and an assumed range and range rate, for bst_od_predict.
 * The light time is that of the assumed range.
 *
 * Given:     direction, rate_radps, sky_covariance  of the track, in the tangent axes at the
 *                                                   direction */
void bst_od_from_track(const bst_od_observer *observer, bst_vec3 direction, bst_vec3 rate_radps,
                       const double sky_covariance[4][4], const bst_orbit_range *range,
                       bst_od_state *out, double covariance[6][6]);

/* Gravitational parameter of a motion model, m^3/s^2. */
double bst_od_gm(const bst_od_motion *motion);

#endif
