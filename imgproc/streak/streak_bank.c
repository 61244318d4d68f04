#include "imgproc/streak/streak_bank.h"

#include <assert.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/detect/simd_layout.h"
#include "sim/core/heapsort.h"

/* A tile holds the lines that start in it. */
enum { TILE_COLUMNS = 512, TILE_ROWS = 256, TILE_HITS = 2048, PIECES = 8 };

/* Rows per piece of a line in an octave. */
static int piece_rows(int octave) {
    return 1 << octave;
}

/* Number of slopes in an octave. */
static int slopes_of(int octave) {
    return 8 * piece_rows(octave) + 1;
}

/* Quotient rounded to the nearest integer. */
static int rounded(int numerator, int denominator) {
    return (int)floor((double)numerator / denominator + 0.5);
}

/* Column of row r of a piece of `a` rows with slope k / a, relative to the piece's middle. */
static int piece_column(int a, int k, int r) {
    return rounded(k * (2 * r - a + 1), 2 * a);
}

/* Slope, in steps of 1 / a, of the piece used for line slope number i - 4 a. */
static int piece_slope(int a, int i) {
    return a > 1 ? rounded(i - 4 * a, 4) : 0;
}

/* Column of piece j of a line, relative to the first piece. */
static int piece_shift(int a, int i, int j) {
    return rounded((i - 4 * a) * j, 4);
}

/* Longest window at a slope, rows: no path is longer than max_px. */
static int most_rows(const bst_streak_bank *bank, int a, int i) {
    double slope = (i - 4 * a) / (4.0 * a);
    return (int)ceil(bank->max_px / sqrt(1.0 + slope * slope)) + a / 2;
}

/* Number of window lengths in an octave. */
static int windows_of(const bst_streak_bank *bank, int octave) {
    int a = piece_rows(octave);
    return octave == bank->octaves - 1 && 7 * a < bank->max_rows ? 5 : 4;
}

static size_t tile_count(int width, int height) {
    size_t rows = (size_t)((height + TILE_ROWS - 1) / TILE_ROWS);
    size_t columns = (size_t)((width + TILE_COLUMNS - 1) / TILE_COLUMNS);
    return rows * columns;
}

bst_status bst_streak_bank_create(bst_ctx *ctx, int max_width, int max_height, double max_px,
                                  int workers, bst_streak_bank *out) {
    int rows = (int)fmin(ceil(max_px), BST_STREAK_MAX_ROWS);
    *out = (bst_streak_bank){
        .max_px = max_px, .max_rows = rows < 7 ? 7 : rows, .sigma_px = -1.0, .workers = workers};
    while (out->octaves < BST_STREAK_MAX_OCTAVES &&
           (out->octaves == 0 || 8 * piece_rows(out->octaves - 1) < out->max_rows)) {
        out->octaves++;
    }
    /* windows of other shapes have at most this many tiles */
    size_t tiles = tile_count(max_width, max_height) + tile_count(max_height, max_width);
    size_t columns = TILE_COLUMNS + 2 * BST_STREAK_PAD;
    out->max_tiles = (int)tiles;
    bool good = true;
    for (int o = 0; o < out->octaves; o++) {
        out->scale[o] = calloc((size_t)slopes_of(o) * BST_STREAK_WINDOWS, sizeof(float));
        good = good && out->scale[o];
        int b = piece_rows(o);
        size_t work =
            TILE_COLUMNS + (size_t)(TILE_ROWS / b + PIECES) * (size_t)(2 * b + 1) * columns;
        out->work_per_worker = work > out->work_per_worker ? work : out->work_per_worker;
    }
    out->work = calloc(out->work_per_worker * (size_t)workers, sizeof *out->work);
    out->hits = calloc(tiles * TILE_HITS, sizeof *out->hits);
    out->hit_count = calloc(tiles, sizeof *out->hit_count);
    if (!good || !out->hits || !out->hit_count || !out->work) {
        bst_streak_bank_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a bank of streak filters");
    }
    return BST_OK;
}

void bst_streak_bank_free(bst_streak_bank *bank) {
    for (int o = 0; o < BST_STREAK_MAX_OCTAVES; o++) {
        free(bank->scale[o]);
    }
    free(bank->hits);
    free(bank->hit_count);
    free(bank->work);
    *bank = (bst_streak_bank){0};
}

int bst_streak_bank_capacity(const bst_streak_bank *bank) {
    return bank->max_tiles * TILE_HITS;
}

