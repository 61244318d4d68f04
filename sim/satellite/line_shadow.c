#include "sim/satellite/line_shadow.h"

#include "sim/core/simd.h"

#include "sim/satellite/pose_view.h"
#include "sim/satellite/separation.h"

enum { SPANS_MAX = 32 };

/* Least cosine between the axis of a ring and the view: its ellipse is this thin at most. */
static const double EDGE_ON = 1e-6;
/* Angle of the arc that a corner of a polygon about a round body stands for, at most. */
static const double SIDE_RAD = 0.25 * BST_PI;

/* Free parts of a line, as fractions of its length. */
typedef struct spans {
    double from[SPANS_MAX], to[SPANS_MAX];
    int count;
} spans;

/* A line in a view, and the interval of it that is looked at. */
typedef struct line_view {
    bst_point2 from, to;
    double bounds[6]; /* lowest and highest x, y, z */
    double low, high;
} line_view;

/* Removes [low, high] from the free parts; the smaller part of a free one too where there is no
 * room for both. */
static BST_INLINED void take(spans *s, double low, double high) {
    int kept = 0, count = s->count;
    for (int i = 0; i < count; i++) {
        double from = s->from[i], to = s->to[i];
        bool before = low > from, after = high < to;
        if (before && after && low < to && high > from) { /* the new part goes to the end */
            bool room = s->count < SPANS_MAX;
            if (room) {
                s->from[s->count] = high;
                s->to[s->count++] = to;
            }
            after = !room && to - high > low - from;
            before = !after;
        }
        if (before || after) {
            s->from[kept] = before ? from : high > from ? high : from;
            s->to[kept++] = after ? to : low < to ? low : to;
        }
    }
    for (int i = count; i < s->count; i++, kept++) {
        s->from[kept] = s->from[i];
        s->to[kept] = s->to[i];
    }
    s->count = kept;
}

static BST_INLINED double greater_of(double a, double b) {
    return a > b ? a : b;
}

static BST_INLINED double lesser_of(double a, double b) {
    return a < b ? a : b;
}

/* Keeps the part of the interval where a linear function is not below 0, given at the ends. */
static BST_INLINED void keep(line_view *l, double at_from, double at_to) {
    if (at_from < 0.0 && at_to < 0.0) {
        l->high = -1.0;
    } else if (at_from < 0.0) {
        l->low = greater_of(l->low, at_from / (at_from - at_to));
    } else if (at_to < 0.0) {
        l->high = lesser_of(l->high, at_from / (at_from - at_to));
    }
}

/* Keeps what is within a convex polygon of the view: without branches, for wide registers. */
static BST_INLINED void keep_within(line_view *l, const bst_half_planes *sides, int blocks) {
    double low[BST_HALF_PLANES], high[BST_HALF_PLANES];
    for (int k = 0; k < BST_HALF_PLANES; k++) {
        low[k] = l->low;
        high[k] = l->high;
    }
    for (int b = 0; b < blocks; b++) {
        const bst_half_planes *s = &sides[b];
        for (int k = 0; k < BST_HALF_PLANES; k++) {
            double from = s->u[k] * l->from.x + s->v[k] * l->from.y + s->w[k];
            double to = s->u[k] * l->to.x + s->v[k] * l->to.y + s->w[k];
            double at = from / (from - to);
            double enters = from < 0.0 ? to < 0.0 ? 2.0 : at : 0.0;
            double leaves = to < 0.0 ? from < 0.0 ? -1.0 : at : 1.0;
            low[k] = enters > low[k] ? enters : low[k];
            high[k] = leaves < high[k] ? leaves : high[k];
        }
    }
    for (int k = 0; k < BST_HALF_PLANES; k++) {
        l->low = greater_of(l->low, low[k]);
        l->high = lesser_of(l->high, high[k]);
    }
}

/* Coordinates of a vector of the view in which the circles of a band are round. */
static BST_INLINED bst_point2 in_band(const bst_round_band *b, double x, double y) {
    return (bst_point2){(x * b->along.x + y * b->along.y) * b->scale,
                        y * b->along.x - x * b->along.y};
}

/* Extends an interval to what a line has in a circle about the origin. */
static BST_INLINED void add_circle(bst_point2 from, bst_point2 step, double radius, line_view *l) {
    double a = step.x * step.x + step.y * step.y, b = from.x * step.x + from.y * step.y;
    double c = from.x * from.x + from.y * from.y - radius * radius, root = b * b - a * c;
    if (root > 0.0 && a > 0.0) {
        double half = sqrt(root), low = greater_of((-b - half) / a, 0.0);
        double high = lesser_of((half - b) / a, 1.0);
        if (low < high) {
            l->low = lesser_of(l->low, low);
            l->high = greater_of(l->high, high);
        }
    } else if (c < 0.0 && !(a > 0.0)) {
        l->low = 0.0;
        l->high = 1.0;
    }
}

