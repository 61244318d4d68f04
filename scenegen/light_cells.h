/* Coarse cells of a grid of light, and how the pixels of a window lie between their centres. */
#ifndef BST_SCENEGEN_LIGHT_CELLS_H
#define BST_SCENEGEN_LIGHT_CELLS_H

#include "scenegen/lanes.h"
#include "scenegen/light_grid.h"

/* How a block of 16 pixels of a row lies between cells, linearly: the shares of `cell` and of those
 * that follow it. Such a block has at most 80 samples; a cell 16 or, beyond 1.4 samples per px, 32.
 */
enum { BST_CELL_SHARES = 5 };
typedef struct bst_cell_shares {
    int cell;
    bst_lanes share[BST_CELL_SHARES];
} bst_cell_shares;

typedef struct bst_light_cells {
    int side; /* of a cell, samples: 16 or 32 */
    int columns, rows;
    float *light;                  /* [rows][columns] */
    bst_cell_shares *shares;       /* per block of a row of the window */
    double rows_per_px, first_row; /* row of cells of the window's rows, from the centres */
} bst_light_cells;

/* Cells of a grid, for a window of `width` px that starts `margin` px into the period. Light is not
 * set. BST_ERR_MEMORY; *out can be cleared then too. */
bst_status bst_light_cells_create(bst_ctx *ctx, const bst_light_axis *x, const bst_light_axis *y,
                                  int width, int margin, bst_light_cells *out) BST_MUST_CHECK;
void bst_light_cells_clear(bst_light_cells *cells);

/* The cells' values for row `row` of the window, between two rows of cells: fills out[columns].
 * What the shares are taken of has zeros after it: bst_light_cells_row_floats in all. */
void bst_light_cells_row(const bst_light_cells *cells, int row, float *out);
int bst_light_cells_row_floats(const bst_light_cells *cells);

#endif
