/* The objects of a field query; inside of sim/world. */
#ifndef BST_WORLD_SCENE_FIELD_OBJECTS_H
#define BST_WORLD_SCENE_FIELD_OBJECTS_H

#include "sim/world/scene/field.h"
#include "sim/world/world_internal.h"

typedef struct bst_scene_object_query {
    bst_world_view *view;
    const bst_camera *camera;
    bst_world_view_span span;
    bst_quat q_mid; /* camera attitude half way */
    bst_window window;
    double margin_px; /* of the window, with what the attitude moves during the exposure */
    bst_vec3 centre;  /* a cone of directions (GCRF) that holds the window with its margin: axis */
    double radius;    /* and half angle, rad */
} bst_scene_object_query;

/* What the light of an object through an exposure follows from. */
typedef struct bst_scene_path_light {
    bst_vec3 eye_m[BST_PATH_NODES]; /* the observer at the path's times, geocentric */
    bst_vec3 lag_m;                 /* at mid-exposure: the object when the light left, from the
                                       object when it arrives */
    bst_vec3 sun_m[BST_PATH_NODES]; /* the Sun, likewise */
    bst_vec3 earth_bary_mps, pole;  /* as in bst_bodies, at mid-exposure */
    double light_time_s;
} bst_scene_path_light;

/* How bright the object is at time u in [0, 1] of a span: fills phase,
 * sunlit fraction and light of *out. */
void bst_scene_view_light(const bst_world_view *view, const bst_world_view_span *span, int object,
                          const bst_scene_source_path *path, const bst_scene_path_light *light,
                          double u, bst_world_sight *out);

/* Description of an object of the view's world. */
const bst_world_object_info *bst_scene_view_object(const bst_world_view *view, int object);

/* Memory of a source for what belongs to it. */
typedef struct bst_scene_object_parts {
    bst_scene_source_path path;
    bst_scene_source_rate rate;
    bst_scene_source_shape shape;
} bst_scene_object_parts;

/* Makes the source of an object, which keeps `parts`. *there false (and nothing to be used) when it
 * does not touch the window, has no orbit then, or is the observer itself. */
bst_status bst_field_object(bst_ctx *ctx, const bst_scene_object_query *query, int object,
                            bst_scene_object_parts *parts, bst_scene_source *out,
                            bool *there) BST_MUST_CHECK;

/* Fills a rate by what `at(user, u)` gives, so that straight lines between the knots follow it to
 * 1e-5 of its maximum where the knots suffice. *mean: mean over the exposure. false, and *mean the
 * value at the middle, when it hardly changes (by less than 1e-3) or is 0 throughout. */
bool bst_field_rate(double (*at)(void *user, double u), void *user, bst_scene_source_rate *out,
                    double *mean);

#endif
