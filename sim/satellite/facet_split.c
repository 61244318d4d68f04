/* What is seen of a facet that borders of nearer layers cross, but no other facet: it is split
 * along these borders, and each cell is seen as a whole or not at all. */
#include <math.h>
#include <string.h>

#include "sim/satellite/facet_layers_internal.h"

/* Borders across a facet, cells of it and their corners, at most. */
enum { BORDERS_MAX = 24, CELLS_MAX = 48, CORNERS_MAX = 16 };

/* Distance over the extent of a facet below which two corners are one. */
static const double TINY = 1e-12;

/* A convex cell of a facet, counter-clockwise. */
typedef struct cell {
    bst_point2 p[CORNERS_MAX];
    int count;
} cell;

/* True if a place is on the border of a facet or within it. */
static bool covers(const bst_facet_layers *l, int facet, bst_point2 p) {
    static const double ROUNDING = 1e-12;
    const int *corner = l->net->corner + l->net->first[facet];
    int count = l->net->first[facet + 1] - l->net->first[facet];
    for (int i = 0; i < count; i++) {
        bst_point2 a = l->at[corner[i]], b = l->at[corner[i + 1 < count ? i + 1 : 0]];
        if ((b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x) > ROUNDING) {
            return false;
        }
    }
    return true;
}

bool bst_facet_layers_covers(const bst_facet_layers *l, int facet, bst_point2 p) {
    return covers(l, facet, p);
}

bst_layers_seen bst_facet_layers_point_visibility(const bst_facet_layers *l,
                                                  const bst_layers_box *box, const double plane[3],
                                                  bst_point2 p) {
    if (!(p.x >= 0.0 && p.y >= 0.0 && p.x < l->width && p.y < l->height)) {
        return BST_LAYERS_SEEN_UNKNOWN;
    }
    int bin = (int)p.y / BST_LAYERS_BIN * l->bins_x + (int)p.x / BST_LAYERS_BIN;
    const bst_layers_box *b = &l->entries[l->bin_first[bin]];
    const bst_layers_box *end = &l->entries[l->bin_first[bin + 1]];
    double near = plane[0] + plane[1] * p.x + plane[2] * p.y;
    for (; b < end && b->nearest <= box->farthest; b++) {
        double other[3];
        if (b->facet == box->facet || (double)b->low[0] > p.x || (double)b->high[0] < p.x ||
            (double)b->low[1] > p.y || (double)b->high[1] < p.y || !covers(l, b->facet, p)) {
            continue;
        }
        if (b->farthest < box->nearest) {
            return BST_LAYERS_SEEN_NOTHING;
        }
        if (bst_facet_layers_plane(l, b->facet, other)) {
            double before = other[0] + other[1] * p.x + other[2] * p.y - near;
            if (before >= -l->same) {
                return before > l->same ? BST_LAYERS_SEEN_NOTHING : BST_LAYERS_SEEN_UNKNOWN;
            }
        }
    }
    return BST_LAYERS_SEEN_ALL;
}

/* Appends a corner that is not the one before it. False: there is no room. */
static bool push(cell *to, bst_point2 p, double tiny) {
    if (to->count > 0 && fabs(to->p[to->count - 1].x - p.x) <= tiny &&
        fabs(to->p[to->count - 1].y - p.y) <= tiny) {
        return true;
    }
    if (to->count == CORNERS_MAX) {
        return false;
    }
    to->p[to->count++] = p;
    return true;
}

/* Closes a cell: its last corner is not its first one. */
static void close_cell(cell *c, double tiny) {
    while (c->count > 1 && fabs(c->p[c->count - 1].x - c->p[0].x) <= tiny &&
           fabs(c->p[c->count - 1].y - c->p[0].y) <= tiny) {
        c->count--;
    }
}

/* Splits a cell along the line of a border that crosses it. False: it would have too many corners.
 *
 * Returned:  other  what is to the right of a-b; without corners if the border does not cross */
