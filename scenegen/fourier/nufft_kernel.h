/* Spreading kernel of a non-uniform Fourier transform: how a point's light is put on the samples of
 * a grid so that, after division by the kernel's transform, the grid's FFT is the transform of the
 * point.
 *
 * phi(t) = exp(beta (sqrt(1 - (2 t / taps)^2) - 1)) for |t| <= taps / 2 samples, else 0
 * (Barnett, Magland and af Klinteberg 2019, SIAM J. Sci. Comput. 41, C479). */
#ifndef BST_SCENEGEN_FOURIER_NUFFT_KERNEL_H
#define BST_SCENEGEN_FOURIER_NUFFT_KERNEL_H

typedef struct bst_nufft_kernel {
    int taps; /* 2 to 8 samples per axis */
    double beta;
} bst_nufft_kernel;

/* Value phi(t) of the kernel; 0 outside half its taps.
 *
 * Given:     t  distance, samples of the grid */
double bst_nufft_kernel_value(const bst_nufft_kernel *spread, double t);

/* Integral of phi(t) cos(2 pi nu t) dt, nu in cycles per sample. */
double bst_nufft_kernel_transform(const bst_nufft_kernel *spread, double nu);

/* The strength of a PSF's frequencies along one axis: weight[i], summing to 1, at
 * (i + 1/2) * step cycles/px. */
enum { BST_SPREAD_BINS = 48 };
typedef struct bst_nufft_kernel_band {
    double step;
    double weight[BST_SPREAD_BINS];
} bst_nufft_kernel_band;

/* Chooses beta for a grid of `density` samples per px. Returns a bound of the error that the grid
 * brings along this axis, relative to the PSF's peak: aliases and frequencies beyond the grid's
 * band. */
double bst_nufft_kernel_choose(bst_nufft_kernel *spread, const bst_nufft_kernel_band *band,
                               double density);

/* A kernel that also widens: phi(t) (c0 + c1 z^2 + c2 z^4), z = 2 t / taps. */
typedef struct bst_nufft_kernel_shape {
    double c[3];
} bst_nufft_kernel_shape;

/* The coefficients with which the grid shows, after division by phi's own transform, the PSF
 * widened by a Gaussian of `variance` samples^2 (least squares over the band; the
 * light is kept exactly). Returns the error relative to the PSF's peak. */
double bst_nufft_kernel_widen(const bst_nufft_kernel *spread, const bst_nufft_kernel_band *band,
                              double density, double variance, bst_nufft_kernel_shape *out);

/* Value of the widening kernel, phi(t) (c0 + c1 z^2 + c2 z^4) with z = 2 t / taps.
 *
 * Given:     t  distance, samples of the grid */
double bst_nufft_kernel_shape_value(const bst_nufft_kernel *spread,
                                    const bst_nufft_kernel_shape *shape, double t);

#endif
