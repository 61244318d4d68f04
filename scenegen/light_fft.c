#include "scenegen/light_fft.h"

#include <fftw3.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "scenegen/light_wrap.h"

/* The rows' spectra are kept in tiles of TILE x TILE complex numbers, [column block][row block]
 * [column][row]: written by a block of rows and read by a block of columns, both in whole cache
 * lines and few pages. */
enum { TILE = 16, TILE_FLOATS = 2 * TILE * TILE, LINE = 16 /* floats of a cache line */ };

/* Pixels from `begin` on lie between the centres of `cell` and the next; the first one at `place`
 * of the way. */
typedef struct stretch {
    int begin, cell;
    float place;
} stretch;

/* Working memory of one part; as many as there are threads. */
typedef struct bench {
    atomic_flag taken;
    float *rows; /* [TILE][pitch] */
    float *sum;  /* [out_pitch] a column of the image's spectrum */
    float *line[2];
} bench;

struct bst_light_fft {
    const bst_psf *psf;
    bst_light_shape shape;
    double cutoff;
    bst_parallel *pool;
    int rows, pitch;
    int used;          /* columns of the grid's spectrum within the cut-off */
    int image_columns; /* columns of the image's spectrum */
    int row_blocks;
    float *spectrum;             /* [column blocks of `used`][row_blocks] tiles */
    int *reach;                  /* [used]: rows -reach .. reach are within the cut-off */
    size_t *first;               /* [used + 1]: complex numbers of the table before the column */
    float **table;               /* [nodes]: OTF over the kernel's transform, complex */
    double *kernel_x, *kernel_y; /* transforms by column and by row 0 .. samples / 2 */
    size_t in_pitch, out_pitch;  /* floats */
    fftwf_plan row_forward, row_inverse, column_forward, column_inverse;
    bench *benches;
    int bench_count;
    float *sum; /* [image_columns][out_pitch], where there are several nodes */
    bst_light_wrap *wrap;
    int cell, cells_x, cells_y; /* samples per cell, per axis; cells */
    float *cells;
    stretch *stretches;
    int stretch_count;
};

/* What a loop's parts need to know. */
typedef struct pass {
    bst_light_fft *fft;
    float *grid;
    int node;
    bool first, last;
} pass;

static size_t whole_lines(size_t floats) {
    return (floats + LINE - 1) / LINE * LINE;
}

/* ------------------------------------------------------------------ set-up */

static void fill_table(void *user, int begin, int end) {
    const pass *p = user;
    const bst_light_fft *f = p->fft;
    const bst_light_axis *x = &f->shape.x, *y = &f->shape.y;
    double area = 1.0 / ((double)x->pixels * y->pixels);
    for (int c = begin; c < end; c++) {
        float *t = f->table[p->node] + 2 * f->first[c];
        for (int k = -f->reach[c]; k <= f->reach[c]; k++) {
            double v[2], scale = area / (f->kernel_x[c] * f->kernel_y[abs(k)]);
            bst_psf_otf(f->psf, p->node, (double)c / x->pixels, (double)k / y->pixels, v);
            *t++ = (float)(v[0] * scale);
            *t++ = (float)(v[1] * scale);
        }
    }
}

/* Which frequencies are within the cut-off. */
static void find_band(bst_light_fft *f) {
    const bst_light_axis *x = &f->shape.x, *y = &f->shape.y;
    f->used = (int)fmin(floor(f->cutoff * x->pixels) + 1.0, 0.5 * x->samples);
    for (int c = 0; c < f->used; c++) {
        double fx = (double)c / x->pixels;
        double fy = sqrt(fmax(f->cutoff * f->cutoff - fx * fx, 0.0));
        f->reach[c] = (int)fmin(floor(fy * y->pixels), 0.5 * y->samples - 1.0);
        f->first[c + 1] = f->first[c] + 2 * (size_t)f->reach[c] + 1;
    }
}

