#include "scenegen/fourier/alias_correction.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/fft.h"

enum { PERIODS = 4 };

struct bst_alias_correction {
    int cells[2]; /* x, y */
    int size[2];  /* FFT size of the cells */
    float *room;  /* work space [size y][2 (size x / 2 + 1)] */
    float *kernel;
    bst_fft *forward, *inverse;
};

static int padded(int n) {
    return 2 * (n / 2 + 1);
}

/* Smallest size >= `least` with prime factors 2, 3 and 5 only. */
static int fft_size(int least) {
    for (int n = (least + 7) / 8 * 8;; n += 8) {
        int rest = n;
        for (int p = 2; p <= 5; p += p == 2 ? 1 : 2) {
            while (rest % p == 0) {
                rest /= p;
            }
        }
        if (rest == 1) {
            return n;
        }
    }
}

/* Fine grid of displacements: half a cell, over PERIODS periods. */
typedef struct lattice {
    const bst_psf *psf;
    int spectrum;
    const bst_alias_correction_axis *axis[2];
    int n[2];
    bst_fft_complex_f32 *data; /* [n y][n x / 2 + 1] */
} lattice;

static void fill_rows(void *user, int begin, int end) {
    const lattice *l = user;
    int nodes = bst_psf_nodes(l->psf) / bst_psf_spectra(l->psf), half = l->n[0] / 2 + 1;
    double long_x = (double)PERIODS * l->axis[0]->pixels,
           long_y = (double)PERIODS * l->axis[1]->pixels;
    double whole = 1.0 / (long_x * long_y), part = whole * PERIODS * PERIODS;
    double blur = 2.0 * BST_PI * BST_PI;
    for (int row = begin; row < end; row++) {
        int j = row <= l->n[1] / 2 ? row : row - l->n[1];
        for (int i = 0; i < half; i++) {
            double fx = i / long_x, fy = j / long_y, sum[2] = {0.0, 0.0};
            double smooth = exp(-blur * (fx * fx * l->axis[0]->cell_px * l->axis[0]->cell_px +
                                         fy * fy * l->axis[1]->cell_px * l->axis[1]->cell_px));
            for (int n = 0; n < nodes && smooth > 1e-9; n++) {
                double v[2];
                bst_psf_otf(l->psf, l->spectrum * nodes + n, fx, fy, v);
                sum[0] += v[0] / nodes;
                sum[1] += v[1] / nodes;
            }
            double factor = smooth * (whole - (i % PERIODS == 0 && j % PERIODS == 0 ? part : 0.0));
            float *z = l->data[(size_t)row * (size_t)half + (size_t)i];
            z[0] = (float)(sum[0] * factor);
            z[1] = (float)(sum[1] * factor);
        }
    }
}

/* Copies the kernel for displacements within the cells into the FFT work space; returns its largest
 * value within the used range. */
static double copy_kernel(bst_alias_correction *w, const lattice *l) {
    const float *image = *l->data;
    double largest = 0.0;
    memset(w->room, 0, sizeof(float) * (size_t)w->size[1] * (size_t)padded(w->size[0]));
    for (int dy = 1 - w->cells[1]; dy < w->cells[1]; dy++) {
        for (int dx = 1 - w->cells[0]; dx < w->cells[0]; dx++) {
            bool used = fabs(dx * l->axis[0]->cell_px) <= l->axis[0]->used_px &&
                        fabs(dy * l->axis[1]->cell_px) <= l->axis[1]->used_px;
            /* position on the fine grid, whose cells are half as large */
            int row = (2 * dy + l->n[1]) % l->n[1], column = (2 * dx + l->n[0]) % l->n[0];
            float v = image[(size_t)row * (size_t)padded(l->n[0]) + (size_t)column];
            if (used) {
                largest = fmax(largest, fabs((double)v));
                w->room[(size_t)((dy + w->size[1]) % w->size[1]) * (size_t)padded(w->size[0]) +
                        (size_t)((dx + w->size[0]) % w->size[0])] = v;
            }
        }
    }
    return largest;
}

