/* Numerically integrated orbits with burns, evaluated at any time. */
#ifndef BST_ASTRO_TRAJECTORY_H
#define BST_ASTRO_TRAJECTORY_H

#include "sim/astro/forces.h"

/* Height above the ellipsoid (m) at which a trajectory ends. */
#define BST_TRAJECTORY_FLOOR_M 80000.0

/* A change of velocity along radius, transverse and normal (R along the position, N along position
 * x velocity, T = N x R). With duration_s = 0 an impulse, in the axes right before it; else a
 * constant acceleration dv / duration in axes that turn with the orbit, from time_s on. */
typedef struct bst_astro_thrust {
    double time_s;
    double duration_s;
    bst_vec3 dv_rtn_mps;
} bst_astro_thrust;

/* A numerically integrated orbit, integrated on demand.
 *
 * Notes:     The state is a pure function of time, equal to the bit for any order of
 *            queries. Threads may share it (internal mutex).
 *            Constant memory (40 kB, twice that for times before the initial one): recent steps and
 *            checkpoints. Increasing times cost one step now and then; a query far back costs at
 *            most 1/32 of the whole arc, from the nearest checkpoint. */
typedef struct bst_trajectory bst_trajectory;

typedef struct bst_trajectory_options {
    bst_force_model forces;            /* its borrowed data must outlive the trajectory */
    bst_time epoch;                    /* reference of all seconds */
    double at_s;                       /* time of the initial state */
    bst_vec3 position_m, velocity_mps; /* GCRF, before a burn at that time */
    const bst_astro_thrust *burns;     /* any order, may overlap; copied */
    int burn_count;
    double tolerance; /* relative error of a step, 1e-11 to 1e-3, see
                         docs/explanation/equations/orbits.md; 0: 1e-9 */
} bst_trajectory_options;

/* Creates a trajectory without integrating. BST_ERR_ARGUMENT: values not finite, times beyond 1e10
 * s, negative durations, an initial state below BST_TRAJECTORY_FLOOR_M, or an invalid force
 * model. */
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
