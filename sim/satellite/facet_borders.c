/* Borders of layers: edges of which one facet faces the view. Where none crosses a facet, others
 * hide all of it or nothing, but for planes that cross. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/satellite/facet_layers_internal.h"

/* Shortest chord of a facet, in cells, of which the middle is within it beyond rounding. */
static const double LEAST_CHORD = 1e-6;

/* Distance from a line, times the length of a side, below which a place touches it beyond rounding,
 * cells^2. */
static const double TOUCHING = 1e-7;

static bst_layers_border border_of(const bst_facet_layers *l, const bst_net_edge *edge,
                                   int layers) {
    bst_point2 a = l->at[edge->a], b = l->at[edge->b];
    bool right = b.x > a.x, down = b.y > a.y;
    return (bst_layers_border){.a = a,
                               .b = b,
                               .near = {l->near[edge->a], l->near[edge->b]},
                               .box = {{(float)(right ? a.x : b.x), (float)(down ? a.y : b.y)},
                                       {(float)(right ? b.x : a.x), (float)(down ? b.y : a.y)},
                                       .facet = -1},
                               .layers = layers,
                               .outside = -1};
}

bst_status bst_facet_borders_list(bst_ctx *ctx, bst_facet_layers *l) {
    l->border_count = 0;
    for (int e = 0; e < l->net->edge_count; e++) {
        const bst_net_edge *edge = &l->net->edges[e];
        int layers = l->facing[edge->left] - l->facing[edge->right];
        if (layers == 0) {
            continue;
        }
        if (l->border_count == l->border_capacity) {
            int capacity = 2 * l->border_capacity + 1024;
            void *borders = realloc(l->borders, (size_t)capacity * sizeof *l->borders);
            if (!borders) {
                return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d borders of facets",
                                capacity);
            }
            l->borders = borders;
            l->border_capacity = capacity;
        }
        l->borders[l->border_count++] = border_of(l, edge, layers);
    }
    return BST_OK;
}

/* Counts the borders of each bin, or with `fill` enters them. */
static void enter(bst_facet_layers *l, bool fill) {
    for (int n = 0; n < l->border_count; n++) {
        int at[4];
        const bst_layers_box *b = &l->borders[n].box;
        if (b->high[0] < 0.0F || b->high[1] < 0.0F || b->low[0] > (float)l->width ||
            b->low[1] > (float)l->height) {
            continue;
        }
        bst_layers_range(l, b, BST_LAYERS_BIN, at);
        for (int j = at[2]; j <= at[3]; j++) {
            for (int i = j * l->bins_x + at[0]; i <= j * l->bins_x + at[1]; i++) {
                if (fill) {
                    l->border_entries[l->border_first[i]++] = n;
                } else {
                    l->border_first[i + 1]++;
                }
            }
        }
    }
}

bst_status bst_facet_borders_enter(bst_ctx *ctx, bst_facet_layers *l) {
    int bins = l->bins_x * l->bins_y;
    memset(l->border_first, 0, ((size_t)bins + 1) * sizeof *l->border_first);
    enter(l, false);
    for (int i = 0; i < bins; i++) {
        l->border_first[i + 1] += l->border_first[i];
    }
    int count = l->border_first[bins];
    if (count > l->border_entry_capacity) {
        free(l->border_entries);
        l->border_entry_capacity = count + count / 2 + 1024;
        l->border_entries = malloc((size_t)l->border_entry_capacity * sizeof *l->border_entries);
        if (!l->border_entries) {
            l->border_entry_capacity = 0;
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the places of %d borders", count);
        }
    }
    enter(l, true);
    /* filling moved the first entry of each bin to that of the next one */
    memmove(l->border_first + 1, l->border_first, (size_t)bins * sizeof *l->border_first);
    l->border_first[0] = 0;
    return BST_OK;
}

