#include "imgproc/streak/streak_map.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/detect/filter.h"
#include "imgproc/detect/row_kernels.h"

/* CLAMP_SIGMA: brighter pixels are limited, so that a point contributes little to a sum over many
 * rows */
enum { BAND = 64, TURN = 32, CLAMP_SIGMA = 5 };
static const float SUM_BOUND = 6.0f;

static size_t plane_size(int width, int height) {
    return (size_t)(width + 2 * BST_STREAK_PAD) * (size_t)(height + 2 * BST_STREAK_PAD);
}

bst_status bst_streak_map_create(bst_ctx *ctx, int max_width, int max_height, bool turned,
                                 bst_streak_map *out) {
    *out = (bst_streak_map){.max_width = max_width, .max_height = max_height};
    out->bands = max_height / BAND + 1;
    size_t line = (size_t)max_width + 2 * BST_FILTER_MAX_RADIUS;
    /* work rows: normalised, level, inverse noise, sum, ring */
    out->lines_per_band = line * (2 * BST_FILTER_MAX_RADIUS + 1 + 4);
    out->lines = calloc(out->lines_per_band * (size_t)out->bands, sizeof(float));
    out->memory[0] = calloc(plane_size(max_width, max_height), sizeof(int16_t));
    out->memory[1] = turned ? calloc(plane_size(max_width, max_height), sizeof(int16_t)) : NULL;
    if (!out->lines || !out->memory[0] || (turned && !out->memory[1])) {
        bst_streak_map_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory to search a %d x %d frame", max_width,
                        max_height);
    }
    return BST_OK;
}

void bst_streak_map_free(bst_streak_map *map) {
    free(map->lines);
    free(map->memory[0]);
    free(map->memory[1]);
    *map = (bst_streak_map){0};
}

/* Sets the Gaussian kernel of the map's filter. */
static void set_kernel(bst_streak_map *map, double sigma) {
    map->sigma_px = sigma;
    map->radius = (int)fmax(1.0, fmin(ceil(3.2 * sigma), BST_FILTER_MAX_RADIUS));
    double share[2 * BST_FILTER_MAX_RADIUS + 1], square = 0.0;
    int taps = 2 * map->radius + 1;
    for (int i = 0; i < taps; i++) {
        double root = sigma * sqrt(2.0), d = i - map->radius;
        share[i] = 0.5 * (erf((d + 0.5) / root) - erf((d - 0.5) / root));
        square += share[i] * share[i];
    }
    memset(map->kernel, 0, sizeof map->kernel);
    memset(map->correlation, 0, sizeof map->correlation);
    for (int i = 0; i < taps; i++) {
        map->kernel[i] = (float)(share[i] / sqrt(square));
        for (int k = 0; k + i < taps; k++) {
            map->correlation[k] += share[i] * share[i + k] / square;
        }
    }
}

typedef struct fill_job {
    bst_streak_map *map;
    const float *signal;
    float *sum; /* sum of each pixel's own SNR; NULL: not wanted */
    const bst_background *background;
} fill_job;

/* Adds values limited to SUM_BOUND: one bright pixel of one frame must not dominate the sum. */
static void add_bounded(float *restrict sum, const float *restrict values, int count) {
    for (int x = 0; x < count; x++) {
        float v = values[x] > SUM_BOUND ? SUM_BOUND : values[x];
        sum[x] += v < -SUM_BOUND ? -SUM_BOUND : v;
    }
}

/* Filters one band of rows with the separable kernel. */
static void filter_band(const fill_job *job, int band) {
    bst_streak_map *map = job->map;
    int width = map->width, height = map->height, r = map->radius, taps = 2 * r + 1;
    int padded = (taps + 3) / 4 * 4;
    int first = band * BAND, last = first + BAND < height ? first + BAND : height;
    size_t line = (size_t)map->max_width + 2 * BST_FILTER_MAX_RADIUS;
    float *normalised = map->lines + map->lines_per_band * (size_t)band;
    float *level = normalised + line, *inverse = level + line, *sum = inverse + line;
    float *ring = sum + line;
    memset(normalised, 0, line * sizeof(float));
    const float *in[64];
    float clamp = (float)map->clamp, floor = -6.0f * (float)BST_STREAK_QUANTA;
    for (int y = first - r; y < last + r; y++) {
        float *horizontal = ring + line * (size_t)((y + 64 * taps) % taps);
        if (y >= 0 && y < height) {
            const float *signal = job->signal + (size_t)y * (size_t)width;
            bst_background_row(job->background, y, level, inverse);
            for (int x = 0; x < width; x++) {
                float v = signal[x] * inverse[x];
                normalised[r + x] = signal[x] > BST_PIXEL_NONE ? v : 0.0f;
            }
            if (job->sum && y >= first && y < last) {
                add_bounded(job->sum + (size_t)y * (size_t)width, normalised + r, width);
            }
            for (int t = 0; t < padded; t++) {
                in[t] = normalised + (t < taps ? t : 0);
            }
            bst_row_combine(horizontal, width, in, map->kernel, padded);
        } else {
            memset(horizontal, 0, (size_t)width * sizeof(float));
        }
        int centre = y - r;
        if (centre < first) {
            continue;
        }
        for (int t = 0; t < padded; t++) {
            int source = centre - r + (t < taps ? t : 0);
            in[t] = ring + line * (size_t)((source + 64 * taps) % taps);
        }
        bst_row_combine(sum, width, in, map->kernel, padded);
        int16_t *out =
            map->memory[0] + (long)(centre + BST_STREAK_PAD) * map->stride[0] + BST_STREAK_PAD;
        for (int x = 0; x < width; x++) {
            float v = sum[x] * (float)BST_STREAK_QUANTA;
            v = v < floor ? floor : v > clamp ? clamp : v;
            out[x] = (int16_t)(int)(v + 4096.5f) - 4096;
        }
    }
}

