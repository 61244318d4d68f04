/* What host and kernel agree on about the deposit of light for the Fourier path. C17 and OpenCL C.
 */
#ifndef BST_SCENEGEN_DEPOSIT_SHARED_H
#define BST_SCENEGEN_DEPOSIT_SHARED_H

/* Sub-sample phases of the spreading kernel's table; one more row closes the interval. */
#define BST_SPREAD_PHASES 128
/* A row of that table: one vector. */
#define BST_SPREAD_TAPS 8
/* Floats of the table for one axis: [BST_WIDTHS + 1][BST_SPREAD_PHASES + 1][BST_SPREAD_TAPS]. */
#define BST_SPREAD_TABLE ((BST_WIDTHS + 1) * (BST_SPREAD_PHASES + 1) * BST_SPREAD_TAPS)

/* Shares per source where light of several spectra is deposited one after the other. */
#define BST_SPECTRA 4

/* 32-bit members only, so that both languages lay it out alike. */
typedef struct bst_deposit_params {
    float x0, y0;               /* px of the full sensor at the grid's first sample */
    float density_x, density_y; /* samples per px */
    int samples_x, samples_y;   /* multiples of 16 */
    int tiles_x, tiles_y;
    int source_groups;
    int spectrum; /* whose light is deposited */
    /* weights of one field node, a lattice over the sensor: [field_y][field_x] from px 0 */
    int field_x, field_y;
    float field_per_px_x, field_per_px_y;
} bst_deposit_params;

#endif
