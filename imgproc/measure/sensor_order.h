/* Sorts detections by row, then by column. */
#ifndef BST_IMGPROC_MEASURE_SENSOR_ORDER_H
#define BST_IMGPROC_MEASURE_SENSOR_ORDER_H

#include "imgproc/measure/locate.h"

/* Sorts the indices order[0..count-1] of located sources by y, then x, then index: counting sort by
 * pixel row, then within each row.
 *
 * Given:     height  of the frame, px
 *            swap    [count], row [height + 1]: work space */
void bst_sensor_order(const bst_imgproc_found *found, int count, int height, int *order, int *swap,
                      int *row);

#endif
