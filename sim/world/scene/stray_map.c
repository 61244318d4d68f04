#include "sim/world/scene/stray_map.h"

#include <assert.h>
#include <stdlib.h>

struct bst_stray_map {
    int columns, rows;
    int block_x, block_y; /* sensor pixels of a block */
    float scale;
    float *value; /* [rows][columns] */
};

static bst_status check_size(bst_ctx *ctx, const bst_camera *camera, int width, int height) {
    if (width < 1 || height < 1 || camera->width_px % width != 0 ||
        camera->height_px % height != 0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "the map has %d x %d pixels, the sensor %lld x %lld; allowed is the "
                        "sensor's size, or a whole part of it per axis",
                        width, height, (long long)camera->width_px, (long long)camera->height_px);
    }
    return BST_OK;
}

static bst_status check_values(bst_ctx *ctx, int width, int height, const float *pixels) {
    for (size_t i = 0; i < (size_t)width * (size_t)height; i++) {
        if (!(pixels[i] >= 0.0f && pixels[i] <= 1e12f)) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "the map has %g at pixel (%zu, %zu) from 0; allowed are 0 to 1e12",
                            (double)pixels[i], i % (size_t)width, i / (size_t)width);
        }
    }
    return BST_OK;
}

bst_status bst_stray_map_create(bst_ctx *ctx, const bst_camera *camera, int width, int height,
                                float *pixels, bst_stray_map **out) {
    assert(camera && pixels && out);
    const bst_background_config *c = &camera->background;
    *out = NULL;
    bst_status status = check_size(ctx, camera, width, height);
    if (status == BST_OK) {
        status = check_values(ctx, width, height, pixels);
    }
    if (status == BST_OK && c->stray_map == BST_STRAY_MAP_SHARE &&
        !(c->model == BST_BACKGROUND_SKY && camera->pst)) {
        status = bst_fail(ctx, BST_ERR_CONFIG,
                          "stray_map is \"share\", but there is no stray light of Sun, Moon and "
                          "Earth to share out; give model \"sky\" and pst or pst_file");
    }
    bst_stray_map *map = status == BST_OK ? malloc(sizeof *map) : NULL;
    if (!map) {
        free(pixels);
        return status != BST_OK ? status
                                : bst_fail(ctx, BST_ERR_MEMORY, "no memory for a map of light");
    }
    *map = (bst_stray_map){.columns = width,
                           .rows = height,
                           .block_x = (int)camera->width_px / width,
                           .block_y = (int)camera->height_px / height,
                           .scale = (float)c->stray_map_scale,
                           .value = pixels};
    *out = map;
    return BST_OK;
}

void bst_stray_map_free(bst_stray_map *map) {
    if (map) {
        free(map->value);
        free(map);
    }
}

/* Block below a position and the part of the way to the next one. */
static int block_of(double at_px, int block, int count, double *part) {
    double u = (at_px - 0.5 * (block - 1)) / block;
    int i = (int)floor(u);
    i = i < 0 ? 0 : i > count - 2 ? count - 2 : i;
    i = i < 0 ? 0 : i;
    *part = count > 1 ? fmin(fmax(u - i, 0.0), 1.0) : 0.0;
    return i;
}

double bst_stray_map_at(const bst_stray_map *m, double x_px, double y_px) {
    double s, t;
    int i = block_of(x_px, m->block_x, m->columns, &s);
    int j = block_of(y_px, m->block_y, m->rows, &t);
    int right = m->columns > 1 ? 1 : 0;
    const float *a = m->value + (size_t)j * (size_t)m->columns + i;
    const float *b = m->rows > 1 ? a + m->columns : a;
    double left = (double)a[0] + t * ((double)b[0] - (double)a[0]);
    double far = (double)a[right] + t * ((double)b[right] - (double)a[right]);
    return (double)m->scale * (left + s * (far - left));
}

void bst_stray_map_add_row(const bst_stray_map *m, int x0_px, int y_px, int count, float factor,
                           float *sum) {
    assert(x0_px >= 0 && x0_px + count <= m->columns * m->block_x && sum);
    factor *= m->scale;
    if (m->block_x == 1 && m->block_y == 1) {
        const float *row = m->value + (size_t)y_px * (size_t)m->columns + x0_px;
        for (int x = 0; x < count; x++) {
            sum[x] += factor * row[x];
        }
        return;
    }
    double t;
    int j = block_of(y_px, m->block_y, m->rows, &t), right = m->columns > 1 ? 1 : 0;
    const float *above = m->value + (size_t)j * (size_t)m->columns;
    const float *below = m->rows > 1 ? above + m->columns : above;
    float v = (float)t;
    double half = 0.5 * (m->block_x - 1);
    for (int x = 0, end; x < count; x = end) { /* between the middles of two blocks at a time */
        double part;
        int i = block_of(x0_px + x, m->block_x, m->columns, &part);
        float left = above[i] + v * (below[i] - above[i]);
        float far = above[i + right] + v * (below[i + right] - above[i + right]);
        float slope = (far - left) / (float)m->block_x, low = fminf(left, far);
        float high = fmaxf(left, far), from = (float)(i * m->block_x + half - x0_px);
        end = (int)ceil((i + 1) * m->block_x + half) - x0_px;
        end = i + 2 >= m->columns || end > count ? count : end;
        for (int k = x; k < end; k++) { /* constant beyond the outermost middles */
            float value = left + slope * ((float)k - from);
            sum[k] += factor * fminf(fmaxf(value, low), high);
        }
    }
}
