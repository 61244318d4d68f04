/* The camera attitude during one exposure, extracted from los_history. */
#ifndef BST_WORLD_SCENE_LOS_TRACK_H
#define BST_WORLD_SCENE_LOS_TRACK_H

#include "sim/world/scene/field.h"

/* Memory of a track. All zero: empty. */
typedef struct bst_los_track_store {
    double *time_s;
    bst_quat *q;
    int capacity;
} bst_los_track_store;

/* Extracts the track of an exposure as bst_field_track; `store` holds it until the next call. */
bst_status bst_los_track_cut(bst_ctx *ctx, bst_los_track_store *store,
                             const bst_los_history *history, int64_t start_tick, int64_t end_tick,
                             int64_t tick_rate_hz, bst_los_track *out) BST_MUST_CHECK;
/* The part of a track between two times; `store` holds it. */
bst_status bst_los_track_part(bst_ctx *ctx, bst_los_track_store *store, const bst_los_track *track,
                              double from_s, double to_s, bst_los_track *out) BST_MUST_CHECK;
/* Frees the memory of a track store. */
void bst_los_track_store_free(bst_los_track_store *store);

/* Camera attitude at a time since the start of the exposure. */
bst_quat bst_los_track_attitude(const bst_los_track *track, double time_s);

/* Largest displacement (px) of any image point between two camera attitudes. */
double bst_los_track_moved_px(const bst_camera *camera, bst_quat from, bst_quat to);
/* Largest displacement (px) of any image point by a rotation vector in camera axes. */
double bst_los_track_turned_px(const bst_camera *camera, bst_vec3 turn_rad);

#endif
