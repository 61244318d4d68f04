/* A rolling shutter: when which row is exposed, and what a source does in that time. */
#ifndef BST_WORLD_SCENE_ROW_EXPOSURE_H
#define BST_WORLD_SCENE_ROW_EXPOSURE_H

#include "sim/world/scene/field.h"

/* How a window's rows are exposed: for exposure_s each, the middle row in the middle of the track.
 */
typedef struct bst_row_times {
    double row_time_s; /* not 0 */
    double exposure_s;
    bst_window window;
} bst_row_times;

/* Time since the track's start at which the exposure of the place y_px (full sensor, between rows
 * too) starts. */
double bst_row_start_s(const bst_row_times *rows, const bst_los_track *track, double y_px);

/* From when to when the source lights rows that are exposed: at u[0] its row's exposure starts, at
 * u[1] that of the row where it is then ends. Fractions of the track. Where it is not on the window
 * the window's nearest row counts; where it is not in front of the camera, the middle one. */
void bst_row_source_times(const bst_camera *camera, const bst_row_times *rows,
                          const bst_los_track *track, const bst_scene_source *source, double u[2]);

/* Room for what a part of a source's time needs. */
typedef struct bst_scene_source_part {
    bst_scene_source_path path;
    bst_scene_source_rate rate;
} bst_scene_source_part;

/* The source from time u0 to u1 of its track (0 <= u0 < u1 <= 1) as a source of its own, whose mean
 * brightness is that of the part. Exact: its polynomials are the same ones. *out points to *part.
 */
void bst_scene_source_during(const bst_scene_source *source, double u0, double u1,
                             bst_scene_source_part *part, bst_scene_source *out);

#endif