static bst_status make_tables(bst_ctx *ctx, bst_light_fft *f) {
    const bst_light_axis *x = &f->shape.x, *y = &f->shape.y;
    size_t columns = (size_t)x->samples / 2 + 1, lines = (size_t)y->samples / 2 + 1;
    int nodes = bst_psf_nodes(f->psf);
    f->reach = malloc(columns * sizeof *f->reach);
    f->first = calloc(columns + 1, sizeof *f->first);
    f->kernel_x = malloc(columns * sizeof *f->kernel_x);
    f->kernel_y = malloc(lines * sizeof *f->kernel_y);
    f->table = calloc((size_t)nodes, sizeof *f->table);
    if (!f->reach || !f->first || !f->kernel_x || !f->kernel_y || !f->table) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the transfer function");
    }
    find_band(f);
    for (int c = 0; c < f->used; c++) {
        f->kernel_x[c] = bst_spread_transform(&x->spread, (double)c / x->samples);
    }
    for (size_t k = 0; k < lines; k++) {
        f->kernel_y[k] = bst_spread_transform(&y->spread, (double)k / y->samples);
    }
    for (int n = 0; n < nodes; n++) {
        f->table[n] = fftwf_malloc(2 * sizeof(float) * f->first[f->used]);
        if (!f->table[n]) {
            return bst_fail(ctx, BST_ERR_MEMORY,
                            "no memory for %d transfer functions of %zu numbers", nodes,
                            f->first[f->used]);
        }
        pass p = {.fft = f, .node = n};
        bst_parallel_for(f->pool, f->used, 16, fill_table, &p);
    }
    return BST_OK;
}

static bst_status make_benches(bst_ctx *ctx, bst_light_fft *f) {
    f->bench_count = bst_parallel_threads(f->pool);
    f->benches = calloc((size_t)f->bench_count, sizeof *f->benches);
    int used_blocks = (f->used + TILE - 1) / TILE;
    f->spectrum = fftwf_malloc((size_t)used_blocks * (size_t)f->row_blocks * TILE_FLOATS *
                               sizeof *f->spectrum);
    bool ok = f->benches && f->spectrum;
    size_t line = f->in_pitch > f->out_pitch ? f->in_pitch : f->out_pitch;
    for (int i = 0; ok && i < f->bench_count; i++) {
        bench *b = &f->benches[i];
        atomic_flag_clear(&b->taken);
        b->rows = fftwf_malloc((size_t)TILE * (size_t)f->pitch * sizeof *b->rows);
        b->sum = fftwf_malloc(f->out_pitch * sizeof *b->sum);
        b->line[0] = fftwf_malloc(line * sizeof *b->line[0]);
        b->line[1] = fftwf_malloc(line * sizeof *b->line[1]);
        ok = b->rows && b->sum && b->line[0] && b->line[1];
    }
    if (ok && bst_psf_nodes(f->psf) > 1) {
        f->sum = fftwf_malloc((size_t)f->image_columns * f->out_pitch * sizeof *f->sum);
        ok = f->sum != NULL;
    }
    return ok ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for the light's transform");
}

/* Estimated plans: measured ones would differ from run to run, and the images in their last bits
 * with them. */
static bst_status make_plans(bst_ctx *ctx, bst_light_fft *f) {
    const bench *b = &f->benches[0];
    float *row = b->rows, *image = b->rows + f->pitch;
    fftwf_complex *in = (fftwf_complex *)b->line[0], *out = (fftwf_complex *)b->line[1];
    f->row_forward = fftwf_plan_dft_r2c_1d(f->shape.x.samples, image, (fftwf_complex *)row,
                                           FFTW_ESTIMATE | FFTW_PRESERVE_INPUT);
    f->row_inverse =
        fftwf_plan_dft_c2r_1d(f->shape.x.pixels, (fftwf_complex *)row, image, FFTW_ESTIMATE);
    f->column_forward = fftwf_plan_dft_1d(f->shape.y.samples, in, out, FFTW_FORWARD, FFTW_ESTIMATE);
    f->column_inverse = fftwf_plan_dft_1d(f->shape.y.pixels, in, out, FFTW_BACKWARD, FFTW_ESTIMATE);
    return f->row_forward && f->row_inverse && f->column_forward && f->column_inverse
               ? BST_OK
               : bst_fail(ctx, BST_ERR_MEMORY, "no plan for transforms of %d and %d",
                          f->shape.x.samples, f->shape.y.samples);
}

