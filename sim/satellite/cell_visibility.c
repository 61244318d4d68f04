/* Visible polygons of one cell of an image. */
#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "sim/satellite/visible_surface.h"

/* Corners of a polygon within a cell, at most; others are left out. A disc of half a pixel whose
 * border is right to 1e-5 px has 410, and some more to have as many for each side of the model. */
enum { CORNERS = 500 };

/* Overlaps narrower than that, in cells, are none: coordinates are floats. */
static const double SLIVER = 1e-6;

/* A fragment that is compared with the others of its cell. */
typedef struct bst_cell_polygon {
    const bst_surface_fragment *from;
    int count, order;       /* order: of adding */
    double low[2], high[2]; /* box */
    double least_m, most_m; /* nearness */
    bst_point2 p[CORNERS];
} bst_cell_polygon;

static double nearness(const bst_nearness *n, bst_point2 p) {
    return (double)n->middle_m + (double)n->x_m * p.x + (double)n->y_m * p.y;
}

/* Sets the polygon of a fragment; its order stays. */
static void make_polygon(const bst_visible_surface *s, const bst_surface_fragment *f,
                         bst_cell_polygon *q) {
    static const bst_point2 cell[4] = {{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}};
    q->from = f;
    q->count = f->count == 0 ? 4 : f->count < CORNERS ? f->count : CORNERS;
    q->low[0] = q->low[1] = q->least_m = INFINITY;
    q->high[0] = q->high[1] = q->most_m = -INFINITY;
    for (int i = 0; i < q->count; i++) {
        const bst_fragment_corner *c = &s->corners[f->first + i];
        bst_point2 p = f->count == 0 ? cell[i] : (bst_point2){(double)c->x, (double)c->y};
        double near_m = nearness(&f->near, p);
        q->p[i] = p;
        q->low[0] = p.x < q->low[0] ? p.x : q->low[0];
        q->low[1] = p.y < q->low[1] ? p.y : q->low[1];
        q->high[0] = p.x > q->high[0] ? p.x : q->high[0];
        q->high[1] = p.y > q->high[1] ? p.y : q->high[1];
        q->least_m = near_m < q->least_m ? near_m : q->least_m;
        q->most_m = near_m > q->most_m ? near_m : q->most_m;
    }
}

/* True if an edge of q has all of p on its outer side. */
static bool separates(const bst_cell_polygon *q, const bst_cell_polygon *p) {
    bst_point2 a = q->p[q->count - 1];
    for (int i = 0; i < q->count; i++) {
        bst_point2 b = q->p[i];
        double x = b.x - a.x, y = b.y - a.y, length = fabs(x) + fabs(y);
        if (length > 8.0 * SLIVER) {
            double margin = SLIVER * length + x * a.y - y * a.x;
            int k = 0;
            while (k < p->count && x * p->p[k].y - y * p->p[k].x <= margin) {
                k++;
            }
            if (k == p->count) {
                return true;
            }
        }
        a = b;
    }
    return false;
}

static bool overlap(const bst_cell_polygon *p, const bst_cell_polygon *q) {
    if (p->low[0] >= q->high[0] - SLIVER || q->low[0] >= p->high[0] - SLIVER ||
        p->low[1] >= q->high[1] - SLIVER || q->low[1] >= p->high[1] - SLIVER) {
        return false;
    }
    return !separates(p, q) && !separates(q, p);
}

/* Keeps what of a polygon has c + x X + y Y >= 0. */
static int keep(bst_point2 *p, int count, double c, double x, double y) {
    bst_point2 out[CORNERS];
    int n = 0;
    for (int i = 0; i < count; i++) {
        bst_point2 a = p[i], b = p[i + 1 < count ? i + 1 : 0];
        double da = c + x * a.x + y * a.y, db = c + x * b.x + y * b.y;
        if (da >= 0.0 && n < CORNERS) {
            out[n++] = a;
        }
        if ((da < 0.0) != (db < 0.0) && n < CORNERS) {
            double t = da / (da - db);
            out[n++] = (bst_point2){a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)};
        }
    }
    for (int i = 0; i < n; i++) {
        p[i] = out[i];
    }
    return n >= 3 ? n : 0;
}

