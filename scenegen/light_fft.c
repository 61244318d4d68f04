#include "scenegen/light_fft.h"

#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "scenegen/batch_fft.h"
#include "scenegen/light_cells.h"
#include "scenegen/light_wrap.h"

/* Rows and columns are worked on in blocks of as many as a vector has lanes. */
enum { BLOCK = BST_LANES };

/* A block of columns of the grid's spectrum, in frequencies k0 to k0 + 15 per period, which may be
 * negative. It folds onto the block of the image's columns that is a whole number of image bands
 * away. */
typedef struct strip {
    int k0;
    int block;    /* of the image's columns */
    int reach;    /* rows -reach .. reach are within the cut-off */
    size_t first; /* of the strip's numbers in the table */
} strip;

/* Working memory of one part; as many as there are threads. */
typedef struct bench {
    atomic_flag taken;
    bst_batch *line; /* a block of rows or columns */
    float *wings;    /* [BLOCK][bst_light_cells_row_floats] far wings of rows */
} bench;

struct bst_light_fft {
    const bst_psf *psf;
    bst_light_shape shape;
    double cutoff;
    bst_parallel *pool;
    int pitch, row_blocks, image_blocks; /* blocks of the grid's rows, of the window's rows */
    int used;                            /* columns 1 - used to used - 1 are within the cut-off */
    strip *strips;                       /* those of one block of the image follow each other */
    int strip_count, column_blocks;      /* blocks of the image's columns that the strips reach */
    int *first_strip;                    /* [column_blocks + 1] */
    size_t strip_pitch, image_pitch;     /* elements */
    bst_batch *spectrum;                 /* [strips][strip_pitch]: row by row */
    bst_batch *image;            /* [image_blocks][image_pitch]: column by column, lanes are rows */
    bst_batch **table;           /* [nodes]: OTF over the kernel's transform */
    bst_batch *sum;              /* [column_blocks][y.pixels], where there are several nodes */
    double *kernel_x, *kernel_y; /* transforms by column and by row 0 .. samples / 2 */
    bst_batch_fft *row_forward, *row_inverse, *column_forward, *column_inverse;
    bench *benches;
    int bench_count;
    bst_light_wrap *wrap;
    bst_light_cells cells;
};

/* What a loop's parts need to know. */
typedef struct pass {
    bst_light_fft *fft;
    const float *grid;
    float *image;
    int node;
    bool first, last;
} pass;

static bst_batch *allocate(size_t elements) {
    return aligned_alloc(sizeof(bst_lanes), elements * sizeof(bst_batch));
}

/* ------------------------------------------------------------------ set-up */

/* The transfer functions of some strips. Both kinds of rows come as the sum or the difference of
 * two numbers, hence the half. */
static void fill_table(void *user, int begin, int end) {
    const pass *p = user;
    const bst_light_fft *f = p->fft;
    const bst_light_axis *x = &f->shape.x, *y = &f->shape.y;
    double area = 0.5 / ((double)x->pixels * y->pixels);
    for (int i = begin; i < end; i++) {
        const strip *s = &f->strips[i];
        bst_batch *t = f->table[p->node] + s->first;
        for (int k = -s->reach; k <= s->reach; k++, t++) {
            *t = (bst_batch){{0}, {0}};
            for (int l = 0; l < BLOCK; l++) {
                int c = s->k0 + l;
                double v[2], fx = (double)c / x->pixels, fy = (double)k / y->pixels;
                if (abs(c) >= f->used || fx * fx + fy * fy > f->cutoff * f->cutoff) {
                    continue;
                }
                double scale = area / (f->kernel_x[abs(c)] * f->kernel_y[abs(k)]);
                bst_psf_otf(f->psf, p->node, fx, fy, v);
                t->re[l] = (float)(v[0] * scale);
                t->im[l] = (float)(v[1] * scale);
            }
        }
    }
}

