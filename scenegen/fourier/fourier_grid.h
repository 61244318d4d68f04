/* Grid requirements of a PSF on the Fourier render path: OTF band, extent of its light, node
 * spacing, and grid sizes. */
#ifndef BST_SCENEGEN_FOURIER_FOURIER_GRID_H
#define BST_SCENEGEN_FOURIER_FOURIER_GRID_H

#include "boresight/status.h"
#include "scenegen/fourier/nufft_kernel.h"
#include "scenegen/fourier/psf_sensitivity.h"
#include "sim/optics/psf.h"

/* Number of binnings distinguished; the last covers all larger ones. */
enum { BST_PIXEL_PARTS = 8 };

/* Band of a PSF, independent of the window. */
typedef struct bst_fourier_band {
    double cutoff; /* highest kept frequency, cycles/px */
    double lost;   /* error bound by the neglected frequencies, relative to the PSF's peak */
    double peak;   /* largest share of a point's light in one pixel */
    /* Gaussian as sensitive to coarse nodes: its derivatives of order 2, 4 and 6 relative to its
     * peak (1, 3 and 15 over sigma to that order) are at least the PSF's */
    double node_sigma_px;
    /* variance of the Gaussian whose derivatives of order 4 and 6 smoothing reduces no more than
     * the PSF's, at least that of node_sigma_px */
    double smoothed_variance_px2;
    /* derivatives of order 2, 4 and 6 in pixels binned n + 1 times, relative to their peak and to
     * unbinned pixels */
    double pixel_part[BST_PIXEL_PARTS][3];
    bst_psf_sensitivity sensitivity; /* relative to the Gaussian of node_sigma_px */
    double share_sigma_px;           /* Gaussian with the same peak */
    int reach_px;  /* beyond it a pixel gets less than 3e-7 of a point's light (16 to 160) */
    double beyond; /* largest share of a point's light in a pixel beyond reach_px */
    bst_nufft_kernel_band axis[2];
} bst_fourier_band;

/* Measures the band of a PSF over all its field nodes. Errors: BST_ERR_MEMORY. */
bst_status bst_fourier_band_measure(bst_ctx *ctx, const bst_psf *psf, double tolerance,
                                    bst_fourier_band *out) BST_MUST_CHECK;

/* One axis of a grid: a period of `pixels` px covered by `samples` samples. */
typedef struct bst_fourier_axis {
    int pixels, samples;
    bst_nufft_kernel spread;
    double error; /* error bound relative to the PSF's peak */
} bst_fourier_axis;

/* Samples per px that an axis (0: x, 1: y) needs for an error below `tolerance` of the PSF's peak,
 * at most 5. */
double bst_fourier_density(const bst_fourier_band *band, int axis, int taps, double tolerance);

/* Chooses FFT-friendly sizes for at least `least` px at `density` or more samples per px. */
bst_fourier_axis bst_fourier_axis_choose(const bst_fourier_band *band, int axis, int taps,
                                         int least, double density);

#endif
