/* Pixels reduced to the means of squares, for pages that cannot show all of them. */
#ifndef BST_VIEW_PIXEL_BINS_H
#define BST_VIEW_PIXEL_BINS_H

#include "view/recorded_run.h"

/* Replaces pixels by the means of n x n of them, rounded to integers (halves up); those of a bin
 * that reaches over the edge by the mean of the pixels that are there.
 *
 * Given:     pixels  [height][width] 16-bit numbers; width 0: something else, which is left
 *            n       from 1: as they are
 * Returned:  pixels  [ceil(height / n)][ceil(width / n)], with binning and size of the frame */
void bst_view_bin_pixels(bst_view_bytes *pixels, int n);

#endif
