#include "scenegen/planes.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "scenegen/part_mask.h"
#include "sim/world/scene/skylight.h"

enum {
    CELL_PX = 16, /* resolution of the grid on which boxes are separated */
    LAYERS = 64,  /* layers per round: the bits of a cell */
};

/* A source of the segmentation mask. */
typedef struct shape {
    int item, source;
    int x0, y0, x1, y1; /* box in the frame, x1 and y1 exclusive; empty: not in the frame */
    int margin;         /* of the box beyond the source's track */
    int layer;          /* -1: none in this round */
    bool done;
} shape;

struct bst_plane_maker {
    uint32_t planes;
    double threshold_sigma;
    double read_noise_e;
    float level;   /* threshold of the mask, electrons: for all pixels, or for the darkest */
    bool uneven;   /* the background, and so the threshold, differs between pixels */
    size_t pixels; /* capacity: a whole sensor */
    int width, height, binning; /* of the frame */
    float *electrons[BST_PLANE_SEGMENTATION];
    float *image;  /* light of some sources */
    float *sensor; /* renderer output before binning; NULL: not needed so far */
    uint8_t *saturation;
    float *best; /* light of the source that owns a pixel */
    int32_t *mask, *parts;
    bst_part_mask part_mask; /* work space */
    uint64_t *cells;
    int cells_x;
    shape *shapes;
    bst_scene_source *sources; /* of one layer */
    int capacity;              /* of both */
};

static bool wants(const bst_plane_maker *m, bst_plane plane) {
    return m->planes & UINT32_C(1) << plane;
}

bst_status bst_plane_maker_create(bst_ctx *ctx, uint32_t planes, int width, int height,
                                  double threshold_sigma, bst_plane_maker **out) {
    assert(out && width > 0 && height > 0 && threshold_sigma >= 0.0);
    *out = NULL;
    bst_plane_maker *m = calloc(1, sizeof *m);
    if (!m) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for noise-free planes");
    }
    m->planes = planes;
    m->threshold_sigma = threshold_sigma;
    m->pixels = (size_t)width * (size_t)height;
    m->cells_x = width / CELL_PX + 1;
    bool enough = (m->image = malloc(m->pixels * sizeof *m->image)) != NULL;
    /* the background is subtracted from the other planes */
    for (int k = 0; k < BST_PLANE_SEGMENTATION && enough; k++) {
        if (wants(m, (bst_plane)k) || k == BST_PLANE_BACKGROUND) {
            enough = (m->electrons[k] = malloc(m->pixels * sizeof(float))) != NULL;
        }
    }
    if (enough && wants(m, BST_PLANE_SEGMENTATION)) {
        m->best = malloc(m->pixels * sizeof *m->best);
        m->mask = malloc(m->pixels * sizeof *m->mask);
        m->cells = malloc((size_t)m->cells_x * (size_t)(height / CELL_PX + 1) * sizeof *m->cells);
        enough = m->best && m->mask && m->cells;
    }
    if (enough && wants(m, BST_PLANE_SATURATION)) {
        enough = (m->saturation = malloc(m->pixels)) != NULL;
    }
    if (enough && wants(m, BST_PLANE_PARTS)) {
        enough = (m->parts = malloc(m->pixels * sizeof *m->parts)) != NULL;
    }
    if (!enough) {
        bst_plane_maker_free(m);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for noise-free planes of %d x %d pixels",
                        width, height);
    }
    *out = m;
    return BST_OK;
}

void bst_plane_maker_free(bst_plane_maker *m) {
    if (m) {
        for (int k = 0; k < BST_PLANE_SEGMENTATION; k++) {
            free(m->electrons[k]);
        }
        free(m->image);
        free(m->sensor);
        free(m->saturation);
        free(m->best);
        free(m->mask);
        free(m->parts);
        bst_part_mask_free(&m->part_mask);
        free(m->cells);
        free(m->shapes);
        free(m->sources);
        free(m);
    }
}

