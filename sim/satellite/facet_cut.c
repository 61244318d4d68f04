/* What others hide of a facet in a view. */
#include <math.h>
#include <string.h>

#include "sim/satellite/facet_layers_internal.h"
#include "sim/satellite/polygon_cut.h"

static void make_outline(const bst_facet_layers *l, int facet, bst_layers_outline *o) {
    const int *corner = l->net->corner + l->net->first[facet];
    int count = l->net->first[facet + 1] - l->net->first[facet];
    o->count = count;
    o->low[0] = o->low[1] = o->least = INFINITY;
    o->high[0] = o->high[1] = o->most = -INFINITY;
    for (int i = 0; i < count; i++) {
        int v = corner[count - 1 - i];
        bst_point2 p = l->at[v];
        double near = l->near[v];
        o->p[i] = p;
        o->low[0] = p.x < o->low[0] ? p.x : o->low[0];
        o->low[1] = p.y < o->low[1] ? p.y : o->low[1];
        o->high[0] = p.x > o->high[0] ? p.x : o->high[0];
        o->high[1] = p.y > o->high[1] ? p.y : o->high[1];
        o->least = near < o->least ? near : o->least;
        o->most = near > o->most ? near : o->most;
    }
}

/* True if the boxes of two facets share cells. */
static bool boxes_meet(const bst_layers_box *a, const bst_layers_box *b) {
    return a->low[0] < b->high[0] && b->low[0] < a->high[0] && a->low[1] < b->high[1] &&
           b->low[1] < a->high[1];
}

/* The part of a polygon, [room 2 * BST_LAYERS_CORNERS_MAX], where c[0] + c[1] x + c[2] y >= 0. */
static int keep(bst_point2 *p, int count, const double c[3]) {
    bst_point2 out[2 * BST_LAYERS_CORNERS_MAX];
    int n = 0;
    for (int i = 0; i < count; i++) {
        bst_point2 a = p[i], b = p[i + 1 < count ? i + 1 : 0];
        double da = c[0] + c[1] * a.x + c[2] * a.y, db = c[0] + c[1] * b.x + c[2] * b.y;
        if (da >= 0.0 && n < 2 * BST_LAYERS_CORNERS_MAX) {
            out[n++] = a;
        }
        if ((da < 0.0) != (db < 0.0) && n < 2 * BST_LAYERS_CORNERS_MAX) {
            double t = da / (da - db);
            out[n++] = (bst_point2){a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)};
        }
    }
    memcpy(p, out, (size_t)n * sizeof *out);
    return n >= 3 ? n : 0;
}

/* The sides of a facet in the view, counter-clockwise: from a corner along a way. */
typedef struct outline_sides {
    bst_point2 from[BST_LAYERS_CORNERS_MAX], way[BST_LAYERS_CORNERS_MAX];
} outline_sides;

/* Length of a side over the extent of its facet below which it has no direction. */
static const double TINY = 1e-12;

static void make_sides(const bst_layers_outline *o, outline_sides *out) {
    double tiny = TINY * (o->high[0] - o->low[0] + o->high[1] - o->low[1]);
    for (int i = 0; i < o->count; i++) {
        bst_point2 a = o->p[i], b = o->p[i + 1 < o->count ? i + 1 : 0];
        bst_point2 way = {b.x - a.x, b.y - a.y};
        bool any = fabs(way.x) > tiny || fabs(way.y) > tiny;
        out->from[i] = a;
        out->way[i] = any ? way : (bst_point2){NAN, NAN}; /* separates nothing */
    }
}

/* How far a place is to the left of a line, times the length of its part. */
static inline double left_of(bst_point2 from, bst_point2 way, bst_point2 p) {
    return way.x * (p.y - from.y) - way.y * (p.x - from.x);
}

/* True if a side of one of two facets has the other one on its outside: they do not overlap. */
static bool is_beside(const bst_facet_layers *l, int facet, const bst_layers_outline *own,
                      const outline_sides *sides) {
    const int *corner = l->net->corner + l->net->first[facet];
    int count = l->net->first[facet + 1] - l->net->first[facet];
    for (int i = 0; i < own->count; i++) {
        bool outside = !isnan(sides->way[i].x);
        for (int k = 0; k < count && outside; k++) {
            outside = left_of(sides->from[i], sides->way[i], l->at[corner[k]]) <= 0.0;
        }
        if (outside) {
            return true;
        }
    }
    for (int i = count - 1, last = 0; i >= 0; last = i--) { /* corners are clockwise */
        bst_point2 a = l->at[corner[last]], b = l->at[corner[i]], way = {b.x - a.x, b.y - a.y};
        bool outside = way.x != 0.0 || way.y != 0.0;
        for (int k = 0; k < own->count && outside; k++) {
            outside = left_of(a, way, own->p[k]) <= 0.0;
        }
        if (outside) {
            return true;
        }
    }
    return false;
}

