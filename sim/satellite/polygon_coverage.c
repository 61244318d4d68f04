#include "sim/satellite/polygon_coverage.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Room for the corners that cuts add. */
enum { ROOM = BST_COVERAGE_CORNERS_MAX + 8 };

typedef struct polygon {
    bst_point2 p[ROOM];
    int count;
} polygon;

void bst_polygon_coverage_free(bst_polygon_coverage *list) {
    free(list->cells);
    free(list->corners);
    *list = (bst_polygon_coverage){.count = 0};
}

void bst_polygon_coverage_clear(bst_polygon_coverage *list) {
    list->count = list->corner_count = 0;
}

/* Makes room for corners of one more cell. */
static bst_status reserve_corners(bst_ctx *ctx, bst_polygon_coverage *list, int more) {
    if (list->corner_count + more > list->corner_capacity) {
        int capacity = 2 * list->corner_capacity + 4096 + more;
        bst_point2 *corners = realloc(list->corners, (size_t)capacity * sizeof *corners);
        if (!corners) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the %d corners of a polygon",
                            capacity);
        }
        list->corners = corners;
        list->corner_capacity = capacity;
    }
    return BST_OK;
}

static bst_status push(bst_ctx *ctx, bst_polygon_coverage *list, const bst_coverage_cell *cell) {
    if (list->count == list->capacity) {
        int capacity = list->capacity ? 2 * list->capacity : 1024;
        bst_coverage_cell *cells = realloc(list->cells, (size_t)capacity * sizeof *cells);
        if (!cells) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the %d cells of a polygon",
                            capacity);
        }
        list->cells = cells;
        list->capacity = capacity;
    }
    list->cells[list->count++] = *cell;
    return BST_OK;
}

/* Copies the corners in use. */
static void copy(polygon *to, const polygon *from) {
    to->count = from->count;
    memcpy(to->p, from->p, (size_t)from->count * sizeof from->p[0]);
}

static double coordinate(bst_point2 p, int axis) {
    return axis == 0 ? p.x : p.y;
}

static void add_corner(polygon *to, bst_point2 p) {
    if (to->count < ROOM) {
        to->p[to->count++] = p;
    }
}

/* Cuts a convex polygon at a line x = at (axis 0) or y = at (axis 1); `low` or `high` may be NULL.
 * Corners on the line have its exact coordinate. */
static void cut(const polygon *from, int axis, double at, polygon *low, polygon *high) {
    if (low) {
        low->count = 0;
    }
    if (high) {
        high->count = 0;
    }
    for (int i = 0; i < from->count; i++) {
        bst_point2 a = from->p[i], b = from->p[i + 1 < from->count ? i + 1 : 0];
        double da = coordinate(a, axis) - at, db = coordinate(b, axis) - at;
        if (low && da <= 0.0) {
            add_corner(low, a);
        }
        if (high && da >= 0.0) {
            add_corner(high, a);
        }
        if ((da < 0.0 && db > 0.0) || (da > 0.0 && db < 0.0)) {
            double t = da / (da - db);
            bst_point2 c = {a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)};
            *(axis == 0 ? &c.x : &c.y) = at;
            if (low) {
                add_corner(low, c);
            }
            if (high) {
                add_corner(high, c);
            }
        }
    }
}

static void extent(const polygon *p, int axis, double *least, double *most) {
    *least = INFINITY;
    *most = -INFINITY;
    for (int i = 0; i < p->count; i++) {
        double c = coordinate(p->p[i], axis);
        *least = c < *least ? c : *least;
        *most = c > *most ? c : *most;
    }
}

