/* Overlay marks of a run's frames (truth, detections, tracks) from its tables: one pass over each
 * table for all frames. */
#ifndef BST_EXPORT_FRAME_MARKS_H
#define BST_EXPORT_FRAME_MARKS_H

#include "sim/io/frame_picture.h"
#include "sim/io/run_reader.h"

typedef struct bst_frame_marks bst_frame_marks;

/* Opens the tables for marks. `sensor`: row of the table sensors; `target`: name of its target, "":
 * none. Tables that were not recorded give no marks. */
bst_status bst_frame_marks_create(bst_ctx *ctx, const bst_run_reader *run, int64_t sensor,
                                  const char *target, bst_frame_marks **out) BST_MUST_CHECK;
/* Frees frame marks and closes their tables; NULL is allowed. */
void bst_frame_marks_free(bst_frame_marks *marks);

/* Exposure number of plane or extension `fits_index` of the frame file; -1: unknown. Call it in
 * ascending order. */
bst_status bst_frame_marks_exposure(bst_ctx *ctx, bst_frame_marks *marks, int64_t fits_index,
                                    int64_t *exposure_id) BST_MUST_CHECK;

/* Marks (by decreasing importance) and caption of an exposure, in frame pixels; valid until the
 * next call. Call it in ascending order. */
bst_status bst_frame_marks_get(bst_ctx *ctx, bst_frame_marks *marks, int64_t exposure_id,
                               bst_io_overlay *out) BST_MUST_CHECK;

#endif
