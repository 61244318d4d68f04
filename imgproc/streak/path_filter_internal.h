/* State of a matched filter along a path, shared by its source files. */
#ifndef BST_IMGPROC_STREAK_PATH_FILTER_INTERNAL_H
#define BST_IMGPROC_STREAK_PATH_FILTER_INTERNAL_H

#include <math.h>

#include "imgproc/streak/path_filter.h"

/* BLOCK: side of the squares over which the path's shape changes by less than a pixel. */
enum { BST_PATH_BLOCK = 16, BST_PATH_SHIFTS = 24 };
/* States of a block, in place of the number of subtractions before it was filtered: only a bound is
 * known; to be filtered again, with places that are left out. */
enum { BST_PATH_BOUND = -2, BST_PATH_AGAIN = -1 };

/* Samples of the path whose light some places of a block have in the frame. */
typedef struct bst_path_samples {
    int count;
    int place[BST_STAR_PATH_ROOM][2]; /* in the frame, for the block's first place; px */
    const float *image[BST_STAR_PATH_ROOM], *weights[BST_STAR_PATH_ROOM];
    float light[BST_STAR_PATH_ROOM], squared[BST_STAR_PATH_ROOM];
    bool whole; /* all samples of all places are inside */
} bst_path_samples;

/* Subtractions change the image. A block of places is filtered again when its highest SNR, which
 * they can only lower, is the highest of all. */
struct bst_path_filter {
    bst_star_path path;
    bst_path_samples samples;  /* of the latest block */
    int margin;                /* of places outside the frame, px */
    int width, height;         /* of the places: the frame and its margins */
    int columns, rows, blocks; /* of blocks: in a row and in a column, in all */
    size_t places;             /* that there is memory for */
    int frame[2];              /* width and height of the frame */
    size_t stride;             /* of the two images below */
    float *image, *weights; /* the input with BLOCK zeros on all sides; NULL: all weights are 1 */
    size_t half_stride, half_size; /* of each of the images below */
    float *half;                   /* [4] every second pixel of every second row of the input */
    float *response;               /* [blocks][BLOCK][BLOCK] */
    float *per_noise; /* likewise: one over the noise of the response; 0: not searched */
    float *highest;   /* [blocks] highest SNR when the block was filtered, or a bound */
    float *of_row;    /* [rows] greatest of them */
    float *first;     /* [blocks] those before the first subtraction */
    int *filtered;    /* [blocks] subtractions before that, or the state of the block */
    int subtractions;
    bool by_bounds;     /* blocks begin with bounds, not filtered */
    bool left_out;      /* some places are */
    double correlation; /* variance of the response over the sum of the squared light */
    double squares;     /* sum of the squared light of the whole path */
    double whole;       /* response to the whole path, of unit amplitude */
    double step_px;     /* greatest distance of consecutive samples */
    double psf_sigma_px;
    double least_inside;            /* share of the path inside the frame */
    double length_px, direction[2]; /* from end to end */
    double systematic_px;           /* position error beside the noise */
    int losses;                     /* that are known */
    double loss[BST_PATH_SHIFTS];   /* see bst_path_filter_loss */
};

/* Correlation of two samples of the image at a distance. */
static inline double bst_path_filter_correlation(const bst_path_filter *f, double r2) {
    return exp(-0.25 * r2 / (f->psf_sigma_px * f->psf_sigma_px));
}

/* Filters a block if only a bound of it is known, or again if it was before the latest
 * subtraction. */
void bst_path_filter_refresh(bst_path_filter *filter, int block);
/* Share of the response that a shift along the path by whole pixels loses.
 *
 * Given:     shift_px  0 to BST_PATH_SHIFTS - 1 */
double bst_path_filter_loss(bst_path_filter *filter, int shift_px);

#endif