/* Place on one axis of the cells' centres: the lower cell and the share of the way to the next,
 * which is below 0 or above 1 at the ends. */
static double cell_place(const bst_light_fft *f, const bst_light_axis *axis, int cells, int pixel,
                         int *lower) {
    double sample = (pixel + f->shape.margin) * (double)axis->samples / axis->pixels;
    double place = (sample + 0.5) / f->cell - 0.5;
    *lower = (int)fmin(fmax(floor(place), 0.0), cells - 2.0);
    return place - *lower;
}

/* Stretches of a row between the same two cells' centres. */
static bst_status make_stretches(bst_ctx *ctx, bst_light_fft *f) {
    f->stretches = malloc((size_t)f->cells_x * sizeof *f->stretches);
    if (!f->stretches) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the far wings");
    }
    for (int x = 0, last = -1; x < f->shape.width; x++) {
        int cell;
        double u = cell_place(f, &f->shape.x, f->cells_x, x, &cell);
        if (cell != last) {
            f->stretches[f->stretch_count++] = (stretch){x, cell, (float)u};
        }
        last = cell;
    }
    return BST_OK;
}

static bst_status make_wrap(bst_ctx *ctx, bst_light_fft *f) {
    const bst_light_axis *x = &f->shape.x, *y = &f->shape.y;
    /* cells well below the distance from which wings wrap */
    f->cell = x->samples > 14 * x->pixels / 10 ? 32 : 16;
    f->cells_x = (x->samples + f->cell - 1) / f->cell;
    f->cells_y = (y->samples + f->cell - 1) / f->cell;
    f->cells = malloc((size_t)f->cells_x * (size_t)f->cells_y * sizeof *f->cells);
    if (!f->cells) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the far wings");
    }
    BST_TRY(make_stretches(ctx, f));
    bst_light_wrap_axis wx = {x->pixels, f->cells_x, (double)f->cell * x->pixels / x->samples,
                              f->shape.width + f->shape.margin};
    bst_light_wrap_axis wy = {y->pixels, f->cells_y, (double)f->cell * y->pixels / y->samples,
                              f->shape.height + f->shape.margin};
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
    const bst_light_axis *x = &shape->x, *y = &shape->y;
    f->psf = psf;
    f->shape = *shape;
    f->cutoff = cutoff;
    f->pool = pool;
    f->rows = y->samples > shape->height ? y->samples : shape->height;
    int longest = x->samples > x->pixels ? x->samples : x->pixels;
    f->pitch = (int)whole_lines((size_t)longest + 2 + 2 * TILE);
    f->pitch += f->pitch % 1024 == 0 ? LINE : 0; /* rows a page apart would share cache sets */
    f->image_columns = x->pixels / 2 + 1;
    f->row_blocks = (f->rows + TILE - 1) / TILE;
    f->in_pitch = whole_lines(2 * (size_t)y->samples) + LINE;
    f->out_pitch = whole_lines(2 * (size_t)y->pixels) + LINE;
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
    fftwf_plan plans[] = {f->row_forward, f->row_inverse, f->column_forward, f->column_inverse};
    for (size_t i = 0; i < sizeof plans / sizeof *plans; i++) {
        fftwf_destroy_plan(plans[i]);
    }
    for (int n = 0; f->table && n < bst_psf_nodes(f->psf); n++) {
        fftwf_free(f->table[n]);
    }
    for (int i = 0; f->benches && i < f->bench_count; i++) {
        fftwf_free(f->benches[i].rows);
        fftwf_free(f->benches[i].sum);
        fftwf_free(f->benches[i].line[0]);
        fftwf_free(f->benches[i].line[1]);
    }
    bst_light_wrap_free(f->wrap);
    fftwf_free(f->sum);
    fftwf_free(f->spectrum);
    free(f->benches);
    free(f->cells);
    free(f->stretches);
    free(f->table);
    free(f->reach);
    free(f->first);
    free(f->kernel_x);
    free(f->kernel_y);
    free(f);
}

