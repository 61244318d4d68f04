#include "sim/satellite/polygon_covers.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/simd.h"

/* Half planes of all sets of a list; corners of all intersections that are kept at the same time.
 */
enum { SIDES = 1024, WORK = 8192 };

/* Length of an edge over the extent of its polygon below which it has no direction. */
static const double TINY = 1e-12;

/* Corners of an intersection, at most, and those computed at a time. */
enum { CORNERS = 4 * BST_POLYGON_CORNERS_MAX, BLOCK = 4, APART = 40 };

/* Intersections after which bst_polygon_uncovered_area gives up: their number can double with each
 * set. */
enum { INTERSECTIONS_MAX = 200 };

bst_status bst_polygon_covers_create(bst_ctx *ctx, bst_polygon_covers *covers) {
    *covers = (bst_polygon_covers){.sides = malloc(SIDES * sizeof *covers->sides),
                                   .work = malloc(WORK * sizeof *covers->work),
                                   .corners = malloc(SIDES * sizeof *covers->corners)};
    if (!covers->sides || !covers->work || !covers->corners) {
        bst_polygon_covers_free(covers);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the shadows of a satellite");
    }
    return BST_OK;
}

void bst_polygon_covers_free(bst_polygon_covers *covers) {
    free(covers->sides);
    free(covers->work);
    free(covers->corners);
    *covers = (bst_polygon_covers){0};
}

void bst_polygon_covers_clear(bst_polygon_covers *covers) {
    covers->count = 0;
    bst_polygon_covers_restart(covers);
}

void bst_polygon_covers_restart(bst_polygon_covers *covers) {
    covers->pending = 0;
    if (covers->count < BST_POLYGON_COVERS_MAX) {
        covers->corner_first[covers->count + 1] = covers->corner_first[covers->count];
    }
}

bool bst_polygon_covers_add(bst_polygon_covers *covers, bst_half_plane side) {
    int at = covers->first[covers->count] + covers->pending;
    if (at >= SIDES) {
        return false;
    }
    covers->sides[at] = side;
    covers->pending++;
    return true;
}

bst_point2 *bst_polygon_covers_corners(bst_polygon_covers *covers, int count) {
    int i = covers->count, first = covers->corner_first[i];
    if (i >= BST_POLYGON_COVERS_MAX || first + count > SIDES) {
        return NULL;
    }
    covers->corner_first[i + 1] = first + count;
    covers->corner_sides[i] = covers->pending;
    return covers->corners + first;
}

bool bst_polygon_covers_end(bst_polygon_covers *covers) {
    if (covers->count >= BST_POLYGON_COVERS_MAX) {
        return false;
    }
    covers->first[covers->count + 1] = covers->first[covers->count] + covers->pending;
    covers->count++;
    bst_polygon_covers_restart(covers);
    return true;
}

int bst_half_planes_of(const bst_point2 *p, int count, bst_half_planes *sides) {
    int blocks = (count + BST_HALF_PLANES - 1) / BST_HALF_PLANES;
    double extent = 0.0;
    for (int i = 1; i < count; i++) {
        double far = fabs(p[i].x - p[0].x) + fabs(p[i].y - p[0].y);
        extent = far > extent ? far : extent;
    }
    for (int i = 0; i < BST_HALF_PLANES * blocks; i++) {
        bst_half_planes *to = &sides[i / BST_HALF_PLANES];
        int lane = i % BST_HALF_PLANES;
        const bst_point2 *a = &p[i < count ? i : 0], *b = &p[i + 1 < count ? i + 1 : 0];
        double x = b->x - a->x, y = b->y - a->y, tiny = TINY * extent;
        bool any = i < count && (fabs(x) > tiny || fabs(y) > tiny);
        to->u[lane] = any ? -y : 0.0;
        to->v[lane] = any ? x : 0.0;
        to->w[lane] = any ? y * a->x - x * a->y : 1.0;
    }
    return blocks;
}