/* Scale of each window's sum to unit noise, from the variance over the pixels that it sums. */
static void set_scales(bst_streak_bank *bank, const bst_streak_map *map) {
    bank->sigma_px = map->sigma_px;
    int column[BST_STREAK_MAX_ROWS + 8];
    for (int o = 0; o < bank->octaves; o++) {
        int a = piece_rows(o);
        for (int i = 0; i < slopes_of(o); i++) {
            int k = piece_slope(a, i);
            double variance = 0.0;
            for (int row = 0; row < PIECES * a; row++) {
                column[row] = piece_shift(a, i, row / a) + piece_column(a, k, row % a);
                variance += map->correlation[0] * map->correlation[0];
                for (int lag = 1; lag <= row && lag <= 2 * map->radius; lag++) {
                    int across = abs(column[row] - column[row - lag]);
                    if (across <= 2 * map->radius) {
                        variance += 2.0 * map->correlation[lag] * map->correlation[across];
                    }
                }
                int pieces = (row + 1) / a;
                if ((row + 1) % a == 0 && pieces >= 4) {
                    bank->scale[o][i * BST_STREAK_WINDOWS + pieces - 4] =
                        (float)(1.0 / (BST_STREAK_QUANTA * sqrt(variance)));
                }
            }
        }
    }
}

/* Sum of rows of the streak map: out = sum of in. */
BST_CLONES_16
static void sum_rows(int16_t *restrict out, int count, const int16_t *const *in, int rows) {
    if (rows == 1) {
        memcpy(out, in[0], (size_t)count * sizeof *out);
        return;
    }
    const int16_t *restrict a = in[0], *restrict b = in[1];
    if (rows == 2) {
        for (int x = 0; x < count; x++) {
            out[x] = (int16_t)(a[x] + b[x]);
        }
        return;
    }
    const int16_t *restrict c = in[2], *restrict d = in[3];
    for (int x = 0; x < count; x++) {
        out[x] = (int16_t)(a[x] + b[x] + c[x] + d[x]);
    }
    for (int r = 4; r < rows; r += 4) {
        const int16_t *restrict e = in[r], *restrict f = in[r + 1], *restrict g = in[r + 2],
                                *restrict h = in[r + 3];
        for (int x = 0; x < count; x++) {
            out[x] = (int16_t)(out[x] + e[x] + f[x] + g[x] + h[x]);
        }
    }
}

/* Largest excess over the thresholds among the windows of 4 to 7 (8) pieces; returns true if any is
 * above 0. */
BST_CLONES_16
static bool best_window(int16_t *restrict out, int count, const int16_t *const *in,
                        const int16_t *limit, int windows) {
    const int16_t *restrict p0 = in[0], *restrict p1 = in[1], *restrict p2 = in[2],
                            *restrict p3 = in[3], *restrict p4 = in[4], *restrict p5 = in[5],
                            *restrict p6 = in[6], *restrict p7 = in[7];
    int16_t l0 = limit[0], l1 = limit[1], l2 = limit[2], l3 = limit[3], l4 = limit[4];
    int16_t any = -1;
    if (windows == 5) {
        for (int x = 0; x < count; x++) {
            int16_t s = (int16_t)(p0[x] + p1[x] + p2[x] + p3[x]);
            int16_t best = (int16_t)(s - l0), v;
            s = (int16_t)(s + p4[x]);
            v = (int16_t)(s - l1);
            best = v > best ? v : best;
            s = (int16_t)(s + p5[x]);
            v = (int16_t)(s - l2);
            best = v > best ? v : best;
            s = (int16_t)(s + p6[x]);
            v = (int16_t)(s - l3);
            best = v > best ? v : best;
            s = (int16_t)(s + p7[x]);
            v = (int16_t)(s - l4);
            best = v > best ? v : best;
            out[x] = best;
            any = best > any ? best : any;
        }
        return any > 0;
    }
    for (int x = 0; x < count; x++) {
        int16_t s = (int16_t)(p0[x] + p1[x] + p2[x] + p3[x]);
        int16_t best = (int16_t)(s - l0), v;
        s = (int16_t)(s + p4[x]);
        v = (int16_t)(s - l1);
        best = v > best ? v : best;
        s = (int16_t)(s + p5[x]);
        v = (int16_t)(s - l2);
        best = v > best ? v : best;
        s = (int16_t)(s + p6[x]);
        v = (int16_t)(s - l3);
        best = v > best ? v : best;
        out[x] = best;
        any = best > any ? best : any;
    }
    return any > 0;
}