const bst_light_shape *bst_light_fft_shape(const bst_light_fft *f) {
    return &f->shape;
}

int bst_light_fft_rows(const bst_light_fft *f) {
    return f->rows;
}

int bst_light_fft_pitch(const bst_light_fft *f) {
    return f->pitch;
}

/* ------------------------------------------------------------------ rows forward */

/* Adds a row to its cells; returns whether there is light in it. */
static bool add_cells(const bst_light_fft *f, const float *row, float *cells) {
    float any = 0.0f;
    for (int i = 0; i < f->cells_x; i++) {
        int begin = i * f->cell, rest = f->shape.x.samples - begin;
        float part[8] = {0};
        for (int k = 0; k + 8 <= (rest < f->cell ? rest : f->cell); k += 8) {
            for (int n = 0; n < 8; n++) {
                part[n] += row[begin + k + n];
            }
        }
        float sum = ((part[0] + part[1]) + (part[2] + part[3])) +
                    ((part[4] + part[5]) + (part[6] + part[7]));
        cells[i] += sum;
        any += sum;
    }
    return any > 0.0f;
}

static bench *take_bench(bst_light_fft *f) {
    for (int i = 0;; i = (i + 1) % f->bench_count) {
        if (!atomic_flag_test_and_set(&f->benches[i].taken)) {
            return &f->benches[i];
        }
    }
}

/* The tile of a block of columns and a block of rows. */
static float *tile_of(const bst_light_fft *f, int column, int row_block) {
    return f->spectrum +
           ((size_t)(column / TILE) * (size_t)f->row_blocks + (size_t)row_block) * TILE_FLOATS;
}

/* Copies between rows and tiles, complex numbers of a tile's side each way; two by two, so that
 * whole vectors are written. */
static void transpose(const float *from, size_t from_pitch, float *to, size_t to_pitch) {
    for (int r = 0; r < TILE; r += 2) {
        for (int c = 0; c < TILE; c += 2) {
            const float *a = from + (size_t)r * from_pitch + 2 * c, *b = a + from_pitch;
            float *x = to + (size_t)c * to_pitch + 2 * r;
            float first[4] = {a[0], a[1], b[0], b[1]}, second[4] = {a[2], a[3], b[2], b[3]};
            memcpy(x, first, sizeof first);
            memcpy(x + to_pitch, second, sizeof second);
        }
    }
}

/* Transforms a block of TILE rows of the grid. */
static void row_block_forward(bst_light_fft *f, float *grid, int block, bench *b, float *cells) {
    size_t pitch = (size_t)f->pitch;
    bool any = false;
    for (int r = 0; r < TILE; r++) {
        float *from = grid + (size_t)(block * TILE + r) * pitch;
        float *row = b->rows + (size_t)r * pitch;
        if (add_cells(f, from, cells)) {
            fftwf_execute_dft_r2c(f->row_forward, from, (fftwf_complex *)row);
            any = true;
        } else {
            memset(row, 0, pitch * sizeof *row);
        }
    }
    for (int c = 0; c < f->used; c += TILE) {
        if (any) {
            transpose(b->rows + 2 * c, pitch, tile_of(f, c, block), 2 * TILE);
        } else {
            memset(tile_of(f, c, block), 0, TILE_FLOATS * sizeof(float));
        }
    }
}

/* Rows of cells, which are one block of rows or two. */
static void rows_forward(void *user, int begin, int end) {
    const pass *p = user;
    bst_light_fft *f = p->fft;
    bench *b = take_bench(f);
    for (int j = begin; j < end; j++) {
        float *cells = f->cells + (size_t)j * (size_t)f->cells_x;
        if (p->first) {
            memset(cells, 0, (size_t)f->cells_x * sizeof *cells);
        }
        for (int k = j * f->cell; k < (j + 1) * f->cell && k < f->shape.y.samples; k += TILE) {
            row_block_forward(f, p->grid, k / TILE, b, cells);
        }
    }
    atomic_flag_clear(&b->taken);
}

