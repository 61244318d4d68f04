#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "scenegen/light_fft_internal.h"

static bench *take_bench(bst_light_fft *f) {
    for (int i = 0;; i = (i + 1) % f->bench_count) {
        if (!atomic_flag_test_and_set(&f->benches[i].taken)) {
            return &f->benches[i];
        }
    }
}

/* ------------------------------------------------------------------ rows forward */

/* Loads two blocks of rows (the second may be NULL) as real and imaginary parts and adds them to
 * their rows of cells. Returns whether there is light. */
BST_LANES_FUNCTION
static bool load_rows(const bst_light_fft *f, const bst_lanes *a, const bst_lanes *b,
                      bst_batch *line, float *cells_a, float *cells_b) {
    bool any = false;
    for (int i = 0, x = 0; i < f->cells_x; i++) {
        int end = x + f->cell < f->shape.x.samples ? x + f->cell : f->shape.x.samples;
        bst_lanes sum_a = {0}, sum_b = {0};
        for (; x < end; x++) {
            line[x] = (bst_batch){a[x], b ? b[x] : (bst_lanes){0}};
            sum_a += line[x].re;
            sum_b += line[x].im;
        }
        float total_a = 0.0f, total_b = 0.0f;
        for (int l = 0; l < BLOCK; l++) {
            total_a += sum_a[l];
            total_b += sum_b[l];
        }
        cells_a[i] += total_a;
        any = any || total_a != 0.0f || total_b != 0.0f; /* light of a spectrum may be negative */
        if (b) {
            cells_b[i] += total_b;
        }
    }
    return any;
}

/* The spectra of two blocks of rows for one strip, from the transform of both as one complex
 * number: twice them. The columns become lanes. */
BST_LANES_FUNCTION
static void store_strip(const bst_light_fft *f, const strip *s, const bst_batch *line, bst_batch *a,
                        bst_batch *b) {
    const int *order = bst_batch_fft_order(f->row_forward);
    int samples = f->shape.x.samples;
    bst_lanes part[4][BLOCK];
    for (int l = 0; l < BLOCK; l++) {
        int k = s->k0 + l;
        if (abs(k) >= f->used) {
            part[0][l] = part[1][l] = part[2][l] = part[3][l] = (bst_lanes){0};
            continue;
        }
        const bst_batch *p = &line[order[k < 0 ? k + samples : k]];
        const bst_batch *q = &line[order[k > 0 ? samples - k : -k]];
        part[0][l] = p->re + q->re;
        part[1][l] = p->im - q->im;
        part[2][l] = p->im + q->im;
        part[3][l] = q->re - p->re;
    }
    for (int i = 0; i < (b ? 4 : 2); i++) {
        bst_lanes_transpose(part[i]);
    }
    for (int r = 0; r < BLOCK; r++) {
        bst_lanes_stream(&a[r].re, &part[0][r]);
        bst_lanes_stream(&a[r].im, &part[1][r]);
    }
    for (int r = 0; b && r < BLOCK; r++) {
        bst_lanes_stream(&b[r].re, &part[2][r]);
        bst_lanes_stream(&b[r].im, &part[3][r]);
    }
}

/* Pairs of blocks of rows, which fill whole rows of cells. */
static void rows_forward(void *user, int begin, int end) {
    const pass *p = user;
    bst_light_fft *f = p->fft;
    bench *w = take_bench(f);
    int per_cell = f->cell / BLOCK, fields = bst_psf_nodes(f->psf) / f->spectra;
    size_t spectrum = (size_t)(p->node / fields) * (size_t)f->cells_y;
    for (int j = begin; j < end; j++) {
        int a = 2 * j, b = a + 1 < f->row_blocks ? a + 1 : -1;
        size_t row_a = (size_t)(a / per_cell), row_b = (size_t)((b < 0 ? a : b) / per_cell);
        float *cells_a = f->cells + (spectrum + row_a) * (size_t)f->cells_x;
        float *cells_b = f->cells + (spectrum + row_b) * (size_t)f->cells_x;
        size_t block = (size_t)f->shape.x.samples, bytes = (size_t)f->cells_x * sizeof *cells_a;
        const bst_lanes *grid = (const bst_lanes *)p->grid;
        if (p->node % fields == 0) {
            memset(cells_a, 0, bytes);
            memset(cells_b, 0, bytes);
        }
        bool any = load_rows(f, grid + (size_t)a * block, b < 0 ? NULL : grid + (size_t)b * block,
                             w->line, cells_a, cells_b);
        if (any) {
            bst_batch_fft_run(f->row_forward, w->line);
        }
        for (int i = 0; i < f->strip_count; i++) {
            bst_batch *to = f->spectrum + (size_t)i * f->strip_pitch + (size_t)a * BLOCK;
            if (any) {
                store_strip(f, &f->strips[i], w->line, to, b < 0 ? NULL : to + BLOCK);
            } else {
                memset(to, 0, (b < 0 ? 1U : 2U) * BLOCK * sizeof *to);
            }
        }
    }
    bst_lanes_streamed();
    atomic_flag_clear(&w->taken);
}