/* Keeps what is within a round body: bands whose hulls together are convex. */
static BST_INLINED void keep_within_bands(line_view *l, const bst_round_band *bands, int count) {
    line_view all = {.low = 1.0, .high = 0.0};
    for (int i = 0; i < count; i++) {
        const bst_round_band *b = &bands[i];
        bst_point2 from = in_band(b, l->from.x - b->centre.x, l->from.y - b->centre.y);
        bst_point2 step = in_band(b, l->to.x - l->from.x, l->to.y - l->from.y);
        if (i == 0) { /* the first circle of others is the second one of the last */
            add_circle(from, step, b->radius_m[0], &all);
        }
        add_circle((bst_point2){from.x - b->apart, from.y}, step, b->radius_m[1], &all);
        if (!b->tangents) {
            continue;
        }
        bst_point2 to = {from.x + step.x, from.y + step.y};
        line_view inner = {.high = 1.0};
        double least = b->sine * b->radius_m[0], most = b->apart + b->sine * b->radius_m[1];
        double a = b->radius_m[0] - b->sine * from.x, c = b->radius_m[0] - b->sine * to.x;
        keep(&inner, from.x - least, to.x - least);
        keep(&inner, most - from.x, most - to.x);
        keep(&inner, a - b->cosine * from.y, c - b->cosine * to.y);
        keep(&inner, a + b->cosine * from.y, c + b->cosine * to.y);
        if (inner.low < inner.high) {
            all.low = lesser_of(all.low, inner.low);
            all.high = greater_of(all.high, inner.high);
        }
    }
    l->low = greater_of(l->low, all.low);
    l->high = lesser_of(l->high, all.high);
}

/* Keeps what is behind a face. */
static void keep_behind(line_view *l, const bst_light_line *of, bst_vec3 point, bst_vec3 normal) {
    keep(l, bst_vec3_dot(normal, bst_vec3_sub(point, of->from)),
         bst_vec3_dot(normal, bst_vec3_sub(point, of->to)));
}

/* Keeps what is behind all faces of an occluder toward the view: see add_faces in pose_areas.c. */
static void keep_behind_faces(const bst_satellite_pose *p, const bst_pose_view *v,
                              const bst_occluder *o, const bst_light_line *of, line_view *l) {
    const bst_satellite *s = p->satellite;
    for (int f = o->first_facet; f < o->first_facet + o->facet_count && l->low < l->high; f++) {
        if (!s->facets[f].inside && bst_vec3_dot(p->normals[f], v->z) > 0.0) {
            keep_behind(l, of, p->vertices[s->corner[s->facets[f].first]], p->normals[f]);
        }
    }
    if (o->shell >= 0) {
        bst_vec3 axis = bst_pose_shell_axis(p, o->shell);
        if (bst_vec3_dot(axis, v->z) > 0.0) {
            keep_behind(l, of, p->vertices[s->shells[o->shell].first_rim], axis);
        }
    }
}

/* Finds the tangents of a band's circles. */
static void set_tangents(bst_round_band *b) {
    double narrower = b->radius_m[0] - b->radius_m[1];
    b->tangents = b->apart > fabs(narrower);
    b->sine = b->tangents ? narrower / b->apart : 0.0;
    b->cosine = sqrt((1.0 - b->sine) * (1.0 + b->sine));
}

/* A band in a view. */
static bst_round_band band_of(const bst_pose_view *v, bst_vec3 base, bst_vec3 axis, double low_m,
                              double high_m, double length_m) {
    double x = bst_vec3_dot(axis, v->x), y = bst_vec3_dot(axis, v->y), across = sqrt(x * x + y * y);
    bst_round_band b = {.centre = {bst_vec3_dot(base, v->x), bst_vec3_dot(base, v->y)},
                        .along = {1.0, 0.0},
                        .radius_m = {low_m, high_m}};
    if (across > 0.0) {
        b.along = (bst_point2){x / across, y / across};
    }
    b.scale = 1.0 / greater_of(fabs(bst_vec3_dot(axis, v->z)), EDGE_ON);
    b.apart = length_m * across * b.scale;
    set_tangents(&b);
    return b;
}

