#include "scenegen/fourier/otf_convolve_internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/pages.h"

static bst_batch *allocate(size_t elements) {
    return bst_pages_alloc(elements * sizeof(bst_batch));
}

/* ------------------------------------------------------------------ Set-up */

/* Tabulates the transfer function of some strips. Both rows of a pair arrive as sum or difference
 * of two numbers, hence the factor 1/2. */
static void fill_table(void *user, int begin, int end) {
    const pass *p = user;
    const bst_otf_convolve *f = p->fft;
    const bst_fourier_axis *x = &f->shape.x, *y = &f->shape.y;
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

/* Finds the frequency strips within the cut-off. */
static bst_status find_strips(bst_ctx *ctx, bst_otf_convolve *f) {
    const bst_fourier_axis *x = &f->shape.x, *y = &f->shape.y;
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

static bst_status make_tables(bst_ctx *ctx, bst_otf_convolve *f) {
    const bst_fourier_axis *x = &f->shape.x, *y = &f->shape.y;
    size_t lines = (size_t)y->samples / 2 + 1;
    BST_TRY(find_strips(ctx, f));
    f->kernel_x = malloc((size_t)f->used * sizeof *f->kernel_x);
    f->kernel_y = malloc(lines * sizeof *f->kernel_y);
    if (!f->kernel_x || !f->kernel_y) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the transfer function");
    }
    for (int c = 0; c < f->used; c++) {
        f->kernel_x[c] = bst_nufft_kernel_transform(&x->spread, (double)c / x->samples);
    }
    for (size_t k = 0; k < lines; k++) {
        f->kernel_y[k] = bst_nufft_kernel_transform(&y->spread, (double)k / y->samples);
    }
    for (int n = 0; n < bst_psf_nodes(f->psf); n++) {
        pass p = {.fft = f, .node = n};
        bst_parallel_for(f->pool, f->strip_count, 1, fill_table, &p);
    }
    return BST_OK;
}

static int longest_line(const bst_otf_convolve_layout *s) {
    int x = s->x.samples > s->x.pixels ? s->x.samples : s->x.pixels;
    return x > s->y.pixels ? x : s->y.pixels;
}

static bst_status make_benches(bst_ctx *ctx, bst_otf_convolve *f) {
    size_t rows = (size_t)f->row_blocks * BLOCK;
    /* odd multiples of a block: strides of whole pages would share cache sets */
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

static bst_status make_plans(bst_ctx *ctx, bst_otf_convolve *f) {
    BST_TRY(bst_batch_fft_create(ctx, f->shape.x.samples, &f->row_forward));
    BST_TRY(bst_batch_fft_create(ctx, f->shape.x.pixels, &f->row_inverse));
    BST_TRY(bst_batch_fft_create(ctx, f->shape.y.samples, &f->column_forward));
    return bst_batch_fft_create(ctx, f->shape.y.pixels, &f->column_inverse);
}

double bst_otf_convolve_cell_place(const bst_otf_convolve *f, const bst_fourier_axis *axis,
                                   int cells, int pixel, int *lower) {
    double sample = (pixel + f->shape.margin) * (double)axis->samples / axis->pixels;
    double place = (sample + 0.5) / f->cell - 0.5;
    *lower = (int)fmin(fmax(floor(place), 0.0), cells - 2.0);
    return place - *lower;
}

/* Interpolation weights of the far wings for the inverse row FFT. */
static bst_status make_shares(bst_ctx *ctx, bst_otf_convolve *f) {
    int blocks = (f->shape.width + BLOCK - 1) / BLOCK;
    size_t wings = (size_t)BLOCK * (size_t)(f->cells_x + SHARES);
    f->shares = malloc((size_t)blocks * sizeof *f->shares);
    bool ok = f->shares;
    for (int i = 0; ok && i < f->bench_count; i++) {
        f->benches[i].wings = calloc(wings, sizeof(float));
        ok = f->benches[i].wings;
    }
    if (!ok) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the far wings");
    }
    for (int i = 0; i < blocks; i++) {
        cell_shares *s = &f->shares[i];
        memset(s, 0, sizeof *s);
        for (int l = 0; l < BLOCK; l++) {
            int cell;
            float u = (float)bst_otf_convolve_cell_place(f, &f->shape.x, f->cells_x, i * BLOCK + l,
                                                         &cell);
            s->cell = l == 0 ? cell : s->cell;
            s->share[cell - s->cell][l] = 1.0f - u;
            s->share[cell - s->cell + 1][l] = u;
        }
    }
    return BST_OK;
}

static bst_status make_wrap(bst_ctx *ctx, bst_otf_convolve *f) {
    const bst_fourier_axis *x = &f->shape.x, *y = &f->shape.y;
    /* cells much smaller than the wrap-around distance */
    f->cell = x->samples > 14 * x->pixels / 10 ? 32 : 16;
    f->cells_x = (x->samples + f->cell - 1) / f->cell;
    f->cells_y = (y->samples + f->cell - 1) / f->cell;
    f->spectra = bst_psf_spectra(f->psf);
    size_t cells = (size_t)f->cells_x * (size_t)f->cells_y;
    f->cells = malloc((size_t)f->spectra * cells * sizeof *f->cells);
    if (!f->cells) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the far wings");
    }
    BST_TRY(make_shares(ctx, f));
    bst_alias_correction_axis wx = {x->pixels, f->cells_x, (double)f->cell * x->pixels / x->samples,
                                    f->shape.width + f->shape.margin};
    bst_alias_correction_axis wy = {y->pixels, f->cells_y, (double)f->cell * y->pixels / y->samples,
                                    f->shape.height + f->shape.margin};
    for (int s = 0; s < f->spectra; s++) {
        BST_TRY(bst_alias_correction_create(ctx, f->psf, s, &wx, &wy, f->pool, &f->wrap[s]));
        f->wraps = f->wraps || f->wrap[s];
    }
    return BST_OK;
}

bst_status bst_otf_convolve_create(bst_ctx *ctx, const bst_psf *psf, double cutoff,
                                   const bst_otf_convolve_layout *shape, bst_parallel *pool,
                                   bst_otf_convolve **out) {
    *out = NULL;
    bst_otf_convolve *f = calloc(1, sizeof *f);
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
        bst_otf_convolve_free(f);
        return status;
    }
    *out = f;
    return BST_OK;
}

void bst_otf_convolve_free(bst_otf_convolve *f) {
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
    for (int s = 0; s < f->spectra; s++) {
        bst_alias_correction_free(f->wrap[s]);
    }
    free(f->sum);
    free(f->image);
    free(f->spectrum);
    free(f->strips);
    free(f->first_strip);
    free(f->benches);
    free(f->cells);
    free(f->shares);
    free(f->table);
    free(f->kernel_x);
    free(f->kernel_y);
    free(f);
}

const bst_otf_convolve_layout *bst_otf_convolve_shape(const bst_otf_convolve *f) {
    return &f->shape;
}

size_t bst_otf_convolve_floats(const bst_otf_convolve *f) {
    size_t grid = (size_t)f->shape.x.samples * (size_t)f->shape.y.samples;
    size_t image = (size_t)f->pitch * (size_t)f->shape.height;
    return grid > image ? grid : image;
}

int bst_otf_convolve_pitch(const bst_otf_convolve *f) {
    return f->pitch;
}
