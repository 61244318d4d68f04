/* Parts of the stack that only its own files share. */
#ifndef BST_IMGPROC_STACK_STACK_INTERNAL_H
#define BST_IMGPROC_STACK_STACK_INTERNAL_H

#include "imgproc/detect/background.h"
#include "imgproc/stack/stack.h"
#include "imgproc/streak/streak_map.h"
#include "sim/core/parallel.h"

enum {
    STACK_NONE = -128,                         /* a place without a measurement */
    STACK_QUANTA = BST_STREAK_QUANTA,          /* steps per standard deviation */
    STACK_CLAMP = 127,                         /* greatest value: 7.9 standard deviations */
    STACK_VISIBLE = 9 * BST_STREAK_QUANTA / 2, /* seen in a frame by itself */
    STACK_PHASES = 64,                         /* of the interpolation */
    STACK_NODE_PX = 32,     /* between places at which the alignment is worked out */
    STACK_TILE = 128,       /* side of the squares that are searched */
    STACK_TILE_FOUND = 128, /* most paths kept of one */
    STACK_REST = 65536,     /* most sources at rest */
    STACK_VISITS = 8192,
};

/* A path: the place at the mean of the frames' times and the rate per mean frame interval, in
 * pixels of the first frame. */
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
    int8_t *maps;  /* [frames][max_width * max_height]: frames on the first one's pixels */
    float *steady; /* [height][width]: sum of the pixels' own SNR, on the sensor */
    int16_t *rest; /* [height][width]: sum of the maps */
    double *node_x, *node_y; /* where a node of the first frame's grid is in another frame, less its
                                own place */
    int *maxima;             /* [STACK_REST] of `rest` */
    stack_path *rest_paths;  /* [STACK_REST] */
    int *visit;              /* [STACK_VISITS] pixels of a source's light */
    uint8_t *visited;        /* [height][width] */
    /* of the stack in work */
    int count, width, height;
    double origin_x_px, origin_y_px, binning, sigma_px;
    double time_s[BST_STACK_MAX_FRAMES], tau[BST_STACK_MAX_FRAMES]; /* tau: in frame intervals from
                                                                       their mean */
    double interval_s, time_variance;
    bst_quat q[BST_STACK_MAX_FRAMES];
    double noise_e[BST_STACK_MAX_FRAMES]; /* median */
    /* interpolation: weights by phase, scaled to unit noise; and the field's roughness */
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
    stack_path *paths; /* [BST_STACK_MAX_FOUND] at rest, then in motion */
    int *order;
    bst_stack_found found[BST_STACK_MAX_FOUND];
};

static inline int8_t *stack_map(const bst_stack *s, int frame) {
    return s->maps + (size_t)frame * (size_t)s->max_width * (size_t)s->max_height;
}

/* stack_align.c: filters a frame and lays it on the first one's pixels. */
void stack_align(bst_stack *stack, const bst_stack_frame *frame, int number);
/* Makes the interpolation's table for a filter whose output has this correlation by lag. */
void stack_set_interpolation(bst_stack *stack, double sigma_px, const double correlation[64]);

/* stack_path.c */
/* The sum along a path over the root of the frames in it; values count up to `clamp`. 0 with fewer
 * than half of the frames. */
double stack_sum(const bst_stack *stack, const stack_path *path, int clamp, int *frames);
/* Moves a path to the maximum near it and fills in snr and frames. */
void stack_climb(const bst_stack *stack, stack_path *path);
/* Whether what a path shows is not due to a few frames alone. */
bool stack_holds(const bst_stack *stack, const stack_path *path);
/* Whether its rate may be that of a star. */
bool stack_at_rest(const bst_stack *stack, const stack_path *path);

/* stack_clean.c */
/* Takes out charge at the same pixel of the sensor in all frames. */
void stack_clean_charge(bst_stack *stack);
/* Finds sources at rest, takes them out and leaves those above the threshold, but not seen in a
 * frame by themselves, in stack->paths; returns their number. */
int stack_clean_rest(bst_stack *stack);
/* Takes a path's light out of the maps. */
void stack_clean_path(bst_stack *stack, const stack_path *path);

/* stack_search.c */
bst_status stack_search_create(bst_ctx *ctx, bst_stack *stack) BST_MUST_CHECK;
void stack_search_free(bst_stack *stack);
/* Fills tile_paths and tile_count. */
void stack_search_tiles(bst_stack *stack);

/* stack_rows.c: sums of rectangles of rows, whose pointers are their first elements. */
void stack_rows_add4(const int16_t *const in[4], int in_stride, int16_t *out, int out_stride,
                     int width, int height);
/* Greatest sum of `count` rectangles; `row` is room for one row. */
int stack_rows_greatest(const int16_t *const *in, int count, int stride, int16_t *row, int width,
                        int height);
void stack_rows_add_bytes(const int8_t *in, int16_t *sum, int count);

#endif
