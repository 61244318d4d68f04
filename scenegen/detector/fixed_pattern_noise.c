#include "scenegen/detector/fixed_pattern_noise.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/file.h"
#include "sim/io/fits_image.h"

enum {
    DRAW_GAIN,
    DRAW_DEAD,
    DRAW_DARK,
    DRAW_HOT,
    DRAW_HOT_RATE,
    DRAW_COLUMN,
    DRAW_COLUMN_ROW,
    DRAW_COLUMN_OFFSET,
    DRAW_ROW_OFFSET
};

static bool has_edges(const bst_detector_edges_config *e) {
    return e->left > 0 || e->right > 0 || e->bottom > 0 || e->top > 0;
}

/* Sets the pixels at the edges of a map to 0. */
static void clear_edges(const bst_camera *camera, const bst_detector_edges_config *e, int stride,
                        float *map) {
    for (int y = 0; y < camera->height_px; y++) {
        bool row = y < e->bottom || y >= camera->height_px - e->top;
        for (int x = 0; x < camera->width_px; x++) {
            if (row || x < e->left || x >= camera->width_px - e->right) {
                map[(size_t)y * (size_t)stride + (size_t)x] = 0.0f;
            }
        }
    }
}

bool bst_fixed_pattern_noise_has_gain(const bst_camera *camera) {
    const bst_detector_config *d = &camera->detector;
    return d->prnu_rms > 0.0 || d->prnu_map[0] || d->dead_fraction > 0.0 || d->bad_columns > 0 ||
           has_edges(&d->shielded) || has_edges(&d->overscan);
}

bool bst_fixed_pattern_noise_has_dark(const bst_camera *camera) {
    const bst_detector_config *d = &camera->detector;
    return (d->dsnu_rms > 0.0 && camera->dark_current_e_per_s > 0.0) || d->dark_map[0] ||
           d->hot_fraction > 0.0 || (has_edges(&d->overscan) && camera->dark_current_e_per_s > 0.0);
}

/* Loads a FITS map of the sensor's size, finite and not negative, scaled by `factor`. */
static bst_status load_map(bst_ctx *ctx, const bst_camera *camera, const char *what,
                           const char *path, double factor, int stride, float *map) {
    int width, height;
    float *pixels;
    BST_TRY(bst_fits_read_image(ctx, path, &width, &height, &pixels));
    bst_status status = BST_OK;
    if (width != camera->width_px || height != camera->height_px) {
        status = bst_fail(ctx, BST_ERR_CONFIG,
                          "detector.%s: %s has %d x %d pixels, the sensor %lld x %lld", what, path,
                          width, height, (long long)camera->width_px, (long long)camera->height_px);
    }
    for (int y = 0; status == BST_OK && y < height; y++) {
        for (int x = 0; x < width; x++) {
            float v = pixels[(size_t)y * (size_t)width + (size_t)x];
            if (!(v >= 0.0f) || !isfinite(v)) {
                status = bst_fail(ctx, BST_ERR_CONFIG,
                                  "detector.%s: %s is %g at column %d, row %d (counted from 0); "
                                  "allowed are numbers from 0 on",
                                  what, path, (double)v, x, y);
                break;
            }
            map[(size_t)y * (size_t)stride + (size_t)x] = (float)(factor * (double)v);
        }
    }
    free(pixels);
    return status;
}

/* Rows of a map that are drawn in parallel: each pixel's numbers depend on its own counter. */
typedef struct map_job {
    const bst_camera *camera;
    bst_rng_key key;
    int stride;
    float *map;
} map_job;

/* Rows in a part of a parallel loop. */
enum { ROWS = 16 };

/* Number of pixels of a row from x on that are drawn in one block. */
static int block_pixels(int width, int x) {
    return width - x < BST_RNG_BLOCK ? width - x : BST_RNG_BLOCK;
}