/* What a facet hides of another one: the part where it is nearer, of their intersection or of all
 * of it.
 *
 * Given:     own, sides, own_plane  the facet behind
 * Returned:  number of corners in to[2 * BST_LAYERS_CORNERS_MAX] */
static int hidden_part(const bst_facet_layers *l, int facet, int behind,
                       const bst_layers_outline *own, const outline_sides *sides,
                       const double own_plane[3], bst_point2 *to) {
    bst_layers_outline other;
    bst_point2 work[2 * BST_LAYERS_CORNERS_MAX];
    double c[3], least = INFINITY, most = -INFINITY;
    if (is_beside(l, facet, own, sides) || !bst_facet_layers_plane(l, facet, c)) {
        return 0;
    }
    make_outline(l, facet, &other);
    if (other.least > own->most) { /* all of it that is before the facet */
        memcpy(to, other.p, (size_t)other.count * sizeof *to);
        return other.count;
    }
    int n = bst_polygon_intersection(other.p, other.count, own->p, own->count, work, to);
    if (n < 3) {
        return 0;
    }
    for (int i = 0; i < 3; i++) {
        c[i] -= own_plane[i];
    }
    for (int i = 0; i < n; i++) {
        double d = c[0] + c[1] * to[i].x + c[2] * to[i].y;
        least = d < least ? d : least;
        most = d > most ? d : most;
    }
    if (most <= l->same) { /* behind, or in the same plane: then the first one is seen */
        return least >= -l->same && facet < behind ? n : 0;
    }
    return least >= -l->same ? n : keep(to, n, c);
}

/* Number of vertices that two facets share. */
static int shared_vertices(const bst_facet_net *net, int f, int g) {
    int shared = 0;
    for (int i = net->first[f]; i < net->first[f + 1]; i++) {
        for (int k = net->first[g]; k < net->first[g + 1]; k++) {
            shared += net->corner[i] == net->corner[k];
        }
    }
    return shared;
}

/* True if another facet, as near as `own` somewhere, overlaps it: their planes may cross.
 * Neighbours at an edge lie on both of its sides unless one covers the middle of the other. */
static bool may_cross(const bst_facet_layers *l, int facet, int own_facet,
                      const bst_layers_outline *own, bst_point2 middle) {
    if (shared_vertices(l->net, facet, own_facet) > 1) {
        return bst_facet_layers_covers(l, facet, middle);
    }
    bst_layers_outline other;
    make_outline(l, facet, &other);
    return !bst_polygon_is_separate(own->p, own->count, other.p, other.count);
}

static bst_point2 middle_of(const bst_layers_outline *o) {
    bst_point2 middle = {0.0, 0.0};
    for (int i = 0; i < o->count; i++) {
        middle.x += o->p[i].x / o->count;
        middle.y += o->p[i].y / o->count;
    }
    return middle;
}

/* Finds it of a facet that others may cross. Unknown: one does, perhaps. */
static bst_layers_seen look_at_all(const bst_facet_layers *l, const bst_layers_box *box,
                                   const bst_layers_outline *own) {
    const int *at = l->bins[box->facet];
    bst_point2 middle = middle_of(own);
    bst_layers_seen seen = BST_LAYERS_SEEN_ALL;
    if (!(middle.x >= 0.0 && middle.y >= 0.0 && middle.x < l->width && middle.y < l->height)) {
        return BST_LAYERS_SEEN_UNKNOWN; /* borders off the grid are not known */
    }
    for (int j = at[2]; j <= at[3]; j++) {
        for (int i = j * l->bins_x + at[0]; i <= j * l->bins_x + at[1]; i++) {
            const bst_layers_box *b = &l->entries[l->bin_first[i]];
            const bst_layers_box *end = &l->entries[l->bin_first[i + 1]];
            for (; b < end && b->nearest <= box->farthest; b++) {
                if (!boxes_meet(b, box) || b->facet == box->facet) {
                    continue;
                }
                if (b->farthest >= box->nearest) {
                    if (may_cross(l, b->facet, box->facet, own, middle)) {
                        return BST_LAYERS_SEEN_UNKNOWN;
                    }
                } else if (seen == BST_LAYERS_SEEN_ALL &&
                           bst_facet_layers_covers(l, b->facet, middle)) {
                    seen = BST_LAYERS_SEEN_NOTHING;
                }
            }
        }
    }
    return seen;
}

