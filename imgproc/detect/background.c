#include "imgproc/detect/background.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/detect/row_kernels.h"
#include "imgproc/detect/simd_layout.h"
#include "imgproc/detect/truncated_moments.h"
#include "imgproc/value_of_rank.h"
#include "sim/core/pages.h"

/* least pixel noise, in ADC steps: the quantisation noise 1 / sqrt(12) */
static const float QUANTISATION = 0.28867513f;

enum {
    SAMPLE = 96,
    LEFT_SHARE = 16,
    CLIP_PASSES = 4,
    MANY_PX = 4096 /* a mesh of at least so many pixels is estimated from half of its rows */
};

/* The noise is far from normal below this many ADC steps, or above this skewness (counted electrons
 * over sigma cubed). */
static const float FEW_STEPS = 1.2f;
static const double MUCH_SKEW = 0.4;

/* Opposite neighbour meshes are averaged in if they agree to so many standard errors. */
static const float AGREEMENT = 4.0f;

/* Floats between rows of a band of meshes. It is no power of two, so that rows do not share cache
 * lines. */
static size_t band_stride(int width) {
    return (size_t)((width + BST_LANES - 1) / BST_LANES * BST_LANES + BST_LANES);
}

bst_status bst_background_create(bst_ctx *ctx, int mesh_px, int max_width, int max_height,
                                 int threads, bst_background *out) {
    assert(out && mesh_px > 0 && max_width > 0 && max_height > 0 && threads >= 0);
    *out = (bst_background){.mesh_px = mesh_px,
                            .max_columns = (max_width + mesh_px - 1) / mesh_px,
                            .max_rows = (max_height + mesh_px - 1) / mesh_px};
    size_t columns = (size_t)out->max_columns, meshes = columns * (size_t)out->max_rows;
    out->level = calloc(meshes, sizeof(float));
    out->noise = calloc(meshes, sizeof(float));
    out->error = calloc(meshes, sizeof(float));
    out->left = calloc(meshes, sizeof(int));
    out->read = calloc(meshes, sizeof(int));
    out->scratch = calloc(2 * meshes, sizeof(float));
    /* the last mesh of an axis may be half as long again */
    size_t height = (size_t)(mesh_px + mesh_px / 2 + 1);
    height = height < (size_t)max_height ? height : (size_t)max_height;
    out->band = band_stride(max_width) * height;
    out->lent = calloc(1, sizeof *out->lent);
    out->bands = bst_pages_zero(out->band * (size_t)threads, sizeof(float));
    if (!out->level || !out->noise || !out->error || !out->left || !out->read || !out->scratch ||
        !out->bands || !out->lent) {
        bst_background_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu background meshes", meshes);
    }
    bst_scratch_pool_init(out->lent, threads);
    return BST_OK;
}

void bst_background_free(bst_background *b) {
    free(b->level);
    free(b->noise);
    free(b->error);
    free(b->left);
    free(b->read);
    free(b->scratch);
    bst_pages_free(b->bands);
    free(b->lent);
    *b = (bst_background){0};
}

/* The pixels of one mesh of the background. */
typedef struct mesh_pixels {
    const float *pixels;
    size_t stride;
    int width, height;
} mesh_pixels;

/* First estimate of a mesh's level and noise, e-, from at most SAMPLE pixels (median and MAD).
 * Returns false if no pixel is usable. */
static bool median_estimate(const mesh_pixels *m, float step_e, float *level, float *noise) {
    float sample[SAMPLE];
    int total = m->width * m->height;
    int step = (total + SAMPLE - 1) / SAMPLE;
    /* a step that shares a factor with the width would sample only a few columns */
    while (step > 1 && m->width % step == 0) {
        step++;
    }
    int count = 0;
    for (int pass = 0; pass < 2 && count == 0; pass++) {
        const float *row = m->pixels;
        int by = pass == 0 ? step : 1;
        for (int i = 0, x = 0; i < total && count < SAMPLE; i += by, x += by) {
            for (; x >= m->width; x -= m->width) {
                row += m->stride;
            }
            sample[count] = row[x];
            count += row[x] > BST_PIXEL_NONE;
        }
    }
    if (count == 0) {
        return false;
    }
    float median = bst_row_median(sample, count);
    for (int i = 0; i < count; i++) {
        sample[i] = fabsf(sample[i] - median);
    }
    *level = median;
    /* coarse quantisation can make the MAD 0: the noise is at least one step */
    *noise = fmaxf(1.4826f * bst_row_median(sample, count), step_e);
    return true;
}

