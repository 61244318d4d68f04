#include "imgproc/calibrate/columns.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/optics/column_level.h"

enum {
    FIRST_ROWS = BST_COLUMN_LEVEL_LEAST_ROWS,
    MOST_ROWS = BST_COLUMN_LEVEL_MOST_ROWS,
    BLOCK = 64
};

static const double CLIP_SIGMAS = 3.0;
/* Share of the full well above which blooming, not smear, dominates the median of a column. */
static const double FULL_SHARE = 0.5;

bst_status bst_columns_create(bst_ctx *ctx, int width, bst_columns *out) {
    *out = (bst_columns){.capacity = width};
    out->level_e = calloc((size_t)width, sizeof(float));
    out->noise = calloc((size_t)width, sizeof(float));
    out->ordered = calloc((size_t)width, sizeof(float));
    if (!out->level_e || !out->noise || !out->ordered) {
        bst_columns_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the levels of %d columns", width);
    }
    return BST_OK;
}

void bst_columns_free(bst_columns *columns) {
    free(columns->level_e);
    free(columns->noise);
    free(columns->ordered);
    *columns = (bst_columns){0};
}

/* qsort order of pixel values, ascending. */
static int by_value(const void *a, const void *b) {
    float p = *(const float *)a, q = *(const float *)b;
    return (p > q) - (p < q);
}

static float median_of(float *values, int count) {
    qsort(values, (size_t)count, sizeof values[0], by_value);
    return values[count / 2];
}

typedef struct measuring {
    bst_columns *columns;
    const bst_camera *camera;
    const bst_imgproc_frame *frame;
    int width, height;
} measuring;

/* Electrons of a binned pixel above the camera's offset. */
static double electrons(const measuring *m, double dn) {
    return (dn - m->camera->offset_dn) * m->camera->gain_e_per_dn;
}

/* Start value of each column's level: the median of FIRST_ROWS rows, DN. */
static void median_column_levels(const measuring *m, int x0, int count, float *level) {
    for (int i = 0; i < count; i++) {
        float few[FIRST_ROWS];
        for (int k = 0; k < FIRST_ROWS; k++) {
            size_t y = (size_t)((2 * k + 1) * m->height / (2 * FIRST_ROWS));
            few[k] = (float)m->frame->pixels[y * (size_t)m->width + (size_t)(x0 + i)];
        }
        level[i] = median_of(few, FIRST_ROWS);
    }
}

/* Sigma-clips the rows of each column about `level`, DN, and replaces `level` by their mean. */
static void clip_column_levels(const measuring *m, int x0, int count, float *level) {
    const bst_camera *c = m->camera;
    const double read_e = bst_camera_read_noise_e(c);
    float limit[BLOCK], sum[BLOCK] = {0}, kept[BLOCK] = {0};
    for (int i = 0; i < count; i++) {
        double variance = read_e * read_e + fmax(electrons(m, (double)level[i]), 0.0) +
                          c->gain_e_per_dn * c->gain_e_per_dn / 12.0;
        /* one ADC step wider on either side, so that at least one digital value lies inside */
        limit[i] = (float)(CLIP_SIGMAS * sqrt(variance) / c->gain_e_per_dn + 1.0);
    }
    int rows = m->height < MOST_ROWS ? m->height : MOST_ROWS;
    for (int k = 0; k < rows; k++) {
        size_t y = (size_t)((int64_t)k * m->height / rows);
        const uint16_t *row = m->frame->pixels + y * (size_t)m->width + (size_t)x0;
        for (int i = 0; i < count; i++) {
            float off = (float)row[i] - level[i], in = fabsf(off) <= limit[i] ? 1.0f : 0.0f;
            sum[i] += in * off;
            kept[i] += in;
        }
    }
    for (int i = 0; i < count; i++) {
        level[i] += kept[i] > 0.0f ? sum[i] / kept[i] : 0.0f;
    }
}

/* Column levels of blocks begin to end - 1, e- (loop body of bst_parallel_for). */
static void measure_column_blocks(void *user, int begin, int end) {
    const measuring *m = user;
    for (int b = begin; b < end; b++) {
        float level[BLOCK];
        int x0 = b * BLOCK, count = m->width - x0 < BLOCK ? m->width - x0 : BLOCK;
        median_column_levels(m, x0, count, level);
        clip_column_levels(m, x0, count, level);
        clip_column_levels(m, x0, count, level);
        for (int i = 0; i < count; i++) {
            m->columns->level_e[x0 + i] = (float)electrons(m, (double)level[i]);
        }
    }
}

void bst_columns_measure(bst_columns *columns, bst_parallel *pool, const bst_camera *camera,
                         const bst_imgproc_frame *frame) {
    assert(columns && camera && frame && frame->pixels);
    int b = frame->binning;
    measuring m = {columns, camera, frame, frame->window.width / b, frame->window.height / b};
    double well = bst_camera_full_e(camera) * b * b;
    columns->count = m.width;
    memset(columns->level_e, 0, (size_t)m.width * sizeof(float));
    if (m.height >= FIRST_ROWS) {
        bst_parallel_for(pool, (m.width + BLOCK - 1) / BLOCK, 1, measure_column_blocks, &m);
    }
    memcpy(columns->ordered, columns->level_e, (size_t)m.width * sizeof(float));
    columns->median_e = median_of(columns->ordered, m.width);
    double read_e = bst_camera_read_noise_e(camera);
    double quiet = read_e * read_e + fmax((double)columns->median_e, 0.0) +
                   camera->gain_e_per_dn * camera->gain_e_per_dn / 12.0;
    bool smeared = camera->detector.frame_transfer_s > 0.0;
    for (int x = 0; x < m.width; x++) {
        double over = (double)columns->level_e[x] - (double)columns->median_e;
        over = over > FULL_SHARE * well ? 0.0 : over;
        columns->level_e[x] = (float)over;
        columns->noise[x] = (float)sqrt(1.0 + (smeared ? fmax(over, 0.0) / quiet : 0.0));
    }
}
