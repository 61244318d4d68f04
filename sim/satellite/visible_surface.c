#include "sim/satellite/visible_surface.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

/* Cover above which a cell is full. */
#define FULL 0.99999

static const bst_surface_cell empty = {.depth_m = INFINITY, .part = -1, .first = -1};

void bst_visible_surface_free(bst_visible_surface *s) {
    free(s->cells);
    free(s->fragments);
    *s = (bst_visible_surface){.width = 0};
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
    s->fragment_count = 0;
    s->low[0] = width;
    s->low[1] = height;
    s->high[0] = s->high[1] = 0;
    return BST_OK;
}

/* Joins a fragment to another one of the same cell if they are neighbours on a curved
 * surface. */
static bool join(bst_surface_fragment *to, const bst_surface_fragment *f) {
    static const float MOST = 1.0001F;
    float apart = fabsf(to->depth_m - f->depth_m);
    if (f->curved < 0 || to->curved != f->curved || apart > to->reach_m + f->reach_m ||
        to->area + f->area > MOST) {
        return false;
    }
    float low = fminf(to->depth_m - to->reach_m, f->depth_m - f->reach_m);
    float high = fmaxf(to->depth_m + to->reach_m, f->depth_m + f->reach_m);
    to->depth_m = 0.5F * (low + high);
    to->reach_m = 0.5F * (high - low);
    to->area += f->area;
    to->area_x += f->area_x;
    to->area_y += f->area_y;
    to->light += f->light;
    to->light_x += f->light_x;
    to->light_y += f->light_y;
    return true;
}

bst_status bst_visible_surface_add(bst_ctx *ctx, bst_visible_surface *s, int x, int y,
                                   const bst_surface_fragment *f) {
    assert(x >= 0 && y >= 0 && x < s->width && y < s->height);
    bst_surface_cell *cell = &s->cells[(size_t)y * (size_t)s->width + (size_t)x];
    s->low[0] = x < s->low[0] ? x : s->low[0];
    s->low[1] = y < s->low[1] ? y : s->low[1];
    s->high[0] = x >= s->high[0] ? x + 1 : s->high[0];
    s->high[1] = y >= s->high[1] ? y + 1 : s->high[1];
    if (f->depth_m >= cell->depth_m) {
        return BST_OK; /* behind a surface that covers the cell */
    }
    if (f->area >= (float)FULL && f->light_x == 0.0F && f->light_y == 0.0F) {
        cell->depth_m = f->depth_m;
        cell->light = f->light;
        cell->part = f->part;
        return BST_OK;
    }
    if (cell->first >= 0 && join(&s->fragments[cell->first], f)) {
        return BST_OK;
    }
    if (s->fragment_count == s->fragment_capacity) {
        int capacity = s->fragment_capacity ? 2 * s->fragment_capacity : 16384;
        bst_surface_fragment *items = realloc(s->fragments, (size_t)capacity * sizeof *items);
        if (!items) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d parts of facets", capacity);
        }
        s->fragments = items;
        s->fragment_capacity = capacity;
    }
    bst_surface_fragment *to = &s->fragments[s->fragment_count];
    *to = *f;
    to->next = cell->first;
    cell->first = s->fragment_count++;
    return BST_OK;
}

/* What of a cell is not yet covered, and its light. */
typedef struct open_cell {
    double area, x, y; /* uncovered area and its first moments */
    double before;     /* uncovered area in front of the current surface */
    double depth_m;    /* largest of the current surface */
    double light, light_x, light_y;
    double most; /* largest visible area of a fragment */
    int part;
} open_cell;

/* Covers a part of the cell by the next fragment, from front to back. */
static void cover(open_cell *o, const bst_surface_fragment *f, double gap_m) {
    if ((double)(f->depth_m - f->reach_m) > o->depth_m + gap_m) {
        o->before = o->area;
    }
    o->depth_m = fmax(o->depth_m, (double)(f->depth_m + f->reach_m));
    double area, share;
    if (f->area >= (float)FULL) { /* all that is left */
        area = o->area;
        share = area / (double)f->area;
        o->light_x += share * (double)f->light_x + (double)(f->light / f->area) * o->x;
        o->light_y += share * (double)f->light_y + (double)(f->light / f->area) * o->y;
        o->x = o->y = 0.0;
    } else { /* beside its own surface; independent of those in front */
        area = fmin((double)f->area * o->before, o->area);
        share = area / (double)f->area;
        o->light_x += share * (double)f->light_x;
        o->light_y += share * (double)f->light_y;
        o->x -= share * (double)f->area_x;
        o->y -= share * (double)f->area_y;
    }
    o->light += share * (double)f->light;
    o->area -= area;
    if (area > o->most) {
        o->most = area;
        o->part = f->part;
    }
}

/* Collects the fragments of a cell in front of its whole cover, nearest first. */
static int collect(const bst_visible_surface *s, const bst_surface_cell *cell, int most,
                   const bst_surface_fragment **list) {
    int count = 0;
    for (int i = cell->first; i >= 0; i = s->fragments[i].next) {
        const bst_surface_fragment *f = &s->fragments[i];
        if (f->depth_m >= cell->depth_m) {
            continue;
        }
        if (count == most && list[most - 1]->depth_m <= f->depth_m) {
            continue;
        }
        int k = count < most ? count++ : most - 1; /* the farthest is lost */
        for (; k > 0 && list[k - 1]->depth_m > f->depth_m; k--) {
            list[k] = list[k - 1];
        }
        list[k] = f;
    }
    return count;
}

double bst_visible_surface_resolve(bst_visible_surface *s, double gap_m, double cell_rad,
                                   double weight, bst_resolved_image *image) {
    enum { MOST = 64 };
    const bst_surface_fragment *list[MOST];
    double total = 0.0;
    assert(image->width == s->width && image->height == s->height);
    for (int y = s->low[1]; y < s->high[1]; y++) {
        for (int x = s->low[0]; x < s->high[0]; x++) {
            size_t at = (size_t)y * (size_t)s->width + (size_t)x;
            bst_surface_cell *cell = &s->cells[at];
            if (cell->part < 0 && cell->first < 0) {
                continue;
            }
            open_cell o = {.area = 1.0, .before = 1.0, .depth_m = -INFINITY, .part = -1};
            int count = 0;
            if (cell->first >= 0) {
                count = collect(s, cell, MOST, list);
            }
            for (int i = 0; i < count && o.area > 0.0; i++) {
                cover(&o, list[i], gap_m);
            }
            if (cell->part >= 0 && o.area > 0.0) {
                bst_surface_fragment behind = {.depth_m = cell->depth_m,
                                               .area = 1.0F,
                                               .light = cell->light,
                                               .part = cell->part};
                cover(&o, &behind, gap_m);
            }
            bst_resolved_cell *to = &image->cells[at];
            double u = (image->x0 + x + 0.5) * cell_rad, v = (image->y0 + y + 0.5) * cell_rad;
            double c2 = 1.0 / (1.0 + u * u + v * v), part = weight * c2 * sqrt(c2);
            to->light += (float)(part * o.light);
            to->moment_x += (float)(part * o.light_x);
            to->moment_y += (float)(part * o.light_y);
            to->cover += (float)(weight * (1.0 - o.area));
            image->part[at] = (int16_t)o.part;
            total += c2 * sqrt(c2) * o.light;
            *cell = empty;
        }
    }
    s->fragment_count = 0;
    s->low[0] = s->width;
    s->low[1] = s->height;
    s->high[0] = s->high[1] = 0;
    return total;
}
