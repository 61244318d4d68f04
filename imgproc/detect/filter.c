#include "imgproc/detect/filter.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/detect/row_kernels.h"
#include "sim/core/pages.h"

enum {
    PART_PX = 131072,     /* least pixels per part of a parallel pass */
    PARTS_PER_THREAD = 8, /* at most: each part filters 2 radius rows of its neighbours again */
    GROUP = 4,            /* rows filtered together */
    LATEST = 3,           /* latest rows of the streak map, kept in a ring */
    CACHED_PX = 1 << 20,
    FEW_TAPS = 24, /* a streak of at most so many taps is computed on demand */
    /* pixels per maximum below which a frame is crowded, and a map of the larger output is kept */
    CROWD_PX = 400,
    SOON_PX = 512 /* pixels prefetched at a time */
};

static bool has_known(const bst_filter *f) {
    return !f->known || (f->lags && f->phases && f->work);
}

bst_status bst_filter_create(bst_ctx *ctx, const bst_known_psf *known, int max_width,
                             int max_height, double streak_max_px, int threads, bst_filter *out) {
    assert(out && max_width > 0 && max_height > 0 && streak_max_px >= 0.0);
    int pad = (int)ceil(0.5 * streak_max_px) + 2;
    /* the search for maxima reads beyond a row */
    pad = pad > 2 * BST_ROW_LANES ? pad : 2 * BST_ROW_LANES;
    /* rows start on cache lines if the frame's width allows it */
    pad = (pad + BST_ROW_LANES - 1) / BST_ROW_LANES * BST_ROW_LANES;
    *out = (bst_filter){
        .known = known, .max_width = max_width, .max_height = max_height, .pad = pad, .rank = 1};
    size_t pixels = (size_t)max_width * (size_t)max_height;
    size_t line = (size_t)(max_width + 2 * pad);
    /* per thread: three rows, the ring of the streak map, the row's background segments, and the
     * ring of horizontally filtered rows */
    size_t ring = (2 * BST_FILTER_MAX_RADIUS + GROUP) * (known ? BST_FILTER_RANK : 1);
    out->line_floats = line * (3 + LATEST + 3 + ring);
    size_t map = line * (size_t)(max_height + 2 * pad) * sizeof(float);
    out->point = bst_pages_alloc(map);
    out->best = bst_pages_alloc(map);
    out->maxima = calloc((size_t)max_height, sizeof *out->maxima);
    out->maximum_x = bst_pages_zero(pixels, sizeof *out->maximum_x);
    out->maximum_snr = bst_pages_zero(pixels, sizeof *out->maximum_snr);
    out->lines = bst_pages_zero(out->line_floats * (size_t)threads, sizeof(float));
    out->lent = calloc(1, sizeof *out->lent);
    out->edge_x = calloc((size_t)max_width, sizeof(float));
    out->edge_y = calloc((size_t)max_height, sizeof(float));
    if (known) {
        out->lags = calloc((size_t)BST_FILTER_LAGS * BST_FILTER_LAGS, sizeof *out->lags);
        out->phases = calloc(BST_FILTER_PHASE_FLOATS, sizeof *out->phases);
        out->work = calloc(BST_FILTER_WORK, sizeof *out->work);
    }
    if (!has_known(out) || !out->point || !out->best || !out->maxima || !out->maximum_x ||
        !out->maximum_snr || !out->lines || !out->lent || !out->edge_x || !out->edge_y) {
        bst_filter_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the filters of a %d x %d frame",
                        max_width, max_height);
    }
    bst_scratch_pool_init(out->lent, threads);
    return BST_OK;
}

void bst_filter_free(bst_filter *f) {
    free(f->point);
    free(f->best);
    free(f->maxima);
    bst_pages_free(f->maximum_x);
    bst_pages_free(f->maximum_snr);
    bst_pages_free(f->lines);
    free(f->lent);
    free(f->edge_x);
    free(f->edge_y);
    free(f->lags);
    free(f->phases);
    free(f->work);
    *f = (bst_filter){0};
}

