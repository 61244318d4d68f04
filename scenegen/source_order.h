/* The order in which a frame's sources are drawn: neighbours together. */
#ifndef BST_SCENEGEN_SOURCE_ORDER_H
#define BST_SCENEGEN_SOURCE_ORDER_H

#include "boresight/camera.h"
#include "scenegen/kernels/scene_shared.h"

/* Writes the `count` sources to `sorted` by the cells of the sensor that they are in, those of one
 * cell as they come, so that what a tile draws lies together in memory. The order of two sources
 * depends on nothing but their places and their order in `list`: each pixel sums its light in the
 * same order for every window. */
void bst_source_order(const bst_camera *camera, const bst_kernel_source_record *list, int count,
                      bst_kernel_source_record *sorted);

#endif
