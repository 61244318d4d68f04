/* Declarations shared by otf_convolve.c and otf_convolve_passes.c. */
#ifndef BST_SCENEGEN_FOURIER_OTF_CONVOLVE_INTERNAL_H
#define BST_SCENEGEN_FOURIER_OTF_CONVOLVE_INTERNAL_H

#include <stdatomic.h>

#include "scenegen/fourier/alias_correction.h"
#include "scenegen/fourier/batch_fft.h"
#include "scenegen/fourier/otf_convolve.h"

/* Rows and columns are processed in blocks of one SIMD batch. */
enum { BLOCK = BST_LANES };

/* Block of columns of the grid's spectrum: frequencies k0 to k0 + 15 per period, possibly negative.
 * It folds onto the image's column block that is a whole number of image bands away. */
typedef struct strip {
    int k0;
    int block;    /* of the image's columns */
    int reach;    /* rows -reach .. reach are within the cut-off */
    size_t first; /* index of the strip's first number in the table */
} strip;

/* Linear interpolation weights of a block of row pixels between cell centres: for `cell` and the
 * following ones. A block spans 16 px of at most 5 samples; a cell spans 16 samples or, above 1.4
 * per px, 32. */
enum { SHARES = 5 };
typedef struct cell_shares {
    int cell;
    float share[SHARES][BLOCK];
} cell_shares;

/* Work space of one thread. */
typedef struct bench {
    atomic_flag taken;
    bst_batch *line; /* a block of rows or columns */
    float *wings;    /* [BLOCK][cells_x + SHARES]: far wings of rows at the cell centres */
} bench;

struct bst_otf_convolve {
    const bst_psf *psf;
    bst_otf_convolve_layout shape;
    double cutoff;
    bst_parallel *pool;
    int pitch, row_blocks, image_blocks; /* blocks of grid rows, of window rows */
    int used;                            /* columns 1 - used to used - 1 are within the cut-off */
    strip *strips;                       /* strips of one image block are consecutive */
    int strip_count, column_blocks;      /* image column blocks with strips */
    int *first_strip;                    /* [column_blocks + 1] */
    size_t strip_pitch, image_pitch;     /* elements */
    bst_batch *spectrum;                 /* [strips][strip_pitch]: row by row */
    bst_batch *image;            /* [image_blocks][image_pitch]: by column, lanes are rows */
    bst_batch **table;           /* [nodes]: OTF over the kernel's transform */
    bst_batch *sum;              /* [column_blocks][y.pixels] if there are several nodes */
    double *kernel_x, *kernel_y; /* kernel transforms by column and by row, 0 .. samples / 2 */
    bst_batch_fft *row_forward, *row_inverse, *column_forward, *column_inverse;
    bench *benches;
    int bench_count;
    bst_alias_correction
        *wrap[BST_PSF_SPECTRA]; /* NULL: negligible light of that spectrum wraps around */
    bool wraps;                 /* any of `wrap` is not NULL */
    int cell, cells_x, cells_y; /* samples per cell and axis; number of cells */
    int spectra;
    float *cells;        /* [spectra][cells_y][cells_x] */
    cell_shares *shares; /* per block of a row's pixels */
};

/* Context of a pass's parallel loop. */
typedef struct pass {
    bst_otf_convolve *fft;
    const float *grid;
    float *image;
    int node;
    bool first, last;
} pass;

/* Position of a pixel between cell centres along one axis: lower cell and fraction, which is below
 * 0 or above 1 at the ends. */
double bst_otf_convolve_cell_place(const bst_otf_convolve *f, const bst_fourier_axis *axis,
                                   int cells, int pixel, int *lower);

#endif
