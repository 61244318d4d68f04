/* What surrounds a spacecraft, and what it believes of that, on a time grid and in between. */
#ifndef BST_GIMBAL_SPACECRAFT_SPACECRAFT_SKY_H
#define BST_GIMBAL_SPACECRAFT_SPACECRAFT_SKY_H

#include <stdint.h>

#include "boresight/status.h"
#include "gimbal/spacecraft/pointing_law.h"

/* Nodes per second. A cubic through four of them is off by at most 9/384 h^4 of the fourth
 * derivative: 1e-9 m of a low orbit's place, 1e-9 rad of a pass at 0.03 rad/s. */
#define BST_SKY_NODES_PER_S 4

typedef struct bst_spacecraft_sky {
    bst_vec3 position_m; /* true, geocentric, GCRF */
    bst_vec3 sun_m;      /* true, from the spacecraft */
    double sunlit;       /* fraction of the Sun's disc in sight */
    bst_spacecraft_law_inputs known;
} bst_spacecraft_sky;

/* Fills *out for `seconds` after the epoch. */
typedef bst_status (*bst_spacecraft_sky_fn)(void *user, bst_ctx *ctx, double seconds,
                                            bst_spacecraft_sky *out);

typedef struct bst_spacecraft_sky_grid {
    bst_spacecraft_sky_fn sky_at;
    void *user;
    const bst_pointing_law *law;
    int64_t first; /* number of node[0]; node k is at k / BST_SKY_NODES_PER_S */
    int filled;    /* 0 or 4 */
    bst_spacecraft_sky node[4];
    bst_quat attitude[4]; /* wanted by the law */
} bst_spacecraft_sky_grid;

/* Interpolated surroundings (position_m, sun_m and sunlit alone) and the wanted motion. Nodes are
 * never before time 0 when seconds >= 0, and at most two steps of the grid later than asked.
 * Passes on what sky_at fails with. */
bst_status bst_spacecraft_sky_grid_at(bst_spacecraft_sky_grid *grid, bst_ctx *ctx, double seconds,
                                      bst_spacecraft_sky *sky,
                                      bst_spacecraft_attitude_reference *reference) BST_MUST_CHECK;

#endif
