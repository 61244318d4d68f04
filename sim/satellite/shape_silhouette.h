/* Silhouettes of satellites, and the part of one that another one hides. */
#ifndef BST_SATELLITE_SHAPE_SILHOUETTE_H
#define BST_SATELLITE_SHAPE_SILHOUETTE_H

#include "sim/satellite/pose.h"

enum { BST_SILHOUETTE_PIECES = 64, BST_SILHOUETTE_CIRCLE = 96 };

/* Convex polygons, counter-clockwise, that may overlap; piece i: points from first[i] to before
 * first[i + 1]. */
typedef struct bst_shape_silhouette {
    bst_point2 *points;
    int capacity;
    int first[BST_SILHOUETTE_PIECES + 1];
    int pieces;
} bst_shape_silhouette;

/* Allocates a silhouette for models of up to `vertices` vertices. BST_ERR_MEMORY. The caller frees
 * it with bst_shape_silhouette_free. */
bst_status bst_shape_silhouette_create(bst_ctx *ctx, int vertices,
                                       bst_shape_silhouette *out) BST_MUST_CHECK;
/* Frees the memory of a silhouette; the struct belongs to the caller. */
void bst_shape_silhouette_free(bst_shape_silhouette *silhouette);

/* Silhouette of a sphere: a polygon of BST_SILHOUETTE_CIRCLE corners and the area of its disc. */
void bst_shape_silhouette_of_sphere(bst_shape_silhouette *silhouette, double radius_m);

/* Silhouette of a pose.
 *
 * Given:     pose    joints as bst_satellite_pose_set left them; its view 0 is changed
 *            x, y    unit, body frame: axes of the plane; it is seen from their cross product
 * Notes:     exact for models of up to BST_SILHOUETTE_PIECES convex bodies; others count as their
 *            convex hull, or as their sphere if that has too many corners */
void bst_shape_silhouette_of_pose(bst_shape_silhouette *silhouette, bst_satellite_pose *pose,
                                  bst_vec3 x, bst_vec3 y);

/* True if a ray meets a facet of a pose: the point is inside the silhouette in perspective.
 *
 * Given:     pose       all vertices placed (bst_satellite_pose_set)
 *            eye_m      start of the ray, body frame
 *            direction  body frame, any length
 * Notes:     curved parts have the outline of their facets; a ray along an edge meets it */
bool bst_shape_silhouette_meets(const bst_satellite_pose *pose, bst_vec3 eye_m, bst_vec3 direction);

/* Part of the area of a silhouette that another one covers.
 *
 * Given:     clip   work memory
 *            front  covers; scaled and then shifted
 * Returned:  0 to 1 */
double bst_shape_silhouette_hidden(bst_polygon_clip *clip, const bst_shape_silhouette *silhouette,
                                   const bst_shape_silhouette *front, double scale,
                                   bst_point2 shift);

#endif
