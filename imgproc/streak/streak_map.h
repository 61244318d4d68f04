/* What the search for streaks looks at: the frame in units of its noise, filtered with the PSF and
 * kept in 16 bits, with the stars taken out. */
#ifndef BST_IMGPROC_STREAK_STREAK_MAP_H
#define BST_IMGPROC_STREAK_STREAK_MAP_H

#include <stdbool.h>
#include <stdint.h>

#include "imgproc/detect/background.h"
#include "sim/core/parallel.h"

enum {
    BST_STREAK_QUANTA = 16,   /* steps of the map per standard deviation */
    BST_STREAK_PAD = 136,     /* zeros on every side */
    BST_STREAK_MAX_ROWS = 128 /* pixels along the longer axis of a streak */
};

typedef struct bst_streak_map {
    int max_width, max_height;
    int width, height;  /* of the latest frame */
    int stride[2];      /* of each plane */
    int16_t *memory[2]; /* [height + 2 pad][stride], and the same with x and y exchanged or NULL */
    int radius;         /* of the PSF's kernel, px */
    float kernel[64];   /* one axis, unit norm, padded with zeros to a multiple of 4 */
    double sigma_px;    /* that the kernel was made for */
    double correlation[64]; /* of the map at integer lags along an axis */
    int clamp;              /* greatest value, quanta: no sum over a streak overflows */
    float *lines;           /* work space of each band */
    size_t lines_per_band;  /* floats */
    int bands;
} bst_streak_map;

/* turned: with the second plane. */
bst_status bst_streak_map_create(bst_ctx *ctx, int max_width, int max_height, bool turned,
                                 bst_streak_map *out) BST_MUST_CHECK;
/* Frees the memory of a map and clears the struct, which belongs to the caller. */
void bst_streak_map_free(bst_streak_map *map);

/* A frame. */
typedef struct bst_streak_map_input {
    const float *signal; /* [height][width], electrons above the background, see background.h: what
                            holds no measurement counts as background */
    int width, height;
    const bst_background *background;
    double sigma_px; /* of the PSF */
} bst_streak_map_input;

/* Makes both planes. */
void bst_streak_map_fill(bst_streak_map *map, bst_parallel *pool,
                         const bst_streak_map_input *input);
/* Makes the first plane alone, with values of at most `clamp` quanta. Unless `sum` [height][width]
 * is NULL the SNR of each pixel by itself, within 6, is added to it. */
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
