/* Outlines of sources and of parts of satellites in exported frames: the planes segmentation and
 * parts of a run. */
#ifndef BST_EXPORT_MASK_LABELS_H
#define BST_EXPORT_MASK_LABELS_H

#include "sim/export/export.h"
#include "sim/io/fits_reader.h"

struct cJSON;

/* Bounding box of the pixels of one value; x1 and y1 exclusive; pixels 0: none. */
typedef struct bst_mask_extent {
    int x0, y0, x1, y1;
    int64_t pixels;
} bst_mask_extent;

/* A part of an object: row of table parts. */
typedef struct bst_mask_part {
    int64_t number, object;
    char name[64];
} bst_mask_part;

/* A recorded plane of a sensor. All zero: none. */
typedef struct bst_mask_labels {
    bst_fits_reader *fits;   /* NULL: the run has no such plane */
    bst_fits_read_mask mask; /* of the current frame; items NULL: none */
    bst_mask_extent *extents;
    int extent_count, extent_room; /* by value */
    bst_mask_part *parts;
    int part_count;
} bst_mask_labels;

/* Opens a plane of a sensor. Free with bst_mask_labels_close.
 *
 * Given:     file   FITS file of the sensor's frames
 *            plane  "segmentation", or "parts", which reads the table parts too
 * Returned:  *out   fits NULL: the run has no such plane */
bst_status bst_mask_labels_open(bst_ctx *ctx, const bst_run_reader *run, const char *file,
                                const char *plane, bst_mask_labels *out) BST_MUST_CHECK;
/* Frees the memory and clears the struct, which belongs to the caller. */
void bst_mask_labels_close(bst_mask_labels *labels);

/* The frame to which a mask must belong. */
typedef struct bst_mask_frame {
    int64_t index, exposure_id; /* index: from 0 in the file */
    int width, height;
} bst_mask_frame;

/* Reads the mask of a frame and the extents of its values. BST_ERR_FORMAT: it belongs to another
 * exposure, or its values are out of range. */
bst_status bst_mask_labels_read(bst_ctx *ctx, bst_mask_labels *labels,
                                const bst_mask_frame *frame) BST_MUST_CHECK;

/* Pixels of a value in the current frame. */
int64_t bst_mask_labels_pixels(const bst_mask_labels *labels, int64_t value);

/* Adds "area" (pixels) and "segmentation" (polygons of the outline) of a value that has pixels. */
bst_status bst_mask_labels_add(bst_ctx *ctx, const bst_mask_labels *labels, int64_t value,
                               struct cJSON *node) BST_MUST_CHECK;

/* Adds the array "parts" of an object: name, number, bbox, area and segmentation of each part that
 * has pixels. Nothing if the run has no plane of parts.
 *
 * Given:     fractions  bbox and segmentation in shares of the image's width and height, instead of
 *                       pixels; the area is in pixels */
bst_status bst_mask_labels_add_parts(bst_ctx *ctx, const bst_mask_labels *labels, int64_t object,
                                     bool fractions, struct cJSON *node) BST_MUST_CHECK;

#endif
