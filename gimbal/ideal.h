/* Ideal line of sight: apparent direction of a target, interpolated between nodes on a fine time
 * grid. */
#ifndef BST_GIMBAL_IDEAL_H
#define BST_GIMBAL_IDEAL_H

#include <stdint.h>

#include "boresight/archive.h"
#include "boresight/status.h"
#include "boresight/vec.h"
#include "gimbal/platform.h"

/* Target of the module "ideal". */
enum { BST_IDEAL_OBJECT, BST_IDEAL_DIRECTION, BST_IDEAL_STAR };
typedef struct bst_ideal_config {
    int32_t target;         /* BST_IDEAL_... */
    char object[64];        /* name of the object in the scenario */
    double ra_deg, dec_deg; /* ICRS */
    double star_tyc[3];     /* Tycho-2 identity */
    bst_platform_config platform;
} bst_ideal_config;
extern const bst_config_desc bst_ideal_config_table[];

/* Nodes per second. The error of the cubic through four nodes is at most 9/384 h^4 |d4 u/dt4|; a
 * pass at 0.03 rad/s (500 km range, 15 km/s) has about 2e-5 rad/s^4: below 1e-10 rad. */
#define BST_IDEAL_NODES_PER_S 10

/* Apparent direction (unit, GCRF axes) `seconds` after the epoch. */
typedef bst_status (*bst_ideal_fn)(void *user, bst_ctx *ctx, double seconds, bst_vec3 *direction);

typedef struct bst_ideal {
    bst_ideal_fn direction_at;
    void *user;
    int64_t first; /* index of node[0]; node k is at k / BST_IDEAL_NODES_PER_S */
    int filled;    /* 0 or 4 */
    bst_vec3 node[4];
} bst_ideal;

/* Archives the nodes. */
void bst_ideal_archive(bst_ideal *ideal, bst_archive *archive);

/* Interpolated direction at `seconds`. For seconds >= 0 no node is before time 0, and nodes are at
 * most two grid steps later than `seconds`. Errors: those of direction_at. */
bst_status bst_ideal_at(bst_ideal *ideal, bst_ctx *ctx, double seconds,
                        bst_vec3 *direction) BST_MUST_CHECK;

#endif
