#include "sim/analysis/characterize/frame_stack.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/analysis/characterize/clipped_moments.h"
#include "sim/cli/stop_signals.h"

enum { LEAST_SIDE = 64, MOST_FRAMES = 100000 };

/* Clipping of noise that should be normal, in standard deviations. */
static const double CLIP = 5.0;

/* Differences that are radiation hits: of the brightest pixel, of the others, in standard
 * deviations. */
static const double SEED = 6.0, GROW = 4.0, FLAT_SEED = 4.0, FLAT_GROW = 2.5;

/* Frames being reduced. */
typedef struct reduction {
    const char *kind;
    const bst_keyword_map *map;
    bst_keyword_map whole; /* the map without sections: overscan and image are cut here */
    bst_recorded_frames *recorded;
    bst_frame_stack *stack;
    double *sum;    /* [height][width] of all frames: a float loses the last bits of many frames */
    float *before;  /* [height][width] the first frame of a pair */
    float *scratch; /* [height * width] */
    double *rows;   /* [height] */
    uint8_t *hit;   /* [height * width] 1: pixel of a radiation hit of the last pair */
    bst_time first_start;
} reduction;

double bst_frame_stack_level_variance(const bst_frame_stack *s) {
    double mean = 0.0, sum = 0.0;
    for (int i = 0; i < s->count; i++) {
        mean += s->levels[i] / s->count;
    }
    for (int i = 0; i < s->count; i++) {
        sum += (s->levels[i] - mean) * (s->levels[i] - mean);
    }
    return s->count > 1 ? sum / (s->count - 1) : 0.0;
}

void bst_frame_stack_free(bst_frame_stack *s) {
    free(s->levels);
    free(s->mean);
    free(s->last);
    free(s->overscan);
    bst_radiation_hits_free(&s->hits);
    *s = (bst_frame_stack){0};
}

/* Allocates for frames of the first one's size. */
static bst_status make_room(bst_ctx *ctx, reduction *r, const bst_recorded_frame *f,
                            const int box[4], int overscan_width, int frames) {
    bst_frame_stack *s = r->stack;
    if (box[2] < LEAST_SIDE || box[3] < LEAST_SIDE) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "%.400s: a %s frame of %d x %d pixels (allowed: sides of %d or more)",
                        f->path, r->kind, box[2], box[3], LEAST_SIDE);
    }
    s->width = box[2];
    s->height = box[3];
    s->overscan_width = overscan_width;
    s->exposure_s = f->values.exposure_s;
    s->gain_e_per_dn = f->values.gain_e_per_dn;
    s->integer = true;
    r->first_start = f->values.start;
    size_t pixels = (size_t)s->width * (size_t)s->height;
    s->levels = calloc((size_t)frames, sizeof *s->levels);
    s->mean = calloc(pixels, sizeof *s->mean);
    s->last = calloc(pixels, sizeof *s->last);
    s->overscan = calloc((size_t)overscan_width * (size_t)s->height + 1, sizeof *s->overscan);
    r->sum = calloc(pixels, sizeof *r->sum);
    r->before = calloc(pixels, sizeof *r->before);
    r->scratch = calloc(pixels, sizeof *r->scratch);
    r->rows = calloc((size_t)s->height, sizeof *r->rows);
    r->hit = calloc(pixels, sizeof *r->hit);
    return s->levels && s->mean && s->last && s->overscan && r->sum && r->before && r->scratch &&
                   r->rows && r->hit
               ? BST_OK
               : bst_fail(ctx, BST_ERR_MEMORY, "no memory for frames of %d x %d pixels", s->width,
                          s->height);
}

/* Checks that a frame belongs to the others. */
static bst_status check_frame(bst_ctx *ctx, const reduction *r, const bst_recorded_frame *f,
                              const int box[4]) {
    const bst_frame_stack *s = r->stack;
    char where[BST_FRAME_WHERE_TEXT];
    (void)bst_frame_where(f->path, &f->place, where);
    if (box[2] != s->width || box[3] != s->height) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "%s: %d x %d pixels, those of the first %s frame are %d x %d "
                        "(allowed: frames of one size)",
                        where, box[2], box[3], r->kind, s->width, s->height);
    }
    if (fabs(f->values.exposure_s - s->exposure_s) > 1e-3 * s->exposure_s + 1e-6) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "%s: %s gives %g s, the first %s frame has %g s (allowed: %s "
                        "frames of one exposure); give the others to another run",
                        where, r->map->exposure_s.keyword, f->values.exposure_s, r->kind,
                        s->exposure_s, r->kind);
    }
    return BST_OK;
}

