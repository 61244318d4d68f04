/* Spreading kernel of a non-uniform FFT: distributes a point's light over grid samples. After
 * division by the kernel's transform, the grid's FFT is the Fourier transform of the point.
 *
 * phi(t) = exp(beta (sqrt(1 - (2 t / taps)^2) - 1)) for |t| <= taps / 2 samples, else 0 (Barnett,
 * Magland and af Klinteberg 2019, SIAM J. Sci. Comput. 41, C479). */
#ifndef BST_SCENEGEN_FOURIER_NUFFT_KERNEL_H
#define BST_SCENEGEN_FOURIER_NUFFT_KERNEL_H

#include <stdbool.h>

typedef struct bst_nufft_kernel {
    int taps; /* 2 to 8 samples per axis */
    double beta;
} bst_nufft_kernel;

/* Value phi(t) of the kernel; 0 outside half its taps.
 *
 * Given:     t  distance, samples of the grid */
double bst_nufft_kernel_value(const bst_nufft_kernel *spread, double t);

/* Fourier transform of phi: integral of phi(t) cos(2 pi nu t) dt, nu in cycles per sample. */
double bst_nufft_kernel_transform(const bst_nufft_kernel *spread, double nu);

/* Spectrum of a PSF along one axis: weight[i], summing to 1, at (i + 1/2) * step cycles/px. */
enum { BST_SPREAD_BINS = 48 };
typedef struct bst_nufft_kernel_band {
    double step;
    double weight[BST_SPREAD_BINS];
} bst_nufft_kernel_band;

/* Chooses beta for a grid of `density` samples per px.
 *
 * Returned:  error bound of the grid along this axis relative to the PSF's peak: aliases, and
 *            frequencies beyond the grid's band */
double bst_nufft_kernel_choose(bst_nufft_kernel *spread, const bst_nufft_kernel_band *band,
                               double density);

/* True if a kernel of this many taps has an error bound, as bst_nufft_kernel_choose returns, of
 * `tolerance` or less on a grid of `density` samples per px. */
bool bst_nufft_kernel_suffices(int taps, const bst_nufft_kernel_band *band, double density,
                               double tolerance);

/* Widening kernel: phi(t) (c0 + c1 z^2 + c2 z^4), z = 2 t / taps. */
typedef struct bst_nufft_kernel_shape {
    double c[3];
} bst_nufft_kernel_shape;

/* Computes the coefficients with which the grid, divided by phi's own transform, shows the PSF
 * widened by a Gaussian of `variance` samples^2 (least squares over the band, flux conserved).
 * Returns the error relative to the PSF's peak. */
double bst_nufft_kernel_widen(const bst_nufft_kernel *spread, const bst_nufft_kernel_band *band,
                              double density, double variance, bst_nufft_kernel_shape *out);

/* Transform of the widening kernel over phi's own, at nu cycles per sample. */
double bst_nufft_kernel_shape_transform(const bst_nufft_kernel *spread,
                                        const bst_nufft_kernel_shape *shape, double nu);

/* Value of the widening kernel, phi(t) (c0 + c1 z^2 + c2 z^4) with z = 2 t / taps.
 *
 * Given:     t  distance, samples of the grid */
double bst_nufft_kernel_shape_value(const bst_nufft_kernel *spread,
                                    const bst_nufft_kernel_shape *shape, double t);

#endif
