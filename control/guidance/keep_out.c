#include "control/guidance/keep_out.h"

#include "sim/astro/bodies.h"

/* Depth inside a cone's edge that still counts as outside, because paths run along edges. */
#define EDGE_RAD 1e-9

int bst_keep_out_zones(const bst_keep_out *exclusion, bst_vec3 position_m, bst_vec3 to_sun,
                       bst_vec3 to_moon, bst_keep_out_zone zones[BST_ZONE_KINDS]) {
    int count = 0;
    if (exclusion->sun_rad > 0.0 && bst_vec3_norm(to_sun) > 0.0) {
        zones[count++] =
            (bst_keep_out_zone){BST_ZONE_SUN, bst_vec3_unit(to_sun), exclusion->sun_rad};
    }
    if (exclusion->moon_rad > 0.0 && bst_vec3_norm(to_moon) > 0.0) {
        zones[count++] =
            (bst_keep_out_zone){BST_ZONE_MOON, bst_vec3_unit(to_moon), exclusion->moon_rad};
    }
    double r = bst_vec3_norm(position_m);
    if (exclusion->earth && r > 0.0) {
        double limb = (BST_EARTH_RADIUS_M + exclusion->limb_altitude_m) / r;
        double half = asin(fmin(limb, 1.0)) + exclusion->earth_limb_rad;
        if (half > 0.0) {
            zones[count++] = (bst_keep_out_zone){
                BST_ZONE_EARTH, bst_vec3_scale(position_m, -1.0 / r), fmin(half, BST_PI - 1e-6)};
        }
    }
    return count;
}

int bst_keep_out_inside(const bst_keep_out_zone *zones, int count, bst_vec3 direction,
                        double *depth_rad) {
    int deepest = -1;
    *depth_rad = EDGE_RAD;
    for (int i = 0; i < count; i++) {
        /* cos x >= 1 - x^2 / 2: far outside is decided without the angle */
        double half = zones[i].half_angle_rad;
        if (bst_vec3_dot(zones[i].axis, direction) < 0.999999 - 0.5 * half * half) {
            continue;
        }
        double depth = half - bst_vec3_angle(zones[i].axis, direction);
        if (depth > *depth_rad) {
            *depth_rad = depth;
            deepest = i;
        }
    }
    *depth_rad = deepest >= 0 ? *depth_rad : 0.0;
    return deepest;
}

/* True if a direction is outside all keep-out cones. */
static bool outside(const bst_keep_out_zone *zones, int count, bst_vec3 direction) {
    double depth;
    return bst_keep_out_inside(zones, count, direction, &depth) < 0;
}

/* Rotates unit vector v by an angle about a unit axis (Rodrigues). */
static bst_vec3 turned(bst_vec3 axis, double angle, bst_vec3 v) {
    bst_vec3 along = bst_vec3_scale(axis, bst_vec3_dot(axis, v));
    bst_vec3 across = bst_vec3_sub(v, along);
    bst_vec3 out = bst_vec3_axpy(along, cos(angle), across);
    return bst_vec3_unit(bst_vec3_axpy(out, sin(angle), bst_vec3_cross(axis, across)));
}

/* Point of a cone's edge on the side of `towards`. */
static bst_vec3 edge_point(const bst_keep_out_zone *zone, bst_vec3 towards) {
    bst_vec3 side = bst_vec3_axpy(towards, -bst_vec3_dot(towards, zone->axis), zone->axis);
    side = bst_vec3_norm(side) > 1e-12 ? bst_vec3_unit(side) : bst_vec3_perpendicular(zone->axis);
    return bst_vec3_unit(bst_vec3_axpy(bst_vec3_scale(zone->axis, cos(zone->half_angle_rad)),
                                       sin(zone->half_angle_rad), side));
}

/* The two unit vectors n with n . a = p and n . b = q; returns their number, 0 or 2. */
static int with_products(bst_vec3 a, double p, bst_vec3 b, double q, bst_vec3 out[2]) {
    double c = bst_vec3_dot(a, b);
    bst_vec3 across = bst_vec3_cross(a, b);
    double s2 = bst_vec3_dot(across, across);
    if (s2 < 1e-24) {
        return 0;
    }
    double x = (p - c * q) / s2, y = (q - c * p) / s2;
    bst_vec3 flat = bst_vec3_axpy(bst_vec3_scale(a, x), y, b);
    double rest = 1.0 - bst_vec3_dot(flat, flat);
    if (rest < 0.0) {
        return 0;
    }
    double z = sqrt(rest / s2);
    out[0] = bst_vec3_unit(bst_vec3_axpy(flat, z, across));
    out[1] = bst_vec3_unit(bst_vec3_axpy(flat, -z, across));
    return 2;
}

