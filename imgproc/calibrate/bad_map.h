/* Pixels of the sensor that are left out. */
#ifndef BST_IMGPROC_CALIBRATE_BAD_MAP_H
#define BST_IMGPROC_CALIBRATE_BAD_MAP_H

#include "imgproc/imgproc.h"

/* The bad pixels of a map (maps->bad, may be NULL) and of a list of bst_imgproc_bad_pixel together:
 * [height_px][width_px], the caller's to free; NULL where there are none. BST_ERR_CONFIG for a
 * pixel outside the sensor, BST_ERR_MEMORY. */
bst_status bst_bad_map_create(bst_ctx *ctx, const bst_camera *camera, const bst_imgproc_maps *maps,
                              const bst_config_list *list, uint8_t **out) BST_MUST_CHECK;

#endif