/* Lists the bands of a round body. Returned: the first one; -1: none, or no room. */
static int add_bands(bst_line_shadow *w, const bst_pose_view *v, int occluder) {
    const bst_satellite_pose *p = w->pose;
    const bst_occluder *o = &p->satellite->occluders[occluder];
    int first = w->band_count;
    if (o->curved_count == 0 || first + o->curved_count > BST_LINE_BANDS_MAX) {
        return -1;
    }
    for (int i = o->first_curved; i < o->first_curved + o->curved_count; i++) {
        const bst_curved *c = &p->satellite->curved[i];
        bst_vec3 base = bst_pose_moved(p, c->joint, c->base_m);
        if (c->side > 0.0) { /* of a sphere: one circle */
            w->bands[w->band_count++] = c->sphere
                                            ? band_of(v, base, v->z, c->radius_m, c->radius_m, 0.0)
                                            : band_of(v, base, bst_pose_turned(p, c->joint, c->z),
                                                      c->radius_m, c->top_radius_m, c->length_m);
        }
    }
    return first;
}

/* Number of bands of a hider that has them. */
static int bands_of(const bst_satellite_pose *p, int occluder) {
    const bst_occluder *o = &p->satellite->occluders[occluder];
    return o->shell >= 0 ? o->curved_count / 2 : o->curved_count; /* shells have two sides */
}

/* The rim of a shell as a band; of radius 0 if no light leaves through it toward the view. */
static bst_round_band rim_of(const bst_satellite_pose *p, const bst_pose_view *v, int index) {
    bst_pose_rim rim = bst_pose_rim_of(p, v, index);
    double radius_m = rim.rate > 0.0 ? p->satellite->shells[index].radius_m : 0.0;
    return band_of(v, rim.centre, rim.axis, radius_m, radius_m, 0.0);
}

/* Takes what light cannot leave through the rim of a shell. */
static BST_INLINED void take_beside_rim(const bst_round_band *rim, line_view *l, spans *free) {
    if (rim->radius_m[0] > 0.0) {
        keep_within_bands(l, rim, 1);
    }
    if (rim->radius_m[0] > 0.0 && l->low < l->high) {
        take(free, -1.0, l->low);
        take(free, l->high, 2.0);
    } else {
        free->count = 0;
    }
}

/* True if the middle of a line is inside a shell. */
static bool is_inside(const bst_satellite_pose *p, const bst_light_line *l,
                      const bst_shell *shell) {
    return bst_pose_is_inside_shell(p, bst_vec3_scale(bst_vec3_add(l->from, l->to), 0.5), shell);
}

/* Keeps what is within the silhouette of a hider. */
static BST_INLINED void keep_within_silhouette(const bst_line_shadow *w, int view,
                                               const int hider[2], line_view *l) {
    if (hider[1] >= 0) {
        keep_within_bands(l, w->bands + hider[1], bands_of(w->pose, hider[0]));
        return;
    }
    const bst_half_planes *sides;
    int blocks = bst_pose_sides(w->pose, view, hider[0], &sides);
    keep_within(l, sides, blocks);
    l->high = blocks > 0 ? l->high : -1.0;
}

/* True if a line or surface is beside a body or in front of it, by the bounds of both. Round bodies
 * may reach beyond those of their vertices by 0.3 % of their size, with 24 facets around. */
static BST_INLINED bool is_beside(const double own[6], const double b[6]) {
    double x = 0.02 * (b[1] - b[0]), y = 0.02 * (b[3] - b[2]);
    return (own[1] < b[0] - x) | (own[0] > b[1] + x) | (own[3] < b[2] - y) | (own[2] > b[3] + y) |
           (own[4] >= b[5]);
}

