/* Windows of a frame that image processing looks at: round predicted places. */
#ifndef BST_IMGPROC_DETECT_REGION_OF_INTEREST_H
#define BST_IMGPROC_DETECT_REGION_OF_INTEREST_H

#include <stdbool.h>

#include "imgproc/imgproc.h"

enum { BST_WINDOWS_MAX = 128 };

typedef struct bst_region_of_interest {
    int count;
    bst_window items[BST_WINDOWS_MAX];
} bst_region_of_interest;

/* Adds a window of half_x and half_y to either side of a place, full-sensor px; what lies outside
 * `frame` is cut off. False when there is no room, or nothing of it lies inside. */
bool bst_region_of_interest_add(bst_region_of_interest *windows, const bst_window *frame,
                                double x_px, double y_px, double half_x_px, double half_y_px);

/* Puts the windows along the pixels of `binning` of the frame and joins those that touch, until all
 * are apart. False when they then cover more than `share` of the frame: the whole of it costs less.
 */
bool bst_region_of_interest_settle(bst_region_of_interest *windows, const bst_window *frame,
                                   int binning, double share);

/* Whether a place lies in one of them or within margin_px of it. */
bool bst_region_of_interest_hold(const bst_region_of_interest *windows, double x_px, double y_px,
                                 double margin_px);

/* The pixels of one window (inside the frame, along its binned pixels) as a frame of its own,
 * copied to `pixels`, which must have room for them. */
bst_imgproc_frame bst_region_of_interest_crop(const bst_imgproc_frame *frame,
                                              const bst_window *window, uint16_t *pixels);

#endif
