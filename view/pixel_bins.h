/* Pixels reduced to the means of squares, for pages that cannot show all of them. */
#ifndef BST_VIEW_PIXEL_BINS_H
#define BST_VIEW_PIXEL_BINS_H

#include <stdint.h>

#include "view/recorded_run.h"

/* Replaces pixels by the means of n x n of them, rounded to integers (halves up); those of a bin
 * that reaches over the edge by the mean of the pixels that are there.
 *
 * Given:     pixels  [height][width] 16-bit numbers; width 0: something else, which is left
 *            n       from 1: as they are
 * Returned:  pixels  [ceil(height / n)][ceil(width / n)], with binning and size of the frame */
void bst_view_bin_pixels(bst_view_bytes *pixels, int n);

/* Largest number of each bin of n x n pixels; a bin that reaches over the edge has fewer of them.
 *
 * Given:     pixels  [height][width]
 *            n       from 1
 *            row     [width], work memory
 * Returned:  out     [ceil(height / n)][ceil(width / n)] */
void bst_view_peak_pixels(const uint16_t *pixels, int width, int height, int n, uint16_t *row,
                          uint16_t *out);

#endif