/* Expected electrons in the frame's (binned) pixels. */
static bst_status render(bst_ctx *ctx, bst_plane_maker *m, bst_renderer *renderer,
                         const bst_render_request *request, float *out) {
    int b = m->binning, width = request->window.width;
    if (b == 1) {
        return bst_renderer_render_noise_free(ctx, renderer, request, out);
    }
    if (!m->sensor && !(m->sensor = malloc(m->pixels * sizeof *m->sensor))) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for noise-free planes before binning");
    }
    BST_TRY(bst_renderer_render_noise_free(ctx, renderer, request, m->sensor));
    for (int y = 0; y < m->height; y++) {
        for (int x = 0; x < m->width; x++) {
            const float *from = m->sensor + (size_t)(y * b) * (size_t)width + (size_t)(x * b);
            double sum = 0.0;
            for (int k = 0; k < b * b; k++) {
                sum += (double)from[(size_t)(k / b) * (size_t)width + (size_t)(k % b)];
            }
            out[(size_t)y * (size_t)m->width + (size_t)x] = (float)sum;
        }
    }
    return BST_OK;
}

/* Expected electrons of some sources only. */
static bst_status render_sources(bst_ctx *ctx, bst_plane_maker *m, bst_renderer *renderer,
                                 const bst_render_request *request, const bst_scene_source *sources,
                                 int count, float *out) {
    bst_render_request part = *request;
    part.sources = sources;
    part.count = count;
    /* rendered with the background, for the same tolerance as in the frame */
    BST_TRY(render(ctx, m, renderer, &part, out));
    const float *background = m->electrons[BST_PLANE_BACKGROUND];
    size_t pixels = (size_t)m->width * (size_t)m->height;
    for (size_t i = 0; i < pixels; i++) {
        out[i] -= background[i];
    }
    return BST_OK;
}

/* ------------------------------------------------------------------ Segmentation mask */

/* Pixels around the track within which a Gaussian of this peak exceeds `level`; at least 2. */
static int gaussian_margin(const bst_camera *camera, int binning, double peak, double level) {
    double sigma = hypot(bst_camera_psf_sigma_px(camera), 0.3 * binning) / binning;
    double ratio = fmax(peak / level, 1.0);
    return 2 + (int)ceil(sigma * sqrt(2.0 * log(ratio)));
}

static int clip(double value, int limit) {
    return value < 0.0 ? 0 : value > limit ? limit : (int)value;
}

/* Box of a source's track in the frame, with its margin. */
static void make_box(const bst_plane_maker *m, const bst_camera *camera,
                     const bst_render_request *q, shape *s) {
    const bst_los_track *track = q->track;
    double x0 = INFINITY, y0 = INFINITY, x1 = -INFINITY, y1 = -INFINITY;
    for (int k = 0; k < track->count; k++) {
        double x, y;
        if (bst_field_project(camera, track, k, &q->sources[s->source], &x, &y)) {
            x = (x - q->window.x0 + 0.5) / m->binning - 0.5;
            y = (y - q->window.y0 + 0.5) / m->binning - 0.5;
            x0 = fmin(x0, x);
            y0 = fmin(y0, y);
            x1 = fmax(x1, x);
            y1 = fmax(y1, y);
        }
    }
    if (!(x1 >= x0)) {
        s->x0 = s->x1 = s->y0 = s->y1 = 0;
        return;
    }
    s->x0 = clip(floor(x0) - s->margin, m->width);
    s->y0 = clip(floor(y0) - s->margin, m->height);
    s->x1 = clip(ceil(x1) + s->margin + 1, m->width);
    s->y1 = clip(ceil(y1) + s->margin + 1, m->height);
}

static bool is_empty(const shape *s) {
    return s->x1 <= s->x0 || s->y1 <= s->y0;
}

/* Assigns a source the first layer in which its box is free; -1 if there is none. */
static void choose_layer(bst_plane_maker *m, shape *s) {
    uint64_t taken = 0;
    int cx0 = s->x0 / CELL_PX, cy0 = s->y0 / CELL_PX;
    int cx1 = (s->x1 - 1) / CELL_PX, cy1 = (s->y1 - 1) / CELL_PX;
    for (int y = cy0; y <= cy1; y++) {
        for (int x = cx0; x <= cx1; x++) {
            taken |= m->cells[(size_t)y * (size_t)m->cells_x + (size_t)x];
        }
    }
    s->layer = 0;
    while (s->layer < LAYERS && taken & UINT64_C(1) << s->layer) {
        s->layer++;
    }
    if (s->layer == LAYERS) {
        s->layer = -1;
        return;
    }
    for (int y = cy0; y <= cy1; y++) {
        for (int x = cx0; x <= cx1; x++) {
            m->cells[(size_t)y * (size_t)m->cells_x + (size_t)x] |= UINT64_C(1) << s->layer;
        }
    }
}

