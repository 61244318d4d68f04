/* Fourier transforms by FFTW. Plans are estimated, not measured: a measurement would choose other
 * algorithms, with other rounding, from run to run. */
#include <assert.h>
#include <fftw3.h>
#include <stdlib.h>

#include "sim/core/fft.h"

/* one of the two is set */
struct bst_fft {
    fftwf_plan f32;
    fftw_plan f64;
};

void *bst_fft_array(size_t bytes) {
    assert(bytes > 0);
    return fftw_malloc(bytes);
}

void bst_fft_array_free(void *array) {
    fftw_free(array);
}

static bst_status finish(bst_ctx *ctx, int rows, int columns, bst_fft *fft, bst_fft **out) {
    *out = NULL;
    if (!fft || (!fft->f32 && !fft->f64)) {
        free(fft);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a Fourier transform of %d x %d", rows,
                        columns);
    }
    *out = fft;
    return BST_OK;
}

bst_status bst_fft_create_f32(bst_ctx *ctx, bst_fft_kind kind, int rows, int columns, float *in,
                              float *out, bst_fft **out_fft) {
    assert(rows > 0 && columns > 0 && in && out && out_fft);
    assert(in == out || kind == BST_FFT_REAL_FORWARD);
    bst_fft *fft = calloc(1, sizeof *fft);
    fftwf_complex *spectrum = (fftwf_complex *)out;
    if (fft) {
        /* the planner belongs to the process, which may have several simulations */
        fftwf_make_planner_thread_safe();
        if (kind == BST_FFT_REAL_FORWARD) {
            fft->f32 = fftwf_plan_dft_r2c_2d(rows, columns, in, spectrum, FFTW_ESTIMATE);
        } else if (kind == BST_FFT_REAL_INVERSE) {
            fft->f32 = fftwf_plan_dft_c2r_2d(rows, columns, spectrum, out, FFTW_ESTIMATE);
        } else {
            int sign = kind == BST_FFT_FORWARD ? FFTW_FORWARD : FFTW_BACKWARD;
            fft->f32 = fftwf_plan_dft_2d(rows, columns, spectrum, spectrum, sign, FFTW_ESTIMATE);
        }
    }
    return finish(ctx, rows, columns, fft, out_fft);
}

bst_status bst_fft_create_f64(bst_ctx *ctx, bst_fft_kind kind, int rows, int columns, double *in,
                              double *out, bst_fft **out_fft) {
    assert(rows > 0 && columns > 0 && in && out && out_fft);
    assert(in == out || kind == BST_FFT_REAL_FORWARD);
    bst_fft *fft = calloc(1, sizeof *fft);
    fftw_complex *spectrum = (fftw_complex *)out;
    if (fft) {
        fftw_make_planner_thread_safe();
        if (kind == BST_FFT_REAL_FORWARD) {
            fft->f64 = fftw_plan_dft_r2c_2d(rows, columns, in, spectrum, FFTW_ESTIMATE);
        } else if (kind == BST_FFT_REAL_INVERSE) {
            fft->f64 = fftw_plan_dft_c2r_2d(rows, columns, spectrum, out, FFTW_ESTIMATE);
        } else {
            int sign = kind == BST_FFT_FORWARD ? FFTW_FORWARD : FFTW_BACKWARD;
            fft->f64 = fftw_plan_dft_2d(rows, columns, spectrum, spectrum, sign, FFTW_ESTIMATE);
        }
    }
    return finish(ctx, rows, columns, fft, out_fft);
}

void bst_fft_free(bst_fft *fft) {
    if (fft) {
        if (fft->f32) {
            fftwf_destroy_plan(fft->f32);
        }
        if (fft->f64) {
            fftw_destroy_plan(fft->f64);
        }
        free(fft);
    }
}

void bst_fft_run(bst_fft *fft) {
    assert(fft);
    if (fft->f32) {
        fftwf_execute(fft->f32);
    } else {
        fftw_execute(fft->f64);
    }
}

const char *bst_fft_library(void) {
    return fftwf_version;
}
