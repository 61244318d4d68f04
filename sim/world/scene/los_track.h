/* The line of sight of one exposure, cut out of the history. */
#ifndef BST_WORLD_SCENE_LOS_TRACK_H
#define BST_WORLD_SCENE_LOS_TRACK_H

#include "sim/world/scene/field.h"

/* What a track lies in. All zero: empty. */
typedef struct bst_los_track_store {
    double *time_s;
    bst_quat *q;
    int capacity;
} bst_los_track_store;

/* As bst_field_track; the track is held in `store` until the next call. */
bst_status bst_los_track_cut(bst_ctx *ctx, bst_los_track_store *store,
                             const bst_los_history *history, int64_t start_tick, int64_t end_tick,
                             int64_t tick_rate_hz, bst_los_track *out) BST_MUST_CHECK;
/* The part of a track from from_s to to_s, held in `store`. */
bst_status bst_los_track_part(bst_ctx *ctx, bst_los_track_store *store, const bst_los_track *track,
                              double from_s, double to_s, bst_los_track *out) BST_MUST_CHECK;
/* What it holds. */
void bst_los_track_store_free(bst_los_track_store *store);

/* Attitude at a time since the exposure's start, within it. */
bst_quat bst_los_track_attitude(const bst_los_track *track, double time_s);

/* How far, in px, any point of the image moves at most from one attitude to another. */
double bst_los_track_moved_px(const bst_camera *camera, bst_quat from, bst_quat to);
/* The same for a turn (rotation vector, camera axes). */
double bst_los_track_turned_px(const bst_camera *camera, bst_vec3 turn_rad);

#endif
