/* Directions that the boresight keeps out of, and the shortest way round them. */
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

/* A cone that directions stay out of. */
typedef struct bst_keep_out_zone {
    int kind;              /* bst_keep_out_zone_kind */
    bst_vec3 axis;         /* unit */
    double half_angle_rad; /* > 0, < pi */
} bst_keep_out_zone;

#define BST_ZONES 6 /* most cones that a path is planned round */

/* What keeps the boresight away, as angles from the centre of Sun and Moon and from the Earth's
 * limb; 0 for Sun and Moon: none. */
typedef struct bst_keep_out {
    double sun_rad, moon_rad;
    bool earth;
    double earth_limb_rad;  /* may be negative: so much of the Earth's disc is allowed */
    double limb_altitude_m; /* of the limb that counts: the air's */
} bst_keep_out;

/* The cones at one time from an observer's geocentric position and the directions (any length) from
 * it to Sun and Moon. The Earth's limb, of a sphere of its equatorial radius and the altitude R, is
 * asin(R / r) from the nadir; an observer inside it sees the Earth in half the sky. Returns their
 * number. */
int bst_keep_out_zones(const bst_keep_out *exclusion, bst_vec3 position_m, bst_vec3 to_sun,
                       bst_vec3 to_moon, bst_keep_out_zone zones[BST_ZONE_KINDS]);

/* The zone that a direction is in the most deeply, and how deeply (rad, > 0); -1: it is in none. */
int bst_keep_out_inside(const bst_keep_out_zone *zones, int count, bst_vec3 direction,
                        double *depth_rad);

/* The nearest direction outside of all zones to one that is inside; itself when it is outside.
 * Right on a cone's axis it is on the side of `towards`. False when there is none. */
bool bst_keep_out_nearest(const bst_keep_out_zone *zones, int count, bst_vec3 direction,
                          bst_vec3 towards, bst_vec3 *out);

/* A piece of a path: `from` turned about `axis` by up to turn_rad > 0 (right hand). A great circle
 * where axis and from are perpendicular. */
typedef struct bst_keep_out_arc {
    bst_vec3 axis, from; /* unit */
    double turn_rad;
    double length_rad;
} bst_keep_out_arc;

#define BST_PATH_ARCS 24

typedef struct bst_keep_out_route {
    int count; /* 0: nothing to go, and arcs[0].from is where it stays */
    bst_keep_out_arc arcs[BST_PATH_ARCS];
    double length_rad;
    int left_zone;   /* zone that it starts in and leaves first, -1: none */
    int target_zone; /* zone that the target is in: the path ends beside it, where it is nearest;
                        -1: none */
} bst_keep_out_route;

/* The shortest path between two unit vectors that enters no zone: of great circles tangent to cones
 * and of parts of the cones' edges. It is Dijkstra's over all tangents from the ends and between
 * cones, and the edges between their feet (visibility graph; Lozano-Perez and Wesley, Comm. ACM 22,
 * 1979, on the sphere). A start inside of a zone is left by the shortest way first. False, and the
 * path empty, when the zones leave no way or `count` exceeds BST_ZONES. */
bool bst_keep_out_path(const bst_keep_out_zone *zones, int count, bst_vec3 from, bst_vec3 to,
                       bst_keep_out_route *out);

/* The direction at a distance s along a path, clamped to its ends; its derivative by s (unit, zero
 * for an empty path) and second derivative. */
bst_vec3 bst_keep_out_route_at(const bst_keep_out_route *path, double s_rad, bst_vec3 *tangent,
                               bst_vec3 *bend);

#endif
