/* Numerically integrated orbits with burns. */
#ifndef BST_ASTRO_TRAJECTORY_H
#define BST_ASTRO_TRAJECTORY_H

#include "sim/astro/forces.h"

/* Below this height above the ellipsoid (m) a trajectory ends: nothing is in orbit there. */
#define BST_TRAJECTORY_FLOOR_M 80000.0

/* A change of velocity along radius, transverse and normal (R along the position, N along position
 * x velocity, T = N x R). With duration_s = 0 an impulse, in the axes right before it; else a
 * constant acceleration dv / duration in axes that turn with the orbit, from time_s on. */
typedef struct bst_astro_thrust {
    double time_s;
    double duration_s;
    bst_vec3 dv_rtn_mps;
} bst_astro_thrust;

/* An orbit that is integrated when it is asked for. To its users it never changes: the state at any
 * time is a pure function of time, equal to the bit whatever has been asked before, and threads may
 * share it (a mutex is inside). Memory is fixed (40 kB, twice that once a time before the initial
 * one is asked for): the steps around the times asked for and some way points. So times that run on
 * cost one step's work now and then, and a look far back costs the way from the nearest way point
 * (1/32 of the whole way at most). */
typedef struct bst_trajectory bst_trajectory;

typedef struct bst_trajectory_options {
    bst_force_model forces;            /* what it borrows must outlive the trajectory */
    bst_time epoch;                    /* what seconds count from */
    double at_s;                       /* time of the initial state */
    bst_vec3 position_m, velocity_mps; /* GCRF, before a burn at that very time */
    const bst_astro_thrust *burns;     /* in any order, they may overlap; copied */
    int burn_count;
    double
        tolerance; /* of a step, 1e-11 to 1e-3, see docs/explanation/equations/orbits.md; 0: 1e-9 */
} bst_trajectory_options;

/* Makes a trajectory; nothing is integrated yet. BST_ERR_ARGUMENT for values that are not finite,
 * times beyond 1e10 s, negative durations, an initial state below BST_TRAJECTORY_FLOOR_M, or a
 * wrong force model. */
bst_status bst_trajectory_create(bst_ctx *ctx, const bst_trajectory_options *options,
                                 bst_trajectory **out) BST_MUST_CHECK;
void bst_trajectory_free(bst_trajectory *trajectory); /* NULL allowed */

/* State (GCRF) at `seconds` after the epoch, also before the initial time. At the time of an
 * impulse: right after it. BST_ERR_NUMERIC from the time on at which the orbit passes below
 * BST_TRAJECTORY_FLOOR_M (for times before the initial one: up to the time at which it rose above
 * it) and where no step is small enough; errors of bst_forces_at beyond the time they occur at;
 * BST_ERR_ARGUMENT for a time that is not finite or beyond 1e10 s.
 * The integrator (sim/astro/radau.h) chooses its steps by itself. They end exactly at burns' edges
 * and, with solar pressure, where the spacecraft enters and leaves penumbra and umbra (to 1e-4 s).
 */
bst_status bst_trajectory_state(bst_ctx *ctx, const bst_trajectory *trajectory, double seconds,
                                bst_vec3 *position_m, bst_vec3 *velocity_mps) BST_MUST_CHECK;

#endif