bool bst_keep_out_nearest(const bst_keep_out_zone *zones, int count, bst_vec3 direction,
                          bst_vec3 towards, bst_vec3 *out) {
    *out = direction;
    if (outside(zones, count, direction)) {
        return true;
    }
    double best = INFINITY;
    for (int i = 0; i < count; i++) {
        bool centre = bst_vec3_norm(bst_vec3_cross(zones[i].axis, direction)) < 1e-12;
        bst_vec3 point[3] = {edge_point(&zones[i], centre ? towards : direction)};
        if (count == 1) {
            *out = point[0];
            return true;
        }
        for (int j = 0; j <= i; j++) {
            int points = 1;
            if (j < i) { /* intersections of two edges */
                points = with_products(zones[i].axis, cos(zones[i].half_angle_rad), zones[j].axis,
                                       cos(zones[j].half_angle_rad), point + 1);
            }
            for (int k = 0; k < points; k++) {
                bst_vec3 p = j < i ? point[1 + k] : point[0];
                double distance = bst_vec3_angle(direction, p);
                if (distance < best && outside(zones, count, p)) {
                    best = distance;
                    *out = p;
                }
            }
        }
    }
    return isfinite(best);
}

/* ---- Visibility graph ---- */

#define HALVES 16
/* both ends, their tangents and edge points, tangents between cones, paths between antipodes */
#define NODES (2 + 6 * BST_ZONES + 4 * BST_ZONES * (BST_ZONES - 1) + HALVES)

typedef struct node {
    bst_vec3 place;
    int zone;     /* cone on whose edge it lies, -1: none */
    int partner;  /* node at the other end of a tangent, -1: none */
    double angle; /* angle along the edge */
    double cost;
    int before;           /* predecessor on the shortest path, -1: none */
    bst_keep_out_arc arc; /* arc from the predecessor */
    bool done;
} node;

typedef struct graph {
    const bst_keep_out_zone *zones;
    int zone_count, count;
    node nodes[NODES];
    bst_vec3 x[BST_ZONES], y[BST_ZONES]; /* reference axes of the angles along each edge */
} graph;

/* Largest p . axis over an arc: its closest approach to a cone's axis. */
static double closest_approach(const bst_keep_out_arc *arc, bst_vec3 axis) {
    bst_vec3 across = bst_vec3_axpy(arc->from, -bst_vec3_dot(arc->from, arc->axis), arc->axis);
    double level = bst_vec3_dot(arc->axis, arc->from) * bst_vec3_dot(arc->axis, axis);
    double a = bst_vec3_dot(across, axis);
    double b = bst_vec3_dot(bst_vec3_cross(arc->axis, across), axis);
    double at = atan2(b, a);
    if (at < 0.0) {
        at += 2.0 * BST_PI;
    }
    if (at <= arc->turn_rad) {
        return level + hypot(a, b);
    }
    double end = a * cos(arc->turn_rad) + b * sin(arc->turn_rad);
    return level + fmax(a, end);
}

/* True if an arc crosses no keep-out cone but `except`. */
static bool is_free(const graph *g, const bst_keep_out_arc *arc, int except) {
    for (int i = 0; i < g->zone_count; i++) {
        double half = g->zones[i].half_angle_rad;
        /* margin in the cosine: d cos = sin d angle */
        if (i != except &&
            closest_approach(arc, g->zones[i].axis) > cos(half) + EDGE_RAD * sin(half) + 4e-16) {
            return false;
        }
    }
    return true;
}

/* Great-circle arc between two directions. */
static bst_keep_out_arc great_circle(bst_vec3 a, bst_vec3 b) {
    bst_vec3 n = bst_vec3_cross(a, b);
    bst_keep_out_arc arc = {.from = a, .turn_rad = bst_vec3_angle(a, b)};
    arc.axis = bst_vec3_norm(n) > 0.0 ? bst_vec3_unit(n) : bst_vec3_perpendicular(a);
    /* corrects rounding for nearly parallel vectors */
    arc.axis = bst_vec3_unit(bst_vec3_axpy(arc.axis, -bst_vec3_dot(arc.axis, a), a));
    arc.length_rad = arc.turn_rad;
    return arc;
}