/* Lowest value that each half plane has in a box. Returned: the least of their highest ones. */
BST_CLONES_256 static double extremes_in_box(const bst_half_planes *sides, int blocks,
                                             const double bounds[4], double *low) {
    double x = 0.5 * (bounds[0] + bounds[1]), y = 0.5 * (bounds[2] + bounds[3]);
    double half_x = 0.5 * (bounds[1] - bounds[0]), half_y = 0.5 * (bounds[3] - bounds[2]);
    double least[BST_HALF_PLANES];
    for (int k = 0; k < BST_HALF_PLANES; k++) {
        least[k] = INFINITY;
    }
    for (int b = 0; b < blocks; b++) {
        for (int k = 0; k < BST_HALF_PLANES; k++) {
            double u = sides[b].u[k], v = sides[b].v[k];
            double middle = u * x + v * y + sides[b].w[k];
            double reach = fabs(u) * half_x + fabs(v) * half_y, high = middle + reach;
            low[BST_HALF_PLANES * b + k] = middle - reach;
            least[k] = high < least[k] ? high : least[k];
        }
    }
    double two[2] = {least[0] < least[1] ? least[0] : least[1],
                     least[2] < least[3] ? least[2] : least[3]};
    return two[0] < two[1] ? two[0] : two[1];
}

int bst_half_planes_crossing(const bst_half_planes *sides, int blocks, const bst_point2 *p,
                             int count, const double bounds[4], int *indices) {
    double low[BST_POLYGON_CORNERS_MAX + BST_HALF_PLANES];
    int found = 0, n = BST_HALF_PLANES * blocks;
    assert(n < BST_POLYGON_CORNERS_MAX + BST_HALF_PLANES);
    if (extremes_in_box(sides, blocks, bounds, low) <= 0.0) {
        return BST_HALF_PLANES_APART;
    }
    for (int i = 0; i < n; i++) {
        if (low[i] >= 0.0) {
            continue;
        }
        const bst_half_planes *s = &sides[i / BST_HALF_PLANES];
        int lane = i % BST_HALF_PLANES, within = 0, outside = 0;
        double u = s->u[lane], v = s->v[lane], w = s->w[lane];
        for (int k = 0; k < count; k++) {
            double value = u * p[k].x + v * p[k].y + w;
            within += value >= 0.0;
            outside += value <= 0.0;
        }
        if (outside == count) {
            return BST_HALF_PLANES_APART;
        }
        if (within < count) {
            indices[found++] = i;
        }
    }
    return found;
}

/* A polygon by coordinates, filled up to whole blocks with copies of its last corner. `apart` keeps
 * the same corners' coordinates at different places of a page of memory. */
typedef struct corners {
    double x[CORNERS], apart[APART], y[CORNERS], apart_too[APART];
    int count;
} corners;

static void fill_up(corners *c) {
    for (int i = c->count; i % BLOCK != 0; i++) {
        c->x[i] = c->x[c->count - 1];
        c->y[i] = c->y[c->count - 1];
    }
}

/* Values of a half plane at the corners. Returned: how many of them are below 0. */
static inline int values_at(const corners *c, bst_half_plane s, double *value) {
    uint64_t below[BLOCK] = {0};
    for (int i = 0; i < c->count; i += BLOCK) {
        for (int k = 0; k < BLOCK; k++) {
            uint64_t bits; /* of which the highest is the sign */
            value[i + k] = s.u * c->x[i + k] + s.v * c->y[i + k] + s.w;
            memcpy(&bits, &value[i + k], sizeof bits);
            below[k] += bits >> 63;
        }
    }
    int copies = (BLOCK - c->count % BLOCK) % BLOCK;
    int found = (int)(below[0] + below[1] + below[2] + below[3]);
    return found - (signbit(value[c->count - 1]) ? copies : 0);
}

/* Cuts a polygon by the values of a half plane at its corners. There is room for `room` of them, at
 * most CORNERS / 2, which suffices but for polygons that rounding made concave; each corner of
 * `from` adds two at most. */
