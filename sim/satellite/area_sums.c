/* Signed areas to the right of edges, by cell, as rasterisers of fonts sum them. */
#include "sim/satellite/area_sums.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/pages.h"
#include "sim/core/simd.h"

/* Light below that share of the brightest cell is rounding. */
static const double LEAST = 1e-9;

void bst_area_sums_free(bst_area_sums *s) {
    free(s->cells);
    free(s->second);
    *s = (bst_area_sums){.width = 0};
}

/* A row of cells: column 0, with one before it for what is left of the image. `second` is NULL for
 * an edge without second moments. */
typedef struct row {
    bst_area_cell *cells;
    bst_area_second *second;
    int width;
} row;

/* Adds what the cells to the right of one receive from a part of an edge in their row. y: from the
 * row's middle. */
static inline void add_right(const row *r, int i, double y, double high, double dy) {
    r->cells[i].row_light += dy;
    r->cells[i].row_y += (float)(dy * y);
    if (r->second) {
        r->second[i].row_yy += (float)(dy * (y * y + (high * high - 1.0) * (1.0 / 12.0)));
    }
}

/* A part of an edge within a cell, from (x0, y0) to (x1, y1) from the cell's centre: what is to the
 * right of it. Along it, x = x + wide t and y = y + high t with t from -1/2 to 1/2, whose mean
 * square is 1/12. */
static inline void add_part(const row *r, int i, double x0, double y0, double x1, double y1,
                            double light) {
    double x = 0.5 * (x0 + x1), y = 0.5 * (y0 + y1), wide = x1 - x0, high = y1 - y0;
    double dy = light * high, x2 = wide * wide * (1.0 / 12.0), right = 0.5 - x;
    double xy = wide * high * (1.0 / 12.0), across = 0.5 * (0.25 - x * x - x2);
    bst_area_cell *c = &r->cells[i];
    c->light += (float)(dy * right);
    c->x += (float)(dy * across);
    c->y += (float)(dy * (y * right - xy));
    if (r->second) {
        bst_area_second *q = &r->second[i];
        double yy = y * y + (high * high - 1.0) * (1.0 / 12.0), even = right * (1.0 / 12.0);
        q->xx += (float)(dy * ((1.0 / 3.0) * (0.125 - x * (x * x + 3.0 * x2)) - even));
        q->xy += (float)(dy * (y * across - x * xy));
        q->yy += (float)(dy * (yy * right - 2.0 * y * xy));
    }
    add_right(r, i, y, high, dy);
}

/* Adds an edge within a row of cells that it crosses: x at its ends in cells, y from the row's
 * middle.
 *
 * Given:     slope  of y over x */
static inline void add_across(const row *r, const double x[2], const double y[2], double slope,
                              double light) {
    bool right = x[1] > x[0];
    double low = right ? x[0] : x[1], high = right ? x[1] : x[0];
    int first = low < 0.0 ? -1 : (int)low, last = high >= r->width ? r->width : (int)high;
    double at = x[0], to = y[0];
    for (int n = first; n <= last; n++) {
        int i = right ? n : last - (n - first);
        bool end = n == last;
        double border = right ? i + 1.0 : i, next = end ? x[1] : border;
        double y_next = end ? y[1] : y[0] + (border - x[0]) * slope;
        y_next = y_next < to ? to : y_next > y[1] ? y[1] : y_next; /* of steep edges by rounding */
        if (i < 0) {
            add_right(r, -1, 0.5 * (to + y_next), y_next - to, light * (y_next - to));
        } else if (i < r->width) {
            add_part(r, i, at - i - 0.5, to, next - i - 0.5, y_next, light);
        }
        at = next;
        to = y_next;
    }
}

