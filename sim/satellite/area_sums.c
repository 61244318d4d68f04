/* Signed areas to the right of edges, by cell, as rasterisers of fonts sum them. */
#include "sim/satellite/area_sums.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Light below that share of the brightest cell is rounding. */
static const double LEAST = 1e-9;

void bst_area_sums_free(bst_area_sums *s) {
    free(s->cells);
    *s = (bst_area_sums){.width = 0};
}

bst_status bst_area_sums_begin(bst_ctx *ctx, bst_area_sums *s, int width, int height) {
    size_t need = ((size_t)width + 1) * (size_t)height;
    if (need > s->capacity) {
        free(s->cells);
        s->cells = malloc(need * sizeof *s->cells);
        s->capacity = s->cells ? need : 0;
        if (!s->cells) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for an image of %d x %d cells", width,
                            height);
        }
    }
    s->width = width;
    s->height = height;
    memset(s->cells, 0, need * sizeof *s->cells);
    return BST_OK;
}

/* Adds a part of an edge to the cells to its right. y: from the row's middle. */
static inline void add_row(bst_area_cell *c, double y0, double y1, double light) {
    double y = 0.5 * (y0 + y1), high = y1 - y0, dy = light * high;
    c->row_light += dy;
    c->row_y += dy * y;
    c->row_yy += dy * (y * y + high * high * (1.0 / 12.0));
}

/* A part of an edge within a cell, from (x0, y0) to (x1, y1) from the cell's centre: what is to the
 * right of it. Along it, x = x + wide t and y = y + high t with t from -1/2 to 1/2, whose mean
 * square is 1/12. */
static inline void add_part(bst_area_cell *c, double x0, double y0, double x1, double y1,
                            double light) {
    double x = 0.5 * (x0 + x1), y = 0.5 * (y0 + y1), wide = x1 - x0, high = y1 - y0;
    double dy = light * high, x2 = wide * wide * (1.0 / 12.0), y2 = high * high * (1.0 / 12.0);
    double xy = wide * high * (1.0 / 12.0), right = 0.5 - x, yy = y * y + y2;
    double across = 0.5 * (0.25 - x * x - x2);
    c->light += (float)(dy * right);
    c->x += (float)(dy * across);
    c->y += (float)(dy * (y * right - xy));
    c->xx += (float)(dy * (1.0 / 3.0) * (0.125 - x * (x * x + 3.0 * x2)));
    c->xy += (float)(dy * (y * across - x * xy));
    c->yy += (float)(dy * (yy * right - 2.0 * y * xy));
    add_row(c + 1, y0, y1, light);
}

/* Adds an edge within a row of cells: x at its ends in cells, y from the row's middle. */
static void add_in_row(const bst_area_sums *s, bst_area_cell *row, const double x[2],
                       const double y[2], double light) {
    double low = x[0] < x[1] ? x[0] : x[1], high = x[0] < x[1] ? x[1] : x[0];
    if (low >= s->width) {
        return;
    }
    if (high <= 0.0) { /* left of the image */
        add_row(row, y[0], y[1], light);
        return;
    }
    int first = low < 0.0 ? -1 : (int)low, last = high >= s->width ? s->width : (int)high;
    if (first == last) {
        add_part(row + first, x[0] - first - 0.5, y[0], x[1] - first - 0.5, y[1], light);
        return;
    }
    double slope = (y[1] - y[0]) / (x[1] - x[0]);
    bool right = x[1] > x[0];
    double at = x[0], to = y[0];
    for (int n = first; n <= last; n++) {
        int i = right ? n : last - (n - first);
        bool end = n == last;
        double border = right ? i + 1.0 : i, next = end ? x[1] : border;
        double y_next = end ? y[1] : y[0] + (border - x[0]) * slope;
        if (i < 0) {
            add_row(row, to, y_next, light);
        } else if (i < s->width) {
            add_part(row + i, at - i - 0.5, to, next - i - 0.5, y_next, light);
        }
        at = next;
        to = y_next;
    }
}

