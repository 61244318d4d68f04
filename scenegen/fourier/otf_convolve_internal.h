/* What otf_convolve.c and otf_convolve_passes.c share. */
#ifndef BST_SCENEGEN_FOURIER_OTF_CONVOLVE_INTERNAL_H
#define BST_SCENEGEN_FOURIER_OTF_CONVOLVE_INTERNAL_H

#include <stdatomic.h>

#include "scenegen/fourier/alias_correction.h"
#include "scenegen/fourier/batch_fft.h"
#include "scenegen/fourier/otf_convolve.h"

/* Rows and columns are worked on in blocks of as many as a batch has sequences. */
enum { BLOCK = BST_LANES };

/* A block of columns of the grid's spectrum, in frequencies k0 to k0 + 15 per period, which may be
 * negative. It folds onto the block of the image's columns that is a whole number of image bands
 * away. */
typedef struct strip {
    int k0;
    int block;    /* of the image's columns */
    int reach;    /* rows -reach .. reach are within the cut-off */
    size_t first; /* of the strip's numbers in the table */
} strip;

/* How a block of a row's pixels lies between the centres of cells, linearly: the shares of `cell`
 * and those that follow. A block spans 16 px of at most 5 samples, a cell 16 samples or, beyond 1.4
 * per px, 32. */
enum { SHARES = 5 };
typedef struct cell_shares {
    int cell;
    float share[SHARES][BLOCK];
} cell_shares;

/* Working memory of one part; as many as there are threads. */
typedef struct bench {
    atomic_flag taken;
    bst_batch *line; /* a block of rows or columns */
    float *wings;    /* [BLOCK][cells_x + SHARES] far wings of rows at the cells' centres */
} bench;

struct bst_otf_convolve {
    const bst_psf *psf;
    bst_otf_convolve_layout shape;
    double cutoff;
    bst_parallel *pool;
    int pitch, row_blocks, image_blocks; /* blocks of the grid's rows, of the window's rows */
    int used;                            /* columns 1 - used to used - 1 are within the cut-off */
    strip *strips;                       /* those of one block of the image follow each other */
    int strip_count, column_blocks;      /* blocks of the image's columns that the strips reach */
    int *first_strip;                    /* [column_blocks + 1] */
    size_t strip_pitch, image_pitch;     /* elements */
    bst_batch *spectrum;                 /* [strips][strip_pitch]: row by row */
    bst_batch *image;            /* [image_blocks][image_pitch]: column by column, lanes are rows */
    bst_batch **table;           /* [nodes]: OTF over the kernel's transform */
    bst_batch *sum;              /* [column_blocks][y.pixels], where there are several nodes */
    double *kernel_x, *kernel_y; /* transforms by column and by row 0 .. samples / 2 */
    bst_batch_fft *row_forward, *row_inverse, *column_forward, *column_inverse;
    bench *benches;
    int bench_count;
    bst_alias_correction
        *wrap[BST_PSF_SPECTRA]; /* NULL: of such a spectrum, no light to speak of */
    bool wraps;                 /* any does */
    int cell, cells_x, cells_y; /* samples per cell, per axis; cells */
    int spectra;
    float *cells;        /* [spectra][cells_y][cells_x] */
    cell_shares *shares; /* per block of a row's pixels */
};

/* What a loop's parts need to know. */
typedef struct pass {
    bst_otf_convolve *fft;
    const float *grid;
    float *image;
    int node;
    bool first, last;
} pass;

/* Place on one axis of the cells' centres: the lower cell and the share of the way to the next,
 * which is below 0 or above 1 at the ends. */
double bst_otf_convolve_cell_place(const bst_otf_convolve *f, const bst_fourier_axis *axis,
                                   int cells, int pixel, int *lower);

#endif
