/* Light through a general PSF: aberrated, not separable, its wings not cut.
 *
 * The frame's nodes are spread on a grid of the density that the PSF's band asks for, on the
 * device; the grid is convolved by FFT on the host's threads (a CPU device's memory is used in
 * place), and the image goes to the tile kernel. The cost depends on the window and the number of
 * nodes, hardly on the PSF; a field-dependent PSF costs one grid per field node, and one with
 * several spectra that many of each. */
#ifndef BST_SCENEGEN_FOURIER_FOURIER_RENDER_H
#define BST_SCENEGEN_FOURIER_FOURIER_RENDER_H

#include "boresight/messages.h"
#include "scenegen/fourier/fourier_grid.h"
#include "scenegen/kernels/deposit_shared.h"
#include "scenegen/kernels/scene_shared.h"
#include "sim/device/device.h"

typedef struct bst_fourier_render bst_fourier_render;

typedef struct bst_fourier_render_options {
    int taps;               /* of the spreading kernel: 4, 6 or 8 */
    double tolerance;       /* error of the grid in any pixel, over the PSF's peak */
    int spatial_oversample; /* as the renderer's */
} bst_fourier_render_options;

/* Options with their defaults: 8 taps, tolerance 3e-5 of the PSF's peak. */
bst_fourier_render_options bst_fourier_render_default_options(void);

/* Measures the PSF and builds the kernel. The PSF is borrowed. `options` may be NULL. */
bst_status bst_fourier_render_create(bst_ctx *ctx, bst_device *device, const bst_camera *camera,
                                     const bst_psf *psf, const bst_fourier_render_options *options,
                                     bst_fourier_render **out) BST_MUST_CHECK;
/* Frees a renderer with its kernels and buffers on the device; NULL is allowed. */
void bst_fourier_render_free(bst_fourier_render *light);

/* Band of the PSF's frequencies; it belongs to the renderer. */
const bst_fourier_band *bst_fourier_render_band(const bst_fourier_render *light);

/* Pixels outside the window from which a source's light is still drawn. */
int bst_fourier_render_margin_px(const bst_fourier_render *light);

/* Least samples of its grid per px and axis. */
double bst_fourier_render_density(const bst_fourier_render *light);

/* Sets the part of a source's record that says how far its nodes reach. */
void bst_fourier_render_stamp(const bst_fourier_render *light, bst_kernel_source_record *source);

/* By how many node variances (bst_fourier_band) a node may be widened. */
double bst_fourier_render_widest(const bst_fourier_render *light);

/* Spectra of the PSF (bst_psf_spectra). */
int bst_fourier_render_spectra(const bst_fourier_render *light);

/* Bound of an image's error by grid and cut-off, in sigma of the worst pixel, of a source with
 * `peak_e` electrons in its brightest one (fourier_error.h). fine: with the finer of two grids.
 * wings: the window has no more than them of it. */
double bst_fourier_render_error_sigma(const bst_fourier_render *light, bool fine, bool wings,
                                      bst_window window, double peak_e, double dark_variance_e2);

/* Bound of its error by mixing spectra (bst_psf_mixing_error), over the peak of a source that has
 * one of its own. */
double bst_fourier_render_mixing_error(const bst_fourier_render *light);

/* The frame's sources and node table on the device, and the boxes that the nodes kernel made. */
typedef struct bst_fourier_render_nodes {
    cl_mem sources, table, block_box, source_box;
    cl_mem shares; /* float [sources][BST_SPECTRA], where the PSF has several spectra */
    int source_groups;
    bool fine; /* on the finer grid */
} bst_fourier_render_nodes;

/* Expected electrons of the window's pixels: pixel (i, j) at buffer[first + j * pitch + i]. Valid
 * until the next call. */
typedef struct bst_fourier_render_image {
    cl_mem buffer;
    int first, pitch;
} bst_fourier_render_image;

/* Makes the image of a window. Waits for the nodes on `queue`. Prepares for a window of a new size
 * first, which takes longer than the image itself; the latest few sizes are kept. */
bst_status bst_fourier_render_frame(bst_ctx *ctx, bst_fourier_render *light, cl_command_queue queue,
                                    bst_window window, const bst_fourier_render_nodes *nodes,
                                    bst_fourier_render_image *out) BST_MUST_CHECK;

#endif