static void fill_bands(void *user, int begin, int end) {
    for (int band = begin; band < end; band++) {
        filter_band(user, band);
    }
}

/* Writes rows of the second (transposed) plane, in squares that fit the cache. */
static void transpose_band(void *user, int begin, int end) {
    bst_streak_map *map = user;
    long from = map->stride[0], to = map->stride[1];
    const int16_t *in = bst_streak_map_plane(map, 0);
    int16_t *out = map->memory[1] + BST_STREAK_PAD * to + BST_STREAK_PAD;
    for (int band = begin; band < end; band++) {
        int x1 = (band + 1) * TURN < map->width ? (band + 1) * TURN : map->width;
        for (int y0 = 0; y0 < map->height; y0 += TURN) {
            int y1 = y0 + TURN < map->height ? y0 + TURN : map->height;
            for (int x = band * TURN; x < x1; x++) {
                for (int y = y0; y < y1; y++) {
                    out[x * to + y] = in[y * from + x];
                }
            }
        }
    }
}

void bst_streak_map_filter(bst_streak_map *map, bst_parallel *pool,
                           const bst_streak_map_input *input, int clamp, float *sum) {
    const int width = input->width, height = input->height;
    if (map->width != width || map->height != height) {
        map->width = width;
        map->height = height;
        map->stride[0] = width + 2 * BST_STREAK_PAD;
        map->stride[1] = height + 2 * BST_STREAK_PAD;
        for (int plane = 0; plane < 2; plane++) {
            if (map->memory[plane]) {
                memset(map->memory[plane], 0, plane_size(width, height) * sizeof(int16_t));
            }
        }
    }
    map->clamp = clamp;
    set_kernel(map, input->sigma_px);
    fill_job job = {map, input->signal, sum, input->background};
    bst_parallel_for(pool, (height + BAND - 1) / BAND, 1, fill_bands, &job);
}

void bst_streak_map_fill(bst_streak_map *map, bst_parallel *pool,
                         const bst_streak_map_input *input) {
    bst_streak_map_filter(map, pool, input, CLAMP_SIGMA * BST_STREAK_QUANTA, NULL);
    bst_parallel_for(pool, (input->width + TURN - 1) / TURN, 1, transpose_band, map);
}

/* Sets a plane to zero within a strip about a segment. */
static void mask_segment(bst_streak_map *map, int plane, double x0, double y0, double x1, double y1,
                         double radius) {
    int width = plane ? map->height : map->width, height = plane ? map->width : map->height;
    double ux = x1 - x0, uy = y1 - y0, square = ux * ux + uy * uy;
    int top = (int)fmax(ceil(fmin(y0, y1) - radius), 0.0);
    int bottom = (int)fmin(floor(fmax(y0, y1) + radius), height - 1.0);
    int left = (int)fmax(ceil(fmin(x0, x1) - radius), 0.0);
    int right = (int)fmin(floor(fmax(x0, x1) + radius), width - 1.0);
    for (int y = top; y <= bottom; y++) {
        int16_t *row =
            map->memory[plane] + (long)(y + BST_STREAK_PAD) * map->stride[plane] + BST_STREAK_PAD;
        for (int x = left; x <= right; x++) {
            double px = x - x0, py = y - y0;
            double t = square > 0.0 ? (px * ux + py * uy) / square : 0.0;
            t = fmax(0.0, fmin(t, 1.0));
            double dx = px - t * ux, dy = py - t * uy;
            if (dx * dx + dy * dy <= radius * radius) {
                row[x] = 0;
            }
        }
    }
}

void bst_streak_map_blank(bst_streak_map *map, double x0, double y0, double x1, double y1,
                          double radius_px) {
    mask_segment(map, 0, x0, y0, x1, y1, radius_px);
    mask_segment(map, 1, y0, x0, y1, x1, radius_px);
}
