/* Internal state of a field query; shared by field.c and field_truth.c. */
#ifndef BST_WORLD_SCENE_FIELD_INTERNAL_H
#define BST_WORLD_SCENE_FIELD_INTERNAL_H

#include "sim/world/scene/field.h"
#include "sim/world/scene/field_objects.h"
#include "sim/world/scene/los_track.h"
#include "sim/world/scene/skylight.h"
#include "sim/world/scene/star_occultation.h"

/* Sigma points in (attitude deviation, time) for the mean position (Julier and Uhlmann 1997). Exact
 * to second order; the first point, the mean, has zero weight. */
enum {
    BST_FIELD_SIGMA_DIMENSIONS = 4,
    BST_FIELD_SIGMA_POINTS = 2 * BST_FIELD_SIGMA_DIMENSIONS + 1
};

struct bst_field {
    const bst_world *world;
    bst_world_view *view;
    const bst_camera *camera;
    int observer;
    bst_los_track_store track, middle; /* middle: track of a rolling shutter's middle row */
    bst_star *stars;
    int star_capacity;
    bst_faint_stars *faint;      /* NULL: no statistical stars */
    bst_skylight *skylight;      /* NULL: the background is constant and uniform */
    const bst_skylight_map *map; /* of the latest query */
    bst_scene_source *sources;
    int source_capacity;
    bst_scene_object_parts *parts; /* [part_capacity], for the objects among the sources */
    int part_capacity;
    int *near;                   /* candidate objects; room for all */
    bst_star_occultation hiding; /* stars behind satellites */
    bst_quat q_mid;
    double exposure_s;
    bst_quat sigma_q[BST_FIELD_SIGMA_POINTS];
    double sigma_time[BST_FIELD_SIGMA_POINTS]; /* fraction of the exposure */
};

#endif