/* The same for two neighbouring cells, from column i on: most edges cross no more. */
static inline void add_to_two(const row *r, int i, const double x[2], const double y[2],
                              double slope, double light) {
    double border = i + 1.0, y_border = y[0] + (border - x[0]) * slope;
    int from = x[1] > x[0] ? i : i + 1, to = x[1] > x[0] ? i + 1 : i;
    y_border = y_border < y[0] ? y[0] : y_border > y[1] ? y[1] : y_border;
    add_part(r, from, x[0] - from - 0.5, y[0], border - from - 0.5, y_border, light);
    add_part(r, to, border - to - 0.5, y_border, x[1] - to - 0.5, y[1], light);
}

/* Adds an edge within a row of cells. */
static inline void add_in_row(const row *r, const double x[2], const double y[2], double slope,
                              double light) {
    double low = x[0] < x[1] ? x[0] : x[1], high = x[0] < x[1] ? x[1] : x[0];
    if (low >= r->width) {
        return;
    }
    if (high <= 0.0) { /* left of the image */
        add_right(r, -1, 0.5 * (y[0] + y[1]), y[1] - y[0], light * (y[1] - y[0]));
        return;
    }
    int first = low > 0.0 ? (int)low : 0; /* low is of any size below 0 */
    if (low >= 0.0 && high < first + 1.0) {
        add_part(r, first, x[0] - first - 0.5, y[0], x[1] - first - 0.5, y[1], light);
        return;
    }
    if (low >= 0.0 && high < first + 2.0 && first + 1 < r->width) {
        add_to_two(r, first, x, y, slope, light);
        return;
    }
    add_across(r, x, y, slope, light);
}

/* Four sums of a cell: row_y, light, x and y, or its second moments. */
typedef float sums4 __attribute__((vector_size(16)));

/* Adds to four sums from `to` on. */
BST_SIMD_INLINE void add_four(float *to, const sums4 *more) {
    sums4 sums;
    memcpy(&sums, to, sizeof sums);
    sums += *more;
    memcpy(to, &sums, sizeof sums);
}

#define BST_SIMD_KERNELS "sim/satellite/area_edge_kernels.inc"
#include "sim/core/simd_each.inc"

bst_status bst_area_sums_begin(bst_ctx *ctx, bst_area_sums *s, int width, int height) {
    size_t need = ((size_t)width + 1) * (size_t)height;
    if (need > s->capacity) {
        free(s->cells);
        free(s->second);
        size_t capacity = need + need / 4; /* as those of the image */
        s->cells = bst_pages_alloc(capacity * sizeof *s->cells);
        s->second = bst_pages_alloc(capacity * sizeof *s->second);
        s->capacity = s->cells && s->second ? capacity : 0;
        if (s->capacity == 0) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for an image of %d x %d cells", width,
                            height);
        }
    }
    s->width = width;
    s->height = height;
    s->add_inner[0] = BST_SIMD_PICK(add_faint_edge);
    s->add_inner[1] = BST_SIMD_PICK(add_inner_edge);
    memset(s->cells, 0, need * sizeof *s->cells);
    memset(s->second, 0, need * sizeof *s->second);
    return BST_OK;
}

static inline void add_edge(bst_area_sums *s, bst_point2 a, bst_point2 b, double light,
                            bool second) {
    if (b.y < a.y) {
        bst_point2 c = a;
        a = b;
        b = c;
        light = -light;
    }
    if (!(b.y > 0.0) || !(a.y < s->height) || a.y == b.y) {
        return;
    }
    double slope = (b.x - a.x) / (b.y - a.y), steep = (b.y - a.y) / (b.x - a.x);
    double low = a.x < b.x ? a.x : b.x, high = a.x < b.x ? b.x : a.x;
    if (low >= 1.0 && high < s->width - 1.0 && a.y >= 0.0 && b.y < s->height - 1.0) {
        const bst_area_edge e = {a, b, slope, steep, light};
        s->add_inner[second](s, &e);
        return;
    }
    double x = a.x, y = a.y;
    if (y < 0.0) {
        x -= y * slope;
        y = 0.0;
    }
    double end = b.y < s->height ? b.y : s->height;
    size_t stride = (size_t)s->width + 1;
    for (int j = (int)y; y < end; j++) {
        bool last = end <= j + 1.0;
        double y_next = last ? end : j + 1.0;
        double x_next = last && end == b.y ? b.x : a.x + (y_next - a.y) * slope;
        const double px[2] = {x, x_next}, py[2] = {y - j - 0.5, y_next - j - 0.5};
        const row r = {s->cells + (size_t)j * stride + 1,
                       second ? s->second + (size_t)j * stride + 1 : NULL, s->width};
        add_in_row(&r, px, py, steep, light);
        x = x_next;
        y = y_next;
    }
}