/* Copies a part of an image of `width` columns, in the camera's order of rows. */
static void cut_out(const float *image, int width, const int box[4], bool flip_rows, float *to) {
    for (int y = 0; y < box[3]; y++) {
        int row = flip_rows ? box[3] - 1 - y : y;
        memcpy(to + (size_t)y * (size_t)box[2],
               image + (size_t)(box[1] + row) * (size_t)width + (size_t)box[0],
               (size_t)box[2] * sizeof *to);
    }
}

/* First row or column of a block. */
static int block_edge(int index, int length) {
    return (int)((int64_t)index * length / BST_STACK_SIDE);
}

/* Adds the covariance along a row between two frames, outliers left out. White noise has none: it
 * is that of pick-up. d: scratch, [width] */
static void add_covariance(bst_frame_stack *s, const float *a, const float *b,
                           const bst_clipped_moments *m, float *d) {
    for (int x = 0; x < s->width; x++) {
        double v = (double)b[x] - (double)a[x];
        d[x] = v >= m->low && v <= m->high ? (float)(v - m->mean) : 0.0F;
    }
    for (int lag = 1; lag <= BST_STACK_LAGS; lag++) {
        double sum = 0.0;
        for (int x = lag; x < s->width; x++) {
            sum += (double)(d[x] * d[x - lag]);
        }
        s->covariance[lag - 1] += 0.5 * sum / (s->width - lag) / s->height;
    }
}

/* True if a pixel or one beside it is part of a radiation hit. */
static bool near_hit(const reduction *r, int x, int y) {
    for (int k = 0; k < 9; k++) {
        int u = x + k % 3 - 1, v = y + k / 3 - 1;
        if (u >= 0 && v >= 0 && u < r->stack->width && v < r->stack->height &&
            r->hit[(size_t)v * (size_t)r->stack->width + (size_t)u]) {
            return true;
        }
    }
    return false;
}

/* Variance of the difference of two frames in a block, rows levelled.
 *
 * Given:     hits  pixels of radiation hits are left out
 * Returned:  *hot    level above which a pixel is hot
 *            *level  mean of the others */
static double variance_of(reduction *r, int block, bool hits, double *hot, double *level) {
    const bst_frame_stack *s = r->stack;
    size_t width = (size_t)s->width, n = 0;
    int x0 = block_edge(block % BST_STACK_SIDE, s->width),
        x1 = block_edge(block % BST_STACK_SIDE + 1, s->width);
    int y0 = block_edge(block / BST_STACK_SIDE, s->height),
        y1 = block_edge(block / BST_STACK_SIDE + 1, s->height);
    for (int y = y0; y < y1; y++) {
        for (int x = x0; x < x1; x++) {
            size_t i = (size_t)y * width + (size_t)x;
            r->scratch[n++] = s->last[i] + r->before[i];
        }
    }
    /* dead and hot pixels have other noise; the sum is independent of the difference */
    bst_clipped_moments sum = bst_clipped_moments_of(r->scratch, n, CLIP);
    n = 0;
    for (int y = y0; y < y1; y++) {
        for (int x = x0; x < x1; x++) {
            size_t i = (size_t)y * width + (size_t)x;
            double both = (double)s->last[i] + (double)r->before[i];
            if (both >= sum.low && both <= sum.high && !(hits && near_hit(r, x, y))) {
                r->scratch[n++] = s->last[i] - r->before[i] - (float)r->rows[y];
            }
        }
    }
    *hot = 0.5 * sum.high;
    *level = 0.5 * sum.mean;
    double freedom = 1.0 - 1.0 / s->width; /* the row's mean is of the same pixels */
    return bst_clipped_moments_of(r->scratch, n, CLIP).variance / freedom;
}