typedef struct reading {
    bst_background *b;
    double read_variance;
    bst_imgproc_pixel_fn pixels;
    const void *user;
    float step_e;
    double origin_e; /* electrons of digital value 0 */
    bool again;      /* second reading: a mesh with few usable pixels keeps its estimate */
} reading;

typedef struct moments {
    double count, mean, variance;
} moments;

/* Moments of the pixels between low and high in `rows` rows of a mesh; false if fewer than two. */
static bool inner_moments(const mesh_pixels *m, int first, int rows, float low, float high,
                          moments *out) {
    bst_row_sums sums = {0};
    float middle = 0.5f * (low + high);
    bst_row_clipped_sums(m->pixels + (size_t)first * m->stride, m->width, rows, m->stride, middle,
                         0.5f * (high - low), &sums);
    double n = 0.0, s = 0.0, q = 0.0;
    for (int i = 0; i < BST_ROW_LANES; i++) {
        n += (double)sums.count[i];
        s += (double)sums.sum[i];
        q += (double)sums.square[i];
    }
    if (n < 2.0) {
        return false;
    }
    out->count = n;
    out->mean = (double)middle + s / n;
    out->variance = fmax(q - s * s / n, 0.0) / (n - 1.0);
    return true;
}

/* Edge midway between two digital values, nearest to `value`, e-. */
static float between_steps(const reading *r, float value) {
    double step = (double)r->step_e;
    return (float)((floor(((double)value - r->origin_e) / step) + 0.5) * step + r->origin_e);
}

/* Clip edges about the level, e-. They are wider where the noise has few ADC steps or a large
 * skewness, because the Edgeworth series converges slowly there. */
static void final_clip_edges(const reading *r, float level, float noise, float *low, float *high) {
    double variance = (double)noise * (double)noise;
    double counted = fmax(variance - r->read_variance, 0.0);
    bool few = noise<FEW_STEPS * r->step_e, skew = counted> MUCH_SKEW * variance * (double)noise;
    /* Design choices: 3 sigma cut off 0.3 % of normal noise; wider limits cut off less of coarse
     * and skewed noise. At 1.5 steps three levels stay. */
    float limit = fmaxf((few ? 4.0f : skew ? 5.0f : 3.0f) * noise, 1.5f * r->step_e);
    *low = between_steps(r, level - limit);
    *high = between_steps(r, level + limit);
}

/* Level and noise, e-, of one mesh by iterated sigma clipping. */
static bool estimate_mesh(const reading *r, const mesh_pixels *m, float *level, float *noise,
                          float *error) {
    float step_e = r->step_e;
    *error = 1.0f;
    if (!median_estimate(m, step_e, level, noise)) {
        return false;
    }
    for (int pass = 0; pass < CLIP_PASSES; pass++) {
        bool last = pass + 1 == CLIP_PASSES;
        float limit = fmaxf(3.0f * *noise, 1.5f * step_e);
        float low = *level - limit, high = *level + limit;
        if (last) {
            final_clip_edges(r, *level, *noise, &low, &high);
        }
        /* half of the rows suffice in the first passes */
        int half = (m->height + 1) / 2, first = pass == 1 ? m->height - half : 0;
        int rows = pass + 2 < CLIP_PASSES ? half : m->height;
        double deviation = (double)*noise, centre = (double)*level;
        moments inner;
        if (!inner_moments(m, first, rows, low, high, &inner)) {
            break;
        }
        double mean = inner.mean;
        if (last) {
            bst_truncated_moments_noise law = {r->read_variance, (double)step_e};
            bst_truncated_moments_solve(&law, (double)low, (double)high, mean, inner.variance,
                                        &centre, &deviation);
            mean = centre;
        } else {
            /* 0.97334 = 1 - 6 phi(3) / (2 Phi(3) - 1): variance of a normal cut at 3 sigma */
            deviation = sqrt(inner.variance / 0.97334);
        }
        *level = (float)mean;
        *noise = fmaxf((float)deviation, QUANTISATION * step_e);
        *error = (float)(1.0 / sqrt(inner.count));
    }
    return true;
}

/* Number of usable pixels of a mesh. */
static int count_usable(const mesh_pixels *m) {
    int left = 0;
    for (int y = 0; y < m->height; y++) {
        left += bst_row_good(m->pixels + (size_t)y * m->stride, m->width);
    }
    return left;
}

