#include "imgproc/streak/common_streak.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/streak/template_filter.h"

enum { MOST_SHAPES = 8, LEAST_PIXELS = 6, EDGE_PX = 2, MARGIN_PX = 3, END_PX = 10 };

/* Threshold of connected sources on means of 3 x 3 pixels, sigma of a pixel: six of the mean. */
static const double CONNECTED_SIGMA = 2.0;
/* Negative pixels below this are bad, sigma. */
static const float LEAST_SIGMA = -5.0f;
/* A source this near to a brighter one, and fainter by this share, is what its subtraction left. */
static const double GHOST_PX = 15.0, GHOST_SHARE = 0.15;
/* A source whose variance along its longer axis is below this times that across is a point. */
static const double ROUND = 2.0;
/* Least share of the template's energy inside the frame. */
static const double LEAST_INSIDE = 0.25;

static int ascending(const void *a, const void *b) {
    float d = *(const float *)a - *(const float *)b;
    return (d > 0.0f) - (d < 0.0f);
}

/* Median of the values that are not NAN; sorts them. */
static float median(float *values, int count) {
    int kept = 0;
    for (int i = 0; i < count; i++) {
        if (!isnan(values[i])) {
            values[kept++] = values[i];
        }
    }
    qsort(values, (size_t)kept, sizeof *values, ascending);
    return kept > 0 ? values[kept / 2] : 0.0f;
}

/* Removes the medians of columns and rows and divides by the noise. */
static void clean(bst_common_streak *s, float *scratch) {
    const int w = s->width, h = s->height;
    for (int x = 0; x < w; x++) {
        for (int y = 0; y < h; y++) {
            scratch[y] = s->image[(size_t)y * (size_t)w + (size_t)x];
        }
        float level = median(scratch, h);
        for (int y = 0; y < h; y++) {
            s->image[(size_t)y * (size_t)w + (size_t)x] -= level;
        }
    }
    for (int y = 0; y < h; y++) {
        float *row = &s->image[(size_t)y * (size_t)w];
        memcpy(scratch, row, (size_t)w * sizeof *row);
        float level = median(scratch, w);
        for (int x = 0; x < w; x++) {
            row[x] -= level;
        }
    }
    const size_t pixels = (size_t)w * (size_t)h;
    for (size_t i = 0; i < pixels; i++) {
        scratch[i] = fabsf(s->image[i]);
    }
    s->sigma = fmax(1.4826 * (double)median(scratch, (int)pixels), 1e-9);
    for (size_t i = 0; i < pixels; i++) {
        float v = s->image[i] / (float)s->sigma;
        s->image[i] = isnan(v) ? 0.0f : v < LEAST_SIGMA ? LEAST_SIGMA : v;
    }
}

/* A connected source. */
typedef struct shape {
    double sum;
    int label, pixels, x0, x1, y0, y1;
} shape;

/* Collects the connected pixels of a source, depth first. */
static shape flood(const bst_common_streak *s, const bool *above, int *label, int *stack, int from,
                   int number) {
    const int w = s->width, h = s->height;
    shape out = {.label = number, .x0 = w, .y0 = h};
    int depth = 0;
    stack[depth++] = from;
    label[from] = number;
    while (depth > 0) {
        int i = stack[--depth], x = i % w, y = i / w;
        out.sum += (double)s->image[i];
        out.pixels++;
        out.x0 = x < out.x0 ? x : out.x0;
        out.x1 = x > out.x1 ? x : out.x1;
        out.y0 = y < out.y0 ? y : out.y0;
        out.y1 = y > out.y1 ? y : out.y1;
        for (int k = 0; k < 9; k++) {
            int u = x + k % 3 - 1, v = y + k / 3 - 1;
            if (u >= 0 && v >= 0 && u < w && v < h && above[v * w + u] && label[v * w + u] == 0) {
                label[v * w + u] = number;
                stack[depth++] = v * w + u;
            }
        }
    }
    return out;
}

/* Marks pixels whose mean of 3 x 3 is above the threshold. */
static void mark(const bst_common_streak *s, bool *above) {
    const int w = s->width, h = s->height;
    for (int y = 1; y < h - 1; y++) {
        for (int x = 1; x < w - 1; x++) {
            double sum = 0.0;
            for (int k = 0; k < 9; k++) {
                sum += (double)s->image[(y + k / 3 - 1) * w + x + k % 3 - 1];
            }
            above[y * w + x] = sum > 9.0 * CONNECTED_SIGMA;
        }
    }
}