/* Which frequencies are within the cut-off. */
static bst_status find_strips(bst_ctx *ctx, bst_light_fft *f) {
    const bst_light_axis *x = &f->shape.x, *y = &f->shape.y;
    f->used = (int)fmin(floor(f->cutoff * x->pixels) + 1.0, 0.5 * x->samples);
    int blocks = (x->pixels / 2 + BLOCK) / BLOCK, folds = f->used / x->pixels + 1;
    size_t most = (size_t)blocks * (2 * (size_t)folds + 1);
    f->strips = malloc(most * sizeof *f->strips);
    f->first_strip = malloc(((size_t)blocks + 1) * sizeof *f->first_strip);
    if (!f->strips || !f->first_strip) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the light's transform");
    }
    size_t numbers = 0;
    for (int b = 0; b < blocks; b++) {
        f->first_strip[b] = f->strip_count;
        for (int fold = -folds; fold <= folds; fold++) {
            int k0 = b * BLOCK + fold * x->pixels;
            int nearest = k0 > 0 ? k0 : k0 + BLOCK > 0 ? 0 : 1 - BLOCK - k0;
            if (nearest >= f->used) {
                continue;
            }
            double fx = (double)nearest / x->pixels;
            double fy = sqrt(fmax(f->cutoff * f->cutoff - fx * fx, 0.0));
            int reach = (int)fmin(floor(fy * y->pixels), 0.5 * y->samples - 1.0);
            f->strips[f->strip_count++] = (strip){k0, b, reach, numbers};
            numbers += 2 * (size_t)reach + 1;
            f->column_blocks = b + 1;
        }
    }
    f->first_strip[f->column_blocks] = f->strip_count;
    int nodes = bst_psf_nodes(f->psf);
    f->table = calloc((size_t)nodes, sizeof *f->table);
    for (int n = 0; n < nodes; n++) {
        if (!f->table || !(f->table[n] = allocate(numbers))) {
            return bst_fail(ctx, BST_ERR_MEMORY,
                            "no memory for %d transfer functions of %zu numbers", nodes,
                            numbers * BLOCK);
        }
    }
    return BST_OK;
}

static bst_status make_tables(bst_ctx *ctx, bst_light_fft *f) {
    const bst_light_axis *x = &f->shape.x, *y = &f->shape.y;
    size_t lines = (size_t)y->samples / 2 + 1;
    BST_TRY(find_strips(ctx, f));
    f->kernel_x = malloc((size_t)f->used * sizeof *f->kernel_x);
    f->kernel_y = malloc(lines * sizeof *f->kernel_y);
    if (!f->kernel_x || !f->kernel_y) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the transfer function");
    }
    for (int c = 0; c < f->used; c++) {
        f->kernel_x[c] = bst_spread_transform(&x->spread, (double)c / x->samples);
    }
    for (size_t k = 0; k < lines; k++) {
        f->kernel_y[k] = bst_spread_transform(&y->spread, (double)k / y->samples);
    }
    for (int n = 0; n < bst_psf_nodes(f->psf); n++) {
        pass p = {.fft = f, .node = n};
        bst_parallel_for(f->pool, f->strip_count, 1, fill_table, &p);
    }
    return BST_OK;
}

static int longest_line(const bst_light_shape *s) {
    int x = s->x.samples > s->x.pixels ? s->x.samples : s->x.pixels;
    return x > s->y.pixels ? x : s->y.pixels;
}

