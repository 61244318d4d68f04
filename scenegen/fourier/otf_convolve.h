/* Convolution of a grid of deposited light with a PSF given as OTF, on the host's threads.
 *
 * The grid has `samples` samples over a period of `pixels` px per axis; the image has one value per
 * px. Three passes over memory, each on sixteen rows or columns side by side: rows forward; columns
 * forward, times OTF over the spreading kernel's transform, folded to the image's band, inverse;
 * rows inverse. Rows without light, frequencies beyond the cut-off and rows outside the window are
 * left out. The result does not depend on the number of threads. */
#ifndef BST_SCENEGEN_FOURIER_OTF_CONVOLVE_H
#define BST_SCENEGEN_FOURIER_OTF_CONVOLVE_H

#include <stdbool.h>
#include <stddef.h>

#include "scenegen/fourier/fourier_grid.h"
#include "sim/core/parallel.h"

typedef struct bst_otf_convolve bst_otf_convolve;

/* A window of width x height px that starts `margin` px into the period, a multiple of 16. */
typedef struct bst_otf_convolve_layout {
    bst_fourier_axis x, y;
    int width, height, margin;
} bst_otf_convolve_layout;

/* Plans, tabulates the OTF of all nodes of the PSF and prepares the far wings. The pool is
 * borrowed. BST_ERR_MEMORY. */
bst_status bst_otf_convolve_create(bst_ctx *ctx, const bst_psf *psf, double cutoff,
                                   const bst_otf_convolve_layout *shape, bst_parallel *pool,
                                   bst_otf_convolve **out) BST_MUST_CHECK;
/* Frees a convolution with its buffers; NULL is allowed. */
void bst_otf_convolve_free(bst_otf_convolve *fft);

/* Layout of the grids; it belongs to the convolution. */
const bst_otf_convolve_layout *bst_otf_convolve_shape(const bst_otf_convolve *fft);

/* Floats of the memory that holds the grid and then the image, 64-byte aligned. */
size_t bst_otf_convolve_floats(const bst_otf_convolve *fft);
/* Floats from one row of the image to the next. */
int bst_otf_convolve_pitch(const bst_otf_convolve *fft);

/* Takes the grid that holds the light of the PSF's node `node`: sample (i, j) at
 * grid[(j / 16 * x.samples + i) * 16 + j % 16]. The image is the sum over the nodes from the one
 * that is `first` to the one that is `last`. */
void bst_otf_convolve_add(bst_otf_convolve *fft, int node, bool first, bool last,
                          const float *grid);

/* After the last node: the image, pixel (i, j) of the window at image[j * pitch + i]; rows are
 * filled to a multiple of 16 with the pixels beyond the window. */
void bst_otf_convolve_finish(bst_otf_convolve *fft, float *image);

#endif