/* Lists the brightest sources that lie wholly inside the frame; returns their number. */
static int list_shapes(const bst_common_streak *s, const bool *above, int *label, int *stack,
                       shape out[MOST_SHAPES]) {
    int count = 0, number = 0;
    for (int i = 0; i < s->width * s->height; i++) {
        if (!above[i] || label[i] != 0) {
            continue;
        }
        shape found = flood(s, above, label, stack, i, ++number);
        if (found.pixels < LEAST_PIXELS || found.x0 <= EDGE_PX || found.y0 <= EDGE_PX ||
            found.x1 >= s->width - 1 - EDGE_PX || found.y1 >= s->height - 1 - EDGE_PX) {
            continue;
        }
        int at = count < MOST_SHAPES ? count++ : MOST_SHAPES;
        for (; at > 0 && out[at - 1].sum < found.sum; at--) {
            if (at < MOST_SHAPES) {
                out[at] = out[at - 1];
            }
        }
        if (at < MOST_SHAPES) {
            out[at] = found;
        }
    }
    return count;
}

/* Copies a source as the template, of unit energy. */
static bst_status copy_template(bst_ctx *ctx, bst_common_streak *s, const int *label,
                                const shape *from) {
    const int x0 = from->x0 - MARGIN_PX, y0 = from->y0 - MARGIN_PX;
    s->columns = from->x1 - from->x0 + 1 + 2 * MARGIN_PX;
    s->rows = from->y1 - from->y0 + 1 + 2 * MARGIN_PX;
    s->template = calloc((size_t)s->columns * (size_t)s->rows, sizeof *s->template);
    if (!s->template) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a streak");
    }
    double energy = 0.0;
    for (int pass = 0; pass < 2; pass++) {
        for (int y = from->y0; y <= from->y1; y++) {
            for (int x = from->x0; x <= from->x1; x++) {
                float v = label[y * s->width + x] == from->label ? s->image[y * s->width + x] : 0;
                if (pass == 0) {
                    energy += (double)v * (double)v;
                } else {
                    s->template[(y - y0) * s->columns + x - x0] = v / (float)sqrt(energy);
                }
            }
        }
    }
    return BST_OK;
}

/* Centroid and principal axis of the template, pointing right. Returns false for a point. */
static bool principal_axis(const bst_common_streak *s, double centre[2], double axis[2]) {
    double sum = 0.0, m[5] = {0};
    for (int y = 0; y < s->rows; y++) {
        for (int x = 0; x < s->columns; x++) {
            double v = fmax((double)s->template[y * s->columns + x], 0.0);
            sum += v;
            m[0] += v * x;
            m[1] += v * y;
            m[2] += v * x * x;
            m[3] += v * x * y;
            m[4] += v * y * y;
        }
    }
    centre[0] = m[0] / sum;
    centre[1] = m[1] / sum;
    double xx = m[2] / sum - centre[0] * centre[0], xy = m[3] / sum - centre[0] * centre[1],
           yy = m[4] / sum - centre[1] * centre[1];
    double angle = 0.5 * atan2(2.0 * xy, xx - yy);
    axis[0] = cos(angle);
    axis[1] = sin(angle);
    double spread = hypot(xx - yy, 2.0 * xy);
    return xx + yy + spread > ROUND * (xx + yy - spread);
}

/* Places of the ends: where the light along the principal axis falls to half of that of the last
 * END_PX. A round source has both at its centre. */
static bst_status find_ends(bst_ctx *ctx, bst_common_streak *s) {
    double centre[2], axis[2];
    if (!principal_axis(s, centre, axis)) {
        s->ends[0] = s->ends[1] = (bst_common_streak_point){centre[0], centre[1]};
        return BST_OK;
    }
    const int half = s->rows + s->columns, bins = 2 * half + 1;
    double *light = calloc(2 * (size_t)bins, sizeof *light), *side = light + bins;
    if (!light) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a streak");
    }
    double most = 0.0;
    for (int y = 0; y < s->rows; y++) {
        for (int x = 0; x < s->columns; x++) {
            double v = (double)s->template[y * s->columns + x], dx = x - centre[0],
                   dy = y - centre[1];
            int bin = half + (int)lround(dx * axis[0] + dy * axis[1]);
            light[bin] += v;
            side[bin] += v * (dy * axis[0] - dx * axis[1]);
            most = fmax(most, light[bin]);
        }
    }
    for (int e = 0; e < 2; e++) {
        int step = e == 0 ? 1 : -1, at = e == 0 ? 0 : bins - 1;
        while (light[at] < 0.2 * most) {
            at += step;
        }
        double plateau = 0.0, across = 0.0, weight = 0.0;
        for (int k = 2; k < END_PX; k++) {
            plateau += light[at + k * step > 0 && at + k * step < bins ? at + k * step : at];
        }
        plateau /= END_PX - 2;
        at -= 2 * step;
        while (light[at] < 0.5 * plateau) {
            at += step;
        }
        double before = light[at - step],
               u = at - half - step * (light[at] - 0.5 * plateau) / (light[at] - before);
        for (int k = 0; k < 3; k++) {
            across += side[at + k * step];
            weight += light[at + k * step];
        }
        across /= weight;
        s->ends[e] = (bst_common_streak_point){centre[0] + u * axis[0] - across * axis[1],
                                               centre[1] + u * axis[1] + across * axis[0]};
    }
    free(light);
    return BST_OK;
}

