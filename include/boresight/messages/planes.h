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
    BST_PLANE_COUNT
} bst_plane;

/* planes (latest): of the frame written in the same step, the expected electrons per pixel from
 * stars, from objects, and from sky and dark current; the brightest source of each pixel; and its
 * saturation. For hooks of the engine only: the images belong to their writer, which overwrites
 * them in its next step. */
typedef struct bst_planes {
    int64_t exposure_id;
    int width, height;                              /* of the frame: its window over its binning */
    const float *electrons[BST_PLANE_SEGMENTATION]; /* [height][width] by bst_plane; NULL: not
                                                       asked for */
    const int32_t *segmentation; /* [height][width]: 0, or 1 + number of the item of `truth` that
                                    gives most light there; NULL: not asked for */
    const uint8_t *saturation;   /* [height][width]: 0, or 1: the well is full (one of those that
                                    were added), 2: the converter is at its top, 3: both; NULL: not
                                    asked for */
} bst_planes;

#endif
