/* Full-sensor map of the bad detector pixels that the configuration lists. */
#ifndef BST_IMGPROC_CALIBRATE_BAD_MAP_H
#define BST_IMGPROC_CALIBRATE_BAD_MAP_H

#include "imgproc/imgproc.h"

/* Combines the bad pixels of a calibration map (maps->bad, may be NULL) with those of a configured
 * list of bst_imgproc_bad_pixel.
 *
 * Returned:  *out  [height_px][width_px], 1: bad; NULL if no pixel is bad
 * Errors:    BST_ERR_CONFIG for a pixel outside the sensor, BST_ERR_MEMORY
 * Ownership: the caller frees *out */
bst_status bst_bad_map_create(bst_ctx *ctx, const bst_camera *camera, const bst_imgproc_maps *maps,
                              const bst_config_list *list, uint8_t **out) BST_MUST_CHECK;

#endif