static bst_status make_kernel(bst_ctx *ctx, bst_alias_correction *w, lattice *l, bst_parallel *pool,
                              double *largest) {
    bst_fft *to_image;
    BST_TRY(bst_fft_create_f32(ctx, BST_FFT_REAL_INVERSE, l->n[1], l->n[0], *l->data, *l->data,
                               &to_image));
    bst_parallel_for(pool, l->n[1], 16, fill_rows, l);
    bst_fft_run(to_image);
    bst_fft_free(to_image);
    *largest = copy_kernel(w, l);
    bst_fft_run(w->forward);
    size_t count = (size_t)w->size[1] * (size_t)padded(w->size[0]);
    double scale = 1.0 / ((double)w->size[0] * w->size[1]);
    for (size_t i = 0; i < count; i++) {
        w->kernel[i] = (float)(w->room[i] * scale);
    }
    return BST_OK;
}

static bst_status make_transforms(bst_ctx *ctx, bst_alias_correction *w) {
    BST_TRY(bst_fft_create_f32(ctx, BST_FFT_REAL_FORWARD, w->size[1], w->size[0], w->room, w->room,
                               &w->forward));
    return bst_fft_create_f32(ctx, BST_FFT_REAL_INVERSE, w->size[1], w->size[0], w->room, w->room,
                              &w->inverse);
}

bst_status bst_alias_correction_create(bst_ctx *ctx, const bst_psf *psf, int spectrum,
                                       const bst_alias_correction_axis *x,
                                       const bst_alias_correction_axis *y, bst_parallel *pool,
                                       bst_alias_correction **out) {
    assert(psf && x && y && out && spectrum >= 0);
    *out = NULL;
    bst_alias_correction *w = calloc(1, sizeof *w);
    lattice l = {psf, spectrum, {x, y}, {0, 0}, NULL};
    if (!w) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the far wings");
    }
    for (int a = 0; a < 2; a++) {
        w->cells[a] = l.axis[a]->cells;
        w->size[a] = fft_size(2 * w->cells[a]);
        l.n[a] = (int)lround(2.0 * PERIODS * l.axis[a]->pixels / l.axis[a]->cell_px);
    }
    size_t bytes = sizeof(float) * (size_t)w->size[1] * (size_t)padded(w->size[0]);
    w->room = bst_fft_array(bytes);
    w->kernel = malloc(bytes);
    l.data = bst_fft_array(sizeof(float) * (size_t)l.n[1] * (size_t)padded(l.n[0]));
    bst_status status = BST_OK;
    double largest = 0.0;
    if (!w->room || !w->kernel || !l.data) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "no memory for the far wings");
    } else {
        status = make_transforms(ctx, w);
    }
    if (status == BST_OK) {
        status = make_kernel(ctx, w, &l, pool, &largest);
    }
    bst_fft_array_free(l.data);
    /* a correction below the rounding of single precision, 6e-8, is none */
    if (status != BST_OK || largest * x->used_px * y->used_px < 1e-7) {
        bst_alias_correction_free(w);
        return status;
    }
    *out = w;
    return BST_OK;
}

void bst_alias_correction_free(bst_alias_correction *w) {
    if (w) {
        bst_fft_free(w->forward);
        bst_fft_free(w->inverse);
        bst_fft_array_free(w->room);
        free(w->kernel);
        free(w);
    }
}

void bst_alias_correction_run(bst_alias_correction *w, float *light) {
    int pitch = padded(w->size[0]);
    size_t count = (size_t)w->size[1] * (size_t)pitch;
    memset(w->room, 0, sizeof(float) * count);
    for (int j = 0; j < w->cells[1]; j++) {
        memcpy(w->room + (size_t)j * (size_t)pitch, light + (size_t)j * (size_t)w->cells[0],
               sizeof(float) * (size_t)w->cells[0]);
    }
    bst_fft_run(w->forward);
    for (size_t i = 0; i < count; i += 2) {
        float a = w->room[i], b = w->room[i + 1], c = w->kernel[i], d = w->kernel[i + 1];
        w->room[i] = a * c - b * d;
        w->room[i + 1] = a * d + b * c;
    }
    bst_fft_run(w->inverse);
    for (int j = 0; j < w->cells[1]; j++) {
        memcpy(light + (size_t)j * (size_t)w->cells[0], w->room + (size_t)j * (size_t)pitch,
               sizeof(float) * (size_t)w->cells[0]);
    }
}
