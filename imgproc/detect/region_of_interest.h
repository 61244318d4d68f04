/* Regions of interest: windows of a frame about predicted positions, in which image processing
 * searches. */
#ifndef BST_IMGPROC_DETECT_REGION_OF_INTEREST_H
#define BST_IMGPROC_DETECT_REGION_OF_INTEREST_H

#include <stdbool.h>

#include "imgproc/imgproc.h"

enum { BST_WINDOWS_MAX = 128 };

typedef struct bst_region_of_interest {
    int count;
    bst_window items[BST_WINDOWS_MAX];
    int planned_count;
    bst_searched_window planned[BST_WINDOWS_MAX]; /* why: `number` is the index of its window */
} bst_region_of_interest;

/* Adds a window of half widths half_x_px, half_y_px about the position `why`->x_px, y_px, clipped
 * to `frame`. Returns false if the list is full or the window lies outside.
 *
 * Given:     why  reason, identity and position; window and number are not used */
bool bst_region_of_interest_add(bst_region_of_interest *windows, const bst_window *frame,
                                const bst_searched_window *why, double half_x_px, double half_y_px);

/* Removes all windows. */
void bst_region_of_interest_clear(bst_region_of_interest *windows);

/* Aligns the windows with the frame's binned pixels and merges those that touch; sets `window` of
 * each reason to what is searched. Returns false if they cover more than `share` of the frame: a
 * search of the whole frame is then cheaper. */
bool bst_region_of_interest_settle(bst_region_of_interest *windows, const bst_window *frame,
                                   int binning, double share);

/* True if a position lies within margin_px of one of the windows. */
bool bst_region_of_interest_hold(const bst_region_of_interest *windows, double x_px, double y_px,
                                 double margin_px);

/* Crops a window out of a frame. The window lies inside the frame, aligned with its binned pixels.
 *
 * Returned:  frame whose pixels are copied to `pixels`; these need room for the window */
bst_imgproc_frame bst_region_of_interest_crop(const bst_imgproc_frame *frame,
                                              const bst_window *window, uint16_t *pixels);

#endif
