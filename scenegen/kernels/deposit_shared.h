/* Constants and parameters shared by host and kernel for the light deposit of the Fourier path. C17
 * and OpenCL C. */
#ifndef BST_SCENEGEN_DEPOSIT_SHARED_H
#define BST_SCENEGEN_DEPOSIT_SHARED_H

#ifndef __OPENCL_VERSION__
#include "scenegen/kernels/scene_shared.h"
#endif

/* Sub-sample phases of the spreading kernel's table, plus one row to close the interval. */
#define BST_SPREAD_PHASES 128
/* Taps of a table row: one vector. */
#define BST_SPREAD_TAPS 8
/* Floats of the table for one axis: [BST_WIDTHS + 1][BST_SPREAD_PHASES + 1][BST_SPREAD_TAPS]. */
#define BST_SPREAD_TABLE ((BST_WIDTHS + 1) * (BST_SPREAD_PHASES + 1) * BST_SPREAD_TAPS)

/* A density of at most 5 times up to 8192 px is exact in single precision. */
#define BST_DENSITY_PARTS 256

/* Spectrum shares per source, if several spectra are deposited one after the other. */
#define BST_SPECTRA 4

/* Only 32-bit members, so that both languages have the same layout. */
typedef struct bst_deposit_params {
    float x0, y0; /* full-sensor px of the grid's first sample, whole */
    /* samples per px: a multiple of 1 / BST_DENSITY_PARTS, and the rest */
    float coarse_x, coarse_y, finer_x, finer_y;
    int samples_x, samples_y; /* multiples of 16 */
    int tiles_x, tiles_y;
    int source_groups;
    int spectrum; /* spectrum whose light is deposited */
    /* weights of one field node on a sensor grid: [field_y][field_x] from px 0 */
    int field_x, field_y;
    float field_per_px_x, field_per_px_y;
    int by_field, by_spectrum; /* weights by position in the field; by the sources' spectra */
    bst_kernel_node_params nodes;
} bst_deposit_params;

#endif