/* The part of a polygon in which it is in front of another one that it overlaps, in `to`.
 * Returned: the number of its corners; 0: none. */
static int front_part(const bst_cell_polygon *p, const bst_cell_polygon *behind, double same_m,
                      bst_point2 *to) {
    for (int i = 0; i < p->count; i++) {
        to[i] = p->p[i];
    }
    if (p->least_m > behind->most_m) {
        return p->count;
    }
    /* their intersection */
    int n = p->count;
    const bst_point2 *q = behind->p;
    for (int i = 0; i < behind->count && n > 0; i++) {
        bst_point2 a = q[i], b = q[i + 1 < behind->count ? i + 1 : 0];
        n = keep(to, n, (b.y - a.y) * a.x - (b.x - a.x) * a.y, a.y - b.y, b.x - a.x);
    }
    const bst_nearness *near = &p->from->near, *far = &behind->from->near;
    double c = (double)near->middle_m - (double)far->middle_m;
    double x = (double)near->x_m - (double)far->x_m, y = (double)near->y_m - (double)far->y_m;
    double least = INFINITY, most = -INFINITY;
    for (int i = 0; i < n; i++) {
        double d = c + x * to[i].x + y * to[i].y;
        least = d < least ? d : least;
        most = d > most ? d : most;
    }
    if (n == 0 || (most <= same_m && least >= -same_m)) {
        return n > 0 && p->order < behind->order ? n : 0;
    }
    if (most > same_m && least < -same_m) { /* the planes cross */
        return keep(to, n, c, x, y);
    }
    return most > -least ? n : 0;
}

/* Adds the light of a polygon. */
static double add_light(const bst_point2 *p, int count, double light, bst_cell_view *out) {
    double area = 0.0, x = 0.0, y = 0.0;
    bst_point2 a = p[count - 1];
    for (int i = 0; i < count; i++) {
        bst_point2 b = p[i];
        double c = a.x * b.y - b.x * a.y;
        area += c;
        x += (a.x + b.x) * c;
        y += (a.y + b.y) * c;
        a = b;
    }
    out->light += 0.5 * light * area;
    out->light_x += light / 6.0 * x;
    out->light_y += light / 6.0 * y;
    return 0.5 * area;
}

/* Adds the light of all of a fragment. */
static double add_whole(const bst_surface_fragment *f, bst_cell_view *out) {
    out->light += (double)(f->light * f->area);
    out->light_x += (double)(f->light * f->area_x);
    out->light_y += (double)(f->light * f->area_y);
    return (double)f->area;
}

/* Adds what the others leave visible of a fragment. */
static double add_visible(const bst_cell_polygon *all, int count, int index, bst_polygon_clip *clip,
                          double same_m, bst_cell_view *out) {
    const bst_cell_polygon *p = &all[index];
    bool whole = true;
    for (int k = 0; k < count; k++) {
        const bst_cell_polygon *q = &all[k];
        bst_point2 cut[CORNERS];
        if (k == index || q->from->more_light || q->from->body == p->from->body ||
            q->most_m < p->least_m || !overlap(p, q)) {
            continue;
        }
        int corners = front_part(q, p, same_m, cut);
        if (corners == 0) {
            continue;
        }
        if (whole) {
            bst_polygon_clip_start(clip, p->p, p->count);
            whole = false;
        }
        bst_polygon_clip_subtract(clip, cut, corners, false);
        if (bst_polygon_clip_is_empty(clip)) {
            return 0.0;
        }
    }
    if (whole) {
        return add_whole(p->from, out);
    }
    double area = 0.0;
    for (int i = 0; i < clip->piece_count; i++) {
        const bst_polygon_piece *piece = &clip->pieces[i];
        if (piece->count > 0) {
            area +=
                add_light(clip->points + piece->first, piece->count, (double)p->from->light, out);
        }
    }
    return area;
}