bst_layers_place bst_facet_borders_part(const bst_point2 *p, int count, bst_point2 a, bst_point2 b,
                                        double t[2]) {
    double least = INFINITY, most = -INFINITY;
    t[0] = 0.0;
    t[1] = 1.0;
    for (int i = 0, last = count - 1; i < count; last = i++) {
        double from = bst_point2_left_of(p[last], p[i], a),
               to = bst_point2_left_of(p[last], p[i], b);
        if (from <= 0.0 && to <= 0.0) {
            return from < -TOUCHING && to < -TOUCHING ? BST_LAYERS_PLACE_APART
                                                      : BST_LAYERS_PLACE_TOUCHING;
        }
        if (from < 0.0) {
            double at = from / (from - to);
            t[0] = at > t[0] ? at : t[0];
        } else if (to < 0.0) {
            double at = from / (from - to);
            t[1] = at < t[1] ? at : t[1];
        }
        double side = bst_point2_left_of(a, b, p[i]);
        least = side < least ? side : least;
        most = side > most ? side : most;
    }
    return least < 0.0 && most > 0.0              ? BST_LAYERS_PLACE_CROSSING
           : least > TOUCHING || most < -TOUCHING ? BST_LAYERS_PLACE_APART
                                                  : BST_LAYERS_PLACE_TOUCHING;
}

/* True if a border is behind the plane of a facet at a place t along it. */
static bool is_behind(const bst_facet_layers *l, const bst_layers_border *b, const double plane[3],
                      double t) {
    double x = b->a.x + t * (b->b.x - b->a.x), y = b->a.y + t * (b->b.y - b->a.y);
    double near = b->near[0] + t * (b->near[1] - b->near[0]);
    return near < plane[0] + plane[1] * x + plane[2] * y - l->same;
}

/* True if two boxes share a place, or touch. */
static bool boxes_meet(const bst_layers_box *a, const bst_layers_box *b) {
    return a->low[0] <= b->high[0] && b->low[0] <= a->high[0] && a->low[1] <= b->high[1] &&
           b->low[1] <= a->high[1];
}

static bool is_same(bst_point2 p, bst_point2 q) {
    return p.x == q.x && p.y == q.y;
}

/* True if two borders cross or touch elsewhere than in a common end. */
static bool borders_meet(const bst_layers_border *p, const bst_layers_border *q) {
    if (is_same(p->a, q->a) || is_same(p->a, q->b) || is_same(p->b, q->a) || is_same(p->b, q->b)) {
        return false;
    }
    double a = bst_point2_left_of(p->a, p->b, q->a), b = bst_point2_left_of(p->a, p->b, q->b);
    double c = bst_point2_left_of(q->a, q->b, p->a), d = bst_point2_left_of(q->a, q->b, p->b);
    return !((a > 0.0 && b > 0.0) || (a < 0.0 && b < 0.0) || (c > 0.0 && d > 0.0) ||
             (c < 0.0 && d < 0.0));
}

bool bst_facet_borders_meet(const bst_facet_layers *l, int border) {
    const bst_layers_border *own = &l->borders[border];
    int at[4];
    bst_layers_range(l, &own->box, BST_LAYERS_BIN, at);
    for (int j = at[2]; j <= at[3]; j++) {
        int first = l->border_first[j * l->bins_x + at[0]];
        int end = l->border_first[j * l->bins_x + at[1] + 1];
        for (int n = first; n < end; n++) {
            const bst_layers_border *b = &l->borders[l->border_entries[n]];
            if (b != own && boxes_meet(&b->box, &own->box) && borders_meet(b, own)) {
                return true;
            }
        }
    }
    return false;
}

/* True if all of a border is farther than all of a facet. */
static bool is_far_behind(const bst_facet_layers *l, const bst_layers_border *b,
                          const bst_layers_outline *own) {
    double least = own->least - l->same;
    return b->near[0] < least && b->near[1] < least;
}

