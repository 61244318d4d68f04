/* Channel planes: noise-free images and masks of one frame. */
#ifndef BORESIGHT_MESSAGES_PLANES_H
#define BORESIGHT_MESSAGES_PLANES_H

#include <stdint.h>

#define BST_CHANNEL_PLANES "planes"

/* Images of a frame before the detector's effects, and masks. */
typedef enum bst_plane {
    BST_PLANE_STARS = 0,
    BST_PLANE_TARGETS,
    BST_PLANE_BACKGROUND,
    BST_PLANE_SEGMENTATION,
    BST_PLANE_SATURATION,
    BST_PLANE_PARTS,
    BST_PLANE_COUNT
} bst_plane;

/* planes (latest): for the frame of the same step: expected electrons per pixel from stars,
 * objects, and sky with dark current; brightest source of each pixel; saturation; parts of shapes.
 * For observers of the engine only: the writer overwrites the images in its next step. */
typedef struct bst_planes {
    int64_t exposure_id;
    int width, height; /* of the frame: its window over its binning */
    const float
        *electrons[BST_PLANE_SEGMENTATION]; /* [height][width] by bst_plane; NULL: not requested */
    const int32_t *segmentation; /* [height][width]: 0, or 1 + index of the item of `truth` with
                                    most light in the pixel; NULL: not requested */
    const uint8_t *saturation; /* [height][width]: 0; 1: full well (of a binned pixel); 2: converter
                                  limit; 3: both; NULL: not requested */
    const int32_t *parts; /* [height][width]: 0, or the number of the part of an object with a shape
                             that covers the pixel at mid-exposure; NULL: not requested */
} bst_planes;

#endif
