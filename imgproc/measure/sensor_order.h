/* The order of detections: by row, then by column. */
#ifndef BST_IMGPROC_MEASURE_SENSOR_ORDER_H
#define BST_IMGPROC_MEASURE_SENSOR_ORDER_H

#include "imgproc/measure/locate.h"

/* Orders the numbers order[0..count-1] of found ones on a frame of `height` rows by y, then x, then
 * number: into rows of pixels by counting, within them one by one. Work space: swap [count], row
 * [height + 1]. */
void bst_sensor_order(const bst_imgproc_found *found, int count, int height, int *order, int *swap,
                      int *row);

#endif
