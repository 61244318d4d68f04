/* A file that drives a sensor frame by frame: pointing, states of objects, and changes of exposure,
 * period, window, binning and field of view while the run goes on. docs/interfaces.md, "Frame
 * updates". */
#ifndef BST_WORLD_FRAME_UPDATES_H
#define BST_WORLD_FRAME_UPDATES_H

#include "boresight/messages.h"
#include "sim/world/world_config.h"

/* The file of one sensor; immutable once made. */
typedef struct bst_frame_updates bst_frame_updates;

/* Attitude at a time after the exposure's start. */
typedef struct bst_world_pointing_node {
    double time_s;
    bst_quat q_cam_from_gcrf; /* unit */
} bst_world_pointing_node;

/* States of an object at the start and at the end of one exposure, geocentric, m and m/s, in the
 * axes that the object's orbit names (states_frame). */
typedef struct bst_frame_object {
    char name[64];
    bst_vec3 start_position_m, start_velocity_mps, end_position_m, end_velocity_mps;
} bst_frame_object;

/* What the file says of one frame. */
typedef struct bst_frame_update {
    int64_t frame;                        /* number of the exposure */
    double exposure_s;                    /* < 0: as before */
    double period_s;                      /* <= 0: as before */
    double pixel_scale_arcsec;            /* 0: as before */
    bst_window window;                    /* width 0: as before */
    int binning;                          /* 0: as before */
    const bst_world_pointing_node *nodes; /* [node_count], times ascending: the first 0, the last
                                       the exposure */
    int node_count;                       /* 0: the file gives no pointing for this frame */
    const bst_frame_object *objects;
    int object_count;
} bst_frame_update;

/* Reads and checks a file for a sensor with this camera and these first settings. BST_ERR_CONFIG
 * names file, frame and key, what was found and what is allowed; BST_ERR_IO, BST_ERR_FORMAT as
 * bst_json_load. */
bst_status bst_frame_updates_load(bst_ctx *ctx, const char *path, const bst_camera *camera,
                                  const bst_exposure_config *exposure,
                                  bst_frame_updates **out) BST_MUST_CHECK;
/* The same from text; `name` stands for the path in messages. */
bst_status bst_frame_updates_parse(bst_ctx *ctx, const char *name, const char *text, size_t bytes,
                                   const bst_camera *camera, const bst_exposure_config *exposure,
                                   bst_frame_updates **out) BST_MUST_CHECK;
/* NULL is allowed. */
void bst_frame_updates_free(bst_frame_updates *updates);

/* Name of the file; it belongs to the updates. */
const char *bst_frame_updates_name(const bst_frame_updates *updates);
/* Number of updates. */
int bst_frame_updates_count(const bst_frame_updates *updates);
/* In the order of frames. */
const bst_frame_update *bst_frame_updates_item(const bst_frame_updates *updates, int index);

/* Goes through a sensor's frames with the settings that hold in each: a setting stays until the
 * file changes it. */
typedef struct bst_frame_cursor {
    const bst_frame_updates *updates; /* NULL: none */
    double tick_rate_hz;              /* 0: ticks are not wanted */
    int next;                         /* update that comes next */
    const bst_frame_update *update;   /* of this frame; NULL: none */
    int64_t frame;
    double start_s, exposure_s, period_s;
    int64_t start_tick, exposure_ticks, period_ticks; /* rounded to the nearest */
    bst_window window;
    int binning;
    double pixel_scale_arcsec;
} bst_frame_cursor;

/* At frame 0. `updates` may be NULL. */
bst_frame_cursor bst_frame_cursor_begin(const bst_frame_updates *updates, const bst_camera *camera,
                                        const bst_exposure_config *exposure, double tick_rate_hz);
/* On to the next frame: it starts one period after this one's start, or at its end if that is
 * later. */
void bst_frame_cursor_next(bst_frame_cursor *cursor);

/* Longest exposure (from the first to the last row of a rolling shutter) and shortest time between
 * two starts that a file leads to. */
void bst_frame_updates_limits(const bst_frame_updates *updates, const bst_camera *camera,
                              const bst_exposure_config *exposure, double *longest_exposure_s,
                              double *shortest_cycle_s);

/* A camera at another pixel scale. BST_ERR_CONFIG as bst_camera_prepare. */
bst_status bst_world_camera_at_scale(bst_ctx *ctx, const bst_camera *camera,
                                     double pixel_scale_arcsec, bst_camera *out) BST_MUST_CHECK;

#endif
