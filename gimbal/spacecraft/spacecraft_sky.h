/* Environment of a spacecraft and its onboard estimate, interpolated on a time grid. */
#ifndef BST_GIMBAL_SPACECRAFT_SPACECRAFT_SKY_H
#define BST_GIMBAL_SPACECRAFT_SPACECRAFT_SKY_H

#include <stdint.h>

#include "boresight/archive.h"
#include "boresight/status.h"
#include "gimbal/spacecraft/pointing_law.h"

/* Nodes per second. The error of a cubic through four nodes is at most 9/384 h^4 of the fourth
 * derivative: 1e-9 m for a low orbit, 1e-9 rad for a pass at 0.03 rad/s. */
#define BST_SKY_NODES_PER_S 4

typedef struct bst_spacecraft_sky {
    bst_vec3 position_m, velocity_mps; /* true, geocentric, GCRF */
    bst_vec3 sun_m;                    /* true, from the spacecraft */
    double sunlit;                     /* visible fraction of the Sun's disc */
    bst_spacecraft_law_inputs known;
} bst_spacecraft_sky;

/* Computes the environment at `seconds` after the epoch. */
typedef bst_status (*bst_spacecraft_sky_fn)(void *user, bst_ctx *ctx, double seconds,
                                            bst_spacecraft_sky *out);

typedef struct bst_spacecraft_sky_grid {
    bst_spacecraft_sky_fn sky_at;
    void *user;
    const bst_pointing_law *law;
    int64_t first; /* index of node[0]; node k is at k / BST_SKY_NODES_PER_S */
    int filled;    /* 0 or 4 */
    bst_spacecraft_sky node[4];
    bst_quat attitude[4]; /* wanted by the law */
} bst_spacecraft_sky_grid;

/* Interpolated environment (only position_m, velocity_mps, sun_m and sunlit) and the wanted motion.
 * For seconds >= 0 no node is before time 0, and nodes are at most two grid steps later than
 * `seconds`, within the first step three. Errors: those of sky_at. */
bst_status bst_spacecraft_sky_grid_at(bst_spacecraft_sky_grid *grid, bst_ctx *ctx, double seconds,
                                      bst_spacecraft_sky *sky,
                                      bst_spacecraft_attitude_reference *reference) BST_MUST_CHECK;

/* Archives the nodes of a grid. */
void bst_spacecraft_sky_grid_archive(bst_spacecraft_sky_grid *grid, bst_archive *archive);

#endif
