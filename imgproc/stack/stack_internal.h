/* Internal declarations of frame stacking. */
#ifndef BST_IMGPROC_STACK_STACK_INTERNAL_H
#define BST_IMGPROC_STACK_STACK_INTERNAL_H

#include "imgproc/detect/background.h"
#include "imgproc/stack/stack.h"
#include "imgproc/streak/streak_map.h"
#include "sim/core/parallel.h"

enum {
    STACK_NONE = -128,                         /* pixel without a measurement */
    STACK_QUANTA = BST_STREAK_QUANTA,          /* quanta per standard deviation */
    STACK_CLAMP = 127,                         /* largest value: 7.9 standard deviations */
    STACK_VISIBLE = 9 * BST_STREAK_QUANTA / 2, /* visible in a single frame */
    STACK_PHASES = 64,                         /* sub-pixel phases of the interpolation */
    STACK_NODE_PX = 32,                        /* spacing of the alignment grid */
    STACK_TILE = 128,                          /* side of the tiles that are searched */
    STACK_TILE_FOUND = 128,                    /* most paths per tile */
    STACK_REST = 65536,                        /* most sources at rest */
    /* most pixels masked per source */
    STACK_VISITS = 8192,
};

/* A path: position at the mean of the frame times and rate per mean frame interval, in pixels of
 * the first frame. */
typedef struct stack_path {
    double x, y, vx, vy;
    double snr;
    int frames;
} stack_path;

struct bst_stack {
    bst_stack_config config;
    bst_camera camera;
    bst_parallel *pool;
    bst_streak_map map;
    int max_width, max_height;
    int8_t *maps;  /* [frames][max_width * max_height]: filtered frames aligned with the first */
    float *steady; /* [height][width]: sum of each sensor pixel's own SNR over the frames */
    int16_t *rest; /* [height][width]: sum of the aligned frames */
    double *node_x, *node_y; /* shift of each alignment node from the first frame to another */
    int *maxima;             /* [STACK_REST] maxima of `rest` */
    stack_path *rest_paths;  /* [STACK_REST] */
    int *visit;              /* [STACK_VISITS] pixels of a source */
    uint8_t *visited;        /* [height][width] */
    /* of the current stack */
    int count, width, height;
    double origin_x_px, origin_y_px, binning, sigma_px;
    /* tau: in frame intervals relative to their mean */
    double time_s[BST_STACK_MAX_FRAMES], tau[BST_STACK_MAX_FRAMES];
    double interval_s, time_variance;
    bst_quat q[BST_STACK_MAX_FRAMES];
    double noise_e[BST_STACK_MAX_FRAMES]; /* median of the frame */
    /* interpolation weights by phase, scaled to unit noise; roughness of the interpolated field */
    float weight[STACK_PHASES + 1][4];
    double weight_sigma, roughness;
    double threshold;
    struct stack_tile *workers;
    int worker_count;
    stack_path *tile_paths; /* [tiles][STACK_TILE_FOUND] */
    int *tile_count;        /* [tiles] */
    int64_t *tile_followed; /* [tiles] */
    int tiles_x, tiles_y;
    int64_t followed;
    stack_path *paths; /* [BST_STACK_MAX_FOUND]: at rest, then moving */
    int *order;
    bst_stack_found found[BST_STACK_MAX_FOUND];
};

static inline int8_t *stack_map(const bst_stack *s, int frame) {
    return s->maps + (size_t)frame * (size_t)s->max_width * (size_t)s->max_height;
}

/* stack_align.c: filters a frame and aligns it with the first one. */
void stack_align(bst_stack *stack, const bst_stack_frame *frame, int number);
/* Sets the interpolation table for a filter output with this autocorrelation by lag. */
void stack_set_interpolation(bst_stack *stack, double sigma_px, const double correlation[64]);

/* stack_path.c */
/* Stacked sum along a path over the root of the number of frames; values are limited to `clamp`
 * quanta. 0 with fewer than half of the frames. */
double stack_sum(const bst_stack *stack, const stack_path *path, int clamp, int *frames);
/* Moves a path to the nearest maximum of the stacked sum; sets snr and frames. */
void stack_climb(const bst_stack *stack, stack_path *path);
/* True if a path's signal is not due to a few frames alone. */
bool stack_holds(const bst_stack *stack, const stack_path *path);
/* True if the path's rate is consistent with a star. */
bool stack_at_rest(const bst_stack *stack, const stack_path *path);

/* stack_clean.c */
/* Masks charge at the same sensor pixel in all frames. */
void stack_clean_charge(bst_stack *stack);
/* Finds sources at rest, masks them, and stores in stack->paths those above the threshold that no
 * single frame shows; returns their number. */
int stack_clean_rest(bst_stack *stack);
/* Masks a path's light in the aligned frames. */
void stack_clean_path(bst_stack *stack, const stack_path *path);

/* stack_search.c */
bst_status stack_search_create(bst_ctx *ctx, bst_stack *stack) BST_MUST_CHECK;
void stack_search_free(bst_stack *stack);
/* Searches all tiles; sets tile_paths and tile_count. */
void stack_search_tiles(bst_stack *stack);

/* stack_rows.c: sums of rectangles; the pointers are to their first elements. */
/* Sum of four rectangles. */
void stack_rows_add4(const int16_t *const in[4], int in_stride, int16_t *out, int out_stride,
                     int width, int height);
/* Largest sum of `count` rectangles; `row` is work space for one row. */
int stack_rows_greatest(const int16_t *const *in, int count, int stride, int16_t *row, int width,
                        int height);
/* Adds 8-bit values to 16-bit sums. */
void stack_rows_add_bytes(const int8_t *in, int16_t *sum, int count);

#endif
