/* Render order of a frame's sources: neighbours together. */
#ifndef BST_SCENEGEN_SOURCE_ORDER_H
#define BST_SCENEGEN_SOURCE_ORDER_H

#include "boresight/camera.h"
#include "scenegen/kernels/scene_shared.h"

/* Sorts `count` sources by sensor cell, keeping the order within a cell, so that a tile's sources
 * are adjacent in memory. The order of two sources depends only on their positions and their order
 * in `list`; each pixel therefore sums its light in the same order for every window. */
void bst_source_order(const bst_camera *camera, const bst_kernel_source_record *list, int count,
                      bst_kernel_source_record *sorted);

#endif