static void gain_rows(void *user, int begin, int end) {
    const map_job *job = user;
    const bst_detector_config *d = &job->camera->detector;
    const int width = (int)job->camera->width_px;
    double z[BST_RNG_BLOCK] = {0}, u[BST_RNG_BLOCK];
    for (int y = begin; y < end; y++) {
        for (int x = 0; x < width; x += BST_RNG_BLOCK) {
            float *row = job->map + (size_t)y * (size_t)job->stride + x;
            uint64_t pixel = (uint64_t)y * (uint64_t)width + (uint64_t)x;
            const int pixels = block_pixels(width, x);
            if (!d->prnu_map[0]) {
                if (d->prnu_rms > 0.0) {
                    bst_rng_normal_draws(job->key, DRAW_GAIN, pixel, z);
                }
                for (int i = 0; i < pixels; i++) {
                    row[i] = (float)fmax(1.0 + d->prnu_rms * z[i], 0.0);
                }
            }
            if (d->dead_fraction > 0.0) {
                bst_rng_uniform_draws(job->key, DRAW_DEAD, pixel, u);
                for (int i = 0; i < pixels; i++) {
                    row[i] = u[i] < d->dead_fraction ? 0.0f : row[i];
                }
            }
        }
    }
}

bst_status bst_fixed_pattern_noise_gain(bst_ctx *ctx, const bst_camera *camera, bst_rng_key key,
                                        bst_parallel *pool, int stride, float *gain) {
    assert(camera && gain && stride >= (int)camera->width_px);
    const bst_detector_config *d = &camera->detector;
    int width = (int)camera->width_px, height = (int)camera->height_px;
    if (d->prnu_map[0]) {
        BST_TRY(load_map(ctx, camera, "prnu_map", d->prnu_map, 1.0, stride, gain));
    }
    map_job job = {camera, key, stride, gain};
    bst_parallel_for(pool, height, ROWS, gain_rows, &job);
    for (int64_t i = 0; i < d->bad_columns && i < camera->width_px; i++) {
        int x = (int)(bst_rng_uniform(key, DRAW_COLUMN, (uint64_t)i) * width);
        int first = (int)(bst_rng_uniform(key, DRAW_COLUMN_ROW, (uint64_t)i) * height);
        for (int y = first; y < height; y++) {
            gain[(size_t)y * (size_t)stride + (size_t)x] = 0.0f;
        }
    }
    clear_edges(camera, &d->shielded, stride, gain);
    clear_edges(camera, &d->overscan, stride, gain);
    return BST_OK;
}

static void dark_rows(void *user, int begin, int end) {
    const map_job *job = user;
    const bst_detector_config *d = &job->camera->detector;
    const int width = (int)job->camera->width_px;
    const double warm = bst_detector_dark_factor(d), mean = bst_camera_dark_e_per_s(job->camera);
    /* log-normal distribution of mean 1 */
    const double s2 = log1p(d->dsnu_rms * d->dsnu_rms), s = sqrt(s2);
    double z[BST_RNG_BLOCK] = {0}, u[BST_RNG_BLOCK];
    for (int y = begin; y < end; y++) {
        for (int x = 0; x < width; x += BST_RNG_BLOCK) {
            float *row = job->map + (size_t)y * (size_t)job->stride + x;
            uint64_t pixel = (uint64_t)y * (uint64_t)width + (uint64_t)x;
            const int pixels = block_pixels(width, x);
            if (!d->dark_map[0]) {
                if (s > 0.0) {
                    bst_rng_normal_draws(job->key, DRAW_DARK, pixel, z);
                }
                for (int i = 0; i < pixels; i++) {
                    row[i] = (float)(mean * exp(s * z[i] - 0.5 * s2));
                }
            }
            if (d->hot_fraction > 0.0) {
                bst_rng_uniform_draws(job->key, DRAW_HOT, pixel, u);
            }
            for (int i = 0; d->hot_fraction > 0.0 && i < pixels; i++) {
                if (u[i] < d->hot_fraction) {
                    double dex = d->hot_spread_dex *
                                 bst_rng_normal(job->key, DRAW_HOT_RATE, pixel + (uint64_t)i);
                    row[i] += (float)(warm * d->hot_median_e_per_s * pow(10.0, dex));
                }
            }
        }
    }
}