/* ------------------------------------------------------------------ columns */

/* Adds a strip's spectrum times its transfer function to a block of the image's, with real and
 * imaginary parts swapped for the inverse. */
BST_LANES_FUNCTION
static void fold(const bst_light_fft *f, const strip *s, const bst_batch *table,
                 const bst_batch *line, bst_batch *sum) {
    const int *order = bst_batch_fft_order(f->column_forward);
    int samples = f->shape.y.samples, pixels = f->shape.y.pixels;
    int to = (pixels - s->reach % pixels) % pixels;
    for (int k = -s->reach; k <= s->reach; k++, table++) {
        const bst_batch *v = &line[order[k < 0 ? k + samples : k]];
        sum[to].im += v->re * table->re - v->im * table->im;
        sum[to].re += v->re * table->im + v->im * table->re;
        to = to + 1 < pixels ? to + 1 : 0;
    }
}

/* The window's rows of a block of columns; the rows become lanes. */
BST_LANES_FUNCTION
static void store_image(const bst_light_fft *f, int block, const bst_batch *line) {
    const int *order = bst_batch_fft_order(f->column_inverse) + f->shape.margin;
    for (int j = 0; j < f->image_blocks; j++, order += BLOCK) {
        bst_batch *to = f->image + (size_t)j * f->image_pitch + (size_t)block * BLOCK;
        bst_lanes re[BLOCK], im[BLOCK];
        for (int r = 0; r < BLOCK; r++) {
            re[r] = line[order[r]].im;
            im[r] = line[order[r]].re;
        }
        bst_lanes_transpose(re);
        bst_lanes_transpose(im);
        for (int l = 0; l < BLOCK; l++) {
            bst_lanes_stream(&to[l].re, &re[l]);
            bst_lanes_stream(&to[l].im, &im[l]);
        }
    }
}

/* Far wings of all nodes' light, in place of it. */
static void run_wrap(bst_light_fft *f) {
    float scale = (float)(1.0 / (f->kernel_x[0] * f->kernel_y[0]));
    size_t count = (size_t)f->cells_x * (size_t)f->cells_y;
    for (int s = 0; s < f->spectra; s++) {
        float *cells = f->cells + (size_t)s * count;
        for (size_t i = 0; i < count; i++) {
            cells[i] *= f->wrap[s] ? scale : 0.0f;
        }
        if (f->wrap[s]) {
            bst_light_wrap_run(f->wrap[s], cells);
        }
        for (size_t i = 0; s > 0 && i < count; i++) {
            f->cells[i] += cells[i];
        }
    }
}

/* Blocks of the image's columns; before them, with the last node, the far wings. */
static void columns(void *user, int begin, int end) {
    const pass *p = user;
    bst_light_fft *f = p->fft;
    bench *w = take_bench(f);
    size_t pixels = (size_t)f->shape.y.pixels;
    for (int i = begin; i < end; i++) {
        int c = i - (p->last && f->wraps);
        if (c < 0) {
            run_wrap(f);
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
            fold(f, s, f->table[p->node] + s->first, line, sum);
        }
        if (p->last) {
            bst_batch_fft_run(f->column_inverse, sum);
            store_image(f, c, sum);
        }
    }
    bst_lanes_streamed();
    atomic_flag_clear(&w->taken);
}

