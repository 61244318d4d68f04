/* Labels of objects with a shape in exported frames: the table shapes of a run. */
#ifndef BST_EXPORT_SHAPE_LABELS_H
#define BST_EXPORT_SHAPE_LABELS_H

#include "sim/export/export.h"

struct cJSON;

/* Truth of an object's shape; full-sensor pixels. */
typedef struct bst_shape_label {
    double x_px, y_px;                 /* centre of mass */
    double x0_px, y0_px, x1_px, y1_px; /* box around all parts */
    double size_px, phase_deg, range_m;
    double q_body_from_gcrf[4]; /* x, y, z, w */
} bst_shape_label;

/* Rows of the table of one sensor, in the order of exposure and item. All zero: none. */
typedef struct bst_shape_labels {
    bst_io_rows *rows; /* NULL: the run has no such table */
    bool more;
} bst_shape_labels;

/* Opens the labels of a sensor. A run without the table has none. Free with bst_shape_labels_close.
 */
bst_status bst_shape_labels_open(bst_ctx *ctx, const bst_export *export, int sensor,
                                 bst_shape_labels *out) BST_MUST_CHECK;
/* Ends the labels of a sensor and clears the struct, which belongs to the caller. */
void bst_shape_labels_close(bst_shape_labels *labels);

/* Finds the label of an item of the truth. Requests come in the order of exposure and item.
 *
 * Returned:  *found  false: the item has no shape, or a part of it is behind the camera */
bst_status bst_shape_labels_find(bst_ctx *ctx, bst_shape_labels *labels, int64_t exposure_id,
                                 int64_t item, bst_shape_label *out, bool *found) BST_MUST_CHECK;

/* Image coordinates of a label: (pixel - first + 0.5) / scale. */
typedef struct bst_shape_label_view {
    double first_x_px, first_y_px, scale_x, scale_y;
} bst_shape_label_view;

/* Adds the object "shape" to an annotation. */
void bst_shape_label_add(const bst_shape_label *label, const bst_shape_label_view *view,
                         struct cJSON *node);

#endif
