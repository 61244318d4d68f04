#include "imgproc/detect/candidates.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    CELL_PX = 16,
    MOST_LANES = 16,      /* of a vector */
    SOON = 8,             /* rows read ahead */
    GATHER_ROWS = 16,     /* rows of cells per part of a loop */
    GRAIN = 256,          /* least maxima per part of a loop */
    PARTS_PER_THREAD = 4, /* of a crowded frame */
};

/* A maximum is one of its own if the output falls by this many sigma and this share of it towards
 * a higher one. Design choices: 3 sigma against noise, 15 % for bright sources, where
 * errors of PSF and path exceed the noise. */
static const float SADDLE_SIGMA = 3.0f, SADDLE_SHARE = 0.15f;

static void lay_out(bst_candidates *c, size_t cells) {
    size_t n = (size_t)c->capacity;
    BST_ARENA_TAKE(&c->arena, c->items, n);
    BST_ARENA_TAKE(&c->arena, c->order, n);
    BST_ARENA_TAKE(&c->arena, c->maxima, n);
    BST_ARENA_TAKE(&c->arena, c->cell_x, n + MOST_LANES); /* whole vectors are read */
    BST_ARENA_TAKE(&c->arena, c->cell_y, n + MOST_LANES);
    BST_ARENA_TAKE(&c->arena, c->cell_snr, n + MOST_LANES);
    BST_ARENA_TAKE(&c->arena, c->cell, cells);
    BST_ARENA_TAKE(&c->arena, c->stands, n);
    BST_ARENA_TAKE(&c->arena, c->order_swap, n);
    BST_ARENA_TAKE(&c->arena, c->key, n);
    BST_ARENA_TAKE(&c->arena, c->key_swap, n);
}

bst_status bst_candidates_create(bst_ctx *ctx, int max_width, int max_height, bst_candidates *out) {
    assert(out && max_width > 0 && max_height > 0);
    /* local maxima of an 8-neighbourhood cannot be denser than one in four pixels */
    *out = (bst_candidates){.capacity = ((max_width + 1) / 2) * ((max_height + 1) / 2)};
    size_t cells = (size_t)(max_width / CELL_PX + 1) * (size_t)(max_height / CELL_PX + 1) + 1;
    char what[64];
    snprintf(what, sizeof what, "the candidates of a %d x %d frame", max_width, max_height);
    lay_out(out, cells);
    BST_TRY(bst_arena_alloc(ctx, &out->arena, what));
    lay_out(out, cells);
    return BST_OK;
}

void bst_candidates_free(bst_candidates *c) {
    bst_arena_free(&c->arena);
    *c = (bst_candidates){0};
}

typedef struct search {
    bst_candidates *c;
    const bst_filter *f;
    const float *map; /* SNR map at pixel (0, 0); NULL: computed on demand */
    int reach, rows;  /* reach: px; rows: of cells */
    float floor, certain;
    bst_candidate_fn accept;
    const void *user;
} search;

/* True if the SNR stays above `least` on the pixels nearest to the line between maximum `a` and one
 * (dx, dy) pixels away. */
static bool is_ridge(const search *s, const bst_candidate *a, int dx, int dy, float least) {
    int steps = abs(dx) > abs(dy) ? abs(dx) : abs(dy);
    float slope_x = (float)dx / (float)steps, slope_y = (float)dy / (float)steps;
    const float *map = s->map ? s->map + (long)a->y * s->f->stride + a->x : NULL;
    for (int i = 1; i < steps; i++) {
        /* rounds; the added constant keeps the value positive */
        int x = (int)((float)i * slope_x + 4096.5f) - 4096;
        int y = (int)((float)i * slope_y + 4096.5f) - 4096;
        float snr =
            map ? map[(long)y * s->f->stride + x] : bst_filter_best_at(s->f, a->x + x, a->y + y);
        if (!(snr > least)) {
            return false;
        }
    }
    return true;
}

#define BST_SIMD_KERNELS "imgproc/detect/candidates_kernels.inc"
#include "sim/core/simd_each.inc"