/* Appends one cell with the part of the polygon within it. */
static bst_status add_cell(bst_ctx *ctx, bst_polygon_coverage *list, const polygon *p, int x,
                           int y) {
    double area = 0.0, mx = 0.0, my = 0.0, cx = x + 0.5, cy = y + 0.5;
    if (p->count < 3) {
        return BST_OK;
    }
    BST_TRY(reserve_corners(ctx, list, p->count));
    bst_point2 *q = list->corners + list->corner_count;
    for (int i = 0; i < p->count; i++) {
        q[i] = (bst_point2){p->p[i].x - cx, p->p[i].y - cy};
    }
    for (int i = 0, last = p->count - 1; i < p->count; last = i++) {
        double c = q[last].x * q[i].y - q[i].x * q[last].y;
        area += c;
        mx += (q[last].x + q[i].x) * c;
        my += (q[last].y + q[i].y) * c;
    }
    double sign = area < 0.0 ? -1.0 : 1.0;
    bst_coverage_cell cell = {
        x, y, 1, 0.5 * sign * area, sign * mx / 6.0, sign * my / 6.0, list->corner_count, p->count};
    if (!(cell.area > 1e-14)) {
        return BST_OK;
    }
    for (int i = 0, k = p->count - 1; area < 0.0 && i < k; i++, k--) {
        bst_point2 swap = q[i];
        q[i] = q[k];
        q[k] = swap;
    }
    list->corner_count += p->count;
    return push(ctx, list, &cell);
}

/* Appends the cells of the part of a row; destroys it. */
static bst_status add_cells(bst_ctx *ctx, bst_polygon_coverage *list, polygon *row, int y) {
    double least, most;
    if (row->count < 3) {
        return BST_OK;
    }
    extent(row, 0, &least, &most);
    polygon cell, rest;
    for (int x = (int)floor(least); x < most; x++) {
        if (x + 1 >= most) {
            return add_cell(ctx, list, row, x, y);
        }
        cut(row, 0, x + 1, &cell, &rest);
        BST_TRY(add_cell(ctx, list, &cell, x, y));
        copy(row, &rest);
    }
    return BST_OK;
}

/* Cells of a row, from *from to *to, that the polygon covers as a whole: those between its sections
 * with both borders of the row. */
static void full_cells(const polygon *row, int y, int *from, int *to) {
    double left = -INFINITY, right = INFINITY;
    for (int border = y; border <= y + 1; border++) {
        double least = INFINITY, most = -INFINITY;
        for (int i = 0; i < row->count; i++) {
            if (row->p[i].y == border) {
                least = fmin(least, row->p[i].x);
                most = fmax(most, row->p[i].x);
            }
        }
        left = fmax(left, least);
        right = fmin(right, most);
    }
    *from = *to = 0;
    if (right - left >= 1.0) {
        *from = (int)ceil(left);
        *to = (int)floor(right);
    }
}

static bst_status add_row(bst_ctx *ctx, bst_polygon_coverage *list, polygon *row, int y) {
    int from, to;
    full_cells(row, y, &from, &to);
    if (to <= from) {
        return add_cells(ctx, list, row, y);
    }
    polygon side;
    cut(row, 0, from, &side, NULL);
    BST_TRY(add_cells(ctx, list, &side, y));
    bst_coverage_cell run = {from, y, to - from, 1.0, 0.0, 0.0, 0, 0};
    BST_TRY(push(ctx, list, &run));
    cut(row, 0, to, NULL, &side);
    return add_cells(ctx, list, &side, y);
}

bst_status bst_polygon_coverage_add(bst_ctx *ctx, bst_polygon_coverage *list,
                                    const bst_point2 *corners, int count, int width, int height) {
    assert(list && corners && count <= BST_COVERAGE_CORNERS_MAX);
    polygon rest, part, row;
    rest.count = 0;
    for (int i = 0; i < count; i++) {
        add_corner(&rest, corners[i]);
    }
    const double border[2] = {width, height};
    for (int axis = 0; axis < 2; axis++) {
        double least, most;
        extent(&rest, axis, &least, &most);
        if (least < 0.0) {
            cut(&rest, axis, 0.0, NULL, &part);
            copy(&rest, &part);
        }
        if (most > border[axis]) {
            cut(&rest, axis, border[axis], &part, NULL);
            copy(&rest, &part);
        }
    }
    if (rest.count < 3) {
        return BST_OK;
    }
    double least, most;
    extent(&rest, 1, &least, &most);
    for (int y = (int)floor(least); y < most; y++) {
        if (y + 1 >= most) {
            return add_row(ctx, list, &rest, y);
        }
        cut(&rest, 1, y + 1, &row, &part);
        if (row.count >= 3) {
            BST_TRY(add_row(ctx, list, &row, y));
        }
        copy(&rest, &part);
    }
    return BST_OK;
}