/* Estimates the rows of meshes begin to end - 1 (loop body of bst_parallel_for). */
static void estimate_mesh_rows(void *user, int begin, int end) {
    const reading *r = user;
    bst_background *b = r->b;
    int taken = bst_scratch_pool_take(b->lent);
    float *band = b->bands + (size_t)taken * b->band;
    size_t stride = band_stride(b->width);
    for (int j = begin; j < end; j++) {
        int y0 = j * b->mesh_px, y1 = j + 1 == b->rows ? b->height : y0 + b->mesh_px;
        /* rows are read whole, in memory order; a half takes as many even as odd rows */
        bool all = b->mesh_px * b->mesh_px < MANY_PX;
        int rows = 0;
        for (int y = y0; y < y1; y++) {
            if (all || y % 4 == 0 || y % 4 == 3) {
                r->pixels(r->user, y, 0, b->width, band + (size_t)rows++ * stride);
            }
        }
        for (int i = 0; i < b->columns; i++) {
            int x0 = i * b->mesh_px, x1 = i + 1 == b->columns ? b->width : x0 + b->mesh_px;
            int k = j * b->columns + i;
            mesh_pixels m = {band + x0, stride, x1 - x0, rows};
            if (r->again) {
                b->left[k] = count_usable(&m);
                b->read[k] = m.width * m.height;
                if (b->left[k] * LEFT_SHARE < b->read[k]) {
                    continue;
                }
            }
            if (!estimate_mesh(r, &m, &b->level[k], &b->noise[k], &b->error[k])) {
                b->noise[k] = -1.0f;
            }
        }
    }
    bst_scratch_pool_give(b->lent, taken);
}

/* Smooths a map over the meshes: each mesh is averaged with the pairs of opposite neighbours that
 * agree. */
static void smooth_meshes(bst_background *b, float *values, bool of_noise) {
    static const int across[4][2] = {{1, 0}, {0, 1}, {1, 1}, {1, -1}};
    float *copy = b->scratch;
    memcpy(copy, values, (size_t)(b->columns * b->rows) * sizeof *copy);
    for (int j = 0; j < b->rows; j++) {
        for (int i = 0; i < b->columns; i++) {
            int k = j * b->columns + i;
            float sum = copy[k], weight = 1.0f;
            /* the standard error of a standard deviation is sqrt(1/2) of that of the mean */
            float error = b->error[k] * b->noise[k] * (of_noise ? 0.70710678f : 1.0f);
            for (int d = 0; d < 4; d++) {
                int u = across[d][0], v = across[d][1];
                if (i - u < 0 || i + u >= b->columns || j - abs(v) < 0 || j + abs(v) >= b->rows) {
                    continue;
                }
                float pair = copy[k + v * b->columns + u] + copy[k - v * b->columns - u];
                if (fabsf(0.5f * pair - copy[k]) < AGREEMENT * 1.2247449f * error) {
                    sum += pair;
                    weight += 2.0f;
                }
            }
            values[k] = sum / weight;
        }
    }
}

/* Median of a map over all meshes. */
static float median_of(bst_background *b, const float *values, int count) {
    memcpy(b->scratch, values, (size_t)count * sizeof(float));
    return bst_value_of_rank(b->scratch, count, count / 2);
}

/* Slope of the level along one axis, e- per mesh: the smaller one-sided difference, 0 if the signs
 * differ. */
static float slope_at(const float *level, int stride, bool before, bool after) {
    float a = before ? level[0] - level[-stride] : after ? level[stride] - level[0] : 0.0f;
    float c = after ? level[stride] - level[0] : a;
    return a * c <= 0.0f ? 0.0f : fabsf(a) < fabsf(c) ? a : c;
}

/* Removes the level's slope from the noise: a slope adds a twelfth of its square to the mesh's
 * variance. */
static void remove_slope_variance(bst_background *b) {
    for (int j = 0; j < b->rows; j++) {
        for (int i = 0; i < b->columns; i++) {
            int k = j * b->columns + i;
            float x = slope_at(b->level + k, 1, i > 0, i + 1 < b->columns);
            float y = slope_at(b->level + k, b->columns, j > 0, j + 1 < b->rows);
            float variance = b->noise[k] * b->noise[k];
            b->noise[k] = sqrtf(fmaxf(variance - (x * x + y * y) / 12.0f, 0.25f * variance));
        }
    }
}

static void fill_gaps(bst_background *b, float step_e);

static void read_meshes(bst_background *b, bst_parallel *pool, const reading *r) {
    /* a small frame is done before another thread wakes */
    int grain = 65536 / (b->width * b->mesh_px) + 1;
    bst_parallel_for(pool, b->rows, grain, estimate_mesh_rows, (void *)r);
    fill_gaps(b, r->step_e);
    smooth_meshes(b, b->level, false);
    remove_slope_variance(b);
    smooth_meshes(b, b->noise, true);
}

