/* Fixed-point positions on the sensor: fractions of a pixel, as fine as the sensor's size permits.
 */
#ifndef BST_SCENEGEN_STAMP_FIXED_POINT_PX_H
#define BST_SCENEGEN_STAMP_FIXED_POINT_PX_H

#include "boresight/camera.h"
#include "scenegen/kernels/scene_shared.h"

/* Longest stamp, px. */
enum { BST_PLACE_TAPS = 512 };

/* Distance from the boresight, px without distortion, beyond which a point's light stays off the
 * sensor. */
static inline double bst_fixed_point_px_far_px(const bst_camera *c) {
    return tan(bst_camera_half_diagonal_rad(c)) / bst_camera_scale_rad(c) +
           BST_PLACE_TAPS / fmax(bst_camera_shrink(c), 0.01);
}

/* Fractional bits of a position: four times the distance above stays below BST_PLACE_LIMIT. */
static inline int bst_fixed_point_px_bits(const bst_camera *c) {
    return (int)fmax(floor(log2(BST_PLACE_LIMIT / (4.0 * bst_fixed_point_px_far_px(c)))), 1.0);
}

#endif
