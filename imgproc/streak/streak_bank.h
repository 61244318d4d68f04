/* Filter bank for streaks of every direction and length: sums of the streak map along lines. */
#ifndef BST_IMGPROC_STREAK_STREAK_BANK_H
#define BST_IMGPROC_STREAK_STREAK_BANK_H

#include "imgproc/streak/streak_map.h"

enum { BST_STREAK_MAX_OCTAVES = 5, BST_STREAK_WINDOWS = 5, BST_STREAK_LEAST_ROWS = 4 };

/* A line of the filter bank above the threshold. Plane 0: rows are y; plane 1: rows are x. */
typedef struct bst_streak_hit {
    float snr;
    float x0, y0, x1, y1; /* ends of the path, frame px */
    int16_t plane, rows;  /* rows: number of summed pixels along the longer axis */
} bst_streak_hit;

typedef struct bst_streak_bank {
    int octaves, max_rows;
    double max_px;
    double sigma_px; /* for which the scales were computed */
    /* 1 / standard deviation of a sum, per quantum, [octave][slope][window] */
    float *scale[BST_STREAK_MAX_OCTAVES];
    bst_streak_hit *hits; /* of the latest frame, with room per tile */
    int *hit_count;       /* [max_tiles] */
    int max_tiles;
    int16_t *work; /* per worker: a line, and pieces of lines */
    size_t work_per_worker;
    int workers;
} bst_streak_bank;

/* Creates a filter bank for streaks of up to max_px along their longer axis.
 *
 * Given:     workers  concurrent parts of a loop
 * Errors:    BST_ERR_MEMORY */
bst_status bst_streak_bank_create(bst_ctx *ctx, int max_width, int max_height, double max_px,
                                  int workers, bst_streak_bank *out) BST_MUST_CHECK;
/* Frees the memory of a bank and clears the struct, which belongs to the caller. */
void bst_streak_bank_free(bst_streak_bank *bank);
/* Largest number of hits per frame. */
int bst_streak_bank_capacity(const bst_streak_bank *bank);

/* Sums the streak map along lines of the octaves from first_octave on and keeps those with SNR
 * above `threshold`.
 *
 * Short pieces of a line are shared by all longer lines that contain them (fast Radon transform).
 * An octave with pieces of a = 1, 2, 4, ... rows has lines of 4 a to 7 a rows. They start at every
 * a-th row and every pixel across, with slopes 1 / (4 a) apart from -1 to 1. Flatter lines are
 * found in the second plane.
 *
 * Returned:  number of hits, packed in bank->hits in an order that does not depend on the threads
 * Reference: Brady, SIAM J. Comput. 27, 107, 1998; Nir, Zackay and Ofek, Astron. J. 156, 229, 2018
 */
int bst_streak_bank_run(bst_streak_bank *bank, bst_parallel *pool, const bst_streak_map *map,
                        int first_octave, double threshold);

#endif
