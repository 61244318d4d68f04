/* Input of the streak search: the frame in units of its noise, filtered with the PSF, in 16 bits,
 * with the stars masked. */
#ifndef BST_IMGPROC_STREAK_STREAK_MAP_H
#define BST_IMGPROC_STREAK_STREAK_MAP_H

#include <stdbool.h>
#include <stdint.h>

#include "imgproc/detect/background.h"
#include "sim/core/parallel.h"

enum {
    BST_STREAK_QUANTA = 16,   /* steps of the map per standard deviation */
    BST_STREAK_PAD = 136,     /* zero padding on every side */
    BST_STREAK_MAX_ROWS = 128 /* longest streak along its longer axis, px */
};

typedef struct bst_streak_map {
    int max_width, max_height;
    int width, height;  /* of the latest frame */
    int stride[2];      /* of each plane */
    int16_t *memory[2]; /* [height + 2 pad][stride]; plane 1 is transposed, or NULL */
    int radius;         /* of the PSF's kernel, px */
    float kernel[64];   /* kernel along one axis, unit norm, padded with zeros to a multiple of 4 */
    double sigma_px;    /* for which the kernel was computed */
    double correlation[64]; /* autocorrelation of the map at integer lags along an axis */
    int clamp;              /* largest value, quanta: no sum over a streak overflows */
    float *lines;           /* work space per band */
    size_t lines_per_band;  /* floats */
    int bands;
} bst_streak_map;

/* Creates a streak map. Errors: BST_ERR_MEMORY.
 *
 * Given:     turned  also allocates the transposed plane */
bst_status bst_streak_map_create(bst_ctx *ctx, int max_width, int max_height, bool turned,
                                 bst_streak_map *out) BST_MUST_CHECK;
/* Frees the memory of a map and clears the struct, which belongs to the caller. */
void bst_streak_map_free(bst_streak_map *map);

/* Input frame of a streak map. */
typedef struct bst_streak_map_input {
    /* [height][width], electrons above the background, see background.h; pixels without a
     * measurement count as background */
    const float *signal;
    int width, height;
    const bst_background *background;
    double sigma_px; /* of the PSF */
} bst_streak_map_input;

/* Filters a frame into both planes. */
void bst_streak_map_fill(bst_streak_map *map, bst_parallel *pool,
                         const bst_streak_map_input *input);
/* Filters a frame into the first plane only, limited to `clamp` quanta. If `sum` [height][width] is
 * not NULL, each pixel's own SNR, limited to 6, is added to it. */
void bst_streak_map_filter(bst_streak_map *map, bst_parallel *pool,
                           const bst_streak_map_input *input, int clamp, float *sum);
/* Sets both planes to zero within radius_px of a segment. */
void bst_streak_map_blank(bst_streak_map *map, double x0, double y0, double x1, double y1,
                          double radius_px);
/* Pixel (0, 0) of a plane. */
static inline const int16_t *bst_streak_map_plane(const bst_streak_map *map, int plane) {
    return map->memory[plane] + (long)BST_STREAK_PAD * map->stride[plane] + BST_STREAK_PAD;
}

#endif