/* Takes the charge of radiation hits out of the sum: the other frame of the pair has none. */
static void remove_hits(reduction *r) {
    const bst_frame_stack *s = r->stack;
    for (size_t i = 0; i < (size_t)s->width * (size_t)s->height; i++) {
        if (r->hit[i]) {
            double row = r->rows[i / (size_t)s->width];
            r->sum[i] -= fabs((double)s->last[i] - (double)r->before[i] - row);
        }
    }
}

/* Adds the covariance of neighbours between two frames, without outliers and radiation hits. */
static void add_neighbours(reduction *r, const double *sigma, bool hits) {
    bst_frame_stack *s = r->stack;
    for (int y = 0; y < s->height; y++) {
        for (int x = 0; x < s->width; x++) {
            size_t i = (size_t)y * (size_t)s->width + (size_t)x;
            int block = bst_stack_block_of(x, y, s->width, s->height);
            float d = s->last[i] - r->before[i] - (float)r->rows[y];
            bool out = fabsf(d) > (float)(CLIP * sigma[block]) || (hits && near_hit(r, x, y));
            r->scratch[i] = out ? NAN : d;
        }
    }
    bst_neighbour_covariance_add(&s->neighbours, r->scratch, s->width, s->height);
}

/* Adds the variance between two frames: rows are levelled, so that noise common to a row is
 * separate. */
static bst_status add_pair(bst_ctx *ctx, reduction *r) {
    bst_frame_stack *s = r->stack;
    double hot[BST_STACK_BLOCKS], sigma[BST_STACK_BLOCKS], variance[BST_STACK_BLOCKS],
        level[BST_STACK_BLOCKS];
    double rows2 = 0.0, within = 0.0, mean = 0.0;
    size_t width = (size_t)s->width;
    for (int y = 0; y < s->height; y++) {
        const float *a = r->before + (size_t)y * width, *b = s->last + (size_t)y * width;
        for (size_t x = 0; x < width; x++) {
            r->scratch[x] = b[x] - a[x];
        }
        bst_clipped_moments m = bst_clipped_moments_of(r->scratch, width, CLIP);
        r->rows[y] = m.mean;
        add_covariance(s, a, b, &m, r->scratch);
        within += m.variance / (double)width / s->height;
        mean += m.mean / s->height;
    }
    for (int y = 0; y < s->height; y++) {
        rows2 += (r->rows[y] - mean) * (r->rows[y] - mean) / (s->height - 1);
    }
    s->row_variance += 0.5 * (rows2 - within);
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        variance[k] = variance_of(r, k, false, &hot[k], &level[k]);
        sigma[k] = sqrt(variance[k]);
    }
    /* of a million pixels 0.002 pass 6 standard deviations by noise. In flats hits are only left
     * out, and few pass the shot noise: 4 standard deviations lose 0.1 % of the variance */
    bool flat = strcmp(r->kind, "flat") == 0;
    const bst_hit_pair pair = {s->width,
                               s->height,
                               r->before,
                               s->last,
                               r->rows,
                               hot,
                               level,
                               sigma,
                               s->gain_e_per_dn,
                               BST_STACK_SIDE,
                               flat ? FLAT_SEED : SEED,
                               flat ? FLAT_GROW : GROW};
    size_t found = s->hits.used;
    BST_TRY(bst_radiation_hits_add(ctx, &pair, r->hit, &s->hits));
    bool hits = s->hits.used > found;
    for (int k = 0; k < BST_STACK_BLOCKS; k++) {
        s->variance[k] += 0.5 * (hits ? variance_of(r, k, true, &hot[k], &level[k]) : variance[k]);
    }
    add_neighbours(r, sigma, hits);
    if (hits) {
        remove_hits(r);
    }
    s->pairs++;
    return BST_OK;
}