static void cut_by(const corners *from, const double *value, int room, corners *to) {
    int n = 0, count = from->count;
    double before = value[count - 1], x = from->x[count - 1], y = from->y[count - 1];
    for (int i = 0; i < count; i++) {
        double now = value[i], next_x = from->x[i], next_y = from->y[i];
        if (before * now < 0.0) {
            double t = before / (before - now);
            to->x[n] = x + t * (next_x - x);
            to->y[n++] = y + t * (next_y - y);
        }
        to->x[n] = next_x; /* the next one takes its place if it is outside */
        to->y[n] = next_y;
        n += now >= 0.0;
        before = now;
        x = next_x;
        y = next_y;
    }
    to->count = n > room ? room : n >= 3 ? n : 0;
    if (to->count > 0) {
        fill_up(to);
    }
}

static int before(int i, int count) {
    return i > 0 ? i - 1 : count - 1;
}

static int after(int i, int count) {
    return i + 1 < count ? i + 1 : 0;
}

/* Corners that follow each other, all of those outside of a half plane, with its values at the ends
 * and at the corners beside them. */
typedef struct outside {
    int first, last, count;
    double before, at_first, at_last, after;
} outside;

/* Where a side from corner i to the next one crosses the border of a half plane. */
static bst_point2 crossing_of(const corners *c, int i, double value, double next) {
    int k = after(i, c->count);
    double t = value / (value - next);
    return (bst_point2){c->x[i] + t * (c->x[k] - c->x[i]), c->y[i] + t * (c->y[k] - c->y[i])};
}

/* Moves the corners from one on to another place. */
static void move(corners *c, int from, int end, int to) {
    size_t count = (size_t)(end - from);
    if (from != to) {
        memmove(c->x + to, c->x + from, count * sizeof *c->x);
        memmove(c->y + to, c->y + from, count * sizeof *c->y);
    }
}

/* Cuts the corners outside of a half plane off. Returned: the last new one, or one beside it. */
static int cut_off(corners *c, const outside *o) {
    bst_point2 by[2];
    int count = 0, n = c->count, first = o->first;
    if (o->before > 0.0) {
        by[count++] = crossing_of(c, before(o->first, n), o->before, o->at_first);
    }
    if (o->after > 0.0) {
        by[count++] = crossing_of(c, o->last, o->at_last, o->after);
    }
    if (o->first <= o->last) {
        move(c, o->last + 1, n, first + count);
    } else { /* over the end of the list */
        move(c, o->last + 1, o->first, 0);
        first = o->first - o->last - 1;
    }
    for (int i = 0; i < count; i++) {
        c->x[first + i] = by[i].x;
        c->y[first + i] = by[i].y;
    }
    c->count = n - o->count + count;
    c->count = c->count >= 3 ? c->count : 0;
    if (c->count > 0) {
        fill_up(c);
    }
    return first + count > 0 ? first + count - 1 : 0;
}

static double value_at(const corners *c, bst_half_plane s, int i) {
    return s.u * c->x[i] + s.v * c->y[i] + s.w;
}

/* Finds the corners outside of a half plane about one of them. */
static outside outside_about(const corners *c, bst_half_plane s, int at, double value) {
    int n = c->count;
    outside o = {.first = at, .last = at, .count = 1, .at_first = value, .at_last = value};
    while (o.after = value_at(c, s, after(o.last, n)), o.after < 0.0 && o.count < n) {
        o.last = after(o.last, n);
        o.at_last = o.after;
        o.count++;
    }
    while (o.before = value_at(c, s, before(o.first, n)), o.before < 0.0 && o.count < n) {
        o.first = before(o.first, n);
        o.at_first = o.before;
        o.count++;
    }
    return o;
}

/* Keeps what a polygon has in a half plane.
 *
 * Given:     room   see cut_by
 *            *at    a corner that may be outside: sides of a convex set come in order, so that each
 *                   cuts near the last one
 *            spare  work memory
 * Returned:  *at    likewise for the next one
 *            false: nothing was removed */