/* True if the image exceeds the mask's threshold in a pixel. */
static bool above(const bst_plane_maker *m, size_t pixel) {
    if (!m->uneven) {
        return m->image[pixel] > m->level;
    }
    double variance =
        (double)m->electrons[BST_PLANE_BACKGROUND][pixel] + m->read_noise_e * m->read_noise_e;
    return (double)m->image[pixel] > m->threshold_sigma * sqrt(variance);
}

/* True if a source's light exceeds the threshold at its box's border inside the frame: the box is
 * too small. */
static bool is_cut(const bst_plane_maker *m, const shape *s) {
    for (int y = s->y0; y < s->y1; y++) {
        size_t row = (size_t)y * (size_t)m->width;
        bool edge = (y == s->y0 && s->y0 > 0) || (y == s->y1 - 1 && s->y1 < m->height);
        for (int x = s->x0; edge && x < s->x1; x++) {
            if (above(m, row + (size_t)x)) {
                return true;
            }
        }
        if ((s->x0 > 0 && above(m, row + (size_t)s->x0)) ||
            (s->x1 < m->width && above(m, row + (size_t)s->x1 - 1))) {
            return true;
        }
    }
    return false;
}

/* Assigns the pixels of a source's box in which it is the brightest. */
static void paint(bst_plane_maker *m, const shape *s) {
    for (int y = s->y0; y < s->y1; y++) {
        size_t row = (size_t)y * (size_t)m->width;
        for (int x = s->x0; x < s->x1; x++) {
            size_t i = row + (size_t)x;
            if (m->image[i] > m->best[i] && above(m, i)) {
                m->best[i] = m->image[i];
                m->mask[i] = s->item + 1;
            }
        }
    }
}

/* Renders the sources of one layer and paints them; sources with too small a box get a larger one
 * and are repeated. */
static bst_status paint_layer(bst_ctx *ctx, bst_plane_maker *m, bst_renderer *renderer,
                              const bst_camera *camera, const bst_render_request *q, int count,
                              int layer, int *left) {
    int n = 0;
    for (int i = 0; i < count; i++) {
        if (!m->shapes[i].done && m->shapes[i].layer == layer) {
            m->sources[n++] = q->sources[m->shapes[i].source];
        }
    }
    if (n == 0) {
        return BST_OK;
    }
    BST_TRY(render_sources(ctx, m, renderer, q, m->sources, n, m->image));
    for (int i = 0; i < count; i++) {
        shape *s = &m->shapes[i];
        if (s->done || s->layer != layer) {
            continue;
        }
        if (is_cut(m, s)) {
            s->margin *= 2;
            make_box(m, camera, q, s);
        } else {
            paint(m, s);
            s->done = true;
            --*left;
        }
    }
    return BST_OK;
}

/* Lists the sources that may exceed the threshold, with their boxes. */
static bst_status list_shapes(bst_ctx *ctx, bst_plane_maker *m, const bst_renderer *renderer,
                              const bst_camera *camera, const bst_render_request *q,
                              const int *item_source, int item_count, double level, int *count) {
    if (item_count > m->capacity) {
        free(m->shapes);
        free(m->sources);
        m->shapes = malloc((size_t)item_count * sizeof *m->shapes);
        m->sources = malloc((size_t)item_count * sizeof *m->sources);
        m->capacity = m->shapes && m->sources ? item_count : 0;
        if (m->capacity == 0) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a mask of %d sources", item_count);
        }
    }
    *count = 0;
    for (int i = 0; i < item_count; i++) {
        double peak = bst_renderer_peak_e(renderer, item_source[i]) * m->binning * m->binning;
        shape *s = &m->shapes[*count];
        *s = (shape){.item = i,
                     .source = item_source[i],
                     .margin = gaussian_margin(camera, m->binning, peak, level)};
        if (peak > 0.5 * level) { /* margin: the peak is an estimate */
            make_box(m, camera, q, s);
            *count += !is_empty(s);
        }
    }
    return BST_OK;
}

