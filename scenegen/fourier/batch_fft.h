/* FFT of sixteen sequences at a time, one per SIMD lane.
 *
 * Sequence l gives X_l[k] = sum over j of x_l[j] exp(-2 pi i j k / n), in the order of decimation
 * in frequency (bst_batch_fft_order). With real and imaginary parts swapped before and after, it is
 * the inverse times n. Results are equal for all vector widths. */
#ifndef BST_SCENEGEN_FOURIER_BATCH_FFT_H
#define BST_SCENEGEN_FOURIER_BATCH_FFT_H

#include "boresight/status.h"

enum { BST_LANES = 16 };

/* One complex number of each of sixteen sequences. */
typedef struct bst_batch {
    _Alignas(64) float re[BST_LANES];
    float im[BST_LANES];
} bst_batch;

typedef struct bst_batch_fft bst_batch_fft;

/* Relative cost of an FFT of length n; INFINITY unless n >= 16 has prime factors 2, 3 and 5 only.
 */
double bst_batch_fft_cost(int n);

/* Creates a plan for a length n of finite cost. Errors: BST_ERR_MEMORY. */
bst_status bst_batch_fft_create(bst_ctx *ctx, int n, bst_batch_fft **out) BST_MUST_CHECK;
/* Frees a transform; NULL is allowed. */
void bst_batch_fft_free(bst_batch_fft *fft);

/* Output order: X[k] is at index order[k], 0 <= k < n. */
const int *bst_batch_fft_order(const bst_batch_fft *fft);

/* Transforms n elements, aligned to 64 bytes, in place. Several threads may use one plan. */
void bst_batch_fft_run(const bst_batch_fft *fft, bst_batch *data);

#endif
