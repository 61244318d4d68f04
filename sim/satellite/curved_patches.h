/* Facets of curved surfaces divided into finer ones on the surface itself. Internal to
 * sim/satellite. */
#ifndef BST_SATELLITE_CURVED_PATCHES_H
#define BST_SATELLITE_CURVED_PATCHES_H

#include "sim/satellite/pose.h"

/* Curved surfaces of a model: where they are, and which vertices are on their rims. */
typedef struct bst_curved_places {
    bst_vec3 *centre; /* by curved surface: a point of its axis, a sphere's centre, joint frame */
    int *rim;         /* by vertex: the cone or cylinder that it belongs to; -1: none */
} bst_curved_places;

/* Finds the curved surfaces of a model. BST_ERR_MEMORY. The caller frees it. */
bst_status bst_curved_places_create(bst_ctx *ctx, const bst_satellite *satellite,
                                    bst_curved_places *out) BST_MUST_CHECK;
/* Frees the memory of places; the struct belongs to the caller. */
void bst_curved_places_free(bst_curved_places *places);

/* A facet of a curved surface, as ranges of azimuth and of height (for a sphere: latitude) in the
 * surface's frame, which is given in the body frame. */
typedef struct bst_curved_facet {
    const bst_curved *curved;
    bst_vec3 centre, x, y, z;
    double azimuth[2], height[2], radius_m[2]; /* radius_m: at both heights, of a cone */
} bst_curved_facet;

/* Prepares a facet of a pose whose facet->curved is not below 0. */
void bst_curved_facet_make(const bst_satellite_pose *pose, const bst_curved_places *places,
                           int facet, bst_curved_facet *out);

/* Factor on the radius by which the outline of a surface that is divided into such parts has the
 * area of the circle. */
double bst_curved_facet_scale(const bst_curved_facet *facet, int around, int up);

/* Corners of a part of a facet that is divided into parts[0] around and parts[1] up, body frame.
 *
 * Given:     place  index of the part, around and up
 *            scale  factor on the radius
 * Returned:  corner  [4] counter-clockwise from outside, from low azimuth and height; two may be
 *                    the same */
void bst_curved_facet_part(const bst_curved_facet *facet, const int parts[2], const int place[2],
                           double scale, bst_vec3 corner[4]);

/* Normal of the surface at fractions of azimuth and height of a facet, unit, body frame. */
bst_vec3 bst_curved_facet_normal(const bst_curved_facet *facet, double u, double v);

/* Corners of a plane facet, whose edges on rims are divided into `around` parts.
 *
 * Returned:  corner  [count * around] room; the number is the return value */
int bst_plane_facet_corners(const bst_satellite_pose *pose, const bst_curved_places *places,
                            int facet, int around, bst_vec3 *corner);

#endif