static bst_status make_benches(bst_ctx *ctx, bst_light_fft *f) {
    size_t rows = (size_t)f->row_blocks * BLOCK;
    /* odd multiples of a block: strips a page's multiple apart would share cache sets */
    f->strip_pitch = rows + (f->row_blocks % 2 == 0 ? BLOCK : 0);
    f->image_pitch = ((size_t)f->column_blocks | 1) * BLOCK;
    f->bench_count = bst_parallel_threads(f->pool);
    f->benches = calloc((size_t)f->bench_count, sizeof *f->benches);
    f->spectrum = allocate((size_t)f->strip_count * f->strip_pitch);
    f->image = allocate((size_t)f->image_blocks * f->image_pitch);
    bool ok = f->benches && f->spectrum && f->image;
    for (int i = 0; ok && i < f->bench_count; i++) {
        atomic_flag_clear(&f->benches[i].taken);
        f->benches[i].line = allocate((size_t)longest_line(&f->shape));
        ok = f->benches[i].line != NULL;
    }
    if (ok && bst_psf_nodes(f->psf) > 1) {
        f->sum = allocate((size_t)f->column_blocks * (size_t)f->shape.y.pixels);
        ok = f->sum != NULL;
    }
    return ok ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for the light's transform");
}

static bst_status make_plans(bst_ctx *ctx, bst_light_fft *f) {
    BST_TRY(bst_batch_fft_create(ctx, f->shape.x.samples, &f->row_forward));
    BST_TRY(bst_batch_fft_create(ctx, f->shape.x.pixels, &f->row_inverse));
    BST_TRY(bst_batch_fft_create(ctx, f->shape.y.samples, &f->column_forward));
    return bst_batch_fft_create(ctx, f->shape.y.pixels, &f->column_inverse);
}

static bst_status make_wrap(bst_ctx *ctx, bst_light_fft *f) {
    const bst_light_shape *s = &f->shape;
    bst_light_cells *c = &f->cells;
    BST_TRY(bst_light_cells_create(ctx, &s->x, &s->y, s->width, s->margin, c));
    for (int i = 0; i < f->bench_count; i++) {
        f->benches[i].wings = calloc((size_t)BLOCK * (size_t)bst_light_cells_row_floats(c),
                                     sizeof *f->benches[i].wings);
        if (!f->benches[i].wings) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the far wings");
        }
    }
    bst_light_wrap_axis wx = {s->x.pixels, c->columns, (double)c->side * s->x.pixels / s->x.samples,
                              s->width + s->margin};
    bst_light_wrap_axis wy = {s->y.pixels, c->rows, (double)c->side * s->y.pixels / s->y.samples,
                              s->height + s->margin};
    return bst_light_wrap_create(ctx, f->psf, &wx, &wy, f->pool, &f->wrap);
}

bst_status bst_light_fft_create(bst_ctx *ctx, const bst_psf *psf, double cutoff,
                                const bst_light_shape *shape, bst_parallel *pool,
                                bst_light_fft **out) {
    *out = NULL;
    bst_light_fft *f = calloc(1, sizeof *f);
    if (!f) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the light's transform");
    }
    f->psf = psf;
    f->shape = *shape;
    f->cutoff = cutoff;
    f->pool = pool;
    /* an odd number of lines: rows a page apart would share cache sets */
    f->pitch = ((shape->width + BLOCK - 1) / BLOCK | 1) * BLOCK;
    f->row_blocks = shape->y.samples / BLOCK;
    f->image_blocks = (shape->height + BLOCK - 1) / BLOCK;
    bst_status status = make_tables(ctx, f);
    if (status == BST_OK) {
        status = make_benches(ctx, f);
    }
    if (status == BST_OK) {
        status = make_plans(ctx, f);
    }
    if (status == BST_OK) {
        status = make_wrap(ctx, f);
    }
    if (status != BST_OK) {
        bst_light_fft_free(f);
        return status;
    }
    *out = f;
    return BST_OK;
}