/* True if no ridge connects a maximum to a higher one within reach: it is a source of its own. */
static bool is_separate_source(const search *s, const bst_candidate *m) {
    enum { A_TIME = 32 };
    const bst_candidates *c = s->c;
    float least = fmaxf(m->snr - fmaxf(SADDLE_SIGMA, SADDLE_SHARE * m->snr), s->floor);
    int left = m->x > s->reach ? (m->x - s->reach) / CELL_PX : 0;
    int right = (m->x + s->reach) / CELL_PX, bottom = (m->y + s->reach) / CELL_PX;
    right = right < c->columns ? right : c->columns - 1;
    bottom = bottom < s->rows ? bottom : s->rows - 1;
    for (int v = m->y > s->reach ? (m->y - s->reach) / CELL_PX : 0; v <= bottom; v++) {
        int next = c->cell[v * c->columns + left], end = c->cell[v * c->columns + right + 1];
        for (; next < end; next += A_TIME) {
            int some = end - next < A_TIME ? end - next : A_TIME;
            uint32_t higher = BST_SIMD_PICK(higher_neighbours)(c, next, some, m, s->reach);
            for (; higher != 0; higher &= higher - 1u) {
                int k = next + __builtin_ctz(higher);
                if (is_ridge(s, m, c->cell_x[k] - m->x, c->cell_y[k] - m->y, least)) {
                    return false;
                }
            }
        }
    }
    return true;
}

/* Reads rows `from` to `last` of the SNR map into the cache in memory order, because the lines
 * between maxima of a crowded frame go everywhere. Plain reads let the processor's own prefetcher
 * help. Returns the next row. */
static int read_ahead(const search *s, int from, int last) {
    enum { LINE = 16 };
    int y = from;
    for (; y <= last && y < s->f->height; y++) {
        const float *row = s->map + (long)y * s->f->stride;
        for (int x = 0; x < s->f->width; x += LINE) {
            (void)*(const volatile float *)(row + x);
        }
    }
    return y;
}

/* Decides which maxima are candidates (loop body of bst_parallel_for). */
static void select_candidates(void *user, int begin, int end) {
    const search *s = user;
    int read = 0;
    for (int i = begin; i < end; i++) {
        const bst_candidate *m = &s->c->maxima[i];
        if (s->f->crowded && s->map) {
            int first = m->y > s->reach ? m->y - s->reach : 0;
            read = read_ahead(s, read > first ? read : first, m->y + s->reach);
        }
        s->c->stands[i] =
            is_separate_source(s, m) && (m->snr > s->certain || s->accept(s->user, m)) ? 1 : 0;
    }
}

/* Sorts candidates by falling SNR, stable; many by radix sort. The bits of positive floats sort
 * like the floats. */
static void sort_items(bst_candidates *c) {
    enum { BITS = 11, BINS = 1 << BITS, PASSES = 3, FEW = 64 };
    if (c->count < FEW) {
        for (int i = 0; i < c->count; i++) {
            int at = i;
            for (; at > 0 && c->items[c->order[at - 1]].snr < c->items[i].snr; at--) {
                c->order[at] = c->order[at - 1];
            }
            c->order[at] = i;
        }
        return;
    }
    for (int i = 0; i < c->count; i++) {
        uint32_t bits;
        memcpy(&bits, &c->items[i].snr, sizeof bits);
        c->key[i] = ~bits;
        c->order[i] = i;
    }
    for (int pass = 0; pass < PASSES; pass++) {
        int bins[BINS] = {0}, sum = 0;
        for (int i = 0; i < c->count; i++) {
            bins[c->key[i] >> (pass * BITS) & (BINS - 1)]++;
        }
        for (int b = 0; b < BINS; b++) {
            int n = bins[b];
            bins[b] = sum;
            sum += n;
        }
        for (int i = 0; i < c->count; i++) {
            int to = bins[c->key[i] >> (pass * BITS) & (BINS - 1)]++;
            c->key_swap[to] = c->key[i];
            c->order_swap[to] = c->order[i];
        }
        uint32_t *key = c->key;
        int *order = c->order;
        c->key = c->key_swap;
        c->order = c->order_swap;
        c->key_swap = key;
        c->order_swap = order;
    }
}