/* ------------------------------------------------------------------ columns */

/* out += line * table over n complex numbers. */
static void multiply_add(float *restrict out, const float *restrict line,
                         const float *restrict table, int n) {
    for (int i = 0; i < 2 * n; i += 2) {
        float a = line[i], b = line[i + 1], c = table[i], d = table[i + 1];
        out[i] += a * c - b * d;
        out[i + 1] += a * d + b * c;
    }
}

/* The same conjugate and in falling order: out[-i] += conj(line[i] table[i]). */
static void multiply_add_mirrored(float *restrict out, const float *restrict line,
                                  const float *restrict table, int n) {
    for (int i = 0; i < n; i++) {
        float a = line[2 * i], b = line[2 * i + 1], c = table[2 * i], d = table[2 * i + 1];
        out[-2 * i] += a * c - b * d;
        out[-2 * i + 1] -= a * d + b * c;
    }
}

/* Adds one transformed column of the grid, times its transfer function, to a column of the image's
 * spectrum. */
static void fold(const bst_light_fft *f, int node, int column, bool mirrored, const float *line,
                 float *out) {
    int samples = f->shape.y.samples, pixels = f->shape.y.pixels, reach = f->reach[column];
    const float *table = f->table[node] + 2 * f->first[column];
    for (int k = -reach; k <= reach;) {
        /* a stretch in which neither index wraps */
        int run = reach + 1 - k, from = k < 0 ? k + samples : k;
        run = k < 0 && run > -k ? -k : run;
        if (mirrored) {
            int to = ((-k) % pixels + pixels) % pixels;
            run = run > to + 1 ? to + 1 : run;
            multiply_add_mirrored(out + 2 * to, line + 2 * from, table, run);
        } else {
            int to = (k % pixels + pixels) % pixels;
            run = run > pixels - to ? pixels - to : run;
            multiply_add(out + 2 * to, line + 2 * from, table, run);
        }
        k += run;
        table += 2 * run;
    }
}

/* Copies a column of the rows' spectra into a line. */
static void gather(const bst_light_fft *f, int column, float *line) {
    const float *from = tile_of(f, column, 0) + (size_t)(column % TILE) * 2 * TILE;
    for (int r = 0; r < f->shape.y.samples; r += TILE) {
        memcpy(line + 2 * r, from, 2 * TILE * sizeof *line);
        from += TILE_FLOATS;
    }
}

/* Puts the window's rows of an inverse column in its place, from row block 0 on. */
static void scatter(const bst_light_fft *f, int column, const float *line) {
    float *to = tile_of(f, column, 0) + (size_t)(column % TILE) * 2 * TILE;
    const float *from = line + 2 * f->shape.margin;
    for (int r = 0; r < f->shape.height; r += TILE) {
        memcpy(to, from + 2 * r, 2 * TILE * sizeof *to);
        to += TILE_FLOATS;
    }
}

/* Adds the grid's columns that fold onto the image's column `column`. */
static void add_aliases(const pass *p, bench *b, int column, float *sum) {
    const bst_light_fft *f = p->fft;
    for (int j = 0; j * f->shape.x.pixels - column < f->used; j++) {
        for (int mirrored = 0; mirrored <= (j > 0); mirrored++) {
            int c = j * f->shape.x.pixels + (mirrored ? -column : column);
            if (c < f->used) {
                gather(f, c, b->line[0]);
                fftwf_execute_dft(f->column_forward, (fftwf_complex *)b->line[0],
                                  (fftwf_complex *)b->line[1]);
                fold(f, p->node, c, mirrored, b->line[1], sum);
            }
        }
    }
}

/* Columns of the image's spectrum. The inverse of a column is put where the column itself was: the
 * others that fold onto it lie beyond the image's columns, so nobody else reads it. */
