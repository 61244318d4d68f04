/* A bank of filters for streaks of every direction and length: sums of the map along lines. */
#ifndef BST_IMGPROC_STREAK_STREAK_BANK_H
#define BST_IMGPROC_STREAK_STREAK_BANK_H

#include "imgproc/streak/streak_map.h"

enum { BST_STREAK_MAX_OCTAVES = 5, BST_STREAK_WINDOWS = 5, BST_STREAK_LEAST_ROWS = 4 };

/* A line of the bank that stands out. Plane 0: rows are y; plane 1: rows are x. */
typedef struct bst_streak_hit {
    float snr;
    float x0, y0, x1, y1; /* ends of the path, frame px */
    int16_t plane, rows;  /* rows: pixels along the axis that is summed over */
} bst_streak_hit;

typedef struct bst_streak_bank {
    int octaves, max_rows;
    double max_px;
    double sigma_px; /* that the scales were made for */
    /* 1 / standard deviation of a sum, per quantum, [octave][slope][window] */
    float *scale[BST_STREAK_MAX_OCTAVES];
    bst_streak_hit *hits; /* of the latest frame; room for those of each tile */
    int *hit_count;       /* [max_tiles] */
    int max_tiles;
    int16_t *work; /* of each worker: a line, and pieces of lines */
    size_t work_per_worker;
    int workers;
} bst_streak_bank;

/* For streaks of up to max_px along their longer axis; workers: loops' parts that run at a time. */
bst_status bst_streak_bank_create(bst_ctx *ctx, int max_width, int max_height, double max_px,
                                  int workers, bst_streak_bank *out) BST_MUST_CHECK;
/* Frees the memory of a bank and clears the struct, which belongs to the caller. */
void bst_streak_bank_free(bst_streak_bank *bank);
/* The most hits that a frame can give. */
int bst_streak_bank_capacity(const bst_streak_bank *bank);

/* Sums the map along lines of the octaves from first_octave on and keeps those whose SNR exceeds
 * `threshold`.
 *
 * Rows are summed by the partial sums of the fast Radon transform (Brady, SIAM J. Comput. 27, 107,
 * 1998; Nir, Zackay and Ofek, Astron. J. 156, 229, 2018): short pieces of a line serve all the
 * longer lines that pass through them. An octave with pieces of a = 1, 2, 4, ... rows has lines of
 * 4 a to 7 a rows that begin at every a-th row and every pixel across, with slopes 1 / (4 a) apart;
 * slopes reach from -1 to 1, and lines that are flatter than that are found in the second plane.
 * Returns the number of hits and packs them into bank->hits, in an order that does not depend on
 * the threads. */
int bst_streak_bank_run(bst_streak_bank *bank, bst_parallel *pool, const bst_streak_map *map,
                        int first_octave, double threshold);

#endif
