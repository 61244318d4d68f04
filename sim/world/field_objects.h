/* The objects of a field query; inside of sim/world. */
#ifndef BST_WORLD_FIELD_OBJECTS_H
#define BST_WORLD_FIELD_OBJECTS_H

#include "sim/world/field.h"
#include "sim/world/world_internal.h"

typedef struct bst_object_query {
    bst_view *view;
    const bst_camera *camera;
    int observer;
    double start_s, end_s; /* of the exposure */
    bst_quat q_mid;        /* camera attitude half way */
    bst_window window;
    double margin_px; /* of the window, with what the attitude moves during the exposure */
    bst_vec3 centre;  /* a cone of directions (GCRF) that holds the window with its margin: axis */
    double radius;    /* and half angle, rad */
} bst_object_query;

/* Makes the source of an object, which keeps `path`. *there false (and nothing to be used) when it
 * does not touch the window, has no orbit then, or is the observer itself. */
bst_status bst_field_object(bst_ctx *ctx, const bst_object_query *query, int object,
                            bst_source_path *path, bst_source *out, bool *there) BST_MUST_CHECK;

#endif