/* Room for the polygons of a cell. */
static bst_status reserve(bst_ctx *ctx, bst_visible_surface *s, int count) {
    if (count > s->polygon_capacity) {
        int capacity = count + count / 2 + 8;
        bst_cell_polygon *items = realloc(s->polygons, (size_t)capacity * sizeof *items);
        if (!items) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d parts of facets in a cell",
                            capacity);
        }
        s->polygons = items;
        s->polygon_capacity = capacity;
    }
    return BST_OK;
}

/* True if fragments that are all in front of the cover tile the cell, as neighbours on one surface
 * do: their areas and first moments are those of the cell, and all are as near as each other. */
static bool tile_cell(const bst_visible_surface *s, const bst_surface_cell *cell) {
    static const float MOST = 1e-5F;
    float area = 0.0F, x = 0.0F, y = 0.0F, least = -INFINITY, most = INFINITY;
    for (int i = cell->first; i >= 0; i = s->fragments[i].next) {
        const bst_surface_fragment *f = &s->fragments[i];
        float half = 0.5F * (fabsf(f->near.x_m) + fabsf(f->near.y_m));
        if (!f->more_light) {
            area += f->area;
            x += f->area_x;
            y += f->area_y;
        }
        least = fmaxf(least, f->near.middle_m - half);
        most = fminf(most, f->near.middle_m + half);
        if (cell->part >= 0 &&
            f->near.middle_m - half <
                cell->is.cover.near.middle_m +
                    0.5F * (fabsf(cell->is.cover.near.x_m) + fabsf(cell->is.cover.near.y_m))) {
            return false;
        }
    }
    return fabsf(area - 1.0F) < MOST && fabsf(x) < MOST && fabsf(y) < MOST && least <= most;
}

/* Adds the light of the fragments of a cell that hide nothing of each other. */
static void add_all(const bst_visible_surface *s, const bst_surface_cell *cell,
                    bst_cell_view *out) {
    float most = 0.0F;
    for (int i = cell->first; i >= 0; i = s->fragments[i].next) {
        const bst_surface_fragment *f = &s->fragments[i];
        double area = add_whole(f, out);
        if (!f->more_light) {
            out->area += area;
            out->part = f->area > most ? f->part : out->part;
            most = fmaxf(most, f->area);
        }
    }
}

bst_status bst_cell_view_find(bst_ctx *ctx, bst_visible_surface *s, const bst_surface_cell *cell,
                              bst_polygon_clip *clip, double same_m, bst_cell_view *out) {
    bst_surface_fragment cover = {.area = 1.0F};
    double most = 0.0, behind_m = -INFINITY;
    int count = 0;
    bool several = false;
    *out = (bst_cell_view){.part = -1};
    if (cell->first >= 0 && tile_cell(s, cell)) {
        add_all(s, cell, out);
        return BST_OK;
    }
    if (cell->part >= 0) {
        cover.near = cell->is.cover.near;
        cover.light = cell->is.cover.light;
        cover.body = cell->body;
        cover.part = cell->part;
        BST_TRY(reserve(ctx, s, 1));
        make_polygon(s, &cover, &s->polygons[0]);
        s->polygons[0].order = -1;
        behind_m = s->polygons[0].least_m;
        count = 1;
    }
    for (int i = cell->first; i >= 0; i = s->fragments[i].next) {
        BST_TRY(reserve(ctx, s, count + 1));
        bst_cell_polygon *q = &s->polygons[count];
        make_polygon(s, &s->fragments[i], q);
        q->order = i;
        if (q->most_m >= behind_m) {
            several = several || q->from->body != s->polygons[0].from->body;
            count++;
        }
    }
    for (int i = 0; i < count; i++) {
        const bst_surface_fragment *f = s->polygons[i].from;
        double area =
            several ? add_visible(s->polygons, count, i, clip, same_m, out) : add_whole(f, out);
        area = f->more_light || f->front ? 0.0 : area;
        out->area += area;
        if (area > most) {
            most = area;
            out->part = f->part;
        }
    }
    return BST_OK;
}
