#include "sim/satellite/visible_surface.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

/* Cover from which a cell is full. */
#define FULL 0.99999F

static const bst_surface_cell empty = {.part = -1, .first = -1, .kind = BST_CELL_EMPTY};

void bst_visible_surface_free(bst_visible_surface *s) {
    free(s->cells);
    free(s->fragments);
    free(s->corners);
    free(s->polygons);
    *s = (bst_visible_surface){.width = 0};
}

static void start_box(bst_visible_surface *s) {
    s->fragment_count = s->corner_count = 0;
    s->low[0] = s->width;
    s->low[1] = s->height;
    s->high[0] = s->high[1] = 0;
}

bst_status bst_visible_surface_begin(bst_ctx *ctx, bst_visible_surface *s, int width, int height) {
    size_t need = (size_t)width * (size_t)height;
    if (need > s->cell_capacity) {
        free(s->cells);
        s->cells = malloc(need * sizeof *s->cells);
        s->cell_capacity = s->cells ? need : 0;
        if (!s->cells) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for an image of %d x %d cells", width,
                            height);
        }
    }
    for (size_t i = 0; i < need; i++) {
        s->cells[i] = empty;
    }
    s->width = width;
    s->height = height;
    start_box(s);
    return BST_OK;
}

/* A cell that is used. */
static bst_surface_cell *use(bst_visible_surface *s, int x, int y) {
    assert(x >= 0 && y >= 0 && x < s->width && y < s->height);
    s->low[0] = x < s->low[0] ? x : s->low[0];
    s->low[1] = y < s->low[1] ? y : s->low[1];
    s->high[0] = x >= s->high[0] ? x + 1 : s->high[0];
    s->high[1] = y >= s->high[1] ? y + 1 : s->high[1];
    return &s->cells[(size_t)y * (size_t)s->width + (size_t)x];
}

void bst_visible_surface_reach(bst_visible_surface *s, int x, int y, int body) {
    bst_surface_cell *cell = use(s, x, y);
    if (body >= 0 && cell->kind == BST_CELL_EMPTY) {
        cell->kind = BST_CELL_OF_ONE;
        cell->body = body;
        cell->is.sum.area = cell->is.sum.light = 0.0F;
        cell->is.sum.light_x = cell->is.sum.light_y = 0.0F;
    } else if (body < 0 || cell->body != body) {
        cell->kind = BST_CELL_OF_SEVERAL;
    }
}

void bst_visible_surface_clear(bst_visible_surface *s, int x, int y) {
    *use(s, x, y) = empty;
}

/* Half of the range of nearness in a cell. */
static float half_range(const bst_nearness *n) {
    return 0.5F * (fabsf(n->x_m) + fabsf(n->y_m));
}

/* Room for one more fragment with corners. */
static bst_status reserve(bst_ctx *ctx, bst_visible_surface *s, int corners) {
    if (s->fragment_count == s->fragment_capacity) {
        int capacity = s->fragment_capacity ? 2 * s->fragment_capacity : 8192;
        bst_surface_fragment *items = realloc(s->fragments, (size_t)capacity * sizeof *items);
        if (!items) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d parts of facets", capacity);
        }
        s->fragments = items;
        s->fragment_capacity = capacity;
    }
    if (s->corner_count + corners > s->corner_capacity) {
        int capacity = 2 * s->corner_capacity + 32768 + corners;
        bst_fragment_corner *items = realloc(s->corners, (size_t)capacity * sizeof *items);
        if (!items) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d corners of facets", capacity);
        }
        s->corners = items;
        s->corner_capacity = capacity;
    }
    return BST_OK;
}

/* Adds to the sums of a cell of one body. Another body reaches it by rounding only, and shows where
 * the cell is left over. */
static void add_to_sum(bst_surface_cell *cell, const bst_surface_fragment *f) {
    float share = 1.0F;
    if (f->body != cell->body) {
        share = fminf(fmaxf(1.0F - cell->is.sum.area, 0.0F), 1.0F);
    }
    cell->is.sum.area += f->more_light ? 0.0F : share * f->area;
    cell->is.sum.light += share * f->light * f->area;
    cell->is.sum.light_x += share * f->light * f->area_x;
    cell->is.sum.light_y += share * f->light * f->area_y;
    cell->part = cell->part < 0 ? f->part : cell->part;
}

bst_status bst_visible_surface_add(bst_ctx *ctx, bst_visible_surface *s, int x, int y,
                                   const bst_surface_fragment *f, const bst_point2 *corners,
                                   int count) {
    bst_surface_cell *cell = use(s, x, y);
    if (cell->kind == BST_CELL_OF_ONE) {
        add_to_sum(cell, f);
        return BST_OK;
    }
    cell->kind = BST_CELL_OF_SEVERAL;
    float least = f->near.middle_m - half_range(&f->near);
    float most = f->near.middle_m + half_range(&f->near);
    bool whole = (count == 0 || f->area >= FULL) && !f->more_light;
    if (cell->part >= 0) {
        float middle = cell->is.cover.near.middle_m, half = half_range(&cell->is.cover.near);
        if (most < middle - half) {
            return BST_OK; /* behind a surface that covers the cell */
        }
        whole = whole && least > middle + half;
    }
    if (whole) {
        cell->is.cover.near = f->near;
        cell->is.cover.light = f->light;
        cell->part = f->part;
        cell->body = f->body;
        return BST_OK;
    }
    BST_TRY(reserve(ctx, s, count));
    bst_surface_fragment *to = &s->fragments[s->fragment_count];
    *to = *f;
    to->first = s->corner_count;
    to->count = count;
    for (int i = 0; i < count; i++) {
        s->corners[s->corner_count++] =
            (bst_fragment_corner){(float)corners[i].x, (float)corners[i].y};
    }
    to->next = cell->first;
    cell->first = s->fragment_count++;
    return BST_OK;
}

bst_status bst_visible_surface_resolve(bst_ctx *ctx, bst_visible_surface *s, bst_polygon_clip *clip,
                                       double same_m, double cell_rad, double weight,
                                       bst_resolved_image *image, double *total) {
    assert(image->width == s->width && image->height == s->height);
    *total = 0.0;
    for (int y = s->low[1]; y < s->high[1]; y++) {
        for (int x = s->low[0]; x < s->high[0]; x++) {
            size_t at = (size_t)y * (size_t)s->width + (size_t)x;
            bst_surface_cell *cell = &s->cells[at];
            if (cell->part < 0 && cell->first < 0) {
                *cell = empty;
                continue;
            }
            bst_cell_view seen;
            if (cell->kind == BST_CELL_OF_ONE) {
                seen = (bst_cell_view){(double)cell->is.sum.area, (double)cell->is.sum.light,
                                       (double)cell->is.sum.light_x, (double)cell->is.sum.light_y,
                                       cell->part};
            } else {
                BST_TRY(bst_cell_view_find(ctx, s, cell, clip, same_m, &seen));
            }
            bst_resolved_cell *to = &image->cells[at];
            double u = (image->x0 + x + 0.5) * cell_rad, v = (image->y0 + y + 0.5) * cell_rad;
            double c2 = 1.0 / (1.0 + u * u + v * v), part = weight * c2 * sqrt(c2);
            to->light += (float)(part * seen.light);
            to->moment_x += (float)(part * seen.light_x);
            to->moment_y += (float)(part * seen.light_y);
            to->cover += (float)(weight * fmin(seen.area, 1.0));
            image->part[at] = (int16_t)seen.part;
            *total += c2 * sqrt(c2) * seen.light;
            *cell = empty;
        }
    }
    start_box(s);
    return BST_OK;
}
