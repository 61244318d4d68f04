/* What a run's tables know of its frames, exposure after exposure: one pass over each table,
 * however many frames there are. */
#ifndef BST_EXPORT_FRAME_MARKS_H
#define BST_EXPORT_FRAME_MARKS_H

#include "sim/io/frame_picture.h"
#include "sim/io/run_reader.h"

typedef struct bst_frame_marks bst_frame_marks;

/* `sensor` is the row of the table sensors, `target` the name of what it looks for ("" for none).
 * Tables that were not recorded give no marks. */
bst_status bst_frame_marks_create(bst_ctx *ctx, const bst_run_reader *run, int64_t sensor,
                                  const char *target, bst_frame_marks **out) BST_MUST_CHECK;
/* Frees the marks of a frame and closes their rows; NULL is allowed. */
void bst_frame_marks_free(bst_frame_marks *marks);

/* Number of the exposure of plane or extension `fits_index`, -1 when the tables do not say. Ask in
 * ascending order. */
bst_status bst_frame_marks_exposure(bst_ctx *ctx, bst_frame_marks *marks, int64_t fits_index,
                                    int64_t *exposure_id) BST_MUST_CHECK;

/* Marks by falling importance, and caption, of an exposure, in pixels of its frame; valid until the
 * next call. Ask in ascending order. */
bst_status bst_frame_marks_get(bst_ctx *ctx, bst_frame_marks *marks, int64_t exposure_id,
                               bst_io_overlay *out) BST_MUST_CHECK;

#endif