/* The visibility of a facet without borders before it is that of its neighbours of that kind: finds
 * one whose visibility is known. */
static bst_layers_seen visibility_of_neighbours(const bst_facet_layers *l, int facet) {
    for (int i = l->net->first[facet]; i < l->net->first[facet + 1]; i++) {
        uint8_t known = l->known[l->net->beside[i]];
        if (known) {
            return known == BST_LAYERS_KNOWN_ALL ? BST_LAYERS_SEEN_ALL : BST_LAYERS_SEEN_NOTHING;
        }
    }
    return BST_LAYERS_SEEN_UNKNOWN;
}

/* What is seen of a facet. Unknown: borders that may hide a part of it cross it, and others may
 * cross it, too. */
static bst_layers_seen look_within_borders(bst_facet_layers *l, const bst_layers_box *box,
                                           const bst_layers_outline *own, const double plane[3]) {
    bst_layers_cross cross = BST_LAYERS_CROSS_NONE;
    bst_layers_seen seen = BST_LAYERS_SEEN_UNKNOWN;
    uint8_t apart = l->net->apart[box->facet];
    bool border = l->doubtful[box->facet] >= BST_LAYERS_AT_BORDER;
    if (border) {
        cross = bst_facet_borders_cross(l, box, own, plane);
        if (cross == BST_LAYERS_CROSS_BEFORE) {
            return apart ? bst_facet_layers_split(l, box, own, plane) : seen;
        }
    }
    bool clear = cross == BST_LAYERS_CROSS_NONE && apart == BST_NET_FREE &&
                 bst_facet_layers_is_within(l, box->facet);
    if (clear) {
        seen = visibility_of_neighbours(l, box->facet);
    }
    /* a facet that crosses this one may hide a part of it at a place with one layer elsewhere; its
     * borders then cross this one, perhaps behind it */
    if (seen == BST_LAYERS_SEEN_UNKNOWN && border && cross != BST_LAYERS_CROSS_BEHIND &&
        bst_facet_borders_layers(l, own) == 1) {
        seen = BST_LAYERS_SEEN_ALL;
    }
    if (seen == BST_LAYERS_SEEN_UNKNOWN) {
        seen = apart ? bst_facet_layers_point_visibility(l, box, plane, middle_of(own))
                     : look_at_all(l, box, own);
    }
    if (clear && seen != BST_LAYERS_SEEN_UNKNOWN) {
        l->known[box->facet] =
            seen == BST_LAYERS_SEEN_ALL ? BST_LAYERS_KNOWN_ALL : BST_LAYERS_KNOWN_NOTHING;
    }
    return seen;
}

bool bst_facet_layers_cut(bst_facet_layers *l, int facet) {
    bst_layers_outline own;
    outline_sides sides;
    double plane[3];
    bool whole = true;
    const int *at = l->bins[facet];
    const bst_layers_box *box = &l->boxes[facet];
    if (!bst_facet_layers_plane(l, facet, plane)) {
        return true;
    }
    make_outline(l, facet, &own);
    l->clip.piece_count = 0;
    bst_layers_seen seen = look_within_borders(l, box, &own, plane);
    if (seen != BST_LAYERS_SEEN_UNKNOWN) {
        return seen == BST_LAYERS_SEEN_ALL;
    }
    make_sides(&own, &sides);
    l->stamp++;
    l->seen[facet] = l->stamp;
    for (int n = 0; n < (at[1] - at[0] + 1) * (at[3] - at[2] + 1); n++) {
        int columns = at[1] - at[0] + 1;
        int bin = (at[2] + n / columns) * l->bins_x + at[0] + n % columns;
        const bst_layers_box *b = &l->entries[l->bin_first[bin]];
        const bst_layers_box *end = &l->entries[l->bin_first[bin + 1]];
        for (; b < end && b->nearest <= box->farthest; b++) {
            bst_point2 part[2 * BST_LAYERS_CORNERS_MAX];
            if (!boxes_meet(b, box) || l->seen[b->facet] == l->stamp) {
                continue;
            }
            l->seen[b->facet] = l->stamp;
            int corners = hidden_part(l, b->facet, facet, &own, &sides, plane, part);
            if (corners < 3) {
                continue;
            }
            if (whole) {
                bst_polygon_clip_start(&l->clip, own.p, own.count);
                whole = false;
            }
            bst_polygon_clip_subtract(&l->clip, part, corners, false);
            if (bst_polygon_clip_is_empty(&l->clip)) {
                return false;
            }
        }
    }
    return whole;
}

