/* Bias, dark or flat frames reduced one by one: mean, temporal variance, levels, overscan. */
#ifndef BST_ANALYSIS_CHARACTERIZE_FRAME_STACK_H
#define BST_ANALYSIS_CHARACTERIZE_FRAME_STACK_H

#include <stdbool.h>

#include "sim/analysis/characterize/neighbour_covariance.h"
#include "sim/analysis/characterize/radiation_hits.h"
#include "sim/io/recorded_frames.h"

/* Blocks per side: statistics are taken in 8 x 8 blocks, whose scatter gives the uncertainty. */
enum { BST_STACK_SIDE = 8, BST_STACK_BLOCKS = BST_STACK_SIDE * BST_STACK_SIDE };
/* Distances along a row of which a stack has the covariance, px. */
enum { BST_STACK_LAGS = 16 };

/* Frames of one kind. Values are DN. */
typedef struct bst_frame_stack {
    int count, width, height;
    double exposure_s, gain_e_per_dn;    /* by the header of the first frame */
    double start_s;                      /* of the last frame, after that of the first */
    bool integer;                        /* all values are whole numbers: quantised */
    double *levels;                      /* [count] mean of each frame without outliers */
    float *mean;                         /* [height][width] */
    float *last;                         /* [height][width] the last frame */
    int pairs;                           /* of successive frames, each frame in one */
    double variance[BST_STACK_BLOCKS];   /* of a pixel between frames, mean of the pairs */
    double row_variance;                 /* of the mean of a row between frames, in excess */
    double covariance[BST_STACK_LAGS];   /* of pixels 1, 2, ... apart in a row between frames */
    bst_neighbour_covariance neighbours; /* between frames, outliers left out */
    bst_radiation_hits hits;             /* in the pairs; out of the mean */
    int overscan_width;                  /* 0: none */
    float *overscan;                     /* [height][overscan_width] of the last frame */
} bst_frame_stack;

/* Block of a pixel of a frame of width x height. */
static inline int bst_stack_block_of(int x, int y, int width, int height) {
    return (int)((int64_t)x * BST_STACK_SIDE / width) +
           BST_STACK_SIDE * (int)((int64_t)y * BST_STACK_SIDE / height);
}

/* Reads and reduces frames. Memory does not grow with their number.
 *
 * Radiation hits that the other frame of a pair shows are left out of mean and variance.
 *
 * Given:     kind   for messages: "bias", "dark", "flat"
 *            paths  [count] as bst_recorded_frames_open takes them
 *            map    keyword map: exposure, gain, image section, overscan
 * Errors:    those of the files and of the map; BST_ERR_ARGUMENT: frames of several sizes or
 *            exposures, or smaller than 64 x 64 pixels; BST_ERR_INTERRUPTED
 * Ownership: free *out with bst_frame_stack_free, also after an error */
bst_status bst_frame_stack_read(bst_ctx *ctx, const char *kind, const char *const *paths, int count,
                                const bst_keyword_map *map, bst_frame_stack *out) BST_MUST_CHECK;
/* The same of frames of a list that is open.
 *
 * Given:     first, count  frames of the list
 * Errors:    as bst_frame_stack_read */
bst_status bst_frame_stack_reduce(bst_ctx *ctx, const char *kind, bst_recorded_frames *recorded,
                                  int64_t first, int64_t count, const bst_keyword_map *map,
                                  bst_frame_stack *out) BST_MUST_CHECK;
/* Variance of the level from frame to frame, DN^2; 0: one frame. */
double bst_frame_stack_level_variance(const bst_frame_stack *s);
/* Frees the arrays. */
void bst_frame_stack_free(bst_frame_stack *stack);

#endif