static inline bool keep_side(corners *c, bst_half_plane s, int room, int *at, corners *spare) {
    double value[CORNERS];
    int i = *at < c->count ? *at : 0, count = -1; /* outside; -1: unknown */
    if (!(value_at(c, s, i) < 0.0)) {
        count = values_at(c, s, value);
        if (count == 0) {
            return false;
        }
        for (i = 0; i < c->count && !(value[i] < 0.0); i++) {
        }
        if (i == c->count) { /* all of these are -0 */
            return true;
        }
    }
    const outside o = outside_about(c, s, i, value_at(c, s, i));
    if (o.count == c->count) {
        c->count = 0;
    } else if ((count < 0 || count == o.count) && c->count + 2 - o.count <= room) {
        *at = cut_off(c, &o);
    } else { /* concave by rounding */
        (void)values_at(c, s, value);
        cut_by(c, value, room, spare);
        *c = *spare;
    }
    return true;
}

/* Lowest and highest coordinates of a polygon. */
typedef struct bounds {
    double low[2], high[2];
} bounds;

static bounds bounds_of(const bst_point2 *p, int count) {
    bounds b = {{p[0].x, p[0].y}, {p[0].x, p[0].y}};
    for (int i = 1; i < count; i++) {
        b.low[0] = p[i].x < b.low[0] ? p[i].x : b.low[0];
        b.high[0] = p[i].x > b.high[0] ? p[i].x : b.high[0];
        b.low[1] = p[i].y < b.low[1] ? p[i].y : b.low[1];
        b.high[1] = p[i].y > b.high[1] ? p[i].y : b.high[1];
    }
    return b;
}

/* True if two polygons have at most a border in common. */
static bool apart(const bounds *a, const bounds *b) {
    return a->high[0] <= b->low[0] || b->high[0] <= a->low[0] || a->high[1] <= b->low[1] ||
           b->high[1] <= a->low[1];
}

/* Finds the half planes that may cut a polygon, by its bounds. Returned: their number, or
 * BST_HALF_PLANES_APART if one of them has no part of it. */
static int may_cut(const bounds *b, const bst_half_plane *sides, int side_count, int *indices) {
    int found = 0;
    double x = 0.5 * (b->low[0] + b->high[0]), half_x = 0.5 * (b->high[0] - b->low[0]);
    double y = 0.5 * (b->low[1] + b->high[1]), half_y = 0.5 * (b->high[1] - b->low[1]);
    for (int i = 0; i < side_count; i++) {
        const bst_half_plane s = sides[i];
        double middle = s.u * x + s.v * y + s.w;
        double reach = fabs(s.u) * half_x + fabs(s.v) * half_y;
        if (middle + reach <= 0.0) {
            return BST_HALF_PLANES_APART;
        }
        indices[found] = i;
        found += middle < reach;
    }
    return found;
}

/* A convex set of half planes. The first corner_sides of them may be those of known corners. */
typedef struct convex_set {
    const bst_half_plane *sides;
    int side_count;
    const bst_point2 *corners;
    int corner_count, corner_sides; /* corner_count 0: unknown */
} convex_set;

static void start(corners *to, const bst_point2 *p, int count) {
    to->count = count;
    for (int i = 0; i < count; i++) {
        to->x[i] = p[i].x;
        to->y[i] = p[i].y;
    }
    fill_up(to);
}

/* As bst_polygon_keep, with the polygon's bounds. If many more of the set's half planes matter than
 * the polygon has corners, the set is cut by the polygon. */
