/* Rolling shutter: exposure times of rows, and sources during them. */
#ifndef BST_WORLD_SCENE_ROW_EXPOSURE_H
#define BST_WORLD_SCENE_ROW_EXPOSURE_H

#include "sim/world/scene/field.h"

/* Exposure times of a window's rows: exposure_s each, the middle row at the middle of the track. */
typedef struct bst_row_times {
    double row_time_s; /* not 0 */
    double exposure_s;
    bst_window window;
} bst_row_times;

/* Start of the exposure at row position y_px (full sensor, may be fractional), since the start of
 * the track. */
double bst_row_start_s(const bst_row_times *rows, const bst_los_track *track, double y_px);

/* Exposure of a source with a rolling shutter, as fractions of the track: u[0] its row's exposure
 * starts, u[1] the exposure of its row at that time ends. Outside the window the nearest row
 * counts; behind the camera, the middle row. */
void bst_row_source_times(const bst_camera *camera, const bst_row_times *rows,
                          const bst_los_track *track, const bst_scene_source *source, double u[2]);

/* Memory for a source restricted to a time interval. */
typedef struct bst_scene_source_part {
    bst_scene_source_path path;
    bst_scene_source_rate rate;
} bst_scene_source_part;

/* Restricts a source to time u0 to u1 of its track (0 <= u0 < u1 <= 1), with the mean brightness of
 * that interval. Exact: the polynomials are the same. *out points into *part. */
void bst_scene_source_during(const bst_scene_source *source, double u0, double u1,
                             bst_scene_source_part *part, bst_scene_source *out);

#endif