void bst_light_fft_free(bst_light_fft *f) {
    if (!f) {
        return;
    }
    bst_batch_fft_free(f->row_forward);
    bst_batch_fft_free(f->row_inverse);
    bst_batch_fft_free(f->column_forward);
    bst_batch_fft_free(f->column_inverse);
    for (int n = 0; f->table && n < bst_psf_nodes(f->psf); n++) {
        free(f->table[n]);
    }
    for (int i = 0; f->benches && i < f->bench_count; i++) {
        free(f->benches[i].line);
        free(f->benches[i].wings);
    }
    bst_light_wrap_free(f->wrap);
    free(f->sum);
    free(f->image);
    free(f->spectrum);
    free(f->strips);
    free(f->first_strip);
    free(f->benches);
    bst_light_cells_clear(&f->cells);
    free(f->table);
    free(f->kernel_x);
    free(f->kernel_y);
    free(f);
}

const bst_light_shape *bst_light_fft_shape(const bst_light_fft *f) {
    return &f->shape;
}

size_t bst_light_fft_floats(const bst_light_fft *f) {
    size_t grid = (size_t)f->shape.x.samples * (size_t)f->shape.y.samples;
    size_t image = (size_t)f->pitch * (size_t)f->shape.height;
    return grid > image ? grid : image;
}

int bst_light_fft_pitch(const bst_light_fft *f) {
    return f->pitch;
}

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
    float any = 0.0f;
    for (int i = 0, x = 0; i < f->cells.columns; i++) {
        int rest = f->shape.x.samples - x, end = x + (f->cells.side < rest ? f->cells.side : rest);
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
        any += total_a + total_b;
        if (b) {
            cells_b[i] += total_b;
        }
    }
    return any > 0.0f;
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
    int per_cell = f->cells.side / BLOCK, cells = f->cells.columns;
    for (int j = begin; j < end; j++) {
        int a = 2 * j, b = a + 1 < f->row_blocks ? a + 1 : -1;
        float *cells_a = f->cells.light + (size_t)(a / per_cell) * (size_t)cells;
        float *cells_b = f->cells.light + (size_t)((b < 0 ? a : b) / per_cell) * (size_t)cells;
        size_t block = (size_t)f->shape.x.samples, bytes = (size_t)cells * sizeof *cells_a;
        const bst_lanes *grid = (const bst_lanes *)p->grid;
        if (p->first) {
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
    size_t count = (size_t)f->cells.columns * (size_t)f->cells.rows;
    for (size_t i = 0; i < count; i++) {
        f->cells.light[i] *= scale;
    }
    bst_light_wrap_run(f->wrap, f->cells.light);
}

/* Blocks of the image's columns; before them, with the last node, the far wings. */
static void columns(void *user, int begin, int end) {
    const pass *p = user;
    bst_light_fft *f = p->fft;
    bench *w = take_bench(f);
    size_t pixels = (size_t)f->shape.y.pixels;
    for (int i = begin; i < end; i++) {
        int c = i - (p->last && f->wrap);
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
    bst_parallel_for(f->pool, f->column_blocks + (last && f->wrap), 1, columns, &p);
}

/* ------------------------------------------------------------------ rows inverse */

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
        const bst_cell_shares *s = &f->cells.shares[x / BLOCK];
        const float *w = wings ? wings + s->cell : NULL;
        for (int r = 0; r < rows; r++) {
            for (int k = 0; w && k < BST_CELL_SHARES; k++) {
                v[r] += w[k] * s->share[k];
            }
            w += w ? bst_light_cells_row_floats(&f->cells) : 0;
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
            for (int r = 0; f->wrap && r < rows; r++) {
                bst_light_cells_row(
                    &f->cells, top + r,
                    w->wings + (size_t)r * (size_t)bst_light_cells_row_floats(&f->cells));
            }
            store_rows(f, w->line, k > a, rows, f->wrap ? w->wings : NULL, image);
        }
    }
    bst_lanes_streamed();
    atomic_flag_clear(&w->taken);
}

void bst_light_fft_finish(bst_light_fft *f, float *image) {
    pass p = {.fft = f, .image = image};
    bst_parallel_for(f->pool, (f->image_blocks + 1) / 2, 1, rows_inverse, &p);
}
