/* What a PSF asks of the Fourier path: the band of its OTF, how far its light reaches, how fine
 * nodes must be, and the sizes of grids that serve it. */
#ifndef BST_SCENEGEN_FOURIER_FOURIER_GRID_H
#define BST_SCENEGEN_FOURIER_FOURIER_GRID_H

#include "boresight/status.h"
#include "scenegen/fourier/nufft_kernel.h"
#include "sim/optics/psf.h"

/* Binnings of pixels that are distinguished, the last for all above. */
enum { BST_PIXEL_PARTS = 8 };

/* Independent of the window. */
typedef struct bst_fourier_band {
    double cutoff;        /* cycles/px that are kept */
    double lost;          /* bound of the error of those that are not, over the PSF's peak */
    double peak;          /* largest share of a point's light in one pixel */
    double node_sigma_px; /* of the Gaussian that is as sensitive to coarse nodes: its derivatives
                             over its peak, of order 2, 4 and 6 (1, 3 and 15 over sigma to that
                             order), are at least the PSF's anywhere */
    /* what pixels binned n + 1 times show of the derivatives of order 2, 4 and 6, over their peak,
     * in parts of what those of the sensor show */
    double pixel_part[BST_PIXEL_PARTS][3];
    double share_sigma_px; /* of the Gaussian with the same peak */
    int reach_px;          /* beyond, a pixel gets less than 3e-7 of a point's light (16 to 160) */
    double beyond;         /* largest share of a point's light in a pixel beyond that */
    bst_nufft_kernel_band axis[2];
} bst_fourier_band;

/* Takes all field nodes together. BST_ERR_MEMORY. */
bst_status bst_fourier_band_measure(bst_ctx *ctx, const bst_psf *psf, double tolerance,
                                    bst_fourier_band *out) BST_MUST_CHECK;

/* One axis of a grid: a period of `pixels` px that `samples` samples cover. */
typedef struct bst_fourier_axis {
    int pixels, samples;
    bst_nufft_kernel spread;
    double error; /* bound, over the PSF's peak */
} bst_fourier_axis;

/* Samples per px that an axis needs (axis 0: x, 1: y) for an error below `tolerance` of the PSF's
 * peak, at most 5. */
double bst_fourier_density(const bst_fourier_band *band, int axis, int taps, double tolerance);

/* Sizes with quick FFTs, for at least `least` px at `density` samples per px or more; lines are
 * transformed along x or y. */
bst_fourier_axis bst_fourier_axis_choose(const bst_fourier_band *band, int axis, int taps,
                                         int least, double density);

#endif