/* Takes what a body hides of a line in a view. */
static BST_INLINED void take_hidden(const bst_line_shadow *w, int view, const int hider[2],
                                    const bst_light_line *of, const line_view *all, spans *free) {
    bst_satellite_pose *p = w->pose;
    const bst_satellite *s = p->satellite;
    const bst_pose_view *v = &p->views[view];
    const bst_occluder *o = &s->occluders[hider[0]];
    const double *bounds = v->bounds[hider[0]];
    if (hider[0] != w->body && is_beside(all->bounds, bounds)) {
        return;
    }
    line_view l = *all;
    if (hider[0] == w->body) {
        take_beside_rim(&w->rim[view], &l, free);
        return;
    }
    if (o->shell >= 0 && is_inside(p, of, &s->shells[o->shell])) {
        bst_round_band rim = rim_of(p, v, o->shell);
        take_beside_rim(&rim, &l, free);
        return;
    }
    keep_within_silhouette(w, view, hider, &l);
    bst_vec3 axis;
    /* as in bst_pose_area_subtract */
    if (l.low < l.high && bounds[4] < l.bounds[5] && !bst_separation(p, w->body, hider[0], &axis)) {
        const bst_point2 *hull;
        int count = BST_POSE_ALL_IN_FRONT;
        if (o->closed || o->vertex_count > BST_POLYGON_CORNERS_MAX) {
            keep_behind_faces(p, v, o, of, &l);
        } else {
            count = bst_pose_front(p, v, hider[0], of->from, of->normal, &hull);
        }
        if (count != BST_POSE_ALL_IN_FRONT) {
            keep_within(&l, p->sides, bst_half_planes_of(hull, count, p->sides));
            l.high = count > 0 ? l.high : -1.0;
        }
    }
    if (l.low < l.high) {
        take(free, l.low, l.high);
    }
}

/* Extends bounds to a circle in a view. */
static void add_ring(const bst_pose_view *v, const bst_line_ring *ring, double b[6]) {
    const bst_vec3 axes[] = {v->x, v->y, v->z};
    for (int a = 0; a < 3; a++) {
        double middle = bst_vec3_dot(ring->centre, axes[a]);
        double along = bst_vec3_dot(ring->axis, axes[a]);
        double reach = ring->radius_m * sqrt(greater_of(1.0 - along * along, 0.0));
        b[2 * a] = lesser_of(b[2 * a], middle - reach);
        b[2 * a + 1] = greater_of(b[2 * a + 1], middle + reach);
    }
}

/* True if all light of a surface between coaxial rings leaves through the rim of its shell. */
static bool is_within_rim(const bst_satellite_pose *p, const bst_pose_view *v, int index,
                          const bst_line_ring *rings, int count) {
    bst_pose_rim rim = bst_pose_rim_of(p, v, index);
    bool within = rim.rate > 0.0;
    for (int i = 0; i < count && within; i++) {
        bst_vec3 r = bst_vec3_sub(rings[i].centre, rim.centre);
        r = bst_vec3_axpy(r, -bst_vec3_dot(r, rim.axis) / rim.rate, v->z);
        double reach = bst_vec3_norm(r) + rings[i].radius_m;
        within = reach <= (1.0 + 1e-12) * p->satellite->shells[index].radius_m;
    }
    return within;
}

bool bst_line_shadow_make(bst_satellite_pose *p, int body, bool inside, const bst_line_ring *rings,
                          int ring_count, bst_line_shadow *w) {
    int n = 0, occluders = p->satellite->occluder_count;
    bool few = occluders <= BST_SEPARATION_BODIES;
    w->pose = p;
    w->body = body;
    w->band_count = 0;
    for (int k = 0; k < 2; k++) {
        const bst_pose_view *v = &p->views[k];
        double bounds[6];
        bool own = inside;
        w->first[k] = n;
        bst_pose_start_bounds(bounds);
        if (inside) {
            int shell = p->satellite->occluders[body].shell;
            w->rim[k] = rim_of(p, v, shell);
            own = !is_within_rim(p, v, shell, rings, ring_count);
        }
        for (int i = 0; i < ring_count; i++) {
            add_ring(v, &rings[i], bounds);
        }
        for (int o = 0; o < occluders; o++) {
            bool may = o == body ? own : !few || (v->hiders[body] >> o & 1);
            if (may && (o == body || !is_beside(bounds, v->bounds[o]))) {
                p->hiders[n][0] = o;
                p->hiders[n++][1] = o == body ? -1 : add_bands(w, v, o);
            }
        }
    }
    w->first[2] = n;
    return n > 0;
}