static bst_status make_mask(bst_ctx *ctx, bst_plane_maker *m, bst_renderer *renderer,
                            const bst_camera *camera, const bst_render_request *q, int count) {
    size_t pixels = (size_t)m->width * (size_t)m->height;
    memset(m->mask, 0, pixels * sizeof *m->mask);
    memset(m->best, 0, pixels * sizeof *m->best);
    for (int left = count; left > 0;) {
        memset(m->cells, 0,
               (size_t)m->cells_x * (size_t)(m->height / CELL_PX + 1) * sizeof *m->cells);
        int layers = 0;
        for (int i = 0; i < count; i++) {
            if (!m->shapes[i].done) {
                choose_layer(m, &m->shapes[i]);
                layers = m->shapes[i].layer >= layers ? m->shapes[i].layer + 1 : layers;
            }
        }
        for (int layer = 0; layer < layers; layer++) {
            BST_TRY(paint_layer(ctx, m, renderer, camera, q, count, layer, &left));
        }
    }
    return BST_OK;
}

bst_status bst_plane_maker_render(bst_ctx *ctx, bst_plane_maker *m, bst_renderer *renderer,
                                  const bst_camera *camera, const bst_render_request *request,
                                  const int *item_source, int item_count, bst_planes *out) {
    assert(m && renderer && camera && request && out && item_count >= 0);
    assert(item_source || item_count == 0);
    int b = m->binning = request->binning > 1 ? request->binning : 1;
    m->width = request->window.width / b;
    m->height = request->window.height / b;
    double least_e =
        b * b *
        (request->background_e + (request->background ? request->background->least_e : 0.0));
    if (wants(m, BST_PLANE_SATURATION)) { /* of the frame, which is the renderer's latest */
        BST_TRY(
            bst_renderer_flags(ctx, renderer, (size_t)m->width * (size_t)m->height, m->saturation));
    }
    m->read_noise_e = bst_camera_read_noise_e(camera);
    m->uneven = request->background != NULL;
    m->level = (float)(m->threshold_sigma * sqrt(least_e + m->read_noise_e * m->read_noise_e));
    int shapes = 0, stars = 0;
    if (wants(
            m,
            BST_PLANE_SEGMENTATION)) { /* first, because it needs the peaks of the whole request */
        BST_TRY(list_shapes(ctx, m, renderer, camera, request, item_source, item_count,
                            (double)m->level, &shapes));
    }
    while (stars < request->count && request->sources[stars].kind != BST_SOURCE_OBJECT) {
        stars++;
    }
    bst_render_request empty = *request;
    empty.count = 0;
    if (m->planes & ~(UINT32_C(1) << BST_PLANE_SATURATION | UINT32_C(1) << BST_PLANE_PARTS)) {
        BST_TRY(render(ctx, m, renderer, &empty, m->electrons[BST_PLANE_BACKGROUND]));
    }
    if (wants(m, BST_PLANE_STARS)) {
        BST_TRY(render_sources(ctx, m, renderer, request, request->sources, stars,
                               m->electrons[BST_PLANE_STARS]));
    }
    if (wants(m, BST_PLANE_TARGETS)) {
        BST_TRY(render_sources(ctx, m, renderer, request, request->sources + stars,
                               request->count - stars, m->electrons[BST_PLANE_TARGETS]));
    }
    if (wants(m, BST_PLANE_SEGMENTATION)) {
        BST_TRY(make_mask(ctx, m, renderer, camera, request, shapes));
    }
    if (m->parts) {
        BST_TRY(bst_part_mask_draw(ctx, &m->part_mask, camera, request, m->parts));
    }
    out->exposure_id = request->exposure_id;
    out->width = m->width;
    out->height = m->height;
    for (int k = 0; k < BST_PLANE_SEGMENTATION; k++) {
        out->electrons[k] = wants(m, (bst_plane)k) ? m->electrons[k] : NULL;
    }
    out->segmentation = wants(m, BST_PLANE_SEGMENTATION) ? m->mask : NULL;
    out->saturation = m->saturation;
    out->parts = m->parts;
    return BST_OK;
}
