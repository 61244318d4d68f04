/* Fourier render path: light through a general PSF (aberrated, not separable, wings not truncated).
 *
 * The frame's nodes are spread on a grid on the device, as dense as the PSF's band requires. The
 * host's threads convolve the grid by FFT (in place for a CPU device), and the image goes to the
 * tile kernel. The cost depends on window size and number of nodes, hardly on the PSF. A
 * field-dependent PSF costs one grid per field node, times its number of spectra. */
#ifndef BST_SCENEGEN_FOURIER_FOURIER_RENDER_H
#define BST_SCENEGEN_FOURIER_FOURIER_RENDER_H

#include "boresight/messages.h"
#include "scenegen/fourier/fourier_error.h"
#include "scenegen/fourier/fourier_grid.h"
#include "scenegen/kernels/deposit_shared.h"
#include "scenegen/kernels/scene_shared.h"
#include "sim/device/device.h"

typedef struct bst_fourier_render bst_fourier_render;

typedef struct bst_fourier_render_options {
    int taps;               /* taps of the spreading kernel: 4, 6 or 8 */
    double tolerance;       /* grid error in any pixel, relative to the PSF's peak */
    int spatial_oversample; /* as in bst_renderer_options */
} bst_fourier_render_options;

/* Options with their defaults: 8 taps, tolerance 3e-5 of the PSF's peak. */
bst_fourier_render_options bst_fourier_render_default_options(void);

/* Creates the Fourier render path: measures the PSF and builds the kernel.
 *
 * Given:     psf      lent
 *            options  NULL: defaults
 * Errors:    BST_ERR_MEMORY, BST_ERR_DEVICE */
bst_status bst_fourier_render_create(bst_ctx *ctx, bst_device *device, const bst_camera *camera,
                                     const bst_psf *psf, const bst_fourier_render_options *options,
                                     bst_fourier_render **out) BST_MUST_CHECK;
/* Frees a renderer with its kernels and buffers on the device; NULL is allowed. */
void bst_fourier_render_free(bst_fourier_render *light);

/* Band of the PSF's frequencies; it belongs to the renderer. */
const bst_fourier_band *bst_fourier_render_band(const bst_fourier_render *light);

/* Distance outside the window, px, from which a source's light is still rendered. */
int bst_fourier_render_margin_px(const bst_fourier_render *light);

/* Smallest number of grid samples per px and axis, of the finer of the two grids if `fine`. */
double bst_fourier_render_density(const bst_fourier_render *light, bool fine);

/* Sets the reach of a source's nodes in its record. */
void bst_fourier_render_stamp(const bst_fourier_render *light, bst_kernel_source_record *source);

/* Largest widening of a node, in node variances (bst_fourier_band). */
double bst_fourier_render_widest(const bst_fourier_render *light);

/* Number of spectra of the PSF (bst_psf_spectra). */
int bst_fourier_render_spectra(const bst_fourier_render *light);

/* Begins a frame of read-out pixels of `binning` by `binning` of the sensor's, whose errors are
 * measured at the first one. Errors: BST_ERR_MEMORY. */
bst_status bst_fourier_render_begin(bst_ctx *ctx, bst_fourier_render *light,
                                    int binning) BST_MUST_CHECK;

/* Error bound of a source's image by grid, cut-off and widening kernel, in sigma of the worst pixel
 * (fourier_error.h).
 *
 * Given:     fine  the finer of the two grids */
double bst_fourier_render_error_sigma(const bst_fourier_render *light, bool fine, bst_window window,
                                      const bst_fourier_point *point);

/* Error bound by mixing of spectra (bst_psf_mixing_error), relative to the peak of a source with
 * its own spectrum. */
double bst_fourier_render_mixing_error(const bst_fourier_render *light);

/* Sources and node table of a frame on the device, and the boxes computed by the nodes kernel. */
typedef struct bst_fourier_render_nodes {
    cl_mem sources, table, block_box, source_box;
    cl_mem shares; /* float [sources][BST_SPECTRA] if the PSF has several spectra */
    int source_groups;
    bool fine; /* use the finer grid */
} bst_fourier_render_nodes;

/* Expected electrons of a window: pixel (i, j) at buffer[first + j * pitch + i]. Valid until the
 * next call. */
typedef struct bst_fourier_render_image {
    cl_mem buffer;
    int first, pitch;
} bst_fourier_render_image;

/* Renders the light of a window. It waits for the nodes on `queue`. A new window size needs a
 * setup, which takes longer than the image; the latest few are kept. */
bst_status bst_fourier_render_frame(bst_ctx *ctx, bst_fourier_render *light, cl_command_queue queue,
                                    bst_window window, const bst_fourier_render_nodes *nodes,
                                    bst_fourier_render_image *out) BST_MUST_CHECK;

#endif