static bool split(cell *c, bst_point2 a, bst_point2 b, double tiny, cell *other) {
    double t[2], from[CORNERS_MAX];
    cell left = {.count = 0};
    other->count = 0;
    if (bst_facet_borders_part(c->p, c->count, a, b, t) != BST_LAYERS_PLACE_CROSSING) {
        return true;
    }
    for (int i = 0; i < c->count; i++) {
        from[i] = bst_point2_left_of(a, b, c->p[i]);
    }
    for (int i = 0; i < c->count; i++) {
        int n = i + 1 < c->count ? i + 1 : 0;
        if ((from[i] >= 0.0 && !push(&left, c->p[i], tiny)) ||
            (from[i] <= 0.0 && !push(other, c->p[i], tiny))) {
            return false;
        }
        if ((from[i] < 0.0 && from[n] > 0.0) || (from[i] > 0.0 && from[n] < 0.0)) {
            double u = from[i] / (from[i] - from[n]);
            bst_point2 p = {c->p[i].x + u * (c->p[n].x - c->p[i].x),
                            c->p[i].y + u * (c->p[n].y - c->p[i].y)};
            if (!push(&left, p, tiny) || !push(other, p, tiny)) {
                return false;
            }
        }
    }
    close_cell(&left, tiny);
    close_cell(other, tiny);
    if (left.count < 3 || other->count < 3) { /* one side is rounding */
        other->count = 0;
        return true;
    }
    memcpy(c, &left, sizeof left);
    return true;
}

bst_layers_seen bst_facet_layers_split(bst_facet_layers *l, const bst_layers_box *box,
                                       const bst_layers_outline *own, const double plane[3]) {
    cell cells[CELLS_MAX];
    int borders[BORDERS_MAX], count = 1, seen = 0;
    int crossing = bst_facet_borders_before(l, box, own, plane, borders, BORDERS_MAX);
    if (crossing < 0 || own->count > CORNERS_MAX) {
        return BST_LAYERS_SEEN_UNKNOWN;
    }
    double tiny = TINY * (own->high[0] - own->low[0] + own->high[1] - own->low[1]);
    memcpy(cells[0].p, own->p, (size_t)own->count * sizeof *own->p);
    cells[0].count = own->count;
    for (int n = 0; n < crossing; n++) {
        const bst_layers_border *border = &l->borders[borders[n]];
        for (int i = 0, end = count; i < end; i++) {
            if (count == CELLS_MAX ||
                !split(&cells[i], border->a, border->b, tiny, &cells[count])) {
                return BST_LAYERS_SEEN_UNKNOWN;
            }
            count += cells[count].count > 0;
        }
    }
    l->clip.piece_count = l->clip.point_count = 0;
    l->clip.overflow = false;
    l->clip.tiny = tiny;
    for (int i = 0; i < count; i++) {
        const cell *c = &cells[i];
        bst_point2 middle = {0.0, 0.0};
        for (int k = 0; k < c->count; k++) {
            middle.x += c->p[k].x / c->count;
            middle.y += c->p[k].y / c->count;
        }
        bst_layers_seen found = bst_facet_layers_point_visibility(l, box, plane, middle);
        if (found == BST_LAYERS_SEEN_UNKNOWN) {
            l->clip.piece_count = l->clip.point_count = 0;
            return found;
        }
        if (found == BST_LAYERS_SEEN_ALL) {
            memcpy(l->clip.points + l->clip.point_count, c->p, (size_t)c->count * sizeof *c->p);
            l->clip.pieces[l->clip.piece_count++] =
                (bst_polygon_piece){l->clip.point_count, c->count};
            l->clip.point_count += c->count;
            seen++;
        }
    }
    return seen == count ? BST_LAYERS_SEEN_ALL
           : seen == 0   ? BST_LAYERS_SEEN_NOTHING
                         : BST_LAYERS_SEEN_PIECES;
}