static int add_node(graph *g, bst_vec3 place, int zone, int partner) {
    node *n = &g->nodes[g->count];
    *n = (node){.place = place, .zone = zone, .partner = partner, .cost = INFINITY, .before = -1};
    if (zone >= 0) {
        n->angle = atan2(bst_vec3_dot(place, g->y[zone]), bst_vec3_dot(place, g->x[zone]));
    }
    return g->count++;
}

/* Point of the great circle with normal n nearest to a cone's axis. */
static bst_vec3 foot(const bst_keep_out_zone *zone, bst_vec3 n) {
    return bst_vec3_unit(bst_vec3_axpy(zone->axis, -bst_vec3_dot(zone->axis, n), n));
}

/* Adds the tangents between ends and cones, and between cones. */
static void add_tangents(graph *g) {
    bst_vec3 n[2];
    for (int i = 0; i < g->zone_count; i++) {
        const bst_keep_out_zone *zone = &g->zones[i];
        double s = sin(zone->half_angle_rad);
        for (int end = 0; end < 2; end++) {
            int count = with_products(g->nodes[end].place, 0.0, zone->axis, s, n);
            for (int k = 0; k < count; k++) {
                (void)add_node(g, foot(zone, n[k]), i, end);
            }
        }
        for (int j = 0; j < i; j++) {
            for (int side = -1; side <= 1; side += 2) {
                int count = with_products(zone->axis, s, g->zones[j].axis,
                                          side * sin(g->zones[j].half_angle_rad), n);
                for (int k = 0; k < count; k++) {
                    int a = add_node(g, foot(zone, n[k]), i, -1);
                    g->nodes[a].partner = add_node(g, foot(&g->zones[j], n[k]), j, a);
                }
            }
        }
    }
}

/* Dijkstra relaxation of a node by an arc. */
static void relax(graph *g, int from, int to, const bst_keep_out_arc *arc) {
    double cost = g->nodes[from].cost + arc->length_rad;
    if (cost < g->nodes[to].cost) {
        g->nodes[to].cost = cost;
        g->nodes[to].before = from;
        g->nodes[to].arc = *arc;
    }
}

/* Relaxes both directions along a cone's edge. */
static void relax_edges(graph *g, int from) {
    const node *a = &g->nodes[from];
    const bst_keep_out_zone *zone = &g->zones[a->zone];
    for (int to = 0; to < g->count; to++) {
        if (to == from || g->nodes[to].zone != a->zone || g->nodes[to].done) {
            continue;
        }
        double turn = g->nodes[to].angle - a->angle;
        turn -= 2.0 * BST_PI * floor(turn / (2.0 * BST_PI));
        for (int way = 0; way < 2; way++) {
            bst_keep_out_arc arc = {.axis = bst_vec3_scale(zone->axis, way ? -1.0 : 1.0),
                                    .from = a->place,
                                    .turn_rad = way ? 2.0 * BST_PI - turn : turn};
            arc.length_rad = arc.turn_rad * sin(zone->half_angle_rad);
            if (is_free(g, &arc, a->zone)) {
                relax(g, from, to, &arc);
            }
        }
    }
}

static void relax_straight(graph *g, int from, int to) {
    bst_keep_out_arc arc = great_circle(g->nodes[from].place, g->nodes[to].place);
    if (is_free(g, &arc, -1)) {
        relax(g, from, to, &arc);
    }
}

/* Dijkstra's algorithm from node 0 to node 1. */
static bool dijkstra(graph *g) {
    g->nodes[0].cost = 0.0;
    for (;;) {
        int at = -1;
        for (int i = 0; i < g->count; i++) {
            if (!g->nodes[i].done && isfinite(g->nodes[i].cost) &&
                (at < 0 || g->nodes[i].cost < g->nodes[at].cost)) {
                at = i;
            }
        }
        if (at < 0 || at == 1) {
            return at == 1;
        }
        node *n = &g->nodes[at];
        n->done = true;
        if (n->zone >= 0) {
            relax_edges(g, at);
            relax_straight(g, at, n->partner);
        } else if (at > 0) {
            relax_straight(g, at, 1);
        } else {
            for (int i = 2; i < g->count; i++) {
                if (g->nodes[i].partner == 0 || g->nodes[i].zone < 0) {
                    relax_straight(g, 0, i);
                }
            }
        }
    }
}

