/* Objects of a field query. Internal to sim/world. */
#ifndef BST_WORLD_SCENE_FIELD_OBJECTS_H
#define BST_WORLD_SCENE_FIELD_OBJECTS_H

#include "sim/world/scene/field.h"
#include "sim/world/scene/object_shape.h"
#include "sim/world/scene/source_body.h"
#include "sim/world/world_internal.h"

/* A cone of directions: axis (unit, GCRF), half angle in rad. */
typedef struct bst_scene_cone {
    bst_vec3 axis;
    double radius;
} bst_scene_cone;

typedef struct bst_scene_object_query {
    bst_world_view *view;
    const bst_camera *camera;
    bst_world_view_span span;
    bst_quat q_mid;    /* camera attitude at mid-exposure */
    bst_window lit;    /* part of the sensor whose sources count: the window, or more */
    bst_window window; /* beside which a source is `outside`, if `lit` is wider */
    bool wider;
    double margin_px;               /* around both, including the motion during the exposure */
    bst_scene_cone cone, near_cone; /* contain `lit` and the window with the margin */
} bst_scene_object_query;

/* Inputs of an object's brightness during an exposure. */
typedef struct bst_scene_path_light {
    bst_vec3 eye_m[BST_PATH_NODES]; /* geocentric observer at the times of the path */
    bst_vec3 lag_m; /* at mid-exposure: object at emission minus object at reception */
    bst_vec3 sun_m[BST_PATH_NODES]; /* the Sun, likewise */
    bst_vec3 earth_bary_mps, pole;  /* as in bst_bodies, at mid-exposure */
    double light_time_s;
} bst_scene_path_light;

/* Brightness of an object at time u in [0, 1] of a span: fills phase, sunlit fraction and light of
 * *out. */
void bst_scene_view_light(const bst_world_view *view, const bst_world_view_span *span, int object,
                          const bst_scene_source_path *path, const bst_scene_path_light *light,
                          double u, bst_world_sight *out);

/* Where an object with a shape stands to its light at time u in [0, 1] of a span. */
void bst_scene_view_aspect(const bst_world_view *view, const bst_world_view_span *span, int object,
                           const bst_scene_source_path *path, const bst_scene_path_light *light,
                           double u, bst_object_aspect *out);

/* The view's work memory for an object's shape. */
bst_satellite_pose *bst_scene_view_pose(const bst_world_view *view, int object);

/* The body of an object with a shape during a span, for a camera. */
void bst_scene_view_body(const bst_world_view *view, const bst_world_view_span *span, int object,
                         const bst_scene_source_path *path, const bst_scene_path_light *light,
                         const bst_camera *camera, bst_scene_source_body *out);

/* Description of an object in the world of a view. */
const bst_world_object_info *bst_scene_view_object(const bst_world_view *view, int object);

/* Memory for the path, rate and shape of one source. */
typedef struct bst_scene_object_parts {
    bst_scene_source_path path;
    bst_scene_source_rate rate;
    bst_scene_source_shape shape;
    bst_scene_source_body *body; /* NULL: none; kept for later queries */
} bst_scene_object_parts;

/* Makes the source of an object; `parts` holds its path, rate and shape. *there false: it does not
 * touch the window, has no orbit at that time, or is the observer itself. */
bst_status bst_field_object(bst_ctx *ctx, const bst_scene_object_query *query, int object,
                            bst_scene_object_parts *parts, bst_scene_source *out,
                            bool *there) BST_MUST_CHECK;

/* Where the sampling of a light curve begins, and how far it goes. */
typedef struct bst_field_rate_start {
    int intervals;       /* equal ones; even, at most 64 */
    const double *times; /* more times, unordered, within (0, 1) */
    int time_count;
    int most_knots; /* at most BST_RATE_KNOTS, and above intervals + 1 + time_count */
} bst_field_rate_start;

/* Samples a brightness so that linear interpolation is accurate to 1e-5 of the maximum, if the
 * knots suffice: intervals are halved where a straight line misses most light.
 *
 * Given:     at     brightness at a time in [0, 1]
 * Returned:  *out   knots; `error` is the light by which the halved intervals still differ
 *            *mean  mean over the exposure; at the middle if false is returned
 * Value:     false: the change is below 1e-3, or the brightness is 0 */
bool bst_field_rate(double (*at)(void *user, double u), void *user,
                    const bst_field_rate_start *start, bst_scene_source_rate *out, double *mean);

#endif
