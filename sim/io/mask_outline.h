/* Outlines of sources in a segmentation mask as polygons, for COCO's "segmentation". */
#ifndef BST_IO_MASK_OUTLINE_H
#define BST_IO_MASK_OUTLINE_H

#include <stdint.h>
#include <stdio.h>

#include "boresight/status.h"

/* A mask and the position of the source `item` in it. */
typedef struct bst_mask_item {
    const int32_t *mask; /* row-major [..][width] */
    int width;
    int32_t item;
    int x0, y0, x1, y1; /* bounding box of its pixels; x1 and y1 exclusive */
} bst_mask_item;

/* Writes the outline of a source as JSON: a list of polygons, each a list x, y, x, y, ...
 * Given: item; stream. Coordinates are along the edges of pixels, whole numbers from the image's
 * upper left corner.
 * Returned: the polygons, one for each set of pixels that share edges; [] for a source without
 * pixels. The sources' pixels are those whose centres lie inside a polygon by the even-odd rule. A
 * hole is joined to its outline by a seam, two lines of which one goes back along the other.
 * Errors: BST_ERR_MEMORY.
 * Source: COCO (cocodataset.org, "Data format", object detection): polygons where "iscrowd" is 0.
 */
bst_status bst_mask_outline_write(bst_ctx *ctx, const bst_mask_item *item,
                                  FILE *stream) BST_MUST_CHECK;

#endif
