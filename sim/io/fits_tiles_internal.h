/* Compressed tiles and the values of their numbers. */
#ifndef BST_IO_FITS_TILES_INTERNAL_H
#define BST_IO_FITS_TILES_INTERNAL_H

#include "sim/io/fits_source_internal.h"

/* How the numbers of a compressed image become values. */
typedef struct bst_fits_tile_scale {
    bool dithered, zero_kept; /* SUBTRACTIVE_DITHER_1 and _2; of _2 one number is exactly 0 */
    bool has_blank;
    int64_t blank;
    int64_t seed; /* ZDITHER0 */
    double scale, zero;
} bst_fits_tile_scale;

/* Values of a tile's numbers.
 *
 * Given:     numbers, count
 *            tile     number of the tile, from 1, which begins the random numbers of the dithering
 * Returned:  values   [count], NAN for blank ones
 * Source:    FITS Standard 4.0, section 10.2 and appendix I */
void bst_fits_tile_values(const bst_fits_tile_scale *scale, int64_t tile, const int32_t *numbers,
                          size_t count, float *values);

#endif
