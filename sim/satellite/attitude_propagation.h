/* Rotation of a rigid body under torques, integrated on demand. */
#ifndef BST_SATELLITE_ATTITUDE_PROPAGATION_H
#define BST_SATELLITE_ATTITUDE_PROPAGATION_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/status.h"
#include "boresight/vec.h"

/* Torque about the centre of mass, N m, body axes, at `seconds` after the epoch; false: unknown
 * then. It depends on its arguments alone. */
typedef bool (*bst_attitude_torque_fn)(void *user, double seconds, bst_quat q_body_from_gcrf,
                                       bst_vec3 *torque_nm);

/* A body and its motion at one time. */
typedef struct bst_attitude_motion {
    double inertia_kg_m2[3]; /* principal moments about the body's x, y, z */
    double start_s;          /* after the epoch */
    bst_quat q_body_from_gcrf;
    bst_vec3 rate_radps; /* body axes */
} bst_attitude_motion;

/* A rotation, integrated on demand.
 *
 * Notes:     The attitude is a pure function of time, equal to the bit for any order of queries.
 *            Threads may share it (internal mutex). 120 bytes for each half step are kept. */
typedef struct bst_attitude_propagation bst_attitude_propagation;

/* Prepares a rotation without integrating.
 *
 * Given:     start          its moments as bst_tumbling_check allows
 *            tolerance_rad  estimated error of the attitude after a day: each step may add its
 *                           share by time, of the attitude and of the rate times a day
 *            torque         called under the propagation's mutex
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_attitude_propagation_free
 * Notes:     A step is the motion without torque (bst_tumbling_turn), with impulses of the torque
 *            at its start, middle and end, weighted as by Simpson: without torque, energy and
 *            momentum are kept at any length of the step. It is taken at once and in two halves.
 *            The difference gives the error and, by Richardson's extrapolation, the result. Steps
 *            are at most 120 s, and a radian of rotation. Between them the deviation from the
 *            motion without torque is a cubic polynomial.
 * Reference: McLachlan, BIT 35 (1995) 258; Laskar and Robutel, Celest. Mech. Dyn. Astron. 80
 *            (2001) 39 (SBAB2: composition for small perturbations) */
bst_status bst_attitude_propagation_create(bst_ctx *ctx, const bst_attitude_motion *start,
                                           double tolerance_rad, bst_attitude_torque_fn torque,
                                           void *user,
                                           bst_attitude_propagation **out) BST_MUST_CHECK;
/* Frees a rotation; NULL is allowed. */
void bst_attitude_propagation_free(bst_attitude_propagation *propagation);

/* Sets the attitude at the start, before the first query. */
void bst_attitude_propagation_start(bst_attitude_propagation *propagation,
                                    bst_quat q_body_from_gcrf);

/* Attitude at `seconds` after the epoch.
 *
 * Returned:  q_body_from_gcrf; *rate_radps  body axes, if not NULL
 * Notes:     before the start, and from where the torque is unknown on, the motion without
 *            torque */
bst_quat bst_attitude_propagation_at(bst_attitude_propagation *propagation, double seconds,
                                     bst_vec3 *rate_radps);

/* Number of calls of the torque so far. */
int64_t bst_attitude_propagation_calls(bst_attitude_propagation *propagation);

#endif