BST_CLONES_256 static int keep(const bst_point2 *p, int count, const bounds *within,
                               const convex_set *set, bst_point2 *out, bool *cut) {
    enum { MANY = 2 }; /* by the time of light curves: below that, cutting the polygon is faster */
    corners left, spare;
    int indices[CORNERS], room = count + set->side_count + set->corner_count, at = 0;
    assert(count > 0 && room <= CORNERS / 2);
    int wanted = may_cut(within, set->sides, set->side_count, indices);
    *cut = wanted == BST_HALF_PLANES_APART;
    if (*cut) {
        return 0;
    }
    bool swap = set->corner_count > 0 && wanted > MANY * count;
    start(&left, swap ? set->corners : p, swap ? set->corner_count : count);
    for (int i = 0; i < wanted && left.count > 0; i++) {
        if (!swap || indices[i] >= set->corner_sides) {
            *cut |= keep_side(&left, set->sides[indices[i]], room, &at, &spare);
        }
    }
    /* two corners of one place but for rounding, as a cut through a corner leaves them, have no
     * side between them */
    double tiny = TINY * (within->high[0] - within->low[0] + within->high[1] - within->low[1]);
    for (int i = 0; i < count && left.count > 0 && swap; i++) {
        bst_point2 a = p[i], b = p[after(i, count)], way = {b.x - a.x, b.y - a.y};
        if (!(fabs(way.x) > tiny || fabs(way.y) > tiny)) {
            continue;
        }
        const bst_half_plane side = {-way.y, way.x, way.y * a.x - way.x * a.y};
        (void)keep_side(&left, side, room, &at, &spare);
    }
    *cut |= swap; /* a set that covers all leaves an area of rounding */
    for (int i = 0; i < left.count; i++) {
        out[i] = (bst_point2){left.x[i], left.y[i]};
    }
    return left.count;
}

int bst_polygon_keep(const bst_point2 *p, int count, const bst_half_plane *sides, int side_count,
                     bst_point2 *out, bool *cut) {
    assert(count > 0);
    const bounds within = bounds_of(p, count);
    const convex_set set = {sides, side_count, NULL, 0, 0};
    return keep(p, count, &within, &set, out, cut);
}

/* A sum of areas in progress. */
typedef struct sum {
    const bst_polygon_covers *covers;
    int used;          /* points of the work memory */
    int intersections; /* so far; above INTERSECTIONS_MAX: given up */
} sum;

/* Area of a polygon outside of the first `covers` sets of the list, but for those that are in `off`
 * as bits. */
static double uncovered(sum *s, const bst_point2 *p, int count, const bounds *within, int covers,
                        unsigned off) {
    double area = bst_polygon_area(p, count);
    bounds parts[BST_POLYGON_COVERS_MAX]; /* of the intersections with the sets so far */
    int start = s->used;
    for (int i = 0; i < covers; i++) {
        const bst_polygon_covers *all = s->covers;
        const convex_set set = {all->sides + all->first[i], all->first[i + 1] - all->first[i],
                                all->corners + all->corner_first[i],
                                all->corner_first[i + 1] - all->corner_first[i],
                                all->corner_sides[i]};
        int room = count + set.side_count + set.corner_count;
        if (off & 1U << i) {
            continue;
        }
        if (room > CORNERS / 2 || s->used + room > WORK || ++s->intersections > INTERSECTIONS_MAX) {
            s->intersections = INTERSECTIONS_MAX + 1;
            return 0.0;
        }
        bst_point2 *out = s->covers->work + start;
        bool cut;
        int n = keep(p, count, within, &set, out, &cut);
        if (!cut) {
            return 0.0; /* the set covers all */
        }
        if (n == 0) {
            off |= 1U << i;
            continue;
        }
        parts[i] = bounds_of(out, n);
        unsigned without = off;
        for (int k = 0; k < i; k++) {
            if (!(off & 1U << k) && apart(&parts[k], &parts[i])) {
                without |= 1U << k;
            }
        }
        s->used = start + n;
        area -= uncovered(s, out, n, &parts[i], i, without);
        s->used = start;
    }
    return area;
}

double bst_polygon_uncovered_area(const bst_polygon_covers *covers, const bst_point2 *points,
                                  int count) {
    sum s = {.covers = covers};
    const bounds within = bounds_of(points, count);
    double area = uncovered(&s, points, count, &within, covers->count, 0);
    return s.intersections > INTERSECTIONS_MAX ? -1.0 : fmax(area, 0.0);
}
