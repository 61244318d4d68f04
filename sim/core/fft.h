/* Discrete Fourier transforms of two-dimensional arrays.
 *
 * Forward: X[v][u] = sum over y, x of a[y][x] exp(-2 pi i (u x / columns + v y / rows)). Inverse:
 * the same with exp(+2 pi i ...). Neither is scaled: forward and inverse give the input times
 * rows * columns. Frequencies are in wrap-around order: 0, 1, ..., -2, -1.
 *
 * Arrays are row-major. A complex array is [rows][columns]. The spectrum of a real array is
 * [rows][columns / 2 + 1], without the frequencies that are complex conjugates of others. A real
 * array is [rows][columns], or, in place of its spectrum, [rows][2 (columns / 2 + 1)] with unused
 * values at the ends of rows.
 *
 * The CMake option BORESIGHT_FFT selects the library that computes them. Results of the libraries
 * differ by rounding: the relative RMS error is below 3e-7 in single precision and below 1e-13 in
 * double precision, up to 2048 values along an axis (tests/core/test_fft.c). */
#ifndef BST_CORE_FFT_H
#define BST_CORE_FFT_H

#include "boresight/status.h"

#ifdef __cplusplus
#define BST_NOEXCEPT noexcept
extern "C" {
#else
#define BST_NOEXCEPT
#endif

/* real and imaginary part */
typedef float bst_fft_complex_f32[2];
typedef double bst_fft_complex_f64[2];

typedef enum bst_fft_kind {
    BST_FFT_FORWARD,      /* complex, in place */
    BST_FFT_INVERSE,      /* complex, in place */
    BST_FFT_REAL_FORWARD, /* real to spectrum; in place or not */
    BST_FFT_REAL_INVERSE  /* spectrum to real, in place */
} bst_fft_kind;

/* Transform of one kind, size and precision between two arrays, with its work space. */
typedef struct bst_fft bst_fft;

/* Name and version of the library that transforms. */
const char *bst_fft_library(void) BST_NOEXCEPT;

/* Allocates an array for transforms, aligned for vector instructions, uninitialised.
 *
 * Given:     bytes  above 0
 * Returned:  NULL if out of memory. Free with bst_fft_array_free */
void *bst_fft_array(size_t bytes) BST_NOEXCEPT;
/* Frees an array of bst_fft_array; NULL is allowed. */
void bst_fft_array_free(void *array) BST_NOEXCEPT;

/* Creates a transform in single precision. Any thread may call it at any time.
 *
 * Given:     rows, columns  above 0; products of 2, 3 and 5 are fast
 *            in, out        arrays of bst_fft_array; equal for a transform in place. They are not
 *                           read, but may be overwritten
 * Returned:  *out_fft       transform of `in` to `out`, which the caller keeps until it is freed
 * Errors:    BST_ERR_MEMORY */
bst_status bst_fft_create_f32(bst_ctx *ctx, bst_fft_kind kind, int rows, int columns, float *in,
                              float *out, bst_fft **out_fft) BST_NOEXCEPT BST_MUST_CHECK;
/* Creates a transform in double precision, as bst_fft_create_f32. */
bst_status bst_fft_create_f64(bst_ctx *ctx, bst_fft_kind kind, int rows, int columns, double *in,
                              double *out, bst_fft **out_fft) BST_NOEXCEPT BST_MUST_CHECK;
/* Frees a transform, not its arrays; NULL is allowed. */
void bst_fft_free(bst_fft *fft) BST_NOEXCEPT;

/* Transforms the arrays that the transform was created with. It allocates no memory. One thread at
 * a time. */
void bst_fft_run(bst_fft *fft) BST_NOEXCEPT;

#ifdef __cplusplus
}
#endif

#endif
