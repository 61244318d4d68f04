/* Rice code of FITS pixels. The decoder: cfitsio 4.2 reads beyond its memory on damaged data. The
 * encoder: its bytes are those of cfitsio, in a sixth of the time (docs/results/benchmarks.md). */
#ifndef BST_IO_FITS_RICE_H
#define BST_IO_FITS_RICE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Decodes one tile of `count` pixels from `bytes` bytes at `data`, `block` pixels to a block (1 or
 * more). The values are those that were coded, modulo 2^16. False: the data are too short or
 * contain an invalid code; `out` is then undefined. Source: FITS Standard 4.0, section 10.4.1; R.
 * L. White et al., "Tiled Image Convention for Storing Compressed Images", 2009. */
bool bst_fits_rice_decode(const uint8_t *data, size_t bytes, int block, uint16_t *out,
                          size_t count);

/* The same for pixels of 1, 2 or 4 bytes.
 *
 * Given:     pixel_bytes  1, 2, 4: BYTEPIX of the standard
 * Returned:  out  [count] unsigned of 1 byte, else signed */
bool bst_fits_rice_decode_wide(const uint8_t *data, size_t bytes, int block, int pixel_bytes,
                               int32_t *out, size_t count);

/* Pixels of a block that is coded. */
#define BST_FITS_RICE_BLOCK 32

/* Space for a coded tile of this many pixels, bytes. */
static inline size_t bst_fits_rice_bytes(size_t count) {
    return 3 * count +
           32; /* words have 17 bits in the mean at most, codes 4; 8 bytes are written at a time */
}

/* Codes one tile of 16-bit pixels that are stored with BZERO = 32768. Source: as above; the low
 * bits of a block's words are chosen as in White's encoder, from half the mean of its differences.
 *
 * Given:     pixels  [count], DN; one or more
 * Returned:  out     [bst_fits_rice_bytes(count)] coded; the bytes of it that count are returned */
size_t bst_fits_rice_encode(const uint16_t *pixels, size_t count, uint8_t *out);

#endif