void bst_area_sums_edge(bst_area_sums *s, bst_point2 a, bst_point2 b, double light) {
    add_edge(s, a, b, light, true);
}

void bst_area_sums_faint_edge(bst_area_sums *s, bst_point2 a, bst_point2 b, double light) {
    add_edge(s, a, b, light, false);
}

void bst_area_sums_polygon(bst_area_sums *s, const bst_point2 *p, int count, double light) {
    for (int i = 0; i < count; i++) {
        bst_area_sums_edge(s, p[i], p[i + 1 < count ? i + 1 : 0], -light);
    }
}

void bst_area_sums_add(bst_area_sums *to, const bst_area_sums *from, int first, int end) {
    assert(to->width == from->width && to->height == from->height);
    size_t stride = (size_t)to->width + 1, start = stride * (size_t)first;
    size_t count = stride * (size_t)end;
    for (size_t i = start; i < count; i++) {
        bst_area_cell *c = &to->cells[i];
        const bst_area_cell *d = &from->cells[i];
        c->row_light += d->row_light;
        c->row_y += d->row_y;
        c->light += d->light;
        c->x += d->x;
        c->y += d->y;
    }
    for (size_t i = start; i < count; i++) {
        bst_area_second *c = &to->second[i];
        const bst_area_second *d = &from->second[i];
        c->row_yy += d->row_yy;
        c->xx += d->xx;
        c->xy += d->xy;
        c->yy += d->yy;
    }
}

/* Second moment of even light in a cell. */
static const double EVEN = 1.0 / 12.0;

void bst_area_sums_finish(const bst_area_sums *s, double cell_rad, bst_resolved_image *image) {
    assert(image->width == s->width && image->height == s->height && image->second);
    double most = 0.0;
    for (int j = 0; j < s->height; j++) {
        size_t first = (size_t)j * (size_t)s->width, before = first + (size_t)j;
        double light = 0.0, row_y = 0.0, row_yy = 0.0; /* of the row from this cell on */
        double v = (image->y0 + j + 0.5) * cell_rad;
        for (int i = 0; i < s->width; i++) {
            const bst_area_cell *from = &s->cells[before + (size_t)i];
            const bst_area_second *from_2 = &s->second[before + (size_t)i];
            bst_resolved_cell *to = &image->cells[first + (size_t)i];
            bst_resolved_second *second = &image->second[first + (size_t)i];
            light += from[0].row_light;
            row_y += (double)from[0].row_y;
            row_yy += (double)from_2[0].row_yy;
            double u = (image->x0 + i + 0.5) * cell_rad, c2 = 1.0 / (1.0 + u * u + v * v);
            double c3 = c2 * sqrt(c2), own = c3 * (light + (double)from[1].light);
            to->light = (float)own;
            to->cover = 0.0F;
            to->moment_x = (float)(c3 * (double)from[1].x);
            to->moment_y = (float)(c3 * (row_y + (double)from[1].y));
            second->xx = (float)(own * EVEN + c3 * (double)from_2[1].xx);
            second->xy = (float)(c3 * (double)from_2[1].xy);
            second->yy = (float)(own * EVEN + c3 * (row_yy + (double)from_2[1].yy));
            most = own > most ? own : most;
        }
    }
    float least = (float)(LEAST * most);
    for (size_t i = 0; i < (size_t)s->width * (size_t)s->height; i++) {
        if (!(image->cells[i].light > least)) {
            image->cells[i].light = 0.0F;
        }
    }
}
