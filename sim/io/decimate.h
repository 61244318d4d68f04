/* Time series reduced to what a plot of some columns can show. */
#ifndef BST_IO_DECIMATE_H
#define BST_IO_DECIMATE_H

#include <stddef.h>

/* A value at a time. */
typedef struct bst_io_sample {
    double time_s, value; /* value NAN: a gap in the line */
} bst_io_sample;

/* Extremes of the samples of one column of a plot. */
typedef struct bst_io_extent {
    double time_s;    /* of the sample, or the middle of the column */
    double low, high; /* NAN: a gap */
} bst_io_extent;

/* Sorts samples by time; those in order are left as they are. */
void bst_io_sort_samples(bst_io_sample *samples, size_t count);

/* Minimum and maximum of the samples in each column of a plot.
 *
 * Given:     samples  [count] by rising time
 *            from_s, to_s  ends of the plot, from_s < to_s
 *            columns  of the plot, 1 or more
 * Returned:  out      [columns + 2]
 *            number of extents in `out`, by rising time
 * Notes:     the nearest sample beyond each end is included, so that lines reach the edges. If
 *            there are no more samples than columns, each sample is an extent of its own. A column
 *            without samples has no extent; one with gaps only has a gap. No extreme is lost. */
size_t bst_io_decimate(const bst_io_sample *samples, size_t count, double from_s, double to_s,
                       int columns, bst_io_extent *out);

/* Keeps the minimum and the maximum of every four samples, in place and in order: half of them.
 *
 * Returned:  number of samples that are left
 * Notes:     gaps are dropped where four samples hold a value. */
size_t bst_io_thin_samples(bst_io_sample *samples, size_t count);

#endif
