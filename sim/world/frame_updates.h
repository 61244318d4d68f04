/* Frame updates: a file that sets pointing, object states, exposure, period, window, binning and
 * field of view per frame. Format: docs/reference/file_formats.md, "Frame updates". */
#ifndef BST_WORLD_FRAME_UPDATES_H
#define BST_WORLD_FRAME_UPDATES_H

#include "boresight/archive.h"
#include "boresight/messages.h"
#include "sim/world/world_config.h"

/* The frame updates of one sensor; immutable. */
typedef struct bst_frame_updates bst_frame_updates;

/* Camera attitude at a time after the start of the exposure. */
typedef struct bst_world_pointing_node {
    double time_s;
    bst_quat q_cam_from_gcrf; /* unit */
} bst_world_pointing_node;

/* States of an object at the start and end of one exposure: geocentric, m and m/s, in the frame
 * that the object's orbit names (states_frame); and its attitudes then. It has one of them or
 * both. */
typedef struct bst_frame_object {
    char name[64];
    bool has_states, has_attitudes;
    bst_vec3 start_position_m, start_velocity_mps, end_position_m, end_velocity_mps;
    bst_quat start_q_body_from_gcrf, end_q_body_from_gcrf; /* unit */
} bst_frame_object;

/* Settings that the file gives for one frame. */
typedef struct bst_frame_update {
    int64_t frame;                        /* exposure number */
    double exposure_s;                    /* < 0: unchanged */
    double period_s;                      /* <= 0: unchanged */
    double pixel_scale_arcsec;            /* 0: unchanged */
    bst_window window;                    /* width 0: unchanged */
    int binning;                          /* 0: unchanged */
    const bst_world_pointing_node *nodes; /* [node_count], times ascending: the first 0, the last
                                       the exposure */
    int node_count;                       /* 0: no pointing given for this frame */
    const bst_frame_object *objects;
    int object_count;
} bst_frame_update;

/* Reads and checks a frame-updates file for a sensor with this camera and these initial settings.
 * BST_ERR_CONFIG names file, frame, key, the value found and the allowed values. BST_ERR_IO,
 * BST_ERR_FORMAT as bst_json_load. */
bst_status bst_frame_updates_load(bst_ctx *ctx, const char *path, const bst_camera *camera,
                                  const bst_exposure_config *exposure,
                                  bst_frame_updates **out) BST_MUST_CHECK;
/* As bst_frame_updates_load, from text in memory; messages show `name` as the path. */
bst_status bst_frame_updates_parse(bst_ctx *ctx, const char *name, const char *text, size_t bytes,
                                   const bst_camera *camera, const bst_exposure_config *exposure,
                                   bst_frame_updates **out) BST_MUST_CHECK;
/* Frees frame updates; NULL is allowed. */
void bst_frame_updates_free(bst_frame_updates *updates);

/* File name of the frame updates, owned by them. */
const char *bst_frame_updates_name(const bst_frame_updates *updates);
/* Number of frames in a frame-updates file. */
int bst_frame_updates_count(const bst_frame_updates *updates);
/* One frame update; they are sorted by frame. */
const bst_frame_update *bst_frame_updates_item(const bst_frame_updates *updates, int index);

/* Iterates over a sensor's frames with the settings in effect. A setting holds until the file
 * changes it. */
typedef struct bst_frame_cursor {
    const bst_frame_updates *updates; /* NULL: none */
    double tick_rate_hz;              /* 0: ticks are not needed */
    int next;                         /* index of the next update */
    const bst_frame_update *update;   /* update of this frame; NULL: none */
    int64_t frame;
    double start_s, exposure_s, period_s;
    int64_t start_tick, exposure_ticks, period_ticks; /* rounded to the nearest tick */
    bst_window window;
    int binning;
    double pixel_scale_arcsec;
} bst_frame_cursor;

/* Cursor at frame 0. `updates` may be NULL. */
bst_frame_cursor bst_frame_cursor_begin(const bst_frame_updates *updates, const bst_camera *camera,
                                        const bst_exposure_config *exposure, double tick_rate_hz);
/* Advances to the next frame. It starts one period after the start of the previous frame, or at the
 * end of that frame if this is later. */
void bst_frame_cursor_next(bst_frame_cursor *cursor);

/* Archives the position of a cursor. */
void bst_frame_cursor_archive(bst_frame_cursor *cursor, bst_archive *archive);

/* Longest exposure (from the first to the last row of a rolling shutter) and shortest frame period
 * that a file sets. */
void bst_frame_updates_limits(const bst_frame_updates *updates, const bst_camera *camera,
                              const bst_exposure_config *exposure, double *longest_exposure_s,
                              double *shortest_cycle_s);

/* Copies a camera with another pixel scale. BST_ERR_CONFIG as bst_camera_prepare. */
bst_status bst_world_camera_at_scale(bst_ctx *ctx, const bst_camera *camera,
                                     double pixel_scale_arcsec, bst_camera *out) BST_MUST_CHECK;

#endif