/* Reads a frame and adds it to the sums. */
static bst_status add_frame(bst_ctx *ctx, reduction *r, int64_t index, int frames) {
    const bst_recorded_options options = {.map = &r->whole};
    bst_recorded_frame f;
    const float *image;
    int box[4], bias[4];
    BST_TRY(bst_recorded_frames_select(ctx, r->recorded, index, &options, &f));
    bst_frame_source *source = bst_recorded_frames_source(r->recorded);
    BST_TRY(bst_keyword_section(ctx, r->map->image_section, source, &f.place, box));
    BST_TRY(bst_keyword_section(ctx, r->map->bias_section, source, &f.place, bias));
    if (box[2] == 0) {
        box[2] = f.width;
        box[3] = f.height;
    }
    /* an overscan of columns beside all rows; others are not used */
    bool beside = bias[2] > 0 && bias[1] == box[1] && bias[3] == box[3];
    if (r->stack->count == 0) {
        BST_TRY(make_room(ctx, r, &f, box, beside ? bias[2] : 0, frames));
    }
    BST_TRY(check_frame(ctx, r, &f, box));
    BST_TRY(bst_recorded_frames_pixels(ctx, r->recorded, &options, &f, &image));
    bst_frame_stack *s = r->stack;
    bool flip_rows = r->map->first_row == BST_KEYWORD_BOTTOM;
    size_t pixels = (size_t)s->width * (size_t)s->height;
    cut_out(image, f.width, box, flip_rows, s->last);
    if (beside && bias[2] == s->overscan_width) {
        cut_out(image, f.width, bias, flip_rows, s->overscan);
    }
    for (size_t i = 0; i < pixels; i++) {
        s->integer = s->integer && (isnan(s->last[i]) || s->last[i] == floorf(s->last[i]));
        r->sum[i] += s->last[i];
        r->scratch[i] = s->last[i];
    }
    s->levels[s->count] = bst_clipped_moments_of(r->scratch, pixels, CLIP).mean;
    s->start_s = bst_time_diff(f.values.start, r->first_start);
    if (s->count % 2 == 1) {
        BST_TRY(add_pair(ctx, r));
    }
    memcpy(r->before, s->last, pixels * sizeof *r->before);
    s->count++;
    return BST_OK;
}

static bst_status reduce(bst_ctx *ctx, reduction *r, int64_t first, int64_t frames) {
    bst_frame_stack *s = r->stack;
    if (frames > MOST_FRAMES) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%lld %s frames were given (allowed: %d)",
                        (long long)frames, r->kind, MOST_FRAMES);
    }
    for (int64_t i = first; i < first + frames; i++) {
        if (bst_stop_requested()) {
            return bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted");
        }
        BST_TRY(add_frame(ctx, r, i, (int)frames));
    }
    size_t pixels = (size_t)s->width * (size_t)s->height;
    for (size_t i = 0; i < pixels; i++) {
        s->mean[i] = (float)(r->sum[i] / s->count);
    }
    for (int k = 0; k < BST_STACK_BLOCKS && s->pairs > 0; k++) {
        s->variance[k] /= s->pairs;
    }
    for (int k = 0; k < BST_STACK_LAGS && s->pairs > 0; k++) {
        s->covariance[k] /= s->pairs;
    }
    s->row_variance = s->pairs > 0 ? s->row_variance / s->pairs : NAN;
    return BST_OK;
}

bst_status bst_frame_stack_reduce(bst_ctx *ctx, const char *kind, bst_recorded_frames *recorded,
                                  int64_t first, int64_t count, const bst_keyword_map *map,
                                  bst_frame_stack *out) {
    assert(kind && recorded && first >= 0 && count > 0 && map && out);
    *out = (bst_frame_stack){0};
    reduction r = {.kind = kind, .map = map, .whole = *map, .recorded = recorded, .stack = out};
    r.whole.image_section[0] = r.whole.bias_section[0] = '\0';
    r.whole.first_row = BST_KEYWORD_TOP; /* sections are of the file's rows */
    bst_status status = reduce(ctx, &r, first, count);
    free(r.sum);
    free(r.before);
    free(r.scratch);
    free(r.rows);
    free(r.hit);
    return status;
}

bst_status bst_frame_stack_read(bst_ctx *ctx, const char *kind, const char *const *paths, int count,
                                const bst_keyword_map *map, bst_frame_stack *out) {
    assert(kind && paths && count > 0 && map && out);
    *out = (bst_frame_stack){0};
    bst_recorded_frames *recorded = NULL;
    bst_status status = bst_recorded_frames_open(ctx, paths, count, map, &recorded);
    if (status == BST_OK) {
        status = bst_frame_stack_reduce(ctx, kind, recorded, 0, bst_recorded_frames_count(recorded),
                                        map, out);
    }
    bst_recorded_frames_close(recorded);
    return status;
}
