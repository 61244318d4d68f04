/* Convolution of a light grid with a PSF given as OTF, on the host's threads.
 *
 * The grid has `samples` samples per period of `pixels` px along each axis; the image has one value
 * per px. Three passes work on sixteen rows or columns at a time. Rows: forward FFT. Columns:
 * forward FFT, multiplication by OTF over the spreading kernel's transform, folding to the image's
 * band, inverse FFT. Rows: inverse FFT. Rows without light, frequencies beyond the cut-off and rows
 * outside the window are skipped. The result does not depend on the number of threads. */
#ifndef BST_SCENEGEN_FOURIER_OTF_CONVOLVE_H
#define BST_SCENEGEN_FOURIER_OTF_CONVOLVE_H

#include <stdbool.h>
#include <stddef.h>

#include "scenegen/fourier/fourier_grid.h"
#include "sim/core/parallel.h"

typedef struct bst_otf_convolve bst_otf_convolve;

/* Window of width x height px that starts `margin` px (a multiple of 16) into the period. */
typedef struct bst_otf_convolve_layout {
    bst_fourier_axis x, y;
    int width, height, margin;
} bst_otf_convolve_layout;

/* Creates a convolution: FFT plans, OTF tables of all nodes, correction of far wings.
 *
 * Given:     pool  lent
 * Errors:    BST_ERR_MEMORY */
bst_status bst_otf_convolve_create(bst_ctx *ctx, const bst_psf *psf, double cutoff,
                                   const bst_otf_convolve_layout *shape, bst_parallel *pool,
                                   bst_otf_convolve **out) BST_MUST_CHECK;
/* Frees a convolution with its buffers; NULL is allowed. */
void bst_otf_convolve_free(bst_otf_convolve *fft);

/* Layout of the grids; it belongs to the convolution. */
const bst_otf_convolve_layout *bst_otf_convolve_shape(const bst_otf_convolve *fft);

/* Size of the grid and image memory, floats, 64-byte aligned. */
size_t bst_otf_convolve_floats(const bst_otf_convolve *fft);
/* Row stride of the image, floats. */
int bst_otf_convolve_pitch(const bst_otf_convolve *fft);

/* Adds the grid with the light of PSF node `node`: sample (i, j) at grid[(j / 16 * x.samples + i) *
 * 16 + j % 16]. The image is the sum over the nodes from the `first` to the `last` one. */
void bst_otf_convolve_add(bst_otf_convolve *fft, int node, bool first, bool last,
                          const float *grid);

/* Writes the image after the last node: window pixel (i, j) at image[j * pitch + i]; rows are
 * padded to a multiple of 16 with pixels beyond the window. */
void bst_otf_convolve_finish(bst_otf_convolve *fft, float *image);

#endif