typedef struct run_job {
    bst_streak_bank *bank;
    const bst_streak_map *map;
    int first_octave;
    double threshold;
    int tiles[2], columns[2]; /* per plane */
    atomic_int next;
} run_job;

static bool stronger(const void *context, int a, int b) {
    const bst_streak_hit *hits = context;
    return hits[a].snr > hits[b].snr || (hits[a].snr == hits[b].snr && a < b);
}

/* Keeps the stronger half of the hits; returns the least SNR still accepted. */
static float keep_stronger_half(bst_streak_hit *hits, int *count) {
    int order[TILE_HITS];
    for (int i = 0; i < TILE_HITS; i++) {
        order[i] = i;
    }
    bst_heapsort_indices(order, TILE_HITS, stronger, hits);
    float least = hits[order[TILE_HITS / 2]].snr;
    int kept = 0;
    for (int i = 0; i < TILE_HITS; i++) {
        if (hits[i].snr > least) {
            hits[kept++] = hits[i];
        }
    }
    *count = kept;
    return least;
}

typedef struct tile {
    const run_job *job;
    int plane, x0, y0, x1, y1; /* lines begin at x0 <= x < x1, y0 <= y < y1 */
    bst_streak_hit *hits;
    int *count;
    float least;
    int16_t *pieces, *line;
} tile;

/* Stores a hit of the filter bank. */
static void add_hit(tile *t, const bst_streak_hit *hit) {
    if (hit->snr <= t->least) {
        return;
    }
    if (*t->count == TILE_HITS) {
        t->least = keep_stronger_half(t->hits, t->count);
        if (hit->snr <= t->least) {
            return;
        }
    }
    t->hits[(*t->count)++] = *hit;
}

/* Collects the maximum of each run of adjacent excesses in a line. */
static void collect_hits(tile *t, const int16_t *const *in, int octave, int slope, int y,
                         int windows) {
    const bst_streak_bank *bank = t->job->bank;
    const float *scale = bank->scale[octave] + slope * BST_STREAK_WINDOWS;
    int a = piece_rows(octave), count = t->x1 - t->x0;
    float gradient = (float)(slope - 4 * a) / (float)(4 * a);
    bst_streak_hit best = {.snr = 0.0f};
    for (int x = 0; x <= count; x++) {
        if (x == count || t->line[x] <= 0) {
            if (best.snr > 0.0f) {
                add_hit(t, &best);
                best.snr = 0.0f;
            }
            continue;
        }
        int sum = 0;
        for (int j = 0; j < windows + 3; j++) {
            sum += in[j][x];
            float snr = j >= 3 ? (float)sum * scale[j - 3] : 0.0f;
            if (snr > best.snr && (double)snr > t->job->threshold) {
                /* the path ends at the outer edges of the first and last row */
                int rows = (j + 1) * a;
                float middle = (float)(t->x0 + x), top = (float)y - 0.5f;
                float u0 = middle - 0.5f * gradient * (float)a;
                float u1 = u0 + gradient * (float)rows, v1 = top + (float)rows;
                bool turned = t->plane != 0;
                best = (bst_streak_hit){.snr = snr,
                                        .x0 = turned ? top : u0,
                                        .y0 = turned ? u0 : top,
                                        .x1 = turned ? v1 : u1,
                                        .y1 = turned ? u1 : v1,
                                        .plane = (int16_t)t->plane,
                                        .rows = (int16_t)rows};
            }
        }
    }
}