/* Edge correction along one axis: 1 / norm of the part of the kernel on pixels 0 to count - 1, per
 * pixel. */
static void edge_factors(const bst_filter *f, const double *square_at, int count, float *out) {
    for (int x = 0; x < count; x++) {
        out[x] = 1.0f;
        if (x >= f->radius && x + f->radius < count) {
            continue;
        }
        double square = 0.0;
        for (int i = -f->radius; i <= f->radius; i++) {
            square += x + i >= 0 && x + i < count ? square_at[i + f->radius] : 0.0;
        }
        out[x] = (float)(1.0 / sqrt(square));
    }
}

/* Context of a filter pass over a frame. */
typedef struct pass {
    bst_filter *f;
    const bst_background *background;
    bst_imgproc_pixel_fn read;
    const void *user;
    const uint16_t *raw;
    const bst_row_gain *gain; /* NULL: electrons are read by `read` */
    float *signal;
    int saturated_dn, part_rows;
    int reach;        /* half height of the streak's taps, rows */
    bool provisional; /* the signal is stored only if the frame is not crowded */
    bool past_cache;  /* frame larger than the cache */
    bool apart;       /* streak-map rows are discarded once their maxima are found */
    float threshold;
} pass;

/* Row y of a padded map, at column 0. */
static float *map_row(const bst_filter *f, float *map, int y) {
    return map + (long)(y + f->pad) * (long)f->stride + f->pad;
}

/* Stores the local maxima of row y of the SNR map. */
static void note_maxima(bst_filter *f, int y, const float *above, const float *row,
                        const float *below, float threshold) {
    size_t at = (size_t)y * (size_t)f->max_width;
    if (y + 1 < f->height) { /* the maxima of successive rows lie far apart in memory */
        __builtin_prefetch(f->maximum_x + at + (size_t)f->max_width, 1);
        __builtin_prefetch(f->maximum_snr + at + (size_t)f->max_width, 1);
    }
    f->maxima[y] = bst_row_maxima(above, row, below, f->width, threshold, f->maximum_x + at,
                                  f->maximum_snr + at);
}

/* Finds the maxima of row y. The rows above and below must be complete; rows outside the frame are
 * 0. */
static void find_maxima(bst_filter *f, int y, float threshold) {
    const float *row = map_row(f, f->streak ? f->best : f->point, y);
    note_maxima(f, y, row - f->stride, row, row + f->stride, threshold);
}

/* One row of the streak map; `copy` (NULL: none) gets the same values. The rows of the point map
 * that the taps use must be complete. */
static void filter_streak(const bst_filter *f, int y, float *row, float *copy) {
    const float *in[BST_FILTER_MAX_TAPS], *point = map_row(f, f->point, y);
    for (int t = 0; t < f->taps; t++) {
        in[t] = point + (long)f->tap_y[t] * (long)f->stride + f->tap_x[t];
    }
    bst_row_streak(row, copy, f->width, in, f->tap_weight, f->taps, point);
}

/* Normalises a row for the part of the kernel cut off at the frame's edges. */
static void normalise_edges(const bst_filter *f, int y, float *row) {
    int r = f->radius < f->width ? f->radius : f->width, last = f->width - r;
    if (f->edge_y[y] != 1.0f || last < r) {
        bst_row_scale(row, f->edge_x, f->edge_y[y], f->width);
    } else {
        bst_row_scale(row, f->edge_x, 1.0f, r);
        bst_row_scale(row + last, f->edge_x + last, 1.0f, r);
    }
}

/* Signal of row y, and its normalised signal at lines + radius. */
static void read_row(const pass *p, int y, float *lines, float *signal) {
    const bst_filter *f = p->f;
    int width = f->width, r = f->radius;
    size_t row = (size_t)y * (size_t)width, line = (size_t)f->stride;
    float *normalised = lines, *electrons = lines + line;
    bst_row_part *parts = (bst_row_part *)(void *)(lines + 3 * line);
    if (!p->gain) {
        p->read(p->user, y, 0, width, electrons);
    }
    const bst_row_input pixels = {p->raw + row, p->gain, electrons, p->saturated_dn};
    bst_row_normalise(&pixels, parts, bst_background_parts(p->background, y, parts), signal,
                      normalised + r);
    if (f->correct_row) {
        f->correct_row(f->correct_user, y, width, signal, normalised + r);
    }
}