bst_layers_cross bst_facet_borders_cross(const bst_facet_layers *l, const bst_layers_box *box,
                                         const bst_layers_outline *own, const double plane[3]) {
    const int *at = l->bins[box->facet];
    const bool apart = l->net->apart[box->facet];
    bst_layers_cross found = BST_LAYERS_CROSS_NONE;
    for (int j = at[2]; j <= at[3]; j++) {
        int first = l->border_first[j * l->bins_x + at[0]];
        int end = l->border_first[j * l->bins_x + at[1] + 1];
        for (int n = first; n < end; n++) {
            const bst_layers_border *b = &l->borders[l->border_entries[n]];
            double t[2];
            if (!boxes_meet(&b->box, box) ||
                ((apart || found == BST_LAYERS_CROSS_BEHIND) && is_far_behind(l, b, own))) {
                continue;
            }
            bst_layers_place place = bst_facet_borders_part(own->p, own->count, b->a, b->b, t);
            if (place == BST_LAYERS_PLACE_CROSSING) {
                if (!is_behind(l, b, plane, t[0]) || !is_behind(l, b, plane, t[1])) {
                    return BST_LAYERS_CROSS_BEFORE;
                }
                found = apart ? found : BST_LAYERS_CROSS_BEHIND;
            } else if (place == BST_LAYERS_PLACE_TOUCHING && found == BST_LAYERS_CROSS_NONE) {
                found = BST_LAYERS_CROSS_TOUCHING;
            }
        }
    }
    return found;
}

int bst_facet_borders_before(const bst_facet_layers *l, const bst_layers_box *box,
                             const bst_layers_outline *own, const double plane[3], int *out,
                             int room) {
    const int *at = l->bins[box->facet];
    int count = 0;
    for (int j = at[2]; j <= at[3]; j++) {
        int first = l->border_first[j * l->bins_x + at[0]];
        int end = l->border_first[j * l->bins_x + at[1] + 1];
        for (int n = first; n < end; n++) {
            int entry = l->border_entries[n], k = 0;
            const bst_layers_border *b = &l->borders[entry];
            double t[2];
            if (!boxes_meet(&b->box, box) || is_far_behind(l, b, own) ||
                bst_facet_borders_part(own->p, own->count, b->a, b->b, t) !=
                    BST_LAYERS_PLACE_CROSSING ||
                (is_behind(l, b, plane, t[0]) && is_behind(l, b, plane, t[1]))) {
                continue;
            }
            while (k < count && out[k] != entry) {
                k++;
            }
            if (k == room) {
                return -1;
            }
            out[k] = entry;
            count = k == count ? count + 1 : count;
        }
    }
    return count;
}

/* Middle of a facet's chord at a height. False: it has none. */
static bool chord_middle(const bst_layers_outline *o, double y, double *x) {
    double low = INFINITY, high = -INFINITY;
    for (int i = 0, last = o->count - 1; i < o->count; last = i++) {
        bst_point2 a = o->p[last], b = o->p[i];
        if ((a.y < y) != (b.y < y)) {
            double cross = a.x + (y - a.y) * ((b.x - a.x) / (b.y - a.y));
            low = cross < low ? cross : low;
            high = cross > high ? cross : high;
        }
    }
    *x = 0.5 * (low + high);
    return high - low > LEAST_CHORD;
}

int bst_facet_borders_layers(const bst_facet_layers *l, const bst_layers_outline *own) {
    double x = 0.0;
    int middle = (int)floor(0.5 * (own->low[1] + own->high[1])), row = middle;
    bool found = false;
    for (int n = 0; n < 3 && !found; n++) {
        row = middle + (n == 1 ? -1 : n == 2 ? 1 : 0);
        double y = row + 0.5;
        found = row >= 0 && row < l->height && own->low[1] < y && own->high[1] > y &&
                chord_middle(own, y, &x) && x >= 0.0 && x < l->width;
    }
    if (!found) {
        return -1;
    }
    int low = l->row_first[row], high = l->row_first[row + 1], first = low;
    while (low < high) { /* the first one to its right */
        int at = (low + high) / 2;
        *(l->crossings[at].x <= x ? &low : &high) = l->crossings[at].x <= x ? at + 1 : at;
    }
    return low > first ? l->crossings[low - 1].layers : 0;
}