static reading reading_of(bst_background *b, const bst_background_input *input, bool again) {
    return (reading){b,           input->read_variance_e2, input->read,
                     input->user, (float)input->step_e,    input->origin_e,
                     again};
}

void bst_background_read(bst_background *b, bst_parallel *pool, const bst_background_input *input,
                         int width, int height) {
    b->width = width;
    b->height = height;
    /* a remainder narrower than half a mesh joins its neighbour */
    int half = b->mesh_px / 2;
    b->columns = (width + half) / b->mesh_px > 0 ? (width + half) / b->mesh_px : 1;
    b->rows = (height + half) / b->mesh_px > 0 ? (height + half) / b->mesh_px : 1;
    reading r = reading_of(b, input, false);
    read_meshes(b, pool, &r);
}

double bst_background_read_again(bst_background *b, bst_parallel *pool,
                                 const bst_background_input *input) {
    reading r = reading_of(b, input, true);
    read_meshes(b, pool, &r);
    double left = 0.0, read = 0.0;
    for (int k = 0; k < b->columns * b->rows; k++) {
        left += b->left[k];
        read += b->read[k];
    }
    return left / read;
}

typedef struct picture {
    const float *pixels;
    int width;
} picture;

static void of_picture(const void *user, int y, int x, int count, float *out) {
    const picture *p = user;
    memcpy(out, p->pixels + (size_t)y * (size_t)p->width + (size_t)x, (size_t)count * sizeof *out);
}

void bst_background_estimate(bst_background *b, const float *image, int width, int height,
                             float step_e) {
    picture p = {image, width};
    const bst_background_input input = {of_picture, &p, (double)step_e, 0.0, INFINITY};
    bst_background_read(b, NULL, &input, width, height);
}

/* Gives meshes without usable pixels the frame's median level and noise. */
static void fill_gaps(bst_background *b, float step_e) {
    int good = 0;
    for (int k = 0; k < b->columns * b->rows; k++) {
        good += b->noise[k] > 0.0f;
    }
    int count = b->columns * b->rows;
    b->median_level = 0.0f;
    b->median_noise = QUANTISATION * step_e;
    if (good == count) {
        b->median_level = median_of(b, b->level, count);
        b->median_noise = median_of(b, b->noise, count);
        return;
    }
    int kept = 0;
    for (int k = 0; k < count; k++) {
        if (b->noise[k] > 0.0f) {
            b->scratch[kept++] = b->level[k];
        }
    }
    if (kept > 0) {
        b->median_level = bst_value_of_rank(b->scratch, kept, kept / 2);
        kept = 0;
        for (int k = 0; k < count; k++) {
            if (b->noise[k] > 0.0f) {
                b->scratch[kept++] = b->noise[k];
            }
        }
        b->median_noise = bst_value_of_rank(b->scratch, kept, kept / 2);
    }
    for (int k = 0; k < count; k++) {
        if (!(b->noise[k] > 0.0f)) {
            b->level[k] = b->median_level;
            b->noise[k] = b->median_noise;
        }
    }
}

/* Mesh index and interpolation fraction of a pixel coordinate; mesh centres at (i + 1/2) mesh -
 * 1/2. */
static int mesh_position(double p, int mesh, int count, float *fraction) {
    double u = (p + 0.5) / mesh - 0.5;
    if (!(u > 0.0) || count < 2) {
        *fraction = 0.0f;
        return 0;
    }
    if (u >= count - 1) {
        *fraction = 1.0f;
        return count - 2;
    }
    int i = (int)u;
    *fraction = (float)(u - i);
    return i;
}

/* The two rows of meshes about an image row and the interpolation fractions between them. */
typedef struct mesh_rows {
    size_t first, second; /* index of the first mesh of each row of meshes */
    float level, noise;   /* fractions; the level is extrapolated beyond the outermost centres */
} mesh_rows;

static mesh_rows rows_about(const bst_background *b, int y) {
    mesh_rows out;
    int j = mesh_position(y, b->mesh_px, b->rows, &out.noise);
    out.level = b->rows > 1 ? ((float)y + 0.5f) / (float)b->mesh_px - 0.5f - (float)j : 0.0f;
    out.first = (size_t)j * (size_t)b->columns;
    out.second = out.first + (b->rows > 1 ? (size_t)b->columns : 0);
    return out;
}