static void columns(void *user, int begin, int end) {
    const pass *p = user;
    bst_light_fft *f = p->fft;
    bench *b = take_bench(f);
    for (int c = begin; c < end; c++) {
        float *sum = f->sum ? f->sum + (size_t)c * f->out_pitch : b->sum;
        if (p->first) {
            memset(sum, 0, f->out_pitch * sizeof *sum);
        }
        add_aliases(p, b, c, sum);
        if (p->last) {
            fftwf_execute_dft(f->column_inverse, (fftwf_complex *)sum, (fftwf_complex *)b->line[1]);
            scatter(f, c, b->line[1]);
        }
    }
    atomic_flag_clear(&b->taken);
}

/* Columns of the image's spectrum that the grid's band reaches; the others are zero. */
static int reached(const bst_light_fft *f) {
    return f->used < f->image_columns ? f->used : f->image_columns;
}

void bst_light_fft_add(bst_light_fft *f, int node, bool first, bool last, float *grid) {
    pass p = {f, grid, node, first, last};
    bst_parallel_for(f->pool, f->cells_y, 1, rows_forward, &p);
    bst_parallel_for(f->pool, reached(f), TILE, columns, &p);
}

/* ------------------------------------------------------------------ rows inverse */

/* Adds the far wings of a row, linearly between the cells' centres. */
static void add_wings(const bst_light_fft *f, int row, float *image) {
    int j;
    float v = (float)cell_place(f, &f->shape.y, f->cells_y, row, &j);
    const float *a = f->cells + (size_t)j * (size_t)f->cells_x, *b = a + f->cells_x;
    float step = (float)((double)f->shape.x.samples / f->shape.x.pixels / f->cell);
    for (int n = 0; n < f->stretch_count; n++) {
        const stretch *s = &f->stretches[n];
        int i = s->cell, end = n + 1 < f->stretch_count ? s[1].begin : f->shape.width;
        float left = a[i] + v * (b[i] - a[i]), right = a[i + 1] + v * (b[i + 1] - a[i + 1]);
        float base = left + s->place * (right - left), slope = step * (right - left);
        for (int k = 0; k < end - s->begin; k++) {
            image[s->begin + k] += base + slope * (float)k;
        }
    }
}

/* Blocks of TILE rows of the window. */
static void rows_inverse(void *user, int begin, int end) {
    const pass *p = user;
    bst_light_fft *f = p->fft;
    bench *b = take_bench(f);
    size_t pitch = (size_t)f->pitch;
    int columns_used = reached(f), zero = f->image_columns - columns_used;
    for (int block = begin; block < end; block++) {
        for (int c = 0; c < columns_used; c += TILE) {
            transpose(tile_of(f, c, block), 2 * TILE, b->rows + 2 * c, pitch);
        }
        for (int y = block * TILE; y < (block + 1) * TILE && y < f->shape.height; y++) {
            float *row = b->rows + (size_t)(y % TILE) * pitch;
            float *image = p->grid + (size_t)y * pitch;
            memset(row + 2 * columns_used, 0, 2 * (size_t)zero * sizeof *row);
            fftwf_execute_dft_c2r(f->row_inverse, (fftwf_complex *)row, image);
            if (f->wrap) {
                add_wings(f, y, image + f->shape.margin);
            }
        }
    }
    atomic_flag_clear(&b->taken);
}

void bst_light_fft_finish(bst_light_fft *f, float *grid) {
    if (f->wrap) {
        float scale = (float)(1.0 / (f->kernel_x[0] * f->kernel_y[0]));
        size_t count = (size_t)f->cells_x * (size_t)f->cells_y;
        for (size_t i = 0; i < count; i++) {
            f->cells[i] *= scale;
        }
        bst_light_wrap_run(f->wrap, f->cells);
    }
    pass p = {.fft = f, .grid = grid};
    bst_parallel_for(f->pool, (f->shape.height + TILE - 1) / TILE, 1, rows_inverse, &p);
}
