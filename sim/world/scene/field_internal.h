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
    int *ghost_near;             /* those for ghosts; NULL: never needed */
    bst_star_occultation hiding; /* stars behind satellites */
    bst_quat q_mid;
    double exposure_s;
    bst_quat sigma_q[BST_FIELD_SIGMA_POINTS];
    double sigma_time[BST_FIELD_SIGMA_POINTS]; /* fraction of the exposure */
};

/* State of one field query. */
typedef struct bst_field_scene {
    double start_s, end_s; /* start and end of the attitude track */
    double mid_s, exposure_s;
    bst_los_track own; /* track of the exposure alone */
    bst_quat mean;
    bst_window window;
    bst_window lit;           /* part of the sensor whose sources count: the window, or more */
    bool wider;               /* it is more */
    double margin_px;         /* around `lit`, including the motion during the exposure */
    bst_scene_cone cone;      /* contains `lit` with its margin */
    bst_scene_cone near_cone; /* contains the window with its margin */
    bst_world_state eye;
    bst_bodies bodies;
    bst_mat3 itrf_from_gcrf;
    bst_light light, geocentric;
    double v_limit, faint_limit; /* magnitude limits: catalogue stars; statistical stars */
    double ghost_sigma;          /* as in bst_field_options; 0: no ghosts */
    double image_margin_px;      /* margin_px without the motion */
    int binning;
    double ghost_least_e; /* light of a ghost in a read-out pixel that counts, e- */
} bst_field_scene;

/* Collects catalogue stars, then statistical stars down to faint_limit, in the cone of a query. */
bst_status bst_field_query_stars(bst_ctx *ctx, bst_field *field, const bst_field_scene *q,
                                 int *count) BST_MUST_CHECK;
/* Makes the source of a star. False: its image does not touch the lit part of the sensor. */
bool bst_field_make_star(const bst_field *field, const bst_field_scene *q, const bst_star *star,
                         bst_scene_source *s);
/* Computes the cone of directions that contains a part of the sensor with its margin. */
bst_scene_cone bst_field_find_cone(const bst_field *field, const bst_field_scene *q,
                                   bst_window window);
/* Makes room for `count` sources. */
bst_status bst_field_reserve_sources(bst_ctx *ctx, bst_field *field, int count) BST_MUST_CHECK;
/* True if a catalogue object is the observer's own satellite. */
bool bst_field_is_self(const bst_field *field, int index);

#endif