/* Filters one row horizontally; own: also stores its signal. */
static void filter_horizontal(const pass *p, int y, bool own, float *lines, float *out) {
    const bst_filter *f = p->f;
    int width = f->width, r = f->radius;
    size_t row = (size_t)y * (size_t)width, line = (size_t)f->stride;
    if (y < 0 || y >= f->height) {
        for (int k = 0; k < f->rank; k++) {
            memset(out + (size_t)k * line, 0, (size_t)width * sizeof(float));
        }
        return;
    }
    const float *normalised = lines;
    read_row(p, y, lines, own && p->signal && !p->provisional ? p->signal + row : lines + 2 * line);
    const float *in[2 * BST_FILTER_MAX_RADIUS + 1];
    for (int x = 0; x < width; x += SOON_PX) {
        int count = width - x < SOON_PX ? width - x : SOON_PX;
        if (y + 1 < f->height) {
            bst_row_prefetch(p->raw + row + (size_t)(width + x), count);
        }
        for (int t = 0; t <= 2 * r; t++) {
            in[t] = normalised + x + t;
        }
        if (!f->known) {
            bst_row_even(out + x, count, in + r, f->kernel + r, r);
        }
        for (int k = 0; f->known && k < f->rank; k++) {
            bst_row_combine(out + (size_t)k * line + x, count, in, f->across[k], 2 * r + 1);
        }
    }
}

/* Filters vertically: one row of the point map for a known PSF. */
static void filter_vertical_known(const bst_filter *f, int y, const float *ring, int ring_rows,
                                  float *out) {
    const float *in[BST_FILTER_RANK * (2 * BST_FILTER_MAX_RADIUS + 1)];
    size_t line = (size_t)f->stride;
    int r = f->radius, taps = 2 * r + 1;
    for (int k = 0; k < f->rank; k++) {
        for (int t = 0; t < taps; t++) {
            int at = (y - r + t + ring_rows) % ring_rows;
            in[k * taps + t] = ring + line * (size_t)(at * f->rank + k);
        }
    }
    bst_row_combine(out, f->width, in, f->down, f->rank * taps);
}

/* Filters vertically: `count` (1 or GROUP) rows of the point map from the ring of horizontal
 * results. */
static void filter_vertical(bst_filter *f, int y, int count, const float *ring, int ring_rows) {
    const float *in[2 * BST_FILTER_MAX_RADIUS + GROUP];
    size_t line = (size_t)f->stride;
    int r = f->radius;
    float *out = map_row(f, f->point, y);
    for (int t = 0; !f->known && t < 2 * r + count; t++) {
        in[t] = ring + line * (size_t)((y - r + t + ring_rows) % ring_rows);
    }
    for (int k = 0; f->known && k < count; k++) {
        filter_vertical_known(f, y + k, ring, ring_rows, out + (size_t)k * line);
    }
    if (f->known) {
        /* done above */
    } else if (count == GROUP) {
        bst_row_even_4(out, line, f->width, in + r, f->kernel + r, r);
    } else {
        bst_row_even(out, f->width, in + r, f->kernel + r, r);
    }
    for (int k = 0; k < count; k++) {
        normalise_edges(f, y + k, out + (size_t)k * line);
    }
}

/* Filters rows begin to end - 1: signal and point map, and those rows of streak map and maxima that
 * need no row of another part. */