/* Background level, e-, of an image row at the centre of mesh column i. */
static float level_node(const bst_background *b, const mesh_rows *r, int i) {
    const float *v = b->level + i;
    return v[r->first] + r->level * (v[r->second] - v[r->first]);
}

/* 1 / noise of an image row at the centre of mesh column i. */
static float inverse_node(const bst_background *b, const mesh_rows *r, int i) {
    const float *v = b->noise + i;
    return 1.0f / (v[r->first] + r->noise * (v[r->second] - v[r->first]));
}

/* Iterates over the linear segments of an image row's background, left to right. */
typedef struct segment_walk {
    mesh_rows rows;
    int next;                   /* part */
    float level[2], inverse[2]; /* level and 1 / noise at the segment's two nodes */
} segment_walk;

static segment_walk walk_segments(const bst_background *b, int y) {
    segment_walk w = {.rows = rows_about(b, y)};
    int right = b->columns > 1 ? 1 : 0;
    for (int k = 0; k < 2; k++) {
        w.level[k] = level_node(b, &w.rows, k * right);
        w.inverse[k] = inverse_node(b, &w.rows, k * right);
    }
    return w;
}

/* Next segment: from the centre of mesh column i - 1 to that of column i, clipped to the row. */
BST_SIMD_INLINE bst_row_part next_segment(const bst_background *b, segment_walk *w) {
    float step = 1.0f / (float)b->mesh_px, centre = 0.5f * (float)(b->mesh_px - 1);
    int i = w->next++, last = b->columns - 1;
    if (i >= 2 && i <= last) {
        w->level[0] = w->level[1];
        w->inverse[0] = w->inverse[1];
        w->level[1] = level_node(b, &w->rows, i);
        w->inverse[1] = inverse_node(b, &w->rows, i);
    }
    int end = i <= last ? b->mesh_px / 2 + i * b->mesh_px : b->width;
    bst_row_part out = {.end = end < b->width ? end : b->width};
    /* first of the segment's two nodes */
    int node = i < 2 ? 0 : i <= last ? i - 1 : last - 1;
    node = node > 0 ? node : 0;
    float at = centre + (float)(node * b->mesh_px);
    out.level_slope = (w->level[1] - w->level[0]) * step;
    out.level = w->level[0] - out.level_slope * at;
    if (i == 0 || i > last) {
        out.inverse = w->inverse[i == 0 ? 0 : 1];
    } else {
        out.inverse_slope = (w->inverse[1] - w->inverse[0]) * step;
        out.inverse = w->inverse[0] - out.inverse_slope * at;
    }
    return out;
}

int bst_background_parts(const bst_background *b, int y, bst_row_part *parts) {
    assert(b && parts && y >= 0);
    segment_walk w = walk_segments(b, y);
    int count = 0, begin = 0;
    for (int i = 0; i <= b->columns; i++) {
        bst_row_part part = next_segment(b, &w);
        if (part.end > begin) {
            begin = part.end;
            assert(count <= b->columns);
            parts[count++] = part;
        }
    }
    return count;
}

void bst_background_row(const bst_background *b, int y, float *level, float *inverse_noise) {
    segment_walk w = walk_segments(b, y);
    for (int i = 0, x = 0; i <= b->columns; i++) {
        bst_row_part part = next_segment(b, &w);
        if (part.end > x) {
            bst_row_line(level + x, part.end - x, part.level, part.level_slope, (float)x);
            bst_row_line(inverse_noise + x, part.end - x, part.inverse, part.inverse_slope,
                         (float)x);
            x = part.end;
        }
    }
}

/* Bilinear interpolation of a map between mesh centres. */
static double value_at(const bst_background *b, const float *values, double x_px, double y_px) {
    float fx, fy;
    int i = mesh_position(x_px, b->mesh_px, b->columns, &fx);
    int j = mesh_position(y_px, b->mesh_px, b->rows, &fy);
    int right = b->columns > 1 ? 1 : 0, down = b->rows > 1 ? b->columns : 0;
    const float *n = values + (size_t)j * (size_t)b->columns + (size_t)i;
    float top = n[0] + fx * (n[right] - n[0]);
    float bottom = n[down] + fx * (n[down + right] - n[down]);
    return (double)(top + fy * (bottom - top));
}

double bst_background_level_at(const bst_background *b, double x_px, double y_px) {
    assert(b && isfinite(x_px) && isfinite(y_px));
    return value_at(b, b->level, x_px, y_px);
}

double bst_background_noise_at(const bst_background *b, double x_px, double y_px) {
    assert(b && isfinite(x_px) && isfinite(y_px));
    return value_at(b, b->noise, x_px, y_px);
}
