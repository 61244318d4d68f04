/* Parts of frames, and pixels reduced to the means or peaks of squares, for pages that cannot show
 * all of them. */
#ifndef BST_VIEW_PIXEL_BINS_H
#define BST_VIEW_PIXEL_BINS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Largest bins: the sum of 256 x 256 pixels fits 32 bits. */
enum { BST_VIEW_BINNING_MOST = 256 };

/* A part of a frame as a page asks for it. */
typedef struct bst_view_part {
    int64_t x, y;          /* its first pixel */
    int64_t width, height; /* px of the frame; 0: up to the edge */
    int64_t binning;       /* pixels along a side of a bin; 0: 1 */
    int64_t longest;       /* longest side of the answer: binning rises until it fits; 0: any */
} bst_view_part;

/* Cuts a part to a frame, and chooses the binning.
 *
 * Given:     part           any numbers
 *            width, height  of the frame, px
 * Returned:  part           within the frame; binning 1 to BST_VIEW_BINNING_MOST
 *            false: no pixel of it is within the frame, or a number is negative or too large */
bool bst_view_fit_part(bst_view_part *part, int width, int height);

/* Number of bins along a side of so many pixels: the last one may be smaller. */
static inline int bst_view_bins(int64_t pixels, int64_t n) {
    return (int)((pixels + n - 1) / n);
}

/* Means of bins of n columns of a few rows, rounded to integers (halves up); the last bin may have
 * fewer columns.
 *
 * Given:     rows    first pixel; the next row is `stride` pixels on
 *            width   pixels of a row
 *            count   rows, 1 to n
 *            n       1 to BST_VIEW_BINNING_MOST
 *            sums    [width], work memory
 * Returned:  out     [bst_view_bins(width, n)] */
void bst_view_bin_row(const uint16_t *rows, size_t stride, int width, int count, int n,
                      uint32_t *sums, uint16_t *out);

/* Means of the bins of a part of a frame in memory.
 *
 * Given:     pixels  [height][stride]
 *            part    fitted to the frame
 * Returned:  out     [bst_view_bins(part->height)][bst_view_bins(part->width)]
 *            false: out of memory */
bool bst_view_bin_part(const uint16_t *pixels, size_t stride, const bst_view_part *part,
                       uint16_t *out);

/* Largest number of each bin of n x n pixels; a bin that reaches over the edge has fewer of them.
 *
 * Given:     pixels  [height][width]
 *            n       from 1
 *            row     [width], work memory
 * Returned:  out     [ceil(height / n)][ceil(width / n)] */
void bst_view_peak_pixels(const uint16_t *pixels, int width, int height, int n, uint16_t *row,
                          uint16_t *out);

#endif