/* Sums all lines of an octave that start in a tile. */
static void sum_octave(tile *t, int octave) {
    const bst_streak_bank *bank = t->job->bank;
    const bst_streak_map *map = t->job->map;
    int a = piece_rows(octave), kinds = 2 * a + 1;
    int height = t->plane ? map->width : map->height;
    int columns = TILE_COLUMNS + 2 * BST_STREAK_PAD;
    long stride = map->stride[t->plane];
    const int16_t *plane = bst_streak_map_plane(map, t->plane);
    int windows = windows_of(bank, octave), needed = windows + 3;
    /* pieces that start in the tile's rows, and those that its last lines need */
    int last = (height / a) * a;
    int pieces = (t->y1 - t->y0 + a - 1) / a + needed - 1;
    pieces = pieces < (last - t->y0) / a ? pieces : (last - t->y0) / a;
    /* a line extends sideways by at most its number of rows */
    int margin = needed * a, left = t->x0 - margin, wide = t->x1 - t->x0 + 2 * margin;
    const int16_t *in[16];
    if (a > 1) {
        for (int j = 0; j < pieces; j++) {
            for (int k = -a; k <= a; k++) {
                const int16_t *row = plane + (long)(t->y0 + j * a) * stride + left;
                for (int r = 0; r < a; r++) {
                    in[r] = row + r * stride + piece_column(a, k, r);
                }
                sum_rows(
                    t->pieces + ((size_t)j * (size_t)kinds + (size_t)(k + a)) * (size_t)columns,
                    wide, in, a);
            }
        }
    }
    for (int j = 0; j * a < t->y1 - t->y0; j++) {
        int have = pieces - j;
        if (have < 4) {
            break;
        }
        /* lines of slope +1 and -1 belong to the first plane */
        int skip = t->plane ? 1 : 0;
        for (int i = skip; i < slopes_of(octave) - skip; i++) {
            int rows = most_rows(bank, a, i) / a;
            int usable = (have < rows ? have : rows) - 3;
            if (usable < 1) {
                continue;
            }
            usable = usable < windows ? usable : windows;
            int16_t limit[BST_STREAK_WINDOWS];
            const float *scale = bank->scale[octave] + i * BST_STREAK_WINDOWS;
            for (int w = 0; w < BST_STREAK_WINDOWS; w++) {
                limit[w] = w < usable ? (int16_t)fmin(t->job->threshold / (double)scale[w], 20000.0)
                                      : 20000;
            }
            for (int p = 0; p < PIECES; p++) {
                int q = p < usable + 3 ? p : usable + 2;
                int shift = piece_shift(a, i, q);
                if (a > 1) {
                    size_t at = (size_t)(j + q) * (size_t)kinds + (size_t)(piece_slope(a, i) + a);
                    in[p] = t->pieces + at * (size_t)columns + margin + shift;
                } else {
                    in[p] = plane + (long)(t->y0 + j + q) * stride + t->x0 + shift;
                }
            }
            if (best_window(t->line, t->x1 - t->x0, in, limit, windows)) {
                collect_hits(t, in, octave, i, t->y0 + j * a, usable);
            }
        }
    }
}

/* Processes tiles (loop body); a tile's result does not depend on the worker. */
static void run_tiles(void *user, int begin, int end) {
    run_job *job = user;
    bst_streak_bank *bank = job->bank;
    for (int worker = begin; worker < end; worker++) {
        int16_t *work = bank->work + (size_t)worker * bank->work_per_worker;
        for (int n; (n = atomic_fetch_add(&job->next, 1)) < job->tiles[0] + job->tiles[1];) {
            int plane = n >= job->tiles[0], local = n - (plane ? job->tiles[0] : 0);
            int width = plane ? job->map->height : job->map->width;
            int height = plane ? job->map->width : job->map->height;
            tile t = {.job = job, .plane = plane, .line = work, .pieces = work + TILE_COLUMNS};
            t.x0 = local % job->columns[plane] * TILE_COLUMNS;
            t.y0 = local / job->columns[plane] * TILE_ROWS;
            t.x1 = t.x0 + TILE_COLUMNS < width ? t.x0 + TILE_COLUMNS : width;
            t.y1 = t.y0 + TILE_ROWS < height ? t.y0 + TILE_ROWS : height;
            t.hits = bank->hits + (size_t)n * TILE_HITS;
            t.count = &bank->hit_count[n];
            *t.count = 0;
            for (int o = job->first_octave; o < bank->octaves; o++) {
                sum_octave(&t, o);
            }
        }
    }
}

int bst_streak_bank_run(bst_streak_bank *bank, bst_parallel *pool, const bst_streak_map *map,
                        int first_octave, double threshold) {
    assert(bank && map && first_octave >= 0 && threshold > 0.0);
    if (map->sigma_px != bank->sigma_px) {
        set_scales(bank, map);
    }
    run_job job = {.bank = bank, .map = map, .first_octave = first_octave, .threshold = threshold};
    for (int plane = 0; plane < 2; plane++) {
        int width = plane ? map->height : map->width, height = plane ? map->width : map->height;
        job.columns[plane] = (width + TILE_COLUMNS - 1) / TILE_COLUMNS;
        job.tiles[plane] = (int)tile_count(width, height);
    }
    atomic_init(&job.next, 0);
    bst_parallel_for(pool, bank->workers, 1, run_tiles, &job);
    int count = 0;
    for (int n = 0; n < job.tiles[0] + job.tiles[1]; n++) {
        memmove(bank->hits + count, bank->hits + (size_t)n * TILE_HITS,
                (size_t)bank->hit_count[n] * sizeof *bank->hits);
        count += bank->hit_count[n];
    }
    return count;
}