static bool inside(const bst_common_streak *s, double x, double y) {
    return x >= 0.0 && y >= 0.0 && x <= s->width - 1 && y <= s->height - 1;
}

/* True for what the subtraction of a brighter source left. */
static bool is_ghost(const bst_common_streak *s, const bst_detection *d) {
    for (int i = 0; i < s->count; i++) {
        const bst_detection *o = &s->items[i];
        if (hypot(d->x_px - o->x_px, d->y_px - o->y_px) < GHOST_PX &&
            d->flux_e < GHOST_SHARE * o->flux_e) {
            return true;
        }
    }
    return false;
}

/* Finds the stars one after the other; those that are not kept are subtracted, too. */
static void find_stars(bst_common_streak *s, bst_template_filter *filter,
                       const bst_common_streak_options *o) {
    for (int i = 0; i < 2 * o->max_sources && s->count < o->max_sources; i++) {
        bst_template_peak peak;
        if (!bst_template_filter_peak(filter, s->image, LEAST_INSIDE, &peak) ||
            peak.snr < o->least_snr) {
            break;
        }
        bst_detection d = {.x_px = peak.x_px,
                           .y_px = peak.y_px,
                           .flux_e = peak.amplitude * s->sigma,
                           .flux_sigma_e = peak.amplitude * s->sigma / peak.snr,
                           .snr = peak.snr,
                           .cov_xx = peak.cov_xx,
                           .cov_xy = peak.cov_xy,
                           .cov_yy = peak.cov_yy};
        bool end = inside(s, d.x_px + s->ends[0].x_px, d.y_px + s->ends[0].y_px) ||
                   inside(s, d.x_px + s->ends[1].x_px, d.y_px + s->ends[1].y_px);
        if (end && peak.whole && !is_ghost(s, &d)) {
            s->items[s->count++] = d;
        }
        bst_template_filter_subtract(filter, s->image, &peak);
    }
}

/* Work space of the search for shapes. */
typedef struct workspace {
    float *scratch;
    bool *above;
    int *label, *stack;
} workspace;

static bst_status find(bst_ctx *ctx, const bst_common_streak_options *options, workspace *k,
                       bst_common_streak *out) {
    shape shapes[MOST_SHAPES];
    clean(out, k->scratch);
    mark(out, k->above);
    int count = list_shapes(out, k->above, k->label, k->stack, shapes);
    if (options->shape >= count || options->shape >= options->candidates) {
        return BST_OK;
    }
    out->shapes = count;
    BST_TRY(copy_template(ctx, out, k->label, &shapes[options->shape]));
    BST_TRY(find_ends(ctx, out));
    bst_template_filter *filter;
    BST_TRY(bst_template_filter_create(ctx, out->width, out->height, out->template, out->columns,
                                       out->rows, &filter));
    find_stars(out, filter, options);
    bst_template_filter_free(filter);
    return BST_OK;
}

bst_status bst_common_streak_find(bst_ctx *ctx, const float *pixels, int width, int height,
                                  const bst_common_streak_options *options,
                                  bst_common_streak *out) {
    assert(pixels && options && out && width > 0 && height > 0);
    *out = (bst_common_streak){.width = width, .height = height};
    const size_t n = (size_t)width * (size_t)height;
    workspace k = {.scratch = malloc(n * sizeof(float)),
                   .above = calloc(n, sizeof(bool)),
                   .label = calloc(n, sizeof(int)),
                   .stack = malloc(n * sizeof(int))};
    out->image = malloc(n * sizeof *out->image);
    out->items = calloc((size_t)options->max_sources + 1, sizeof *out->items);
    bst_status status = BST_OK;
    if (!k.scratch || !k.above || !k.label || !k.stack || !out->image || !out->items) {
        status =
            bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a frame of %d x %d px", width, height);
    } else {
        memcpy(out->image, pixels, n * sizeof *out->image);
        status = find(ctx, options, &k, out);
    }
    free(k.scratch);
    free(k.above);
    free(k.label);
    free(k.stack);
    return status;
}

void bst_common_streak_free(bst_common_streak *s) {
    free(s->image);
    free(s->template);
    free(s->items);
    *s = (bst_common_streak){0};
}