/* Antipodal ends: adds great circles through both in several directions. */
static void add_halves(graph *g) {
    bst_vec3 from = g->nodes[0].place, side = bst_vec3_perpendicular(from);
    for (int i = 0; i < HALVES; i++) {
        (void)add_node(g, turned(from, 2.0 * BST_PI * i / HALVES, side), -1, -1);
    }
}

static bool append(bst_keep_out_route *path, const bst_keep_out_arc *arc) {
    if (arc->length_rad <= 1e-15) {
        return true;
    }
    if (path->count == BST_PATH_ARCS) {
        return false;
    }
    path->arcs[path->count++] = *arc;
    path->length_rad += arc->length_rad;
    return true;
}

bool bst_keep_out_path(const bst_keep_out_zone *zones, int count, bst_vec3 from, bst_vec3 to,
                       bst_keep_out_route *out) {
    *out = (bst_keep_out_route){.left_zone = -1, .target_zone = -1, .arcs = {{.from = from}}};
    if (count < 0 || count > BST_ZONES) {
        return false;
    }
    double depth;
    bst_vec3 start, end;
    out->left_zone = bst_keep_out_inside(zones, count, from, &depth);
    out->target_zone = bst_keep_out_inside(zones, count, to, &depth);
    if (!bst_keep_out_nearest(zones, count, from, to, &start) ||
        !bst_keep_out_nearest(zones, count, to, start, &end)) {
        return false;
    }
    if (out->left_zone >= 0) {
        bst_keep_out_arc leave = great_circle(from, start);
        (void)append(out, &leave);
    }
    graph g = {.zones = zones, .zone_count = count};
    for (int i = 0; i < count; i++) {
        g.x[i] = bst_vec3_perpendicular(zones[i].axis);
        g.y[i] = bst_vec3_cross(zones[i].axis, g.x[i]);
    }
    (void)add_node(&g, start, -1, -1);
    (void)add_node(&g, end, -1, -1);
    if (bst_vec3_angle(start, end) > BST_PI - 1e-9) {
        add_halves(&g);
    } else {
        bst_keep_out_arc direct = great_circle(start, end);
        if (is_free(&g, &direct, -1)) {
            return append(out, &direct);
        }
    }
    add_tangents(&g);
    /* ends on an edge can be left along it */
    for (int e = 0; e < 2; e++) {
        for (int i = 0; i < count; i++) {
            double off = bst_vec3_angle(g.nodes[e].place, zones[i].axis) - zones[i].half_angle_rad;
            if (fabs(off) <= EDGE_RAD) {
                (void)add_node(&g, g.nodes[e].place, i, e);
            }
        }
    }
    if (!dijkstra(&g)) {
        *out = (bst_keep_out_route){
            .left_zone = out->left_zone, .target_zone = out->target_zone, .arcs = {{.from = from}}};
        return false;
    }
    int chain[NODES], links = 0;
    for (int i = 1; g.nodes[i].before >= 0; i = g.nodes[i].before) {
        chain[links++] = i;
    }
    bool fits = true;
    while (links > 0) {
        fits = append(out, &g.nodes[chain[--links]].arc) && fits;
    }
    return fits;
}

bst_vec3 bst_keep_out_route_at(const bst_keep_out_route *path, double s_rad, bst_vec3 *tangent,
                               bst_vec3 *bend) {
    *tangent = *bend = (bst_vec3){0.0, 0.0, 0.0};
    if (path->count == 0) {
        return path->arcs[0].from;
    }
    int i = 0;
    double s = fmin(fmax(s_rad, 0.0), path->length_rad);
    while (i < path->count - 1 && s > path->arcs[i].length_rad) {
        s -= path->arcs[i++].length_rad;
    }
    const bst_keep_out_arc *arc = &path->arcs[i];
    s = fmin(s, arc->length_rad);
    double rate = arc->turn_rad / arc->length_rad;
    bst_vec3 d = turned(arc->axis, s * rate, arc->from);
    *tangent = bst_vec3_scale(bst_vec3_cross(arc->axis, d), rate);
    *bend = bst_vec3_scale(bst_vec3_cross(arc->axis, *tangent), rate);
    return d;
}