/* Context of the loop that gathers the maxima. */
typedef struct gathering {
    bst_candidates *c;
    const bst_filter *f;
} gathering;

/* Copies the maxima of rows of cells begin to end - 1 and groups them by cell (counting sort). The
 * first cell of each row of cells holds the index of its first maximum before. */
static void gather_rows(void *user, int begin, int end) {
    const gathering *g = user;
    const bst_filter *f = g->f;
    bst_candidates *c = g->c;
    for (int v = begin; v < end; v++) {
        int *cell = c->cell + v * c->columns, first = cell[0], next = first;
        int last = (v + 1) * CELL_PX < f->height ? (v + 1) * CELL_PX : f->height;
        memset(cell, 0, (size_t)c->columns * sizeof *cell);
        for (int y = v * CELL_PX; y < last; y++) {
            size_t at = (size_t)y * (size_t)f->max_width;
            if (y + SOON < f->height) { /* the maxima of successive rows lie far apart in memory */
                __builtin_prefetch(f->maximum_x + at + (size_t)(SOON * f->max_width));
                __builtin_prefetch(f->maximum_snr + at + (size_t)(SOON * f->max_width));
            }
            for (int i = 0; i < f->maxima[y]; i++) {
                int x = f->maximum_x[at + (size_t)i];
                c->maxima[next++] = (bst_candidate){x, y, f->maximum_snr[at + (size_t)i]};
                cell[x / CELL_PX]++;
            }
        }
        for (int u = 0, sum = first; u < c->columns; u++) {
            sum += cell[u];
            cell[u] = sum;
        }
        /* filled from the back: each cell's end becomes its first index */
        for (int i = next - 1; i >= first; i--) {
            int to = --cell[c->maxima[i].x / CELL_PX];
            c->cell_x[to] = c->maxima[i].x;
            c->cell_y[to] = c->maxima[i].y;
            c->cell_snr[to] = c->maxima[i].snr;
        }
    }
}

/* Gathers the maxima of all rows, in row order and by cell; returns their number. */
static int gather_maxima(bst_candidates *c, bst_parallel *pool, const bst_filter *f, int rows) {
    gathering g = {c, f};
    int maxima = 0;
    for (int y = 0; y < f->height; y++) {
        if (y % CELL_PX == 0) {
            c->cell[y / CELL_PX * c->columns] = maxima;
        }
        maxima += f->maxima[y];
    }
    c->cell[c->columns * rows] = maxima;
    /* few maxima are gathered before another thread wakes */
    bst_parallel_for(pool, rows, f->crowded ? GATHER_ROWS : rows, gather_rows, &g);
    return maxima;
}

void bst_candidates_find(bst_candidates *c, bst_parallel *pool, const bst_filter *f,
                         const bst_candidates_criteria *criteria) {
    assert(c && f && criteria && f->width > 0 && f->height > 0);
    int rows = (f->height + CELL_PX - 1) / CELL_PX;
    c->columns = (f->width + CELL_PX - 1) / CELL_PX;
    int maxima = gather_maxima(c, pool, f, rows);
    const float *map = !f->streak ? f->point : f->kept ? f->best : NULL;
    map = map ? map + (long)f->pad * f->stride + f->pad : NULL;
    search s = {c,
                f,
                map,
                criteria->reach_px,
                rows,
                criteria->floor,
                criteria->certain,
                criteria->accept,
                criteria->user};
    /* few parts if each reads the rows about it, because the rows at a border are read twice */
    int share = f->crowded ? maxima / (PARTS_PER_THREAD * bst_parallel_threads(pool)) : 0;
    bst_parallel_for(pool, maxima, share > GRAIN ? share : GRAIN, select_candidates, &s);
    c->count = 0;
    for (int i = 0; i < maxima; i++) {
        if (c->stands[i]) {
            c->items[c->count++] = c->maxima[i];
        }
    }
    sort_items(c);
}
