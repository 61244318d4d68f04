/* Internal types of a trajectory in one time direction. */
#ifndef BST_ASTRO_TRAJECTORY_INTERNAL_H
#define BST_ASTRO_TRAJECTORY_INTERNAL_H

#include <stdint.h>

#include "sim/astro/radau.h"
#include "sim/astro/trajectory.h"

/* A time at which acceleration or velocity is discontinuous. */
typedef struct bst_trajectory_edge {
    double time_s;
    bst_vec3 thrust_rtn_mps2; /* until the next edge */
    int first_impulse, impulse_count;
} bst_trajectory_edge;

typedef struct bst_trajectory_edges {
    bst_trajectory_edge *items; /* sorted by time */
    int count;
    bst_vec3 *impulses_rtn_mps;
} bst_trajectory_edges;

/* Converts burns to sorted edges; free them with bst_trajectory_edges_free. */
bst_status bst_trajectory_edges_make(bst_ctx *ctx, const bst_astro_thrust *burns, int count,
                                     bst_trajectory_edges *out) BST_MUST_CHECK;
/* Frees the memory of a list of edges and clears the struct, which belongs to the caller. */
void bst_trajectory_edges_free(bst_trajectory_edges *edges);

enum { BST_CHAIN_WINDOW = 64, BST_CHAIN_WAY_POINTS = 32 };

/* State of a chain of steps, on which its next step depends. */
typedef struct bst_trajectory_chain_point {
    int64_t step; /* number of the next step */
    double time_s, time_low_s;
    double h_s; /* step size to try next */
    int edge;   /* forward: index of the next edge; backward: of the previous one */
    bst_radau_point motion;
} bst_trajectory_chain_point;

typedef struct bst_trajectory_chain_step {
    double time_s, time_low_s, end_s;
    bst_radau_step motion;
} bst_trajectory_chain_step;

typedef struct bst_trajectory_chain {
    double direction; /* 1 or -1 */
    bst_trajectory_chain_point here, furthest;
    bst_trajectory_chain_step window[BST_CHAIN_WINDOW]; /* steps first_kept to here.step - 1 */
    int64_t first_kept;
    bst_trajectory_chain_point
        way[BST_CHAIN_WAY_POINTS]; /* checkpoints at steps 0, stride, 2 stride, ... */
    int way_count;
    int64_t stride;
    bool ended; /* no state beyond end_s, reached in step end_step */
    double end_s;
    int64_t end_step;
    bst_status why;
    char message[256];
} bst_trajectory_chain;

typedef struct bst_trajectory_chain_context {
    bst_forces *forces;
    const bst_radau *radau;
    const bst_trajectory_edges *edges;
    double tolerance;
} bst_trajectory_chain_context;

/* Starts the integration of a trajectory at a state.
 *
 * Given:     context                   forces and edges (burns, shadow); must outlive the chain
 *            direction                 +1: forwards in time, -1: backwards
 *            at_s                      time of the state, s
 *            position_m, velocity_mps  GCRF, m and m/s */
void bst_trajectory_chain_start(bst_trajectory_chain *chain,
                                const bst_trajectory_chain_context *context, double direction,
                                double at_s, bst_vec3 position_m, bst_vec3 velocity_mps);
/* Finds the step that contains `seconds`, integrating if necessary. Errors as
 * bst_trajectory_state. */
bst_status bst_trajectory_chain_find(bst_ctx *ctx, bst_trajectory_chain *chain,
                                     bst_trajectory_chain_context *context, double seconds,
                                     const bst_trajectory_chain_step **out) BST_MUST_CHECK;

#endif