static void filter_rows(void *user, int begin, int end) {
    const pass *p = user;
    bst_filter *f = p->f;
    int r = f->radius, ring_rows = 2 * r + GROUP;
    size_t line = (size_t)f->stride;
    int taken = bst_scratch_pool_take(f->lent);
    float *lines = f->lines + f->line_floats * (size_t)taken, *ring = lines + 6 * line;
    /* ring of the latest streak-map rows: maxima are found while they are in the cache */
    size_t ring_lines = (size_t)(ring_rows * f->rank);
    float *latest = ring + line * ring_lines + f->pad;
    bool ring_of_streaks = f->streak && p->past_cache;
    memset(lines, 0, line * sizeof(float));
    memset(latest - f->pad, 0, LATEST * line * sizeof(float));
    for (int y = begin - r, next = begin; y < end + r; y++) {
        filter_horizontal(p, y, y >= begin && y < end, lines,
                          ring + line * (size_t)((y + ring_rows) % ring_rows * f->rank));
        int last = y - r; /* last row that can be filtered */
        int count = last - next + 1 == GROUP ? GROUP : last + 1 == end ? 1 : 0;
        for (; count > 0 && next <= last; next += count) {
            filter_vertical(f, next, count, ring, ring_rows);
            for (int k = next; k < next + count; k++) {
                int ready = k - p->reach;
                if (f->streak && ready >= begin + p->reach) {
                    float *row = map_row(f, f->best, ready);
                    filter_streak(f, ready,
                                  ring_of_streaks ? latest + line * (size_t)(ready % LATEST) : row,
                                  ring_of_streaks && !p->apart ? row : NULL);
                }
                if (ready - 2 < begin + p->reach) {
                    continue;
                }
                if (ring_of_streaks) {
                    note_maxima(f, ready - 1, latest + line * (size_t)((ready - 2) % LATEST),
                                latest + line * (size_t)((ready - 1) % LATEST),
                                latest + line * (size_t)(ready % LATEST), p->threshold);
                } else {
                    find_maxima(f, ready - 1, p->threshold);
                }
            }
        }
    }
    bst_scratch_pool_give(f->lent, taken);
}

/* Stores the signal of rows begin to end - 1. */
static void keep_signal(void *user, int begin, int end) {
    const pass *p = user;
    const bst_filter *f = p->f;
    int taken = bst_scratch_pool_take(f->lent);
    for (int y = begin; y < end; y++) {
        read_row(p, y, f->lines + f->line_floats * (size_t)taken,
                 p->signal + (size_t)y * (size_t)f->width);
    }
    bst_scratch_pool_give(f->lent, taken);
}

/* True if row y needs rows of another part, up to `reach` rows away. */
static bool is_border(const pass *p, int y, int reach) {
    int begin = y / p->part_rows * p->part_rows, end = begin + p->part_rows;
    end = end < p->f->height ? end : p->f->height;
    return y < begin + reach || y >= end - reach;
}

/* Streak-map rows at the borders of parts. */
static void finish_streaks(void *user, int begin, int end) {
    const pass *p = user;
    for (int y = begin; y < end; y++) {
        if (is_border(p, y, p->reach)) {
            filter_streak(p->f, y, map_row(p->f, p->f->best, y), NULL);
        }
    }
}

/* The whole streak map. */
static void keep_streaks(void *user, int begin, int end) {
    const pass *p = user;
    for (int y = begin; y < end; y++) {
        filter_streak(p->f, y, map_row(p->f, p->f->best, y), NULL);
    }
}

/* Maxima in rows at the borders of parts. */
static void finish_maxima(void *user, int begin, int end) {
    const pass *p = user;
    for (int y = begin; y < end; y++) {
        if (is_border(p, y, p->reach + 1)) {
            find_maxima(p->f, y, p->threshold);
        }
    }
}

/* Maxima in rows at the borders of parts if the streak map is not stored. */
static void finish_maxima_transient(void *user, int begin, int end) {
    const pass *p = user;
    bst_filter *f = p->f;
    size_t line = (size_t)f->stride;
    int taken = bst_scratch_pool_take(f->lent), made = -2;
    float *ring = f->lines + f->line_floats * (size_t)taken;
    memset(ring, 0, LATEST * line * sizeof(float));
    for (int y = begin; y < end; y++) {
        if (!is_border(p, y, p->reach + 1)) {
            continue;
        }
        const float *rows[LATEST];
        for (int k = 0; k < LATEST; k++) {
            int at = y - 1 + k;
            float *row = ring + line * (size_t)((at + LATEST) % LATEST) + f->pad;
            bool outside = at < 0 || at >= f->height;
            if (!outside && at > made) {
                filter_streak(f, at, row, NULL);
                made = at;
            }
            rows[k] = outside ? map_row(f, f->best, at) : row;
        }
        note_maxima(f, y, rows[0], rows[1], rows[2], p->threshold);
    }
    bst_scratch_pool_give(f->lent, taken);
}