/* Distance from a border, in cells, up to which a side of what is left lies on it. */
static const double BESIDE = 1e-6;

/* Extends the part of a border, from t[0] to t[1] along it, on which what is left of a facet ends
 * within `part`. */
static void find_ends(const bst_polygon_clip *clip, const bst_layers_border *b,
                      const double part[2], double t[2]) {
    bst_point2 way = {b->b.x - b->a.x, b->b.y - b->a.y};
    double length2 = way.x * way.x + way.y * way.y, beside = BESIDE * sqrt(length2);
    for (int i = 0; i < clip->piece_count; i++) {
        const bst_point2 *p = clip->points + clip->pieces[i].first;
        for (int k = 0, count = clip->pieces[i].count; k < count; k++) {
            bst_point2 c = p[k], d = p[k + 1 < count ? k + 1 : 0];
            if (fabs(left_of(b->a, way, c)) > beside || fabs(left_of(b->a, way, d)) > beside) {
                continue;
            }
            double u = ((c.x - b->a.x) * way.x + (c.y - b->a.y) * way.y) / length2;
            double v = ((d.x - b->a.x) * way.x + (d.y - b->a.y) * way.y) / length2;
            double low = fmax(fmin(u, v), part[0]), high = fmin(fmax(u, v), part[1]);
            if (low < high) {
                t[0] = fmin(t[0], low);
                t[1] = fmax(t[1], high);
            }
        }
    }
}

/* Sets the side of a facet on which an end of a line is. */
static void find_side(const bst_facet_layers *l, int facet, const bst_layers_outline *own,
                      bst_layers_end *end, int k) {
    end->side[k] = (bst_point2){0.0, 0.0};
    end->beside[k] = -1;
    for (int i = 0; i < own->count; i++) {
        bst_point2 a = own->p[i], b = own->p[i + 1 < own->count ? i + 1 : 0];
        bst_point2 way = {b.x - a.x, b.y - a.y};
        if (fabs(left_of(a, way, end->place[k])) <= BESIDE * hypot(way.x, way.y)) {
            /* corners of the net are in the other order */
            int corner = (2 * own->count - 2 - i) % own->count;
            end->side[k] = way;
            end->beside[k] = l->net->beside[l->net->first[facet] + corner];
        }
    }
}

int bst_facet_layers_ends(const bst_facet_layers *l, int facet, bst_layers_end *out) {
    bst_layers_outline own;
    int borders[BST_LAYERS_ENDS], ends = 0;
    double plane[3];
    if (!bst_facet_layers_plane(l, facet, plane)) {
        return 0;
    }
    make_outline(l, facet, &own);
    int count =
        bst_facet_borders_before(l, &l->boxes[facet], &own, plane, borders, BST_LAYERS_ENDS);
    for (int n = 0; n < count; n++) {
        const bst_layers_border *b = &l->borders[borders[n]];
        double part[2], t[2] = {1.0, 0.0};
        if (bst_facet_borders_part(own.p, own.count, b->a, b->b, part) ==
            BST_LAYERS_PLACE_CROSSING) {
            find_ends(&l->clip, b, part, t);
        }
        bst_layers_end *end = &out[ends];
        *end = (bst_layers_end){.gap = 0.0};
        for (int i = 0; i < 2 && t[0] < t[1]; i++) {
            double x = b->a.x + t[i] * (b->b.x - b->a.x), y = b->a.y + t[i] * (b->b.y - b->a.y);
            double near = b->near[0] + t[i] * (b->near[1] - b->near[0]);
            end->place[i] = (bst_point2){x, y};
            find_side(l, facet, &own, end, i);
            end->gap = fmax(end->gap, near - plane[0] - plane[1] * x - plane[2] * y);
        }
        ends += end->gap > 0.0;
    }
    return count < 0 ? -1 : ends;
}
