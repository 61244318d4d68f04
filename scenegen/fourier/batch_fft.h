/* Fourier transforms of sixteen sequences at a time, side by side in the lanes of vectors.
 *
 * The result of sequence l is X_l[k] = sum over j of x_l[j] exp(-2 pi i j k / n). It is left in the
 * order of decimation in frequency, which costs a reader that knows the order nothing. With real
 * and imaginary parts swapped before and after, the same gives the inverse, times n. The numbers
 * are the same with vectors of every width. */
#ifndef BST_SCENEGEN_FOURIER_BATCH_FFT_H
#define BST_SCENEGEN_FOURIER_BATCH_FFT_H

#include "boresight/status.h"

enum { BST_LANES = 16 };

/* One number of sixteen sequences. */
typedef struct bst_batch {
    _Alignas(64) float re[BST_LANES];
    float im[BST_LANES];
} bst_batch;

typedef struct bst_batch_fft bst_batch_fft;

/* Time of a transform of length n by its number of operations; INFINITY unless n >= 16 is a product
 * of powers of 2, 3 and 5. */
double bst_batch_fft_cost(int n);

/* For such an n. BST_ERR_MEMORY. */
bst_status bst_batch_fft_create(bst_ctx *ctx, int n, bst_batch_fft **out) BST_MUST_CHECK;
/* Frees a transform; NULL is allowed. */
void bst_batch_fft_free(bst_batch_fft *fft);

/* order[k], 0 <= k < n: where run leaves X[k]. */
const int *bst_batch_fft_order(const bst_batch_fft *fft);

/* In place, n elements aligned to 64 bytes. Several threads may run one plan at a time. */
void bst_batch_fft_run(const bst_batch_fft *fft, bst_batch *data);

#endif