/* True if the maxima are so dense that a map of the larger output pays. */
static bool is_crowded(const bst_filter *f) {
    long maxima = 0;
    for (int y = 0; y < f->height; y++) {
        maxima += f->maxima[y];
    }
    return maxima * CROWD_PX > (long)f->width * f->height;
}

void bst_filter_run(bst_filter *f, bst_parallel *pool, const bst_filter_input *input,
                    float threshold) {
    assert(f && input && threshold > 0.0f);
    const int width = input->width, height = input->height;
    if (f->width != width || f->height != height) {
        f->width = width;
        f->height = height;
        f->stride = width + 2 * f->pad;
        size_t bytes = (size_t)f->stride * (size_t)(height + 2 * f->pad) * sizeof(float);
        memset(f->point, 0, bytes);
        memset(f->best, 0, bytes);
    }
    edge_factors(f, f->square_x, width, f->edge_x);
    edge_factors(f, f->square_y, height, f->edge_y);
    int rows = PART_PX / width > 0 ? PART_PX / width : 1, reach = 0;
    int share = height / (PARTS_PER_THREAD * bst_parallel_threads(pool));
    rows = share > rows ? share : rows;
    for (int t = 0; t < f->taps; t++) {
        reach = abs(f->tap_y[t]) > reach ? abs(f->tap_y[t]) : reach;
    }
    bool past_cache = width * height > CACHED_PX;
    pass p = {.f = f,
              .background = input->background,
              .read = input->read,
              .user = input->user,
              .raw = input->raw,
              .gain = input->gain,
              .signal = input->signal,
              .saturated_dn = input->saturated_dn,
              .part_rows = rows,
              .reach = reach,
              .provisional = input->provisional && f->crowded,
              .past_cache = past_cache,
              .apart = f->streak && past_cache && f->taps <= FEW_TAPS && !f->crowded,
              .threshold = threshold};
    f->kept = f->streak && !p.apart;
    bst_parallel_for(pool, height, rows, filter_rows, &p);
    if (f->kept) {
        bst_parallel_for(pool, height, rows, finish_streaks, &p);
    }
    bst_parallel_for(pool, height, rows, p.apart ? finish_maxima_transient : finish_maxima, &p);
    f->crowded = is_crowded(f);
    if (p.signal && p.provisional && !f->crowded) {
        bst_parallel_for(pool, height, rows, keep_signal, &p);
    }
    if (p.apart && f->crowded) {
        bst_parallel_for(pool, height, rows, keep_streaks, &p);
        f->kept = true;
    }
}

float bst_filter_streak_at(const bst_filter *f, int x, int y) {
    float sum = 0.0f;
    for (int t = 0; t < f->taps; t++) {
        sum += f->tap_weight[t] * bst_filter_point_at(f, x + f->tap_x[t], y + f->tap_y[t]);
    }
    return sum;
}

void bst_filter_mask(const bst_filter *f, int y, int x, int count, float snr, float *out) {
    /* the map's margin is zero */
    const float *map = f->streak ? f->best : f->point;
    const float *rows[2 * BST_ROW_NEAR + 1];
    for (int j = -BST_ROW_NEAR; j <= BST_ROW_NEAR; j++) {
        int v = y + j < 0 ? 0 : y + j < f->height ? y + j : f->height - 1;
        rows[j + BST_ROW_NEAR] = map + (long)(v + f->pad) * f->stride + f->pad + x;
    }
    bst_row_mask(rows, count, snr, out);
}
