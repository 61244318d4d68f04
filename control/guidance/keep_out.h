/* Keep-out cones of the boresight, and the shortest path around them. */
#ifndef BST_CONTROL_GUIDANCE_KEEP_OUT_H
#define BST_CONTROL_GUIDANCE_KEEP_OUT_H

#include <stdbool.h>

#include "boresight/vec.h"

typedef enum bst_keep_out_zone_kind {
    BST_ZONE_SUN = 0,
    BST_ZONE_MOON,
    BST_ZONE_EARTH,
    BST_ZONE_KINDS,
} bst_keep_out_zone_kind;

/* A keep-out cone. */
typedef struct bst_keep_out_zone {
    int kind;              /* bst_keep_out_zone_kind */
    bst_vec3 axis;         /* unit */
    double half_angle_rad; /* > 0, < pi */
} bst_keep_out_zone;

#define BST_ZONES 6 /* most cones that a path is planned around */

/* Keep-out angles from the centre of Sun and Moon and from the Earth's limb; 0 for Sun and Moon:
 * none. */
typedef struct bst_keep_out {
    double sun_rad, moon_rad;
    bool earth;
    double earth_limb_rad;  /* may be negative: part of the Earth's disc is allowed */
    double limb_altitude_m; /* altitude of the limb, for the atmosphere */
} bst_keep_out;

/* Keep-out cones at one time.
 *
 * Given:     position_m       geocentric position of the observer
 *            to_sun, to_moon  directions from the observer, any length
 * Returned:  number of zones
 * Notes:     The limb of a sphere of radius R (equatorial radius plus altitude) is asin(R / r) from
 *            the nadir; an observer inside it sees the Earth in half the sky. */
int bst_keep_out_zones(const bst_keep_out *exclusion, bst_vec3 position_m, bst_vec3 to_sun,
                       bst_vec3 to_moon, bst_keep_out_zone zones[BST_ZONE_KINDS]);

/* Cone in which a direction lies most deeply, and its depth (rad, > 0); -1: outside all. */
int bst_keep_out_inside(const bst_keep_out_zone *zones, int count, bst_vec3 direction,
                        double *depth_rad);

/* Nearest direction outside all cones; unchanged if it is already outside. On a cone's axis it is
 * on the side of `towards`. Returns false if there is none. */
bool bst_keep_out_nearest(const bst_keep_out_zone *zones, int count, bst_vec3 direction,
                          bst_vec3 towards, bst_vec3 *out);

/* Arc of a path: `from` rotated about `axis` by up to turn_rad > 0 (right-handed). It is a great
 * circle if axis and from are perpendicular. */
typedef struct bst_keep_out_arc {
    bst_vec3 axis, from; /* unit */
    double turn_rad;
    double length_rad;
} bst_keep_out_arc;

#define BST_PATH_ARCS 24

typedef struct bst_keep_out_route {
    int count; /* 0: zero length, at arcs[0].from */
    bst_keep_out_arc arcs[BST_PATH_ARCS];
    double length_rad;
    int left_zone; /* cone in which the path starts and which it leaves first, -1: none */
    /* cone that contains the target: the path ends at the nearest direction beside it; -1: none */
    int target_zone;
} bst_keep_out_route;

/* Shortest path between two unit vectors that enters no cone, composed of great circles tangent to
 * cones and of arcs along their edges. Dijkstra's algorithm runs on the visibility graph. A start
 * inside a cone leaves it first by the shortest way.
 *
 * Returned:  false, with an empty path, if the cones block every path or `count` exceeds BST_ZONES
 * Reference: Lozano-Perez and Wesley, Comm. ACM 22, 1979, here on the sphere */
bool bst_keep_out_path(const bst_keep_out_zone *zones, int count, bst_vec3 from, bst_vec3 to,
                       bst_keep_out_route *out);

/* Direction at a distance s along a path, clamped to its ends.
 *
 * Returned:  *tangent  first derivative by s (unit; zero for an empty path)
 *            *bend     second derivative by s */
bst_vec3 bst_keep_out_route_at(const bst_keep_out_route *path, double s_rad, bst_vec3 *tangent,
                               bst_vec3 *bend);

#endif
