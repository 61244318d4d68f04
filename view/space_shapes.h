/* Shapes of objects and their attitudes, and what an observer keeps away from, for the page's view
 * of space. */
#ifndef BST_VIEW_SPACE_SHAPES_H
#define BST_VIEW_SPACE_SHAPES_H

#include "view/routes.h"

enum {
    BST_VIEW_SHAPE_HEAD = 2,      /* numbers before the triangles */
    BST_VIEW_SHAPE_TRIANGLE = 13, /* numbers of a triangle */
    BST_VIEW_POSE_HEAD = 6,       /* numbers of a pose before the joints */
    BST_VIEW_POSE_JOINT = 12      /* numbers of a joint */
};

/* Adds to the description of the scene: shapes: [{object, radius_m, triangles}] of the objects that
 * have one, and to each of `sensors` what its controller keeps away from, if it does: keep_out:
 * {sun_deg, moon_deg, earth, earth_limb_deg, earth_limb_altitude_km}, of its guidance; 0 and false:
 * nothing. Call it with the run locked. */
void bst_view_space_add_shapes(const bst_view_run *run, cJSON *scene);

/* Triangles of the shape of object x->object.
 *
 * Returned:  x->bytes, doubles: number of joints, number of triangles, then
 *            BST_VIEW_SHAPE_TRIANGLE for each: joint (-1: the body), red, green, blue (0 to 1: of
 *            the material at 0.70, 0.55 and 0.40 um), three corners (m, frame of the joint),
 *            counter-clockwise from outside
 * Errors:    BST_ERR_NOT_FOUND: no such object, or it has no shape; BST_ERR_MEMORY */
bst_status bst_view_route_space_shape(bst_ctx *ctx, bst_view_exchange *x) BST_MUST_CHECK;

/* Attitude of the shape of object x->object at x->from_s. For the exposure of sensor x->sensor
 * whose middle is then, it is the one that the run recorded (table shapes), else that of the run's
 * scenario. Joints follow Sun, Earth and the observer of that sensor.
 *
 * Returned:  x->bytes, doubles: q_body_from_gcrf (x, y, z, w), visible fraction of the Sun's disc,
 *            1 if the attitude was recorded, then BST_VIEW_POSE_JOINT for each joint: rotation from
 *            its frame to the body (rows), origin (m, body frame)
 * Errors:    BST_ERR_NOT_FOUND: no such object or sensor, or no shape; those of the orbits */
bst_status bst_view_route_space_pose(bst_ctx *ctx, bst_view_exchange *x) BST_MUST_CHECK;

#endif
