#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "scenegen/fourier/otf_convolve_internal.h"
#include "sim/core/simd.h"

/* Takes a free work space. */
static bench *take_bench(bst_otf_convolve *f) {
    for (int i = 0;; i = (i + 1) % f->bench_count) {
        if (!atomic_flag_test_and_set(&f->benches[i].taken)) {
            return &f->benches[i];
        }
    }
}

#define BST_SIMD_KERNELS "scenegen/fourier/otf_convolve_kernels.inc"
#include "sim/core/simd_each.inc"

/* ------------------------------------------------------------------ Forward rows */

/* Forward FFT of pairs of row blocks, which fill whole rows of cells. */
static void rows_forward(void *user, int begin, int end) {
    const pass *p = user;
    bst_otf_convolve *f = p->fft;
    bench *w = take_bench(f);
    int per_cell = f->cell / BLOCK, fields = bst_psf_nodes(f->psf) / f->spectra;
    size_t spectrum = (size_t)(p->node / fields) * (size_t)f->cells_y;
    for (int j = begin; j < end; j++) {
        int a = 2 * j, b = a + 1 < f->row_blocks ? a + 1 : -1;
        size_t row_a = (size_t)(a / per_cell), row_b = (size_t)((b < 0 ? a : b) / per_cell);
        float *cells_a = f->cells + (spectrum + row_a) * (size_t)f->cells_x;
        float *cells_b = f->cells + (spectrum + row_b) * (size_t)f->cells_x;
        size_t block = (size_t)f->shape.x.samples * BLOCK,
               bytes = (size_t)f->cells_x * sizeof *cells_a;
        if (p->node % fields == 0) {
            memset(cells_a, 0, bytes);
            memset(cells_b, 0, bytes);
        }
        bool any = BST_SIMD_PICK(load_rows)(f, p->grid + (size_t)a * block,
                                            b < 0 ? NULL : p->grid + (size_t)b * block, w->line,
                                            cells_a, cells_b);
        if (any) {
            bst_batch_fft_run(f->row_forward, w->line);
        }
        for (int i = 0; i < f->strip_count; i++) {
            bst_batch *to = f->spectrum + (size_t)i * f->strip_pitch + (size_t)a * BLOCK;
            if (any) {
                BST_SIMD_PICK(store_strip)
                (f, &f->strips[i], w->line, to, b < 0 ? NULL : to + BLOCK);
            } else {
                memset(to, 0, (b < 0 ? 1U : 2U) * BLOCK * sizeof *to);
            }
        }
    }
    bst_simd_stream_end();
    atomic_flag_clear(&w->taken);
}

/* ------------------------------------------------------------------ Columns */

/* Replaces the cells' light by the far-wing correction of all nodes. */
static void correct_wings(bst_otf_convolve *f) {
    float scale = (float)(1.0 / (f->kernel_x[0] * f->kernel_y[0]));
    size_t count = (size_t)f->cells_x * (size_t)f->cells_y;
    for (int s = 0; s < f->spectra; s++) {
        float *cells = f->cells + (size_t)s * count;
        for (size_t i = 0; i < count; i++) {
            cells[i] *= f->wrap[s] ? scale : 0.0f;
        }
        if (f->wrap[s]) {
            bst_alias_correction_run(f->wrap[s], cells);
        }
        for (size_t i = 0; s > 0 && i < count; i++) {
            f->cells[i] += cells[i];
        }
    }
}

/* Column FFTs of image column blocks; with the last node, the far-wing correction first. */
static void columns(void *user, int begin, int end) {
    const pass *p = user;
    bst_otf_convolve *f = p->fft;
    bench *w = take_bench(f);
    size_t pixels = (size_t)f->shape.y.pixels;
    for (int i = begin; i < end; i++) {
        int c = i - (p->last && f->wraps);
        if (c < 0) {
            correct_wings(f);
            continue;
        }
        bst_batch *sum = f->sum ? f->sum + (size_t)c * pixels : w->line;
        if (p->first) {
            memset(sum, 0, pixels * sizeof *sum);
        }
        for (const strip *s = f->strips + f->first_strip[c]; s < f->strips + f->first_strip[c + 1];
             s++) {
            bst_batch *line = f->spectrum + (size_t)(s - f->strips) * f->strip_pitch;
            bst_batch_fft_run(f->column_forward, line);
            BST_SIMD_PICK(fold)(f, s, f->table[p->node] + s->first, line, sum);
        }
        if (p->last) {
            bst_batch_fft_run(f->column_inverse, sum);
            BST_SIMD_PICK(store_image)(f, c, sum);
        }
    }
    bst_simd_stream_end();
    atomic_flag_clear(&w->taken);
}

void bst_otf_convolve_add(bst_otf_convolve *f, int node, bool first, bool last, const float *grid) {
    pass p = {.fft = f, .grid = grid, .node = node, .first = first, .last = last};
    bst_parallel_for(f->pool, (f->row_blocks + 1) / 2, 1, rows_forward, &p);
    bst_parallel_for(f->pool, f->column_blocks + (last && f->wraps), 1, columns, &p);
}

/* ------------------------------------------------------------------ Inverse rows */

/* Far wings of a row at the cell centres. */
BST_CLONES
static void row_of_wings(const bst_otf_convolve *f, int row, float *out) {
    int j;
    float v = (float)bst_otf_convolve_cell_place(f, &f->shape.y, f->cells_y, row, &j);
    const float *a = f->cells + (size_t)j * (size_t)f->cells_x, *b = a + f->cells_x;
    for (int i = 0; i < f->cells_x; i++) {
        out[i] = a[i] + v * (b[i] - a[i]);
    }
}

/* Inverse FFT of pairs of row blocks of the window. */
static void rows_inverse(void *user, int begin, int end) {
    const pass *p = user;
    bst_otf_convolve *f = p->fft;
    bench *w = take_bench(f);
    for (int j = begin; j < end; j++) {
        int a = 2 * j, b = a + 1 < f->image_blocks ? a + 1 : a;
        BST_SIMD_PICK(join_rows)
        (f, f->image + (size_t)a * f->image_pitch, f->image + (size_t)b * f->image_pitch, w->line);
        bst_batch_fft_run(f->row_inverse, w->line);
        for (int k = a; k <= b; k++) {
            int top = k * BLOCK, rows = f->shape.height - top;
            rows = rows < BLOCK ? rows : BLOCK;
            float *image = p->image + (size_t)top * (size_t)f->pitch;
            for (int r = 0; f->wraps && r < rows; r++) {
                row_of_wings(f, top + r, w->wings + (size_t)r * (size_t)(f->cells_x + SHARES));
            }
            BST_SIMD_PICK(store_rows)(f, w->line, k > a, rows, f->wraps ? w->wings : NULL, image);
        }
    }
    bst_simd_stream_end();
    atomic_flag_clear(&w->taken);
}

void bst_otf_convolve_finish(bst_otf_convolve *f, float *image) {
    pass p = {.fft = f, .image = image};
    bst_parallel_for(f->pool, (f->image_blocks + 1) / 2, 1, rows_inverse, &p);
}