void bst_area_sums_edge(bst_area_sums *s, bst_point2 a, bst_point2 b, double light) {
    if (b.y < a.y) {
        bst_point2 c = a;
        a = b;
        b = c;
        light = -light;
    }
    if (!(b.y > 0.0) || !(a.y < s->height) || a.y == b.y) {
        return;
    }
    double slope = (b.x - a.x) / (b.y - a.y), x = a.x, y = a.y;
    if (y < 0.0) {
        x -= y * slope;
        y = 0.0;
    }
    double end = b.y < s->height ? b.y : s->height;
    for (int j = (int)y; y < end; j++) {
        bool last = end <= j + 1.0;
        double y_next = last ? end : j + 1.0;
        double x_next = last && end == b.y ? b.x : a.x + (y_next - a.y) * slope;
        const double px[2] = {x, x_next}, py[2] = {y - j - 0.5, y_next - j - 0.5};
        add_in_row(s, s->cells + (size_t)j * ((size_t)s->width + 1), px, py, light);
        x = x_next;
        y = y_next;
    }
}

void bst_area_sums_polygon(bst_area_sums *s, const bst_point2 *p, int count, double light) {
    for (int i = 0; i < count; i++) {
        bst_area_sums_edge(s, p[i], p[i + 1 < count ? i + 1 : 0], -light);
    }
}

void bst_area_sums_add(bst_area_sums *to, const bst_area_sums *from) {
    assert(to->width == from->width && to->height == from->height);
    size_t count = ((size_t)to->width + 1) * (size_t)to->height;
    for (size_t i = 0; i < count; i++) {
        bst_area_cell *c = &to->cells[i];
        const bst_area_cell *d = &from->cells[i];
        c->row_light += d->row_light;
        c->row_y += d->row_y;
        c->row_yy += d->row_yy;
        c->light += d->light;
        c->x += d->x;
        c->y += d->y;
        c->xx += d->xx;
        c->xy += d->xy;
        c->yy += d->yy;
    }
}

void bst_area_sums_finish(const bst_area_sums *s, double cell_rad, bst_resolved_image *image) {
    assert(image->width == s->width && image->height == s->height && image->second);
    double most = 0.0;
    for (int j = 0; j < s->height; j++) {
        const bst_area_cell *from = s->cells + (size_t)j * ((size_t)s->width + 1);
        size_t row = (size_t)j * (size_t)s->width;
        bst_area_cell sum = {0};
        double v = (image->y0 + j + 0.5) * cell_rad;
        for (int i = 0; i < s->width; i++) {
            bst_resolved_cell *to = &image->cells[row + (size_t)i];
            bst_resolved_second *second = &image->second[row + (size_t)i];
            sum.row_light += from[i].row_light;
            sum.row_y += from[i].row_y;
            sum.row_yy += from[i].row_yy;
            double u = (image->x0 + i + 0.5) * cell_rad, c2 = 1.0 / (1.0 + u * u + v * v);
            double c3 = c2 * sqrt(c2), light = c3 * (sum.row_light + (double)from[i].light);
            to->light = (float)light;
            to->moment_x = (float)(c3 * (double)from[i].x);
            to->moment_y = (float)(c3 * (sum.row_y + (double)from[i].y));
            second->xx = (float)(c3 * (sum.row_light * (1.0 / 12.0) + (double)from[i].xx));
            second->xy = (float)(c3 * (double)from[i].xy);
            second->yy = (float)(c3 * (sum.row_yy + (double)from[i].yy));
            most = light > most ? light : most;
        }
    }
    float least = (float)(LEAST * most);
    for (size_t i = 0; i < (size_t)s->width * (size_t)s->height; i++) {
        if (!(image->cells[i].light > least)) {
            image->cells[i].light = 0.0F;
        }
    }
}
