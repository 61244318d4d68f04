/* Places of the bodies of a run, for the page's view of space: recomputed from its scenario.json.
 */
#ifndef BST_VIEW_SPACE_H
#define BST_VIEW_SPACE_H

#include "view/routes.h"

enum {
    BST_VIEW_SPACE_BODIES = 20000, /* observers and objects that are shown; further ones are not */
    BST_VIEW_SPACE_HEAD = 15,      /* numbers of a sky before the bodies */
    BST_VIEW_SPACE_BODY = 6,       /* numbers of a body */
    BST_VIEW_SPACE_POSES = 20000,  /* attitudes of a sensor; more are thinned */
    BST_VIEW_SPACE_POSE = 5        /* numbers of an attitude */
};

/* What there is: {span_s, observers: [name], objects: [name], total, sensors: [{observer, name,
 * object, corners, keep_out}], shapes} (the last two: view/space_shapes.h). observer, object:
 * index; object -1: no target. corners: unit vectors in the camera's frame, of the first row from
 * left to right, then of the last one from right to left. total: objects of the run, of which the
 * first are listed.
 *
 * Returned:  x->json
 * Errors:    those of bst_run_scene_open */
bst_status bst_view_route_space_scene(bst_ctx *ctx, bst_view_exchange *x) BST_MUST_CHECK;

/* The sky at x->from_s: Sun and Moon (m, geocentric), rotation from GCRF to the Earth (rows), then
 * position (m) and velocity (m/s) of observers and objects, in the order of the scene, GCRF; NAN
 * where a body has no state, for example after decay.
 *
 * Returned:  x->bytes, doubles: BST_VIEW_SPACE_HEAD, then BST_VIEW_SPACE_BODY for each body
 * Errors:    those of bst_run_scene_open; BST_ERR_ARGUMENT: before the epoch or later than 1e9 s;
 *            BST_ERR_RANGE: no Earth orientation for that time */
bst_status bst_view_route_space_states(bst_ctx *ctx, bst_view_exchange *x) BST_MUST_CHECK;

/* True attitudes of a sensor's camera at its exposures.
 *
 * Returned:  x->bytes, doubles: BST_VIEW_SPACE_POSE for each: middle of the exposure (s),
 * quaternion camera from GCRF (x, y, z, w) Errors:    BST_ERR_NOT_FOUND: no such sensor;
 * BST_ERR_FORMAT: damaged tables */
bst_status bst_view_route_space_poses(bst_ctx *ctx, bst_view_exchange *x) BST_MUST_CHECK;

/* A coastline, where there is one: the shapefile (ESRI, polygons or lines in degrees) that the
 * environment variable BORESIGHT_COASTLINE names, else the coarse one of Debian's
 * python-cartopy-data (GSHHG, Wessel and Smith 1996, JGR 101, 8741).
 *
 * Returned:  x->bytes, the file; empty where there is none
 * Errors:    BST_ERR_FORMAT: larger than 16 MiB; those of bst_file_read but a file that is missing
 */
bst_status bst_view_route_space_coast(bst_ctx *ctx, bst_view_exchange *x) BST_MUST_CHECK;

#endif
