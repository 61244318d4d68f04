#include "scenegen/fourier/batch_fft.h"

#include <math.h>
#include <stdlib.h>

#include "boresight/vec.h"

enum { MOST_PASSES = 24, MOST_RADIX = 8 };

/* One FFT pass over blocks of `radix` x `step` elements: radix elements `step` apart are
 * transformed and multiplied by twiddle[j][1 .. radix - 1], j the index of the first. */
typedef struct fft_pass {
    int radix, step;
    float *twiddle; /* [step][radix - 1][2]; NULL: none */
} fft_pass;

struct bst_batch_fft {
    int n, passes;
    fft_pass pass[MOST_PASSES];
    int *order;
};

/* ------------------------------------------------------------------ Passes */

/* Output position of frequency k in each butterfly. */
static const signed char places[MOST_RADIX + 1][MOST_RADIX] = {[2] = {0, 1},
                                                               [3] = {0, 1, 2},
                                                               [4] = {0, 2, 1, 3},
                                                               [5] = {0, 1, 2, 3, 4},
                                                               [8] = {0, 4, 2, 6, 1, 5, 3, 7}};

#define BST_SIMD_KERNELS "scenegen/fourier/batch_fft_kernels.inc"
#include "sim/core/simd_each.inc"

void bst_batch_fft_run(const bst_batch_fft *f, bst_batch *data) {
    void (*run_pass)(const fft_pass *, bst_batch *, int) = BST_SIMD_PICK(run_pass);
    /* after the first pass its blocks are independent transforms, each within a core's cache */
    run_pass(&f->pass[0], data, f->n);
    int step = f->pass[0].step;
    for (int begin = 0; begin < f->n; begin += step) {
        for (int k = 1; k < f->passes; k++) {
            run_pass(&f->pass[k], data + begin, step);
        }
    }
}

/* ------------------------------------------------------------------ Plans */

/* Factors n into radices, largest first; returns their number, 0 if n has other prime factors. */
static int split(int n, int radix[MOST_PASSES]) {
    static const int order[5] = {8, 5, 4, 3, 2};
    int count = 0;
    for (int i = 0; i < 5; i++) {
        while (n % order[i] == 0) {
            /* two radix-4 passes rather than radix 8 and 2 */
            if (order[i] == 8 && n % 16 == 0 && (n / 16) % 2 != 0) {
                break;
            }
            radix[count++] = order[i];
            n /= order[i];
        }
    }
    return n == 1 ? count : 0;
}

double bst_batch_fft_cost(int n) {
    int radix[MOST_PASSES], count = n >= BST_LANES ? split(n, radix) : 0;
    /* operations per element, twiddle factors included */
    static const double work[MOST_RADIX + 1] = {
        [2] = 5.0, [3] = 9.3, [4] = 8.5, [5] = 14.0, [8] = 12.5};
    double sum = count > 0 ? 0.0 : INFINITY;
    for (int k = 0; k < count; k++) {
        sum += n * work[radix[k]];
    }
    return sum;
}

static bst_status make_pass(bst_ctx *ctx, fft_pass *p) {
    int n = p->radix * p->step;
    if (p->step == 1) {
        return BST_OK;
    }
    p->twiddle = malloc(2 * sizeof(float) * (size_t)(p->radix - 1) * (size_t)p->step);
    if (!p->twiddle) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a transform of %d", n);
    }
    for (int j = 0; j < p->step; j++) {
        for (int k = 1; k < p->radix; k++) {
            float *w = p->twiddle + 2 * ((size_t)j * (size_t)(p->radix - 1));
            /* twiddle factors are stored in the butterfly's output order */
            int place = places[p->radix][k];
            double a = -2.0 * BST_PI * (double)j * k / n;
            w[2 * (place - 1)] = (float)cos(a);
            w[2 * (place - 1) + 1] = (float)sin(a);
        }
    }
    return BST_OK;
}

bst_status bst_batch_fft_create(bst_ctx *ctx, int n, bst_batch_fft **out) {
    int radix[MOST_PASSES];
    *out = NULL;
    bst_batch_fft *f = calloc(1, sizeof *f);
    int *order = malloc((size_t)n * sizeof *order);
    if (!f || !order) {
        free(f);
        free(order);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a transform of %d", n);
    }
    f->n = n;
    f->order = order;
    f->passes = split(n, radix);
    bst_status status = BST_OK;
    for (int k = 0, length = n; k < f->passes && status == BST_OK; k++) {
        length /= radix[k];
        f->pass[k] = (fft_pass){radix[k], length, NULL};
        status = make_pass(ctx, &f->pass[k]);
    }
    if (status != BST_OK) {
        bst_batch_fft_free(f);
        return status;
    }
    for (int k = 0; k < n; k++) {
        int rest = k, place = 0;
        for (int i = 0; i < f->passes; i++) {
            place += places[radix[i]][rest % radix[i]] * f->pass[i].step;
            rest /= radix[i];
        }
        order[k] = place;
    }
    *out = f;
    return BST_OK;
}

void bst_batch_fft_free(bst_batch_fft *f) {
    if (f) {
        for (int k = 0; k < f->passes; k++) {
            free(f->pass[k].twiddle);
        }
        free(f->order);
        free(f);
    }
}

const int *bst_batch_fft_order(const bst_batch_fft *f) {
    return f->order;
}