bst_status bst_fixed_pattern_noise_dark(bst_ctx *ctx, const bst_camera *camera, bst_rng_key key,
                                        bst_parallel *pool, int stride, float *dark) {
    assert(camera && dark && stride >= (int)camera->width_px);
    const bst_detector_config *d = &camera->detector;
    if (d->dark_map[0]) {
        BST_TRY(load_map(ctx, camera, "dark_map", d->dark_map, bst_detector_dark_factor(d), stride,
                         dark));
    }
    map_job job = {camera, key, stride, dark};
    bst_parallel_for(pool, (int)camera->height_px, ROWS, dark_rows, &job);
    clear_edges(camera, &d->overscan, stride, dark);
    return BST_OK;
}

void bst_fixed_pattern_noise_offsets(const bst_camera *camera, bst_rng_key key, const char *which,
                                     int count, float *offsets) {
    bool columns = strcmp(which, "columns") == 0;
    double rms = columns ? camera->detector.column_offset_rms_e : camera->detector.row_offset_rms_e;
    uint64_t draw = columns ? DRAW_COLUMN_OFFSET : DRAW_ROW_OFFSET;
    for (int i = 0; i < count; i++) {
        double z = rms > 0.0 ? bst_rng_normal(key, draw, (uint64_t)i) : 0.0;
        offsets[i] = (float)(rms * z / camera->gain_e_per_dn);
    }
}

/* Reads the first digital number of each code from the table file; starts: [65536]. */
static bst_status read_table(bst_ctx *ctx, const bst_camera *camera, int *starts, int *count) {
    const char *path = camera->detector.quantisation.table;
    char *text;
    size_t bytes;
    if (!path[0]) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "detector.quantisation: model \"table\" needs the key table: a file");
    }
    BST_TRY(bst_file_read(ctx, path, 1 << 20, "a table of codes", &text, &bytes));
    bst_status status = BST_OK;
    int top = 1 << camera->bits;
    char *at = text;
    *count = 0;
    for (int line = 1; status == BST_OK && *at; line++) {
        char *end;
        long start = strtol(at, &end, 10);
        while (*end == ' ' || *end == '\t' || *end == '\r') {
            end++;
        }
        bool blank = end == at || (*at == '\n' || *at == '#');
        if (blank && (*at == '#' || *at == '\n' || *at == '\r')) {
            at = strchr(at, '\n');
            at = at ? at + 1 : text + bytes;
            continue;
        }
        if (end == at || (*end && *end != '\n') || start >= top ||
            start < (*count ? starts[*count - 1] + 1 : 0) || (*count == 0 && start != 0)) {
            status = bst_fail(ctx, BST_ERR_CONFIG,
                              "detector.quantisation.table: %s, line %d is no first number of a "
                              "code: allowed are whole numbers from 0 to %d, increasing, the first "
                              "of them 0, one a line",
                              path, line, top - 1);
        } else {
            starts[(*count)++] = (int)start;
            at = *end ? end + 1 : end;
        }
    }
    if (status == BST_OK && *count == 0) {
        status =
            bst_fail(ctx, BST_ERR_CONFIG, "detector.quantisation.table: %s holds no code", path);
    }
    free(text);
    return status;
}

bst_status bst_fixed_pattern_noise_codes(bst_ctx *ctx, const bst_camera *camera, uint16_t *codes) {
    const bst_detector_quantisation_config *q = &camera->detector.quantisation;
    int top = 1 << camera->bits, count = 0;
    int *starts = malloc(65536 * sizeof *starts);
    if (!starts) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a table of codes");
    }
    bst_status status = BST_OK;
    if (q->model == BST_QUANTISE_TABLE) {
        status = read_table(ctx, camera, starts, &count);
        for (int dn = 0, code = 0; status == BST_OK && dn < top; dn++) {
            code += code + 1 < count && dn == starts[code + 1];
            codes[dn] = (uint16_t)code;
        }
    } else {
        double highest = (double)((1 << q->bits) - 1);
        for (int dn = 0; dn < top; dn++) {
            codes[dn] = (uint16_t)floor(highest * sqrt((double)dn / (top - 1)) + 0.5);
        }
    }
    for (int first = 0; status == BST_OK && q->expand && first < top;) {
        int end = first + 1;
        while (end < top && codes[end] == codes[first]) {
            end++;
        }
        uint16_t middle = (uint16_t)((first + end - 1) / 2);
        for (; first < end; first++) {
            codes[first] = middle;
        }
    }
    free(starts);
    return status;
}