BST_CLONES_256 static double lost_light(const bst_line_shadow *w, const bst_light_line *of) {
    spans free; /* what is beyond its count is not set */
    free.from[0] = 0.0;
    free.to[0] = 1.0;
    free.count = 1;
    for (int k = 0; k < 2; k++) {
        if (w->first[k] == w->first[k + 1]) {
            continue;
        }
        const bst_pose_view *v = &w->pose->views[k];
        line_view l = {.from = {bst_vec3_dot(of->from, v->x), bst_vec3_dot(of->from, v->y)},
                       .to = {bst_vec3_dot(of->to, v->x), bst_vec3_dot(of->to, v->y)},
                       .high = 1.0};
        double a = bst_vec3_dot(of->from, v->z), b = bst_vec3_dot(of->to, v->z);
        l.bounds[0] = lesser_of(l.from.x, l.to.x);
        l.bounds[1] = greater_of(l.from.x, l.to.x);
        l.bounds[2] = lesser_of(l.from.y, l.to.y);
        l.bounds[3] = greater_of(l.from.y, l.to.y);
        l.bounds[4] = lesser_of(a, b);
        l.bounds[5] = greater_of(a, b);
        for (int i = w->first[k]; i < w->first[k + 1] && free.count > 0; i++) {
            take_hidden(w, k, w->pose->hiders[i], of, &l, &free);
        }
    }
    if (free.count == 1 && free.from[0] <= 0.0 && free.to[0] >= 1.0) {
        return 0.0;
    }
    double left = 0.0, slope = 0.5 * (of->to_weight - of->from_weight);
    for (int i = 0; i < free.count; i++) {
        double from = free.from[i], to = free.to[i];
        left += (to - from) * (of->from_weight + slope * (from + to));
    }
    return greater_of(0.5 * (of->from_weight + of->to_weight) - left, 0.0);
}

double bst_line_shadow_lost(const bst_line_shadow *w, const bst_light_line *of) {
    return lost_light(w, of);
}

/* A band about the silhouette of a round hider. The bowl of a shell, with the radius sqrt(t) at the
 * height t of 1, is within a cone from half the radius to the rim: sqrt(t) <= 1/2 + t/2. */
static bst_round_band band_about(const bst_line_shadow *w, const int hider[2]) {
    int count = bands_of(w->pose, hider[0]);
    const bst_round_band *first = w->bands + hider[1];
    bst_round_band b = first[count - 1];
    if (count > 1) {
        double x = b.centre.x - first->centre.x, y = b.centre.y - first->centre.y;
        b.apart += (x * b.along.x + y * b.along.y) * b.scale;
        b.centre = first->centre;
        b.radius_m[0] = 0.5 * b.radius_m[1];
        set_tangents(&b);
    }
    return b;
}

/* Corners of a polygon about an arc of a band's circle, which its sides touch at both ends.
 * Returned: their number. */
static int corners_about(const bst_round_band *b, int circle, double from, double to,
                         bst_point2 *point) {
    int count = (int)greater_of(ceil((to - from) / SIDE_RAD - 1e-9), 1.0);
    double half = 0.5 * (to - from) / count, r = b->radius_m[circle] / cos(half);
    for (int i = 0; i < count; i++) {
        double angle = from + (2 * i + 1) * half, across = r * sin(angle);
        double along = (r * cos(angle) + circle * b->apart) / b->scale;
        point[i] = (bst_point2){b->centre.x + along * b->along.x - across * b->along.y,
                                b->centre.y + along * b->along.y + across * b->along.x};
    }
    return count;
}

int bst_line_shadow_corners(const bst_line_shadow *w, int view, int index, bst_point2 *point) {
    const int *hider = w->pose->hiders[index];
    if (hider[1] < 0) {
        const bst_point2 *outline;
        int count = bst_pose_outline(w->pose, view, hider[0], &outline);
        int n = count < BST_LINE_CORNERS_MAX ? count : BST_LINE_CORNERS_MAX;
        for (int i = 0; i < n; i++) {
            point[i] = outline[i * count / n];
        }
        return n;
    }
    bst_round_band b = band_about(w, hider);
    if (!b.tangents) {
        return corners_about(&b, b.radius_m[1] > b.radius_m[0], 0.0, 2.0 * BST_PI, point);
    }
    double angle = acos(b.sine);
    int n = corners_about(&b, 1, -angle, angle, point);
    return n + corners_about(&b, 0, angle, 2.0 * BST_PI - angle, point + n);
}

bool bst_line_shadow_tangents(const bst_line_shadow *w, int index, bst_point2 tangent[2][2]) {
    const int *hider = w->pose->hiders[index];
    if (hider[1] < 0) {
        return false;
    }
    const bst_round_band *b = &w->bands[hider[1] + bands_of(w->pose, hider[0]) - 1];
    for (int k = 0; k < 4 && b->tangents; k++) {
        double r = b->radius_m[k % 2], across = (k < 2 ? r : -r) * b->cosine;
        double along = (k % 2 * b->apart + r * b->sine) / b->scale;
        tangent[k / 2][k % 2] =
            (bst_point2){b->centre.x + along * b->along.x - across * b->along.y,
                         b->centre.y + along * b->along.y + across * b->along.x};
    }
    return b->tangents;
}