void bst_light_fft_add(bst_light_fft *f, int node, bool first, bool last, const float *grid) {
    pass p = {.fft = f, .grid = grid, .node = node, .first = first, .last = last};
    bst_parallel_for(f->pool, (f->row_blocks + 1) / 2, 1, rows_forward, &p);
    bst_parallel_for(f->pool, f->column_blocks + (last && f->wraps), 1, columns, &p);
}

/* ------------------------------------------------------------------ rows inverse */

/* Far wings of a row at the cells' centres. */
BST_LANES_FUNCTION
static void row_of_wings(const bst_light_fft *f, int row, float *out) {
    int j;
    float v = (float)bst_light_fft_cell_place(f, &f->shape.y, f->cells_y, row, &j);
    const float *a = f->cells + (size_t)j * (size_t)f->cells_x, *b = a + f->cells_x;
    for (int i = 0; i < f->cells_x; i++) {
        out[i] = a[i] + v * (b[i] - a[i]);
    }
}

/* The spectra of two blocks of rows as that of one complex sequence, real and imaginary parts
 * swapped. */
BST_LANES_FUNCTION
static void join_rows(const bst_light_fft *f, const bst_batch *a, const bst_batch *b,
                      bst_batch *line) {
    int pixels = f->shape.x.pixels, half = pixels / 2, last = f->column_blocks * BLOCK - 1;
    last = last < half ? last : half;
    for (int k = 0; k <= last; k++) {
        bst_batch *up = &line[k], *down = &line[k > 0 ? pixels - k : 0];
        *down = (bst_batch){b[k].re - a[k].im, a[k].re + b[k].im};
        *up = (bst_batch){a[k].im + b[k].re, a[k].re - b[k].im};
    }
    for (int k = last + 1; k < pixels - last; k++) {
        line[k] = (bst_batch){{0}, {0}};
    }
}

/* One block of rows of the image from a part of the joined rows, with the far wings of those rows
 * (NULL: there are none). */
BST_LANES_FUNCTION
static void store_rows(const bst_light_fft *f, const bst_batch *line, bool imaginary, int rows,
                       const float *wings, float *image) {
    const int *order = bst_batch_fft_order(f->row_inverse) + f->shape.margin;
    for (int x = 0; x < f->shape.width; x += BLOCK) {
        bst_lanes v[BLOCK];
        for (int l = 0; l < BLOCK; l++) {
            v[l] = imaginary ? line[order[x + l]].re : line[order[x + l]].im;
        }
        bst_lanes_transpose(v);
        const cell_shares *s = &f->shares[x / BLOCK];
        const float *w = wings ? wings + s->cell : NULL;
        for (int r = 0; r < rows; r++) {
            for (int k = 0; w && k < SHARES; k++) {
                v[r] += w[k] * s->share[k];
            }
            w += w ? f->cells_x + SHARES : 0;
            bst_lanes_stream((bst_lanes *)(image + (size_t)r * (size_t)f->pitch + x), &v[r]);
        }
    }
}

/* Pairs of blocks of rows of the window. */
static void rows_inverse(void *user, int begin, int end) {
    const pass *p = user;
    bst_light_fft *f = p->fft;
    bench *w = take_bench(f);
    for (int j = begin; j < end; j++) {
        int a = 2 * j, b = a + 1 < f->image_blocks ? a + 1 : a;
        join_rows(f, f->image + (size_t)a * f->image_pitch, f->image + (size_t)b * f->image_pitch,
                  w->line);
        bst_batch_fft_run(f->row_inverse, w->line);
        for (int k = a; k <= b; k++) {
            int top = k * BLOCK, rows = f->shape.height - top;
            rows = rows < BLOCK ? rows : BLOCK;
            float *image = p->image + (size_t)top * (size_t)f->pitch;
            for (int r = 0; f->wraps && r < rows; r++) {
                row_of_wings(f, top + r, w->wings + (size_t)r * (size_t)(f->cells_x + SHARES));
            }
            store_rows(f, w->line, k > a, rows, f->wraps ? w->wings : NULL, image);
        }
    }
    bst_lanes_streamed();
    atomic_flag_clear(&w->taken);
}

void bst_light_fft_finish(bst_light_fft *f, float *image) {
    pass p = {.fft = f, .image = image};
    bst_parallel_for(f->pool, (f->image_blocks + 1) / 2, 1, rows_inverse, &p);
}
